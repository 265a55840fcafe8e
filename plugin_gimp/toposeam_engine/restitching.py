"""The engine's operation that joins layers anew: along paths that were bent, and round strokes that say which
layer shall show.

A stroke is obeyed where it was painted. Round the strokes that what shows does not obey yet, a window of the
canvas is joined anew; beyond it everything stays as it is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.arrays import Labels, Mask
from toposeam.layers.canvas.layer import Box, Extent
from toposeam.vector.polyline import trace_boundary
from toposeam.vector.svg import SvgSeam
from toposeam_engine.job import EngineJob
from toposeam_engine.layers import (
    blending,
    changes_of,
    labels_raster,
    layers_of,
    masks_of,
    place_of,
)
from toposeam_engine.lines import lines_of

#: A window reaches so many px beyond the strokes, or as far again as they reach.
_LEAST_MARGIN = 160
#: At the window's border so many px stay as they are.
_RING = 2
#: A stroke counts from this opacity on, of 255.
_OPAQUE = 64


def restitch(job: EngineJob) -> dict[str, Any]:
    """Join layers along given paths, and round what was painted on hints and masks.

    Each pair whose path was touched divides anew what the two of them show; of two layers that were moved
    since, any path does.
    """
    layers, options = layers_of(job), blending(job.options)
    cost = options.pop("cost", None)
    canvas = ts.layers.common_canvas(layers)
    written = _written(job, canvas)
    kept = written is not None and bool(job.request.get("masks_kept"))
    shown = written if kept and written is not None else _shown(job, layers, canvas)
    moved = len(layers) == 2 and written is None
    seams = [seam for seam in job.request["seams"] if seam["touched"] or moved]
    before = shown if written is None else written
    paths = {(int(seam["pair"][0]), int(seam["pair"][1])): _drawing(seam, canvas) for seam in seams}
    labels = before
    if paths:
        labels = ts.layers.restitch(layers, _masks(before, len(layers)), paths).label_map
    job.progress(0.2)
    wanted = _strokes(job, layers, canvas)
    painted = None if kept or written is None else (shown != written) & (shown >= 0)
    if painted is not None:
        wanted[painted] = shown[painted]
    wrong = (wanted >= 0) & (labels != wanted)
    searched = bool(wrong.any())
    if searched:
        labels = _joined_round(layers, canvas, labels, wanted, wrong, cost, str(options.get("blend", "none")))
    job.progress(0.6)
    blended = None
    if options.get("blend", "none") != "none":
        found = ts.layers.restitch(layers, _masks(labels, len(layers)), {}, **options)
        blended = changes_of(job, layers, found, canvas)
    result = {
        "masks": masks_of(job, layers, labels, canvas),
        "blended": blended,
        "labels": labels_raster(job, labels, canvas),
        "seams": _seams(layers, canvas, labels, job.request["seams"]) if searched else None,
        "hints": _hints(job, canvas, wanted) if painted is not None and painted.any() else None,
    }
    job.progress(1.0)
    return result


def _shown(job: EngineJob, layers: Sequence[ts.Layer], canvas: Extent) -> Labels:
    """(H, W), the number of the uppermost layer that its mask lets be seen; -1 where there is none."""
    labels: Labels = np.full(canvas.shape, -1, np.int16)
    for index, (layer, raster) in enumerate(zip(layers, job.request["shown"], strict=True)):
        here = labels[canvas.place(layer).slices]
        seen = layer.covered if raster is None else layer.covered & (job.read(raster) >= 128)
        here[seen] = index
    return labels


def _written(job: EngineJob, canvas: Extent) -> Labels | None:
    """(H, W), what the masks said when they were written; None where layers were moved since."""
    raster = job.request.get("written")
    if raster is None or place_of(raster) != canvas.origin:
        return None
    counted = job.read(raster)
    if counted.shape != canvas.shape:
        return None
    labels: Labels = np.subtract(counted, 1, dtype=np.int16, casting="unsafe")
    return labels


def _masks(labels: Labels, count: int) -> list[Mask]:
    return [labels == index for index in range(count)]


def _strokes(job: EngineJob, layers: Sequence[ts.Layer], canvas: Extent) -> Labels:
    """(H, W), the number of the layer that a stroke wants to be seen, -1 elsewhere: that of the colour which
    is most alike.
    """
    wanted: Labels = np.full(canvas.shape, -1, np.int16)
    raster = job.request.get("hints")
    if raster is None:
        return wanted
    pixels = job.read(raster)
    place = canvas.place(ts.Layer(pixels[..., 0], at=place_of(raster)))
    common = place.shared(canvas.box)
    if not all(common.shape):
        return wanted
    inside = pixels[common.within(place)]
    rows, columns = np.nonzero(inside[..., 3] >= _OPAQUE)
    colours = np.array(job.request["colours"], np.int32)
    far = ((inside[rows, columns, None, :3].astype(np.int32) - colours) ** 2).sum(axis=2)
    here = wanted[common.slices]
    here[rows, columns] = far.argmin(axis=1).astype(np.int16)
    for index, layer in enumerate(layers):
        part = _part(layer, canvas, common)
        own = np.zeros(common.shape, bool)
        if part is not None:
            shared = canvas.place(part).shared(common)
            own[shared.within(common)] = part.covered
        here[(here == index) & ~own] = -1
    return wanted


class _Window(NamedTuple):
    box: Box
    #: (h, w) pixels at its border, beyond which things stay as they are.
    ring: Mask


def _window(wrong: Mask, canvas: Extent) -> _Window:
    """What is joined anew round strokes."""
    rows, columns = (np.flatnonzero(wrong.any(axis=axis)) for axis in (1, 0))
    tight = Box(int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1)
    box = tight.grown(max(_LEAST_MARGIN, *tight.shape)).shared(canvas.box)
    ring = np.zeros(box.shape, bool)
    for edge, limit, part in (
        (box.top, 0, np.s_[:_RING]),
        (box.left, 0, np.s_[:, :_RING]),
        (box.bottom, canvas.box.bottom, np.s_[-_RING:]),
        (box.right, canvas.box.right, np.s_[:, -_RING:]),
    ):
        if edge != limit:
            ring[part] = True
    return _Window(box, ring)


def _joined_round(
    layers: Sequence[ts.Layer],
    canvas: Extent,
    labels: Labels,
    wanted: Labels,
    wrong: Mask,
    cost: ts.seam.MatchCost | None,
    blend: str,
) -> Labels:
    """(H, W), what shows when the strokes are obeyed."""
    box, ring = _window(wrong, canvas)
    old, want = labels[box.slices], wanted[box.slices]
    fixed = np.where(want >= 0, want, np.where(ring, old, np.int16(-1)))
    numbers, parts = [], []
    seen = set(np.unique(old[old >= 0]).tolist()) | set(np.unique(want[want >= 0]).tolist())
    for index in sorted(seen):
        part = _part(layers[index], canvas, box, fixed == index)
        if part is not None:
            numbers.append(index)
            parts.append(part)
    result = labels.copy()
    here = result[box.slices]
    try:
        composed = ts.layers.compose(parts, cost=cost, blend="none" if blend == "soft" else blend)  # type: ignore[arg-type]
    except ts.OverlapError:  # what is painted alone, where there is no way round it
        here[want >= 0] = want[want >= 0]
        return result
    found = composed.labels(slice(None), slice(None))
    place = Box(0, 0, *found.shape).moved(
        composed.origin[1] - canvas.origin[1] - box.top, composed.origin[0] - canvas.origin[0] - box.left
    )
    inside = here[place.slices]
    inside[found >= 0] = np.array(numbers, np.int16)[found[found >= 0]]
    return result


def _part(layer: ts.Layer, canvas: Extent, box: Box, keep: Mask | None = None) -> ts.Layer | None:
    """What a window of the canvas cuts out of a layer, which may have to show in some places."""
    place = canvas.place(layer)
    common = place.shared(box)
    if not all(common.shape):
        return None
    own = common.within(place)
    part = dataclasses.replace(
        layer.bare,
        image=np.asarray(layer.image)[own],
        alpha=None if layer.alpha is None else np.asarray(layer.alpha)[own],
        at=(canvas.origin[0] + common.left, canvas.origin[1] + common.top),
    )
    covered = part.covered
    if keep is not None and (kept := keep[common.within(box)] & covered).any():
        part = dataclasses.replace(part, keep=kept)
    return part if covered.any() else None


def _seams(
    layers: Sequence[ts.Layer], canvas: Extent, labels: Labels, before: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return the seams of a label map, as the asker needs them, with what is the same of those before."""
    known = {(int(seam["pair"][0]), int(seam["pair"][1])): seam["known"] for seam in before}
    pairs: set[tuple[int, int]] = set()
    for first, second in ((labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:])):
        step = first != second
        sides = np.sort(np.stack([first[step], second[step]]), axis=0)
        pairs |= {(int(i), int(j)) for i, j in np.unique(sides[:, sides[0] >= 0], axis=1).T}
    seams = []
    for pair in sorted(pairs):
        places = [canvas.place(layers[index]) for index in pair]
        common = places[0].shared(places[1])
        if not all(common.shape):
            continue
        own = labels[common.slices]
        ground = (own == pair[0]) | (own == pair[1])
        for index, place in zip(pair, places, strict=True):
            ground &= layers[index].covered[common.within(place)]
        shift = np.array([common.left + canvas.origin[0], common.top + canvas.origin[1]], float)
        traced = trace_boundary(own == pair[1], ground)
        if traced:
            name = ts.layers.pair_name(*(layers[index].name for index in pair))
            seams.append({"pair": pair, "name": name, "lines": lines_of(traced, shift, known.get(pair, ()))})
    return seams


