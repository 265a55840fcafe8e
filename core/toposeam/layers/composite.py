"""Layers in, one picture out: each further layer is joined to what is there along a seam of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OptionError, OverlapError
from toposeam.images import Image, Mask
from toposeam.layers.layer import Canvas, Layer, common_canvas
from toposeam.seam.find import apply_paths, find_seam
from toposeam.seam.seam import Seam
from toposeam.vector.svg import SvgSeam

#: Largest canvas that is made without being asked to: a gigapixel.
MAX_PIXELS = 10**9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stitched:
    """The composite of placed layers."""

    #: (H, W) or (H, W, C), dtype of the layers; 0 where no layer has pixels.
    image: Image
    #: (H, W) opacity in the layers' dtype, or None where every pixel is opaque.
    alpha: npt.NDArray[Any] | None
    #: One (H, W) bool mask per layer: where it shows. They never overlap and together cover what any layer covers.
    masks: tuple[Mask, ...]
    #: One seam per layer after the first, each joining it to the composite of those before.
    seams: tuple[Seam, ...]
    #: Column and row of the canvas's upper left pixel in the layers' coordinates.
    origin: tuple[int, int]


def stitch(
    layers: Sequence[Layer],
    *,
    use_path: SvgSeam | None = None,
    avoid: npt.ArrayLike | None = None,
    max_pixels: int = MAX_PIXELS,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Stitched:
    """Join placed layers, one after another in the order given.

    Parameters
    ----------
    layers : sequence of Layer
        At least two, of one dtype; gray layers are widened to the others' channels.
    use_path : SvgSeam, optional
        For two layers: a seam that was read from a file, instead of searching one.
    avoid : (H, W) array_like on the canvas, optional
        Pixels no seam may touch.
    max_pixels : int
        Refuse a larger canvas.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    **options
        As for :func:`toposeam.find_seam`.

    Returns
    -------
    Stitched

    Raises
    ------
    OverlapError
        When a layer shares no pixel with those before it.
    ImageError, OptionError, PathError
    """
    if len(layers) < 2:
        raise OptionError(f"{len(layers)} layer was given; stitching needs at least two")
    if use_path is not None and len(layers) != 2:
        raise OptionError(f"a path joins two layers, but {len(layers)} were given; stitch them pair by pair")
    dtypes = {layer.image.dtype for layer in layers}
    if len(dtypes) > 1:
        raise ImageError(f"the layers have dtypes {', '.join(sorted(map(str, dtypes)))}; convert them to one")
    canvas = common_canvas(layers, max_pixels)
    image, present = _put(layers[0], canvas, _channels(layers))
    alpha = np.zeros(canvas.shape, image.dtype)
    alpha[canvas.place(layers[0])] = _opacity(layers[0])
    owner = np.where(present, np.int16(0), np.int16(-1))
    seams: list[Seam] = []
    for index, layer in enumerate(layers[1:], start=1):
        patch, covered = _put(layer, canvas, _channels(layers))
        try:
            if use_path is not None:
                seam = apply_paths(use_path, image, patch, mask_a=present, mask_b=covered, avoid=avoid, **options)
            else:
                report = None if progress is None else _share(progress, index - 1, len(layers) - 1)
                seam = find_seam(image, patch, present, covered, avoid=avoid, progress=report, **options)
        except OverlapError as error:
            raise OverlapError(f"{layer.name} (at {layer.offset[0]},{layer.offset[1]}): {error}") from error
        if progress is not None:
            progress(index / (len(layers) - 1))
        seams.append(seam)
        place = canvas.place(layer)
        shows = seam.labels[place]
        np.copyto(image[place], patch[place], where=shows if image.ndim == 2 else shows[..., np.newaxis])
        np.copyto(alpha[place], _opacity(layer), where=shows)
        owner[place][shows] = index
        present |= covered
    opaque = bool((alpha == _opaque(layers[0].image.dtype)).all())
    return Stitched(
        image=image, alpha=None if opaque else alpha, masks=tuple(owner == index for index in range(len(layers))), seams=tuple(seams),
        origin=canvas.origin,
    )  # fmt: skip


def _share(progress: Callable[[float], None], done: int, total: int) -> Callable[[float], None]:
    return lambda part: progress((done + part) / total)


def _channels(layers: Sequence[Layer]) -> int | None:
    """The number of channels of the composite, None for a plane of gray."""
    counts = {1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in layers}
    wide = counts - {1}
    if len(wide) > 1:
        raise ImageError(f"the layers have {', '.join(map(str, sorted(wide)))} channels; convert them to the same number, or to gray")
    if wide:
        return wide.pop()
    return None if all(layer.image.ndim == 2 for layer in layers) else 1


def _put(layer: Layer, canvas: Canvas, channels: int | None) -> tuple[Image, Mask]:
    """The layer on the canvas, (H, W[, C]), and where it has pixels there; elsewhere it is 0, whatever transparent pixels hide."""
    place = canvas.place(layer)
    image = np.zeros(canvas.shape if channels is None else (*canvas.shape, channels), layer.image.dtype)
    image[place] = layer.image if channels is None or layer.image.ndim == 3 else layer.image[..., np.newaxis]
    present = np.zeros(canvas.shape, bool)
    present[place] = layer.covered
    if layer.alpha is not None:
        image[~present] = 0
    return image, present


def _opacity(layer: Layer) -> npt.NDArray[Any]:
    """(H, W) alpha of the layer, 0 where it has no pixels."""
    if layer.alpha is None:
        return np.broadcast_to(_opaque(layer.image.dtype), layer.image.shape[:2])
    return np.where(layer.covered, layer.alpha, layer.alpha.dtype.type(0))


def _opaque(dtype: np.dtype[Any]) -> Any:
    return dtype.type(np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1)
