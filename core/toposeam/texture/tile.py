"""Pictures made to repeat: patches laid over the lines where their borders meet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Image, Mask
from toposeam.checks import Seed, check_choice, check_function, check_whole
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_array, as_float, full_scale
from toposeam.texture.assemble_result import finish
from toposeam.texture.canvas.synthesis import Synthesis
from toposeam.texture.canvas.tileable import Tileable
from toposeam.texture.exemplar.scale import natural_patch
from toposeam.texture.exemplar.sources import UNSEEN_STEP, DataRange, Images, as_list, check_varied
from toposeam.texture.holes.hole_window import read_holed
from toposeam.texture.light.border_light import levelled_borders
from toposeam.texture.light.slow_light import flattened
from toposeam.texture.placement.options import LayKeywords, LayOptions
from toposeam.texture.placement.request import TextureRequest
from toposeam.texture.scheduling.raster import SMALLEST_TILE

#: Width of the widest band, px, where elements of the picture are no larger.
_USUAL_BAND = 48
#: Side of the middle part of a picture, px, in which the size of its elements is measured: that of a whole
#: large picture would take long.
_MEASURED_SIDE = 1024


def tile(
    image: npt.ArrayLike,
    *,
    band: int | None = None,
    seed: Seed = 0,
    tileable: Tileable = "both",
    alpha: npt.ArrayLike | None = None,
    maps: Sequence[Images] = (),
    normal: npt.ArrayLike | None = None,
    weights: Sequence[float] | None = None,
    data_range: DataRange = None,
    smooth: int = 1,
    flatten: bool = False,
    level: bool = False,
    progress: Callable[[float], None] | None = None,
    options: LayOptions | None = None,
    **given: Unpack[LayKeywords],
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
        Width of the band along each border, px; by default an eighth of the shorter side, 48 at most, or
        where elements are larger their natural patch. Everything inside stays as it is, bit for bit, but for
        its light.
    seed : int, Generator or None
        The same seed gives the same bytes; the result keeps it.
    tileable : {"both", "x", "y"} or True
        Which borders are to match: left and right ("x"), upper and lower ("y"), or all.
    flatten : bool
        Take slow light out of the picture first (:func:`toposeam.texture.flatten_light`); not out of maps.
    level : bool
        Take out the light by which opposite borders differ, spread over the picture
        (:mod:`toposeam.texture.light.border_light`); not out of maps.
    alpha, maps, normal, weights, data_range, smooth, progress, options
        As for :func:`toposeam.synth`.

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
    >>> repeats = ts.tile(image, band=8).image
    >>> bool((repeats[20:40, 20:40] == image[20:40, 20:40]).all())
    True
    """
    check_function("progress", progress)
    request = TextureRequest.of(
        "tile",
        options,
        given,
        seed=seed,
        smooth=smooth,
        alpha=alpha,
        maps=maps,
        normal=normal,
        weights=weights,
        data_range=data_range,
        tileable=tileable,
    )
    wraps, (height, width) = request.wraps, as_array(image).shape[:2]
    if not any(wraps):
        raise OptionError(
            "{parameter} is {value!r}, so nothing is to match; choose both, x or y",
            kind="choice",
            parameter=Term("tileable"),
            value=tileable,
            allowed=("both", "x", "y"),
        )
    if min(height, width) < 2 * SMALLEST_TILE:
        raise ImageError(
            "{image} is {width} × {height} px; to repeat it needs at least {least} px a side",
            kind="small",
            least=2 * SMALLEST_TILE,
            width=width,
            height=height,
            image=Term("image", "the image"),
        )
    check_choice("flatten", flatten, (True, False))
    check_choice("level", level, (True, False))
    if flatten or level:
        image = _even(request, image, flatten=flatten, level=level)
    band = _band(request, image, band, wraps)
    border, near = (_borders((height, width), wraps, reach) for reach in (1, band))
    alpha = None if alpha is None else as_array(alpha, "alpha")
    if alpha is not None and alpha.shape == border.shape and not (border & (alpha > 0)).any():
        if not np.any(alpha > 0):
            raise ImageError(
                "{array} is transparent everywhere; give one that shows something",
                kind="transparent",
                array=Term("image"),
            )
        raise ImageError(
            "{image} is transparent all along its borders, so it repeats as it is; crop it to"
            " what it shows first",
            kind="transparent borders",
            image=Term("image", "the image"),
        )
    windows, hole = _along_borders((height, width), wraps, band, _steps(request, image))
    holed = read_holed(request, image, hole, empty=not windows)
    check_varied(holed.sources, "image")
    near &= holed.ground
    atlas, canvas = holed.canvas(request)
    if windows:
        placer = holed.placer(request, atlas, canvas)
        if not placer.ranking.search.room(windows[0][2]).any():
            raise ImageError(
                "nowhere is {image} opaque for a patch of {width} × {height} px, as a band of "
                "{band} px needs it; fill its holes first{narrower}",
                kind="no opaque room",
                width=2 * band,
                height=2 * band,
                band=band,
                narrower=", or use a narrower band" if band > 4 else "",
                image=Term("image", "the image"),
            )
    for done, (top, left, shape) in enumerate(windows, start=1):
        rows, columns, _ = canvas.window(top, left, *shape)
        placer.lay(top, left, shape, near[rows, columns])
        if progress is not None:
            progress(done / len(windows))
    settings = {"band": band, **request.settings, "flatten": flatten, "level": level}
    across: list[tuple[int, int, tuple[int, int]]] = []
    if any(top == -band for top, _, _ in windows):
        across.append((-band, 0, (2 * band, width)))
    if any(left == -band for _, left, _ in windows):
        across.append((0, -band, (height, 2 * band)))
    return finish(holed.sources, atlas, canvas, (2 * band, 2 * band), settings, request, near, windows=across)


