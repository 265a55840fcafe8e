"""Join two layers along one seam that is searched or given; order more layers for joining one by one."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from toposeam.arrays import Labels
from toposeam.checks import check_kind, check_pair
from toposeam.errors import OptionError, OverlapError, PathError, Term
from toposeam.layers.canvas.canvas import Canvas, channel_count, paint
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import blocks, dense, new_map
from toposeam.layers.labelling.label_map import Pair
from toposeam.seam.find import find_seam
from toposeam.seam.problem.natural import CELL
from toposeam.seam.result.seam import Seam

if TYPE_CHECKING:
    from toposeam.vector.svg import SvgSeam

#: Options that are arrays on the canvas, of which the box of the overlap is cut out.
_ARRAY_OPTIONS = ("weight", "avoid")


def join(
    two: Canvas,
    common: Mapping[str, Any],
    settings: Mapping[str, Any],
    drawing: SvgSeam | None = None,
) -> tuple[Seam, Labels]:
    """Find the seam of the second of two layers with the first, or apply a drawn one.

    Parameters
    ----------
    two : Canvas
    common : mapping
        Options of :func:`toposeam.find_seam` that also apply to a drawn seam; `weight` and `avoid` on the
        canvas.
    settings : mapping
        The other options of :func:`toposeam.find_seam`.
    drawing : SvgSeam, optional
        On the canvas.

    Returns
    -------
    Seam
        On the canvas.
    (H, W) int16 array
        The label map.
    """
    canvas, (place_a, place_b) = two.box, two.places
    # Specks are measured in this box too, so a drawn seam must be applied to the box in which it was found.
    box = two.seam_box(CELL)
    if not all(place_b.shared(place_a).shape):
        box = canvas
    if drawing is not None and (drawing.height, drawing.width) == two.shape:
        drawing = _on_box(drawing, box)
    elif drawing is not None:
        box = canvas  # on which the drawing is refused
    cover_a, cover_b = (cut(cover, at, box) for cover, at in zip(two.covers, two.places, strict=True))
    channels = channel_count(two.layers)
    first, second = (
        paint([one], [at], np.where(cover, np.int16(0), np.int16(-1)), box, channels)[0]
        for one, at, cover in zip(two.layers, two.places, (cover_a, cover_b), strict=True)
    )
    maps = {name: cut(common[name], canvas, box) for name in _ARRAY_OPTIONS if common.get(name) is not None}
    here = {**common, **maps}
    try:
        if drawing is not None:
            from toposeam.seam.result.seam import apply_paths

            seam = apply_paths(drawing, first, second, cover_a, cover_b, **here)
        else:
            seam = find_seam(first, second, cover_a, cover_b, **here, **settings)
    except (OverlapError, PathError) as error:
        a, b = two.layers
        named = error.naming(a=a.name, b=b.name)
        if isinstance(error, PathError):
            raise named from error
        x, y = b.at
        raise named.within("{name} (at {x},{y}): {error}", name=b.name, x=x, y=y) from error
    label_map = _shown(two, seam, box)
    return moved_seam(seam, box, two.shape, label_map, 1), label_map


def _shown(two: Canvas, seam: Seam, box: Box) -> Labels:
    """Compute the label map of two layers and their seam on a box of the canvas."""
    label_map: Labels = new_map(two.shape, -1, np.int16)
    for index, (place, cover) in enumerate(zip(two.places, two.covers, strict=True)):
        for part in blocks(place):
            before = label_map[part.slices]
            label_map[part.slices] = np.where(cut(cover, place, part), np.int16(index), before)
    first, second = (cut(cover, place, box) for cover, place in zip(two.covers, two.places, strict=True))
    labels, both = cut(label_map, two.box, box), first & second
    np.copyto(labels, seam.labels != 0, where=both)
    label_map[box.slices] = labels
    return label_map


def _on_box(drawing: SvgSeam, box: Box) -> SvgSeam:
    """Convert a drawing on the canvas to one on a box of it."""
    corner = np.array([box.left, box.top], float)
    lines = tuple(dataclasses.replace(line, points=line.points - corner) for line in drawing.polylines)
    return dataclasses.replace(drawing, polylines=lines, height=box.shape[0], width=box.shape[1])


def moved_seam(seam: Seam, box: Box, shape: tuple[int, int], label_map: Labels, index: int) -> Seam:
    """Return a seam on a box of a canvas as one on the canvas; `index` is the number of its second layer."""
    overlap = seam.problem.overlap
    start = overlap.start[0] + box.top, overlap.start[1] + box.left
    problem = dataclasses.replace(
        seam.problem, overlap=dataclasses.replace(overlap, start=start, canvas=shape)
    )
    return dataclasses.replace(seam, problem=problem, _only_b=lambda: dense(label_map) == index)


def paths_by_pair(
    given: SvgSeam | Mapping[Pair, SvgSeam] | None, count: int, name: str = "use_path"
) -> dict[Pair, SvgSeam]:
    """Return the given seams by pair, the lower number first.

    `name` is the parameter that errors name.
    """
    if given is None:
        return {}
    from toposeam.vector.svg import SvgSeam

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
