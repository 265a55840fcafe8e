"""Match pairs of pictures: by the features they share, and by patches of their overlap laid on each other."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy

from toposeam.arrays import Complexes, Floats, Floats32, Indices, Mask
from toposeam.heat.threads import one_thread
from toposeam.images import blurred
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import (
    PlaneTransform,
    ReducedTransform,
    Transform,
    enlarged,
    reach,
)
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.features import FeatureSet, describe_picture, shared_features
from toposeam.layers.registration.homography import (
    LEAST_INLIERS,
    Homography,
    applied,
    find_homography,
    within,
)
from toposeam.layers.registration.planes import find_planes, together_verified

#: Least correlation of two overlaps that are taken to show the same.
LEAST_CORRELATION = 0.5
#: Farthest that a similarity turns pictures against each other, degrees, and scales them, as a share.
LARGEST_TURN, LARGEST_SCALE = 3.5, 0.035
#: Features that have to agree on a similarity.
_LEAST_FEATURES = 5
#: Rows and columns of cells of a picture, or of patches of an overlap, that are looked at.
GRID = 8
#: Least distance of another place, as a share of a picture's diagonal: less is a lens or perspective.
ELSEWHERE = 0.02
#: Least share of the cells that agree: of pictures that lie at the same place, and of others and of the
#: middle of the former. Of 138 pairs with frames, bars and logos 0.47 agree in 95 of 100, in the middle 0.14;
#: of 60 pictures taken twice from one place, darker and noisy, and with something else in a sixth of them,
#: 0.65 and 0.37 in nine of ten; of photographs with parallax at least 0.29 (benchmarks/impostors.py).
_LEAST_AGREEING = (0.5, 0.2)
#: px of the reduced pictures within which a feature agrees with a transform, and one standard deviation of
#: those that do.
_TOLERANCE, FEATURE_DEVIATION = 2.0, 0.5
#: Forests of pairs, no pair in two of them, that have to join two pictures before their own pair is skipped:
#: all pairs of 12 pictures that show the same are tried, and about this many for each of more pictures.
_FORESTS = 6
#: Pairs that an executor is given at once.
_BATCH = 64
#: Largest and least side of a patch, px of the detail.
_PATCH_SIDE, _LEAST_PATCH_SIDE = 64, 16
#: Least correlation of a patch that counts.
_LEAST_PATCH_CORRELATION = 0.6
#: Least ratio of how much a patch changes along its straightest direction to how much it changes across it.
_LEAST_CORNER = 0.1

Kind: TypeAlias = Literal["similarity", "homography"]
#: Two pictures by the digests of what is compared of them.
_Digests: TypeAlias = tuple[bytes, bytes]
#: Width and height of a picture, px.
_Size: TypeAlias = tuple[int, int]
#: (K, 2) x and y of the features that each of two pictures shows in their overlap, px of the first, and of
#: all of the second.
_Shown: TypeAlias = tuple[Floats, Floats, Floats]


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Points of one picture and the same ones of another."""

    #: (M, 2) x and y, px.
    first: Floats
    second: Floats
    #: Of the overlap; NaN where patches were not compared.
    correlation: float
    #: (3, 3): takes points of the second picture to about where they are in the first.
    matrix: Floats = field(default_factory=lambda: np.eye(3))
    #: Features that agree, and their share of all features that a picture shows in the overlap.
    features: int = 0
    share: float = 1.0
    #: One standard deviation of each point, (M,), or of all, px.
    uncertainty: float | Floats = 1.0


def _digest(picture: Layer) -> bytes:
    """Hash all of a picture that is compared: equal pictures are described once."""
    digest = hashlib.sha256(repr((picture.image.shape, picture.image.dtype, picture.data_range)).encode())
    digest.update(np.ascontiguousarray(picture.image).data)
    digest.update(np.packbits(picture.covered).data)
    return digest.digest()


