"""What the engine can be asked for about seams: functions from a :class:`~toposeam_cli.engine.Job` to what goes into the result.

Places are in px of the asker's image. Every raster has its ``offset`` there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import Image, full_scale
from toposeam.layers.blend import Placed, blend_seams
from toposeam.layers.layer import Canvas
from toposeam.layers.painting import channel_count, paint
from toposeam.layers.tones import match_tones
from toposeam.vector.svg import SvgSeam
from toposeam_cli.engine import Job

Floats = npt.NDArray[np.float64]

#: Farthest an editable path may lie from the seam, px: less than a pixel, so that the stairs of pixel corners become lines.
EDITABLE_PX = 0.75


def stitch(job: Job) -> dict[str, Any]:
    """Layers, first the lowest, joined along seams: masks, seams, the layers in matched tones, and what blending changes."""
    layers = _layers(job)
    options = _blending(job.options)
    result: dict[str, Any] = {}
    if options.pop("match_tones", False):
        canvas = ts.common_canvas(layers, ts.MAX_PIXELS)
        layers = match_tones(layers, [canvas.place(layer) for layer in layers])
        result["pixels"] = [job.write(_with_alpha(layer.image, layer.alpha)) for layer in layers]
    stitched = ts.stitch(layers, avoid=_outside_selection(job, layers), progress=job.progress, **options)
    return result | _joined(job, layers, stitched)


def patch(job: Job) -> dict[str, Any]:
    """The second layer, where it is selected, laid on the first within a seam."""
    below, above = _layers(job)
    outside = _outside_selection(job, [above])
    if outside is not None:
        above = dataclasses.replace(above, mask=~outside)
    stitched = ts.stitch([below, above], progress=job.progress, **_blending(job.options))
    return _joined(job, [below, above], stitched)


def restitch(job: Job) -> dict[str, Any]:
    """Layers joined along given paths.

    Of two layers the paths say everything. Of more, each pair whose path was touched divides anew what the two of them show.
    """
    layers = _layers(job)
    canvas = ts.common_canvas(layers, ts.MAX_PIXELS)
    places = [canvas.place(layer) for layer in layers]
    covered = [layer.covered for layer in layers]
    owner = np.full(canvas.shape, -1, np.int16)
    for index, (place, shown) in enumerate(zip(places, job.request["shown"], strict=True)):
        there = owner[place.slices]
        there[covered[index] & ((there < 0) | (job.read(shown) >= 128))] = index
    for seam in job.request["seams"]:
        if len(layers) > 2 and not seam["touched"]:
            continue
        pair = [int(index) for index in seam["pair"]]
        both = []
        for index in pair:
            held = True if len(layers) == 2 else np.isin(owner[places[index].slices], pair)
            both.append(dataclasses.replace(layers[index], mask=covered[index] & held))
        drawing = _drawing(seam, ts.common_canvas(both, ts.MAX_PIXELS))
        joined = ts.stitch(both, use_path=drawing)
        at = canvas.place(ts.Layer(image=joined.image, offset=joined.origin))
        for index, mask in zip(pair, joined.masks, strict=True):
            owner[at.slices][mask] = index
    masks = [owner == index for index in range(len(layers))]
    result: dict[str, Any] = {"masks": _masks(job, layers, masks, canvas.origin)}
    options = _blending(job.options)
    blend: ts.Blend = options.get("blend", "none")
    if blend == "soft":  # a line drawn by hand has no potential
        blend = "feather"
    if blend != "none":
        image, alpha = paint(layers, places, owner, canvas.box, channel_count(layers))
        placed = Placed(layers=layers, places=places, covered=covered, owner=owner)
        blend_seams(placed, (), image, alpha, blend, options.get("blend_width"))
        result["blended"] = _changes(job, layers, masks, image, alpha, canvas)
    return result


def _joined(job: Job, layers: Sequence[ts.Layer], stitched: ts.Stitched) -> dict[str, Any]:
    canvas = ts.common_canvas(layers, ts.MAX_PIXELS)
    alpha = stitched.alpha if stitched.alpha is not None else np.broadcast_to(full_scale(stitched.image.dtype), canvas.shape)
    seams = [
        {
            "pair": pair,
            "name": ts.pair_name(*(stitched.names[index] for index in pair)),
            "lines": _lines(seam, stitched.origin),
            "cost": seam.cost,
            "method": seam.method,
        }
        for pair, seam in zip(stitched.pairs, stitched.seams, strict=True)
    ]
    return {
        "masks": _masks(job, layers, stitched.masks, stitched.origin),
        "seams": seams,
        "blended": _changes(job, layers, stitched.masks, stitched.image, alpha, canvas),
    }


def _changes(
    job: Job, layers: Sequence[ts.Layer], masks: Sequence[npt.NDArray[np.bool_]], image: Image, alpha: Image, canvas: Canvas
) -> dict[str, Any] | None:
    """The pixels in which the composite differs from the layers under their masks, transparent elsewhere; None if it does not differ."""
    changed = np.zeros(canvas.shape, bool)
    for layer, mask in zip(layers, masks, strict=True):
        place = canvas.place(layer)
        for top in range(place.top, place.bottom, 256):
            part = np.s_[top : min(top + 256, place.bottom), place.left : place.right]
            own = layer.image[part[0].start - place.top : part[0].stop - place.top]
            seen = image[part]
            differs = seen != (own if own.ndim == seen.ndim else own[..., np.newaxis])
            changed[part] |= (differs if differs.ndim == 2 else differs.any(axis=2)) & mask[part]
    if not changed.any():
        return None
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    top, left = int(rows[0]), int(columns[0])
    box = np.s_[top : int(rows[-1]) + 1, left : int(columns[-1]) + 1]
    raster = job.write(_with_alpha(image[box], np.where(changed[box], alpha[box], alpha.dtype.type(0))))
    return {**raster, "offset": [canvas.origin[0] + left, canvas.origin[1] + top]}


def _with_alpha(image: Image, alpha: Image | None) -> Image:
    shown = np.broadcast_to(full_scale(image.dtype), image.shape[:2]) if alpha is None else alpha
    return np.dstack([image, shown])


def _blending(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options; a width of 0 means the usual one, and some ways of blending have none."""
    chosen = dict(options)
    width = chosen.pop("blend_width", 0)
    if width and chosen.get("blend") in ("feather", "multiband", "gradient"):
        chosen["blend_width"] = float(width)
    return chosen


