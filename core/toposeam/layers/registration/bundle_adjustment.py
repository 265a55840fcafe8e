"""Adjust all pictures of a set at once to the points that pairs of them share.

Each picture i has a matrix G_i that takes its pixels (x, y, 1), counted from its centre and free of
distortion, to the scene: a homography to a common plane, or R_i diag(1/f_i, 1/f_i, 1), the rays of a camera
that turns about one point; f_i is the same for all pictures unless some show things clearly larger than
others do. A point p of picture i appears at G_j⁻¹ G_i p in picture j; its distances from the points q where
it was found are minimised with a Cauchy loss (Triggs et al. 2000, doi:10.1007/3-540-44480-7_21).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree, shortest_path

from toposeam.arrays import Floats, Indices, Mask
from toposeam.layers.canvas.transforms import undistorted
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.consensus import evidence_of
from toposeam.layers.registration.homography import applied, areas
from toposeam.layers.registration.pair_matching import Match
from toposeam.layers.registration.placement import Family

#: Focal lengths that are tried where none is stated, as shares of the larger side: wide, usual, long.
_FOCALS = (0.8, 1.2, 2.5)
#: One standard deviation of the logarithm of the focal length about a stated one, and about the usual one.
_STATED_DEVIATION, _USUAL_DEVIATION = 0.05, 0.6
#: Points of a pair at most.
_POINTS = 150
#: Two descents, in which all points count first, and then wrong ones little: the distance, in uncertainties,
#: at which a point counts half; the share of the loss that a step has to take away for another one to follow;
#: and the least curvature of a point's loss, as a share of its weight.
_DESCENTS = ((30.0, 1e-5, 1.0), (2.0, 1e-6, 0.1))
#: Steps of a descent at most.
_STEPS = 60
#: Step of difference quotients, in the scaled unknowns.
_STEP = 1e-6
#: Share of the loss that a distortion has to take away to be taken. A single pair has few points far from its
#: middles, and focal lengths of single pictures are many unknowns: both have to take away the larger share.
_DISTORTION_GAIN, _DOUBTFUL_GAIN = 0.04, 0.25
#: Largest b of the distortion of a lens.
_LARGEST_DISTORTION = 0.2
#: Logarithm of the scale between two pictures from which on pictures may have focal lengths of their own
#: where a plane may explain them, too.
_ZOOM = 0.15


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bundle:
    """Pictures adjusted to each other."""

    #: The model: a plane, or a camera that rotates.
    family: Family
    #: Width and height of each picture, px.
    sizes: Floats
    #: (N, 3, 3), from centred pixels to the scene.
    matrices: Floats
    #: (N,) focal length of each picture, px, and b of Hugin's radial distortion; for a plane 1 and 0.
    focals: Floats
    distortion: float
    #: The picture in the middle of the set.
    middle: int

    @property
    def focal(self) -> float:
        """The focal length of the picture in the middle, px."""
        return float(self.focals[self.middle])

    @property
    def rotations(self) -> Floats:
        """(N, 3, 3) turns of the cameras."""
        return np.asarray(self.matrices * _diagonals(self.focals)[:, np.newaxis])

    @property
    def lens(self) -> tuple[float, float, float]:
        """a, b and c of Hugin's radial distortion."""
        return 0.0, self.distortion, 0.0

    @property
    def field_of_view(self) -> float:
        """Largest angle, degrees, between the rays of two corners of the pictures; for a camera."""
        corners = np.stack([self.sizes, self.sizes * [1, -1], -self.sizes, self.sizes * [-1, 1]], axis=1) / 2
        rays = np.append(corners, np.ones((*corners.shape[:2], 1)), axis=2) @ np.swapaxes(self.matrices, 1, 2)
        flat = rays.reshape(-1, 3) / np.linalg.norm(rays.reshape(-1, 3), axis=1, keepdims=True)
        return math.degrees(math.acos(max(-1.0, float((flat @ flat.T).min()))))

    def size(self, index: int) -> tuple[int, int]:
        """Width and height of a picture, px."""
        return int(self.sizes[index, 0]), int(self.sizes[index, 1])

    def between(self, start: int, end: int) -> Floats:
        """Return the (3, 3) matrix from the centred pixels of a picture to those of another, without
        distortion.
        """
        return np.asarray(np.linalg.inv(self.matrices[end]) @ self.matrices[start])

    def ideal(self, index: int, points: Floats) -> Floats:
        """Centre points of a picture and undo the lens's distortion: (M, 2)."""
        return undistorted(points, self.size(index), self.lens)

    def distances(self, pair: Pair, match: Match) -> Floats:
        """Compute the distances between the points of a pair: (M,) px."""
        i, j = pair
        mapped = applied(self.between(i, j), self.ideal(i, match.first))
        return np.asarray(np.hypot(*(mapped - self.ideal(j, match.second)).T))

    def medians(self, matches: Mapping[Pair, Match]) -> dict[Pair, float]:
        """Compute the median distance of each pair, px."""
        return {pair: float(np.median(self.distances(pair, match))) for pair, match in matches.items()}