class PairMatcher:
    """Features of pictures, and the matches of pairs of them.

    Shared features are cheap to find and known of all pairs. Equal pictures are described once.

    Parameters
    ----------
    pictures : sequence of Layer
    report : callable
        Called with the share of the work done, up to 0.5, and up to 0.9 by :meth:`matches`.
    executor : Executor, optional
        Where pictures are described and pairs are matched.
    given : mapping from pairs to Match, optional
        Pairs whose points the user gave.
    """

    def __init__(
        self,
        pictures: Sequence[Layer],
        report: Callable[[float], None],
        executor: Executor | None = None,
        given: Mapping[Pair, Match] | None = None,
    ) -> None:
        self.pictures, self.executor, self._report = pictures, executor, report
        self._digests = list(results(executor, _digest, pictures))
        first = {digest: index for index, digest in reversed(list(enumerate(self._digests)))}
        different = sorted(first, key=lambda digest: first[digest])
        self._described: dict[bytes, FeatureSet] = {}
        self._lines: dict[bytes, Floats] = {}
        self._tried: dict[Kind, dict[_Digests, Match | None]] = {"similarity": {}, "homography": {}}
        described = results(executor, describe_picture, [pictures[first[digest]] for digest in different])
        for digest, features in zip(different, described, strict=True):
            self._described[digest] = features
            report(0.3 * len(self._described) / len(different))
        #: Of each picture.
        self.features = [self._described[digest] for digest in self._digests]
        pairs = list(combinations(range(len(self.features)), 2))
        self._shared = _share_features(self._described, map(self._key, pairs), report, executor)
        given = given or {}
        for pair, match in given.items():
            for tried in self._tried.values():
                tried[self._key(pair)] = match
        #: All pairs, those with given points first, then those that share most features.
        self.pairs = sorted(pairs, key=lambda pair: (pair not in given, -len(self.shared(pair))))

    @property
    def names(self) -> list[str]:
        """Names of the pictures."""
        return [picture.name for picture in self.pictures]

    def _key(self, pair: Pair) -> _Digests:
        return self._digests[pair[0]], self._digests[pair[1]]

    def shared(self, pair: Pair) -> Indices:
        """Return the (M, 2) numbers of the features that a pair shares."""
        return self._shared[self._key(pair)]

    def lines(self, number: int) -> Floats:
        """Return the straight edges of a picture, (K, 4); they are looked for once."""
        digest = self._digests[number]
        if digest not in self._lines:
            from toposeam.layers.mesh.verticals import lines_of

            self._lines[digest] = lines_of(self.pictures[number].image)
        return self._lines[digest]

    def most_shared(self) -> Indices:
        """Count the features that each picture shares with the one that it shares most with: (N,)."""
        most = np.zeros(len(self.features), np.intp)
        for pair in self.pairs:
            most[list(pair)] = np.maximum(most[list(pair)], len(self.shared(pair)))
        return most

    def homographies(self, pairs: Sequence[Pair]) -> list[Match | None]:
        """Match pairs by homographies; None where too few features agree."""
        keys = [self._key(pair) for pair in pairs]
        tried = self._tried["homography"]
        self._try("homography", dict.fromkeys(key for key in keys if key not in tried))
        return [tried[key] for key in keys]

    def planes(self, pair: Pair) -> list[Match]:
        """Match a pair by each plane of the scene, the one with most features first."""
        return match_planes(self.features[pair[0]], self.features[pair[1]], self.shared(pair))

    def _try(self, kind: Kind, keys: Iterable[_Digests]) -> None:
        """Match pairs of different pictures that are not matched yet."""
        keys = list(keys)
        items = [
            (kind, self._described[one], self._described[other], self._shared[one, other])
            for one, other in keys
        ]
        self._tried[kind].update(zip(keys, results(self.executor, _match_pair, items), strict=True))

    def _next_untried(self, kind: Kind, pairs: Sequence[Pair], trees: Indices) -> list[_Digests]:
        """List the first pairs that are tried unless the matches found until then join them."""
        keys: dict[_Digests, None] = {}
        for i, j in pairs:
            if (trees[:, i] != trees[:, j]).any() and self._key((i, j)) not in self._tried[kind]:
                keys[self._key((i, j))] = None
            if len(keys) >= _BATCH:
                break
        return list(keys)

    def matches(self, kind: Kind, least: float) -> tuple[dict[Pair, Match], Floats]:
        """Match pairs, those that share most features first, the rest only where few others join them.

        Parameters
        ----------
        kind : {"similarity", "homography"}
            The transform that takes one picture to the other.
        least : float
            Least correlation of pictures that show the same, of a similarity.

        Returns
        -------
        matches : dict of (int, int) to Match
        best : (N,) array
            The best correlation of each picture; -1 where none was found.
        """
        count, tried = len(self.features), self._tried[kind]
        matches: dict[Pair, Match] = {}
        best = np.full(count, -1.0)
        trees = np.tile(np.arange(count), (_FORESTS, 1))  # the tree of each picture, by forest
        for number, pair in enumerate(self.pairs):
            i, j = pair
            separate = np.flatnonzero(trees[:, i] != trees[:, j])
            if len(separate):
                if self._key(pair) not in tried:
                    ahead = [pair] if self.executor is None else self.pairs[number:]
                    self._try(kind, self._next_untried(kind, ahead, trees))
                match = tried[self._key(pair)]
                if match is not None:
                    best[[i, j]] = np.fmax(best[[i, j]], match.correlation)
                    if not match.correlation < least or kind == "homography":
                        matches[pair] = match
                        tree = trees[separate[0]]
                        tree[tree == tree[j]] = tree[i]
            self._report(0.5 + 0.4 * (number + 1) / len(self.pairs))
        return dict(sorted(matches.items())), best