def _drawing(entry: Mapping[str, Any], canvas: Canvas) -> SvgSeam:
    """The lines of a seam, on the canvas of the two pictures it joins."""
    shift = np.array(canvas.origin, float)
    lines = tuple(ts.Polyline(np.array(line["points"], float).reshape(-1, 2) - shift, bool(line["closed"])) for line in entry["lines"])
    height, width = canvas.shape
    return SvgSeam(lines, width, height, None, (str(entry["name"]),) * len(lines))


def _layers(job: Job) -> list[ts.Layer]:
    """The layers of the request: color and alpha of one raster each, with a mask of its own multiplied in."""
    return [_layer(job, raster) for raster in job.request["layers"]]


def _layer(job: Job, raster: Mapping[str, Any]) -> ts.Layer:
    pixels = job.read(raster)
    alpha = pixels[..., -1]
    if raster.get("mask") is not None:
        share = job.read(raster["mask"]) / np.float32(255)
        alpha = (np.rint(alpha * share) if np.issubdtype(alpha.dtype, np.integer) else alpha * share).astype(alpha.dtype)
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


def _lines(seam: ts.Seam, origin: tuple[int, int]) -> list[dict[str, Any]]:
    """The lines of a seam as the asker needs them: exact, and with fewer points for people to bend."""
    lines = []
    for path in seam.paths:
        points = path.points + np.array(origin, float)
        editable = simplified(points, path.closed, EDITABLE_PX)
        lines.append({"closed": path.closed, "points": points.ravel().tolist(), "editable": editable.ravel().tolist()})
    return lines


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
