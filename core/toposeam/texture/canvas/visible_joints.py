"""Visible joints: steps in brightness or colour where two copies meet, beyond those that the sample has there
itself.

A step in brightness is seen from 12 % of white on. Colours are seen less sharply, but areas of two hues that
meet are told apart by far less, also where noise hides the step between two pixels: so colour is compared by
means over some pixels on either side. Where the sample is full of such steps, as grass is, they hide joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.texture.canvas.copy_borders import joints
from toposeam.texture.canvas.rendering import Lift
from toposeam.texture.exemplar.atlas import Atlas

#: Least step, as a share of white, that is seen.
_VISIBLE = 0.12
#: (3, 3) Brightness, red against green and yellow against blue of red, green and blue: the latter are a and b
#: of Oklab (Ottosson 2020) near gray, where hues are as far apart as they look, in shares of white, doubled,
#: since its distances of colours are short against those of brightness.
_AXES = np.array([[1 / 3, 1 / 3, 1 / 3], [0.68, -0.92, 0.24], [0.22, 0.62, -0.84]], np.float32)
#: Least step in colour that is seen, and number of pixels on either side over which colour is averaged.
_TOLD_APART, _REACH = 0.06, 4
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
        self._shape, self._usable = index.shape, atlas.usable
        usable = atlas.usable.ravel()
        parts: tuple[list[list[Ints32]], list[list[Ints32]]] = [], []
        for first, second, step in joints(index, atlas.width, wraps):
            p, q = index.take(first), index.take(second)
            ahead, behind = p + step, q - step
            np.copyto(ahead, p, where=~usable[ahead])
            np.copyto(behind, q, where=~usable[behind])
            places = (first, second, p, q, ahead, behind)
            parts[step == 1].append([one.astype(np.int32) for one in places])
        self._count = [sum(len(one[0]) for one in part) for part in parts]
        #: First and second pixel of each joint down, then across, and where they and their neighbours beyond
        #: the joint are on the atlas.
        self._places = [np.concatenate(one) for one in zip(*parts[0], *parts[1], strict=True)]
        #: (3, 1 or 3, n): the step at each joint, and those of either copy there, along the axes of colour.
        self._steps = np.zeros((3, 1, sum(self._count)), np.float32)

    def add(self, values: npt.NDArray[Any], axes: Floats32, lift: Lift | None = None) -> None:
        """Add a channel (AH, AW) of the samples, times what it counts on each axis of colour, (1,) or (3,),
        in the light that copies are given.
        """
        if len(axes) > self._steps.shape[1]:
            self._steps = np.repeat(self._steps, len(axes), axis=1)
        parts = np.s_[: self._count[0]], np.s_[self._count[0] :]
        for axis, part in enumerate(parts):
            self._add((values, values), axes, np.s_[:1], part, lift)
            if len(axes) > 1:
                self._add(_sides(values, self._usable, axis), axes, np.s_[1:], part, lift)

    def _add(
        self,
        sides: tuple[npt.NDArray[Any], npt.NDArray[Any]],
        axes: Floats32,
        chosen: slice,
        part: slice,
        lift: Lift | None,
    ) -> None:
        """Add a channel to some axes of some joints, given what there is up to each pixel, and from it on."""
        first, second, p, q, ahead, behind = (one[part] for one in self._places)
        to, on = (side.reshape(-1) for side in sides)
        here, onward, there, back = (
            side.take(one).astype(np.float32) for side, one in ((to, p), (on, ahead), (on, q), (to, behind))
        )
        if lift is not None:
            gain, offset = np.broadcast_to(lift.gain, lift.offset.shape), lift.offset
            for place, both in ((first, (here, onward)), (second, (there, back))):
                for one in both:
                    one *= _taken(gain, place)
                    one += _taken(offset, place)
        weights = axes[chosen, np.newaxis]
        for total, one, two in zip(self._steps, (here, here, back), (there, onward, there), strict=True):
            total[chosen, part] += weights * (one - two)

    def add_all(self, plane: npt.NDArray[Any], white: float) -> None:
        """Add all channels of the samples (AH, AW, C) as they are."""
        for channel, axes in enumerate(_axes_of(plane) / np.float32(white)):
            self.add(plane[..., channel], axes)

    def lit(
        self, lift: Callable[[int], Lift], plane: npt.NDArray[Any], white: float
    ) -> Callable[[int], Lift]:
        """Make a function that gives a channel its light as another one does, and adds it."""

        def light(channel: int) -> Lift:
            given = lift(channel)
            self.add(plane[..., channel], _axes_of(plane)[channel] / np.float32(white), given)
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
        visible = _visible(*self._steps.swapaxes(1, 2))
        first, _, *sources = self._places
        seen, cutting = first[visible], 0
        if objects is not None:
            p, q = (objects.ravel().take(one) for one in sources[:2])
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


def _axes_of(plane: npt.NDArray[Any]) -> Floats32:
    """Return what each channel of a plane (H, W, C) counts on each axis of colour, (C, 1 or 3)."""
    count = plane.shape[2]
    return _AXES.T if count == len(_AXES) else np.full((count, 1), 1 / count, np.float32)


def _visible(at: Floats32, before: Floats32, after: Floats32) -> Mask:
    """Find the steps that are seen among others, all (…, 1 or 3): brightness, and colour if there is any."""
    bright = np.abs(at[..., 0]) - np.maximum(np.abs(before[..., 0]), np.abs(after[..., 0]))
    found: Mask = bright > _VISIBLE
    if at.shape[-1] > 1:
        coloured, *own = (np.linalg.norm(one[..., 1:], axis=-1) for one in (at, before, after))
        found |= coloured - np.maximum(*own) > _TOLD_APART
    return found


def _sides(values: npt.NDArray[Any], usable: Mask, axis: int) -> tuple[Floats32, Floats32]:
    """Average the usable pixels (H, W) up to each one, and from each one on, along an axis."""
    there = usable.astype(np.float32)
    filled = np.where(usable, values, 0).astype(np.float32)

    def mean(origin: int) -> Floats32:
        total, count = (
            ndimage.uniform_filter1d(one, _REACH, axis, mode="constant", origin=origin)
            for one in (filled, there)
        )
        result: Floats32 = total / np.maximum(count, 0.5 / _REACH)
        return result

    return mean((_REACH - 1) // 2), mean(-(_REACH // 2))


def busyness(values: Floats32, usable: Mask) -> float:
    """Compute the share of a sample's pixels (H, W, C), in shares of white, with steps that would be visible
    joints.
    """
    middle = middle_of(usable)
    shown, usable = np.moveaxis(values[middle] @ _axes_of(values), 2, 0), usable[middle]
    shares = []
    for axis, there in enumerate((usable, usable.T)):
        sides = [(shown[0], shown[0]), *(_sides(one, usable, axis) for one in shown[1:])]
        steps = np.stack(
            [np.moveaxis(one, axis, 0)[:-1] - np.moveaxis(two, axis, 0)[1:] for one, two in sides], axis=2
        )
        known = there[:-3] & there[1:-2] & there[2:-1] & there[3:]
        high = _visible(steps[1:-1], steps[:-2], steps[2:])
        shares.append(np.count_nonzero(high & known) / max(int(np.count_nonzero(known)), 1))
    return float(np.mean(shares))


def middle_of(usable: Mask) -> tuple[slice, slice]:
    """Select the rows and columns of a sample in which its own steps are counted."""
    rows, columns = (
        slice(max(length - _MEASURED_SIDE, 0) // 2, (length + min(length, _MEASURED_SIDE)) // 2)
        for length in usable.shape
    )
    return rows, columns
