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

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_items, check_range
from toposeam.errors import OptionError, OverlapError
from toposeam.layers.labelling import Pair
from toposeam.layers.layer import Layer
from toposeam.layers.pairing import Match, find_matches
from toposeam.layers.tasks import Executor, check_executor
from toposeam.layers.turning import placed

#: Least correlation of two overlaps that are taken to show the same.
LEAST_CORRELATION = 0.5
#: Below this, px at the farthest corner, nothing counts as turned or scaled.
_NOT_TURNED = 0.35
#: Patches that do not lie within so many px of where the others say do not count; a pair whose patches are
#: farther off than this does not fit.
_OUTLIER, LARGEST_MISFIT = 1.0, 1.0
#: A picture of which more than so many px are open, one standard deviation at its corners, is refused: what
#: is nearer is placed within half a pixel (benchmarks/placing.py).
LARGEST_DOUBT = 0.4
#: What pictures may do, the simplest first.
_FREEDOMS = ("shift", "turn", "similarity")
#: The unknowns of each, of a, b, u, v.
_FREE = {"shift": (2, 3), "turn": (1, 2, 3), "similarity": (0, 1, 2, 3)}
#: How many directions of all of them there are that change nothing between any two.
_NOBODY_SEES = {"shift": 2, "turn": 3, "similarity": 4}
#: Of a group that shows something else so many pictures are named at most.
_NAMED = 8
#: Patches of a pair overlap, and err alike: so many count as one (benchmarks/placing.py: of 29 sets, no
#: picture is farther off than 4 standard deviations). None is more exact than so many px.
_ALIKE, _FINEST = 16, 0.02


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