def _hints(job: EngineJob, canvas: Extent, wanted: Labels) -> dict[str, Any]:
    """Strokes, with what was painted on masks, as a picture of the colours of layers."""
    rows, columns = (np.flatnonzero((wanted >= 0).any(axis=axis)) for axis in (1, 0))
    box = np.s_[int(rows[0]) : int(rows[-1]) + 1, int(columns[0]) : int(columns[-1]) + 1]
    colours = np.array([*job.request["colours"], [0, 0, 0]], np.uint8)
    shown = wanted[box]
    picture = np.dstack([colours[shown], np.where(shown >= 0, np.uint8(255), np.uint8(0))])
    at = [canvas.origin[0] + int(columns[0]), canvas.origin[1] + int(rows[0])]
    return {**job.write(picture), "at": at}


def _drawing(entry: Mapping[str, Any], canvas: Extent) -> SvgSeam:
    """Return the lines of a seam, on the canvas."""
    shift = np.array(canvas.origin, float)
    lines = tuple(
        ts.vector.Polyline(np.array(line["points"], float).reshape(-1, 2) - shift, bool(line["closed"]))
        for line in entry["lines"]
    )
    height, width = canvas.shape
    return SvgSeam(lines, width, height, None, (str(entry["name"]),) * len(lines))
