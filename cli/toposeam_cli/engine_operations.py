"""What the engine can be asked for: one function per operation, from a :class:`~toposeam_cli.engine.Job` to what goes into the result.

Places are in px of the asker's image. Every raster has its ``offset`` there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.layers.layer import Canvas
from toposeam.vector.svg import SvgSeam
from toposeam_cli.engine import Job

Floats = npt.NDArray[np.float64]

#: Farthest an editable path may lie from the seam, px: less than a pixel, so that the stairs of pixel corners become lines.
EDITABLE_PX = 0.75


def stitch(job: Job) -> dict[str, Any]:
    """Layers, first the lowest, joined along seams; one mask per layer and one entry per seam."""
    layers = _layers(job)
    options = job.options
    if job.request.get("seams") is not None:
        return _restitch(job, layers, job.request["seams"])
    stitched = ts.stitch(layers, avoid=_outside_selection(job, layers), progress=job.progress, **options)
    seams = [_seam(seam, stitched.origin, index, layers) for index, seam in enumerate(stitched.seams, start=1)]
    return {"masks": _masks(job, layers, stitched.masks, stitched.origin), "seams": seams}


def patch(job: Job) -> dict[str, Any]:
    """The second layer, where it is selected, laid on the first within a seam."""
    below, above = _layers(job)
    outside = _outside_selection(job, [above])
    if outside is not None:
        alpha = np.where(outside, np.zeros((), above.image.dtype), above.image.dtype.type(1) if above.alpha is None else above.alpha)
        above = dataclasses.replace(above, alpha=alpha)
    stitched = ts.stitch([below, above], progress=job.progress, **job.options)
    masks = _masks(job, [below, above], stitched.masks, stitched.origin)
    return {"masks": masks, "seams": [_seam(seam, stitched.origin, 1, [below, above]) for seam in stitched.seams]}


def _restitch(job: Job, layers: Sequence[ts.Layer], seams: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The layers joined along given paths, one entry of ``seams`` for each layer after the first."""
    canvas = ts.common_canvas(layers, ts.MAX_PIXELS)
    below = layers[0]
    owner = np.full(canvas.shape, -1, np.int16)
    owner[canvas.place(below)][below.covered] = 0
    found = []
    for index, (layer, entry) in enumerate(zip(layers[1:], seams, strict=True), start=1):
        joined = ts.stitch([below, layer], use_path=_drawing(entry, ts.common_canvas([below, layer], ts.MAX_PIXELS)))
        below = ts.Layer(image=joined.image, alpha=joined.alpha, offset=joined.origin, name=below.name)
        owner[canvas.place(below)][joined.masks[1]] = index
        found.append(_seam(joined.seams[0], joined.origin, index, layers))
        job.progress(index / len(seams))
    return {"masks": _masks(job, layers, [owner == index for index in range(len(layers))], canvas.origin), "seams": found}


def _drawing(entry: Mapping[str, Any], canvas: Canvas) -> SvgSeam:
    """The lines of a seam, on the canvas of the two pictures it joins."""
    lines = tuple(
        ts.Polyline(np.array(line["points"], float).reshape(-1, 2) - np.array(canvas.origin, float), bool(line["closed"]))
        for line in entry["lines"]
    )
    height, width = canvas.shape
    return SvgSeam(lines, width, height, None, (str(entry["name"]),) * len(lines))


def _layers(job: Job) -> list[ts.Layer]:
    """The layers of the request: color and alpha of one raster each, with a mask of its own multiplied in."""
    return [_layer(job, raster) for raster in job.request["layers"]]


def _layer(job: Job, raster: Mapping[str, Any]) -> ts.Layer:
    pixels = job.read(raster)
    alpha = pixels[..., -1]
    if raster.get("mask") is not None:
        hidden = job.read(raster["mask"]) == 0
        alpha = np.where(hidden, alpha.dtype.type(0), alpha)
    image = pixels[..., 0] if pixels.shape[2] == 2 else pixels[..., :-1]
    x, y = raster["offset"]
    return ts.Layer(image=image, alpha=alpha, offset=(int(x), int(y)), name=str(raster["name"]))


