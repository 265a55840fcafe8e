"""Pairs of pictures that match where they do not belong: loops that run through them do not close.

Where pictures repeat themselves, two may fit as well some periods off, or although they share nothing. What
such pairs say moves all others in the sense of least squares. Not so where the sum of the distances is least,
and not that of their squares (:func:`averaged`): there most of the evidence has its way. The pairs that do
not fit there are wrong if, wherever the others are divided so that both pictures of one lie on different
sides, several times as much evidence as they have speaks against them.

What repeats itself correlates well, and what is the same better: how much a match tells is not how large it
is but what the one part lets know of the other, their mutual information (:func:`evidence_of`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.pair_matching import groups

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

Floats = npt.NDArray[np.float64]


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
