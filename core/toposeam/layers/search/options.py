"""The options of the search for the seams of many layers."""

from __future__ import annotations

from dataclasses import dataclass

from toposeam.checks import check_choice
from toposeam.typing import EFFORTS
from toposeam.typing import Effort as Effort

#: Least number of layers for which "best" is the default.
BEST_FROM = 13


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOptions:
    """The options of a search for the cheapest label map. Numbers of pixels count contested ones, at which
    several layers are allowed, unless they are of a canvas.
    """

    #: The weights w with which costs are reduced (:mod:`toposeam.layers.search.cost_coarsening`), one search
    #: for each.
    wandering: tuple[float, ...] = (0.6,)
    #: Whether to search at full size round the places where three layers meet, and up to which distance, px.
    windows: bool = False
    window: int = 24
    #: Canvases of more pixels are searched with the first weight only, and without such windows.
    large_canvas: int = 1 << 22
    #: Costs are halved until at most `coarsest` pixels are left, or `coarsest_large` in problems of more than
    #: `small` pixels, or until a side has at most twice `shortest` px.
    coarsest: int = 3_500
    coarsest_large: int = 10_000
    small: int = 1 << 16
    shortest: int = 32
    #: Number of initial labellings from which expansions start.
    starts: int = 6
    #: A layer may also show at the next size where it would show if the present seams cost more by the
    #: fraction `dearer`. With at most `near_ties` pixels at half the size all pixels are tested for this,
    #: else only those that may change.
    near_ties: int = 1 << 14
    dearer: float = 0.15
    #: Largest distance, px, of pixels where a layer may show from those where it shows at the next smaller
    #: size.
    band: int = 4
    #: Expansions follow within `tangle` px of pixels that more than two layers may show, for `cycles` rounds.
    tangle: int = 8
    cycles: int = 1
    #: Canvases of at most this many pixels are refined as a whole, larger ones pair by pair.
    together: int = 1 << 19
    #: At reduced sizes the method "heat" stops when no seam can be cheaper by more than this fraction.
    rough: float = 0.01


FAST = SearchOptions()
BEST = SearchOptions(wandering=(0.6, 0.9), windows=True, cycles=3)


def search_options(effort: Effort | SearchOptions | None, count: int) -> SearchOptions:
    """Return the options of an effort; by default that for a number of layers.

    Raises
    ------
    OptionError
        If there is no such effort.

    Examples
    --------
    >>> search_options(None, 3) == search_options("fast", 3), search_options(None, 30) == BEST
    (True, True)
    """
    if isinstance(effort, SearchOptions):
        return effort
    if effort is None:
        return BEST if count >= BEST_FROM else FAST
    check_choice("effort", effort, EFFORTS)
    return BEST if effort == "best" else FAST
