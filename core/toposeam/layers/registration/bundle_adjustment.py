"""All pictures of a set adjusted at once to the points that pairs of them share.

Each picture i has a matrix G_i that takes its pixels (x, y, 1), counted from its centre and free of
distortion, to the scene: a homography to a common plane, or R_i diag(1/f_i, 1/f_i, 1), the rays of a camera
that turns about one point; f_i is the same of all pictures unless some show things clearly larger than others
do. A point p of picture i is then seen at G_j⁻¹ G_i p in picture j; what is left to the point q where it was
found is minimised with a Cauchy loss (Triggs et al. 2000, doi:10.1007/3-540-44480-7_21).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree, shortest_path

from toposeam.arrays import Floats
from toposeam.layers.canvas.transforms import undistorted
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.consensus import evidence_of
from toposeam.layers.registration.homography import applied, areas
from toposeam.layers.registration.pair_matching import Match

Family: TypeAlias = Literal["plane", "rotation"]

#: Focal lengths that are tried where nobody says one, as shares of the larger side: wide, usual, long.
_FOCALS = (0.8, 1.2, 2.5)
#: A focal length is within this many per cent of what is said, and of what is usual, one standard deviation.
_SAID, _USUAL = 0.05, 0.6
#: Points of a pair at most.
_POINTS = 150
#: A point that is off by so many times its uncertainty counts half as much; first all count.
_SCALES = (30.0, 2.0)
_STEPS = 60
#: Steps end where one takes away less than this share of the loss: at the first scale, and at the last.
_SETTLED = (1e-5, 1e-6)
#: The curvature of the loss counts at least as this share of a point's weight, at both scales.
_LEAST_CURVATURE = (1.0, 0.1)
#: Step of difference quotients.
_STEP = 1e-6
#: A distortion counts where it takes away this share of what is left, of a single pair more; larger ones are
#: no lens.
_DISTORTION_GAIN, _PAIR_GAIN, _LARGEST_DISTORTION = 0.04, 0.25, 0.2
#: Logarithm of the scale between two pictures from which on they may have focal lengths of their own, which
#: must take away this share of what is left.
_ZOOM, _ZOOM_GAIN = 0.15, 0.25
#: Beyond this many px a point is as wrong as any other.
_CAP = 20.0
#: This share of a pair's points may be wrong.
_WRONG = 0.1


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bundle:
    """Pictures adjusted to each other."""

    family: Family
    #: Width and height of each picture, px.
    sizes: Floats
    #: (N, 3, 3): centred pixels to the scene.
    matrices: Floats
    #: (N,) focal length of each picture, px, and b of Hugin's radial distortion; of a plane 1 and 0.
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
        """Largest angle, degrees, between the rays of two corners of the pictures; of a camera."""
        corners = np.stack([self.sizes, self.sizes * [1, -1], -self.sizes, self.sizes * [-1, 1]], axis=1) / 2
        rays = np.append(corners, np.ones((*corners.shape[:2], 1)), axis=2) @ np.swapaxes(self.matrices, 1, 2)
        flat = rays.reshape(-1, 3) / np.linalg.norm(rays.reshape(-1, 3), axis=1, keepdims=True)
        return math.degrees(math.acos(max(-1.0, float((flat @ flat.T).min()))))

    def size(self, index: int) -> tuple[int, int]:
        """Width and height of a picture, px."""
        return int(self.sizes[index, 0]), int(self.sizes[index, 1])

    def between(self, start: int, end: int) -> Floats:
        """(3, 3) from the centred pixels of one picture to those of another, both free of distortion."""
        return np.asarray(np.linalg.inv(self.matrices[end]) @ self.matrices[start])

    def ideal(self, index: int, points: Floats) -> Floats:
        """(M, 2) centred points of a picture without the lens's distortion."""
        return undistorted(points, self.size(index), self.lens)

    def off(self, pair: Pair, match: Match) -> Floats:
        """(M,) how far, px, the points of a pair lie apart."""
        i, j = pair
        seen = applied(self.between(i, j), self.ideal(i, match.first)) - self.ideal(j, match.second)
        return np.asarray(np.hypot(*seen.T))

    def medians(self, matches: Mapping[Pair, Match]) -> dict[Pair, float]:
        """How far, px, the points of each pair lie apart in the median."""
        return {pair: float(np.median(self.off(pair, match))) for pair, match in matches.items()}


