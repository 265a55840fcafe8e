"""Pairs of pictures that match where they do not belong: loops that run through them do not close.

Where pictures repeat themselves, two may fit as well some periods off, or although they share nothing. What
such pairs say moves all others in the sense of least squares. Not so where the sum of the distances is least,
and not that of their squares: there most of the evidence has its way, turns and scales being averaged first
and then shifts (Chatterjee and Govindu 2013, doi:10.1109/ICCV.2013.70; each by iteratively reweighted least
squares). The pairs that do not fit there are wrong if, wherever the others are divided so that both pictures
of one lie on different sides, several times as many patches as they have speak against them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toposeam.errors import OverlapError
from toposeam.layers.adjustment import Adjustment, adjusted, offsets
from toposeam.layers.labelling import Pair
from toposeam.layers.pairing import Match, groups

#: A pair that is farther off than so many px does not fit.
LARGEST_MISFIT = 1.0
#: Nearer than this share of a picture's diagonal it is not another place: a lens or perspective.
_ELSEWHERE = 0.02
#: How many times the patches of wrong pairs speak against them. Of 37 sets of crops of pictures that repeat
#: themselves, those that would have come to lie wrong had 1.7 at most.
_OUTVOTED = 3
_AVERAGINGS, _NEAREST = 60, 1e-3
_ROUNDS = 8
#: So many pairs are named at most.
_NAMED = 8

Floats = npt.NDArray[np.float64]


def without_contradictions(
    names: list[str], sizes: Floats, matches: dict[Pair, Match]
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

    Raises
    ------
    OverlapError
        When more than these do not fit; the text names the pairs.
    """
    solution = adjusted(sizes, matches)
    if max(offsets(solution.transforms, matches).values()) <= LARGEST_MISFIT:
        return solution, matches
    off = offsets(_majority(len(sizes), matches), matches)
    near = max(3 * float(np.median(list(off.values()))), 3 * LARGEST_MISFIT)
    kept = {pair: matches[pair] for pair in matches if off[pair] <= near}
    settled = False
    for _ in range(_ROUNDS):
        if settled or len(set(groups(len(sizes), kept))) > 1:
            break
        solution = adjusted(sizes, kept)
        off = offsets(solution.transforms, matches)
        before, kept = kept, {pair: matches[pair] for pair in matches if off[pair] <= LARGEST_MISFIT}
        settled = kept.keys() == before.keys()
    wrong = {pair: matches[pair] for pair in matches if off[pair] > LARGEST_MISFIT}
    diagonals = np.hypot(*sizes.T)
    elsewhere = [pair for pair in wrong if off[pair] > _ELSEWHERE * diagonals[list(pair)].min()]
    patches = {pair: len(match.first) for pair, match in matches.items()}
    votes = [{pair: patches[pair] for pair in pairs} for pairs in (kept, wrong)]
    if settled and len(elsewhere) == len(wrong) and outvoted(len(sizes), *votes):
        return solution, kept
    most = max(off.values())
    if not elsewhere:
        raise OverlapError(
            f"{named_pairs(names, list(wrong))} do not fit where the other pictures place them: up to "
            f"{most:.1f} px are left between them; a lens or perspective is not undone here: align them with "
            "Hugin (pto_gen, cpfind, autooptimiser, nona), and join its pictures with toposeam enblend"
        )
    raise OverlapError(
        f"{named_pairs(names, elsewhere)} match where the other pictures do not place them, up to "
        f"{most:.0f} px off, and too little else shows which is right: what repeats itself matches in "
        "several places; leave such pictures out, or say where the pictures lie"
    )


def named_pairs(names: list[str], pairs: list[Pair]) -> str:
    """Pairs by the names of their pictures, a few of them."""
    named = [f"{names[i]} and {names[j]}" for i, j in pairs]
    if len(named) > _NAMED:
        named[_NAMED - 1 :] = [f"{len(named) - _NAMED + 1} more pairs"]
    return ", ".join(named)


def _majority(count: int, matches: dict[Pair, Match]) -> Floats:
    """(N, 4) transforms as in :class:`Adjustment`, from which pairs have the least sum of distances."""
    pairs = np.array(list(matches))
    weights = np.array([len(match.first) for match in matches.values()], float)
    own = np.array([_similarity(match) for match in matches.values()])
    factors = np.exp(averaged(count, pairs, -np.log(own), weights))
    shifts = [
        factors[j] * (match.second @ [1, 1j]) - factors[i] * (match.first @ [1, 1j])
        for (i, j), match in matches.items()
    ]
    middles = np.array([np.median(shift.real) + 1j * np.median(shift.imag) for shift in shifts])
    places = averaged(count, pairs, middles, weights)
    return np.stack([factors.real, factors.imag, places.real, places.imag], axis=1)


def _similarity(match: Match) -> complex:
    """Scale and turn of the second picture in the first, as one complex number."""
    first, second = ((points - points.mean(axis=0)) @ [1, 1j] for points in (match.first, match.second))
    return complex(np.vdot(second, first) / np.vdot(second, second))


def averaged(
    count: int, pairs: npt.NDArray[np.intp], differences: npt.NDArray[np.complex128], weights: Floats
) -> npt.NDArray[np.complex128]:
    """(N,) values, the first one 0, of least weighted sum of |x_i - x_j - difference| over the pairs."""
    incidence = np.zeros((len(pairs), count))
    numbers = np.arange(len(pairs))
    incidence[numbers, pairs[:, 0]], incidence[numbers, pairs[:, 1]] = 1, -1
    values, current = np.zeros(count, complex), weights
    for _ in range(_AVERAGINGS):
        weighted = incidence[:, 1:] * current[:, np.newaxis]
        values[1:] = np.linalg.solve(weighted.T @ incidence[:, 1:], weighted.T @ differences)
        current = weights / np.maximum(np.abs(incidence @ values - differences), _NEAREST)
    return values


def outvoted(count: int, kept: dict[Pair, int], wrong: dict[Pair, int]) -> bool:
    """Whether between the pictures of every wrong pair, where the pairs that are kept have least evidence,
    they have several times as much as the wrong ones have there; as patches or pixels.
    """
    evidence = np.zeros((count, count), np.int32)
    for (i, j), own in kept.items():
        evidence[i, j] = evidence[j, i] = own
    network = csr_array(evidence)
    for i, j in wrong:
        flow = maximum_flow(network, i, j)
        left = csr_array(np.maximum(evidence - flow.flow.toarray(), 0))
        reached = breadth_first_order(left, i, return_predecessors=False)
        across = [wrong[pair] for pair in wrong if np.isin(pair, reached).sum() == 1]
        if flow.flow_value < _OUTVOTED * sum(across):
            return False
    return True
