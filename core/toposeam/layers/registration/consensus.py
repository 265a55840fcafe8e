"""What most pairs of pictures agree to, and pairs that match where they do not belong: loops that run through
these do not close.

Where pictures repeat themselves, two may fit as well some periods off, or although they share nothing. What
such pairs say moves all others in the sense of least squares. Not so where the sum of the distances is least,
and not that of their squares (:func:`averaged`): there most of the evidence has its way. The pairs that do
not fit there are wrong if, wherever the others are divided so that both pictures of one lie on different
sides, several times as much evidence as they have speaks against them.

What repeats itself correlates well, and what is the same better: how much a match tells is not how large it
is but what the one part lets know of the other, their mutual information (:func:`evidence_of`).

Turns and scales are averaged in this way first, then shifts (:func:`voted`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toposeam.arrays import Floats
from toposeam.errors import OverlapError
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.pair_matching import Match, groups
from toposeam.layers.registration.pose_graph import FREEDOMS, Adjustment, adjusted, offsets

#: A pair that is farther off than so many px does not fit.
LARGEST_MISFIT = 1.0
#: Nearer than this share of a picture's diagonal it is not another place: a lens or perspective.
ELSEWHERE = 0.02
_ROUNDS = 8
#: How many times the evidence of wrong pairs speaks against them. Of 58 sets of crops of pictures that repeat
#: themselves, the 13 that would have come to lie wrong had 1.4 at most, the others 1.2 to 50.
_OUTVOTED = 3
#: Parts correlate no better than so much: what differs is noise.
_SAME = 0.999
_AVERAGINGS, _NEAREST = 60, 1e-3
#: Into so many units the most evidence of a pair is divided.
_UNITS = 1 << 20
#: So many pairs are named at most.
_NAMED = 8


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
        How much each has (:func:`evidence_of`).
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


def evidence_of(correlation: float, size: float) -> float:
    """What a match of so many patches or pixels that correlate so well tells: twice the mutual information of
    Gaussian variables, -log(1 - ρ²), for each (Gelfand and Yaglom 1957).
    """
    return -size * math.log(1 - min(max(correlation, 0.0), _SAME) ** 2)


def named_pairs(names: list[str], pairs: list[Pair]) -> str:
    """Pairs by the names of their pictures, a few of them."""
    named = [f"{names[i]} and {names[j]}" for i, j in pairs]
    if len(named) > _NAMED:
        named[_NAMED - 1 :] = [f"{len(named) - _NAMED + 1} more pairs"]
    return ", ".join(named)


def averaged(
    count: int, pairs: Collection[Pair], differences: npt.NDArray[np.complex128], weights: Floats
) -> npt.NDArray[np.complex128]:
    """(N,) values, the first one 0, of least weighted sum of |x_i - x_j - difference| over the pairs, by
    iteratively reweighted least squares (Chatterjee and Govindu 2013, doi:10.1109/ICCV.2013.70).
    """
    incidence = np.zeros((len(pairs), count))
    numbers, (i, j) = np.arange(len(pairs)), np.array(list(pairs)).T
    incidence[numbers, i], incidence[numbers, j] = 1, -1
    values, current = np.zeros(count, complex), weights
    for _ in range(_AVERAGINGS):
        weighted = incidence[:, 1:] * current[:, np.newaxis]
        values[1:] = np.linalg.solve(weighted.T @ incidence[:, 1:], weighted.T @ differences)
        current = weights / np.maximum(np.abs(incidence @ values - differences), _NEAREST)
    return values


def divided(
    count: int, evidence: Mapping[Pair, float], off: Mapping[Pair, float], largest: float
) -> tuple[list[Pair], list[Pair], bool]:
    """Divide the pairs of so many pictures into those that fit and those that are farther off than so many
    px, and tell whether there are none of these, or the others outvote them.
    """
    kept: list[Pair] = []
    wrong: list[Pair] = []
    for pair in evidence:
        (wrong if off[pair] > largest else kept).append(pair)
    votes = [{pair: evidence[pair] for pair in pairs} for pairs in (kept, wrong)]
    return kept, wrong, not wrong or (not groups(count, kept).any() and _outvoted(count, *votes))


def _outvoted(count: int, kept: dict[Pair, float], wrong: dict[Pair, float]) -> bool:
    """Whether between the pictures of every wrong pair, where the pairs that are kept have least evidence,
    they have several times as much as the wrong ones have there.
    """
    evidence = np.zeros((count, count), np.int32)  # flows are of whole numbers
    unit = max(kept.values()) / _UNITS
    for (i, j), own in kept.items():
        evidence[i, j] = evidence[j, i] = round(own / unit)
    network = csr_array(evidence)
    for i, j in wrong:
        flow = maximum_flow(network, i, j)
        left = csr_array(np.maximum(evidence - flow.flow.toarray(), 0))
        reached = breadth_first_order(left, i, return_predecessors=False)
        across = [wrong[pair] for pair in wrong if np.isin(pair, reached).sum() == 1]
        if flow.flow_value * unit < _OUTVOTED * sum(across):
            return False
    return True
