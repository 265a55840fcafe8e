"""Homogeneity round a hole: a texture, alike everywhere, or a photograph of several things."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.images import box_of

#: Reach of a hole's surroundings, in radii of a disc of its area, and least reach, px.
_REACH_RADII, _LEAST_REACH = 2.0, 64
#: Least and largest side of the blocks that are compared, px.
_LEAST_BLOCK, _MOST_BLOCK = 24, 48
#: Largest share of a texture's variance between the means of blocks, and largest coefficient of variation of
#: the blocks' contrast. Of 19 textures and 11 photographs (benchmarks/texture_samples.py, texture_fill.py) no
#: texture without slow light or lone objects has more, and every photograph of several things has.
_MOST_BETWEEN, _MOST_CONTRAST_VARIATION = 0.2, 0.3


def is_texture(features: Callable[[tuple[slice, slice]], Floats32], hole: Mask, known: Mask) -> bool:
    """Test whether a picture is alike everywhere round a hole.

    Parameters
    ----------
    features : callable
        Returns the (h, w, F) features of some rows and columns.
    hole, known : (H, W) bool array
        What has to go, and where there are values.
    """
    radius = float(np.sqrt(np.count_nonzero(hole) / np.pi))
    reach = max(_REACH_RADII * radius, _LEAST_REACH)
    box = box_of(hole, math.ceil(reach))
    seen, hole, known = features(box), hole[box], known[box]
    near = (ndimage.distance_transform_edt(~hole) <= reach) & known & ~hole
    if not near.any():
        return True
    side = int(np.clip(radius, _LEAST_BLOCK, _MOST_BLOCK))
    rows, columns = (np.flatnonzero(near.any(axis=axis)) for axis in (1, 0))
    means, contrasts = [], []
    for top in range(int(rows[0]), int(rows[-1]) + 1, side // 2):
        for left in range(int(columns[0]), int(columns[-1]) + 1, side // 2):
            block = np.s_[top : top + side, left : left + side]
            if 2 * np.count_nonzero(near[block]) >= side * side:
                values = seen[block][near[block]]
                means.append(values.mean(axis=0))
                contrasts.append(float(values.std(axis=0).mean()))
    whole = float(seen[near].var(axis=0).sum())
    if len(means) < 4 or whole == 0 or not any(contrasts):
        return True
    between = float(np.var(means, axis=0).sum()) / whole
    return (
        between < _MOST_BETWEEN and float(np.std(contrasts) / np.mean(contrasts)) < _MOST_CONTRAST_VARIATION
    )
