"""Pictures made to repeat: patches laid over the lines where their borders meet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import Seed, check_whole, options_from, seed_of
from toposeam.errors import ImageError, OptionError
from toposeam.images import as_array
from toposeam.texture.finish import finish, settings_of
from toposeam.texture.holed import placer_over, read_holed
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.raster import SMALLEST_TILE
from toposeam.texture.sources import DataRange, Images
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
    meet and cut along heat seams; only a band along the borders changes.

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
        if not np.any(np.asarray(alpha) > 0):
            raise ImageError("image is transparent everywhere; give one that shows something")
        raise ImageError(
            "the image is transparent all along its borders, so it repeats as it is; crop it to what it "
            "shows first"
        )
    sources, hole, ground = read_holed(image, hole, alpha, (None, None), maps, weights, data_range)
    placer = placer_over(sources, hole, ground, wraps, chosen, seed)
    near &= ground
    windows = _along_borders((height, width), wraps, band)
    for done, (top, left, shape) in enumerate(windows, start=1):
        rows, columns, _ = placer.canvas.window(top, left, *shape)
        placer.lay(top, left, shape, near[rows, columns])
        if progress is not None:
            progress(done / len(windows))
    settings = {
        "band": band,
        "seed": seed,
        "tileable": tileable,
        "smooth": smooth,
        **settings_of(placer.options),
    }
    across: list[tuple[int, int, tuple[int, int]]] = []
    if wraps[0]:
        across.append((-band, 0, (2 * band, width)))
    if wraps[1]:
        across.append((0, -band, (height, 2 * band)))
    patch = 2 * band, 2 * band
    return finish(sources, placer.atlas, placer.canvas, patch, settings, smooth, near, windows=across)


def _along_borders(
    size: tuple[int, int], wraps: tuple[bool, bool], band: int
) -> list[tuple[int, int, tuple[int, int]]]:
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
