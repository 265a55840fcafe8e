"""Whether pictures of a turning camera reach all the way round, and whether their ends agree there.

By their fields of view alone pictures seem to reach round where the focal length is a little too short. The
turn is closed only by a loop of pairs that leads once round: its last pair is then part of the adjustment.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from toposeam.arrays import Floats
from toposeam.layers.canvas.transforms import wrapped
from toposeam.layers.labelling.label_map import Pair

#: Steps of a circle in which the directions that pictures show are counted.
_CIRCLE_STEPS = 1440


def directions(rays: Sequence[Floats]) -> tuple[tuple[float, float], bool]:
    """Find the angles about the vertical, rad, between which pictures show something, and whether they reach
    all the way round.

    Parameters
    ----------
    rays : sequence of (M, 3) arrays
        What each picture shows: right, down, forward.
    """
    shown = np.zeros(_CIRCLE_STEPS, bool)
    for ray in rays:
        yaw = np.arctan2(ray[:, 0], ray[:, 2])
        centre = math.atan2(ray[:, 0].mean(), ray[:, 2].mean())
        angles = wrapped(yaw - centre)
        low, high = (
            (centre + angle) / (2 * math.pi) * _CIRCLE_STEPS for angle in (angles.min(), angles.max())
        )
        shown[np.arange(math.floor(low), math.ceil(high)) % _CIRCLE_STEPS] = True
    if shown.all():
        return (-math.pi, math.pi), True
    # The largest gap is behind.
    hidden = np.flatnonzero(~shown)
    runs = np.split(hidden, np.flatnonzero(np.diff(hidden) > 1) + 1)
    if len(runs) > 1 and runs[0][0] == 0 and runs[-1][-1] == _CIRCLE_STEPS - 1:
        runs = [np.concatenate([runs[-1] - _CIRCLE_STEPS, runs[0]]), *runs[1:-1]]
    gap = max(runs, key=len)
    first, last = gap[-1] + 1, gap[0] + _CIRCLE_STEPS
    low, high = (value / _CIRCLE_STEPS * 2 * math.pi for value in (first, last))
    return (low, high), False


def unrolled(yaws: Floats, pairs: Collection[Pair]) -> Floats:
    """Add whole turns to the directions of pictures, (N,) rad, so that they go on from pair to pair, those of
    nearest directions first.
    """
    yaws = np.array(yaws, float)
    group = np.arange(len(yaws))
    for i, j in sorted(pairs, key=lambda pair: abs(_step(yaws, pair))):
        if group[i] != group[j]:
            moved = group == group[j]
            yaws[moved] += yaws[i] + _step(yaws, (i, j)) - yaws[j]
            group[moved] = group[i]
    return yaws


def closing(yaws: Floats, pairs: Collection[Pair]) -> list[Pair]:
    """List the pairs that lead from one end of an unrolled row (:func:`unrolled`) to the other."""
    return [(i, j) for i, j in pairs if abs(yaws[j] - yaws[i] - _step(yaws, (i, j))) > math.pi]


def _step(yaws: Floats, pair: Pair) -> float:
    """Return the angle from the first picture of a pair to the second, the shorter way."""
    return float(wrapped(yaws[pair[1]] - yaws[pair[0]]))
