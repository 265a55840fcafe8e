"""Pictures reduced and laid on a canvas of a few megapixels, to be looked at while one paints."""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageOps

import toposeam as ts
from toposeam.arrays import Floats
from toposeam.images import full_scale
from toposeam.layers.canvas.transforms import ReducedTransform, Transform, is_move, reach
from toposeam_cli.media.pictures.colour import to_depth, widen
from toposeam_cli.stitching.resample import placed_layers

#: Number of pixels of the preview's canvas.
PREVIEW_PIXELS = 2_000_000
#: Longer side of the small pictures that show before anything is placed, px.
PRINT_PX = 480


@dataclass(slots=True)
class ReducedPictures:
    """Lays pictures on a reduced canvas; to be passed to :func:`toposeam_cli.stitching.inputs.arrange`."""

    pixels: int = field(default_factory=lambda: PREVIEW_PIXELS)
    #: Size of the preview ÷ that of the result; known once pictures are laid.
    scale: float = 1.0
    #: Per picture, from its own pixels to the preview.
    transforms: tuple[Transform, ...] = field(default=())

    def __call__(
        self, layers: Sequence[ts.Layer], transforms: Sequence[Transform], wrap: int | None
    ) -> Sequence[ts.Layer]:
        """Return the layers, reduced and warped onto the preview.

        Raises
        ------
        OptionError
            If the canvas shows nothing of a picture.
        """
        self.scale = self._scale(layers, transforms)
        if self.scale == 1:
            self.transforms = tuple(transforms)
            return placed_layers(layers, transforms)
        reduced, by = [], []
        for layer, transform in zip(layers, transforms, strict=True):
            small = _reduced(layer, self.scale)
            height, width = layer.image.shape[:2]
            rows, columns = small.image.shape[:2]
            reduced.append(small)
            by.append(ReducedTransform(transform, 1 / self.scale, (width / columns, height / rows)))
        self.transforms = tuple(ReducedTransform(one, 1 / self.scale, 1) for one in transforms)
        return placed_layers(reduced, by)

    def _scale(self, layers: Sequence[ts.Layer], transforms: Sequence[Transform]) -> float:
        """Return the size of the preview ÷ that of the result."""
        return min(1.0, math.sqrt(self.pixels / float(np.prod(_extent(layers, transforms)))))


def _extent(layers: Sequence[ts.Layer], transforms: Sequence[Transform]) -> Floats:
    """Return the width and height of the canvas at full size, px."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for layer, transform in zip(layers, transforms, strict=True):
        height, width = layer.image.shape[:2]
        if is_move(transform):
            first = transform.to_canvas(np.zeros((1, 2)))[0]
            reached: Any = first, first + np.array([width - 1, height - 1])
        else:
            reached = reach(transform, (width, height))
        if reached is not None:
            low, high = np.minimum(low, reached[0]), np.maximum(high, reached[1])
    return np.asarray(np.maximum(high - low, 0) + 1)


def _reduced(layer: ts.Layer, scale: float) -> ts.Layer:
    """Return a layer in eight bits, at about a fraction of its size."""
    height, width = layer.image.shape[:2]
    size = max(2, round(width * scale)), max(2, round(height * scale))
    eight = np.dtype(np.uint8)
    image = _resized(to_depth(np.asarray(layer.image), eight), size)
    rows = np.minimum((np.arange(size[1]) + 0.5) * height / size[1], height - 1).astype(np.intp)
    columns = np.minimum((np.arange(size[0]) + 0.5) * width / size[0], width - 1).astype(np.intp)
    masks: dict[str, Any] = {
        name: None if mask is None else np.asarray(mask)[np.ix_(rows, columns)]
        for name in ("mask", "keep")
        if (mask := getattr(layer, name)) is not None
    }
    alpha = None
    if layer.alpha is not None:
        opaque = np.asarray(layer.alpha) >= full_scale(layer.alpha.dtype)
        alpha = np.where(opaque[np.ix_(rows, columns)], np.uint8(255), np.uint8(0))
    return dataclasses.replace(layer, image=image, alpha=alpha, data_range=None, **masks)


def _resized(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    # means of whole squares first, down to 1.4 times the size: half a level off, in half the time
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS, reducing_gap=1.4))


def encoded(layer: ts.Layer) -> bytes:
    """Return a laid picture as WebP, with its opacity."""
    colours = widen(to_depth(np.asarray(layer.image), np.dtype(np.uint8)))
    cover = np.where(np.asarray(layer.covered), np.uint8(255), np.uint8(0))
    file = io.BytesIO()
    Image.fromarray(np.dstack([colours, cover])).save(file, "WEBP", quality=92, method=0)
    return file.getvalue()


def jpeg(pixels: np.ndarray, quality: int = 92) -> bytes:
    """Return pixels as JPEG without chroma subsampling."""
    file = io.BytesIO()
    Image.fromarray(widen(to_depth(pixels, np.dtype(np.uint8)))).save(
        file, "JPEG", quality=quality, subsampling=0
    )
    return file.getvalue()


def small_print(path: Path) -> tuple[bytes, tuple[int, int]] | None:
    """Return a picture at a small size as JPEG, and its width and height; None if it takes the long way.

    JPEG files are decoded at an eighth of their size, which takes a hundredth of a second.
    """
    try:
        with Image.open(path) as opened:
            opened.draft("RGB", (PRINT_PX, PRINT_PX))
            turned = ImageOps.exif_transpose(opened)
            turned.thumbnail((PRINT_PX, PRINT_PX), Image.Resampling.LANCZOS)
            if turned.mode.startswith(("I", "F")):
                return None
            rgb = Image.new("RGB", turned.size, (128, 128, 128))
            rgba = turned.convert("RGBA")
            rgb.paste(rgba, mask=rgba)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
    return jpeg(np.asarray(rgb), 85), rgb.size