def spanning_tree(count: int, strengths: Mapping[Pair, float]) -> tuple[int, Indices, Indices]:
    """Find the tree of the strongest pairs.

    Returns
    -------
    middle : int
        The picture in the middle of the tree.
    order : (N,) int array
        All pictures, from the middle on.
    before : (N,) int array
        The picture that comes before each one on its way from the middle.
    """
    rows, columns = np.array(list(strengths), np.int32).T  # older scipy takes no others
    graph = csr_array((-np.array(list(strengths.values()), float), (rows, columns)), shape=(count, count))
    tree = minimum_spanning_tree(graph)
    tree = tree + tree.T
    steps = shortest_path(tree != 0, directed=False, unweighted=True)
    middle = int(steps.max(axis=1).argmin())
    order, before = breadth_first_order(tree, middle, directed=False)
    return middle, order, before


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Points that pairs share."""

    #: (K,) numbers of the two pictures.
    first: Indices
    second: Indices
    #: (K, 2) x and y in both, px.
    p: Floats
    q: Floats
    #: (K,) share of the features that agree ÷ px of uncertainty.
    weight: Floats
    #: (P + 1,) number of the first point of each pair, and last of all points.
    starts: Indices

    @classmethod
    def of(cls, matches: Mapping[Pair, Match]) -> _Points:
        """Draw points of each match, as many as count."""
        rng = np.random.default_rng(0)
        largest = max(match.share for match in matches.values())
        parts = []
        for (i, j), match in matches.items():
            if not len(match.first):
                continue
            chosen = np.sort(rng.permutation(len(match.first))[:_POINTS])
            uncertainty = np.broadcast_to(match.uncertainty, len(match.first))[chosen]
            parts.append(
                (
                    np.full(len(chosen), i),
                    np.full(len(chosen), j),
                    match.first[chosen],
                    match.second[chosen],
                    match.share / largest / uncertainty,
                )
            )
        first, second, p, q, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
        return cls(first, second, p, q, weight, np.cumsum([0, *(len(part[0]) for part in parts)]))


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Residuals of a bundle and their derivatives, as functions of a vector of unknowns.

    The first two unknowns are the logarithm of the focal length and the distortion; then come those of each
    picture, of which the middle one's are fixed: eight entries of a homography, or a vector along the axis
    of a turn and the logarithm of how many times longer the picture's own focal length is.
    """

    sizes: Floats
    points: _Points
    family: Family
    middle: int
    #: Likely focal length, px, and one standard deviation of its logarithm.
    focal: float
    deviation: float
    #: Whether focal length and distortion are free.
    free_focal: bool
    free_distortion: bool
    #: Whether each picture has a focal length of its own.
    free_zoom: bool = False
    #: Points free of the last distortion that was asked for.
    _ideal: dict[float, tuple[Floats, Floats]] = field(init=False, repr=False, default_factory=dict)

    @property
    def each(self) -> int:
        """Unknowns of a picture."""
        return 8 if self.family == "plane" else 4

    @property
    def free(self) -> Mask:
        """The unknowns that are not fixed."""
        count = len(self.sizes)
        own = np.ones((count, self.each), bool)
        own[self.middle] = False
        own[:, 3:] &= self.family == "plane" or self.free_zoom
        return np.concatenate([[self.free_focal, self.free_distortion], own.ravel()])

    def matrices(self, unknowns: Floats) -> Floats:
        """Return the (..., N, 3, 3) matrices of (..., U) unknowns."""
        own = unknowns[..., 2:].reshape(*unknowns.shape[:-1], len(self.sizes), -1)
        if self.family == "rotation":
            vectors = own[..., :3] * self._per_shift(unknowns[..., 0])[..., np.newaxis, :]
            return np.asarray(_turns(vectors) / _diagonals(self.focals(unknowns))[..., np.newaxis, :])
        ones = np.ones((*own.shape[:-1], 1))
        plain = np.concatenate([own, ones], axis=-1).reshape(*own.shape[:-1], 3, 3)
        return np.asarray(plain @ self._normal)

    def focals(self, unknowns: Floats) -> Floats:
        """Return the (..., N) focal lengths of the cameras, px."""
        return np.asarray(np.exp(unknowns[..., :1] + unknowns[..., 5::4]))

    def _per_shift(self, log_focal: npt.ArrayLike) -> Floats:
        """Return the (..., 3) turns, rad, that move a picture by half its larger side; 1 about the axis."""
        return _diagonals(float(self.sizes.max()) / 2 * np.exp(-np.asarray(log_focal)))

    @property
    def _normal(self) -> Floats:
        half = self.sizes.max() / 2
        return np.diag([1 / half, 1 / half, 1.0])

    def unknowns(self, matrices: Floats, focals: Floats) -> Floats:
        """Return the vector of unknowns of matrices and focal lengths."""
        focal = float(focals[self.middle])
        if self.family == "rotation":
            turns = matrices * _diagonals(focals)[:, np.newaxis]
            vectors = scipy.spatial.transform.Rotation.from_matrix(turns).as_rotvec()
            shifts = vectors / self._per_shift(math.log(focal))
            own = np.append(shifts, np.log(focals / focal)[:, np.newaxis], axis=1)
        else:
            plain = matrices @ np.linalg.inv(self._normal)
            own = (plain / plain[:, 2:, 2:]).reshape(-1, 9)[:, :8]
        return np.concatenate([[math.log(focal), 0.0], own.ravel()])

    def ideal(self, distortion: float) -> tuple[Floats, Floats]:
        """Return the points of both pictures, centred and free of distortion.

        They are kept until another distortion is asked for: most steps leave it as it is.
        """
        if distortion not in self._ideal:
            points = self.points
            drawn = np.concatenate([points.p, points.q])
            sizes = self.sizes[np.concatenate([points.first, points.second])]
            ideal = undistorted(drawn, sizes, (0.0, distortion, 0.0))
            self._ideal.clear()
            self._ideal[distortion] = ideal[: len(points.p)], ideal[len(points.p) :]
        return self._ideal[distortion]

    def residuals(self, unknowns: Floats) -> Floats:
        """Compute the (2 K + 1,) residuals: distances of points in x and y ÷ their uncertainty, and the
        deviation of the focal length from the likely one.
        """
        mapped, ideal, _ = self._mapped(self.matrices(unknowns), float(unknowns[1]))
        distances = (mapped[:, :2] / mapped[:, 2:] - ideal) * self.points.weight[:, np.newaxis]
        prior = (unknowns[0] - math.log(self.focal)) / self.deviation
        return np.append(distances.ravel(), prior if self.free_focal else 0.0)

    def _mapped(self, matrices: Floats, distortion: float) -> tuple[Floats, Floats, Floats]:
        """Map the first points to the second pictures, (K, 3), beside the ideal second and first points."""
        p, q = self.ideal(distortion)
        starts = self.points.starts
        first, second = (index[starts[:-1]] for index in (self.points.first, self.points.second))
        between = (np.linalg.inv(matrices)[second] @ matrices[first]).repeat(np.diff(starts), axis=0)
        mapped = np.einsum("kij,kj->ki", between[:, :, :2], p) + between[:, :, 2]
        # Points behind the camera come to lie far away, from where the loss leads back smoothly.
        mapped[:, 2] = np.where(mapped[:, 2] > 0.02, mapped[:, 2], 0.02)
        return mapped, q, p

    def jacobian(self, unknowns: Floats) -> tuple[Floats, Indices]:
        """Compute the derivatives of the first 2 K of :meth:`residuals`.

        Returns
        -------
        values : (K, 2, C) float array
            Of a point's distances in x and y, by the unknowns of its pair.
        columns : (P, C) int array
            Numbers of the unknowns of each pair.
        """
        points, each = self.points, self.each
        distortion = float(unknowns[1])
        moving = 3 if self.family == "rotation" and not self.free_zoom else each
        # By the picture's own unknowns, and last by the focal length, which all share.
        steps = np.zeros((moving + 1, len(unknowns)))
        for number in range(moving):
            steps[number, 2 + number :: each] = _STEP
        steps[moving, 0] = _STEP
        around = self.matrices(np.concatenate([[unknowns], unknowns + steps, unknowns - steps]))
        matrices = around[0]
        slopes = (around[1 : moving + 2] - around[moving + 2 :]).swapaxes(0, 1) / (2 * _STEP)
        mapped, q, p = self._mapped(matrices, distortion)
        inverse = np.linalg.inv(matrices)[points.second]
        scene = np.append(p, np.ones((len(p), 1)), axis=1)
        back = inverse.transpose(0, 2, 1)
        # by the unknowns of the first picture, of the second, and by those that all share
        moves = np.empty((len(p), 2 * moving + 2, 3))
        first = (slopes[points.first] @ scene[:, np.newaxis, :, np.newaxis])[..., 0] @ back
        second = (slopes[points.second] @ mapped[:, np.newaxis, :, np.newaxis])[..., 0] @ back
        moves[:, :moving], moves[:, moving : 2 * moving] = first[:, :moving], -second[:, :moving]
        moves[:, -2] = first[:, moving] - second[:, moving]
        moves[:, -1] = 0
        if self.free_distortion:
            bent_p, bent_q = self._bent(points.first, p, distortion), self._bent(points.second, q, distortion)
            between = (inverse @ matrices[points.first])[..., :2]
            moves[:, -1] = (between @ bent_p[..., np.newaxis])[..., 0]
        # of the mapped points, px ÷ uncertainty
        moves[..., :2] -= (mapped[:, :2] / mapped[:, 2:])[:, np.newaxis] * moves[..., 2:]
        values = moves[..., :2] / mapped[:, np.newaxis, 2:]
        if self.free_distortion:
            values[:, -1] -= bent_q
        values *= points.weight[:, np.newaxis, np.newaxis]
        pairs = points.starts[:-1, np.newaxis]
        own = 2 + np.arange(moving)
        shared = np.broadcast_to([0, 1], (len(pairs), 2))
        columns = np.concatenate(
            [own + each * points.first[pairs], own + each * points.second[pairs], shared], axis=1
        )
        return np.ascontiguousarray(values.swapaxes(1, 2)), columns

    def equations(
        self, unknowns: Floats, weights: Floats, residuals: Floats, *, dense: int = 256
    ) -> tuple[Floats | csr_array, Floats]:
        """Compute the normal equations JᵀWJ x = -Jᵀr of all unknowns, pair by pair.

        Parameters
        ----------
        unknowns : (U,) float array
        weights, residuals : (2 K + 1,) float arrays
        dense : int
            Unknowns at most whose matrix is dense: sparse ones take several times as long to build.

        Returns
        -------
        matrix : (U, U) array, dense or sparse
        slope : (U,) float array
            Jᵀr.
        """
        values, columns = self.jacobian(unknowns)
        count, each, starts = len(unknowns), columns.shape[1], self.points.starts
        weighted = values * weights[:-1].reshape(-1, 2, 1)
        blocks = [
            values[start:end].reshape(-1, each).T @ weighted[start:end].reshape(-1, each)
            for start, end in pairwise(starts.tolist())
        ]
        matrix: Any = np.zeros((count, count))
        if count <= dense:
            for block, own in zip(blocks, columns, strict=True):
                matrix[own[:, np.newaxis], own] += block
        else:
            at = np.repeat(columns, each, axis=1).ravel(), np.tile(columns, each).ravel()
            matrix = csr_array((np.concatenate(blocks).ravel(), at), shape=(count, count))
        pulls = np.einsum("kac,ka->kc", values, residuals[:-1].reshape(-1, 2))
        slope = np.bincount(columns.ravel(), np.add.reduceat(pulls, starts[:-1]).ravel(), count)
        matrix[0, 0] += weights[-1] / self.deviation**2
        slope[0] += residuals[-1] / self.deviation
        return matrix, np.asarray(slope, float)

    def _bent(self, index: Indices, ideal: Floats, distortion: float) -> Floats:
        """Compute the (K, 2) derivatives by b of points free of distortion b; r (b r² + 1 - b) stays."""
        square = np.square(ideal).sum(axis=1) / np.square(self.sizes.min(axis=1) / 2)[index]
        return np.asarray(ideal * ((1 - square) / (1 - distortion + 3 * distortion * square))[:, np.newaxis])

    def minimise(self, *starts: Floats) -> tuple[Floats, float]:
        """Find the unknowns of least loss, and the loss, from the start that is best after a descent."""
        first, last = _DESCENTS
        tried = [self._descend(start, *first) for start in starts]
        return self._descend(min(tried, key=lambda one: one[1])[0], *last)

    def _descend(self, start: Floats, scale: float, settled: float, least: float) -> tuple[Floats, float]:
        """Find the unknowns of least loss Σ s² log(1 + r² ÷ s²) near a start, by the method of Levenberg and
        Marquardt on equations that are weighted anew in each step; see :data:`_DESCENTS`.
        """

        def loss_of(unknowns: Floats) -> tuple[Floats, float]:
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    residuals = self.residuals(unknowns)
                    loss = float(scale**2 * np.log1p(np.square(residuals / scale)).sum())
            except np.linalg.LinAlgError:  # a step so long that a picture shrinks to a line
                return np.zeros(0), math.inf
            return residuals, loss

        where, unknowns, damping = np.flatnonzero(self.free), start, 1e-3
        residuals, loss = loss_of(unknowns)
        for _ in range(_STEPS):
            far = np.square(residuals / scale)
            weights = 1 / (1 + far)
            curvature = np.maximum((1 - far) * weights**2, least * weights)
            normal, slope = self.equations(unknowns, curvature, weights * residuals)
            normal, slope = normal[where[:, np.newaxis], where], slope[where]
            diagonal = normal.diagonal() + 1e-12
            before = loss
            while damping < 1e8:
                step = _solved(normal, damping * diagonal, -slope)
                moved = unknowns.copy()
                moved[where] += step
                new_residuals, new_loss = loss_of(moved)
                if new_loss < loss:
                    unknowns, residuals, loss = moved, new_residuals, new_loss
                    damping = max(damping / 5, 1e-9)
                    break
                damping *= 4
            if before - loss <= settled * loss:
                break
        return unknowns, loss


