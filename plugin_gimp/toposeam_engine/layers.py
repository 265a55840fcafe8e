"""Layers of a request as core's, and what core makes of them as rasters for the asker.

Places are in px of the asker's image; every raster has its place there, ``at``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import Image, Mask, full_scale
from toposeam.layers.canvas.layer import Extent
from toposeam_engine.job import EngineJob


def layers_of(job: EngineJob) -> list[ts.Layer]:
    """Return the layers of the request: color and alpha of one raster each, with a mask of its own multiplied
    in.
    """
    return [layer_of(job, raster) for raster in job.request["layers"]]


def layer_of(job: EngineJob, raster: Mapping[str, Any]) -> ts.Layer:
    """Return a layer of the request."""
    image, alpha = colours_of(job, raster)
    return ts.Layer(
        image,
        data_range=1.0 if image.dtype.kind == "f" else None,
        alpha=alpha,
        at=place_of(raster),
        name=str(raster.get("name", "layer")),
    )


def colours_of(job: EngineJob, raster: Mapping[str, Any]) -> tuple[Image, npt.NDArray[Any]]:
    """Colour and opacity of a raster, its mask multiplied in."""
    pixels = job.read(raster)
    alpha = pixels[..., -1]
    if raster.get("mask") is not None:
        share = job.read(raster["mask"]) / np.float32(255)
        alpha = (np.rint(alpha * share) if alpha.dtype.kind == "u" else alpha * share).astype(alpha.dtype)
    return pixels[..., 0] if pixels.shape[2] == 2 else pixels[..., :-1], alpha


def place_of(raster: Mapping[str, Any]) -> tuple[int, int]:
    """Return the position of a raster."""
    x, y = raster["at"]
    return int(x), int(y)


def selected_on(job: EngineJob, canvas: Extent) -> Mask | None:
    """(H, W) bool on a canvas: what is selected; None without a selection."""
    raster = job.request.get("selection")
    if raster is None:
        return None
    selected = ts.Layer(job.read(raster) >= 128, at=place_of(raster))
    place, result = canvas.place(selected), np.zeros(canvas.shape, bool)
    common = place.shared(canvas.box)
    if all(common.shape):
        result[common.slices] = np.asarray(selected.image)[common.within(place)]
    return result


def with_alpha(image: Image, alpha: Image | None) -> Image:
    """(H, W, C + 1): colour and opacity as the asker wants them."""
    shown = np.broadcast_to(full_scale(image.dtype), image.shape[:2]) if alpha is None else alpha
    return np.dstack([image, shown])


def masks_of(
    job: EngineJob, layers: Sequence[ts.Layer], masks: Iterable[Mask], canvas: Extent
) -> list[dict[str, Any]]:
    """Return each layer's mask, of the layer's own size, 255 where it shows."""
    return [
        job.write(mask[canvas.place(layer).slices].astype(np.uint8) * np.uint8(255))
        for layer, mask in zip(layers, masks, strict=True)
    ]


def changes_of(
    job: EngineJob, layers: Sequence[ts.Layer], stitched: ts.Stitched, canvas: Extent
) -> dict[str, Any] | None:
    """Return the pixels in which the composite differs from the layers under their masks, transparent
    elsewhere; None if it does not differ.
    """
    changed = np.zeros(canvas.shape, bool)
    for layer, mask in zip(layers, stitched.masks, strict=True):
        place = canvas.place(layer)
        for top in range(place.top, place.bottom, 256):
            part = np.s_[top : min(top + 256, place.bottom), place.left : place.right]
            own = layer.image[part[0].start - place.top : part[0].stop - place.top]
            seen = stitched.image[part]
            differs = seen != (own if own.ndim == seen.ndim else own[..., np.newaxis])
            changed[part] |= (differs if differs.ndim == 2 else differs.any(axis=2)) & mask[part]
    if not changed.any():
        return None
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    top, left = int(rows[0]), int(columns[0])
    box = np.s_[top : int(rows[-1]) + 1, left : int(columns[-1]) + 1]
    image = stitched.image
    alpha = (
        np.broadcast_to(full_scale(image.dtype), canvas.shape) if stitched.alpha is None else stitched.alpha
    )
    raster = job.write(with_alpha(image[box], np.where(changed[box], alpha[box], image.dtype.type(0))))
    return {**raster, "at": [canvas.origin[0] + left, canvas.origin[1] + top]}
