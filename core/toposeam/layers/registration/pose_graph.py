"""Adjust the places of pictures to the patches that pairs of them share: linear least squares.

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
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.pair_matching import Match

#: Least motion of the farthest corner, px, that counts as a turn or a scale.
_LEAST_TURN = 0.35
#: Median distance, px, up to which shifts suffice: errors of matching are alike all along a narrow strip.
_SHIFTS_SUFFICE = 0.15
#: Largest distance, px, of a pair that fits, in the median, and of a patch that is no outlier.
LARGEST_MISFIT = 1.0
#: The unknowns of each kind of transform, of a, b, u, v, the simplest kind first.
_UNKNOWNS = {"shift": (2, 3), "turn": (1, 2, 3), "similarity": (0, 1, 2, 3)}
#: Kinds of transforms, the simplest first.
FREEDOMS = tuple(_UNKNOWNS)
#: Patches of a pair that count as one, as they overlap and err alike (benchmarks/placing.py: of 29 sets, no
#: picture is farther off than 4 standard deviations).
_CORRELATED_PATCHES = 16
#: Least standard deviation of a patch, px.
_LEAST_DEVIATION = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """Transforms of all pictures, adjusted at once."""

    #: (N, 4) a, b, u, v.
    transforms: Floats
    #: Largest median distance of a pair, px.
    misfit: float
    #: One standard deviation of the residuals of the used patches, px, and their (M, 4 N) equations.
    noise: float
    matrix: csr_array
    #: Kind of the transforms, one of :data:`FREEDOMS`.
    freedom: str


def adjust_transforms(
    sizes: Floats, matches: dict[Pair, Match], freedoms: Sequence[str] = FREEDOMS
) -> Adjustment:
    """Adjust transforms of the kind that the Bayesian information criterion chooses.

    (Schwarz 1978, doi:10.1214/aos/1176344136.) A few patches of one poor overlap are no reason to turn.

    Parameters
    ----------
    sizes : (N, 2) array
        Height and width of each picture, px.
    matches : dict of (int, int) to Match
        They join all pictures.
    freedoms : sequence of str
        Kinds of transforms, the simplest first.
    """
    shifted = least_squares(len(sizes), matches, freedoms[0])
    if shifted.misfit <= _SHIFTS_SUFFICE or len(freedoms) == 1:
        return shifted
    tried = [shifted, *(least_squares(len(sizes), matches, freedom) for freedom in freedoms[1:])]
    chosen = tried[_simplest([one.transforms for one in tried], matches)]
    a, b = chosen.transforms.T[:2]
    return chosen if (np.hypot(a - 1, b) * np.hypot(*sizes.T)).max() > _LEAST_TURN else shifted


def _simplest(several: list[Floats], matches: dict[Pair, Match]) -> int:
    """Choose the transforms, of each kind, that explain the patches with no more unknowns than they need.

    Errors have a Cauchy distribution, as wide as the freest transforms leave them.
    """
    distances = np.array(
        [
            np.concatenate([residuals(transforms, i, j, match) for (i, j), match in matches.items()])
            for transforms in several
        ]
    )
    width = max(float(np.median(distances[-1])), _LEAST_DEVIATION)
    count = 2 * distances.shape[1] / _CORRELATED_PATCHES
    costs = [
        count * float(np.log1p((one / width) ** 2).mean())
        + len(_UNKNOWNS[freedom]) * (len(several[0]) - 1) * float(np.log(count))
        for one, freedom in zip(distances, FREEDOMS, strict=False)
    ]
    return int(np.argmin(costs))


def offsets(transforms: Floats, matches: dict[Pair, Match], order: float = 2) -> dict[Pair, float]:
    """Compute the median distance of each pair's patches, px, by the norm of that order."""
    return {
        pair: float(np.median(residuals(transforms, *pair, match, order))) for pair, match in matches.items()
    }


def residuals(transforms: Floats, i: int, j: int, match: Match, order: float = 2) -> Floats:
    """Compute the distance of each of a pair's patches, (M,) px, by the norm of that order."""
    distance = _applied(transforms[i], match.first) - _applied(transforms[j], match.second)
    return np.asarray(np.linalg.norm(distance, order, axis=1))