def _share_features(
    described: Mapping[bytes, FeatureSet],
    pairs: Iterable[_Digests],
    report: Callable[[float], None],
    executor: Executor | None,
) -> dict[_Digests, Indices]:
    """Find the features that pairs of pictures share; all pairs with the same first picture go together."""
    nothing = np.zeros((0, 0), np.float32)
    bare = {digest: replace(one, detail=nothing, known=nothing > 0) for digest, one in described.items()}
    seconds: dict[bytes, list[bytes]] = {}
    for one, other in dict.fromkeys(pairs):
        seconds.setdefault(one, []).append(other)
    count = sum(map(len, seconds.values()))
    shared: dict[_Digests, Indices] = {}
    items = ((bare[one], [bare[other] for other in others]) for one, others in seconds.items())
    for one, found in zip(seconds, results(executor, _shared_with, items), strict=True):
        for other, numbers in zip(seconds[one], found, strict=True):
            shared[one, other] = numbers
            report(0.3 + 0.2 * len(shared) / count)
    return shared


@one_thread()
def _shared_with(item: tuple[FeatureSet, Sequence[FeatureSet]]) -> list[Indices]:
    one, others = item
    return [shared_features(one, other) for other in others]


@one_thread()
def _match_pair(item: tuple[Kind, FeatureSet, FeatureSet, Indices]) -> Match | None:
    kind, a, b, shared = item
    find = _match_similarity if kind == "similarity" else match_homography
    match = find(a, b, shared)
    if match is None and len(shared):
        # What is the same at the same place in both, as a frame or a tool bar, may hide what they share.
        fixed = at_one_place(a, b, shared)
        if fixed.sum() >= _LEAST_FEATURES:
            match = find(a, b, shared[~fixed])
    return match


