"""Cut a part out of a labelling problem, on its canvas or as a problem of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import part_of
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.labelling.problem import Labelling, PairCost


def part_of_labelling(labelling: Labelling, box: Box, pair: Pair | None = None) -> Labelling:
    """Return the same problem for use inside a box of the canvas only, in another process.

    With `pair`, the allowed masks of all other layers are left out.
    """
    near = [all(place.shared(box).shape) for place in labelling.places]
    wanted = np.flatnonzero(near) if pair is None else pair
    nothing, nowhere = Box(0, 0, 0, 0), np.zeros((0, 0), bool)
    shared_parts: dict[int, Any] = {}
    allowed = [
        part_of(mask, box.shared(place).moved(-place.top, -place.left)) if k in wanted else nowhere
        for k, (mask, place) in enumerate(zip(labelling.allowed, labelling.places, strict=True))
    ]
    places = [place if is_near else nothing for place, is_near in zip(labelling.places, near, strict=True)]
    costs = {
        (i, j): cost.part(box, shared_parts)
        for (i, j), cost in labelling.costs.items()
        if near[i] and near[j]
    }
    return dataclasses.replace(labelling, places=places, allowed=allowed, costs=costs)


def window_of_labelling(labelling: Labelling, box: Box, allowed: Sequence[Mask]) -> Labelling:
    """Return a window of a canvas as a labelling problem of its own.

    Parameters
    ----------
    labelling : Labelling
    box : Box
    allowed : sequence of (h, w) bool arrays
        Per layer, True where it may be chosen in the window; an empty array for a layer that does not lie
        there.
    """
    canvas = Box(0, 0, *box.shape)
    places, masks = [], []
    for place, mask in zip(labelling.places, allowed, strict=True):
        inside = place.shared(box)
        here = inside.moved(-box.top, -box.left) if all(inside.shape) else Box(0, 0, 0, 0)
        places.append(here)
        masks.append(mask[here.slices])
    costs: dict[Pair, PairCost] = {
        pair: _WindowCost(cost, box)
        for pair, cost in labelling.costs.items()
        if all(cost.box.grown(-1).shared(box).shape)
    }
    return Labelling(canvas, places, masks, costs, labelling.forbidden)


@dataclass(frozen=True, slots=True, eq=False)
class _WindowCost:
    """The match cost of two layers in the coordinates of a window of their canvas."""

    whole: PairCost
    window: Box

    @property
    def box(self) -> Box:
        """The overlap of the two places in the window, grown by one pixel."""
        inside = self.whole.box.grown(-1).shared(self.window)
        return inside.moved(-self.window.top, -self.window.left).grown(1)

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Return the costs in a box of the window."""
        return self.whole.on(box.moved(*self.window[:2]), beside)

    def shared(self, box: Box) -> Mask:
        """(h, w) bool mask of a box, True where both layers have pixels."""
        return self.whole.shared(box.moved(*self.window[:2]))

    def part(self, box: Box, shared_parts: dict[int, Any]) -> PairCost:
        """Return the same cost for use inside a box of the window only."""
        return _WindowCost(self.whole.part(box.moved(*self.window[:2]), shared_parts), self.window)
