"""How much is tried in the search for the seams of many layers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from toposeam.checks import check_choice

#: "fast" reduces the costs of a problem in one way; "best" does so in two ways, takes the best of both, and
#: searches once more at full size round the places where three layers meet.
Effort = Literal["fast", "best"]
EFFORTS: tuple[Effort, ...] = ("fast", "best")

#: The number of layers from which on "best" is the default.
BEST_FROM = 13


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOptions:
    """How the cheapest label map is searched for. Numbers of pixels count those that have several layers to
    choose from, unless they are of a canvas.
    """

    #: The weights w with which costs are reduced (:mod:`toposeam.layers.search.cost_coarsening`), one search
    #: each.
    wandering: tuple[float, ...] = (0.6,)
    #: Whether to search at full size round the places where three layers meet, and how far, px.
    windows: bool = False
    window: int = 24
    #: Canvases of more pixels are searched with the first weight only, and without windows.
    large_canvas: int = 1 << 22
    #: Costs are halved until at most so many pixels are left: those of problems of up to `small` pixels, and
    #: those of larger ones; and until a side has fewer than twice `shortest` px.
    coarsest: int = 3_500
    coarsest_large: int = 10_000
    small: int = 1 << 16
    shortest: int = 32
    #: The number of orders of the layers from which expansions start.
    starts: int = 6
    #: At reduced sizes it is noted where each layer would show if the present seams cost more by the share
    #: `dearer`: there it may show at the next size. With at most so many pixels at half the size that is
    #: asked of all of them, else of those that may change.
    near_ties: int = 1 << 14
    dearer: float = 0.15
    #: How far from where it shows at the next smaller size a layer may show, px.
    band: int = 4
    #: How far round pixels that more than two layers may show expansions follow, px, and for how many rounds.
    tangle: int = 8
    cycles: int = 1
    #: Canvases of up to so many pixels are refined as a whole, larger ones pair by pair.
    together: int = 1 << 19
    #: At reduced sizes heat stops when no seam can be cheaper by more than this share.
    rough: float = 0.01


FAST = SearchOptions()
BEST = SearchOptions(wandering=(0.6, 0.9), windows=True, cycles=3)


def search_options(effort: Effort | SearchOptions | None, count: int) -> SearchOptions:
    """The options of an effort; by default that of a number of layers.

    Raises
    ------
    OptionError
        When there is no such effort.

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