def match_homography(a: FeatureSet, b: FeatureSet, shared: Indices) -> Match | None:
    """Match two pictures by the features that a homography brings together.

    Parameters
    ----------
    a, b : FeatureSet
    shared : (M, 2) int array
        Numbers of the features that they share.

    Returns
    -------
    Match or None
        None where too few features agree.
    """
    tolerance = _TOLERANCE * float(max(a.scale, b.scale))
    sizes = a.size, b.size
    first, second = a.keypoints[shared[:, 0]], b.keypoints[shared[:, 1]]
    homography = find_homography(first, second, sizes, tolerance)
    if homography is None:
        return None
    shown = _shown(a, b, sizes, homography.matrix)
    if not homography.verified:
        if not together_verified(first, find_planes(first, second, sizes, tolerance)):
            return None
    elif not _agrees(a, b, shared, homography.matrix, shown, homography.inliers):
        return None
    return _match_of(a, b, shared, homography, shown)


def match_planes(a: FeatureSet, b: FeatureSet, shared: Indices) -> list[Match]:
    """Match two pictures by each plane that their features lie on; parameters of :func:`match_homography`."""
    tolerance = _TOLERANCE * float(max(a.scale, b.scale))
    sizes = a.size, b.size
    planes = find_planes(a.keypoints[shared[:, 0]], b.keypoints[shared[:, 1]], sizes, tolerance)
    return [_match_of(a, b, shared, one, _shown(a, b, sizes, one.matrix)) for one in planes]


def _match_of(a: FeatureSet, b: FeatureSet, shared: Indices, homography: Homography, shown: _Shown) -> Match:
    """Return the match of the features that agree with a homography."""
    inliers = homography.inliers
    return Match(
        a.keypoints[shared[inliers, 0]],
        b.keypoints[shared[inliers, 1]],
        math.nan,
        matrix=homography.matrix,
        features=int(inliers.sum()),
        share=float(inliers.sum()) / max(min(map(len, shown[:2])), 1),
        uncertainty=FEATURE_DEVIATION * float(max(a.scale, b.scale)),
    )


def _match_similarity(a: FeatureSet, b: FeatureSet, shared: Indices) -> Match | None:
    """Match two pictures by patches that a similarity brings together; None where they show different things.

    `shared` has the (M, 2) numbers of the features that they share.
    """
    from skimage import measure, transform

    ransac: Any = measure.ransac  # carry no types
    similarity: Any = transform.SimilarityTransform
    if len(shared) < _LEAST_FEATURES or not _moved_alike(a, b, shared):
        return None
    model, inliers = ransac(
        (b.keypoints[shared[:, 1]], a.keypoints[shared[:, 0]]),
        similarity,
        min_samples=2,
        residual_threshold=_TOLERANCE * max(a.scale, b.scale),
        max_trials=500,
        rng=0,
    )
    if inliers is None or inliers.sum() < _LEAST_FEATURES or not np.isfinite(model.params).all():
        return None
    if abs(np.degrees(model.rotation)) > LARGEST_TURN or abs(model.scale - 1) > LARGEST_SCALE:
        return None
    matrix = np.asarray(model.params, float)
    sizes = a.size, b.size
    if not _agrees(a, b, shared, matrix, _shown(a, b, sizes, matrix), inliers):
        return None
    match = None
    for _ in range(2):  # patches laid about where they belong, and then exactly
        match = find_patches(a, b, PlaneTransform(matrix))
        if match is None:
            return None
        if len(match.first) >= 2:
            better = similarity.from_estimate(match.second, match.first)
            if not better:
                return None
            matrix = np.asarray(better.params, float)
    return match


def _shown(a: FeatureSet, b: FeatureSet, sizes: tuple[_Size, _Size], matrix: Floats) -> _Shown:
    """Return the features of each picture in the overlap, and all of `b`, px of `a`, to which a matrix takes
    points of `b`.
    """
    there, back = applied(matrix, b.keypoints), np.asarray(np.linalg.inv(matrix), float)
    return a.keypoints[within(applied(back, a.keypoints), sizes[1])], there[within(there, sizes[0])], there


