"""Pairs of pictures that show the same: the features they share, and patches of their overlap laid exactly on
each other.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Floats
from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import PlaneTransform
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.features import Look, look_at, shared_features
from toposeam.layers.registration.homography import applied, find_homography, within
from toposeam.layers.registration.patches import find_patches

#: Farthest that pictures may be turned against each other, degrees, and scaled, as a share.
LARGEST_TURN, LARGEST_SCALE = 3.5, 0.035
_LEAST_MATCHES = 5
#: Features that a homography brings nearer than so many px of the reduced pictures agree to it; one standard
#: deviation of those.
_TOLERANCE, _FEATURES = 2.0, 0.5
#: Two pictures that so many forests of pairs already join, no pair in two of them, are not tried: the pairs
#: of 12 pictures that all show the same are tried, and of more pictures up to so many for each.
_FORESTS = 6
#: So many pairs are tried at once.
_AT_ONCE = 64

Kind: TypeAlias = Literal["similarity", "homography"]


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Points of one picture and the same ones of another."""

    first: Floats
    second: Floats
    #: Of the overlap; NaN where patches were not compared.
    correlation: float
    #: Points of the second picture lie at these of the first, about: (3, 3).
    matrix: Floats = field(default_factory=lambda: np.eye(3))
    #: Features that agree, and one standard deviation of each point or of all, px.
    features: int = 0
    #: These as a share of all that either picture shows in the overlap.
    share: float = 1.0
    uncertainty: float | Floats = 1.0


def groups(count: int, pairs: Iterable[Pair]) -> npt.NDArray[np.intp]:
    """(N,) which group each of so many pictures is in, joined by pairs."""
    i, j = np.array(list(pairs), np.intp).reshape(-1, 2).T
    joined = csr_array((np.ones(len(i)), (i, j)), shape=(count, count))
    return np.asarray(connected_components(joined, directed=False)[1], np.intp)


def _digest(picture: Layer) -> bytes:
    """Of what is compared of a picture: equal pictures are looked at once."""
    hashed = hashlib.sha256(repr((picture.image.shape, picture.image.dtype, picture.data_range)).encode())
    hashed.update(np.ascontiguousarray(picture.image).data)
    hashed.update(np.packbits(picture.covered).data)
    return hashed.digest()


class Sightings:
    """What pictures show and which features pairs of them share.

    Which features two pictures share is cheap to tell and asked of all pairs. Equal pictures are looked at
    once.

    Parameters
    ----------
    pictures : sequence of Layer
    report : callable
        Called with the share of the work done, up to 0.5, and up to 0.9 by :meth:`matches`.
    executor : Executor, optional
        Where pictures and pairs are looked at.
    marked : mapping from pairs to Match, optional
        Pairs of which somebody gave the points.
    """

    def __init__(
        self,
        pictures: Sequence[Layer],
        report: Callable[[float], None],
        executor: Executor | None = None,
        marked: Mapping[Pair, Match] | None = None,
    ) -> None:
        self._which = list(results(executor, _digest, pictures))
        self._report, self._executor = report, executor
        first = {digest: index for index, digest in reversed(list(enumerate(self._which)))}
        different = sorted(set(self._which), key=lambda digest: first[digest])
        self._seen: dict[bytes, Look] = {}
        self._known: dict[Kind, dict[tuple[bytes, bytes], Match | None]] = {
            "similarity": {},
            "homography": {},
        }
        for look in results(executor, look_at, [pictures[first[digest]] for digest in different]):
            self._seen[different[len(self._seen)]] = look
            report(0.3 * len(self._seen) / len(different))
        self.looks = [self._seen[digest] for digest in self._which]
        pairs = list(combinations(range(len(self.looks)), 2))
        which = self._which
        self._shared = _shared(self._seen, ((which[i], which[j]) for i, j in pairs), report, executor)
        marked = marked or {}
        for (i, j), match in marked.items():
            for known in self._known.values():
                known[which[i], which[j]] = match
        #: All pairs, those first that somebody marked, then those that share most.
        self.pairs = sorted(pairs, key=lambda pair: (pair not in marked, -len(self.shared(pair))))

    def shared(self, pair: Pair) -> npt.NDArray[np.intp]:
        """(M, 2) numbers of the features that a pair shares."""
        return self._shared[self._which[pair[0]], self._which[pair[1]]]

    def homographies(self, pairs: Sequence[Pair]) -> list[Match | None]:
        """Features of each pair that a homography brings together; None where too few agree."""
        keys = [(self._which[i], self._which[j]) for i, j in pairs]
        known = self._known["homography"]
        self._try("homography", dict.fromkeys(key for key in keys if key not in known))
        return [known[key] for key in keys]

    def _try(self, kind: Kind, keys: Iterable[tuple[bytes, bytes]]) -> None:
        """Match pairs of different pictures that are not matched yet."""
        keys = list(keys)
        items = [(kind, self._seen[one], self._seen[other], self._shared[one, other]) for one, other in keys]
        self._known[kind].update(zip(keys, results(self._executor, _matched, items), strict=True))

    def matches(self, kind: Kind, least: float) -> tuple[dict[Pair, Match], Floats]:
        """The pairs that show the same, and the best correlation of each picture.

        Those that share most are tried first, and the rest only where they join what few others do.

        Parameters
        ----------
        kind : {"similarity", "homography"}
            What is to take one picture to the other.
        least : float
            Correlation of pictures that show the same, where it is a similarity.
        """
        which, known = self._which, self._known[kind]
        matches: dict[Pair, Match] = {}
        best = np.full(len(which), -1.0)
        trees = np.tile(np.arange(len(which)), (_FORESTS, 1))  # which tree each picture is in, per forest
        for number, (i, j) in enumerate(self.pairs):
            key, apart = (which[i], which[j]), np.flatnonzero(trees[:, i] != trees[:, j])
            if len(apart):
                if key not in known:
                    # Elsewhere also the next ones that are tried unless what is found till then joins them.
                    following: dict[tuple[bytes, bytes], None] = {}
                    for k, n in self.pairs[number:] if self._executor is not None else [(i, j)]:
                        if (trees[:, k] != trees[:, n]).any() and (which[k], which[n]) not in known:
                            following[which[k], which[n]] = None
                        if len(following) >= _AT_ONCE:
                            break
                    self._try(kind, following)
                match = known[key]
                if match is not None:
                    best[[i, j]] = np.fmax(best[[i, j]], match.correlation)
                    if not match.correlation < least or kind == "homography":
                        matches[i, j] = match
                        tree = trees[apart[0]]
                        tree[tree == tree[j]] = tree[i]
            self._report(0.5 + 0.4 * (number + 1) / len(self.pairs))
        return dict(sorted(matches.items())), best


