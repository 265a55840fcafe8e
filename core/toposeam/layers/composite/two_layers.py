"""Two layers joined, paths between layers applied, and in which order layers are joined."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toposeam.checks import check_kind, check_pair
from toposeam.errors import OptionError, OverlapError, PathError, Term
from toposeam.images import Mask
from toposeam.layers.canvas.layer import Box, Extent, Layer, cut
from toposeam.layers.canvas.painting import LabelMap, channel_count, paint
from toposeam.layers.canvas.tile_map import blocks, dense, is_empty, new_map
from toposeam.layers.labelling.posing import exclusive_covers, meets
from toposeam.layers.labelling.problem import Pair
from toposeam.seam.find import find_seam
from toposeam.seam.problem.natural import CELL
from toposeam.seam.result.seam import Seam, apply_paths
from toposeam.vector.svg import SvgSeam


class Steps:
    """Layers joined one after another; `label_map` says which one shows so far."""

    def __init__(
        self,
        layers: Sequence[Layer],
        canvas: Extent,
        channels: int | None,
        on_canvas: Mapping[str, Any],
        options: dict[str, Any],
    ) -> None:
        self._layers, self._canvas, self._channels = layers, canvas, channels
        self._on_canvas, self._options = on_canvas, options
        self.places = [canvas.place(layer) for layer in layers]
        self.covered = exclusive_covers(layers, self.places, canvas)
        for index, (layer, own) in enumerate(zip(layers, self.covered, strict=True)):
            if is_empty(own):
                x, y = layer.at
                raise OverlapError(
                    "{name} (at {x},{y}): the {patches} do not overlap: no pixel of it shows, as it "
                    "is transparent or masked everywhere, or others keep all of it; leave it out, or "
                    "check what is transparent or masked",
                    kind="apart",
                    layers=(index,),
                    name=layer.name,
                    x=x,
                    y=y,
                )
        self.label_map: LabelMap = new_map(canvas.shape, -1, np.int16)

    def join(self, index: int, options: Mapping[str, Any], drawing: SvgSeam | None = None) -> Seam:
        """The seam of the second of two layers with the first."""
        layer, place = self._layers[index], self.places[index]
        # All that matters lies where both are, and two pixels around: gradients and grounds end there. What
        # is a speck is counted there too, so that a drawn seam is applied to the box it was found in.
        box = place.shared(self.places[0]).grown(2)
        # Cells of the match cost begin at even pixels of the canvas.
        box = Box(box.top - box.top % CELL, box.left - box.left % CELL, *box[2:]).shared(self._canvas.box)
        if not all(place.shared(self.places[0]).shape):
            box = self._canvas.box
        if drawing is not None and (drawing.height, drawing.width) == self._canvas.shape:
            drawing = _on_box(drawing, box)
        elif drawing is not None:
            box = self._canvas.box  # where the drawing is refused
        covers = [cut(cover, at, box) for cover, at in zip(self.covered, self.places, strict=True)]
        first, second = (
            paint([one], [at], np.where(cover, np.int16(0), np.int16(-1)), box, self._channels)[0]
            for one, at, cover in zip(self._layers, self.places, covers, strict=True)
        )
        common: dict[str, Any] = {
            name: None if values is None else cut(values, self._canvas.box, box)
            for name, values in self._on_canvas.items()
        } | self._options
        try:
            if drawing is not None:
                seam = apply_paths(drawing, first, second, covers[0], covers[1], **common)
            else:
                seam = find_seam(first, second, covers[0], covers[1], **common, **options)
        except (OverlapError, PathError) as error:
            named = error.naming(a=self._layers[0].name, b=layer.name)
            if isinstance(error, PathError):
                raise named from error
            x, y = layer.at
            raise named.within("{name} (at {x},{y}): {error}", name=layer.name, x=x, y=y) from error
        self._show(seam, box)
        return moved_seam(seam, box, self._canvas, self.label_map, index)

    def _show(self, seam: Seam, box: Box) -> None:
        canvas = self._canvas.box
        for index, (place, cover) in enumerate(zip(self.places, self.covered, strict=True)):
            for part in blocks(place):
                here = cut(cover, place, part)
                before = self.label_map[part.slices]
                self.label_map[part.slices] = np.where(here, np.int16(index), before)
        shared = [cut(cover, place, box) for cover, place in zip(self.covered, self.places, strict=True)]
        labels = cut(self.label_map, canvas, box)
        both = shared[0] & shared[1]
        labels[both] = np.where(seam.labels[both], np.int16(1), np.int16(0))
        self.label_map[box.slices] = labels


def _on_box(drawing: SvgSeam, box: Box) -> SvgSeam:
    """A drawing on the canvas as one on a box of it."""
    corner = np.array([box.left, box.top], float)
    lines = tuple(dataclasses.replace(line, points=line.points - corner) for line in drawing.polylines)
    return dataclasses.replace(drawing, polylines=lines, height=box.shape[0], width=box.shape[1])


def moved_seam(seam: Seam, box: Box, canvas: Extent, label_map: LabelMap, index: int) -> Seam:
    """A seam on a box of the canvas as one on the canvas; `index` is the number of its second layer."""
    overlap = seam.problem.overlap
    start = overlap.start[0] + box.top, overlap.start[1] + box.left
    problem = dataclasses.replace(
        seam.problem, overlap=dataclasses.replace(overlap, start=start, canvas=canvas.shape)
    )
    return dataclasses.replace(seam, problem=problem, _only_b=lambda: dense(label_map) == index)


def paths_by_pair(
    given: SvgSeam | Mapping[Pair, SvgSeam] | None, count: int, name: str = "use_path"
) -> dict[Pair, SvgSeam]:
    """The given seams by pair, the lower number first; `name` is the caller's word for them."""
    if given is None:
        return {}
    if isinstance(given, SvgSeam):
        if count != 2:
            raise OptionError(
                "a path joins two layers, but {count} were given; say between which two it runs, as "
                "{{(0, 1): path}}",
                kind="count",
                parameter=Term(name),
                count=count,
            )
        return {(0, 1): given}
    check_kind(name, given, Mapping, "an SvgSeam, or one for each pair of layers")
    paths: dict[Pair, SvgSeam] = {}
    for pair, drawing in given.items():
        first, second = check_pair(name, pair, 0)
        check_kind(name, drawing, SvgSeam, "an SvgSeam for each pair of layers")
        if first >= count or second >= count or first == second:
            raise OptionError(
                "a path was given between layers {first} and {second}; choose two different ones from 0 to "
                "{last}",
                kind="choice",
                parameter=Term(name),
                value=pair,
                first=first,
                second=second,
                last=count - 1,
            )
        paths[min(first, second), max(first, second)] = drawing
    return paths


def divided(
    layers: Sequence[Layer], canvas: Extent, pair: Pair, drawing: SvgSeam, options: dict[str, Any]
) -> Mask:
    """(H, W) bool on the canvas, True where a given seam shows the second layer of its pair."""
    steps = Steps([layers[index] for index in pair], canvas, channel_count(layers), {}, options)
    try:
        return steps.join(1, {}, drawing).labels
    except PathError as error:
        first, second = (layers[index].name for index in pair)
        raise error.within(
            "between {first} and {second}: {error}", layers=pair, first=first, second=second
        ) from error


def order_of(layers: Sequence[Layer], places: Sequence[Box], covered: Sequence[Mask]) -> list[int]:
    """The layers in their order, each that overlaps none before it waiting until one does.

    Raises
    ------
    OverlapError
    """
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
