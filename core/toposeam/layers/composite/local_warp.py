"""Bend layers along their seams, so that lines and edges that cross a seam are continuous.

A seam is sampled at points of equal distance. At each point, patches of both layers are compared at every
displacement of the upper layer up to a largest one, by 1 - SSIM (Wang et al. 2004,
doi:10.1109/TIP.2003.819861) plus the difference of colours. Dynamic programming finds the sequence of
displacements of least cost along the seam, in which neighbouring points differ by at most 1 px. The
displacements spread from the seams into the layer and decay with the distance b, as the solution of
(1 - b² ∇²) u = 0. A seam whose cost falls too little is left as it is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats
from toposeam.images import as_float, full_scale, in_dtype
from toposeam.layers.canvas.cylinder import narrowed
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.warping import inside, interpolated, resampled
from toposeam.layers.composite.composition import Composition
from toposeam.layers.labelling.label_map import Pair

#: Distance of the points along a seam, px; it grows where a line has more than _MOST_POINTS of them.
_POINT_SPACING, _MOST_POINTS = 3.0, 1500
#: Patches reach this many px from their centre on each side.
_PATCH_RADIUS = 5
#: Decay length b of displacements, px: at least the first, and the second for each px of the largest one, so
#: that strong displacements do not fold the picture.
_LEAST_DECAY, _DECAY_PER_PX = 48.0, 6.0
#: Costs added up by the dynamic programme, in units of 1 - SSIM: of a patch with missing pixels; of each px
#: of displacement, so that none is the default; of a displacement beyond the largest; of each px of change
#: between neighbouring points, so that displacements vary smoothly.
_MISSING_COST, _COST_PER_PX, _BEYOND_COST, _CHANGE_COST = 3.0, 0.012, 1e3, 0.06
#: Least relative fall of the mean patch cost for a seam to be bent, and of the match cost of all seams for
#: the bent layers to be kept.
_LEAST_PATCH_GAIN, _LEAST_MATCH_GAIN = 0.1, 0.03
#: Side of the cells on which displacements are spread, px; larger ones are taken where there would be more
#: than _MOST_NODES nodes. Displacements below _LEAST_MOVE px are treated as zero.
_CELL, _MOST_NODES, _LEAST_MOVE = 4, 100_000, 0.05


def give_way(
    composed: Composition, most: int, compose: Callable[[Sequence[Layer]], Composition]
) -> Composition:
    """Bend layers along the seams of a composition and compose them again.

    Parameters
    ----------
    composed : Composition
    most : int
        Largest displacement, px.
    compose : callable
        Composes the bent layers, without matching their tones again.

    Returns
    -------
    Composition
        The given one where bending lowers the cost of all seams together by less than 3 %.
    """
    period = composed.period
    layers = [_in_memory(layer if period is None else narrowed(layer, period)) for layer in composed.layers]
    corner = np.array(composed.origin, float)
    seams = [
        (seam.pair, [np.asarray(line.points) + corner for line in seam.paths]) for seam in composed.outlines
    ]
    bent, farthest = bend(layers, seams, most, period)
    if not farthest:
        return composed
    again = compose(bent)
    if again.cost > (1 - _LEAST_MATCH_GAIN) * composed.cost:
        return composed
    return dataclasses.replace(again, bent=farthest)


def _in_memory(layer: Layer) -> Layer:
    """Return the layer with its pixels in memory."""
    alpha = None if layer.alpha is None else np.asarray(layer.alpha[:, :])
    return dataclasses.replace(layer, image=np.asarray(layer.image[:, :]), alpha=alpha)


def bend(
    layers: Sequence[Layer],
    seams: Iterable[tuple[Pair, Sequence[Floats]]],
    most: int,
    period: int | None = None,
) -> tuple[list[Layer], float]:
    """Displace the upper layer of each seam so that its contents continue those of the lower one.

    Parameters
    ----------
    layers : sequence of Layer
    seams : pairs of layers, by number, with the lines between them
        Each line is an (N, 2) array of x and y in the coordinates of the layers.
    most : int
        Largest displacement, px.
    period : int, optional
        Width of a canvas that goes all the way round, px.

    Returns
    -------
    list of Layer
    float
        The largest displacement, px.
    """
    farthest = 0.0
    pinned: list[list[tuple[Floats, Floats]]] = [[] for _ in layers]
    for (i, j), lines in seams:
        for line in lines:
            points = _equidistant_points(line)
            if len(points) < 2:
                continue
            a, b = (_in_period_of(layers[k], points, period) for k in (i, j))
            moves = _displacements(a, b, points, most)
            for k, beside, fixed in ((i, a, np.zeros_like(moves)), (j, b, moves)):
                pinned[k].append((points - np.array(beside.at) + np.array(layers[k].at), fixed))
            farthest = max(farthest, float(np.hypot(*moves.T).max()))
    reach = max(_LEAST_DECAY, _DECAY_PER_PX * most)
    return [_warped(layer, found, reach) for layer, found in zip(layers, pinned, strict=True)], farthest


def _in_period_of(layer: Layer, points: Floats, period: int | None) -> Layer:
    """Move a layer of a round canvas by whole periods to the period in which points lie."""
    if period is None:
        return layer
    x, y = layer.at
    turns = round((float(points[:, 0].mean()) - x - layer.image.shape[1] / 2) / period)
    return dataclasses.replace(layer, at=(x + turns * period, y)) if turns else layer


def _equidistant_points(points: Floats) -> Floats:
    """Resample a line; return (M, 2) points x and y at equal distances along it."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    far = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.arange(0, far[-1] + 1e-9, max(_POINT_SPACING, far[-1] / _MOST_POINTS))
    return np.stack([np.interp(at, far, points[:, axis]) for axis in range(2)], axis=1)