def _shared(
    seen: dict[bytes, Look],
    pairs: Iterable[tuple[bytes, bytes]],
    report: Callable[[float], None],
    executor: Executor | None,
) -> dict[tuple[bytes, bytes], npt.NDArray[np.intp]]:
    """The features that pairs of pictures share; all pairs that a picture is the first of go together."""
    nothing = np.zeros((0, 0), np.float32)
    bare = {digest: replace(look, detail=nothing, known=nothing > 0) for digest, look in seen.items()}
    seconds: dict[bytes, list[bytes]] = {}
    for one, other in dict.fromkeys(pairs):
        seconds.setdefault(one, []).append(other)
    count = sum(map(len, seconds.values()))
    shared: dict[tuple[bytes, bytes], npt.NDArray[np.intp]] = {}
    items = ((bare[one], [bare[other] for other in others]) for one, others in seconds.items())
    for one, found in zip(seconds, results(executor, _shared_with, items), strict=True):
        for other, numbers in zip(seconds[one], found, strict=True):
            shared[one, other] = numbers
            report(0.3 + 0.2 * len(shared) / count)
    return shared


@one_thread()
def _shared_with(item: tuple[Look, Sequence[Look]]) -> list[npt.NDArray[np.intp]]:
    one, others = item
    return [shared_features(one, other) for other in others]


@one_thread()
def _matched(item: tuple[Kind, Look, Look, npt.NDArray[np.intp]]) -> Match | None:
    kind, a, b, found = item
    return _match(a, b, found) if kind == "similarity" else match_homography(a, b, found)


def match_homography(a: Look, b: Look, found: npt.NDArray[np.intp]) -> Match | None:
    """Features that both show and a homography brings together; None where too few agree."""
    first, second = a.keypoints[found[:, 0]], b.keypoints[found[:, 1]]
    sizes = (a.size, b.size)
    scale = float(max(a.scale, b.scale))
    homography = find_homography(first, second, sizes, _TOLERANCE * scale)
    if homography is None or not homography.verified:
        return None
    inliers, back = homography.inliers, np.asarray(np.linalg.inv(homography.matrix), float)
    common = min(
        int(within(applied(back, a.keypoints), b.size).sum()),
        int(within(applied(homography.matrix, b.keypoints), a.size).sum()),
    )
    return Match(
        first[inliers],
        second[inliers],
        math.nan,
        matrix=homography.matrix,
        features=int(inliers.sum()),
        share=float(inliers.sum()) / max(common, 1),
        uncertainty=_FEATURES * scale,
    )


def _match(a: Look, b: Look, found: npt.NDArray[np.intp]) -> Match | None:
    """Points that both show, of (N, 2) numbers of shared features; None where they show nothing in common."""
    from skimage import measure, transform

    ransac: Any = measure.ransac  # carry no types
    kind: Any = transform.SimilarityTransform
    if len(found) < _LEAST_MATCHES or not _agree(a, b, found):
        return None
    first, second = a.keypoints[found[:, 0]], b.keypoints[found[:, 1]]
    model, inliers = ransac(
        (second, first),
        kind,
        min_samples=2,
        residual_threshold=2.0 * max(a.scale, b.scale),
        max_trials=500,
        rng=0,
    )
    if inliers is None or inliers.sum() < _LEAST_MATCHES or not np.isfinite(model.params).all():
        return None
    if abs(np.degrees(model.rotation)) > LARGEST_TURN or abs(model.scale - 1) > LARGEST_SCALE:
        return None
    matrix = np.asarray(model.params, float)
    match = None
    for _ in range(2):  # from about where they belong to exactly
        patches = find_patches(a, b, PlaneTransform(matrix))
        if patches is None:
            return None
        match = Match(patches.first, patches.second, patches.correlation)
        if len(match.first) >= 2:
            better = kind.from_estimate(match.second, match.first)
            if not better:
                return None
            matrix = np.asarray(better.params, float)
    return match


def _agree(a: Look, b: Look, found: npt.NDArray[np.intp]) -> bool:
    """Whether enough features moved by about as much: no more apart than turn and scale may take them."""
    moved = a.keypoints[found[:, 0]] - b.keypoints[found[:, 1]]
    reach = (math.radians(LARGEST_TURN) + LARGEST_SCALE) * math.hypot(*b.detail.shape)
    reach = 1.1 * reach + 8.0 * max(a.scale, b.scale)
    near = (np.abs(moved[:, np.newaxis] - moved[np.newaxis]) <= reach).all(axis=2)
    return bool(near.sum(axis=1).max() >= _LEAST_MATCHES)
