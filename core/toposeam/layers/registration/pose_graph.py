"""Places of pictures, adjusted to the patches that pairs of them share: linear least squares.

With T(x, y) = (a x - b y + u, b x + a y + v) per picture, T_i(p) = T_j(q) for every patch found at p in
picture i and at q in picture j, weighted by the inverse of its uncertainty; the first picture's is the
identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import csr_array

from toposeam.arrays import Floats
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.pair_matching import Match

#: Below this, px at the farthest corner, nothing counts as turned or scaled; and not where shifts leave less
#: between patches, px, as errors of matching are alike all along a narrow overlap.
_NOT_TURNED, _MATCHED = 0.35, 0.15
#: Patches that do not lie within so many px of where the others say do not count.
_OUTLIER = 1.0
#: What pictures may do, the simplest first.
FREEDOMS = ("shift", "turn", "similarity")
#: The unknowns of each, of a, b, u, v.
_FREE = {"shift": (2, 3), "turn": (1, 2, 3), "similarity": (0, 1, 2, 3)}
#: How many directions of all of them there are that change nothing between any two.
_NOBODY_SEES = {"shift": 2, "turn": 3, "similarity": 4}
#: Patches of a pair overlap, and err alike: so many count as one (benchmarks/placing.py: of 29 sets, no
#: picture is farther off than 4 standard deviations). None is more exact than so many px.
_ALIKE, _FINEST = 16, 0.02
#: Share of their diagonal by which normal equations are damped, so that what no patch says does not matter.
_DAMPED = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """All transforms at once."""

    #: (N, 4).
    transforms: Floats
    #: The largest of a pair, px.
    misfit: float
    #: One standard deviation of what the patches that were used leave, px, and (M, 4 N) what they said.
    noise: float
    matrix: csr_array
    freedom: str


def adjusted(sizes: Floats, matches: dict[Pair, Match], freedoms: Sequence[str] = FREEDOMS) -> Adjustment:
    """All transforms of pictures of (N, 2) heights and widths: by shifts, or also by turns, or also by
    scales, as the Bayesian information criterion says (Schwarz 1978, doi:10.1214/aos/1176344136): what a few
    patches of one poor overlap would have is no reason to turn.
    """
    shifted = least_squares(len(sizes), matches, freedoms[0])
    if shifted.misfit <= _MATCHED or len(freedoms) == 1:
        return shifted
    found = [shifted, *(least_squares(len(sizes), matches, freedom) for freedom in freedoms[1:])]
    chosen = found[_simplest([one.transforms for one in found], matches)]
    a, b = chosen.transforms.T[:2]
    return chosen if (np.hypot(a - 1, b) * np.hypot(*sizes.T)).max() > _NOT_TURNED else shifted


def _simplest(several: list[Floats], matches: dict[Pair, Match]) -> int:
    """Which of the transforms found with each freedom explain the patches with no more unknowns than they
    need; errors have a Cauchy distribution, as wide as the freest leave them.
    """
    off = np.array(
        [
            np.concatenate([residuals(transforms, i, j, match) for (i, j), match in matches.items()])
            for transforms in several
        ]
    )
    width = max(float(np.median(off[-1])), _FINEST)
    count = 2 * off.shape[1] / _ALIKE
    costs = [
        count * float(np.log1p((one / width) ** 2).mean())
        + len(_FREE[freedom]) * (len(several[0]) - 1) * float(np.log(count))
        for one, freedom in zip(off, FREEDOMS, strict=False)
    ]
    return int(np.argmin(costs))


def offsets(transforms: Floats, matches: dict[Pair, Match], order: float = 2) -> dict[Pair, float]:
    """How far each pair's patches lie apart, px, in the median."""
    return {
        pair: float(np.median(residuals(transforms, *pair, match, order))) for pair, match in matches.items()
    }


def residuals(transforms: Floats, i: int, j: int, match: Match, order: float = 2) -> Floats:
    """(M,) how far each of a pair's patches lies apart, px, by the norm of that order."""
    distance = _applied(transforms[i], match.first) - _applied(transforms[j], match.second)
    return np.asarray(np.linalg.norm(distance, order, axis=1))


def _applied(transform: Floats, points: Floats) -> Floats:
    a, b, u, v = transform
    return np.stack(
        [a * points[:, 0] - b * points[:, 1] + u, b * points[:, 0] + a * points[:, 1] + v], axis=1
    )