def _agrees(
    a: FeatureSet,
    b: FeatureSet,
    shared: Indices,
    matrix: Floats,
    shown: _Shown,
    inliers: Mask,
) -> bool:
    """Test whether two pictures agree all over their overlap, not only where features brought them together.

    Unrelated pictures share a frame, a menu with its tool bar, a logo or a caption. These lie at the same
    place in both, while pictures of one scene that a camera took one after another are moved. In most cells
    of the overlap that show features pictures of one scene have some match that lies about where the others
    put it, even where several planes do not fit one homography; and, if they lie at the same place, in the
    middle of the overlap, too, which is the middle of a strip that was cut from a picture's side.

    Parameters
    ----------
    a, b : FeatureSet
    shared : (M, 2) int array
        Numbers of the features that match.
    matrix : (3, 3) float array
        Takes points of `b` to where they are in `a`, px.
    shown : three (K, 2) float arrays
        Features of each in the overlap, and where all of `b` lie (:func:`_shown`).
    inliers : (M,) bool array
        The matches that agree.
    """
    first, second = a.keypoints[shared[:, 0]], b.keypoints[shared[:, 1]]
    apart = np.linalg.norm(shown[2][shared[:, 1]] - first, axis=1)
    near = apart < 4 * ELSEWHERE * np.hypot(*a.size)
    fixed = np.mean(_at_one_place(first[inliers], second[inliers], (a.size, b.size))) > 0.5
    agreeing, busy = _agreement(shown[:2], first[near], a.size)
    least_fixed, least = _LEAST_AGREEING
    if not fixed:
        return agreeing >= least * busy
    reached = reach(PlaneTransform(matrix), b.size)
    if reached is None or agreeing < least_fixed * busy:
        return False
    low, high = np.clip(reached, (0, 0), a.size)
    middle = [
        points[(np.abs(points - (low + high) / 2) <= (high - low) / 4).all(axis=1)]
        for points in (*shown[:2], first[near])
    ]
    agreeing, busy = _agreement(middle[:2], middle[2], a.size)
    return agreeing > least * busy if busy else _alike(a, b, PlaneTransform(matrix), (low, high))


def _alike(a: FeatureSet, b: FeatureSet, transform: Transform, overlap: tuple[Floats, Floats]) -> bool:
    """Test whether two pictures show the same in the middle of their overlap where no feature is found, as in
    a sky: of one photograph the very grain is the same, while plain grounds within a frame only look alike.
    """
    from skimage.registration import phase_cross_correlation

    low, high = (corner / a.detail_scale for corner in overlap)
    left, top = np.ceil(low + (high - low) / 4).astype(int)
    right, bottom = np.floor(high - (high - low) / 4).astype(int)
    if min(right - left, bottom - top) < _LEAST_PATCH_SIDE:
        return False
    grid = np.stack(np.meshgrid(np.arange(left, right), np.arange(top, bottom)), axis=-1).astype(float)
    reduced = ReducedTransform(transform, a.detail_scale, b.detail_scale)
    x, y = np.moveaxis(reduced.to_picture(grid), 2, 0)
    one = a.detail[top:bottom, left:right]
    other = scipy.ndimage.map_coordinates(b.detail, [y, x], order=1)
    if one.shape != other.shape or not (one.std() > 0 and other.std() > 0):
        return False
    register: Any = phase_cross_correlation  # carries no types
    shift = register(one, other, upsample_factor=20, normalization=None)[0]
    if np.abs(shift).max() > _TOLERANCE:
        return False
    moved = scipy.ndimage.shift(other, shift, order=1)
    return bool(
        np.corrcoef(one[4:-4, 4:-4].ravel(), moved[4:-4, 4:-4].ravel())[0, 1] > _LEAST_PATCH_CORRELATION
    )


def _agreement(shown: Sequence[Floats], agreeing: Floats, size: _Size) -> tuple[int, int]:
    """Count the cells in which one of two pictures shows enough features: those with a match that agrees, and
    all.
    """
    busy = np.max([_counted(points, size) for points in shown], axis=0) >= _LEAST_FEATURES
    return int((busy & (_counted(agreeing, size) > 0)).sum()), int(busy.sum())