def adjust_plane(sizes: Floats, matches: Mapping[Pair, Match], start: Bundle | None = None) -> Bundle:
    """Adjust homographies to a common plane, that of the picture in the middle.

    Parameters
    ----------
    sizes : (N, 2) float array
        Width and height of each picture, px.
    matches : mapping from pairs to Match
        They join all pictures, and have the homography of each pair.
    start : Bundle, optional
        By default homographies along the tree of the strongest matches.
    """
    if start is None:
        middle, order, before = spanning_tree(len(sizes), strengths_of(matches))
        matrices = np.tile(np.eye(3), (len(sizes), 1, 1))
        for index in order[1:]:
            matrix = matrices[before[index]] @ _centred(matches, sizes, int(before[index]), int(index))
            matrices[index] = matrix / matrix[2, 2]
    else:
        middle, matrices = start.middle, start.matrices
    problem = _Problem(sizes, _Points.of(matches), "plane", middle, 1.0, 1.0, False, False)
    flat = np.ones(len(sizes))
    unknowns, _ = problem.minimise(problem.unknowns(matrices, flat))
    return Bundle(
        family="plane",
        sizes=sizes,
        matrices=problem.matrices(unknowns) / np.cbrt(np.linalg.det(problem._normal)),
        focals=flat,
        distortion=0.0,
        middle=middle,
    )


