"""Transforms that all pairs of pictures agree to but those that the others outvote
(:mod:`toposeam.layers.registration.outlier_pairs`): where most of them have their way turns and scales are
averaged first and then shifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from toposeam.errors import OverlapError
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.outlier_pairs import averaged, divided, evidence_of, named_pairs
from toposeam.layers.registration.pair_matching import Match, groups
from toposeam.layers.registration.pose_graph import FREEDOMS, Adjustment, adjusted, offsets

#: A pair that is farther off than so many px does not fit.
LARGEST_MISFIT = 1.0
#: Nearer than this share of a picture's diagonal it is not another place: a lens or perspective.
ELSEWHERE = 0.02
_ROUNDS = 8

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Vote:
    """Where most of the evidence places pictures."""

    places: Adjustment
    #: The pairs that fit there and that do not, and how far each is off, px.
    kept: list[Pair]
    wrong: list[Pair]
    off: dict[Pair, float]
    #: Whether there are none that do not, or the others outvote them.
    clear: bool


def voted(
    count: int,
    matches: dict[Pair, Match],
    evidence: Mapping[Pair, float],
    solved: Callable[[dict[Pair, Match]], Adjustment],
    largest: float,
    order: float = 2,
) -> Vote:
    """Find where so many pictures belong, by the pairs that agree.

    Parameters
    ----------
    count : int
    matches : dict of (int, int) to Match
        Which join all pictures.
    evidence : mapping from (int, int) to float
        How much each has (:func:`toposeam.layers.registration.outlier_pairs.evidence_of`).
    solved : callable
        Places by least squares from some of the matches.
    largest : float
        A pair that is farther off, px, does not fit.
    order : float
        Of the norm by which that is measured.
    """
    places = solved(matches)
    off = offsets(places.transforms, matches, order)
    if max(off.values()) <= largest:
        return Vote(places, list(matches), [], off, clear=True)
    off = offsets(_majority(count, matches, evidence), matches, order)
    near = 3 * max(float(np.median(list(off.values()))), largest)
    kept, settled = [pair for pair in matches if off[pair] <= near], False
    for _ in range(_ROUNDS):
        if settled or groups(count, kept).any():
            break
        places = solved({pair: matches[pair] for pair in kept})
        off = offsets(places.transforms, matches, order)
        before, kept = kept, [pair for pair in matches if off[pair] <= largest]
        settled = kept == before
    kept, wrong, clear = divided(count, evidence, off, largest)
    return Vote(places, kept, wrong, off, clear=settled and clear)


def without_contradictions(
    names: list[str],
    sizes: Floats,
    matches: dict[Pair, Match],
    freedoms: Sequence[str] = FREEDOMS,
    largest: float = LARGEST_MISFIT,
) -> tuple[Adjustment, dict[Pair, Match]]:
    """Transforms that all pairs but those that are outvoted agree to, and those that agree.

    Parameters
    ----------
    names : list of str
        Of the pictures.
    sizes : (N, 2) array
        Height and width of each, px.
    matches : dict of (int, int) to Match
        Which join all pictures.
    freedoms : sequence of str
        What pictures may do, the simplest first.
    largest : float
        A pair that is farther off, px, does not fit.

    Raises
    ------
    OverlapError
        When more than these do not fit; the text names the pairs.
    """
    evidence = {  # where somebody gave the points, no patches were compared
        pair: evidence_of(match.share, match.features)
        if math.isnan(match.correlation)
        else evidence_of(match.correlation, len(match.first))
        for pair, match in matches.items()
    }
    vote = voted(len(sizes), matches, evidence, partial(adjusted, sizes, freedoms=freedoms), largest)
    elsewhere = placed_elsewhere(sizes, {pair: vote.off[pair] for pair in vote.wrong})
    if vote.clear and len(elsewhere) == len(vote.wrong):
        return vote.places, {pair: matches[pair] for pair in vote.kept}
    most = max(vote.off.values())
    if not elsewhere:
        raise OverlapError(
            "{names} do not fit where the other pictures place them: up to {off} px are left "
            "between them; a lens or perspective is not undone here: align them with Hugin "
            "(pto_gen, cpfind, autooptimiser, nona), and join its pictures with toposeam "
            "enblend",
            kind="misfit",
            names=named_pairs(names, vote.wrong),
            off=f"{most:.1f}",
            layers=_in(vote.wrong),
        )
    raise ambiguous(names, elsewhere, most)


def placed_elsewhere(sizes: Floats, off: Mapping[Pair, float]) -> list[Pair]:
    """List the pairs of pictures of (N, 2) sides that lie so many px off that it is in another place."""
    diagonals = np.hypot(*sizes.T)
    return [pair for pair in off if off[pair] > ELSEWHERE * diagonals[list(pair)].min()]


def ambiguous(names: list[str], elsewhere: list[Pair], most: float) -> OverlapError:
    """The error about pairs that match elsewhere, up to so many px off."""
    return OverlapError(
        "{names} match where the other pictures do not place them, up to {off} px off, "
        "and too little else shows which is right: what repeats itself matches in several"
        " places; leave such pictures out, or say where the pictures lie",
        kind="ambiguous",
        names=named_pairs(names, elsewhere),
        off=f"{most:.0f}",
        layers=_in(elsewhere),
    )


def _in(pairs: Collection[Pair]) -> tuple[int, ...]:
    """The pictures of some pairs."""
    return tuple(sorted({index for pair in pairs for index in pair}))


def _majority(count: int, matches: dict[Pair, Match], evidence: Mapping[Pair, float]) -> Floats:
    """(N, 4) transforms as in :class:`Adjustment`, from which pairs have the least sum of distances."""
    weights = np.array([evidence[pair] for pair in matches])
    own = np.array([_similarity(match) for match in matches.values()])
    factors = np.exp(averaged(count, matches.keys(), -np.log(own), weights))
    shifts = [
        factors[j] * (match.second @ [1, 1j]) - factors[i] * (match.first @ [1, 1j])
        for (i, j), match in matches.items()
    ]
    middles = np.array([np.median(shift.real) + 1j * np.median(shift.imag) for shift in shifts])
    places = averaged(count, matches.keys(), middles, weights)
    return np.stack([factors.real, factors.imag, places.real, places.imag], axis=1)


def _similarity(match: Match) -> complex:
    """Scale and turn of the second picture in the first, as one complex number; one point shows neither."""
    if len(match.first) == 1:
        return 1
    first, second = ((points - points.mean(axis=0)) @ [1, 1j] for points in (match.first, match.second))
    return complex(np.vdot(second, first) / np.vdot(second, second))