def _displacements(a: Layer, b: Layer, points: Floats, most: int) -> Floats:
    """Find the (M, 2) displacements of b, px, at points of a seam; zero where that gains too little."""
    centres = np.rint(points - 0.5).astype(int)
    own, there = _patches(a, centres, _PATCH_RADIUS), _patches(b, centres, _PATCH_RADIUS + most)
    reach = np.arange(-most, most + 1)
    costs = np.empty((len(points), len(reach), len(reach)))
    side = 2 * _PATCH_RADIUS + 1
    for row in range(len(reach)):
        for column in range(len(reach)):
            costs[:, row, column] = _dissimilarity(own, there[:, row : row + side, column : column + side])
    costs[costs[:, most, most] >= _MISSING_COST] = 0  # beyond the end of a layer nothing can be compared
    far = np.hypot(reach[:, np.newaxis], reach)
    costs += np.where(far <= most, _COST_PER_PX * far, _BEYOND_COST)
    found = _cheapest_path(costs)
    at = np.arange(len(points))
    before, after = costs[:, most, most], costs[at, found[:, 0], found[:, 1]]
    if not after.mean() < (1 - _LEAST_PATCH_GAIN) * before.mean():
        return np.zeros((len(points), 2))
    fine = (found - most + _subpixel_shifts(costs, found)).astype(float)
    smooth = scipy.ndimage.gaussian_filter1d(fine, 2.0, axis=0, mode="nearest")
    return np.asarray(smooth[:, ::-1])