def _even(request: TextureRequest, image: npt.ArrayLike, *, flatten: bool, level: bool) -> Image:
    """Take light out of a picture."""
    array = as_array(image)
    white = request.white[0]
    if (
        level
        and request.alpha is not None
        and not (np.asarray(request.alpha) >= full_scale(array.dtype)).all()
    ):
        raise OptionError(
            "light is levelled between opaque borders only; leave out {level}, or fill what is transparent",
            kind="conflict",
            parameter=Term("level"),
        )
    if flatten:
        shows = None if request.alpha is None else as_array(request.alpha, "alpha") > 0
        (array,) = flattened(array, shows, white)
    if not level:
        return array
    as_float(array, "image", white)  # refuses NaN
    return levelled_borders(array, request.wraps, white or full_scale(array.dtype))


def _band(request: TextureRequest, image: npt.ArrayLike, band: int | None, wraps: tuple[bool, bool]) -> int:
    """Check the width of the band along the borders, or choose it."""
    size = as_array(image).shape[:2]
    most = min(length for length, wrapping in zip(size, wraps, strict=True) if wrapping) // 4
    if band is None:
        band = min(size) // 8
        if most > _USUAL_BAND:  # else none can be wider
            middle = tuple(
                slice(max((length - _MEASURED_SIDE) // 2, 0), (length + _MEASURED_SIDE) // 2)
                for length in size
            )
            patch = natural_patch(as_array(image)[middle], data_range=request.white[0])
            band = patch if patch > _USUAL_BAND else min(band, _USUAL_BAND)
        band = int(np.clip(band, 4, most))
    try:
        return check_whole("band", band, 4, most)
    except OptionError as error:
        raise OptionError(
            "{parameter} is {value!r}; for {width} × {height} px give a whole number from "
            "{least} to {most} px",
            kind="whole number",
            parameter=Term("band"),
            value=band,
            allowed=error.allowed,
            width=size[1],
            height=size[0],
            least=4,
            most=most,
        ) from error


def _borders(size: tuple[int, int], wraps: tuple[bool, bool], reach: int) -> Mask:
    """Mark the pixels within reach of a border that is to match."""
    found = np.zeros(size, bool)
    for lines, wrapping in zip((found, found.T), wraps, strict=True):
        if wrapping:
            lines[:reach] = lines[-reach:] = True
    return found


def _steps(request: TextureRequest, image: npt.ArrayLike) -> list[Mask]:
    """Find where along the border of each axis the first pixels do not continue the last ones: (n,) bool."""
    maps = request.maps if request.normal is None else (*request.maps, request.normal)
    planes = [as_array(image), *(as_array(as_list(one, 1, "map")[0], "map") for one in maps)]
    white = [one or full_scale(plane.dtype) for one, plane in zip(request.white, planes, strict=True)]
    if request.alpha is not None:
        planes, white = [*planes, as_array(request.alpha, "alpha")], [*white, full_scale(planes[0].dtype)]
    steps = [np.zeros(length, bool) for length in planes[0].shape[1::-1]]
    for plane, one in zip(planes, white, strict=True):
        if plane.shape[:2] == planes[0].shape[:2]:  # others are refused when they are read
            for axis, line in enumerate(steps):
                first, last = (plane.take(end, axis=axis).astype(np.float64) for end in (0, -1))
                shows = ~(np.abs(first - last) <= UNSEEN_STEP * one)
                line |= shows.reshape(len(line), -1).any(axis=1)
    return steps


def _along_borders(
    size: tuple[int, int], wraps: tuple[bool, bool], band: int, steps: Sequence[Mask]
) -> tuple[list[tuple[int, int, tuple[int, int]]], Mask]:
    """Place square windows over the lines where borders meet, a quarter of each lying on the one before,
    wherever there is a step; and mark the pixels at these lines that are to go.
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


#: The former name of :func:`tile`.
make_tileable = tile