def find_places(
    pictures: Sequence[Layer],
    *,
    least_correlation: float = LEAST_CORRELATION,
    progress: Callable[[float], None] | None = None,
    executor: Executor | None = None,
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
    executor : concurrent.futures.Executor, optional
        Where pictures and pairs are looked at; the places are the same.

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
    check_executor(executor)
    return found_places(pictures, least_correlation, progress, executor, _placed_here)


#: Pictures placed at x and y of (N, 2), turned by (N,) degrees and scaled by (N,).
Places = Callable[[Sequence[Layer], Floats, Floats, Floats], Sequence[Layer]]


def _placed_here(pictures: Sequence[Layer], at: Floats, turns: Floats, scales: Floats) -> Sequence[Layer]:
    return [
        placed(picture, at=(float(u), float(v)), turn=float(turn), scale=float(scale))
        for picture, (u, v), turn, scale in zip(pictures, at, turns, scales, strict=True)
    ]


def found_places(
    pictures: Sequence[Layer],
    least_correlation: float,
    progress: Callable[[float], None] | None,
    executor: Executor | None,
    place: Places,
) -> Placement:
    """As :func:`find_places`, for whoever places pictures in a way of their own, as into files."""
    pictures = check_items("pictures", pictures, Layer, "a sequence of Layers")
    if len(pictures) < 2:
        raise OptionError(f"{len(pictures)} picture was given; pass at least two")
    report: Callable[[float], None] = progress or (lambda _: None)
    matches, best = find_matches(pictures, least_correlation, report, executor)
    _check_joined(pictures, matches, best, least_correlation)
    transforms, misfit = _solve(pictures, matches)
    turns = np.degrees(np.arctan2(transforms[:, 1], transforms[:, 0]))
    scales = np.hypot(transforms[:, 0], transforms[:, 1])
    layers = tuple(place(pictures, transforms[:, 2:], turns, scales))
    report(1.0)
    return Placement(
        layers=layers,
        places=transforms[:, 2:],
        turns=turns,
        scales=scales,
        correlations={pair: match.correlation for pair, match in matches.items()},
        misfit=misfit,
    )


def _check_joined(pictures: Sequence[Layer], matches: dict[Pair, Match], best: Floats, least: float) -> None:
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
        if len(partners) > _NAMED:
            partners[_NAMED - 1 :] = [f"{len(partners) - _NAMED + 1} more"]
        raise OverlapError(
            f"{pictures[index].name} and {', '.join(partners)} show something else than the other pictures; "
            "join the two groups apart"
        )
    close = f"the best correlation is {best[index]:.2f}" if best[index] > -1 else "it has nothing in common"
    raise OverlapError(
        f"{pictures[index].name} fits none of the other pictures ({close}, {least:g} is needed); leave it "
        "out, or say where the pictures lie"
    )


def _solve(pictures: Sequence[Layer], matches: dict[Pair, Match]) -> tuple[Floats, float]:
    """(N, 4) a, b, u, v of each picture, and the largest misfit in px: by shifts alone if that is enough,
    else also by turns, else also by scales, as the Bayesian information criterion says (Schwarz 1978,
    doi:10.1214/aos/1176344136): what a few patches of one poor overlap would have is no reason to turn.
    """
    sizes = np.array([picture.image.shape[:2] for picture in pictures])
    found = []
    for freedom in _FREEDOMS:
        found.append(_least_squares(len(sizes), matches, freedom))
        if found[-1].misfit <= _NOT_TURNED:
            break
    chosen = _simplest([one.transforms for one in found], matches)
    transforms, misfit = found[chosen].transforms, found[chosen].misfit
    for (i, j), match in matches.items():
        off = float(np.median(_residuals(transforms, i, j, match)))
        if off > LARGEST_MISFIT:
            raise OverlapError(
                f"{pictures[i].name} and {pictures[j].name} do not fit where the other pictures place them: "
                f"{off:.1f} px are left between them; a lens or perspective is not undone here: align them "
                "with Hugin (pto_gen, cpfind, autooptimiser, nona), and join its pictures with toposeam "
                "enblend"
            )
    unsure = found[chosen].noise * _open(sizes, transforms, found[chosen].matrix, _FREEDOMS[chosen])
    if unsure.max() > LARGEST_DOUBT:
        worst = int(np.argmax(unsure))
        raise OverlapError(
            f"{pictures[worst].name} cannot be placed exactly: what it shares with the others leaves "
            f"{unsure[worst]:.1f} px open; leave it out, or say where the pictures lie"
        )
    return transforms, misfit


def _simplest(several: list[Floats], matches: dict[Pair, Match]) -> int:
    """Which of the transforms found with each freedom explain the patches with no more unknowns than they
    need; errors have a Cauchy distribution, as wide as the freest leave them.
    """
    off = np.array(
        [
            np.concatenate([_residuals(transforms, i, j, match) for (i, j), match in matches.items()])
            for transforms in several
        ]
    )
    width = max(float(np.median(off[-1])), _FINEST)
    count = 2 * off.shape[1] / _ALIKE
    costs = [
        count * float(np.log1p((one / width) ** 2).mean())
        + len(_FREE[freedom]) * (len(several[0]) - 1) * float(np.log(count))
        for one, freedom in zip(off, _FREEDOMS, strict=False)
    ]
    return int(np.argmin(costs))


def _residuals(transforms: Floats, i: int, j: int, match: Match) -> Floats:
    distance = _applied(transforms[i], match.first) - _applied(transforms[j], match.second)
    return np.asarray(np.hypot(*distance.T))


def _applied(transform: Floats, points: Floats) -> Floats:
    a, b, u, v = transform
    return np.stack(
        [a * points[:, 0] - b * points[:, 1] + u, b * points[:, 0] + a * points[:, 1] + v], axis=1
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """All transforms at once."""

    #: (N, 4).
    transforms: Floats
    #: The largest of a pair, px.
    misfit: float
    #: One standard deviation of what the patches that were used leave, px, and (M, 4 N) what they said.
    noise: float
    matrix: Floats


def _least_squares(count: int, matches: dict[Pair, Match], freedom: str) -> _Solution:
    """All transforms of so many pictures; patches that disagree with a solution are left out of the next."""
    free = _FREE[freedom]
    transforms = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    used = {pair: np.ones(len(match.first), bool) for pair, match in matches.items()}
    columns = np.array([4 * index + k for index in range(1, count) for k in free])
    for _ in range(4):
        blocks = []
        for (i, j), match in matches.items():
            keep = used[i, j]
            block = np.zeros((2 * int(keep.sum()), count, 4))
            for sign, index, points in ((1, i, match.first[keep]), (-1, j, match.second[keep])):
                block[:, index] += sign * _terms(points).reshape(-1, 4)
            blocks.append(block.reshape(len(block), -1))
        matrix = np.concatenate(blocks)
        fixed = np.setdiff1d(np.arange(4 * count), columns)
        right = -matrix[:, fixed] @ transforms.reshape(-1)[fixed]
        solution, _, rank, _ = np.linalg.lstsq(matrix[:, columns], right, rcond=None)
        transforms.reshape(-1)[columns] = solution
        if freedom == "turn":
            transforms[:, 0] = np.sqrt(1 - np.clip(transforms[:, 1], -0.5, 0.5) ** 2)
        for (i, j), match in matches.items():
            off = _residuals(transforms, i, j, match)
            used[i, j] = off <= max(_OUTLIER, 2 * float(np.median(off)))
    left = matrix[:, columns] @ solution - right
    noise = _ALIKE * float(left @ left) / max(len(left) - int(rank), 1)
    misfit = max(
        float(np.median(_residuals(transforms, i, j, match)[used[i, j]])) for (i, j), match in matches.items()
    )
    return _Solution(transforms, misfit, float(np.sqrt(noise)), matrix)


def _open(sizes: Floats, transforms: Floats, matrix: Floats, freedom: str) -> Floats:
    """How far each picture's corners are open where patches have an error of 1 px. That all pictures together
    may lie elsewhere, or turned, nobody sees: the least of all such covariances (Baarda's S-transformation).
    """
    count = len(sizes)
    moves = np.tile(np.eye(4)[:, _FREE[freedom]], (count, 1, 1))
    if freedom == "turn":
        moves[:, 0, 0], moves[:, 1, 0] = -transforms[:, 1], transforms[:, 0]
    design = np.einsum("mci,cik->mck", matrix.reshape(-1, count, 4), moves).reshape(len(matrix), -1)
    corners = np.stack([_terms(size[::-1] * np.array([[0, 0], [0, 1], [1, 0], [1, 1]])) for size in sizes])
    reached = np.einsum("ncpi,nik->ncpk", corners, moves)
    at_corners = np.einsum("ncpk,nm->ncpmk", reached, np.eye(count)).reshape(8 * count, -1)
    values, vectors = np.linalg.eigh(design.T @ design)
    none = _NOBODY_SEES[freedom]
    errors = at_corners @ (vectors[:, none:] / np.sqrt(values[none:].clip(1e-12)))
    unseen = np.linalg.qr(at_corners @ vectors[:, :none])[0]
    errors -= unseen @ (unseen.T @ errors)
    variances = (errors**2).sum(axis=1).reshape(count, 4, 2).sum(axis=2)
    return np.asarray(np.sqrt(variances.max(axis=1)))


def _terms(points: Floats) -> Floats:
    """(N, 2, 4), what a, b, u, v add to x and y of each point."""
    x, y = points.T
    one, none = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([x, -y, one, none], axis=1), np.stack([y, x, none, one], axis=1)], axis=1)