def _applied(transform: Floats, points: Floats) -> Floats:
    a, b, u, v = transform
    return np.stack(
        [a * points[:, 0] - b * points[:, 1] + u, b * points[:, 0] + a * points[:, 1] + v], axis=1
    )


def least_squares(count: int, matches: dict[Pair, Match], freedom: str) -> Adjustment:
    """Adjust transforms of one kind; patches that disagree with a solution are left out of the next.

    Parameters
    ----------
    count : int
        Number of pictures.
    matches : dict of (int, int) to Match
        They join all pictures.
    freedom : {"shift", "turn", "similarity"}
    """
    free = _UNKNOWNS[freedom]
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
        distances = {pair: residuals(transforms, *pair, match) for pair, match in matches.items()}
        before = used
        used = {
            pair: own <= max(LARGEST_MISFIT, 2 * float(np.median(own))) for pair, own in distances.items()
        }
        if freedom != "turn" and all(np.array_equal(used[pair], before[pair]) for pair in used):
            break  # the next solution is the same
    errors = matrix[:, columns] @ solution - right
    noise = _CORRELATED_PATCHES * float(errors @ errors) / max(len(errors) - len(columns), 1)
    misfit = max(float(np.median(own[used[pair]])) for pair, own in distances.items())
    return Adjustment(transforms, misfit, float(np.sqrt(noise)), matrix, freedom)


def _equations(count: int, matches: dict[Pair, Match]) -> csr_array:
    """Return the (2 M, 4 N) equations of all patches, in x and y, for the transforms of `count` pictures."""
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
    """Solve sparse equations by least squares: normal equations, and one step of refinement."""
    normal = (matrix.T @ matrix).tocsc()
    # A little of the diagonal is added, so that unknowns that no patch determines stay finite.
    factors = scipy.sparse.linalg.splu(normal + scipy.sparse.diags_array(1e-12 * normal.diagonal()).tocsc())
    solution = factors.solve(matrix.T @ right)
    return np.asarray(solution + factors.solve(matrix.T @ (right - matrix @ solution)))


def open_corners(sizes: Floats, solution: Adjustment) -> Floats:
    """Compute one standard deviation of each picture's corners, px: (N,).

    A common motion of all pictures changes no pair, so the least of all covariances that differ by one is
    taken (Baarda's S-transformation).
    """
    count, freedom, transforms = len(sizes), solution.freedom, solution.transforms
    moves = np.tile(np.eye(4)[:, _UNKNOWNS[freedom]], (count, 1, 1))
    if freedom == "turn":
        moves[:, 0, 0], moves[:, 1, 0] = -transforms[:, 1], transforms[:, 0]
    design = solution.matrix @ scipy.sparse.block_diag(moves)
    corners = np.stack([_terms(size[::-1] * np.array([[0, 0], [0, 1], [1, 0], [1, 1]])) for size in sizes])
    reached = np.einsum("ncpi,nik->ncpk", corners, moves)
    at_corners = np.einsum("ncpk,nm->ncpmk", reached, np.eye(count)).reshape(8 * count, -1)
    values, vectors = np.linalg.eigh((design.T @ design).toarray())
    common = len(_UNKNOWNS[freedom])  # motions of all pictures together
    errors = at_corners @ (vectors[:, common:] / np.sqrt(values[common:].clip(1e-12)))
    unseen = np.linalg.qr(at_corners @ vectors[:, :common])[0]
    errors -= unseen @ (unseen.T @ errors)
    variances = (errors**2).sum(axis=1).reshape(count, 4, 2).sum(axis=2)
    return np.asarray(solution.noise * np.sqrt(variances.max(axis=1)))


def _terms(points: Floats) -> Floats:
    """Return the coefficients of a, b, u, v in x and y of each point, (N, 2, 4)."""
    x, y = points.T
    one, none = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([x, -y, one, none], axis=1), np.stack([y, x, none, one], axis=1)], axis=1)
