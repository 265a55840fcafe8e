"""Warp layers onto the canvas and match their tones; pixels are computed once and stored in files.

Layers that are more than translated are warped by libvips, a strip at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

import toposeam as ts
from toposeam import _kernels
from toposeam.images import full_scale, in_dtype
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.transforms import Transform, is_move, settled
from toposeam.layers.canvas.warping import coordinates, inside, on_canvas, warped_box
from toposeam.layers.execution.tasks import Executor, results
from toposeam_cli.media.pictures.libvips import channels, evaluate, load_vips, to_vips
from toposeam_cli.media.pictures.picture import Picture

if TYPE_CHECKING:
    from toposeam_cli.files.scratch import Scratch

#: Number of rows of the canvas that are warped at once, and margin of source rows, px, that a bicubic spline
#: needs.
_STRIP_ROWS, _SPLINE_MARGIN = 128, 4
#: Longest side of a picture whose place is only asked for, px.
_LONGEST = 10**9


def placed_layers(
    layers: Sequence[ts.Layer],
    transforms: Sequence[Transform],
    wrap: int | None = None,
    scratch: Scratch | None = None,
    executor: Executor | None = None,
    max_megapixels: float = ts.MAX_PIXELS / 1e6,
) -> list[ts.Layer]:
    """Put layers on the canvas.

    Layers that are more than translated are warped: one at a time if pixels are stored in files, or several
    if an executor does it.

    Raises
    ------
    OptionError
        When the canvas would be larger, before any is warped.
    """
    transforms = list(map(settled, transforms))
    if all(map(is_move, transforms)):
        moved = list(map(on_canvas, layers, transforms))
        check_canvas(moved, max_megapixels)
        return moved
    check_canvas(list(map(blank, layers, transforms)), max_megapixels)
    both = list(zip(layers, transforms, strict=True))
    if scratch is None:
        return [_warped((*one, None)) for one in both]
    bent = [index for index, (_, transform) in enumerate(both) if not is_move(transform)]
    items = ((*both[index], scratch.new()) for index in bent)
    with scratch.failures_told():
        found = dict(zip(bent, results(executor, _warped, items), strict=True))
    return [found.get(index) or on_canvas(*one) for index, one in enumerate(both)]


def check_canvas(layers: Sequence[ts.Layer], max_megapixels: float) -> None:
    """Refuse a canvas that is too large.

    Raises
    ------
    OptionError
    """
    try:
        ts.layers.common_canvas(layers, max_megapixels=max_megapixels)
    except ts.OptionError as error:
        raise error.within("{error}, or allow more with --max-megapixels") from None


def toned_layers(
    layers: Sequence[ts.Layer],
    shading: bool,
    scratch: Scratch,
    executor: Executor | None,
    progress: Callable[[float], None] | None = None,
) -> list[ts.Layer]:
    """Match the tones of layers, and store them, since the search reads every pixel several times.

    Raises
    ------
    OutputError
        When there is no space.
    """
    toned = ts.layers.match_tones(layers, shading=shading, executor=executor)
    found: list[ts.Layer] = []
    with scratch.failures_told():
        for layer in results(executor, _toned, ((layer, scratch.new()) for layer in toned)):
            found.append(layer)
            if progress is not None:
                progress(len(found) / len(toned))
    return found


def _toned(item: tuple[ts.Layer, Path]) -> ts.Layer:
    layer, waits = item
    from toposeam_cli.media.pictures.stored import stored_in

    return replace(layer, image=stored_in(waits, Picture(pixels=layer.image)).pixels)


def blank(layer: ts.Layer, transform: Transform) -> ts.Layer:
    """Make a layer of the size and place of a warped one, whose pixels take no memory."""
    if is_move(transform):
        return on_canvas(layer, transform)
    box = warped_box(layer, transform)
    rows, columns = (min(side, _LONGEST) for side in box.shape)  # beyond it no array has an index
    nothing = np.broadcast_to(np.uint8(0), (rows, columns))
    return ts.Layer(nothing, at=(box.left, box.top), name=layer.name)


def _warped(item: tuple[ts.Layer, Transform, Path | None]) -> ts.Layer:
    """Warp a layer, and store its pixels in a file if one is given."""
    layer, transform, waits = item
    if is_move(transform):
        return on_canvas(layer, transform)
    box = warped_box(layer, transform)
    masks = {name: np.zeros(box.shape, bool) for name in ("mask", "keep") if getattr(layer, name) is not None}
    strips = _strips(layer, transform, box, masks)
    if waits is None:
        parts = list(strips)
        pixels, alpha = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("pixels", "alpha")
        )
    else:
        from toposeam_cli.media.pictures.stored import stored_at

        picture = stored_at(waits, strips)
        pixels, alpha = picture.pixels, cast(np.ndarray, picture.alpha)
    return replace(
        layer,
        image=pixels,
        alpha=alpha,
        at=(box.left, box.top),
        mask=masks.get("mask"),
        keep=masks.get("keep"),
    )


def _strips(
    layer: ts.Layer, transform: Transform, box: Box, masks: dict[str, np.ndarray]
) -> Iterator[Picture]:
    """Yield the strips of a warped picture, and fill its masks."""
    height, width = layer.image.shape[:2]
    dtype = layer.image.dtype
    colours = (3,) if channels(layer.image) == 3 else ()
    for top in range(box.top, box.bottom, _STRIP_ROWS):
        part = Box(top, box.left, min(top + _STRIP_ROWS, box.bottom), box.right)
        at = coordinates(transform, part)
        shown = inside(at, (width, height))
        alpha = shown.astype(dtype) * full_scale(dtype)
        everywhere = bool(shown.all())
        if everywhere or shown.any():
            rows = at[..., 1] if everywhere else at[..., 1][shown]
            low = max(int(rows.min()) - _SPLINE_MARGIN, 0)
            source = slice(low, int(rows.max()) + _SPLINE_MARGIN + 2), slice(None)
            pixels = _splined(np.asarray(layer.image[source]), at, low, shown).reshape(*part.shape, *colours)
            if layer.alpha is not None:
                own = _looked_up(np.asarray(layer.alpha[source]), at, low, "bilinear")
                opacity = shown * (own.reshape(part.shape) / np.float32(full_scale(dtype)))
                alpha = in_dtype(opacity * np.float32(full_scale(dtype)), dtype)
            for name, mask in masks.items():
                nearest = np.rint(at[shown]).astype(np.intp)
                given = np.asarray(getattr(layer, name))
                mask[part.within(box)][shown] = given[nearest[:, 1], nearest[:, 0]]
        else:
            pixels = np.zeros((*part.shape, *colours), dtype)
        yield Picture(pixels=pixels, alpha=alpha)


def _splined(values: np.ndarray, at: np.ndarray, top: int, shown: np.ndarray) -> np.ndarray:
    """Interpolate an image that begins at a row by Catmull and Rom's splines; 0 where it is not shown.

    The kernel rounds as libvips 8.18 does.
    """
    if _kernels.library is None:
        result = _looked_up(values, at, top, "bicubic")
        if not shown.all():
            result[~shown] = 0
        return result
    values, count = np.ascontiguousarray(values), channels(values)
    result = np.empty((*shown.shape, count), values.dtype)
    _kernels.library.catmull_values(
        values.itemsize, *values.shape[:2], count, values, shown.size, at, top, shown, result
    )
    return result


def _looked_up(values: np.ndarray, at: np.ndarray, top: int, interpolate: str) -> np.ndarray:
    """Interpolate the values of an image that begins at a row, at (h, w, 2) coordinates x and y."""
    vips = load_vips()
    where = np.empty(at.shape, np.float32)
    np.subtract(at, [0, top], out=where, casting="same_kind")
    image: Any = to_vips(values).mapim(
        vips.Image.new_from_array(where), interpolate=vips.Interpolate.new(interpolate), extend="copy"
    )
    return np.asarray(evaluate(image, image.numpy))
