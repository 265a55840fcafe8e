"""A label map: which layer shows at each pixel of a canvas, and how that was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from toposeam.arrays import Labels

#: Two layers by their numbers, the lower one first.
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelMap:
    """The solution of a labelling problem."""

    #: (H, W) int16 array, or tiles that read like one: the layer that shows, -1 where none does.
    labels: Labels
    #: The engine, as :attr:`toposeam.seam.Seam.method` has it.
    method: str = "graph-cut"
    #: The options of the engine.
    settings: Mapping[str, Any] = field(default_factory=dict)
    #: Rounds of expansions that were made.
    rounds: int = 0
    #: Seconds of the search.
    seconds: float = 0.0
