"""Steps that levelling leaves at seams, eased into the copies on both sides.

What is added to the copies solves a screened Poisson equation: across a seam it has the step that makes the
picture's gradient the mean of both copies' there, within a copy none, and it dies away with the distance. On
a plane, a cylinder or a torus that is one transform each way. What changes quickly along a seam, as the ends
of fibres, is eased within a few pixels; what hardly does, as light, as far as the screening lets it.
"""

from __future__ import annotations

import numpy as np

from toposeam.heat.poisson import add_steps, spread
from toposeam.texture.atlas import Atlas, Floats32, Ints32
from toposeam.texture.rendering import Lift

#: How far a step reaches, px.
_REACH = 12.0
#: A step, in shares of white, of which half is eased; what is much larger is an edge.
_EDGE = 0.3


def eased(plane: Floats32, atlas: Atlas, index: Ints32, lift: Lift, wraps: tuple[bool, bool]) -> Lift:
    """Light with the steps at seams eased.

    Parameters
    ----------
    plane : (AH, AW, C) float32 array
        The sample.
    atlas : Atlas
    index : (H, W) int32 array
        What shows at each pixel.
    lift : Lift
        The light that copies are given.
    wraps : (bool, bool)
        Whether rows and columns continue at the opposite border.

    Returns
    -------
    Lift
    """
    flat, usable = plane.reshape(-1, plane.shape[2]), atlas.usable.ravel()
    white = (lift.high - lift.low) or 1.0
    wanted = np.zeros(lift.gain.shape, np.float32)
    for axis, step in ((0, atlas.width), (1, 1)):
        beside = np.roll(index, -1, axis)
        seam = (beside - index != step) & (index >= 0) & (beside >= 0)
        if not wraps[axis]:
            seam[(slice(-1, None), slice(None)) if axis == 0 else (slice(None), slice(-1, None))] = False
        y, x = np.nonzero(seam)
        next_y, next_x = ((y + 1) % index.shape[0], x) if axis == 0 else (y, (x + 1) % index.shape[1])
        p, q = index[y, x], index[next_y, next_x]
        ahead, behind = np.minimum(p + step, len(flat) - 1), np.maximum(q - step, 0)
        known = np.stack([usable[ahead], usable[behind]], axis=1).astype(np.float32)
        gain, offset = lift.gain[y, x], lift.offset[y, x]
        here, after = gain * flat[p] + offset, gain * flat[ahead] + offset
        gain, offset = lift.gain[next_y, next_x], lift.offset[next_y, next_x]
        before, there = gain * flat[behind] + offset, gain * flat[q] + offset
        apart = (after - there) * known[:, :1] + (here - before) * known[:, 1:]
        apart /= np.maximum(known.sum(axis=1, keepdims=True), 1)
        apart /= 1 + (np.abs(apart).max(axis=1, keepdims=True) / (_EDGE * white)) ** 4
        add_steps(wanted, (y, x), (next_y, next_x), -apart)
    for channel in np.moveaxis(wanted, 2, 0):
        channel[...] = spread(channel, _REACH, wraps)
    wanted += lift.offset
    return Lift(gain=lift.gain, offset=wanted, low=lift.low, high=lift.high)
