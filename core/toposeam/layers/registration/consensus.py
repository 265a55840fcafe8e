"""Transforms that all pairs of pictures agree to but those that the others outvote
(:mod:`toposeam.layers.registration.outlier_pairs`): where most of them have their way turns and scales are
averaged first and then shifts.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from toposeam.errors import OverlapError
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.outlier_pairs import averaged, evidence_of, named_pairs, voted
from toposeam.layers.registration.pair_matching import Match
from toposeam.layers.registration.pose_graph import FREEDOMS, Adjustment, adjusted, offsets

#: A pair that is farther off than so many px does not fit.
LARGEST_MISFIT = 1.0
#: Nearer than this share of a picture's diagonal it is not another place: a lens or perspective.
ELSEWHERE = 0.02

Floats = npt.NDArray[np.float64]


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

    def solved(pairs: Collection[Pair]) -> tuple[Adjustment, dict[Pair, float]]:
        solution = adjusted(sizes, {pair: matches[pair] for pair in pairs}, freedoms)
        return solution, offsets(solution.transforms, matches)

    def of_most() -> dict[Pair, float]:
        return offsets(_majority(len(sizes), matches, evidence), matches)

    evidence = {pair: evidence_of(match.correlation, len(match.first)) for pair, match in matches.items()}
    vote = voted(len(sizes), evidence, solved, of_most, largest)
    diagonals = np.hypot(*sizes.T)
    elsewhere = [pair for pair in vote.wrong if vote.off[pair] > ELSEWHERE * diagonals[list(pair)].min()]
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


def _majority(count: int, matches: dict[Pair, Match], evidence: dict[Pair, float]) -> Floats:
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
    """Scale and turn of the second picture in the first, as one complex number."""
    first, second = ((points - points.mean(axis=0)) @ [1, 1j] for points in (match.first, match.second))
    return complex(np.vdot(second, first) / np.vdot(second, second))
