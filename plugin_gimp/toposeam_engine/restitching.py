"""The operation that joins layers again, along paths that were bent and round strokes
(:func:`toposeam.layers.restitch`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.arrays import Labels
from toposeam.images import box_of
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam.vector.svg import SvgSeam
from toposeam_engine.job import EngineJob
from toposeam_engine.kept import Kept, kept_of, unpacked
from toposeam_engine.layers import (
    blending,
    changes_of,
    layers_of,
    masks_of,
    place_of,
)
from toposeam_engine.lines import lines_of

#: Least opacity of a stroke, of 255: fainter pixels, as at the rim of a brush, are ignored.
_LEAST_OPACITY = 64


def restitch(job: EngineJob) -> dict[str, Any]:
    """Join layers along given paths, and round strokes on hints and masks.

    Each path that was edited divides the pixels that its pair shows. If two layers were moved since they were
    joined, every path does. A request to `look` is answered by the places where seams may be noticed. One may
    hold only a window of layers that stayed, with the box (`within`) in which pixels may change; if more
    would have to, the answer is to ask again, with everything.
    """
    layers, options = layers_of(job), blending(job.options)
    canvas, within = ts.layers.common_canvas(layers), _box(job.request.get("within"))
    known = None if job.request.get("written") is None else unpacked(job, job.request["written"])
    written = None if known is None else _written(known, canvas, whole=within is None)
    kept = written is not None and bool(job.request.get("masks_kept"))
    shown = written if kept and written is not None else _shown(job, layers, canvas)
    moved = len(layers) == 2 and written is None
    seams = [seam for seam in job.request["seams"] if seam["touched"] or moved]
    before = shown if written is None else written
    paths = {(int(seam["pair"][0]), int(seam["pair"][1])): _drawing(seam, canvas) for seam in seams}
    job.progress(0.2)
    wanted = _strokes(job, canvas)
    painted = None if kept or written is None else (shown != written) & (shown >= 0)
    if painted is not None:
        wanted[painted] = shown[painted]
    masks = [before == index for index in range(len(layers))]
    found = ts.layers.restitch(layers, masks, paths, fixed=wanted, cut_out=within is not None, **options)
    if job.request.get("look"):
        return {"places": _places(found, canvas)}
    labels, searched = found.label_map, found.solution.method not in ("masks", "path")
    job.progress(0.6)
    blends, near = options.get("blend", "none") != "none", None
    if within is None or known is None:
        now = kept_of(layers, labels, canvas)
    else:
        inner = within.moved(-canvas.origin[1], -canvas.origin[0]).shared(canvas.box)
        now, changed = known.with_labels(canvas, labels), labels != before
        searched = bool(changed.any())
        if searched:
            near = Box.of(*box_of(changed))
            if near.around(inner) != inner:
                return {"again": True}
            near = near.grown(found.blending.margin).shared(inner)
        blends = blends and searched
    result = {
        "masks": masks_of(job, layers, labels, canvas, every=within is not None),
        "blended": changes_of(job, layers, found, canvas, near) if blends else None,
        "labels": now.pack(job),
        "margin": [found.blending.margin, found.blending.grid],
        "seams": _seams(now.traced() if within else found, job.request["seams"]) if searched else None,
        "hints": _hints(job, canvas, wanted) if painted is not None and painted.any() else None,
        "beyond": _beyond(job, layers, wanted, labels, canvas),
    }
    job.progress(1.0)
    return result


def _places(found: ts.layers.Composition, canvas: Canvas) -> list[list[int]]:
    """Return where seams may be noticed, on the asker's canvas; those of the most visible seam first."""
    verdicts = sorted(found.verdicts().values(), key=lambda verdict: -verdict.visibility)
    (left, top), height_width = canvas.origin, canvas.shape
    places = [place for verdict in verdicts for place in verdict.places]
    inside = [(x, y) for x, y in places if 0 <= x < height_width[1] and 0 <= y < height_width[0]]
    return [[left + x, top + y] for x, y in inside]