def _patches(layer: Layer, centres: npt.NDArray[np.intp], half: int) -> npt.NDArray[np.float32]:
    """Return (M, 2h + 1, 2h + 1, C) patches round pixels of the canvas; NaN where the layer is not opaque."""
    x, y = centres.T - np.array(layer.at)[:, np.newaxis]
    height, width = layer.image.shape[:2]
    low = np.array([max(y.min() - half, 0), max(x.min() - half, 0)])
    high = np.array([min(y.max() + half + 1, height), min(x.max() + half + 1, width)])
    part = slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))
    values = as_float(np.asarray(layer.image[part]), layer.title, layer.data_range).astype(np.float32)
    if layer.alpha is not None:
        values[np.asarray(layer.alpha[part]) < full_scale(layer.alpha.dtype)] = np.nan
    offsets = np.arange(-half, half + 1)
    rows = y[:, np.newaxis, np.newaxis] - low[0] + offsets[:, np.newaxis]
    columns = x[:, np.newaxis, np.newaxis] - low[1] + offsets
    inside = (rows >= 0) & (rows < values.shape[0]) & (columns >= 0) & (columns < values.shape[1])
    rows, columns = np.where(inside, rows, 0), np.where(inside, columns, 0)
    found = values[rows, columns]
    found[~inside] = np.nan
    return found