def at_one_place(a: FeatureSet, b: FeatureSet, shared: Indices) -> Mask:
    """Test which of the features that two pictures share lie at the same place in both: (M,)."""
    return _at_one_place(a.keypoints[shared[:, 0]], b.keypoints[shared[:, 1]], (a.size, b.size))


def _at_one_place(first: Floats, second: Floats, sizes: tuple[_Size, _Size]) -> Mask:
    """Test which points lie at the same place in two pictures, (M,): counted from the corner or middle from
    which most do, or as a share of the sizes.
    """
    a, b = (np.array(size, float) for size in sizes)
    moves = [first - second - np.array(anchor) * (a - b) for anchor in product((0, 0.5, 1), repeat=2)]
    moves.append(first - second * (a / b))
    largest = ELSEWHERE * np.hypot(*a)
    return max((np.linalg.norm(move, axis=1) <= largest for move in moves), key=lambda one: one.sum())


def _counted(points: Floats, size: _Size) -> Indices:
    """Count (M, 2) points by cells of a picture of that width and height."""
    cells = np.clip((points / np.array(size) * GRID).astype(np.intp), 0, GRID - 1)
    return np.bincount(cells @ [GRID, 1], minlength=GRID**2)


def _moved_alike(a: FeatureSet, b: FeatureSet, shared: Indices) -> bool:
    """Test whether enough features moved alike, as far as the largest turn and scale allow."""
    moves = a.keypoints[shared[:, 0]] - b.keypoints[shared[:, 1]]
    farthest = (math.radians(LARGEST_TURN) + LARGEST_SCALE) * math.hypot(*b.detail.shape)
    farthest = 1.1 * farthest + 8.0 * max(a.scale, b.scale)
    alike = (np.abs(moves[:, np.newaxis] - moves[np.newaxis]) <= farthest).all(axis=2)
    return bool(alike.sum(axis=1).max() >= _LEAST_FEATURES)


def find_patches(a: FeatureSet, b: FeatureSet, transform: Transform, count: int = 6) -> Match | None:
    """Lay patches of the overlap exactly on each other, by phase correlation.

    Parameters
    ----------
    a, b : FeatureSet
    transform : Transform
        Takes points of `b` to about where they are in `a`, px.
    count : int
        Rows and columns of patches over the overlap.

    Returns
    -------
    Match or None
        Centres of the patches, none where fewer than two count, and the correlation of all. None where the
        overlap is too small or shows nothing.
    """
    height, width = b.detail.shape
    transform = ReducedTransform(transform, a.detail_scale, b.detail_scale)
    reached = reach(transform, (width, height))
    if reached is None:
        return None
    low = np.maximum(reached[0], 0)
    high = np.minimum(reached[1], np.array(a.detail.shape[::-1]) - 1.0)
    size = int(min(_PATCH_SIDE, *(0.7 * (high - low))))
    if size < _LEAST_PATCH_SIDE:
        return None
    tops, lefts = (np.linspace(low[k], high[k] - size + 1, count).astype(int) for k in (1, 0))
    corners = np.array(
        [(x, y) for y in tops for x in lefts if a.known[y : y + size, x : x + size].all()]
    ).reshape(-1, 2)
    # (K, size, size, 2) x and y in `b` of all patches at once.
    grid = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1)
    coordinates = transform.to_picture((corners[:, np.newaxis, np.newaxis] + grid).astype(float))
    inside = ((coordinates >= 0) & (coordinates <= np.array([width, height]) - 1)).all(axis=(1, 2, 3))
    corners, coordinates = corners[inside], coordinates[inside]
    nearest = np.rint(coordinates).astype(int)
    known = b.known[nearest[..., 1], nearest[..., 0]].all(axis=(1, 2))
    corners, coordinates = corners[known], coordinates[known]
    ones = np.array([a.detail[top : top + size, left : left + size] for left, top in corners])
    ones = ones.reshape(-1, size, size)
    others = scipy.ndimage.map_coordinates(b.detail, np.moveaxis(coordinates, 3, 0)[::-1], order=1)
    moves = _moves(ones, others)
    moves[~((ones.std(axis=(1, 2)) > 0) & (others.std(axis=(1, 2)) > 0))] = 0
    cornered = _are_cornered(ones)
    centres, shifts, energy = [], [], np.zeros(3)
    for corner, one, other, shift, good in zip(corners, ones, others, moves, cornered, strict=True):
        moved = scipy.ndimage.shift(other, shift, order=1)
        first, second = one[4:-4, 4:-4], moved[4:-4, 4:-4]
        products = np.array([(first * second).sum(), (first**2).sum(), (second**2).sum()], np.float64)
        energy += products
        correlation = float(products[0] / np.sqrt(max(products[1] * products[2], 1e-12)))
        if correlation > _LEAST_PATCH_CORRELATION and good and np.abs(shift).max() <= size / 4:
            centres.append(corner + (size - 1) / 2)
            shifts.append(shift[::-1])
    if energy[1] * energy[2] <= 0:
        return None
    correlation = float(energy[0] / np.sqrt(energy[1] * energy[2]))
    if len(centres) < 2:
        return Match(np.zeros((0, 2)), np.zeros((0, 2)), min(correlation, 0.0))
    points = np.array(centres)
    return Match(
        enlarged(points, a.detail_scale),
        enlarged(transform.to_picture(points - np.array(shifts)), b.detail_scale),
        correlation,
    )


