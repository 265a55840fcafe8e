"""Pairs of pictures that show the same: the features they share, and patches of their overlap laid exactly on
each other.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.features import Look, cornered, look_at, shared_features

#: Farthest that pictures may be turned against each other, degrees, and scaled, as a share.
LARGEST_TURN, LARGEST_SCALE = 3.5, 0.035
_LEAST_MATCHES, _LEAST_PATCHES = 5, 2
_PATCH, _PATCHES = 64, 6  # px a side; in rows and columns of so many over the overlap
_UPSAMPLING = 20
_LEAST_OWN = 0.6  # correlation of a patch that counts
#: Two pictures that so many forests of pairs already join, no pair in two of them, are not tried: the pairs
#: of 12 pictures that all show the same are tried, and of more pictures up to so many for each.
_FORESTS = 6
#: So many pairs are tried at once.
_AT_ONCE = 64

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Points of one picture and the same ones of another."""

    first: Floats
    second: Floats
    correlation: float
    #: Points of the second picture lie at these of the first, about: (3, 3).
    matrix: Floats = field(default_factory=lambda: np.eye(3))
    #: Features that agree, and one standard deviation of a point, px.
    features: int = 0
    uncertainty: float = 1.0


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


def find_matches(
    pictures: Sequence[Layer],
    least: float,
    report: Callable[[float], None],
    executor: Executor | None = None,
) -> tuple[dict[Pair, Match], Floats]:
    """The pairs that show the same, and the best correlation of each picture.

    Which features two pictures share is cheap to tell and asked of all pairs. Those that share most are tried
    first, and the rest only where they join what few others do. Equal pictures are looked at once.

    Parameters
    ----------
    pictures : sequence of Layer
    least : float
        Correlation of pictures that show the same.
    report : callable
        Called with the share of the work done, up to 0.9.
    executor : Executor, optional
        Where pictures and pairs are looked at.
    """
    which = list(results(executor, _digest, pictures))
    first = {digest: index for index, digest in reversed(list(enumerate(which)))}
    different = sorted(set(which), key=lambda digest: first[digest])
    seen: dict[bytes, Look] = {}
    for look in results(executor, look_at, [pictures[first[digest]] for digest in different]):
        seen[different[len(seen)]] = look
        report(0.3 * len(seen) / len(different))
    looks = [seen[digest] for digest in which]
    pairs = list(combinations(range(len(looks)), 2))
    shared = _shared(seen, ((which[i], which[j]) for i, j in pairs), report, executor)
    pairs.sort(key=lambda pair: -len(shared[which[pair[0]], which[pair[1]]]))
    known: dict[tuple[bytes, bytes], Match | None] = {}
    matches: dict[Pair, Match] = {}
    best = np.full(len(looks), -1.0)
    trees = np.tile(np.arange(len(looks)), (_FORESTS, 1))  # which tree each picture is in, per forest
    for number, (i, j) in enumerate(pairs):
        key, apart = (which[i], which[j]), np.flatnonzero(trees[:, i] != trees[:, j])
        if len(apart):
            if key not in known:
                # Elsewhere also the next ones that are tried unless what is found till then joins them.
                following: dict[tuple[bytes, bytes], None] = {}
                for k, n in pairs[number:] if executor is not None else [(i, j)]:
                    if (trees[:, k] != trees[:, n]).any() and (which[k], which[n]) not in known:
                        following[which[k], which[n]] = None
                    if len(following) >= _AT_ONCE:
                        break
                items = [(seen[one], seen[other], shared[one, other]) for one, other in following]
                known.update(zip(following, results(executor, _matched, items), strict=True))
            match = known[key]
            if match is not None:
                best[[i, j]] = np.maximum(best[[i, j]], match.correlation)
                if match.correlation >= least:
                    matches[i, j] = match
                    tree = trees[apart[0]]
                    tree[tree == tree[j]] = tree[i]
        report(0.5 + 0.4 * (number + 1) / len(pairs))
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
def _matched(item: tuple[Look, Look, npt.NDArray[np.intp]]) -> Match | None:
    return _match(*item)


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
        match = _patches(a, b, matrix)
        if match is None:
            return None
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


def _patches(a: Look, b: Look, matrix: Floats) -> Match | None:
    """Patches of the overlap laid exactly on each other, `matrix` taking points of `b` to about where they
    are in `a`.
    """
    from skimage.registration import phase_cross_correlation

    height, width = b.detail.shape
    corners = (
        np.array([[0, 0, 1], [width - 1, 0, 1], [0, height - 1, 1], [width - 1, height - 1, 1]]) @ matrix.T
    )
    low = np.maximum(corners[:, :2].min(axis=0), 0)
    high = np.minimum(corners[:, :2].max(axis=0), np.array(a.detail.shape[::-1]) - 1.0)
    size = int(min(_PATCH, *(0.7 * (high - low))))
    if size < 16:
        return None
    inverse = np.linalg.inv(matrix)
    points_a, points_b, energy = [], [], np.zeros(3)
    register: Any = phase_cross_correlation  # carries no types
    tops, lefts = (np.linspace(low[k], high[k] - size + 1, _PATCHES).astype(int) for k in (1, 0))
    for top in tops:
        for left in lefts:
            y, x = np.mgrid[top : top + size, left : left + size]
            where = inverse[:2, :2] @ np.stack([x.ravel(), y.ravel()]) + inverse[:2, 2:]
            inside = (where >= 0).all() and where[0].max() <= width - 1 and where[1].max() <= height - 1
            if not inside or not a.known[top : top + size, left : left + size].all():
                continue
            one = a.detail[top : top + size, left : left + size]
            if not b.known[np.rint(where[1]).astype(int), np.rint(where[0]).astype(int)].all():
                continue
            other = scipy.ndimage.map_coordinates(b.detail, where[::-1], order=1).reshape(one.shape)
            shift = np.zeros(2)
            if one.std() > 0 and other.std() > 0:
                shift = register(one, other, upsample_factor=_UPSAMPLING, normalization=None)[0]
            moved = scipy.ndimage.shift(other, shift, order=1)
            first, second = one[4:-4, 4:-4], moved[4:-4, 4:-4]
            products = np.array([(first * second).sum(), (first**2).sum(), (second**2).sum()], np.float64)
            energy += products
            own = float(products[0] / np.sqrt(max(products[1] * products[2], 1e-12)))
            if own > _LEAST_OWN and cornered(one) and np.abs(shift).max() <= size / 4:
                centre = np.array([left + (size - 1) / 2, top + (size - 1) / 2])
                points_a.append(centre)
                points_b.append(inverse[:2, :2] @ (centre - shift[::-1]) + inverse[:2, 2])
    if energy[1] * energy[2] <= 0:
        return None
    correlation = float(energy[0] / np.sqrt(energy[1] * energy[2]))
    if len(points_a) < _LEAST_PATCHES:
        return Match(np.zeros((0, 2)), np.zeros((0, 2)), min(correlation, 0.0))
    return Match(np.array(points_a), np.array(points_b), correlation)
