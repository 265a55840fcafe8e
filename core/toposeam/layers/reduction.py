"""A labelling problem at half the size, whose costs are those of the pixels.

Looking at reduced *pictures* misleads: noise that a seam at full size can go round averages out. So costs are
reduced, not pictures. Two columns become one; the interface between two reduced pixels stands for three
columns of interfaces at full size, the one on their common border and one inside of either. A seam at full
size goes through the cheapest of the three in every row, if it may wander freely, and stays in one if it may
not. Their mean with a weight, summed over the two rows, is the reduced cost::

    M'(X, Y) = Σ over rows y of Y:  w min(M(2X, y), M(2X + 1, y), M(2X + 2, y)) + (1 - w) M(2X + 1, y)

with M(x, y) the cost between pixels x and x + 1; likewise across. On overlaps of a million pixels three such
halvings and a band of four pixels round what they show end 1 to 2 % above the seam found at full size, in a
fifth of its time.
"""

from __future__ import annotations

import numpy as np

from toposeam.images import Mask
from toposeam.layers.labelling import Labelling, Pair, PairCost
from toposeam.layers.layer import Box
from toposeam.layers.painting import LabelMap
from toposeam.layers.posing import TableCost
from toposeam.seam.match_cost import Floats32

#: w above.
WANDERING = 0.8
#: Reduced rows that are made at once.
_ROWS = 64


def reduced(labelling: Labelling) -> Labelling:
    """The problem at half the size.

    A layer is allowed at a reduced pixel when it is at all of its covered pixels, or, where no layer is, at
    some.
    """
    canvas = _halved(labelling.canvas)
    ground = np.zeros(labelling.canvas.shape, bool)
    for place, allowed in zip(labelling.places, labelling.allowed, strict=True):
        ground[place.slices] |= allowed
    places = [_halved(place) for place in labelling.places]
    everywhere, somewhere = [], []
    any_layer = np.zeros(canvas.shape, bool)
    for index, place in enumerate(places):
        fine = Box(2 * place.top, 2 * place.left, 2 * place.bottom, 2 * place.right)
        allowed = labelling.allowed_in(index, fine)
        inside = fine.shared(labelling.canvas)
        missing = np.zeros(fine.shape, bool)
        missing[inside.within(fine)] = ground[inside.slices]
        missing &= ~allowed
        some = _any(allowed)
        everywhere.append(some & ~_any(missing))
        somewhere.append(some)
        any_layer[place.slices] |= everywhere[-1]
    chosen = [
        every | (some & ~any_layer[place.slices])
        for every, some, place in zip(everywhere, somewhere, places, strict=True)
    ]
    costs: dict[Pair, PairCost] = {pair: _reduced_cost(cost) for pair, cost in labelling.costs.items()}
    return Labelling(canvas, places, chosen, costs, labelling.forbidden)


def enlarged(label_map: LabelMap, finer: Labelling) -> LabelMap:
    """A label map of a reduced problem on the canvas of the finer one."""
    result = np.full(finer.canvas.shape, -1, np.int16)
    _enlarge(label_map, result)
    finer.make_allowed(result)
    return result


def opened(chosen: Mask, finer: Labelling) -> Mask:
    """(H, W) bool on the finer canvas: pixels of the chosen reduced ones and of their neighbours."""
    wide = chosen.copy()
    wide[1:] |= chosen[:-1]
    wide[:-1] |= chosen[1:]
    wide[:, 1:] |= wide[:, :-1].copy()
    wide[:, :-1] |= wide[:, 1:].copy()
    result = np.zeros(finer.canvas.shape, bool)
    _enlarge(wide, result)
    return result


def _enlarge(coarse: np.ndarray, fine: np.ndarray) -> None:
    for row in (0, 1):
        for column in (0, 1):
            part = fine[row::2, column::2]
            part[:] = coarse[: part.shape[0], : part.shape[1]]


def _halved(box: Box) -> Box:
    return Box(box.top // 2, box.left // 2, -(-box.bottom // 2), -(-box.right // 2))


def _any(mask: Mask) -> Mask:
    result: Mask = mask[::2, ::2] | mask[1::2, ::2] | mask[::2, 1::2] | mask[1::2, 1::2]
    return result


def _reduced_cost(cost: PairCost) -> TableCost:
    """The reduced costs of a pair, a few rows at a time."""
    inner = cost.box.grown(-1)
    box = _halved(inner).grown(1)
    height, width = box.shape
    right, down = np.empty((height, width - 1), np.float32), np.empty((height - 1, width), np.float32)
    for start in range(0, height, _ROWS):
        stop = min(start + _ROWS, height)
        # One more reduced row, for the interfaces below.
        fine = Box(2 * (box.top + start), 2 * box.left, 2 * (box.top + min(stop + 1, height)), 2 * box.right)
        beside, below = cost.on(fine)
        across = _of_three(beside)
        right[start:stop] = (across[0::2] + across[1::2])[: stop - start]
        along = _of_three(below.T).T
        along = along[:, 0::2] + along[:, 1::2]
        down[start : start + len(along)] = along[: height - 1 - start]
    return TableCost(box, right, down)


def _of_three(cost: Floats32) -> Floats32:
    """(n, 2 m - 1) costs between 2 m columns to (n, m - 1) between pairs of them; 0 is no interface."""
    first, border, last = cost[:, 0:-2:2], cost[:, 1:-1:2], cost[:, 2::2]
    known = border > 0
    least = np.where(first > 0, np.minimum(first, border), border)
    least = np.where(last > 0, np.minimum(last, least), least)
    mixed: Floats32 = np.float32(WANDERING) * least + np.float32(1 - WANDERING) * border
    # A border without a cost where the insides have one: the end of an overlap.
    return np.where(known, mixed, np.float32(0))