def _moves(ones: Floats32, others: Floats32, finer: int = 20) -> Floats32:
    """Find by how much each of (K, s, s) patches has to be moved to lie on another one: (K, 2), y and x, px.

    This is scikit-image's ``phase_cross_correlation`` without normalization, of all patches at once: the peak
    of the correlation, and then the one of a transform `finer` times as fine round it (Guizar-Sicairos,
    Thurman and Fienup 2008, doi:10.1364/OL.33.000156).
    """
    size = ones.shape[1]
    if not len(ones):
        return np.zeros((0, 2), np.float32)
    product = scipy.fft.fft2(ones) * scipy.fft.fft2(others).conj()
    peak = np.abs(scipy.fft.ifft2(product)).reshape(len(ones), -1).argmax(axis=1)
    moves = np.stack(np.unravel_index(peak, (size, size)), axis=1).astype(np.float32)
    moves[moves > size // 2] -= size
    side = int(np.ceil(1.5 * finer))
    steps = ((np.arange(side) - side // 2) / finer).astype(np.float32)
    # (K, 2, side, size): down and across
    turns = (moves[..., np.newaxis] + steps.astype(float))[..., np.newaxis] * scipy.fft.fftfreq(size)
    waves = np.exp(2j * np.pi * turns).astype(product.dtype)
    fine = np.abs(waves[:, 0] @ product @ waves[:, 1].swapaxes(1, 2)).reshape(len(ones), -1).argmax(axis=1)
    return np.asarray(moves + steps[np.stack(np.unravel_index(fine, (side, side)), axis=1)])


def _are_cornered(patches: Floats32) -> Mask:
    """Test which of (K, s, s) patches differ from themselves moved in any direction: with straight edges they
    do not.
    """
    down, right = np.gradient(blurred(patches, 1.5)[0], axis=(1, 2))
    sums = [np.sum(one * other, axis=(1, 2)) for one, other in ((down, down), (down, right), (right, right))]
    least, most = np.linalg.eigvalsh(np.stack([*sums[:2], *sums[1:]], axis=1).reshape(-1, 2, 2)).T
    return np.asarray(least > _LEAST_CORNER * most)


def quarter_turns(
    features: Sequence[FeatureSet], pairs: Sequence[Pair], shared: Callable[[Pair], Indices]
) -> list[int]:
    """Find by how many quarter turns, counterclockwise, each picture has to be turned to lie upright.

    The features that two pictures share say by how many one lies turned against the other. Along the
    strongest pairs this says how each picture of a group lies, and most of them lie upright. Where as many
    lie otherwise, as of two pictures, those do that people have panned sideways, and then the light decides,
    which comes from above.

    Parameters
    ----------
    features : sequence of FeatureSet
    pairs : sequence of (int, int)
        Those that share most features first.
    shared : callable
        Returns the (M, 2) numbers of the features that a pair shares.
    """
    group, turns = list(range(len(features))), [0] * len(features)
    joined: list[tuple[int, int, int]] = []  # pairs, and the turn of the second against the first
    for i, j in pairs:
        if len(shared((i, j))) < LEAST_INLIERS:
            break
        if group[i] == group[j]:
            continue
        turn = _turn_between(features[i], features[j], shared((i, j)))
        if turn is None:
            continue
        joined.append((i, j, turn))
        # The whole group of j turns with it.
        extra, old = turns[i] + turn - turns[j], group[j]
        for k in (k for k, own in enumerate(group) if own == old):
            group[k], turns[k] = group[i], (turns[k] + extra) % 4
    result = [0] * len(features)
    for own in set(group):
        members = [k for k in range(len(features)) if group[k] == own]
        counts = np.bincount([turns[k] for k in members], minlength=4)
        upright = np.flatnonzero(counts == counts.max()).tolist()
        if len(upright) > 1:
            light = sum(features[k].light * _turned(turns[k]) for k in members)
            moves = [
                _move_between(features[i], features[j], shared((i, j)), turn) * _turned(turns[i])
                for i, j, turn in joined
                if i in members
            ]
            upright.sort(key=partial(_looks_upright, light, np.array(moves)), reverse=True)
        for k in members:
            result[k] = (turns[k] - upright[0]) % 4
    return result


def _turned(quarters: int) -> complex:
    """Return the factor that turns x + iy, with y down, by quarter turns counterclockwise."""
    return complex((-1j) ** quarters)


def _turn_between(a: FeatureSet, b: FeatureSet, shared: Indices) -> int | None:
    """Find by how many quarter turns, counterclockwise, `b` has to be turned to lie as `a`; None where that
    is not clear.
    """
    first, second = (one.keypoints[numbers] @ [1, 1j] for one, numbers in zip((a, b), shared.T, strict=True))
    i, j = np.triu_indices(len(shared), 1)
    apart = np.angle((first[i] - first[j]) * np.conj(second[i] - second[j]))
    # Angles grow clockwise, as y goes down.
    votes = np.bincount(-np.rint(apart / (np.pi / 2)).astype(int) % 4, minlength=4)
    turn = int(votes.argmax())
    return turn if turn == 0 or match_homography(a, b, shared) is not None else None


def _move_between(a: FeatureSet, b: FeatureSet, shared: Indices, turn: int) -> complex:
    """Find how far the middle of `b`, turned by quarter turns, lies from that of `a`, of the diagonal."""
    first, second = (
        one.keypoints[numbers] @ [1, 1j] - np.array(one.size) @ [0.5, 0.5j]
        for one, numbers in zip((a, b), shared.T, strict=True)
    )
    moves = first - second * _turned(turn)
    return complex(np.median(moves.real), np.median(moves.imag)) / math.hypot(*a.size)


def _looks_upright(light: complex, moves: Complexes, turned: int) -> tuple[bool, float]:
    """Rate how much pictures look upright where they lie turned by so many quarter turns: whether the camera
    was panned sideways, and how much lighter it is above.
    """
    upright = _turned(-turned)
    sideways = ((moves * upright) ** 2).real > 0.5 * (np.abs(moves) ** 2 + ELSEWHERE**2)
    return bool(np.mean(sideways) > 0.5), -(light * upright).imag
