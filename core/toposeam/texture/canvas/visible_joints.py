"""Visible joints: steps in brightness where two copies meet, beyond those that the sample has there itself.

A step is seen from 12 % of white on. Where the sample is full of such steps, as grass is, they hide joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.texture.canvas.copy_borders import joints
from toposeam.texture.canvas.rendering import Lift
from toposeam.texture.exemplar.atlas import Atlas

#: Least step, as a share of white, that is seen.
_VISIBLE = 0.12
#: Share of the sample's own pixels with such steps at which half of the joints are hidden.
_BUSY = 0.02
#: What a joint within an object counts that is no step.
_CUTTING = 0.2
#: Number of joints per 1000 px that are hardly noticed.
FEW = 0.3
#: Side, px, of the squares of a texture of which the worst is named.
_SQUARE = 32
#: Side, px, of the part of a sample in which its own steps are counted.
_MEASURED_SIDE = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class JointVerdict:
    """How good a texture is: the joints that are seen in it, and what of its samples it shows.

    Examples
    --------
    >>> str(JointVerdict(joints=0.1, busy=0, shown=0.9, where=(40, 8)))
    'joints are hardly seen'
    >>> str(JointVerdict(joints=4.2, busy=0, shown=0.9, where=(40, 8)))
    'joints are seen, look at 40,8'
    """

    #: Visible joints per 1000 px of what was laid.
    joints: float
    #: Share of the samples' pixels with such a step of their own, in [0, 1].
    busy: float
    #: Share of the pixels that may be copied that shows, in [0, 1]; None where a picture was only mended.
    shown: float | None
    #: (x, y), px: the middle of the square with most joints; None where there is none.
    where: tuple[int, int] | None

    @property
    def noticed(self) -> float:
        """Joints per 1000 px, less where the samples' own steps hide them."""
        return self.joints / (1 + self.busy / _BUSY)

    @property
    def unseen(self) -> bool:
        """True if joints are hardly noticed."""
        return self.noticed < FEW

    def __str__(self) -> str:
        if self.unseen or self.where is None:
            return "joints are hardly seen"
        return f"joints are seen, look at {self.where[0]},{self.where[1]}"

    def summary(self) -> dict[str, Any]:
        """Return the verdict as in JSON: joints, shown, look_at."""
        return {
            "joints": round(float(self.noticed), 3),
            "shown": None if self.shown is None else round(self.shown, 3),
            "look_at": None if self.unseen or self.where is None else list(self.where),
        }

    def rolled(self, shift: tuple[int, int], shape: tuple[int, int]) -> Self:
        """Return the verdict on a texture (H, W) that begins so many rows and columns further on."""
        if self.where is None:
            return self
        x, y = self.where
        where = (x - shift[1]) % shape[1], (y - shift[0]) % shape[0]
        return type(self)(joints=self.joints, busy=self.busy, shown=self.shown, where=where)


