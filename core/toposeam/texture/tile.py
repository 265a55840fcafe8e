"""Pictures made to repeat: patches laid over the lines where their borders meet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import Seed, check_items, check_whole, options_from, seed_of
from toposeam.errors import ImageError, OptionError
from toposeam.images import Image, Mask, as_array, full_scale
from toposeam.texture.finish import finish, settings_of
from toposeam.texture.holed import canvas_over, placer_over, read_holed
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.raster import SMALLEST_TILE
from toposeam.texture.sources import UNSEEN_STEP, DataRange, Images, as_list, check_varied, white_of
from toposeam.texture.synthesis import Synthesis
from toposeam.texture.tileable import Tileable, wraps_of


def make_tileable(
    image: npt.ArrayLike,
    *,
    band: int | None = None,
    seed: Seed = 0,
    tileable: Tileable = "both",
    alpha: npt.ArrayLike | None = None,
    maps: Sequence[Images] = (),
    weights: Sequence[float] | None = None,
    data_range: DataRange = None,
    smooth: int = 1,
    progress: Callable[[float], None] | None = None,
    options: LayOptions | None = None,
    **given: Any,
) -> Synthesis:
    """Make an existing picture repeat without a visible border.

    On the torus that the repeated picture is, patches of its own are laid over the lines where its borders
    meet and cut along the best seam; only a band along the borders changes, and nothing where the picture
    goes on across them as it is.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Gray or RGB.
    band : int, optional
        Width of the band along each border, px; by default an eighth of the shorter side, 48 at most.
        Everything inside stays as it is, bit for bit.
    seed : int, Generator or None
        The same seed gives the same bytes; the result keeps it.
    tileable : {"both", "x", "y"} or True
        Which borders are to match: left and right ("x"), upper and lower ("y"), or all.
    alpha, maps, weights, data_range, smooth, progress, options
        As for :func:`toposeam.synthesize`.

    Returns
    -------
    Synthesis
        Patch 0 is what was there before.

    Raises
    ------
    ImageError, OptionError
        Their text says what was received and what to do.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> image = np.random.default_rng(0).random((60, 60))
    >>> tile = ts.make_tileable(image, band=8).image
    >>> bool((tile[20:40, 20:40] == image[20:40, 20:40]).all())
    True
    """
    wraps = wraps_of(tileable)
    if not any(wraps):
        raise OptionError(f"tileable is {tileable!r}, so nothing is to match; choose both, x or y")
    chosen = options_from(LayOptions, options, given, "make_tileable")
    seed, smooth = seed_of(seed), check_whole("smooth", smooth, 0, 8)
    maps = check_items("maps", maps, object, "a sequence of images, one a map")
    height, width = as_array(image).shape[:2]
    if min(height, width) < 2 * SMALLEST_TILE:
        raise ImageError(
            f"the image is {width} × {height} px; to repeat it needs at least {2 * SMALLEST_TILE} px a side"
        )
    reach = min(length for length, wrapping in zip((height, width), wraps, strict=True) if wrapping)
    band = int(np.clip(min(height, width) // 8, 4, 48)) if band is None else band
    try:
        band = check_whole("band", band, 4, reach // 4)
    except OptionError as error:
        raise OptionError(
            f"band is {band!r}; for {width} × {height} px give a whole number from 4 to {reach // 4} px"
        ) from error
    border, near = np.zeros((height, width), bool), np.zeros((height, width), bool)
    for axis in (0, 1):
        if wraps[axis]:
            for mask, reach in ((border, 1), (near, band)):
                lines = mask if axis == 0 else mask.T
                lines[:reach] = lines[-reach:] = True
    if alpha is not None and np.shape(alpha) == border.shape and not (border & (np.asarray(alpha) > 0)).any():
        if not np.any(np.asarray(alpha) > 0):
            raise ImageError("image is transparent everywhere; give one that shows something")
        raise ImageError(
            "the image is transparent all along its borders, so it repeats as it is; crop it to what it "
            "shows first"
        )
    planes = [as_array(image), *(as_array(as_list(one, 1, "map")[0], "map") for one in maps)]
    white = [
        one or full_scale(plane.dtype)
        for one, plane in zip(white_of(data_range, len(planes)), planes, strict=True)
    ]
    if alpha is not None:
        planes, white = [*planes, as_array(alpha, "alpha")], [*white, full_scale(planes[0].dtype)]
    steps = [_steps(planes, white, axis) for axis in (0, 1)]
    windows, hole = _along_borders((height, width), wraps, band, steps)
    sources, hole, ground = read_holed(
        image, hole, alpha, (None, None), maps, weights, data_range, empty=not windows
    )
    check_varied(sources, "image")
    near &= ground
    if windows:
        placer = placer_over(sources, hole, ground, wraps, chosen, seed)
        atlas, canvas = placer.atlas, placer.canvas
        if not placer.search.room(windows[0][2]).any():
            raise ImageError(
                f"nowhere is the image opaque for a patch of {2 * band} × {2 * band} px, as a band of {band} "
                f"px needs it; fill its holes first{', or use a narrower band' if band > 4 else ''}"
            )
    else:
        atlas, canvas = canvas_over(sources, hole, ground, wraps, chosen.context)
    for done, (top, left, shape) in enumerate(windows, start=1):
        rows, columns, _ = canvas.window(top, left, *shape)
        placer.lay(top, left, shape, near[rows, columns])
        if progress is not None:
            progress(done / len(windows))
    settings = {
        "band": band,
        "seed": seed,
        "tileable": tileable,
        "smooth": smooth,
        **settings_of(chosen),
    }
    across: list[tuple[int, int, tuple[int, int]]] = []
    if any(top == -band for top, _, _ in windows):
        across.append((-band, 0, (2 * band, width)))
    if any(left == -band for _, left, _ in windows):
        across.append((0, -band, (height, 2 * band)))
    return finish(sources, atlas, canvas, (2 * band, 2 * band), settings, smooth, near, windows=across)


def _steps(planes: Sequence[Image], white: Sequence[float], axis: int) -> Mask:
    """Where along the border of an axis the first pixels do not continue the last ones: (n,) bool."""
    steps: Mask = np.zeros(planes[0].shape[1 - axis], bool)
    for plane, one in zip(planes, white, strict=True):
        if plane.shape[:2] == planes[0].shape[:2]:  # others are refused when they are read
            first, last = (plane.take(end, axis=axis).astype(np.float64) for end in (0, -1))
            shows = ~(np.abs(first - last) <= UNSEEN_STEP * one)
            steps |= shows.reshape(len(steps), -1).any(axis=1)
    return steps


def _along_borders(
    size: tuple[int, int], wraps: tuple[bool, bool], band: int, steps: Sequence[Mask]
) -> tuple[list[tuple[int, int, tuple[int, int]]], Mask]:
    """Square windows over the lines where borders meet, a quarter of each lying on the one before, wherever
    there is a step; and the pixels at these lines that are to go.
    """
    side, hole = 2 * band, np.zeros(size, bool)
    windows = []
    for axis in (1, 0):
        if not wraps[axis]:
            continue
        along, lines = size[1 - axis], hole if axis == 0 else hole.T
        if wraps[1 - axis]:
            count = int(np.ceil(along / (0.75 * side)))
            starts = [round(k * along / count) - band for k in range(count)]
        else:
            count = 1 + int(np.ceil((along - side) / (0.75 * side)))
            starts = [round(k * (along - side) / max(count - 1, 1)) for k in range(count)]
        for start in starts:
            part = np.arange(start, start + side) % along
            if steps[axis][part].any():
                windows.append((start, -band) if axis == 1 else (-band, start))
                lines[0, part] = lines[-1, part] = True
    return [(top, left, (side, side)) for top, left in dict.fromkeys(windows)], hole