def spanning_tree(
    count: int, strengths: Mapping[Pair, float]
) -> tuple[int, npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Picture in the middle of the strongest tree, the order from there, and whom each one hangs on."""
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
    """Points that pairs share: which two pictures, x and y in both, and a weight: the share of what both show
    in common ÷ px of uncertainty.
    """

    first: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]
    p: Floats
    q: Floats
    weight: Floats

    @classmethod
    def of(cls, matches: Mapping[Pair, Match]) -> _Points:
        rng = np.random.default_rng(0)
        largest = max(match.share for match in matches.values())
        parts = []
        for (i, j), match in matches.items():
            chosen = np.sort(rng.permutation(len(match.first))[:_POINTS])
            doubts = np.broadcast_to(match.uncertainty, len(match.first))[chosen]
            some = np.ones(len(chosen))
            parts.append(
                (
                    i * some,
                    j * some,
                    match.first[chosen],
                    match.second[chosen],
                    match.share / largest / doubts,
                )
            )
        first, second, p, q, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
        return cls(first.astype(np.intp), second.astype(np.intp), p, q, weight)


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Residuals of a bundle and their derivatives, as functions of one vector of unknowns.

    The first two unknowns are the logarithm of the focal length and the distortion; then come those of each
    picture, of which the middle one's are fixed: eight entries of a homography, or a vector along the axis
    of a turn and the logarithm of how many times longer the picture's own focal length is.
    """

    sizes: Floats
    points: _Points
    family: Family
    middle: int
    #: Focal length that is likely, px, and one standard deviation of its logarithm.
    focal: float
    doubt: float
    #: Whether focal length and distortion are free.
    free_focal: bool
    free_distortion: bool
    #: Whether each picture has a focal length of its own.
    free_zoom: bool = False
    #: Points free of the last distortion that was asked for.
    _ideal: dict[float, tuple[Floats, Floats]] = field(init=False, repr=False, default_factory=dict)

    @property
    def each(self) -> int:
        return 8 if self.family == "plane" else 4

    @property
    def free(self) -> npt.NDArray[np.bool_]:
        count = len(self.sizes)
        own = np.ones((count, self.each), bool)
        own[self.middle] = False
        own[:, 3:] &= self.family == "plane" or self.free_zoom
        return np.concatenate([[self.free_focal, self.free_distortion], own.ravel()])

    def matrices(self, unknowns: Floats) -> Floats:
        own = unknowns[2:].reshape(len(self.sizes), -1)
        if self.family == "rotation":
            vectors = own[:, :3] * self._per_shift(float(unknowns[0]))
            turns = scipy.spatial.transform.Rotation.from_rotvec(vectors).as_matrix()
            return np.asarray(turns / _diagonals(self.focals(unknowns))[:, np.newaxis])
        ones = np.ones((len(own), 1))
        return np.asarray(np.concatenate([own, ones], axis=1).reshape(-1, 3, 3) @ self._normal)

    def focals(self, unknowns: Floats) -> Floats:
        """(N,) focal lengths of the cameras, px."""
        return np.asarray(np.exp(unknowns[0] + unknowns[5::4]))

    def _per_shift(self, log_focal: float) -> Floats:
        """(3,) turns, rad, that move what is seen by half of the larger side; 1 about the optical axis."""
        shift = float(self.sizes.max()) / 2 * math.exp(-log_focal)
        return np.array([shift, shift, 1.0])

    @property
    def _normal(self) -> Floats:
        half = self.sizes.max() / 2
        return np.diag([1 / half, 1 / half, 1.0])

    def unknowns(self, matrices: Floats, focals: Floats) -> Floats:
        """The vector of unknowns of matrices and focal lengths."""
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
        """(K + 1,): px ÷ the uncertainty of points, in x and y, and what is known of the focal length."""
        seen, ideal, _ = self._seen(self.matrices(unknowns), float(unknowns[1]))
        off = (seen[:, :2] / seen[:, 2:] - ideal) * self.points.weight[:, np.newaxis]
        prior = (unknowns[0] - math.log(self.focal)) / self.doubt
        return np.append(off.ravel(), prior if self.free_focal else 0.0)

    def _seen(self, matrices: Floats, distortion: float) -> tuple[Floats, Floats, Floats]:
        p, q = self.ideal(distortion)
        scene = np.einsum("kij,kj->ki", matrices[self.points.first], np.append(p, np.ones((len(p), 1)), 1))
        seen = np.einsum("kij,kj->ki", np.linalg.inv(matrices)[self.points.second], scene)
        # Behind the camera: far away, on a smooth way back.
        seen[:, 2] = np.where(seen[:, 2] > 0.02, seen[:, 2], 0.02)
        return seen, q, p

    def jacobian(self, unknowns: Floats) -> csr_array:
        """Derivatives of :meth:`residuals` by the free unknowns."""
        points, each = self.points, self.each
        matrices, distortion = self.matrices(unknowns), float(unknowns[1])
        seen, q, p = self._seen(matrices, distortion)
        inverse = np.linalg.inv(matrices)[points.second]
        moving = 3 if self.family == "rotation" and not self.free_zoom else each
        # By the picture's own unknowns, and last by the focal length, which all share.
        steps = np.zeros((moving + 1, len(unknowns)))
        for number in range(moving):
            steps[number, 2 + number :: each] = _STEP
        steps[moving, 0] = _STEP
        slopes = np.stack(
            [
                (self.matrices(unknowns + step) - self.matrices(unknowns - step)) / (2 * _STEP)
                for step in steps
            ],
            axis=1,
        )
        scene = np.append(p, np.ones((len(p), 1)), axis=1)
        moves = (
            np.einsum("kab,knbc,kc->kna", inverse, slopes[points.first], scene),
            -np.einsum("kab,knbc,kc->kna", inverse, slopes[points.second], seen),
        )

        def drawn(move: Floats) -> Floats:
            """(K, n, 2) px ÷ uncertainty, of moves of what is seen."""
            slope = move[..., :2] - (seen[:, :2] / seen[:, 2:])[:, np.newaxis] * move[..., 2:]
            return np.asarray(slope / seen[:, np.newaxis, 2:] * points.weight[:, np.newaxis, np.newaxis])

        rows, columns, values = [], [], []
        numbers = np.arange(2 * len(p)).reshape(-1, 2)
        for index, move in zip((points.first, points.second), moves, strict=True):
            slope = drawn(move)
            own = 2 + each * index[:, np.newaxis] + np.arange(moving + 1)
            own[:, moving] = 0
            rows.append(np.broadcast_to(numbers[:, np.newaxis, :], slope.shape).ravel())
            columns.append(np.broadcast_to(own[..., np.newaxis], slope.shape).ravel())
            values.append(slope.ravel())
        if self.free_distortion:
            bent_p, bent_q = self._bent(points.first, p, distortion), self._bent(points.second, q, distortion)
            between = (inverse @ matrices[points.first])[..., :2]
            slope = drawn(np.einsum("kab,kb->ka", between, bent_p)[:, np.newaxis])[:, 0]
            values.append((slope - bent_q * points.weight[:, np.newaxis]).ravel())
            rows.append(numbers.ravel())
            columns.append(np.ones(numbers.size, int))
        rows.append(np.array([2 * len(p)]))
        columns.append(np.array([0]))
        values.append(np.array([1 / self.doubt]))
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        whole_matrix = csr_array(entries, shape=(2 * len(p) + 1, len(unknowns)))
        return whole_matrix[:, np.flatnonzero(self.free)]

    def _bent(self, index: npt.NDArray[np.intp], ideal: Floats, distortion: float) -> Floats:
        """(K, 2) derivatives of points free of distortion b by b: r (b r² + 1 - b) stays as it is."""
        square = np.square(ideal).sum(axis=1) / np.square(self.sizes.min(axis=1) / 2)[index]
        return np.asarray(ideal * ((1 - square) / (1 - distortion + 3 * distortion * square))[:, np.newaxis])

    def solved(self, *starts: Floats) -> tuple[Floats, float]:
        """Unknowns of least loss, and the loss, from the start that has the least at the first scale."""
        first, last = zip(_SCALES, _SETTLED, _LEAST_CURVATURE, strict=True)
        found = [self._descended(start, *first) for start in starts]
        return self._descended(min(found, key=lambda one: one[1])[0], *last)

    def _descended(self, start: Floats, scale: float, settled: float, least: float) -> tuple[Floats, float]:
        """Unknowns of least loss Σ s² log(1 + r² ÷ s²) near a start, by the method of Levenberg and Marquardt
        on equations that are weighted anew in each step.
        """

        def lost(unknowns: Floats) -> tuple[Floats, float]:
            residuals = self.residuals(unknowns)
            return residuals, float(scale**2 * np.log1p(np.square(residuals / scale)).sum())

        where, unknowns, damping = np.flatnonzero(self.free), start, 1e-3
        residuals, loss = lost(unknowns)
        for _ in range(_STEPS):
            jacobian = self.jacobian(unknowns)
            far = np.square(residuals / scale)
            weights = 1 / (1 + far)
            curvature = np.maximum((1 - far) * weights**2, least * weights)
            normal = (jacobian.multiply(curvature[:, np.newaxis]).tocsr().T @ jacobian).tocsc()
            slope = jacobian.T @ (weights * residuals)
            diagonal = normal.diagonal() + 1e-12
            before = loss
            while damping < 1e8:
                step = scipy.sparse.linalg.spsolve(
                    normal + scipy.sparse.diags_array(damping * diagonal), -slope
                )
                moved = unknowns.copy()
                moved[where] += step
                new_residuals, new_loss = lost(moved)
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
        Which join all pictures, with the homography of each.
    start : Bundle, optional
        By default along the tree of the strongest matches.
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
    unknowns, _ = problem.solved(problem.unknowns(matrices, flat))
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
) -> Bundle:
    """Adjust the turns of one camera, its focal length and its radial distortion.

    Parameters
    ----------
    sizes : (N, 2) float array
        Width and height of each picture, px.
    matches : mapping from pairs to Match
        Which join all pictures, with the homography of each.
    focal : float, optional
        px, about.
    fixed : bool
        The focal length is just that.
    distortion : float, optional
        b of the lens; by default found where the pictures show one.
    start : Bundle, optional
        By default along the tree of the strongest matches, with several focal lengths.
    """
    middle, order, before = spanning_tree(len(sizes), strengths_of(matches))
    usual = 1.2 * float(sizes.max())
    points = _Points.of(matches)
    likely, doubt = (usual, _USUAL) if focal is None else (focal, _SAID)
    problem = _Problem(sizes, points, "rotation", middle, likely, doubt, not fixed, False)
    if start is not None:
        problem = replace(problem, middle=start.middle)
        beginnings = [problem.unknowns(start.matrices, start.focals)]
        beginnings[0][1] = start.distortion
        problem = replace(problem, free_zoom=bool((start.focals != start.focal).any()))
    else:
        guesses = [focal] if focal is not None else _likely_focals(sizes, matches)
        same = np.ones(len(sizes))
        beginnings = [_chained(problem, matches, guess * same, order, before) for guess in guesses]
    unknowns, loss = problem.solved(*beginnings)
    if start is None:
        zooms = _zooms(sizes, matches, order, before)
        if np.ptp(np.log(zooms)) > _ZOOM and not fixed:
            zoomed = replace(problem, free_zoom=True)
            beginnings = [_chained(zoomed, matches, guess * zooms, order, before) for guess in guesses]
            own, other = zoomed.solved(*beginnings)
            if other < (1 - _ZOOM_GAIN) * loss:
                problem, unknowns, loss = zoomed, own, other
    if distortion is not None:
        unknowns[1] = distortion
        unknowns, loss = problem.solved(unknowns)
    else:
        bent, other = replace(problem, free_distortion=True).solved(unknowns)
        gain = _DISTORTION_GAIN if len(sizes) > 2 else _PAIR_GAIN
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


