"""Values continued into a region as a membrane, and copies levelled to one another and to what surrounds
them.

A region of copies keeps the gradients of each copy, takes the mean of both sides' gradients across a seam,
and has the picture's values where it ends: a Poisson equation (Pérez et al. 2003,
doi:10.1145/882262.882269). Its correction is smooth within each of the copies, so detail stays. Where
two copies differ by more than light does, nothing is levelled across their seam: it is an edge, and its
difference would bleed into both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage, sparse
from scipy.sparse import linalg

from toposeam.arrays import Floats, Floats32, Ints32, Mask

#: Largest number of unknowns of a system that is factorised; larger ones are iterated, which takes less
#: memory.
_DIRECT = 60_000
_SYMMETRIC: Any = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}
#: Least side, px, of the blocks that are one unknown each of the coarse system.
_LEAST_BLOCK = 8
#: Relative residual at which the iteration ends, and largest number of its steps.
_TOLERANCE, _MOST_STEPS = 5e-4, 200
#: Difference across a seam, as a share of white, that is levelled with half the weight; much larger ones are
#: edges.
_HALF_WEIGHT = 0.1

_NEIGHBOURS: Any = ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))

Steps = list[tuple[Floats32, Floats32]]


def membrane(values: Floats32, region: Mask) -> Floats32:
    """Continue values into a region from its border, as smoothly as a membrane.

    Parameters
    ----------
    values : (H, W, F) float32 array
        Any values in the region.
    region : (H, W) bool array

    Returns
    -------
    (H, W, F) float32 array
        `values` outside of the region.
    """
    result = values.copy()
    factor = 1
    while np.count_nonzero(region) / factor**2 > 4000:
        factor *= 2
    if factor > 1:  # it is smooth: what a smaller picture says is enough
        h, w = (-(-length // factor) for length in region.shape)
        rows, columns = (
            np.minimum(factor * np.arange(n) + factor // 2, length - 1)
            for n, length in zip((h, w), region.shape, strict=True)
        )
        at = np.ix_(rows, columns)
        small = membrane(values[at], region[at])
        for c in range(values.shape[2]):
            grown = ndimage.zoom(small[..., c], factor, order=1, grid_mode=True, mode="nearest")
            np.copyto(result[..., c], grown[: region.shape[0], : region.shape[1]], where=region)
        return result
    if region.all() or not region.any():
        return result
    steps = [
        (np.zeros(region[s].shape + values.shape[2:], np.float32), np.ones(region[s].shape, np.float32))
        for s, _ in _NEIGHBOURS
    ]
    result[region] = _poisson(values, region, steps)
    return result


def levelled(
    plane: npt.NDArray[Any], usable: Mask, index: Ints32, region: Mask, white: float = 1.0
) -> Floats32:
    """Compute the correction of the copies in a region by which they fit each other and their surroundings.

    Parameters
    ----------
    plane : (AH, AW, C) array
        The picture that was copied from, on its atlas.
    usable : (AH, AW) bool array
        Where it has a value.
    index : (H, W) int32 array
        Flat index into the plane of the pixel that shows.
    region : (H, W) bool array
        Pixels that may change.
    white : float
        The range of the picture's values.

    Returns
    -------
    (H, W, C) float32 array
        0 outside of the region.
    """
    result = np.zeros((*index.shape, plane.shape[2]), np.float32)
    if not region.any():
        return result
    rows, columns = (np.flatnonzero(region.any(axis=axis)) for axis in (1, 0))
    box = np.s_[
        max(int(rows[0]) - 1, 0) : int(rows[-1]) + 2, max(int(columns[0]) - 1, 0) : int(columns[-1]) + 2
    ]
    part, inside = index[box], region[box] & (index[box] >= 0)
    steps = [_steps(plane, usable, part, axis, white) for axis in (1, 0)]
    copied = np.where(part[..., np.newaxis] >= 0, _values(plane, np.maximum(part, 0)), np.float32(0))
    if inside.any():
        result[box][inside] = _poisson(copied, inside, steps) - copied[inside]
    return result


def _steps(
    plane: npt.NDArray[Any], usable: Mask, index: Ints32, axis: int, white: float
) -> tuple[Floats32, Floats32]:
    """Compute the step from each pixel to the next one along an axis as its copies have it, and its weight;
    arguments as for :func:`levelled`.
    """
    (s, t), step = _NEIGHBOURS[1 - axis], plane.shape[1] if axis == 0 else 1
    valid, shown = usable.ravel(), (index[s] >= 0) & (index[t] >= 0)
    p, q = np.maximum(index[s], 0), np.maximum(index[t], 0)
    ahead, behind = np.minimum(p + step, len(valid) - 1), np.maximum(q - step, 0)
    known_p = (valid[p] & valid[ahead] & (index[s] >= 0))[..., np.newaxis]
    known_q = (valid[q] & valid[behind] & (index[t] >= 0))[..., np.newaxis]
    count = np.maximum(known_p.astype(np.float32) + known_q, 1)
    at_p, at_q, at_ahead, at_behind = (_values(plane, places) for places in (p, q, ahead, behind))
    mean = ((at_ahead - at_p) * known_p + (at_q - at_behind) * known_q) / count
    apart = (np.abs(at_ahead - at_q) * known_p + np.abs(at_p - at_behind) * known_q) / count
    weight = 1 / (1 + (apart.max(axis=2) / (_HALF_WEIGHT * white)) ** 4)
    return mean, np.where(shown, weight, 0).astype(np.float32)


def _values(plane: npt.NDArray[Any], index: Ints32) -> Floats32:
    found: Floats32 = plane.reshape(-1, plane.shape[2]).take(index, axis=0).astype(np.float32, copy=False)
    return found


def _poisson(values: Floats32, region: Mask, steps: Steps) -> Floats32:
    """Compute the values in a region whose steps are nearest to given ones.

    Parameters
    ----------
    values : (H, W, F) array
        Values outside of the region.
    region : (H, W) bool array
    steps : list of two pairs
        The wanted step from each pixel to its right, and to its lower neighbour, and its weight.

    Returns
    -------
    (n, F) float32 array
        Per pixel of the region, in raster order.
    """
    number = np.full(region.shape, -1, np.int32)
    n = int(region.sum())
    number[region] = np.arange(n, dtype=np.int32)
    wanted = 1e-6 * values[region].astype(np.float64)
    # Of each row of the matrix, in the order of its columns: the pixel above, to the left, itself, and so on.
    columns, entries = np.full((n, 5), -1, np.int32), np.zeros((n, 5))
    columns[:, 2] = np.arange(n)
    # A pixel without neighbours keeps its value.
    entries[:, 2] = 1e-6
    for (s, t), (step, weight), places in zip(_NEIGHBOURS, steps, ((3, 1), (4, 0)), strict=True):
        for first, second, sign, place in ((s, t, -1.0, places[0]), (t, s, 1.0, places[1])):
            inner = region[first] & (weight > 0)
            here, there, share = number[first][inner], number[second][inner], weight[inner].astype(np.float64)
            entries[here, 2] += share
            wanted[here] += sign * share[:, np.newaxis] * step[inner]
            outside = there < 0
            wanted[here[outside]] += share[outside, np.newaxis] * values[second][inner][outside]
            columns[here, place] = there
            entries[here, place] = -share
    filled = columns >= 0
    ends = np.concatenate([[0], np.cumsum(np.count_nonzero(filled, axis=1))])
    matrix = sparse.csr_matrix((entries[filled], columns[filled], ends), (n, n))
    del number, columns, entries, filled
    if n <= _DIRECT:
        solved = linalg.splu(sparse.csc_matrix(matrix), **_SYMMETRIC).solve(wanted)
    else:
        solved = _iterated(matrix, wanted, values[region], region)
    result: Floats32 = solved.astype(np.float32, copy=False)
    return result


def _iterated(matrix: sparse.csr_matrix, wanted: Floats, found: Floats32, region: Mask) -> Floats32:
    """Solve by conjugate gradients for all channels at once, from what is given first, with a coarse system
    to carry what is far: one unknown for each block of pixels.
    """
    side = max(_LEAST_BLOCK, round(np.sqrt(len(wanted) / _DIRECT)))
    rows, columns = (line.astype(np.int32) for line in np.nonzero(region))
    _, block = np.unique(rows // side * region.shape[1] + columns // side, return_inverse=True)
    del rows, columns
    n, count = len(block), int(block.max()) + 1
    spread = sparse.csr_matrix((np.ones(n), block.astype(np.int32), np.arange(n + 1)), (n, count))
    gathered = sparse.csr_matrix(spread.T)
    coarse = linalg.splu(sparse.csc_matrix(gathered @ (matrix @ spread)), **_SYMMETRIC)
    rest = (wanted - matrix @ found.astype(np.float64)).astype(np.float32)
    goal = _TOLERANCE * np.sqrt(np.square(wanted).sum(axis=0))
    share = (1 / matrix.diagonal()[:, np.newaxis]).astype(np.float32)
    single = sparse.csr_matrix((matrix.data.astype(np.float32), matrix.indices, matrix.indptr), matrix.shape)
    way, before = np.zeros_like(rest), np.ones(rest.shape[1])
    for _ in range(_MOST_STEPS):
        if (np.sqrt(np.square(rest).sum(axis=0, dtype=float)) <= goal).all():
            break
        towards = share * rest + (spread @ coarse.solve(gathered @ rest.astype(float))).astype(np.float32)
        energy = np.einsum("ij,ij->j", rest, towards, dtype=float)
        way = towards + (energy / before).astype(np.float32) * way
        along = single @ way
        step = (energy / np.maximum(np.einsum("ij,ij->j", way, along, dtype=float), 1e-300)).astype(
            np.float32
        )
        found += step * way
        rest -= step * along
        before = np.maximum(energy, 1e-300)
    return found
