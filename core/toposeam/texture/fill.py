"""Holes filled from the rest of the picture: textures by patches, photographs by shifted copies."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Indices, Mask
from toposeam.checks import Seed, check_choice, check_function, check_whole
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import box_of
from toposeam.texture.assemble_result import finish
from toposeam.texture.canvas.progress import stage
from toposeam.texture.canvas.rendering import Lift
from toposeam.texture.canvas.synthesis import Synthesis
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import box_sum
from toposeam.texture.exemplar.scale import SMALLEST_PATCH
from toposeam.texture.exemplar.sources import DataRange, Images
from toposeam.texture.holes.crossing_lines import CrossingBand, crossing_bands, kept_by, strips_of
from toposeam.texture.holes.hole_window import Holed, read_holed
from toposeam.texture.holes.homogeneity import is_texture
from toposeam.texture.holes.shift_candidates import candidate_shifts
from toposeam.texture.holes.shift_map import shift_map
from toposeam.texture.holes.shift_map_moves import Ground
from toposeam.texture.light.levelling import levelled
from toposeam.texture.periodicity.period import find_order
from toposeam.texture.periodicity.phase import Phase
from toposeam.texture.placement.options import LayKeywords, LayOptions
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.placement.request import TextureRequest
from toposeam.texture.synthesize import check_patch
from toposeam.typing import BYS as BYS
from toposeam.typing import By as By

#: Largest side of a hole with its band, in sides of a usual patch, that is filled by one patch along a closed
#: seam.
_ONE_PATCH_SIZE = 2.0
#: Width, px, of the band round a hole that shifted copies may change as well.
_BAND = 8
#: Number of shifts by which a picture repeats itself that are tried.
_SHIFTS = 32
#: Length of the part of a crossing line that may be copied, as a share of the hole's size.
_LINE_REACH = 1.0
#: Largest distance between holes that are filled together, as a share of their size.
_GROUP_DISTANCE = 0.25
#: Number of pixels near a hole, about, that are searched in larger pictures.
_SEARCHED_PIXELS = 1 << 20
#: Least distance to either side of a hole that is searched, as a share of the hole's size.
_SEARCHED_SHARE = 1.5


def fill(
    image: npt.ArrayLike,
    mask: npt.ArrayLike,
    *,
    by: By = "auto",
    patch: int | None = None,
    overlap: float | None = None,
    seed: Seed = 0,
    band: int | None = None,
    alpha: npt.ArrayLike | None = None,
    source: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    maps: Sequence[Images] = (),
    normal: npt.ArrayLike | None = None,
    weights: Sequence[float] | None = None,
    data_range: DataRange = None,
    smooth: int = 1,
    level: bool = True,
    progress: Callable[[float], None] | None = None,
    options: LayOptions | None = None,
    **given: Unpack[LayKeywords],
) -> Synthesis:
    """Replace part of a picture by what the rest of it is like.

    A texture is continued by patches, from outside inwards, each cut along the best seam. A photograph is
    stitched from copies of itself, each shifted as a whole (:mod:`toposeam.texture.holes.shift_map`), and
    levelled so that light runs on. Seams may run through a band round the hole.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Gray or RGB.
    mask : (H, W) array_like
        True (or not 0) where the picture is to be replaced.
    by : {"auto", "patches", "shifts"}
        How: `auto` takes patches where the picture is alike everywhere round the hole, or where their size is
        given, and shifts elsewhere.
    patch : int, optional
        Side of a patch, px; by default by the size of the picture's elements.
    overlap : int or float, optional
        How far patches overlap, px, or below 1 as a share of the patch; by default a quarter.
    seed : int, Generator or None
        The same seed gives the same bytes; the result keeps it.
    band : int, optional
        Width of the band round the hole that may change as well, px; by default the overlap, with shifts 8.
        Everything beyond stays as it is, bit for bit.
    alpha : (H, W) array_like, optional
        Opacity; what is fully transparent is neither copied nor compared nor filled.
    source, avoid : (H, W) array_like, optional
        What may be copied, and what may not; by default everything outside the hole.
    level : bool
        Whether shifted copies are levelled; for pictures whose values are no colours it should be False. Maps
        never are.
    maps, normal, weights, data_range, smooth, progress, options
        As for :func:`toposeam.synth`; of the options only `method` matters to shifts.

    Returns
    -------
    Synthesis
        Patch 0 is what was there before. Of shifts, each is one patch; ``settings["by"]`` tells which it was.

    Raises
    ------
    ImageError, OptionError
        Their text says what was received and what to do.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> image = np.random.default_rng(0).random((60, 60))
    >>> mask = np.zeros((60, 60), bool)
    >>> mask[20:32, 24:40] = True
    >>> filled = ts.fill(image, mask, patch=16).image
    >>> bool((filled[0] == image[0]).all())
    True
    """
    check_function("progress", progress)
    request = TextureRequest.of(
        "fill",
        options,
        given,
        seed=seed,
        smooth=smooth,
        alpha=alpha,
        maps=maps,
        normal=normal,
        weights=weights,
        data_range=data_range,
    )
    check_choice("by", by, BYS)
    check_choice("level", level, (True, False))
    if by == "shifts" and (patch is not None or overlap is not None):
        raise OptionError(
            "{patch} and {overlap} say how large patches are; leave them out with {shifts}",
            kind="conflict",
            parameter=Term("patch" if overlap is None else "overlap"),
            shifts=Term("by", value="shifts"),
        )
    holed = read_holed(request, image, mask, source, avoid, features=False)
    if by == "auto":
        texture = patch is not None or overlap is not None
        texture = texture or is_texture(partial(holed.sources.features_in, 0), holed.hole, holed.ground)
        by = "patches" if texture else "shifts"
    settings = {"by": by, "pixels": int(holed.hole.sum()), **request.settings}
    if by == "shifts":
        return _by_shifts(request, holed, band, level, source is not None, settings, progress)
    holed = dataclasses.replace(holed, sources=holed.sources.with_features())
    return _by_patches(request, holed, patch, overlap, band, settings, progress)


def _by_shifts(
    request: TextureRequest,
    holed: Holed,
    band: int | None,
    level: bool,
    restricted: bool,
    settings: dict[str, Any],
    progress: Callable[[float], None] | None,
) -> Synthesis:
    """Fill holes by shifted copies of the picture."""
    band = check_whole("band", _BAND if band is None else band, 0)
    near = _disk_dilation(holed.hole, band) & holed.ground
    stitched = list(_stitched(request, holed, near, restricted, progress))
    atlas, canvas = holed.canvas(request)
    for (top, left), step, shows in stitched:
        start = atlas.corners[0] + np.array([top, left]) + step
        rows, columns = (
            np.int32(first) + np.arange(length, dtype=np.int32)
            for first, length in zip(start, shows.shape, strict=True)
        )
        canvas.paint(top, left, rows[:, np.newaxis] * np.int32(atlas.width) + columns, shows)
    settings |= {"band": band, "level": level}
    lift = None
    if level:
        plane, box = atlas.spread(holed.sources.planes[0]), box_of(near, request.smooth + 1)
        seen = atlas.usable[..., np.newaxis]
        high = plane.max(where=seen, initial=plane.min())
        low = plane.min(where=seen, initial=high)
        white = (float(high) - float(low)) or 1.0
        added = levelled(plane, atlas.usable, canvas.index[box], near[box], white)
        lift = partial(_lift, added, (float(low), float(high)))
    height, width = (side.stop - side.start for side in box_of(near))
    return finish(holed.sources, atlas, canvas, (height, width), settings, request, near, lift)


def _by_patches(
    request: TextureRequest,
    holed: Holed,
    patch: int | None,
    overlap: float | None,
    band: int | None,
    settings: dict[str, Any],
    progress: Callable[[float], None] | None,
) -> Synthesis:
    """Fill holes by patches, which keep step with the order of the picture."""
    sources, hole = holed.sources, holed.hole
    side, lap = check_patch(sources, patch, overlap)
    band = check_whole("band", lap if band is None else band, 0)
    near = _disk_dilation(hole, band) & holed.ground
    atlas, canvas = holed.canvas(request)
    order, phase = None, None
    if request.options.close:
        order = find_order(sources.features[0], sources.usable[0])
    if order is not None:
        phase, first = Phase(order, order.reciprocal, atlas.factor), atlas.corners[0].tolist()
        phase.begin((0, 0), (first[0], first[1]), (0, 0))
    placer = holed.placer(request, atlas, canvas, phase)
    for top, left, shape in _windows(placer, hole, side, band):
        rows, columns, _ = canvas.window(top, left, *shape)
        placer.lay(top, left, shape, near[rows, columns])
        if progress is not None:
            progress(1 - int(((canvas.index < 0) & hole).sum()) / settings["pixels"])
    settings |= {"patch": side, "overlap": lap, "band": band}
    return finish(sources, atlas, canvas, (side, side), settings, request, near)


def _stitched(
    request: TextureRequest,
    holed: Holed,
    near: Mask,
    restricted: bool,
    progress: Callable[[float], None] | None,
) -> Iterator[tuple[tuple[int, int], Indices, Mask]]:
    """Fill each hole by shifted copies of the picture; yield the corner of each, its shift, and where it
    shows.
    """
    hole, ground, copied = holed.hole, holed.ground, holed.sources.usable[0]
    rng, options = request.rng, request.options
    box, pieces = _grouped(hole, near)
    done, total = 0, int(hole.sum())
    for number in range(1, int(pieces.max()) + 1):
        group = np.zeros(hole.shape, bool)
        group[box] = pieces == number
        part, beside = hole & group, near & group
        del group
        seen = _surroundings(part, copied, restricted)
        missing = hole[seen]
        piece = Atlas.of([(ground & ~hole)[seen]], options.context, [copied[seen]])
        features = piece.spread([holed.sources.features_in(0, seen)])
        shifts = candidate_shifts(piece, features, part[seen], missing, _SHIFTS, rng)
        del features, piece
        bands = _crossing(request, holed, part[seen], (ground & ~hole)[seen], seen)
        if bands:
            reach = _LINE_REACH * max(side.stop - side.start for side in box_of(part))
            shifts = np.concatenate([shifts, *(band.shifts(reach) for band in bands)])
        view = Ground(
            planes=partial(holed.sources.feature_planes, 0, seen),
            hole=part[seen],
            copied=copied[seen],
            present=ground[seen] & (~missing | part[seen]),
            near=beside[seen],
            lines=strips_of(bands, part[seen]) if bands else None,
            keeps=kept_by(bands, shifts) if bands else None,
        )
        report = stage(progress, done / total, int(part.sum()) / total)
        label = shift_map(view, shifts, options.method, report)
        for index in np.unique(label[label >= 0]).tolist():
            shown = box_of(label == index)
            at = shown[0].start + seen[0].start, shown[1].start + seen[1].start
            yield at, shifts[index], label[shown] == index
        done += int(part.sum())


def _crossing(
    request: TextureRequest, holed: Holed, part: Mask, known: Mask, seen: tuple[slice, slice]
) -> list[CrossingBand]:
    """Find the straight lines that cross a hole in a window of the picture."""
    image = holed.sources.planes[0][0][seen]
    gray = image.mean(axis=2, dtype=np.float32) / np.float32(request.white_of(holed.sources))
    return crossing_bands(gray, part, known)


def _surroundings(part: Mask, copied: Mask, restricted: bool) -> tuple[slice, slice]:
    """Select the rows and columns that are searched to fill a hole: of large pictures those near it, and
    whatever the caller says may be copied.
    """
    whole = slice(0, part.shape[0]), slice(0, part.shape[1])
    if part.size <= _SEARCHED_PIXELS:
        return whole
    box = box_of(part)
    reach = max(
        math.isqrt(_SEARCHED_PIXELS) // 2,
        round(_SEARCHED_SHARE * max(side.stop - side.start for side in box)),
    )
    near = box_of(part, reach)
    if restricted and copied.any():
        near = box_of(copied | part, 1)
    return near if np.count_nonzero(copied[near]) >= 2 * np.count_nonzero(part) else whole


def _grouped(hole: Mask, near: Mask) -> tuple[tuple[slice, slice], npt.NDArray[np.int32]]:
    """Number the holes: rows and columns round all of them, and there the number at each pixel in or near
    one; holes near each other have one number.
    """
    longest = max(side.stop - side.start for side in box_of(hole))
    around = box_of(near | hole, max(2 * _BAND, round(_GROUP_DISTANCE * longest)))
    hole, near = hole[around], near[around]
    pieces, _ = ndimage.label(hole, np.ones((3, 3), bool))
    wide = np.zeros(hole.shape, bool)
    for number, box in enumerate(ndimage.find_objects(pieces), start=1):
        reach = max(2 * _BAND, round(_GROUP_DISTANCE * max(side.stop - side.start for side in box)))
        grown = tuple(
            slice(max(side.start - reach, 0), min(side.stop + reach, limit))
            for side, limit in zip(box, hole.shape, strict=True)
        )
        wide[grown] |= ndimage.distance_transform_edt(pieces[grown] != number) <= reach
    return around, ndimage.label(wide | near)[0]


def _windows(
    placer: PatchPlacer, hole: Mask, side: int, band: int
) -> Iterator[tuple[int, int, tuple[int, int]]]:
    """Yield windows that cover the hole: a whole hole at once where it is small, else from outside inwards,
    by what of the canvas is empty yet.
    """
    canvas = placer.canvas
    pieces, _ = ndimage.label(hole, np.ones((3, 3), bool))
    large = np.zeros_like(hole)
    for number, box in enumerate(ndimage.find_objects(pieces), start=1):
        first = [max(part.start - band - 1, 0) for part in box]
        last = [min(part.stop + band + 1, limit) for part, limit in zip(box, canvas.shape, strict=True)]
        shape = last[0] - first[0], last[1] - first[1]
        if max(shape) <= _ONE_PATCH_SIZE * side and _has_room(placer, shape, (first[0], first[1])):
            yield first[0], first[1], shape
        else:
            large |= pieces == number
    height, width = (min(side, length) for length in canvas.shape)
    if large.any() and not _has_room(placer, (height, width)):
        raise ImageError(
            "no place outside {mask} has room for a patch of {width} × {height} px; use "
            "{smaller}a smaller mask",
            kind="no room",
            mask=Term("mask", "the mask"),
            width=width,
            height=height,
            smaller="smaller patches or " if min(width, height) > SMALLEST_PATCH else "",
        )
    while True:
        empty = (canvas.index < 0) & large
        if not empty.any():
            return
        part = box_of(empty, max(height, width))
        known = canvas.index[part] >= 0
        edge = empty[part] & ndimage.binary_dilation(known, np.ones((3, 3), bool))
        if not edge.any():
            edge = empty[part]
        around = ((height // 2, height - height // 2 - 1), (width // 2, width - width // 2 - 1))
        share = box_sum(np.pad(known, around), (height, width))
        row, column = divmod(int(np.where(edge, share, -1).argmax()), known.shape[1])
        at = row + part[0].start, column + part[1].start
        window = _window(canvas.shape, at, (height, width))
        smaller = height, width
        while not _has_room(placer, smaller, window[:2]) and min(smaller) >= 2 * SMALLEST_PATCH:
            smaller = smaller[0] // 2, smaller[1] // 2
            window = _window(canvas.shape, at, smaller)
        yield window


def _lift(added: Floats32, limits: tuple[float, float], channel: int) -> Lift:
    """Select what is added to a channel."""
    one = np.broadcast_to(np.float32(1), (*added.shape[:2], 1))
    return Lift(gain=one, offset=added[..., channel : channel + 1], low=limits[0], high=limits[1])


def _window(
    room: tuple[int, int], at: tuple[int, int], shape: tuple[int, int]
) -> tuple[int, int, tuple[int, int]]:
    """Centre a window of a shape on a pixel, as far as there is room."""
    top, left = (
        min(max(middle - length // 2, 0), limit - length)
        for middle, length, limit in zip(at, shape, room, strict=True)
    )
    return top, left, shape


def _has_room(placer: PatchPlacer, shape: tuple[int, int], at: tuple[int, int] | None = None) -> bool:
    """Test whether there are places for a patch of a shape; for a window of the canvas, places in step with
    the picture's order.
    """
    if any(length > limit for length, limit in zip(shape, placer.atlas.usable.shape, strict=True)):
        return False
    room = placer.ranking.search.room(shape)
    if at is not None and placer.phase is not None:
        room = room & placer.phase.allows(at, shape, *map(np.arange, room.shape))
    return bool(room.any())


def _disk_dilation(mask: Mask, radius: int) -> Mask:
    """Mark the pixels within a distance, px, of the mask."""
    if radius == 0:
        return mask
    grown = np.zeros_like(mask)
    box = box_of(mask, radius)
    grown[box] = ndimage.distance_transform_edt(~mask[box]) <= radius
    return grown