def _chained(
    problem: _Problem,
    matches: Mapping[Pair, Match],
    focals: Floats,
    order: npt.NDArray[np.intp],
    before: npt.NDArray[np.intp],
) -> Floats:
    """Unknowns of cameras with these focal lengths, one after another along a tree."""
    turns = np.tile(np.eye(3), (len(focals), 1, 1))
    lenses = _diagonals(1 / focals)
    for index in order[1:]:
        own = _centred(matches, problem.sizes, int(before[index]), int(index))
        turn = lenses[before[index]][:, np.newaxis] * own / lenses[index]
        turns[index] = turns[before[index]] @ _nearest_turn(turn)
    return problem.unknowns(turns * lenses[:, np.newaxis], focals)


def _diagonals(values: Floats) -> Floats:
    """(N, 3): each value twice and 1."""
    return np.stack([values, values, np.ones_like(values)], axis=1)


def _zooms(
    sizes: Floats, matches: Mapping[Pair, Match], order: npt.NDArray[np.intp], before: npt.NDArray[np.intp]
) -> Floats:
    """(N,) about how many times larger each picture shows things than that in the middle, along a tree.

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
    """How much each pair tells."""
    return {pair: evidence_of(match.share, match.features) for pair, match in matches.items()}


def _centred(matches: Mapping[Pair, Match], sizes: Floats, one: int, other: int) -> Floats:
    """(3, 3) homography from the centred pixels of one picture, `other`, to those of another."""
    matrix = matches[one, other].matrix if (one, other) in matches else matches[other, one].matrix
    if (one, other) not in matches:
        matrix = np.asarray(np.linalg.inv(matrix), float)
    to_centre, back = np.eye(3), np.eye(3)
    to_centre[:2, 2] = -(sizes[one] - 1) / 2
    back[:2, 2] = (sizes[other] - 1) / 2
    return np.asarray(to_centre @ matrix @ back)


def _nearest_turn(matrix: Floats) -> Floats:
    left, _, right = np.linalg.svd(matrix)
    turn = left @ right
    return np.asarray(turn * np.sign(np.linalg.det(turn)))


def _likely_focals(sizes: Floats, matches: Mapping[Pair, Match]) -> list[float]:
    """Focal lengths, px, that the homographies of pairs say, and usual ones (Szeliski and Shum 1997,
    doi:10.1145/258734.258861).
    """
    side = float(sizes.max())
    said: list[float] = []
    for i, j in matches:
        matrix = _centred(matches, sizes, i, j)
        for h in (matrix, np.linalg.inv(matrix)):
            h = h / np.linalg.norm(h)
            for above, below in (
                (-(h[0, 0] * h[0, 1] + h[1, 0] * h[1, 1]), h[2, 0] * h[2, 1]),
                (h[0, 0] ** 2 + h[1, 0] ** 2 - h[0, 1] ** 2 - h[1, 1] ** 2, h[2, 1] ** 2 - h[2, 0] ** 2),
            ):
                if abs(below) > 1e-12 and 0.4 * side < (value := math.sqrt(max(above / below, 0))) < 8 * side:
                    said.append(value)
    middle = [float(np.median(said))] if said else []
    return [*middle, *(share * side for share in _FOCALS)]


def left_over(bundle: Bundle, matches: Mapping[Pair, Match], pairs: Collection[Pair] | None = None) -> float:
    """Root of the mean square of what is left, px, each at most `_CAP`, all pairs alike.

    The farthest `_WRONG` of a pair's points do not count: a model with more unknowns bends to a wrong one.
    """
    parts: list[float] = []
    for pair in matches if pairs is None else pairs:
        off = np.sort(bundle.off(pair, matches[pair]))
        nearest = off[: math.ceil((1 - _WRONG) * len(off))]
        parts.append(float(np.mean(np.minimum(nearest, _CAP) ** 2)))
    return math.sqrt(float(np.mean(parts)))