def _dissimilarity(a: npt.NDArray[np.float32], b: npt.NDArray[np.float32]) -> Floats:
    """Return (M,) dissimilarities of patches: 1 - SSIM plus twice the mean absolute difference."""
    c1, c2 = 0.01**2, 0.03**2
    axes = (1, 2)
    mean_a, mean_b = a.mean(axis=axes), b.mean(axis=axes)
    var_a, var_b = a.var(axis=axes), b.var(axis=axes)
    cov = (a * b).mean(axis=axes) - mean_a * mean_b
    ssim = (2 * mean_a * mean_b + c1) * (2 * cov + c2)
    ssim /= (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    dissimilarity = 1 - ssim.mean(axis=1) + 2 * np.abs(a - b).mean(axis=(1, 2, 3))
    return np.where(np.isfinite(dissimilarity), dissimilarity, _MISSING_COST).astype(float)


def _cheapest_path(costs: Floats) -> npt.NDArray[np.intp]:
    """Find the sequence of least total cost through (M, K, K) states, moving by one state at most.

    Returns (M, 2) rows and columns.
    """
    count, rows, columns = costs.shape
    steps = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    total = costs[0]
    chosen = np.empty((count, rows, columns), np.int8)
    for number in range(1, count):
        padded = np.pad(total, 1, constant_values=np.inf)
        before = np.stack(
            [
                padded[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns] + _CHANGE_COST * np.hypot(dy, dx)
                for dy, dx in steps
            ]
        )
        chosen[number] = before.argmin(axis=0)
        total = before.min(axis=0) + costs[number]
    state = np.array(np.unravel_index(int(total.argmin()), total.shape))
    found = np.empty((count, 2), np.intp)
    for number in range(count - 1, -1, -1):
        found[number] = state
        if number:
            state = state + np.array(steps[chosen[number][tuple(state)]])
    return found


def _subpixel_shifts(costs: Floats, found: npt.NDArray[np.intp]) -> Floats:
    """Refine the cheapest displacements to subpixels by a parabola through their neighbours; (M, 2) px."""
    at, last = np.arange(len(found)), costs.shape[1] - 1
    shifts = np.zeros(found.shape)
    for axis in range(2):
        step = np.eye(2, dtype=int)[axis]
        low, high = np.maximum(found - step, 0), np.minimum(found + step, last)
        here, one, other = (costs[at, own[:, 0], own[:, 1]] for own in (found, low, high))
        bend = one + other - 2 * here
        inner = (found[:, axis] > 0) & (found[:, axis] < last) & (bend > 1e-6)
        shifts[:, axis] = np.where(inner, (one - other) / (2 * np.where(inner, bend, 1.0)), 0.0)
    return np.clip(shifts, -0.5, 0.5)


def _warped(layer: Layer, pinned: Sequence[tuple[Floats, Floats]], reach: float) -> Layer:
    """Warp a layer by displacements that are given at points and decay away from them."""
    if not pinned:
        return layer
    points, moves = (np.concatenate(parts) for parts in zip(*pinned, strict=True))
    if np.abs(moves).max() < _LEAST_MOVE:
        return layer
    height, width = layer.image.shape[:2]
    far = 3 * reach
    moved = np.abs(moves).max(axis=1) >= _LEAST_MOVE
    own = points - np.array(layer.at)
    low = np.maximum(np.floor(own[moved].min(axis=0) - far), 0).astype(int)
    high = np.minimum(np.ceil(own[moved].max(axis=0) + far), (width, height)).astype(int)
    field = _spread_displacements(own - low, moves, (high - low)[::-1], reach)
    part, bends = (slice(low[1], high[1]), slice(low[0], high[0])), np.abs(field).max(axis=2) >= _LEAST_MOVE
    if not bends.any():
        return layer
    at = (np.stack(np.nonzero(bends)[::-1], axis=-1) + low + field[bends]).astype(float)
    whole = np.asarray(layer.image)
    image, known = whole.copy(), np.ones((height, width), np.float32)
    values = resampled(whole.reshape(height, width, -1), layer.white, at)
    image[part][bends] = values if whole.ndim == 3 else values[:, 0]
    if layer.alpha is not None:
        known *= np.asarray(layer.alpha) / np.float32(full_scale(layer.alpha.dtype))
    opacity = known.copy()
    # A pixel that is interpolated from missing ones becomes transparent: a half opaque one would be taken for
    # the end of the layer.
    has_pixels = interpolated((known > 0).astype(np.float32), at)
    shown = inside(at, (width, height)) & (has_pixels > 1 - _LEAST_MOVE / 2)
    opacity[part][bends] = np.where(shown, interpolated(known, at), 0)
    alpha = in_dtype(opacity * np.float32(full_scale(whole.dtype)), whole.dtype)
    return dataclasses.replace(layer, image=image, alpha=alpha)


def _spread_displacements(
    points: Floats, moves: Floats, shape: npt.NDArray[np.intp], reach: float
) -> npt.NDArray[np.float32]:
    """Interpolate (M, 2) displacements at points of a part of a layer to an (h, w, 2) field.

    Known cells are fixed; the others solve a conduction problem with losses.
    """
    grid = max(_CELL, int(np.sqrt(shape.prod() / _MOST_NODES)))
    rows, columns = (int(size) // grid + 2 for size in shape)
    near = np.rint(points / grid).astype(int)
    inside_grid = (near >= 0).all(axis=1) & (near[:, 0] < columns) & (near[:, 1] < rows)
    cell = near[inside_grid, 1] * columns + near[inside_grid, 0]
    count = np.bincount(cell, minlength=rows * columns)
    sums = [np.bincount(cell, own, rows * columns) for own in moves[inside_grid].T]
    values, known = np.stack(sums, axis=1) / np.maximum(count, 1)[:, np.newaxis], count > 0
    down, across = (_second_differences(size) for size in (rows, columns))
    one = scipy.sparse.eye_array
    loss = (grid / reach) ** 2 * one(rows * columns)
    conduction = (scipy.sparse.kron(down, one(columns)) + scipy.sparse.kron(one(rows), across) + loss).tocsr()
    free = ~known
    solved = scipy.sparse.linalg.splu(conduction[free][:, free].tocsc())
    values[free] = solved.solve(-(conduction[free][:, known] @ values[known]))
    at = np.stack(np.meshgrid(*(np.arange(size) / grid for size in shape), indexing="ij"))
    planes = np.moveaxis(values.reshape(rows, columns, 2), -1, 0)
    found = [scipy.ndimage.map_coordinates(plane, at, order=1, output=np.float32) for plane in planes]
    return np.stack(found, axis=-1)


def _second_differences(count: int) -> scipy.sparse.dia_array:
    """Return the matrix of negative second differences on a line with insulated ends."""
    middle = np.full(count, 2.0)
    middle[[0, -1]] = 1
    beside = -np.ones(count - 1)
    return scipy.sparse.diags_array([middle, beside, beside], offsets=[0, 1, -1])