def _box(given: Sequence[int] | None) -> Box | None:
    if given is None:
        return None
    left, top, width, height = given
    return Box(top, left, top + height, left + width)


def _shown(job: EngineJob, layers: Sequence[ts.Layer], canvas: Canvas) -> Labels:
    """(H, W): the number of the uppermost layer that its mask shows, -1 where there is none."""
    labels: Labels = np.full(canvas.shape, -1, np.int16)
    for index, (layer, raster) in enumerate(zip(layers, job.request["shown"], strict=True)):
        here = labels[canvas.place(layer).slices]
        visible = layer.covered if raster is None else layer.covered & (job.read(raster) >= 128)
        here[visible] = index
    return labels


def _written(known: Kept, canvas: Canvas, *, whole: bool) -> Labels | None:
    """(H, W): the labels of the masks as they were written; None if layers were moved since."""
    if whole and known.whole != canvas.frame:
        return None
    return known.on(canvas)


def _strokes(job: EngineJob, canvas: Canvas) -> Labels:
    """(H, W): the number of the layer whose colour is nearest to that of a stroke, -1 without a stroke."""
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
    rows, columns = np.nonzero(inside[..., 3] >= _LEAST_OPACITY)
    colours = np.array(job.request["colours"], np.int32)
    far = ((inside[rows, columns, None, :3].astype(np.int32) - colours) ** 2).sum(axis=2)
    here = wanted[common.slices]
    here[rows, columns] = far.argmin(axis=1).astype(np.int16)
    return wanted


def _beyond(
    job: EngineJob, layers: Sequence[ts.Layer], wanted: Labels, labels: Labels, canvas: Canvas
) -> list[int]:
    """Return, per layer, the number of pixels where new strokes ask for it and it has none, but another one
    shows.
    """
    counts = [0] * len(layers)
    news = _box(job.request.get("news"))
    if news is None:
        return counts
    box = news.moved(-canvas.origin[1], -canvas.origin[0]).shared(canvas.box)
    asked = np.where(labels[box.slices] >= 0, wanted[box.slices], -1)
    for index, (place, cover) in enumerate(zip(canvas.places, canvas.covers, strict=True)):
        counts[index] = int(np.count_nonzero((asked == index) & ~cut(cover, place, box)))
    return counts


def _seams(found: ts.layers.Composition, before: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the seams of a label map for GIMP; where a line is the same as before, its curves are kept."""
    known = {(int(seam["pair"][0]), int(seam["pair"][1])): seam["known"] for seam in before}
    corner = np.array(found.origin, float)
    return [
        {
            "pair": seam.pair,
            "name": ts.layers.pair_name(*(found.names[index] for index in seam.pair)),
            "lines": lines_of(seam.paths, corner, known.get(seam.pair, ())),
        }
        for seam in found.outlines
        if seam.paths
    ]


def _hints(job: EngineJob, canvas: Canvas, wanted: Labels) -> dict[str, Any]:
    """Return the strokes, with those painted on masks, as a raster in the colours of the layers."""
    rows, columns = (np.flatnonzero((wanted >= 0).any(axis=axis)) for axis in (1, 0))
    box = np.s_[int(rows[0]) : int(rows[-1]) + 1, int(columns[0]) : int(columns[-1]) + 1]
    colours = np.array([*job.request["colours"], [0, 0, 0]], np.uint8)
    shown = wanted[box]
    picture = np.dstack([colours[shown], np.where(shown >= 0, np.uint8(255), np.uint8(0))])
    at = [canvas.origin[0] + int(columns[0]), canvas.origin[1] + int(rows[0])]
    return {**job.write(picture), "at": at}


def _drawing(entry: Mapping[str, Any], canvas: Canvas) -> SvgSeam:
    """Convert a seam of the request to lines on the canvas."""
    shift = np.array(canvas.origin, float)
    lines = tuple(
        ts.vector.Polyline(np.array(line["points"], float).reshape(-1, 2) - shift, bool(line["closed"]))
        for line in entry["lines"]
    )
    height, width = canvas.shape
    return SvgSeam(lines, width, height, None, (str(entry["name"]),) * len(lines))
