"""The loop: which frames, and where each pixel changes from one stretch to another; painted when asked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask, Volume
from toposeam.display import to_png
from toposeam.images import full_scale, in_dtype
from toposeam.volume.clip.frames import ClipFrames, enlarged, reduced_shares
from toposeam.volume.clip.levelling import within
from toposeam.volume.clip.period import Jump
from toposeam.volume.clip.verdict import LoopVerdict
from toposeam.volume.clip.walk import walk_length
from toposeam.volume.surface import Surface

#: Change of light, as a share of a step of 8 bits, that is not worth adding.
_LEAST_CHANGE = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Light:
    """Light that levels a loop, on frames reduced by means over squares."""

    #: (P, h, w, C): what is added, as shares of white; and the side of its squares, px.
    added: Floats32
    side: int
    #: (h, w, C): least and greatest share of white at every place of the clip; and the side of its squares.
    low: Floats32
    high: Floats32
    range_side: int
    #: The value that is white.
    white: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """A clip that repeats.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> frames = np.random.default_rng(0).random((16, 8, 8))
    >>> made = ts.loop(frames, length=8, transition=2)
    >>> made.frames.shape, made.source.shape
    ((8, 8, 8), (8, 8, 8))
    """

    #: The jumps back (and forth) in order; a plain loop has one.
    jumps: tuple[Jump, ...]
    #: The jump of a longer loop that shows no more and costs a little more; None if there is none.
    longer: Jump | None = None
    #: The surface of each jump, along which pixels change from one stretch to the other; axis 0 is time. Of
    #: large frames it is found on squares of `side` px.
    surfaces: tuple[Surface, ...] = field(repr=False)
    side: int = 1
    #: Number of frames of the transition at each jump.
    transition: int
    #: First frame of the shot in which the loop stays, and the first one after it.
    shot: tuple[int, int]
    #: Visibility of the changes.
    verdict: LoopVerdict
    #: Ranges of the camera's motion that was taken out, px across and down, and degrees; None if none was.
    steadied: tuple[float, float, float] | None = None
    #: The settings that make the loop again.
    settings: dict[str, Any] = field(default_factory=dict, repr=False)
    _clip: ClipFrames = field(repr=False)
    _flat: bool = field(repr=False)
    _moving: Mask | None = field(default=None, repr=False)
    _still_frame: int = field(default=0, repr=False)
    _light: Light | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        _, height, width, _ = self._clip.shape
        size = f"{len(self)} frames of {width} × {height} px"
        return f"Loop({size}, from frame {self.start}, cost {self.cost:.6g})"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Volume:
        """Return all frames, for NumPy."""
        return np.array(self.frames, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        """Return six frames side by side, for notebooks."""
        chosen = np.linspace(0, len(self), 6, endpoint=False).astype(int)
        strip: npt.NDArray[Any] = np.concatenate(list(self.frames[chosen]), axis=1)
        return to_png(strip)

    def __len__(self) -> int:
        """Number of frames."""
        return walk_length(self.jumps)

    def __iter__(self) -> Iterator[Volume]:
        """Paint frame after frame."""
        return (frame for block in self.blocks() for frame in block)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the frames, px."""
        return self._clip.shape[1:3]

    @property
    def start(self) -> int:
        """Number of the given clip's frame that the first jump enters."""
        return self.jumps[0].enters

    @property
    def cost(self) -> float:
        """Σ M over all surfaces."""
        return sum(surface.cost for surface in self.surfaces)

    @cached_property
    def frames(self) -> Volume:
        """(P, H, W) or (P, H, W, C), of the given clip's dtype; the last frame runs into the first."""
        return np.concatenate(list(self.blocks()))

    @cached_property
    def source(self) -> npt.NDArray[np.int32]:
        """(P, H, W): number of the given clip's frame from which each pixel comes."""
        shape = self._clip.shape[1:3]
        parts = []
        step = np.arange(self.transition, dtype=np.int32)[:, np.newaxis, np.newaxis]
        for place, first, last in self._plan():
            if place is None:
                plain = np.arange(first, last, dtype=np.int32)[:, np.newaxis, np.newaxis]
                parts.append(np.broadcast_to(plain, (len(plain), *shape)))
            else:
                parts.append(np.where(self._labels(place), last + step, first + step).astype(np.int32))
        source: npt.NDArray[np.int32] = np.concatenate(parts)
        if self._moving is not None:
            source[:, ~self._moving] = self._still_frame
        return source

    def blocks(self) -> Iterator[Volume]:
        """Paint the loop's frames in turn, some at a time: a loop may be larger than memory."""
        at, light = 0, self._light
        ranges = None if light is None else self._ranges(light)
        still = None if self._moving is None else self._clip.part(self._still_frame, self._still_frame + 1)
        for place, first, last in self._plan():
            found = self._plain(first, last) if place is None else self._changing(place, first, last)
            for pixels, labels in found:
                painted = pixels
                if light is not None and ranges is not None:
                    shown = [None] * len(pixels) if labels is None else list(labels)
                    lit = [
                        self._lit(one, at + index, light, ranges, shown[index])
                        for index, one in enumerate(pixels)
                    ]
                    painted = np.stack(lit)
                if still is not None and self._moving is not None:
                    painted = np.where(self._moving[..., np.newaxis], painted, still)
                at += len(pixels)
                yield painted[..., 0] if self._flat else painted

    def _plan(self) -> Iterator[tuple[int | None, int, int]]:
        """Yield transitions, as the number of the jump and the first frames of both stretches, and plain
        stretches, as None, the first frame and the one after the last.
        """
        for place, jump in enumerate(self.jumps):
            after = self.jumps[(place + 1) % len(self.jumps)]
            yield place, jump.leaves, jump.enters
            yield None, jump.enters + self.transition, after.leaves

    def _labels(self, place: int) -> Mask:
        """Return where the entered stretch of a jump shows, (D, H, W)."""
        labels = self.surfaces[place].labels
        if self.side == 1:
            return labels
        shape = self._clip.shape[1:3]
        return np.stack([enlarged(label.astype(np.float32), self.side, shape) > 0.5 for label in labels])

    def _plain(self, first: int, last: int) -> Iterator[tuple[Volume, None]]:
        """Return frames of the clip."""
        return ((pixels, None) for pixels in self._clip.parts(first, last))

    def _changing(self, place: int, leaves: int, enters: int) -> Iterator[tuple[Volume, Mask]]:
        """Paint a transition; also return where the entered stretch shows."""
        left, entered = (self._clip.part(first, first + self.transition) for first in (leaves, enters))
        labels = self._labels(place)
        for start, stop in self._clip.ranges(0, self.transition):
            part = slice(start, stop)
            yield np.where(labels[part, ..., np.newaxis], entered[part], left[part]), labels[part]

    def _ranges(self, light: Light) -> tuple[Floats32, Floats32]:
        """Return the least and greatest values of light at every pixel."""
        shape = self._clip.shape[1:3]
        low, high = (
            enlarged(values, light.range_side, shape) * np.float32(light.white)
            for values in (light.low, light.high)
        )
        return low, high

    @staticmethod
    def _lit(
        frame: Volume, at: int, light: Light, ranges: tuple[Floats32, Floats32], label: Mask | None
    ) -> Volume:
        """Add light to a frame. Where two stretches meet, each has light of its own."""
        added, side = light.added[at], light.side
        if np.abs(added).max(initial=0) * 255 < _LEAST_CHANGE and frame.dtype == np.uint8:
            return frame
        shape = (frame.shape[0], frame.shape[1])
        change = enlarged(added, side, shape)
        if label is not None and side > 1 and label.any() and not label.all():
            there = reduced_shares(label[np.newaxis, ..., np.newaxis].astype(np.float32), side, None)[0]
            for shown, weight in ((label, there), (~label, 1 - there)):
                # Squares that have both stretches count for each by its share.
                share = enlarged(weight, side, shape)
                own = enlarged(added * weight, side, shape) / np.maximum(share, 1e-3)
                change = np.where(shown[..., np.newaxis] & (share > 1e-3), own, change)
        change = within(change * np.float32(light.white), frame, *ranges)
        return add_change(frame, change)


def add_change(values: Volume, change: npt.NDArray[np.floating]) -> Volume:
    """Add a change to values, in the values' dtype."""
    sums: Volume = values + change
    return sums > 0.5 if values.dtype.kind == "b" else in_dtype(sums, values.dtype)


def white_of(dtype: np.dtype[Any], data_range: float | None) -> float:
    """Return the value that is white."""
    return float(full_scale(dtype)) if data_range is None else data_range