def adjust_cameras(
    sizes: Floats,
    matches: Mapping[Pair, Match],
    *,
    focal: float | None = None,
    fixed: bool = False,
    distortion: float | None = None,
    start: Bundle | None = None,
    alone: bool = False,
) -> Bundle:
    """Adjust the turns of one camera, its focal length and its radial distortion.

    Parameters
    ----------
    sizes : (N, 2) float array
        Width and height of each picture, px.
    matches : mapping from pairs to Match
        They join all pictures, and have the homography of each pair.
    focal : float, optional
        About, px.
    fixed : bool
        Whether the focal length is exactly that.
    distortion : float, optional
        b of the lens; by default found where the pictures show one.
    start : Bundle, optional
        By default cameras along the tree of the strongest matches, with several focal lengths.
    alone : bool
        Whether no plane may explain the pictures instead.
    """
    middle, order, before = spanning_tree(len(sizes), strengths_of(matches))
    usual = _FOCALS[1] * float(sizes.max())
    points = _Points.of(matches)
    likely, deviation = (usual, _USUAL_DEVIATION) if focal is None else (focal, _STATED_DEVIATION)
    problem = _Problem(sizes, points, "rotation", middle, likely, deviation, not fixed, False)
    if start is not None:
        problem = replace(problem, middle=start.middle)
        beginnings = [problem.unknowns(start.matrices, start.focals)]
        beginnings[0][1] = start.distortion
        problem = replace(problem, free_zoom=bool((start.focals != start.focal).any()))
    else:
        guesses = [focal] if focal is not None else _likely_focals(sizes, matches)
        same = np.ones(len(sizes))
        beginnings = [_chain_cameras(problem, matches, guess * same, order, before) for guess in guesses]
    unknowns, loss = problem.minimise(*beginnings)
    if start is None:
        zooms = _zooms(sizes, matches, order, before)
        if (alone or np.ptp(np.log(zooms)) > _ZOOM) and not fixed:
            zoomed = replace(problem, free_zoom=True)
            beginnings = [_chain_cameras(zoomed, matches, guess * zooms, order, before) for guess in guesses]
            own, other = zoomed.minimise(*beginnings)
            if other < (1 - _DOUBTFUL_GAIN) * loss:
                problem, unknowns, loss = zoomed, own, other
    if distortion is not None:
        unknowns[1] = distortion
        unknowns, loss = problem.minimise(unknowns)
    else:
        bent, other = replace(problem, free_distortion=True).minimise(unknowns)
        gain = _DISTORTION_GAIN if len(sizes) > 2 else _DOUBTFUL_GAIN
        if abs(bent[1]) < _LARGEST_DISTORTION and other < (1 - gain) * loss:
            unknowns = bent
    return Bundle(
        family="rotation",
        sizes=sizes,
        matrices=problem.matrices(unknowns),
        focals=problem.focals(unknowns),
        distortion=float(unknowns[1]),
        middle=problem.middle,
    )