def _outside_selection(job: Job, layers: Sequence[ts.Layer]) -> npt.NDArray[np.bool_] | None:
    """(H, W) bool on the layers' canvas: what the selection leaves out; None without one."""
    raster = job.request.get("selection")
    if raster is None:
        return None
    canvas = ts.common_canvas(layers, ts.MAX_PIXELS)
    outside = np.ones(canvas.shape, bool)
    selected = job.read(raster) >= 128
    x, y = raster["offset"][0] - canvas.origin[0], raster["offset"][1] - canvas.origin[1]
    rows, columns = slice(max(y, 0), max(y + selected.shape[0], 0)), slice(max(x, 0), max(x + selected.shape[1], 0))
    part = outside[rows, columns]
    part[:] = ~selected[max(-y, 0) :, max(-x, 0) :][: part.shape[0], : part.shape[1]]
    return outside


def _masks(job: Job, layers: Sequence[ts.Layer], masks: Iterable[npt.NDArray[np.bool_]], origin: tuple[int, int]) -> list[dict[str, Any]]:
    """Each layer's mask, of the layer's own size, 255 where it shows."""
    written = []
    for layer, mask in zip(layers, masks, strict=True):
        height, width = layer.image.shape[:2]
        x, y = layer.offset[0] - origin[0], layer.offset[1] - origin[1]
        written.append(job.write(mask[y : y + height, x : x + width].astype(np.uint8) * np.uint8(255)))
    return written


def _seam(seam: ts.Seam, origin: tuple[int, int], layer: int, layers: Sequence[ts.Layer]) -> dict[str, Any]:
    """The seam round a layer as the asker needs it: exact lines, and the same with fewer points for people to bend."""
    lines = []
    for path in seam.paths:
        points = path.points + np.array(origin, float)
        lines.append({
            "closed": path.closed,
            "points": points.ravel().tolist(),
            "editable": simplified(points, path.closed, EDITABLE_PX).ravel().tolist(),
        })  # fmt: skip
    return {"name": layers[layer].name, "layer": layer, "lines": lines, "cost": seam.cost, "method": seam.method}


def simplified(points: Floats, closed: bool, tolerance: float) -> Floats:
    """A line with fewer points, nowhere farther than `tolerance` from the given one (Ramer, Douglas and Peucker).

    Parameters
    ----------
    points : (N, 2) float array
    closed : bool
        Whether the last point is joined to the first.
    tolerance : float
        px.

    Returns
    -------
    (M, 2) float array, a subset of the points with both ends; of a closed line at least three
    """
    if closed and len(points) > 3:
        # Two points that surely stay: the first and the one farthest from it.
        far = int(np.argmax(((points - points[0]) ** 2).sum(axis=1)))
        first = simplified(points[: far + 1], False, tolerance)
        second = simplified(np.concatenate([points[far:], points[:1]]), False, tolerance)
        ring = np.concatenate([first, second[1:-1]])
        return ring if len(ring) > 2 else points
    keep = np.zeros(len(points), bool)
    keep[[0, -1]] = True
    waiting = [(0, len(points) - 1)]
    while waiting:
        start, end = waiting.pop()
        if end - start < 2:
            continue
        chord = points[end] - points[start]
        inner = points[start + 1 : end] - points[start]
        along = np.clip(inner @ chord / max(float(chord @ chord), 1e-12), 0.0, 1.0)
        distance = np.hypot(*(inner - along[:, np.newaxis] * chord).T)
        worst = int(np.argmax(distance))
        if distance[worst] > tolerance:
            middle = start + 1 + worst
            keep[middle] = True
            waiting += [(start, middle), (middle, end)]
    return points[keep]


OPERATIONS: dict[str, Callable[[Job], dict[str, Any]]] = {"stitch": stitch, "patch": patch}
