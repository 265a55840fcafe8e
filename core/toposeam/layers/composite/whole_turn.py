"""Which of placed layers shows where on a canvas that goes all the way round."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, cast

from toposeam.arrays import Mask
from toposeam.checks import check_whole
from toposeam.errors import OptionError, Term
from toposeam.layers.blending.blend import Blend, Placed
from toposeam.layers.canvas.layer import Extent, Layer
from toposeam.layers.composite.composition_seams import Made
from toposeam.layers.composite.cylindrical import (
    Turned,
    band,
    best_cut,
    margin,
    round_canvas,
    turned,
    turned_gathered,
    turned_map,
    unrolled,
)
from toposeam.layers.composite.label_maps import Labelled, SeamSearch
from toposeam.layers.composite.two_layers import LayersOnCanvas, order_of
from toposeam.layers.labelling.posing import exclusive_covers, pose_labelling
from toposeam.layers.labelling.problem import Labelling, Pair
from toposeam.layers.search.local_search import find_potentials, refine
from toposeam.layers.search.multilevel import minimise
from toposeam.layers.search.problem import State
from toposeam.vector.svg import SvgSeam


def labelled_round(
    layers: Sequence[Layer], flat: Extent, search: SeamSearch, paths: Mapping[Pair, SvgSeam]
) -> Labelled:
    """Find which of placed layers shows where on a canvas that goes round.

    Parameters
    ----------
    layers : sequence of Layer
    flat : Extent
        The smallest canvas that holds them all.
    search : SeamSearch
        Its options say how wide the round canvas is.
    paths : mapping
        Refused, as are weights and pixels to be avoided.
    """
    options = search.options
    if options.weight is not None or options.avoid is not None or paths:
        raise OptionError(
            "{wrap} goes without {weight}, {avoid} and {paths}; leave them out",
            kind="conflict",
            paths=Term("use_path", "paths"),
        )
    LayersOnCanvas.of(layers, flat)  # refuses a layer that shows nowhere
    widest = max(2, int(options.max_megapixels * 1e6) // flat.shape[0])
    period = check_whole("wrap", options.wrap, 2, widest)
    canvas = round_canvas(layers, period)
    frame = Extent(origin=(0, 0), shape=canvas.shape)
    left, top = canvas.origin
    moved = [dataclasses.replace(layer, at=(layer.at[0] - left, layer.at[1] - top)) for layer in layers]

    def posed(start: int) -> tuple[Labelling, LayersOnCanvas]:
        parts = [turned(layer, period, start) for layer in moved]
        places = [frame.place(part) for part in parts]
        covered = exclusive_covers(parts, places, frame)
        labelling = pose_labelling(
            parts, frame, covered, core=options.core, speck=options.speck, match=search.match
        )
        return labelling, LayersOnCanvas(parts, frame, places, covered)

    cut_at, beside = best_cut(moved, period)
    labelling, ground = posed(cut_at)
    soft = options.blend == "soft"
    labels, report = minimise(search.problem(labelling), order_of(ground), options.max_rounds, soft)
    start = cut_at - period // 2
    labels = turned_map(labels, period, start - cut_at, period)
    if soft or beside > 1:
        problem, state = search.problem(posed(start)[0]), State(labels, band(frame.shape))
    if beside > 1:
        refine(problem, state, options.max_rounds)
    if soft:
        joint = find_potentials(problem, state)
        gathered = turned_gathered([(report.gathered, cut_at), (joint, start)], period)
        report = dataclasses.replace(report, gathered=gathered)
    labels = turned_map(labels, period, -start, period)
    labelling, ground = posed(0)
    made = Made(labelling, labels, report, [], search.recorded())
    found = Labelled(
        canvas=canvas, placed=ground.showing(labels), seam=made, pairs=made.pairs, rounds=report.rounds
    )
    return going_round(found, moved, options.blend)


def going_round(found: Labelled, layers: Sequence[Layer], blend: Blend) -> Labelled:
    """Add some of the other end on both sides of a round canvas, so that blending sees it, but for the blend
    "gradient", which goes round by itself. The layers are those on a canvas that begins at 0,0.
    """
    if blend == "gradient":
        return dataclasses.replace(found, goes_round=True)
    (height, period), placed = found.canvas.shape, found.placed
    beyond = margin(period)
    wide = Extent(origin=(-beyond, 0), shape=(height, period + 2 * beyond))
    longer = [unrolled(layer, period, beyond) for layer in layers]
    covered: list[Any] = [
        Turned(cover, place.left, period, -beyond, wide.shape[1])
        for cover, place in zip(placed.covered, placed.places, strict=True)
    ]
    both_sides = Placed(
        layers=longer,
        places=[wide.place(layer) for layer in longer],
        covered=cast("list[Mask]", covered),
        label_map=turned_map(placed.label_map, period, -beyond, wide.shape[1]),
    )
    return dataclasses.replace(found, placed=both_sides, begin=beyond, goes_round=True)
