"""Places of pictures of which nobody says where they belong.

1. Each picture, reduced, is described by its SIFT features (Lowe 2004,
   doi:10.1023/B:VISI.0000029664.99615.94; scikit-image's). For two pictures those that match give a
   similarity by RANSAC, and the overlap then has to correlate. Where many show the same, the pairs that share
   most are enough.
2. At full size, patches spread over each overlap are laid exactly by phase correlation to a twentieth of a
   pixel.
3. All patches of all pairs together give each picture's place, turn and scale by linear least squares: with
   T(x, y) = (a x - b y + u, b x + a y + v) per picture, T_i(p) = T_j(q) for every patch found at p in picture
   i and at q in picture j; the first picture's is the identity. So a loop of pictures closes. Where no
   picture is turned or scaled, only u and v are sought, and pictures are placed by whole pixels.

Turned or scaled pictures are resampled, once, by cubic splines. What a similarity does not bring together -
perspective, lenses - is refused; it is the business of Hugin, whose results ``toposeam enblend`` joins.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.checks import check_items, check_range
from toposeam.errors import OptionError, OverlapError
from toposeam.layers.features import Look, cornered, look_at, shared_features
from toposeam.layers.labelling import Pair
from toposeam.layers.layer import Layer
from toposeam.layers.turning import placed

#: Least correlation of two overlaps that are taken to show the same.
LEAST_CORRELATION = 0.5
#: Farthest that pictures may be turned against each other, degrees, and scaled, as a share.
LARGEST_TURN, LARGEST_SCALE = 3.5, 0.035
#: Below this, px at the farthest corner, nothing counts as turned or scaled.
_NOT_TURNED = 0.35
#: Patches that do not lie within so many px of where the others say do not count; a pair whose patches are
#: farther off than this does not fit.
_OUTLIER, LARGEST_MISFIT = 1.0, 1.0
#: A picture of which more than so many px are open, one standard deviation at its corners, is refused.
LARGEST_DOUBT = 0.5
#: What pictures may do, the simplest first.
_FREEDOMS = ("shift", "turn", "similarity")

_LEAST_MATCHES, _LEAST_PATCHES = 5, 2
_PATCH, _PATCHES = 64, 6  # px a side; in rows and columns of so many over the overlap
_UPSAMPLING = 20
_LEAST_OWN = 0.6  # correlation of a patch that counts
#: Two pictures that so many forests of pairs already join, no pair in two of them, are not tried: the pairs
#: of 12 pictures that all show the same are tried, and of more pictures up to so many for each.
_FORESTS = 6

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Placement:
    """Where pictures belong.

    Examples
    --------
    >>> from skimage import data
    >>> whole = data.camera()[100:260, :300]
    >>> found = find_places([Layer(whole[:, :180], name="left"), Layer(whole[:, 120:], name="right")])
    >>> found.places.shape, found.misfit < 1
    ((2, 2), True)
    """

    #: Placed, and resampled where they are turned or scaled.
    layers: tuple[Layer, ...]
    #: (N, 2) px, x and y of each picture's upper left corner before rounding; the first one's is (0, 0).
    places: Floats
    #: (N,) degrees, clockwise, and (N,) factors.
    turns: Floats
    scales: Floats
    #: Correlation of the overlap of each pair that was used.
    correlations: dict[Pair, float]
    #: Largest distance, px, between what one pair says and where its pictures were placed.
    misfit: float

    def __repr__(self) -> str:
        return (
            f"Placement({len(self.layers)} pictures, {len(self.correlations)} pairs, misfit "
            f"{self.misfit:.2f} px)"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Match:
    """Points of one picture and the same ones of another."""

    first: Floats
    second: Floats
    correlation: float


def find_places(
    pictures: Sequence[Layer],
    *,
    least_correlation: float = LEAST_CORRELATION,
    progress: Callable[[float], None] | None = None,
) -> Placement:
    """Find out which pictures belong together, and where.

    Parameters
    ----------
    pictures : sequence of Layer
        At least two; where they lie is ignored. They may be shifted in any way, turned by up to 3° and scaled
        by up to 3 %, in any order, and exposed differently.
    least_correlation : float in (0, 1]
        Of the overlap of two pictures that are taken to show the same.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Placement

    Raises
    ------
    OverlapError
        When a picture fits none of the others, or pairs contradict each other; the text names it.
    OptionError

    Examples
    --------
    >>> from skimage import data
    >>> whole = data.camera()[100:260, :300]
    >>> pictures = [Layer(whole[:, :180], name="left"), Layer(whole[:, 120:], name="right")]
    >>> [layer.at for layer in find_places(pictures).layers]
    [(0, 0), (120, 0)]
    """
    check_range(0, 1, above=True, least_correlation=least_correlation)
    pictures = check_items("pictures", pictures, Layer, "a sequence of Layers")
    if len(pictures) < 2:
        raise OptionError(f"{len(pictures)} picture was given; pass at least two")
    report: Callable[[float], None] = progress or (lambda _: None)
    looks: dict[bytes, Look] = {}
    which = []
    for index, picture in enumerate(pictures):
        digest = _digest(picture)
        if digest not in looks:
            looks[digest] = look_at(picture)
        which.append(digest)
        report(0.3 * (index + 1) / len(pictures))
    matches, best = _matches([looks[digest] for digest in which], which, least_correlation, report)
    _check_joined(pictures, matches, best, least_correlation)
    transforms, misfit = _solve(pictures, matches)
    turns = np.degrees(np.arctan2(transforms[:, 1], transforms[:, 0]))
    scales = np.hypot(transforms[:, 0], transforms[:, 1])
    layers = tuple(
        placed(picture, at=(float(u), float(v)), turn=float(turn), scale=float(scale))
        for picture, (u, v), turn, scale in zip(pictures, transforms[:, 2:], turns, scales, strict=True)
    )
    report(1.0)
    return Placement(
        layers=layers,
        places=transforms[:, 2:],
        turns=turns,
        scales=scales,
        correlations={pair: match.correlation for pair, match in matches.items()},
        misfit=misfit,
    )


def _digest(picture: Layer) -> bytes:
    """Of what is compared of a picture: equal pictures are looked at once."""
    hashed = hashlib.sha256(repr((picture.image.shape, picture.image.dtype, picture.data_range)).encode())
    hashed.update(np.ascontiguousarray(picture.image).data)
    hashed.update(np.packbits(picture.covered).data)
    return hashed.digest()


def _matches(
    looks: Sequence[Look], which: Sequence[bytes], least: float, report: Callable[[float], None]
) -> tuple[dict[Pair, _Match], Floats]:
    """The pairs that show the same, and the best correlation of each picture.

    Which features two pictures share is cheap to tell and asked of all pairs. Those that share most are tried
    first, and the rest only where they join what few others do. Equal pairs of pictures are tried once.
    """
    pairs = list(combinations(range(len(looks)), 2))
    shared: dict[tuple[bytes, bytes], npt.NDArray[np.intp]] = {}
    for number, (i, j) in enumerate(pairs):
        if (which[i], which[j]) not in shared:
            shared[which[i], which[j]] = shared_features(looks[i], looks[j])
        report(0.3 + 0.2 * (number + 1) / len(pairs))
    pairs.sort(key=lambda pair: -len(shared[which[pair[0]], which[pair[1]]]))
    known: dict[tuple[bytes, bytes], _Match | None] = {}
    matches: dict[Pair, _Match] = {}
    best = np.full(len(looks), -1.0)
    trees = np.tile(np.arange(len(looks)), (_FORESTS, 1))  # which tree each picture is in, per forest
    for number, (i, j) in enumerate(pairs):
        key, apart = (which[i], which[j]), np.flatnonzero(trees[:, i] != trees[:, j])
        if len(apart):
            if key not in known:
                known[key] = _match(looks[i], looks[j], shared[key])
            match = known[key]
            if match is not None:
                best[[i, j]] = np.maximum(best[[i, j]], match.correlation)
                if match.correlation >= least:
                    matches[i, j] = match
                    tree = trees[apart[0]]
                    tree[tree == tree[j]] = tree[i]
        report(0.5 + 0.4 * (number + 1) / len(pairs))
    return dict(sorted(matches.items())), best


def _match(a: Look, b: Look, found: npt.NDArray[np.intp]) -> _Match | None:
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


def _patches(a: Look, b: Look, matrix: Floats) -> _Match | None:
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
            other = ndimage.map_coordinates(b.detail, where[::-1], order=1).reshape(one.shape)
            shift = np.zeros(2)
            if one.std() > 0 and other.std() > 0:
                shift = register(one, other, upsample_factor=_UPSAMPLING, normalization=None)[0]
            moved = ndimage.shift(other, shift, order=1)
            inner = np.s_[4:-4, 4:-4]
            energy += [
                float((one * moved)[inner].sum()),
                float((one**2)[inner].sum()),
                float((moved**2)[inner].sum()),
            ]
            own = float((one * moved)[inner].sum()) / np.sqrt(
                max(float((one**2)[inner].sum() * (moved**2)[inner].sum()), 1e-12)
            )
            if own > _LEAST_OWN and cornered(one) and np.abs(shift).max() <= size / 4:
                centre = np.array([left + (size - 1) / 2, top + (size - 1) / 2])
                points_a.append(centre)
                points_b.append(inverse[:2, :2] @ (centre - shift[::-1]) + inverse[:2, 2])
    if energy[1] * energy[2] <= 0:
        return None
    correlation = float(energy[0] / np.sqrt(energy[1] * energy[2]))
    if len(points_a) < _LEAST_PATCHES:
        return _Match(np.zeros((0, 2)), np.zeros((0, 2)), min(correlation, 0.0))
    return _Match(np.array(points_a), np.array(points_b), correlation)


def _check_joined(pictures: Sequence[Layer], matches: dict[Pair, _Match], best: Floats, least: float) -> None:
    """Refuse pictures that are not joined to most of the others by pairs that agree."""
    group = list(range(len(pictures)))
    for i, j in matches:
        old, new = group[j], group[i]
        group = [new if k == old else k for k in group]
    sizes = [group.count(own) for own in group]
    if max(sizes) == len(pictures):
        return
    largest = group[int(np.argmax(sizes))]
    lost = [index for index, own in enumerate(group) if own != largest]
    index = lost[0]
    partners = [pictures[k].name for k in lost[1:] if group[k] == group[index]]
    if partners:
        raise OverlapError(
            f"{pictures[index].name} and {', '.join(partners)} show something else than the other pictures; "
            "join the two groups apart"
        )
    close = f"the best correlation is {best[index]:.2f}" if best[index] > -1 else "it has nothing in common"
    raise OverlapError(
        f"{pictures[index].name} fits none of the other pictures ({close}, {least:g} is needed); leave it "
        "out, or say where the pictures lie"
    )


def _solve(pictures: Sequence[Layer], matches: dict[Pair, _Match]) -> tuple[Floats, float]:
    """(N, 4) a, b, u, v of each picture, and the largest misfit in px: by shifts alone if that is enough,
    else also by turns, else also by scales.
    """
    found = []
    for freedom in _FREEDOMS:
        found.append(_least_squares(len(pictures), matches, freedom))
        if found[-1][1] <= _NOT_TURNED:
            break
    transforms, misfit, doubt = min(found, key=lambda one: one[1])
    for (i, j), match in matches.items():
        off = float(np.median(_residuals(transforms, i, j, match)))
        if off > LARGEST_MISFIT:
            raise OverlapError(
                f"{pictures[i].name} and {pictures[j].name} do not fit where the other pictures place them: "
                f"{off:.1f} px are left between them; a lens or perspective is not undone here: align them "
                "with Hugin (pto_gen, cpfind, autooptimiser, nona), and join its pictures with toposeam "
                "enblend"
            )
    reach = np.array([np.hypot(*picture.image.shape[:2]) for picture in pictures])
    unsure = np.hypot(doubt[:, :2].max(axis=1) * reach, doubt[:, 2:].max(axis=1))
    if unsure.max() > LARGEST_DOUBT:
        worst = int(np.argmax(unsure))
        raise OverlapError(
            f"{pictures[worst].name} cannot be placed exactly: what it shares with the others leaves "
            f"{unsure[worst]:.1f} px open; leave it out, or say where the pictures lie"
        )
    return transforms, misfit


def _residuals(transforms: Floats, i: int, j: int, match: _Match) -> Floats:
    distance = _applied(transforms[i], match.first) - _applied(transforms[j], match.second)
    return np.asarray(np.hypot(*distance.T))


def _applied(transform: Floats, points: Floats) -> Floats:
    a, b, u, v = transform
    return np.stack(
        [a * points[:, 0] - b * points[:, 1] + u, b * points[:, 0] + a * points[:, 1] + v], axis=1
    )


def _least_squares(count: int, matches: dict[Pair, _Match], freedom: str) -> tuple[Floats, float, Floats]:
    """All transforms at once, the largest misfit of a pair, and the standard deviations of a, b, u, v;
    patches that disagree with a solution are left out of the next.
    """
    free = {"shift": (2, 3), "turn": (1, 2, 3), "similarity": (0, 1, 2, 3)}[freedom]
    transforms = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    used = {pair: np.ones(len(match.first), bool) for pair, match in matches.items()}
    doubt = np.zeros((count, 4))
    for _ in range(4):
        blocks, values = [], []
        for (i, j), match in matches.items():
            keep = used[i, j]
            block, value = np.zeros((2 * int(keep.sum()), count, 4)), np.zeros(2 * int(keep.sum()))
            for sign, index, points in ((1, i, match.first[keep]), (-1, j, match.second[keep])):
                x, y = points.T
                terms = np.zeros((len(value), 4))
                terms[0::2] = np.stack([x, -y, np.ones_like(x), np.zeros_like(x)], axis=1)
                terms[1::2] = np.stack([y, x, np.zeros_like(x), np.ones_like(x)], axis=1)
                fixed = [k for k in range(4) if index == 0 or k not in free]
                value -= sign * terms[:, fixed] @ transforms[index, fixed]
                terms[:, fixed] = 0
                block[:, index] += sign * terms
            blocks.append(block.reshape(len(value), -1))
            values.append(value)
        matrix, right = np.concatenate(blocks), np.concatenate(values)
        columns = np.array([4 * index + k for index in range(1, count) for k in free])
        solution, _, rank, _ = np.linalg.lstsq(matrix[:, columns], right, rcond=None)
        transforms.reshape(-1)[columns] = solution
        if freedom == "turn":
            transforms[:, 0] = np.sqrt(1 - np.clip(transforms[:, 1], -0.5, 0.5) ** 2)
        for (i, j), match in matches.items():
            off = _residuals(transforms, i, j, match)
            used[i, j] = off <= max(_OUTLIER, 2 * float(np.median(off)))
        # Patches overlap, and err alike: they count as a quarter of their number.
        left = matrix[:, columns] @ solution - right
        noise = 4 * float(left @ left) / max(len(left) - int(rank), 1)
        normal = matrix[:, columns].T @ matrix[:, columns]
        doubt.reshape(-1)[columns] = np.sqrt(noise * np.maximum(np.diag(np.linalg.pinv(normal)), 0))
    misfit = max(
        float(np.median(_residuals(transforms, i, j, match)[used[i, j]])) for (i, j), match in matches.items()
    )
    return transforms, misfit, doubt
