"""Convert the layers of a request to those of core, and core's results to rasters for GIMP.

Places are in px of GIMP's image; every raster has its place there as ``at``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.arrays import Image, Mask
from toposeam.images import box_of, full_scale
from toposeam.layers.blending import Blender
from toposeam.layers.canvas.canvas import Canvas, channel_count, paint
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import blocks
from toposeam_engine.job import EngineJob


def layers_of(job: EngineJob) -> list[ts.Layer]:
    """Return the layers of the request, each from one raster with its mask multiplied into the opacity."""
    return [layer_of(job, raster) for raster in job.request["layers"]]


def layer_of(job: EngineJob, raster: Mapping[str, Any]) -> ts.Layer:
    """Return the layer of a raster."""
    image, alpha = colours_of(job, raster)
    return ts.Layer(
        image,
        data_range=1.0 if image.dtype.kind == "f" else None,
        alpha=alpha,
        at=place_of(raster),
        name=str(raster.get("name", "layer")),
    )


def colours_of(job: EngineJob, raster: Mapping[str, Any]) -> tuple[Image, npt.NDArray[Any] | None]:
    """Return the colours of a raster, and its opacity times its mask; None if it is opaque."""
    pixels = job.read(raster)
    image, alpha = pixels, None
    if raster["channels"] in (2, 4):
        image, alpha = pixels[..., 0] if raster["channels"] == 2 else pixels[..., :-1], pixels[..., -1]
    if raster.get("mask") is not None:
        full = full_scale(pixels.dtype) if alpha is None else alpha
        shown = job.read(raster["mask"]) / np.float32(255) * full
        alpha = (np.rint(shown) if pixels.dtype.kind == "u" else shown).astype(pixels.dtype)
    return image, alpha


def place_of(raster: Mapping[str, Any]) -> tuple[int, int]:
    """Return the position of a raster."""
    x, y = raster["at"]
    return int(x), int(y)


def selected_on(job: EngineJob, canvas: Canvas) -> Mask | None:
    """(H, W) bool mask of a canvas, True at selected pixels; None without a selection."""
    return _white_on(job, job.request.get("selection"), canvas)


def avoided_on(job: EngineJob, canvas: Canvas) -> Mask | None:
    """(H, W) bool mask of a canvas, True where seams must not run, from a channel or a mask; None without
    one.
    """
    return _white_on(job, job.request.get("avoid"), canvas)


def _white_on(job: EngineJob, raster: Mapping[str, Any] | None, canvas: Canvas) -> Mask | None:
    if raster is None:
        return None
    white = ts.Layer(job.read(raster) >= 128, at=place_of(raster))
    place, result = canvas.place(white), np.zeros(canvas.shape, bool)
    common = place.shared(canvas.box)
    if all(common.shape):
        result[common.slices] = np.asarray(white.image)[common.within(place)]
    return result


def with_alpha(image: Image, alpha: Image | None) -> Image:
    """(H, W, C + 1) array of colours and opacity, as GIMP expects."""
    shown = np.broadcast_to(full_scale(image.dtype), image.shape[:2]) if alpha is None else alpha
    return np.dstack([image, shown])


def masks_of(
    job: EngineJob, layers: Sequence[ts.Layer], labels: Any, canvas: Canvas, *, every: bool = False
) -> list[dict[str, Any] | None]:
    """Return a mask for each layer, of the layer's size: 0 where a lower layer shows, 255 elsewhere.

    So painting black on a mask shows the layers below. The lowest layer needs no mask, unless a layer on it
    is partly transparent, or `every` one is wanted.
    """
    places = [canvas.place(layer).slices for layer in layers]
    clear = None
    for index, (layer, place) in enumerate(zip(layers, places, strict=True)):
        if layer.alpha is not None and (thin := layer.alpha < full_scale(layer.image.dtype)).any():
            clear = np.zeros(canvas.shape, bool) if clear is None else clear
            clear[place] |= thin & (labels[place] == index)
    masks: list[dict[str, Any] | None] = []
    for index, place in enumerate(places):
        own = labels[place]
        hides = (own >= 0) & (own < index)
        if clear is not None:
            hides |= (own > index) & clear[place]
        whole = index == 0 and not every and not hides.any()
        masks.append(None if whole else job.write(np.where(hides, np.uint8(0), np.uint8(255))))
    return masks


def blending(options: Mapping[str, Any]) -> dict[str, Any]:
    """Translate the options of blending; a width of 0 stands for the default, and some blends take none."""
    chosen = dict(options)
    if law := chosen.pop("law", None):
        chosen["cost"] = ts.seam.MatchCost(law=law)
    width = chosen.pop("blend_width", 0)
    if width and ts.layers.StitchOptions(blend=chosen.get("blend", "none")).blending.takes_width:
        chosen["blend_width"] = float(width)
    return chosen


def changes_of(
    job: EngineJob,
    layers: Sequence[ts.Layer],
    found: ts.layers.Composition,
    canvas: Canvas,
    within: Box | None = None,
) -> dict[str, Any] | None:
    """Return a raster of the pixels in which the composite differs from the masked layers, all others
    transparent; None if there are none. With a box of the canvas it is the raster of that.
    """
    box = canvas.box if within is None else within
    image, alpha = found.window(*box.slices) if within is None else _painted(found, box)
    labels, changed = found.label_map[box.slices], np.zeros(box.shape, bool)
    for index, layer in enumerate(layers):
        place = canvas.place(layer)
        for top in range(place.top, place.bottom, 256):
            strip = place._replace(top=top, bottom=min(top + 256, place.bottom)).shared(box)
            if not all(strip.shape):
                continue
            here, own = strip.within(box), layer.image[strip.within(place)]
            differs = image[here] != (own if own.ndim == image.ndim else own[..., np.newaxis])
            changed[here] |= (differs if differs.ndim == 2 else differs.any(axis=2)) & (labels[here] == index)
    kept = np.s_[:, :] if within is not None else box_of(changed) if changed.any() else None
    if kept is None:
        return None
    top, left = box.top + (kept[0].start or 0), box.left + (kept[1].start or 0)
    raster = job.write(with_alpha(image[kept], np.where(changed[kept], alpha[kept], image.dtype.type(0))))
    return {**raster, "at": [canvas.origin[0] + left, canvas.origin[1] + top]}


def _painted(found: ts.layers.Composition, box: Box) -> tuple[Image, Image]:
    """Return the pixels and the opacity of a composite in a box of its canvas. Only the box is blended; a
    window of the composite blends whole blocks.
    """
    canvas, labels = found.canvas, found.label_map
    blender, channels = Blender(canvas, labels, found.blending, tuple), channel_count(canvas.layers)
    image, alpha = paint(canvas.layers, canvas.places, labels[box.slices], box, channels)
    for tile in blocks(box):
        here = tile.within(box)
        blender.blend(tile, image[here], alpha[here])
    return image, alpha