def _chain_cameras(
    problem: _Problem,
    matches: Mapping[Pair, Match],
    focals: Floats,
    order: Indices,
    before: Indices,
) -> Floats:
    """Return the unknowns of cameras with these focal lengths, turned one after another along a tree."""
    turns = np.tile(np.eye(3), (len(focals), 1, 1))
    lenses = _diagonals(1 / focals)
    for index in order[1:]:
        own = _centred(matches, problem.sizes, int(before[index]), int(index))
        turn = lenses[before[index]][:, np.newaxis] * own / lenses[index]
        turns[index] = turns[before[index]] @ _nearest_turn(turn)
    return problem.unknowns(turns * lenses[:, np.newaxis], focals)


def _solved(normal: Floats | csr_array, damping: Floats, right: Floats) -> Floats:
    """Solve damped normal equations, dense or sparse."""
    if isinstance(normal, np.ndarray):
        try:
            return np.asarray(np.linalg.solve(normal + np.diag(damping), right))
        except np.linalg.LinAlgError:  # there is no such step, as of a sparse one
            return np.full(len(right), np.nan)
    damped = normal.tocsc() + scipy.sparse.diags_array(damping)
    return np.asarray(scipy.sparse.linalg.spsolve(damped, right))


def _turns(vectors: Floats) -> Floats:
    """Compute the (..., 3, 3) matrices of (..., 3) rotation vectors, rad, by the formula of Rodrigues."""
    angle = np.sqrt(np.square(vectors).sum(axis=-1))[..., np.newaxis, np.newaxis]
    cross = np.zeros((*vectors.shape, 3))
    for axis, (row, column) in enumerate(((2, 1), (0, 2), (1, 0))):
        cross[..., row, column], cross[..., column, row] = vectors[..., axis], -vectors[..., axis]
    sine, cosine = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    return np.asarray(np.eye(3) + sine * cross + cosine * (cross @ cross))


