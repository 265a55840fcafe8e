"""Label maps of more than two layers, by rounds of expansions, on flat canvases and round ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from toposeam.arrays import Mask
from toposeam.errors import OptionError, OverlapError, PathError, Term
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.cylinder import turned_map
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import made_map
from toposeam.layers.composite.options import SeamSearch
from toposeam.layers.composite.seams_of_map import SeamsOfMap
from toposeam.layers.composite.two_layers import join
from toposeam.layers.labelling.label_map import LabelMap, Pair
from toposeam.layers.labelling.posing import meets
from toposeam.layers.search.multilevel import minimise
from toposeam.vector.svg import SvgSeam

#: A round canvas is searched again in a band round its cut. The band reaches 1 / _BAND_SHARE of the width to
#: either side, so that the seams near the cut can move; it holds at most _BAND_PIXELS pixels, which bounds
#: the time, but reaches at least _LEAST_BAND_HALF px to either side.
_BAND_SHARE, _BAND_PIXELS, _LEAST_BAND_HALF = 16, 150_000, 32


def by_rounds(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam], maps: Mapping[str, Any]
) -> tuple[LabelMap, SeamsOfMap]:
    """Search the label map of a flat canvas; `maps` are weights and pixels to be avoided."""
    common = search.common(canvas)
    given = [(pair, divided(canvas, pair, drawing, common)) for pair, drawing in paths.items()]
    labelling, lost = search.struck(search.pose(canvas, given=given, **maps), canvas)
    start = search.preview_on(*canvas.origin)
    found = minimise(search.problem(labelling), order_of(canvas), search.options.max_rounds, start)
    found = dataclasses.replace(found, lost_strokes=lost)
    seams = SeamsOfMap(labelling, found, list(paths), search.recorded())
    if maps["avoid"] is not None:  # strokes hold as far as they can, as while one paints
        seams.check(search.options.executor)
    return found, seams


def by_cutting_open(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam]
) -> tuple[LabelMap, SeamsOfMap]:
    """Search a round canvas as a flat one, cut open at the column on which fewest layers lie.

    If one layer lies at the cut, no seam crosses it. If several do, the labels in a band round the cut are
    searched again, and all others stay.
    """
    options, period = search.options, canvas.shape[1]
    if options.weight is not None or options.avoid is not None or paths:
        raise OptionError(
            "{wrap} goes without {weight}, {avoid} and {paths}; leave them out",
            kind="conflict",
            paths=Term("use_path", "paths"),
        )
    half = max(8, min(period // _BAND_SHARE, max(_LEAST_BAND_HALF, _BAND_PIXELS // (2 * canvas.shape[0]))))
    column, beside = canvas.sparsest_column(away=half)
    opened = canvas.cut_open(column)
    labelling = search.pose(opened)
    start = search.preview_on(canvas.origin[0] + column, canvas.origin[1])
    found = minimise(search.problem(labelling), order_of(opened), options.max_rounds, start, period)
    if column:
        labels = turned_map(found.labels, period, -column, period)
        found, labelling = dataclasses.replace(found, labels=labels), search.pose(canvas.cut_open())
    labelling, lost = search.struck(labelling, canvas)
    if options.strokes:
        found = dataclasses.replace(search.recut(labelling, found), lost_strokes=lost)
    if beside > 1:
        band = _columns(canvas.shape, column - half, column + half)
        found = search.recut(labelling, found, band)
    return found, SeamsOfMap(labelling, found, (), search.recorded())


def _columns(shape: tuple[int, int], left: int, right: int) -> Mask:
    """Return an (H, W) bool map that is True in a range of columns."""

    def values(box: Box) -> Mask:
        columns = np.arange(box.left, box.right)
        return np.broadcast_to((columns >= left) & (columns < right), box.shape)

    return made_map(shape, bool, values)


def divided(canvas: Canvas, pair: Pair, drawing: SvgSeam, common: Mapping[str, Any]) -> Mask:
    """Apply a given seam; return the (H, W) bool mask of the canvas where it shows the second layer."""
    first, second = (canvas.layers[index] for index in pair)
    try:
        return join(canvas.of_layers(pair), common, {}, drawing)[0].labels
    except PathError as error:
        raise error.within(
            "between {first} and {second}: {error}", layers=pair, first=first.name, second=second.name
        ) from error


def order_of(canvas: Canvas) -> list[int]:
    """Order the layers so that each overlaps one before it; otherwise their order is kept.

    Raises
    ------
    OverlapError
    """
    layers, places, covered = canvas.layers, canvas.places, canvas.covers
    order, waiting = [0], list(range(1, len(layers)))
    while waiting:
        index = next((k for k in waiting if any(meets(places, covered, k, j) for j in order)), None)
        if index is None:
            x, y = layers[waiting[0]].at
            hidden = any(each.alpha is not None or each.mask is not None for each in layers)
            raise OverlapError(
                "{name} (at {x},{y}): the {patches} do not overlap: no pixel of it is covered by "
                "another one; move it, or check where they lie{hidden}",
                kind="apart",
                layers=(waiting[0],),
                name=layers[waiting[0]].name,
                x=x,
                y=y,
                hidden=" and what is transparent or masked" if hidden else "",
            )
        waiting.remove(index)
        order.append(index)
    return order