def least_squares(count: int, matches: dict[Pair, Match], freedom: str) -> Adjustment:
    """All transforms of so many pictures; patches that disagree with a solution are left out of the next."""
    free = _FREE[freedom]
    transforms = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    used = {pair: np.ones(len(match.first), bool) for pair, match in matches.items()}
    columns = np.array([4 * index + k for index in range(1, count) for k in free])
    fixed = np.setdiff1d(np.arange(4 * count), columns)
    equations = _equations(count, matches)
    for _ in range(4):
        matrix = equations[np.repeat(np.concatenate(list(used.values())), 2)]
        right = -matrix[:, fixed] @ transforms.reshape(-1)[fixed]
        solution = _solved(matrix[:, columns], right)
        transforms.reshape(-1)[columns] = solution
        if freedom == "turn":
            transforms[:, 0] = np.sqrt(1 - np.clip(transforms[:, 1], -0.5, 0.5) ** 2)
        off = {pair: residuals(transforms, *pair, match) for pair, match in matches.items()}
        before = used
        used = {pair: own <= max(_OUTLIER, 2 * float(np.median(own))) for pair, own in off.items()}
        if freedom != "turn" and all(np.array_equal(used[pair], before[pair]) for pair in used):
            break  # the next solution is the same
    left = matrix[:, columns] @ solution - right
    noise = _ALIKE * float(left @ left) / max(len(left) - len(columns), 1)
    misfit = max(float(np.median(own[used[pair]])) for pair, own in off.items())
    return Adjustment(transforms, misfit, float(np.sqrt(noise)), matrix, freedom)


def _equations(count: int, matches: dict[Pair, Match]) -> csr_array:
    """(2 M, 4 N): what every patch says of the transforms of so many pictures, in x and in y."""
    values, columns = [], []
    for pair, match in matches.items():
        terms = np.stack([_terms(match.first), -_terms(match.second)], axis=2)
        values.append(
            terms / np.broadcast_to(match.uncertainty, len(terms))[:, np.newaxis, np.newaxis, np.newaxis]
        )
        columns.append(np.broadcast_to(4 * np.array(pair)[:, np.newaxis] + np.arange(4), terms.shape))
    entries = np.concatenate(values).ravel()
    starts = np.arange(0, len(entries) + 1, 8)
    return csr_array((entries, np.concatenate(columns).ravel(), starts), shape=(len(starts) - 1, 4 * count))


def _solved(matrix: csr_array, right: Floats) -> Floats:
    """Solve sparse equations by least squares: normal equations, and once more for what these leave."""
    normal = (matrix.T @ matrix).tocsc()
    factors = scipy.sparse.linalg.splu(normal + scipy.sparse.diags_array(_DAMPED * normal.diagonal()).tocsc())
    solution = factors.solve(matrix.T @ right)
    return np.asarray(solution + factors.solve(matrix.T @ (right - matrix @ solution)))


def open_corners(sizes: Floats, solution: Adjustment) -> Floats:
    """How far, px, each picture's corners are open, one standard deviation. That all pictures together may
    lie elsewhere, or turned, nobody sees: the least of all such covariances (Baarda's S-transformation).
    """
    count, freedom, transforms = len(sizes), solution.freedom, solution.transforms
    moves = np.tile(np.eye(4)[:, _FREE[freedom]], (count, 1, 1))
    if freedom == "turn":
        moves[:, 0, 0], moves[:, 1, 0] = -transforms[:, 1], transforms[:, 0]
    design = solution.matrix @ scipy.sparse.block_diag(moves)
    corners = np.stack([_terms(size[::-1] * np.array([[0, 0], [0, 1], [1, 0], [1, 1]])) for size in sizes])
    reached = np.einsum("ncpi,nik->ncpk", corners, moves)
    at_corners = np.einsum("ncpk,nm->ncpmk", reached, np.eye(count)).reshape(8 * count, -1)
    values, vectors = np.linalg.eigh((design.T @ design).toarray())
    none = _NOBODY_SEES[freedom]
    errors = at_corners @ (vectors[:, none:] / np.sqrt(values[none:].clip(1e-12)))
    unseen = np.linalg.qr(at_corners @ vectors[:, :none])[0]
    errors -= unseen @ (unseen.T @ errors)
    variances = (errors**2).sum(axis=1).reshape(count, 4, 2).sum(axis=2)
    return np.asarray(solution.noise * np.sqrt(variances.max(axis=1)))


def _terms(points: Floats) -> Floats:
    """(N, 2, 4), what a, b, u, v add to x and y of each point."""
    x, y = points.T
    one, none = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([x, -y, one, none], axis=1), np.stack([y, x, none, one], axis=1)], axis=1)
