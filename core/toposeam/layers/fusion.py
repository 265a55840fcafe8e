"""Two label maps of one problem made one: wherever they differ, what costs less.

Pixels at which they differ lie in patches. No interface touches two of these, or they would be one; so what a
patch costs does not depend on what is chosen for the others, and the cheaper one of each is the best of all
mixtures of whole patches. It costs at most what the cheaper map does.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.layers.edges import SIDES
from toposeam.layers.labelling import Labelling
from toposeam.layers.painting import LabelMap
from toposeam.layers.pieces import pieces_of


def fused(labelling: Labelling, one: LabelMap, other: LabelMap) -> LabelMap:
    """The cheaper one of two label maps in every patch in which they differ.

    Parameters
    ----------
    labelling : Labelling
    one, other : (H, W) int16 arrays
        Kept where both cost the same: the first one.

    Returns
    -------
    (H, W) int16 array
    """
    patch, count = pieces_of(one != other)
    costs, others = (_costs(labelling, labels, patch, count) for labels in (one, other))
    cheaper = others < costs
    result: LabelMap = np.where(cheaper[patch], other, one)
    return result


def _costs(
    labelling: Labelling, labels: LabelMap, patch: npt.NDArray[np.int32], count: int
) -> npt.NDArray[np.float64]:
    """(count + 1,) what the interfaces of each patch cost."""
    total = np.zeros(count + 1)
    for i, j in labelling.adjoining(labels):
        cost = labelling.costs.get((i, j))
        if cost is None:
            continue
        box = cost.box.shared(labelling.canvas)
        shows, number = labels[box.slices], patch[box.slices]
        for values, s, t in zip(cost.on(box, number > 0), *zip(*SIDES, strict=True), strict=True):
            border = ((shows[s] == i) & (shows[t] == j)) | ((shows[s] == j) & (shows[t] == i))
            border &= (number[s] > 0) | (number[t] > 0)
            at = np.maximum(number[s][border], number[t][border])
            total += np.bincount(at, values[border], count + 1)
    return total
