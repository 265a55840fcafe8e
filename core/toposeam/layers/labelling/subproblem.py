"""A part of a labelling problem, for whoever works on that part only."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import part_of
from toposeam.layers.labelling.problem import Labelling, Pair


def part_of_labelling(labelling: Labelling, box: Box, pair: Pair | None = None) -> Labelling:
    """The same problem as far as a box of the canvas is concerned, to be handed to another process; of
    whoever divides a `pair` only, who need not know where other layers are allowed.
    """
    near = [all(place.shared(box).shape) for place in labelling.places]
    wanted = np.flatnonzero(near) if pair is None else pair
    nothing, nowhere = Box(0, 0, 0, 0), np.zeros((0, 0), bool)
    seen: dict[int, Any] = {}
    allowed = [
        part_of(mask, box.shared(place).moved(-place.top, -place.left)) if k in wanted else nowhere
        for k, (mask, place) in enumerate(zip(labelling.allowed, labelling.places, strict=True))
    ]
    places = [place if is_near else nothing for place, is_near in zip(labelling.places, near, strict=True)]
    costs = {(i, j): cost.part(box, seen) for (i, j), cost in labelling.costs.items() if near[i] and near[j]}
    return dataclasses.replace(labelling, places=places, allowed=allowed, costs=costs)
