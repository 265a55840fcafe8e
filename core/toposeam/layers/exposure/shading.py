"""Shading: one smooth field of gain per layer, so that layers agree although lenses darken towards corners.

A layer's field is the exponential of quadratic B-splines over 3 × 3 cells, the same in all channels: what the
lens, which all layers share, does round the middle of the picture (powers of the distance), and small parts,
one shared and one of its own. In blocks of every overlap the median of log a - log b in light, after the
layers' gains, is one equation between the two fields at the block's middle; all of them are solved by least
squares. All but what goes round the middle is kept small: along a row of pictures no overlap tells how the
lens differs from top to bottom, and what darkens all layers alike at a place of the canvas none does. Blocks
that differ by something else than light, as where things moved, count less and less in rounds of reweighting
(Cauchy).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import linalg

from toposeam.arrays import Floats
from toposeam.layers.canvas.layer import Box

#: Logarithms of two layers' ratio at every so many-th pixel of a box, NaN where they tell nothing; and that
#: step.
Ratios = Callable[[int, int, Box], tuple[Floats, int]]

#: Cells per side, and coefficients.
_CELLS, _SIZE = 3, 5
#: Blocks are about this share of the smaller layer's side.
_BLOCK = 1 / 12
#: Pixels that a block needs.
_ENOUGH = 24
#: What blocks differ by beyond light.
_NOISE = 0.02
#: How large the factors of what goes round the middle are, by powers of the distance.
_POWERS, _ROUND = (2, 4), 1.0
#: How large coefficients are, and their second differences: of the shared part, and of a layer's own.
_SHARED, _OWN = (0.1, 0.05), (0.04, 0.02)
#: Places a side at which splines are fitted to powers.
_SAMPLES = 16
#: Rounds of reweighting, and the residual at which a block counts half.
_ROUNDS, _ODD = 6, 0.07


def weights_along(length: int, at: npt.ArrayLike) -> Floats:
    """(n, 5): the splines at n pixels of a side of so many px."""
    places = np.clip((np.asarray(at, float) + 0.5) / length, 0, 1) * _CELLS
    cell = np.minimum(places.astype(int), _CELLS - 1)
    share = places - cell
    result = np.zeros((len(places), _SIZE))
    rows = np.arange(len(places))
    for step, value in enumerate(((1 - share) ** 2 / 2, 0.5 + share * (1 - share), share**2 / 2)):
        result[rows, cell + step] = value
    return result


def shading(places: Sequence[Box], ratios: Ratios) -> list[Floats]:
    """Per layer the coefficients of the logarithm of its field, (5, 5).

    Parameters
    ----------
    places : sequence of Box
        Where each layer lies on the canvas.
    ratios : callable
        See :data:`Ratios`.
    """
    found = [
        block
        for i in range(len(places))
        for j in range(i + 1, len(places))
        if all(places[i].shared(places[j]).shape)
        for block in _blocks(i, j, places, ratios)
    ]
    if not found:
        return [np.zeros((_SIZE, _SIZE)) for _ in places]
    rows = np.repeat(np.arange(len(found)), 2 * _SIZE**2)
    columns, values = (np.concatenate([block[k] for block in found]) for k in (0, 1))
    each = sparse.csr_array((values, (rows, columns)), shape=(len(found), len(places) * _SIZE**2))
    wanted, trust = (np.array([block[k] for block in found]) for k in (2, 3))
    parts = _parts(places)
    matrix = each @ parts
    prior = _prior(len(places))
    solution = np.zeros(parts.shape[1])
    for _ in range(_ROUNDS):
        odd = (matrix @ solution - wanted) / _ODD
        weight = trust / (1 + odd**2) / _NOISE**2
        weighed = matrix.T @ sparse.diags_array(weight)
        solution = linalg.spsolve((weighed @ matrix + prior).tocsc(), weighed @ wanted)
    return list((parts @ solution).reshape(-1, _SIZE, _SIZE))


def _parts(places: Sequence[Box]) -> sparse.csr_array:
    """(25 N, unknowns): how the layers' coefficients, one layer after the other, add up: from powers of the
    distance to a layer's middle, which are 1 in its corners, a shared part, and each layer's own.
    """
    one = sparse.eye_array(_SIZE**2)
    return sparse.csr_array(
        sparse.hstack(
            [
                np.concatenate([_round_the_middle(place.shape) for place in places]),
                sparse.vstack([one] * len(places)),
                sparse.eye_array(_SIZE**2 * len(places)),
            ]
        )
    )


def _round_the_middle(shape: tuple[int, int]) -> Floats:
    """(25, powers): the coefficients of powers of the distance."""
    at = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    distance = np.hypot.outer(at * shape[0], at * shape[1]) / (np.hypot(*shape) / 2)
    fit = np.linalg.pinv(weights_along(_SAMPLES, np.arange(_SAMPLES)))
    return np.stack([(fit @ distance**power @ fit.T).ravel() for power in _POWERS], axis=1)


def _blocks(
    i: int, j: int, places: Sequence[Box], ratios: Ratios
) -> list[tuple[npt.NDArray[np.intp], Floats, float, float]]:
    """Unknowns, their factors, what they shall add up to, and how much that counts."""
    common = places[i].shared(places[j])
    values, step = ratios(i, j, common)
    side = max(1.0, _BLOCK * min(*places[i].shape, *places[j].shape) / step)
    cuts = [
        np.linspace(0, length, max(1, round(length / side)) + 1).round().astype(int)
        for length in values.shape
    ]
    whole = min(places[k].shape[0] * places[k].shape[1] for k in (i, j)) * _BLOCK**2
    found = []
    for top, bottom in zip(cuts[0], cuts[0][1:], strict=False):
        for left, right in zip(cuts[1], cuts[1][1:], strict=False):
            block = values[top:bottom, left:right]
            known = block[np.isfinite(block)]
            if len(known) < _ENOUGH:
                continue
            row, column = common.top + step * (top + bottom) / 2, common.left + step * (left + right) / 2
            parts = []
            for layer, sign in ((i, -1.0), (j, 1.0)):
                place = places[layer]
                down = weights_along(place.shape[0], [row - place.top])
                across = weights_along(place.shape[1], [column - place.left])
                factors = sign * np.outer(down, across).ravel()
                parts.append((layer * _SIZE**2 + np.arange(_SIZE**2), factors))
            unknowns, signed = (np.concatenate(part) for part in zip(*parts, strict=True))
            found.append((unknowns, signed, float(np.median(known)), min(1.0, len(known) * step**2 / whole)))
    return found


def _prior(count: int) -> sparse.csr_array:
    """What keeps the parts of :func:`_parts` small and even."""
    second = np.diff(np.eye(_SIZE), 2, axis=0)
    one = np.eye(_SIZE)
    curved = np.concatenate([np.kron(second, one), np.kron(one, second)])
    shared, own = (
        sparse.coo_array(np.eye(_SIZE**2) / size**2 + curved.T @ curved / bend**2)
        for size, bend in (_SHARED, _OWN)
    )
    powers = sparse.eye_array(len(_POWERS)) / _ROUND**2
    return sparse.csr_array(sparse.block_diag([powers, shared] + [own] * count))
