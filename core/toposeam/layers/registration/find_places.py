"""Places of pictures of which nobody says where they belong.

1. Each picture, reduced, is described by its SIFT features (Lowe 2004,
   doi:10.1023/B:VISI.0000029664.99615.94; scikit-image's). For two pictures those that match give a
   similarity by RANSAC, and the overlap then has to correlate. Where many show the same, the pairs that share
   most are enough.
2. At full size, patches spread over each overlap are laid exactly by phase correlation to a twentieth of a
   pixel.
3. All patches of all pairs together give each picture's place, turn and scale by linear least squares
   (:mod:`toposeam.layers.registration.pose_graph`), so that a loop of pictures closes. Where no picture is
   turned or scaled, only places are sought, and pictures are placed by whole pixels. Pairs that match where
   they do not belong, as what repeats itself does, are left out where others outvote them
   (:mod:`toposeam.layers.registration.consensus`).

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
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.resampling import placed
from toposeam.layers.execution.tasks import Executor, check_executor
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.consensus import without_contradictions
from toposeam.layers.registration.pair_matching import Match, find_matches, groups
from toposeam.layers.registration.pose_graph import open_corners
from toposeam.sentence import counted

#: Least correlation of two overlaps that are taken to show the same.
LEAST_CORRELATION = 0.5
#: A picture of which more than so many px are open, one standard deviation at its corners, is refused: what
#: is nearer is placed within half a pixel (benchmarks/placing.py).
LARGEST_DOUBT = 0.4
#: So many pictures are named at most that show something else.
_NAMED = 8

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
    #: Largest distance, px, between what one pair that was used says and where its pictures were placed.
    misfit: float
    #: Pairs that match in a place where the others do not put them, and that were not used.
    outvoted: tuple[Pair, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Placement({len(self.layers)} pictures, {counted(len(self.correlations), 'pair')}, misfit "
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
        When pictures fit none of the others, or pairs contradict each other and none outvotes the other; the
        text names them.
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
    sizes = np.array([picture.image.shape[:2] for picture in pictures])
    solution, used = without_contradictions([picture.name for picture in pictures], sizes, matches)
    _check_exact(pictures, open_corners(sizes, solution))
    transforms = solution.transforms
    turns = np.degrees(np.arctan2(transforms[:, 1], transforms[:, 0]))
    scales = np.hypot(transforms[:, 0], transforms[:, 1])
    layers = tuple(place(pictures, transforms[:, 2:], turns, scales))
    report(1.0)
    return Placement(
        layers=layers,
        places=transforms[:, 2:],
        turns=turns,
        scales=scales,
        correlations={pair: match.correlation for pair, match in used.items()},
        misfit=solution.misfit,
        outvoted=tuple(pair for pair in matches if pair not in used),
    )


def _check_joined(pictures: Sequence[Layer], matches: dict[Pair, Match], best: Floats, least: float) -> None:
    """Refuse pictures that are not joined to most of the others by pairs that agree, and name all of them."""
    own = groups(len(pictures), matches)
    sizes = np.bincount(own)
    if len(sizes) == 1:
        return
    lost = [np.flatnonzero(own == group) for group in dict.fromkeys(own) if group != sizes.argmax()]
    alone = np.array([members[0] for members in lost if len(members) == 1], np.intp)
    others = [members for members in lost if len(members) > 1]
    told = []
    if len(alone):
        close = f"the best correlation is {best[alone].max():.2f}"
        close = (
            close if best[alone].max() > -1 else f"{_each(alone, 'it has', 'they have')} nothing in common"
        )
        told.append(
            f"{_named(pictures, alone)} {_each(alone, 'fits', 'fit')} none of the other pictures ({close}, "
            f"{least:g} is needed)"
        )
    if others:
        shown = ", and ".join(_named(pictures, members) for members in others)
        told.append(f"{shown} show something else than the other pictures")
    remedies = []
    if len(alone):
        remedies.append(f"leave {_each(alone, 'it', 'them')} out, or say where the pictures lie")
    if others:
        remedies.append(f"join the {'two' if len(others) == 1 else len(others) + 1} groups apart")
    members = np.concatenate(lost).tolist()
    if len(alone) == 1:
        kind, data = "fits none", {"name": pictures[alone[0]].name}
    elif len(alone):
        kind, data = "fit none", {"names": _named(pictures, alone)}
    else:
        kind, data = "apart in groups", {"name": pictures[members[0]].name}
        data["others"] = _named(pictures, np.array(members[1:]))
    raise OverlapError(
        "{what}; {remedies}",
        kind=kind,
        layers=tuple(sorted(members)),
        what=", and ".join(told),
        remedies="; ".join(remedies),
        **data,
    )


def _check_exact(pictures: Sequence[Layer], doubts: Floats) -> None:
    """Refuse pictures whose corners are open by so many px, and name all of them, the worst first."""
    worst_first = np.argsort(-doubts, kind="stable")
    unsure = worst_first[doubts[worst_first] > LARGEST_DOUBT]
    if len(unsure):
        raise OverlapError(
            "{name} cannot be placed exactly: what {shared} with the others leaves "
            "{up_to}{off} px open; {remedy}, or say where the pictures lie",
            kind="inexact",
            layers=tuple(unsure.tolist()),
            name=_named(pictures, unsure),
            shared=_each(unsure, "it shares", "they share"),
            up_to=_each(unsure, "", "up to "),
            off=f"{doubts.max():.1f}",
            remedy=_each(unsure, "leave it out", "let them overlap more"),
        )


def _each(indices: npt.NDArray[np.intp], one: str, several: str) -> str:
    return one if len(indices) == 1 else several


def _named(pictures: Sequence[Layer], indices: npt.NDArray[np.intp]) -> str:
    names = [pictures[index].name for index in indices]
    if len(names) > _NAMED + 1:
        names[_NAMED:] = [f"{len(names) - _NAMED} more"]
    return names[0] if len(names) == 1 else f"{names[0]} and {', '.join(names[1:])}"