def _diagonals(values: Floats) -> Floats:
    """Return each value twice and 1: (..., 3)."""
    return np.stack([values, values, np.ones_like(values)], axis=-1)


def _zooms(sizes: Floats, matches: Mapping[Pair, Match], order: Indices, before: Indices) -> Floats:
    """Estimate the scale of each picture beside that in the middle, along a tree: (N,).

    A camera that only turns enlarges nothing in the middle between two pictures; the mean over the points
    that both show is near to that.
    """
    zooms = np.ones(len(sizes))
    for index in order[1:]:
        one, other = int(before[index]), int(index)
        matrix = _centred(matches, sizes, one, other)
        pair = (one, other) if (one, other) in matches else (other, one)
        match = matches[pair]
        points = (match.second if pair[1] == other else match.first) - (sizes[other] - 1) / 2
        enlarged = np.log(np.abs(areas(matrix, points)))
        zooms[other] = zooms[one] * math.exp(-float(np.mean(enlarged)) / 2)
    return zooms


def strengths_of(matches: Mapping[Pair, Match]) -> dict[Pair, float]:
    """Compute the evidence of each pair."""
    return {pair: evidence_of(match.share, match.features) for pair, match in matches.items()}


def _centred(matches: Mapping[Pair, Match], sizes: Floats, one: int, other: int) -> Floats:
    """Return the (3, 3) homography from the centred pixels of picture `other` to those of picture `one`."""
    matrix = matches[one, other].matrix if (one, other) in matches else matches[other, one].matrix
    if (one, other) not in matches:
        matrix = np.asarray(np.linalg.inv(matrix), float)
    to_centre, back = np.eye(3), np.eye(3)
    to_centre[:2, 2] = -(sizes[one] - 1) / 2
    back[:2, 2] = (sizes[other] - 1) / 2
    return np.asarray(to_centre @ matrix @ back)


