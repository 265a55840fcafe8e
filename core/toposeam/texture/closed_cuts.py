"""Patches that are laid over something, each inside a ring of its own, cut at the same time.

Most of the time that a small seam takes goes into calls, not into what is computed: many of them in one
array, one below the other, take hardly longer than one. Rings that do not touch do not know of one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toposeam.errors import OverlapError
from toposeam.images import Mask
from toposeam.seam.labels import seam_labels
from toposeam.texture.atlas import Ints32, values_at
from toposeam.texture.landmarks import guarded
from toposeam.texture.lay import PatchPlacer


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Patch:
    """A patch before it is cut."""

    #: First row and column on the canvas.
    at: tuple[int, int]
    #: (h, w) flat indices: what it shows, and (h + 2, w + 2) what is there, one pixel more all round.
    source: Ints32
    before: Ints32
    #: (h, w) bool: where it has to show, and where it may.
    must: Mask
    may: Mask
    #: First patches of the copies that it continues.
    joined: frozenset[int] = frozenset()

    def changes(self, shows: Mask) -> int:
        """How many pixels it changes where it shows."""
        return int(np.count_nonzero(shows & (self.before[1:-1, 1:-1] != self.source)))


def closed_cuts(placer: PatchPlacer, patches: Sequence[Patch]) -> list[Mask]:
    """Where each of some patches shows, cut along the best seam round what it has to show: (h, w) bool each.

    Parameters
    ----------
    placer : PatchPlacer
    patches : sequence of Patch
        They do not touch on the canvas.
    """
    width = max(patch.before.shape[1] for patch in patches)
    tops = np.cumsum([0, *(len(patch.before) for patch in patches)]).tolist()
    there, comes = (np.full((tops[-1], width), -1, np.int32) for _ in range(2))
    covers = np.zeros(there.shape, bool)
    inner = []
    for top, patch in zip(tops, patches, strict=False):
        h, w = patch.source.shape
        inner.append(np.s_[top + 1 : top + 1 + h, 1 : 1 + w])
        there[top : top + h + 2, : w + 2] = patch.before
        there[inner[-1]][patch.must] = -1
        covers[inner[-1]], comes[inner[-1]] = patch.may, patch.source
        known = patch.may & (there[inner[-1]] >= 0)
        if (patch.before[1:-1, 1:-1] == patch.source)[known].all():  # nothing is to be seen of a seam
            covers[inner[-1]] = patch.must
    a, b = (values_at(placer.features, index) for index in (there, comes))
    if placer.guard is not None:
        a, b = guarded(placer.guard, a, b, there, comes[1:-1, 1:-1])
    options = placer.options
    try:
        labels = seam_labels(a, b, there >= 0, covers, options.method, options.cost, closed=True)
    except OverlapError:  # too thin to hold a seam
        return [patch.must for patch in patches]
    return [(labels[box] & patch.may) | patch.must for box, patch in zip(inner, patches, strict=True)]
