"""Match pairs of pictures by points that the user gave, in place of features."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toposeam.checks import check_kind, check_numbers
from toposeam.errors import OptionError
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.homography import least_squares_homography
from toposeam.layers.registration.pair_matching import Match

#: Points of a pair: a homography has eight unknowns.
LEAST_POINTS = 4
#: Features that a pair with given points counts for.
_FEATURES = 200


def matches_of(points: Mapping[Pair, Any], sizes: Sequence[tuple[int, int]]) -> dict[Pair, Match]:
    """Match the pairs whose points the user gave.

    Parameters
    ----------
    points : mapping from (i, j) to (M, 4) arrays
        x and y in picture i, px from the middle of its upper left pixel, and those of the same in picture j.
    sizes : sequence of (int, int)
        Width and height of the pictures.

    Raises
    ------
    OptionError
        When a pair is none of two pictures, or its points are too few, outside, or on one line.
    """
    check_kind("points", points, Mapping, "a mapping from pairs of pictures to their points")
    matches: dict[Pair, Match] = {}
    for pair, given in points.items():
        i, j = _checked_pair(pair, len(sizes))
        both = check_numbers("points", given)
        if both.ndim != 2 or both.shape[1] != 4 or len(both) < LEAST_POINTS:
            raise OptionError(
                "points of pictures {i} and {j} have shape {shape}; give (M, 4), x and y in both, with M at "
                "least {least}",
                kind="points",
                i=i,
                j=j,
                shape=str(both.shape),
                least=LEAST_POINTS,
            )
        limits = np.array([*sizes[i], *sizes[j]]) - 1
        if not ((both >= 0) & (both <= limits)).all():
            raise OptionError(
                "a point of pictures {i} and {j} lies outside of them; give px from the upper left corner",
                kind="points",
                i=i,
                j=j,
            )
        first, second = (both[:, :2], both[:, 2:]) if i < j else (both[:, 2:], both[:, :2])
        spread = min(np.linalg.svd(own - own.mean(axis=0), compute_uv=False)[1] for own in (first, second))
        if spread < 2:
            raise OptionError(
                "the points of pictures {i} and {j} lie on one line; add some beside it",
                kind="points",
                i=i,
                j=j,
            )
        matches[min(i, j), max(i, j)] = Match(
            first,
            second,
            math.nan,
            matrix=least_squares_homography(first, second),
            features=_FEATURES,
        )
    return matches


def _checked_pair(pair: Any, count: int) -> Pair:
    """Return a pair of two different numbers of pictures, or refuse it."""
    whole = isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(one, int) for one in pair)
    if not whole or pair[0] == pair[1] or not all(0 <= one < count for one in pair):
        raise OptionError(
            "points of {pair!r} are of no pair; name two different pictures by their numbers, 0 to {last}",
            kind="points",
            pair=pair,
            last=count - 1,
        )
    return pair[0], pair[1]
