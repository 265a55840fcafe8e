"""A part of a labelling problem, for whoever works on that part only."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from toposeam.layers.labelling import Labelling
from toposeam.layers.layer import Box
from toposeam.layers.maps import part_of


def part_of_labelling(labelling: Labelling, box: Box) -> Labelling:
    """The same problem as far as a box of the canvas is concerned, to be handed to another process."""
    near = [all(place.shared(box).shape) for place in labelling.places]
    nothing, nowhere = Box(0, 0, 0, 0), np.zeros((0, 0), bool)
    seen: dict[int, Any] = {}
    allowed = [
        part_of(mask, box.shared(place).moved(-place.top, -place.left)) if is_near else nowhere
        for mask, place, is_near in zip(labelling.allowed, labelling.places, near, strict=True)
    ]
    places = [place if is_near else nothing for place, is_near in zip(labelling.places, near, strict=True)]
    costs = {(i, j): cost.part(box, seen) for (i, j), cost in labelling.costs.items() if near[i] and near[j]}
    return dataclasses.replace(labelling, places=places, allowed=allowed, costs=costs)