def _nearest_turn(matrix: Floats) -> Floats:
    """Return the rotation that is nearest to a (3, 3) matrix."""
    left, _, right = np.linalg.svd(matrix)
    turn = left @ right
    return np.asarray(turn * np.sign(np.linalg.det(turn)))


def _likely_focals(sizes: Floats, matches: Mapping[Pair, Match]) -> list[float]:
    """List the median focal length, px, of the pairs' homographies, and usual ones (Szeliski and Shum 1997,
    doi:10.1145/258734.258861).
    """
    side = float(sizes.max())
    estimates: list[float] = []
    for i, j in matches:
        matrix = _centred(matches, sizes, i, j)
        for h in (matrix, np.linalg.inv(matrix)):
            h = h / np.linalg.norm(h)
            for above, below in (
                (-(h[0, 0] * h[0, 1] + h[1, 0] * h[1, 1]), h[2, 0] * h[2, 1]),
                (h[0, 0] ** 2 + h[1, 0] ** 2 - h[0, 1] ** 2 - h[1, 1] ** 2, h[2, 1] ** 2 - h[2, 0] ** 2),
            ):
                if abs(below) > 1e-12 and 0.4 * side < (value := math.sqrt(max(above / below, 0))) < 8 * side:
                    estimates.append(value)
    median = [float(np.median(estimates))] if estimates else []
    return [*median, *(share * side for share in _FOCALS)]


def left_over(
    bundle: Bundle,
    matches: Mapping[Pair, Match],
    pairs: Collection[Pair] | None = None,
    *,
    largest: float = 20.0,
    wrong: float = 0.1,
) -> float:
    """Compute the root of the mean square distance of points, px; all pairs count alike.

    Parameters
    ----------
    bundle : Bundle
    matches : mapping from pairs to Match
    pairs : collection of pairs, optional
        Those of the matches that count; by default all.
    largest : float
        Larger distances, px, count like this one.
    wrong : float
        Share of a pair's points, the farthest ones, that do not count: a model with more unknowns bends to
        wrong points.
    """
    parts: list[float] = []
    for pair in matches if pairs is None else pairs:
        distances = np.sort(bundle.distances(pair, matches[pair]))
        nearest = distances[: math.ceil((1 - wrong) * len(distances))]
        parts.append(float(np.mean(np.minimum(nearest, largest) ** 2)))
    return math.sqrt(float(np.mean(parts)))