class JointSteps:
    """The steps at all joints of a texture, gathered channel by channel.

    Parameters
    ----------
    index : (H, W) int32 array
        Flat index into the atlas of the pixel that shows; -1 for none.
    atlas : Atlas
    wraps : (bool, bool)
        Whether rows and columns continue at the opposite border.
    """

    def __init__(self, index: Ints32, atlas: Atlas, wraps: tuple[bool, bool]) -> None:
        self._shape, usable = index.shape, atlas.usable.ravel()
        parts = []
        for first, second, step in joints(index, atlas.width, wraps):
            p, q = index.take(first), index.take(second)
            ahead, behind = p + step, q - step
            np.copyto(ahead, p, where=~usable[ahead])
            np.copyto(behind, q, where=~usable[behind])
            parts.append([one.astype(np.int32) for one in (first, second, p, q, ahead, behind)])
        self._first, self._second, *self._sources = map(np.concatenate, zip(*parts, strict=True))
        #: (3, n): the step at each joint, and the steps of either copy there, in the sum of the channels.
        self._steps = np.zeros((3, len(self._first)), np.float32)

    def add(self, values: npt.NDArray[Any], share: float, lift: Lift | None = None) -> None:
        """Add a channel (AH, AW) of the samples, times what it counts, in the light that copies are given."""
        flat = values.reshape(-1)
        p, q, ahead, behind = (flat.take(one).astype(np.float32) for one in self._sources)
        if lift is not None:
            gain, offset = np.broadcast_to(lift.gain, lift.offset.shape), lift.offset
            for place, here in ((self._first, (p, ahead)), (self._second, (q, behind))):
                for one in here:
                    one *= _taken(gain, place)
                    one += _taken(offset, place)
        for total, one, two in zip(self._steps, (p, p, q), (q, ahead, behind), strict=True):
            total += np.float32(share) * (one - two)

    def add_all(self, plane: npt.NDArray[Any], white: float) -> None:
        """Add all channels of the samples (AH, AW, C) as they are."""
        for channel in range(plane.shape[2]):
            self.add(plane[..., channel], 1 / (white * plane.shape[2]))

    def lit(
        self, lift: Callable[[int], Lift], plane: npt.NDArray[Any], white: float
    ) -> Callable[[int], Lift]:
        """Make a function that gives a channel its light as another one does, and adds it."""

        def light(channel: int) -> Lift:
            given = lift(channel)
            self.add(plane[..., channel], 1 / (white * plane.shape[2]), given)
            return given

        return light

    def verdict(
        self,
        busy: float,
        area: int,
        shown: float | None,
        corner: tuple[int, int] = (0, 0),
        objects: Mask | None = None,
    ) -> JointVerdict:
        """Count the joints that are seen.

        Parameters
        ----------
        busy : float
            Share of the samples' pixels with visible steps (:func:`busyness`).
        area : int
            Number of pixels that were laid.
        shown : float, optional
            Share of the samples that shows.
        corner : (int, int)
            x and y of the first pixel on the picture.
        objects : (AH, AW) bool array, optional
            Pixels of objects, in which joints that are no steps count as well, less: they cut one, or join
            two.
        """
        at, before, after = np.abs(self._steps)
        visible = at - np.maximum(before, after) > _VISIBLE
        seen, cutting = self._first[visible], 0
        if objects is not None:
            p, q = (objects.ravel().take(one) for one in self._sources[:2])
            cutting = int(np.count_nonzero((p | q) & ~visible))
        where = None
        if len(seen):
            y, x = np.divmod(seen, np.int32(self._shape[1]))
            wide = -(-self._shape[1] // _SQUARE)
            row, column = divmod(int(np.bincount(y // _SQUARE * wide + x // _SQUARE).argmax()), wide)
            inside = (y // _SQUARE == row) & (x // _SQUARE == column)
            where = round(float(x[inside].mean())) + corner[0], round(float(y[inside].mean())) + corner[1]
        count = 1000.0 * (len(seen) + _CUTTING * cutting) / max(area, 1)
        return JointVerdict(joints=count, busy=busy, shown=shown, where=where)


def _taken(values: npt.NDArray[Any], place: Ints32) -> Floats32:
    """Gather an (H, W, 1) array at flat places."""
    row, column = np.divmod(place, np.int32(values.shape[1]))
    found: Floats32 = values[row, column, 0]
    return found


def busyness(gray: Floats32, usable: Mask) -> float:
    """Compute the share of a sample's pixels (H, W) with steps that would be visible joints."""
    middle = middle_of(usable)
    shares = []
    for values, there in ((gray[middle], usable[middle]), (gray[middle].T, usable[middle].T)):
        steps = np.abs(np.diff(values, axis=0))
        known = there[:-3] & there[1:-2] & there[2:-1] & there[3:]
        count = int(np.count_nonzero(known))
        high = steps[1:-1] - np.maximum(steps[:-2], steps[2:]) > _VISIBLE
        shares.append(np.count_nonzero(high & known) / max(count, 1))
    return float(np.mean(shares))


def middle_of(usable: Mask) -> tuple[slice, slice]:
    """Select the rows and columns of a sample in which its own steps are counted."""
    rows, columns = (
        slice(max(length - _MEASURED_SIDE, 0) // 2, (length + min(length, _MEASURED_SIDE)) // 2)
        for length in usable.shape
    )
    return rows, columns
