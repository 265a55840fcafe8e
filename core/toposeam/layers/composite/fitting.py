"""Finish a composition to a rectangle: chosen, with slivers filled where that goes unseen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats32, Image, Mask
from toposeam.checks import check_kind
from toposeam.errors import TopoSeamError
from toposeam.images import Windows, blurred, box_of, full_scale
from toposeam.layers.boundary.fit import fitted_box
from toposeam.layers.boundary.ground import HOLE, ground_of, prices_of
from toposeam.layers.boundary.reduced import Overview, overview
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import blocks
from toposeam.layers.canvas.transforms import similarity
from toposeam.layers.composite.composition import Composition
from toposeam.layers.composite.painter import Filling

#: Pixels with their surroundings that are filled at once; larger holes are cropped.
_MOST_FILLED = 4_000_000
#: Width of the rim of real pixels beside a hole that is replaced, px: many pictures have a frame of one.
_RIM = 3
#: Surroundings of a hole that a fill takes from, px: times its depth, at least and at most.
_TIMES, _LEAST, _MOST = 4, 40, 200
#: Depth of a hole, px, whose fill goes unseen anywhere, and as a share of the shorter side.
_UNSEEN, _UNSEEN_SHARE = 8.0, 0.012
#: Deepest hole, px, that takes the mirrored pixels beside it.
_THIN = 16.0
#: Least area of plain ground ÷ that of a hole for a fill to take from nothing else.
_ENOUGH = 2.0
#: Of a fill that is seen: its mean differs by so much of full scale more than its surroundings spread, or its
#: roughness by a factor whose logarithm is so large.
_TONE, _ROUGHER = 0.03, 0.8

_Value = TypeVar("_Value", bound=np.generic)


def fitted(composed: Composition) -> Composition:
    """Crop a composition to the rectangle that is worth most, and fill what no layer shows in it.

    Real pixels count, and most where there is texture; holes cost little where the ground beside them is
    plain or evenly textured, so that a fill goes unseen, and much elsewhere. Of a round canvas the full width
    is kept.

    Returns
    -------
    Composition
        Opaque everywhere if a rectangle is; its :attr:`~Composition.filled` is the share that was filled.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> wall = np.random.default_rng(0).random((80, 90))
    >>> joined = ts.stitch([ts.Layer(wall[:, :60]), ts.Layer(wall[30:, 40:], at=(40, 30))])
    >>> joined.shape, fitted(joined).shape, fitted(joined).alpha is None
    ((80, 90), (80, 60), True)
    """
    check_kind("composed", composed, Composition, "the result of stitch")
    canvas = composed.canvas
    places, round_way = [similarity(layer.at) for layer in composed.layers], canvas.period is not None
    seen = overview(composed.layers, places, canvas.frame, canvas.period)
    if not seen.cover.any() or not _any_holes(composed):
        return composed
    ground = ground_of(seen)
    unseen = min(_UNSEEN, _UNSEEN_SHARE * min(canvas.shape)) / seen.scale
    prices = prices_of(seen.cover, ground, 0.0, unseen)
    box = _exact(composed, seen, prices, fitted_box(seen, prices, goes_round=round_way))
    patches, bad = _filled(composed, seen, box, ground.depth > 0)
    if bad:
        inside = np.zeros(seen.cover.shape, bool)
        inside[_reduced(box, composed, seen).slices] = True
        prices[1][~inside & ~seen.cover] = -HOLE  # what is not filled
        for part, where in bad:
            values = prices[1][_reduced(part, composed, seen).slices]
            places = [
                (np.arange(few) * many // max(1, few)).clip(0, many - 1)
                for few, many in zip(values.shape, where.shape, strict=True)
            ]
            near = scipy.ndimage.maximum_filter(where, int(np.ceil(seen.scale)))[np.ix_(*places)]
            values[near] = -HOLE
        box = _exact(composed, seen, prices, fitted_box(seen, prices, goes_round=round_way))
    return composed.crop(box.moved(-composed.view.top, -composed.view.left)).patched(patches)


def _all(seen: Overview) -> Box:
    return Box(0, 0, *seen.cover.shape)


def _reduced(box: Box, composed: Composition, seen: Overview) -> Box:
    """Return a box of the canvas as one of its overview."""
    left, top = composed.canvas.origin
    edges = [
        (edge + origin) / seen.scale - at
        for edge, origin, at in zip(box, (top, left) * 2, seen.at[::-1] * 2, strict=True)
    ]
    low, high = np.floor(edges[:2]).astype(int), np.ceil(edges[2:]).astype(int)
    return Box(int(low[0]), int(low[1]), int(high[0]), int(high[1])).shared(_all(seen))


def _exact(composed: Composition, seen: Overview, prices: tuple[Floats32, Floats32], small: Box) -> Box:
    """Return a box of the overview as one of the canvas, whose edges are moved inwards by pixels as far as
    that gains.
    """
    left, top = composed.canvas.origin
    edges = [
        round((edge + at) * seen.scale) - origin
        for edge, at, origin in zip(small, seen.at[::-1] * 2, (top, left) * 2, strict=True)
    ]
    box = Box(*edges).shared(composed.canvas.box)
    goes_round = composed.period is not None
    if goes_round:
        box = Box(box.top, 0, box.bottom, composed.canvas.shape[1])
    most = 2 * int(np.ceil(seen.scale)) + 2
    for axis in (0,) if goes_round else (0, 1, 0, 1):
        height, width = sides = box.shape
        depth = min(most, (sides[axis] - 1) // 2)
        strip = Box(0, 0, depth, width) if axis == 0 else Box(0, 0, height, depth)
        low = strip.moved(box.top, box.left)
        high = low.moved(*((height - depth, 0) if axis == 0 else (0, width - depth)))
        first = _losses(_worths(composed, seen, prices, low).sum(axis=1 - axis))
        last = _losses(_worths(composed, seen, prices, high).sum(axis=1 - axis)[::-1])
        if axis == 0:
            box = Box(box.top + first, box.left, box.bottom - last, box.right)
        else:
            box = Box(box.top, box.left + first, box.bottom, box.right - last)
    return box


def _losses(worths: Floats32) -> int:
    """Return how many of the first lines of pixels are worth less than nothing together."""
    return int(np.append(0, worths.cumsum()).argmin())


def _worths(composed: Composition, seen: Overview, prices: tuple[Floats32, Floats32], box: Box) -> Floats32:
    """Return what it is worth to have each pixel of a box of the canvas."""
    real, hole = (_near(each, composed, seen, box) for each in prices)
    return np.where(_holes(composed, box), hole, real)


def _near(
    values: npt.NDArray[_Value], composed: Composition, seen: Overview, box: Box
) -> npt.NDArray[_Value]:
    """Return values of the overview at the pixels of a box of the canvas."""
    left, top = composed.canvas.origin
    height, width = seen.cover.shape
    rows = np.floor((np.arange(box.top, box.bottom) + top + 0.5) / seen.scale).astype(int) - seen.at[1]
    columns = np.floor((np.arange(box.left, box.right) + left + 0.5) / seen.scale).astype(int) - seen.at[0]
    return values[np.ix_(np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1))]


def _any_holes(composed: Composition) -> bool:
    return any(_holes(composed, box).any() for box in blocks(composed.canvas.box))


def _holes(composed: Composition, box: Box) -> Mask:
    """Return which pixels of a box of the canvas are not opaque."""
    canvas = composed.canvas
    if not _is_stored(composed):
        alpha = composed.alpha
        inside = box.moved(-composed.view.top, -composed.view.left).slices
        return np.zeros(box.shape, bool) if alpha is None else alpha[inside] < full_scale(alpha.dtype)
    labels = np.asarray(composed.solution.labels[box.slices])
    holes = labels < 0
    turns = (0,) if canvas.period is None else (-canvas.period, 0, canvas.period)
    for number in np.unique(labels[~holes]).tolist():
        layer = canvas.layers[number]
        if layer.alpha is None:
            continue
        for turn in turns:
            place = canvas.places[number].moved(0, turn)
            common = place.shared(box)
            if all(common.shape):
                faint = np.asarray(layer.alpha[common.within(place)]) < full_scale(layer.image.dtype)
                holes[common.within(box)] |= faint & (labels[common.within(box)] == number)
    return holes


def _filled(
    composed: Composition, seen: Overview, box: Box, plain: Mask
) -> tuple[list[Filling], list[tuple[Box, Mask]]]:
    """Fill the holes in a box of the canvas; return also where a fill is seen, or was not made.

    Deep ones take from `plain` or evenly textured ground only, (H, W) of the overview, if there is enough.
    """
    patches: list[Filling] = []
    bad: list[tuple[Box, Mask]] = []
    for near in _parts(composed, seen, box):
        wide = near.grown(_MOST + _RIM).shared(composed.canvas.box)
        unknown = _holes(composed, wide)
        missing = unknown[near.within(wide)]
        if not missing.any():
            continue
        part = _box_of(missing).moved(near.top, near.left).grown(_RIM).shared(box)
        holes = unknown[part.within(wide)]
        beside = part.grown(1).shared(wide)
        far = scipy.ndimage.distance_transform_edt(unknown[beside.within(wide)])
        depth = float(far[part.within(beside)][holes].max())
        around = part.grown(int(np.clip(_TIMES * depth, _LEAST, _MOST))).shared(wide)
        mine = np.zeros(around.shape, bool)
        if mine.size > _MOST_FILLED:
            bad.append((part, holes))
            continue
        holes = scipy.ndimage.binary_dilation(holes, iterations=_RIM)
        unknown, inner = unknown[around.within(wide)], part.within(around)
        mine[inner] = holes
        image = _continued(
            _pixels(composed, around), mine, unknown & ~mine, depth, _near(plain, composed, seen, around)
        )
        if image is None:
            bad.append((part, holes))
            continue
        shows = _shows(image, mine, unknown & ~mine, min(box.shape))[inner]
        if shows.any():
            bad.append((part, shows))
        patches.append(Filling(part, image[inner], holes))
    return patches, bad


def _parts(composed: Composition, seen: Overview, box: Box) -> Iterator[Box]:
    """Yield boxes that hold the holes in a box of the canvas, each of those together that touch."""
    left, top = composed.canvas.origin
    height, width = seen.cover.shape
    found = np.zeros((height, width), bool)
    rows = max(1, _MOST_FILLED // box.shape[1])
    for first in range(box.top, box.bottom, rows):
        strip = Box(first, box.left, min(first + rows, box.bottom), box.right)
        y, x = np.nonzero(_holes(composed, strip))
        y = np.floor((y + strip.top + top + 0.5) / seen.scale).astype(np.intp) - seen.at[1]
        x = np.floor((x + strip.left + left + 0.5) / seen.scale).astype(np.intp) - seen.at[0]
        inside = (y >= 0) & (x >= 0) & (y < height) & (x < width)
        found[y[inside], x[inside]] = True
    together = scipy.ndimage.label(scipy.ndimage.binary_dilation(found, iterations=2))[0]
    for where in scipy.ndimage.find_objects(together):
        small = Box.of(*where)
        edges = [
            int(np.floor((edge + at) * seen.scale)) - origin
            for edge, at, origin in zip(small, seen.at[::-1] * 2, (top, left) * 2, strict=True)
        ]
        yield Box(*edges).grown(1).shared(box)


def _pixels(composed: Composition, box: Box) -> Image:
    """Return the pixels of a box of the canvas."""
    rows, columns = box.moved(-composed.view.top, -composed.view.left).slices
    return composed.window(rows, columns)[0] if _is_stored(composed) else composed.image[rows, columns]


def _is_stored(composed: Composition) -> bool:
    """Test whether pictures are read by windows, so that the whole result may be larger than memory."""
    return any(isinstance(layer.image, Windows) for layer in composed.layers)


def _continued(image: Image, holes: Mask, unknown: Mask, depth: float, plain: Mask) -> Image | None:
    """Return pixels with holes filled; None where nothing around them serves."""
    missing = holes | unknown
    nearest = scipy.ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    if depth <= _THIN:
        y, x = np.nonzero(holes)
        edge = nearest[:, y, x]
        mirrored = 2 * edge - np.stack([y, x])
        mirrored = np.clip(mirrored, 0, np.array(holes.shape)[:, None] - 1)
        mirrored = np.where(missing[tuple(mirrored)], edge, mirrored)
        continued = image.copy()
        continued[y, x] = image[tuple(mirrored)]
        return continued
    continued = image[tuple(nearest)]
    from toposeam.texture.fill import fill  # few pictures need it

    white = full_scale(image.dtype)
    source = plain & ~missing
    opacity = np.where(unknown, 0, white).astype(image.dtype) if unknown.any() else None
    try:
        return fill(
            continued,
            holes,
            alpha=opacity,
            source=source if source.sum() > _ENOUGH * holes.sum() else None,
            data_range=white if image.dtype.kind == "f" else None,
        ).image
    except TopoSeamError:
        return None


def _shows(image: Image, holes: Mask, unknown: Mask, short: int) -> Mask:
    """Tell where a fill has another mean, or another roughness, than the real pixels beside it."""
    gray = image.reshape(*holes.shape, -1).mean(axis=2, dtype=np.float32) / np.float32(
        full_scale(image.dtype)
    )
    rough = np.abs(gray - blurred(gray, 1.5)[0])
    size = 2 * max(8, short // 24) + 1
    real = ~(scipy.ndimage.binary_dilation(holes, np.ones((3, 3))) | unknown)
    found = []
    for which in (holes.astype(np.float32), real.astype(np.float32)):
        share, mean, square, roughness = (
            scipy.ndimage.uniform_filter(each * which, size, mode="constant")
            for each in (np.float32(1), gray, gray * gray, rough)
        )
        some = np.maximum(share, 1e-4)
        spread = np.sqrt(np.maximum(square / some - (mean / some) ** 2, 0))
        found.append((share > 0.05, mean / some, spread, roughness / some))
    (some, mean, _, roughness), (known, beside, spread, usual) = found
    rougher = np.abs(np.log((roughness + 0.003) / (usual + 0.003))) > _ROUGHER
    return np.asarray(holes & some & known & ((np.abs(mean - beside) > spread + _TONE) | rougher))


def _box_of(mask: Mask) -> Box:
    return Box.of(*box_of(mask))
