"""Holes filled from the rest of the picture, and pictures made to repeat: both lay patches over what has to go."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.errors import ImageError, OptionError
from toposeam.images import Mask, as_mask
from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import Canvas
from toposeam.texture.lay import Layer, LayOptions
from toposeam.texture.raster import SMALLEST_TILE
from toposeam.texture.scale import natural_patch
from toposeam.texture.search import box_sum
from toposeam.texture.sources import Images, Sources, check_varied, read_sources
from toposeam.texture.synthesis import Synthesis
from toposeam.texture.synthesize import Tileable, check_patch, finish, lay_options, settings_of

#: A hole with its band that fits a patch this many times the usual one is filled by one patch, along a closed seam.
_ONE_PATCH = 2.0


def fill(
    image: npt.ArrayLike,
    mask: npt.ArrayLike,
    patch: int | None = None,
    overlap: int | None = None,
    seed: int = 0,
    *,
    band: int | None = None,
    alpha: npt.ArrayLike | None = None,
    allow: npt.ArrayLike | None = None,
    maps: Sequence[Images] = (),
    weights: Sequence[float] | None = None,
    smooth: int = 1,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Synthesis:
    """Replace part of a picture by what the rest of it is like.

    The hole is filled from outside inwards. Each patch is cut along a heat seam that may run through a band round the hole, closed where
    one patch covers all of it.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Gray or RGB.
    mask : (H, W) array_like
        True (or not 0) where the picture is to be replaced.
    patch : int, optional
        Side of a patch, px; by default by the size of the picture's elements.
    overlap : int, optional
        How far patches overlap, px; by default a quarter of the patch.
    seed : int
        The same seed gives the same bytes.
    band : int, optional
        Width of the band round the hole that may change as well, px; by default the overlap. Everything beyond stays as it is, bit for bit.
    alpha : (H, W) array_like, optional
        Opacity; what is fully transparent is neither copied nor compared nor filled.
    allow : (H, W) array_like, optional
        Where patches may be copied from; by default everywhere outside the hole.
    maps, weights, smooth, progress, **options
        As for :func:`toposeam.synthesize`.

    Returns
    -------
    Synthesis
        Patch 0 is what was there before.

    Raises
    ------
    ImageError, OptionError
        Their text says what was received and what to do.
    """
    sources, hole, ground = _read(image, mask, alpha, allow, maps, weights)
    chosen = lay_options(options)
    side, overlap = _patch_size(sources, patch, overlap)
    band = overlap if band is None else band
    if int(band) != band or band < 0:
        raise OptionError(f"band is {band}; give a whole number of px from 0 up")
    near = _dilated(hole, int(band)) & ground
    layer = _over(sources, hole, ground, (False, False), chosen, seed)
    total = int(hole.sum())
    for top, left, shape in _windows(layer, hole, side, int(band)):
        rows, columns, _ = layer.canvas.window(top, left, *shape)
        layer.lay(top, left, shape, near[rows, columns])
        if progress is not None:
            progress(1 - int(((layer.canvas.index < 0) & hole).sum()) / total)
    settings = {"patch": side, "overlap": overlap, "band": int(band), "seed": seed, "smooth": smooth, **settings_of(chosen)}
    return finish(sources, layer.atlas, layer.canvas, (side, side), settings, smooth, near)


def make_tileable(
    image: npt.ArrayLike,
    band: int | None = None,
    seed: int = 0,
    tileable: Tileable = True,
    *,
    alpha: npt.ArrayLike | None = None,
    maps: Sequence[Images] = (),
    weights: Sequence[float] | None = None,
    smooth: int = 1,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Synthesis:
    """Make an existing picture repeat without a visible border.

    On the torus that the repeated picture is, patches of its own are laid over the lines where its borders meet and cut along heat seams;
    only a band along the borders changes.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Gray or RGB.
    band : int, optional
        Width of the band along each border, px; by default an eighth of the shorter side, 48 at most. Everything inside stays as it is,
        bit for bit.
    seed : int
        The same seed gives the same bytes.
    tileable : bool or {"x", "y"}
        Which borders are to match: left and right ("x"), upper and lower ("y"), or all.
    alpha, maps, weights, smooth, progress, **options
        As for :func:`toposeam.synthesize`.

    Returns
    -------
    Synthesis
        Patch 0 is what was there before.

    Raises
    ------
    ImageError, OptionError
        Their text says what was received and what to do.
    """
    if tileable not in (True, "x", "y"):
        raise OptionError(f"tileable is {tileable!r}; choose True, 'x' or 'y'")
    wraps = (tileable in (True, "y"), tileable in (True, "x"))
    height, width = _shape(image)
    if min(height, width) < 2 * SMALLEST_TILE:
        raise ImageError(f"the image is {width} × {height} px; to repeat it needs at least {2 * SMALLEST_TILE} px a side")
    reach = min(length for length, wrapping in zip((height, width), wraps, strict=True) if wrapping)
    band = int(np.clip(min(height, width) // 8, 4, 48)) if band is None else band
    if int(band) != band or not 4 <= band <= reach // 4:
        raise OptionError(f"band is {band}; for {width} × {height} px give a whole number from 4 to {reach // 4} px")
    hole = np.zeros((height, width), bool)
    near = np.zeros((height, width), bool)
    for axis in (0, 1):
        if wraps[axis]:
            border = (slice(None),) * axis
            for side in (slice(0, 1), slice(-1, None)):
                hole[(*border, side)] = True
            for side in (slice(0, band), slice(-band, None)):
                near[(*border, side)] = True
    if alpha is not None and np.shape(alpha) == hole.shape and not (hole & (np.asarray(alpha) > 0)).any():
        raise ImageError("the image is transparent all along its borders, so it repeats as it is; crop it to what it shows first")
    sources, hole, ground = _read(image, hole, alpha, None, maps, weights)
    layer = _over(sources, hole, ground, wraps, lay_options(options), seed)
    near &= ground
    windows = _along_borders((height, width), wraps, int(band))
    for done, (top, left, shape) in enumerate(windows, start=1):
        rows, columns, _ = layer.canvas.window(top, left, *shape)
        layer.lay(top, left, shape, near[rows, columns])
        if progress is not None:
            progress(done / len(windows))
    settings = {"band": int(band), "seed": seed, "tileable": tileable, "smooth": smooth, **settings_of(layer.options)}
    return finish(sources, layer.atlas, layer.canvas, (2 * int(band), 2 * int(band)), settings, smooth, near)


def _shape(image: npt.ArrayLike) -> tuple[int, int]:
    shape = np.shape(image)
    if len(shape) not in (2, 3) or 0 in shape:
        raise ImageError(f"image has shape {shape}; pass a non-empty (H, W) or (H, W, C) array")
    return shape[0], shape[1]


def _read(
    image: npt.ArrayLike, hole: npt.ArrayLike, alpha: npt.ArrayLike | None, allow: npt.ArrayLike | None, maps: Sequence[Images],
    weights: Sequence[float] | None,
) -> tuple[Sources, Mask, Mask]:  # fmt: skip
    """The picture as a source, what has to go, and the pixels there are."""
    shape = _shape(image)
    gone = as_mask(hole, shape, "mask")
    ground = np.ones(shape, bool) if alpha is None else np.asarray(alpha) > 0
    if ground.shape == shape:
        gone = gone & ground
    copied = ~gone if allow is None else ~gone & as_mask(allow, shape, "allow")
    if not gone.any():
        raise ImageError("the mask is empty, or the picture transparent there, so there is nothing to replace; paint what has to go white")
    if allow is not None and not copied.any() and not gone.all():
        raise ImageError("nothing is left to copy from: outside the mask nothing is allowed; paint more of what may be copied white")
    if not copied.any():
        raise ImageError("nothing is left to copy from: the mask covers the whole picture; paint only what has to go white")
    array = np.asarray(image)
    if np.issubdtype(array.dtype, np.floating):  # whatever the hole holds
        array = np.where(gone[..., np.newaxis] if array.ndim == 3 else gone, 0, array).astype(array.dtype)
    sources = read_sources(array, alpha=alpha, mask=copied, maps=maps, weights=weights, name="image")
    check_varied(sources, "image")
    return sources, gone, ground


def _patch_size(sources: Sources, patch: int | None, overlap: int | None) -> tuple[int, int]:
    side = natural_patch(sources.features, sources.usable, sources.shapes) if patch is None else patch
    return check_patch(sources, side, overlap)


def _over(sources: Sources, hole: Mask, ground: Mask, wraps: tuple[bool, bool], options: LayOptions, seed: int) -> Layer:
    """A canvas that shows the picture itself, but for the hole."""
    atlas = Atlas.of([ground & ~hole], options.context, sources.usable)
    canvas = Canvas((hole.shape[0], hole.shape[1]), wraps, atlas.usable.size, None if ground.all() else ground)
    place = atlas.places[0]
    itself = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[place]
    np.copyto(canvas.index, itself, where=ground & ~hole)
    np.copyto(canvas.labels, 0, where=ground & ~hole)
    canvas.patches = 1
    return Layer(atlas, atlas.spread(sources.features), canvas, options, np.random.default_rng(seed), int(hole.sum()))


def _windows(layer: Layer, hole: Mask, side: int, band: int) -> Iterator[tuple[int, int, tuple[int, int]]]:
    """Windows that cover the hole: a whole hole at once where it is small, else from outside inwards. Asks the canvas what is empty yet."""
    canvas = layer.canvas
    pieces, _ = ndimage.label(hole, np.ones((3, 3), bool))
    large = np.zeros_like(hole)
    for number, box in enumerate(ndimage.find_objects(pieces), start=1):
        first = [max(part.start - band - 1, 0) for part in box]
        last = [min(part.stop + band + 1, limit) for part, limit in zip(box, canvas.shape, strict=True)]
        shape = last[0] - first[0], last[1] - first[1]
        if max(shape) <= _ONE_PATCH * side and _has_room(layer, shape):
            yield first[0], first[1], shape
        else:
            large |= pieces == number
    height, width = (min(side, length) for length in canvas.shape)
    if large.any() and not _has_room(layer, (height, width)):
        raise ImageError(f"no place outside the mask has room for a patch of {width} × {height} px; use smaller patches")
    while True:
        empty = (canvas.index < 0) & large
        if not empty.any():
            return
        rows, columns = np.flatnonzero(empty.any(axis=1)), np.flatnonzero(empty.any(axis=0))
        top, left = max(rows[0] - height, 0), max(columns[0] - width, 0)
        part = slice(top, rows[-1] + height + 1), slice(left, columns[-1] + width + 1)
        known = canvas.index[part] >= 0
        edge = empty[part] & ndimage.binary_dilation(known, np.ones((3, 3), bool))
        if not edge.any():
            edge = empty[part]
        around = ((height // 2, height - height // 2 - 1), (width // 2, width - width // 2 - 1))
        share = box_sum(np.pad(known, around), (height, width))
        row, column = divmod(int(np.where(edge, share, -1).argmax()), known.shape[1])
        yield (
            int(np.clip(top + row - height // 2, 0, canvas.shape[0] - height)),
            int(np.clip(left + column - width // 2, 0, canvas.shape[1] - width)),
            (height, width),
        )


def _has_room(layer: Layer, shape: tuple[int, int]) -> bool:
    if any(length > limit for length, limit in zip(shape, layer.atlas.usable.shape, strict=True)):
        return False
    return bool(layer.search.room(shape).any())


def _along_borders(size: tuple[int, int], wraps: tuple[bool, bool], band: int) -> list[tuple[int, int, tuple[int, int]]]:
    """Square windows over the lines where borders meet, a quarter of each lying on the one before."""
    side = 2 * band
    windows = []
    for axis in (1, 0):
        if not wraps[axis]:
            continue
        along = size[1 - axis]
        if wraps[1 - axis]:
            count = int(np.ceil(along / (0.75 * side)))
            starts = [round(k * along / count) - band for k in range(count)]
        else:
            count = 1 + int(np.ceil((along - side) / (0.75 * side)))
            starts = [round(k * (along - side) / max(count - 1, 1)) for k in range(count)]
        windows += [((start, -band) if axis == 1 else (-band, start)) for start in starts]
    return [(top, left, (side, side)) for top, left in dict.fromkeys(windows)]


def _dilated(mask: Mask, radius: int) -> Mask:
    """Pixels within a distance, px, of the mask."""
    if radius == 0:
        return mask
    grown: Mask = ndimage.distance_transform_edt(~mask) <= radius
    return grown
