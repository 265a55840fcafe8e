"""Find wrong pairs by a vote: pairs of pictures that match in another place than where they belong.

Where pictures repeat themselves, two may fit as well some periods off, or although they share nothing. Loops
through such pairs do not close. Least squares would let one wrong pair move all pictures. The least sum of
distances, not of their squares, follows most of the evidence (:func:`average_differences`): turns and scales
are averaged in this way first, then shifts (:func:`vote`). The pairs that do not fit the average are wrong if
every cut that separates their two pictures has several times as much evidence as the wrong pairs across it.

The evidence of a match is not its size but the mutual information of its two parts (:func:`evidence_of`):
what repeats itself correlates well, and what is the same better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toposeam.arrays import Complexes, Floats
from toposeam.layers.canvas.canvas import groups
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.pair_matching import ELSEWHERE, Match
from toposeam.layers.registration.pose_graph import (
    FREEDOMS,
    LARGEST_MISFIT,
    Adjustment,
    adjust_transforms,
    offsets,
)

#: Evidence against wrong pairs ÷ their own, at least. Of 58 sets of crops of pictures that repeat themselves,
#: the 13 that would have come to lie wrong had 1.4 at most, the others 1.2 to 50.
_OUTVOTED = 3
#: Largest correlation that counts: identical parts have no infinite evidence, as pictures have noise.
_LARGEST_CORRELATION = 0.999


@dataclass(frozen=True, slots=True, eq=False)
class Vote:
    """The places of pictures that most of the evidence supports."""

    places: Adjustment
    #: The pairs that fit there and that do not, and the distance of each, px in the median.
    kept: list[Pair]
    wrong: list[Pair]
    distances: dict[Pair, float]
    #: Whether no pair is wrong, or the others outvote the wrong ones.
    clear: bool


def vote(
    count: int,
    matches: dict[Pair, Match],
    evidence: Mapping[Pair, float],
    solve: Callable[[dict[Pair, Match]], Adjustment],
    largest: float,
    order: float = 2,
    rounds: int = 8,
) -> Vote:
    """Find the places of pictures by the pairs that agree.

    Parameters
    ----------
    count : int
        Number of pictures.
    matches : dict of (int, int) to Match
        They join all pictures.
    evidence : mapping from (int, int) to float
        Of each match (:func:`evidence_of`).
    solve : callable
        Finds places by least squares from some of the matches.
    largest : float
        Largest distance of a pair that fits, px.
    order : float
        Of the norm that measures distances.
    rounds : int
        In which pairs that fit are chosen and places found from them, at most.
    """
    places = solve(matches)
    distances = offsets(places.transforms, matches, order)
    if max(distances.values()) <= largest:
        return Vote(places, list(matches), [], distances, clear=True)
    distances = offsets(_majority(count, matches, evidence), matches, order)
    near = 3 * max(float(np.median(list(distances.values()))), largest)
    kept, settled = [pair for pair in matches if distances[pair] <= near], False
    for _ in range(rounds):
        if settled or groups(count, kept).any():
            break
        places = solve({pair: matches[pair] for pair in kept})
        distances = offsets(places.transforms, matches, order)
        before, kept = kept, [pair for pair in matches if distances[pair] <= largest]
        settled = kept == before
    kept, wrong, clear = divide_pairs(count, evidence, distances, largest)
    return Vote(places, kept, wrong, distances, clear=settled and clear)


def without_contradictions(
    names: list[str],
    sizes: Floats,
    matches: dict[Pair, Match],
    freedoms: Sequence[str] = FREEDOMS,
    largest: float = LARGEST_MISFIT,
) -> tuple[Adjustment, dict[Pair, Match]]:
    """Adjust transforms to all pairs but those that are outvoted.

    Parameters
    ----------
    names : list of str
        Of the pictures.
    sizes : (N, 2) array
        Height and width of each, px.
    matches : dict of (int, int) to Match
        They join all pictures.
    freedoms : sequence of str
        Kinds of transforms, the simplest first.
    largest : float
        Largest distance of a pair that fits, px.

    Returns
    -------
    adjustment : Adjustment
    used : dict of (int, int) to Match
        The matches that agree with it.

    Raises
    ------
    OverlapError
        When pairs do not fit that the others do not outvote; the text names them.
    """
    evidence = {  # of given points no patches were compared
        pair: evidence_of(match.share, match.features)
        if math.isnan(match.correlation)
        else evidence_of(match.correlation, len(match.first))
        for pair, match in matches.items()
    }
    solve = partial(adjust_transforms, sizes, freedoms=freedoms)
    result = vote(len(sizes), matches, evidence, solve, largest)
    elsewhere = placed_elsewhere(sizes, {pair: result.distances[pair] for pair in result.wrong})
    if result.clear and len(elsewhere) == len(result.wrong):
        return result.places, {pair: matches[pair] for pair in result.kept}
    from toposeam.layers.registration.refusals import ambiguous, misfit  # most pictures need no refusal

    most = max(result.distances.values())
    raise ambiguous(names, elsewhere, most) if elsewhere else misfit(names, result.wrong, most)


def placed_elsewhere(sizes: Floats, distances: Mapping[Pair, float]) -> list[Pair]:
    """List the pairs that lie in another place, by (N, 2) sides of the pictures and distances, px."""
    diagonals = np.hypot(*sizes.T)
    return [pair for pair in distances if distances[pair] > ELSEWHERE * diagonals[list(pair)].min()]


def _majority(count: int, matches: dict[Pair, Match], evidence: Mapping[Pair, float]) -> Floats:
    """Find the (N, 4) transforms, as of :class:`Adjustment`, of least weighted sum of distances."""
    weights = np.array([evidence[pair] for pair in matches])
    own = np.array([_similarity(match) for match in matches.values()])
    factors = np.exp(average_differences(count, matches.keys(), -np.log(own), weights))
    shifts = [
        factors[j] * (match.second @ [1, 1j]) - factors[i] * (match.first @ [1, 1j])
        for (i, j), match in matches.items()
    ]
    middles = np.array([np.median(shift.real) + 1j * np.median(shift.imag) for shift in shifts])
    places = average_differences(count, matches.keys(), middles, weights)
    return np.stack([factors.real, factors.imag, places.real, places.imag], axis=1)


def _similarity(match: Match) -> complex:
    """Return scale and turn of the second picture in the first, a complex number; 1 for a single point."""
    if len(match.first) == 1:
        return 1
    first, second = ((points - points.mean(axis=0)) @ [1, 1j] for points in (match.first, match.second))
    return complex(np.vdot(second, first) / np.vdot(second, second))


def evidence_of(correlation: float, size: float) -> float:
    """Compute the evidence of a match: twice the mutual information of Gaussian variables, -log(1 - ρ²), for
    each of its patches or pixels, of which there are `size` (Gelfand and Yaglom 1957).
    """
    return -size * math.log(1 - min(max(correlation, 0.0), _LARGEST_CORRELATION) ** 2)


def average_differences(
    count: int,
    pairs: Collection[Pair],
    differences: Complexes,
    weights: Floats,
    *,
    rounds: int = 60,
    nearest: float = 1e-3,
) -> Complexes:
    """Minimise the weighted sum of |x_i - x_j - difference| over the pairs.

    By iteratively reweighted least squares (Chatterjee and Govindu 2013, doi:10.1109/ICCV.2013.70).

    Parameters
    ----------
    count : int
        Number of values.
    pairs : collection of (int, int)
    differences, weights : (M,) arrays
        Of each pair.
    rounds : int
        Of reweighting.
    nearest : float
        Smaller distances count like this one.

    Returns
    -------
    (N,) complex array
        The values; the first one is 0.
    """
    incidence = np.zeros((len(pairs), count))
    numbers, (i, j) = np.arange(len(pairs)), np.array(list(pairs)).T
    incidence[numbers, i], incidence[numbers, j] = 1, -1
    values, current = np.zeros(count, complex), weights
    for _ in range(rounds):
        weighted = incidence[:, 1:] * current[:, np.newaxis]
        values[1:] = np.linalg.solve(weighted.T @ incidence[:, 1:], weighted.T @ differences)
        current = weights / np.maximum(np.abs(incidence @ values - differences), nearest)
    return values


def divide_pairs(
    count: int, evidence: Mapping[Pair, float], distances: Mapping[Pair, float], largest: float
) -> tuple[list[Pair], list[Pair], bool]:
    """Divide the pairs of `count` pictures into those that fit, at most `largest` px off, and the others.

    Returns
    -------
    kept, wrong : list of (int, int)
    clear : bool
        Whether none is wrong, or the others outvote the wrong ones.
    """
    kept: list[Pair] = []
    wrong: list[Pair] = []
    for pair in evidence:
        (wrong if distances[pair] > largest else kept).append(pair)
    votes = [{pair: evidence[pair] for pair in pairs} for pairs in (kept, wrong)]
    return kept, wrong, not wrong or (not groups(count, kept).any() and _outvoted(count, *votes))


def _outvoted(count: int, kept: dict[Pair, float], wrong: dict[Pair, float]) -> bool:
    """Test whether on the least cut between the pictures of every wrong pair the kept pairs have several
    times as much evidence as the wrong ones.
    """
    evidence = np.zeros((count, count), np.int32)  # flows are of whole numbers: of millionths of the greatest
    unit = max(kept.values()) / (1 << 20)
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
