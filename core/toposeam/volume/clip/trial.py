"""Trials of loops on reduced frames: which jumps, levelled or not, and how much shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.volume.clip.frames import enlarged, reduced_shares
from toposeam.volume.clip.levelling import levelling, within
from toposeam.volume.clip.period import Jump, likely_jumps, small_mask, small_surface
from toposeam.volume.clip.survey import Survey
from toposeam.volume.clip.verdict import Transition, judged
from toposeam.volume.clip.walk import walk_length

#: Values of the light that levels a loop, in one channel; on larger loops it is found on larger squares.
_MOST_LIGHT = 1.6e7
#: Least length of a loop that is offered, as a multiple of the chosen one's; number of those that are tried.
_LONGER, _OFFERS = 1.25, 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretches:
    """The two stretches of a jump, on reduced frames, as shares of white."""

    #: (D, h, w, C): the stretch that is left and the one that is entered.
    left: Floats32
    entered: Floats32
    #: (h, w, C): the frame before the first one, and the one after the other one.
    before: Floats32
    after: Floats32


def stretches_of(read: Callable[[int, int], Floats32], jump: Jump, transition: int, count: int) -> Stretches:
    """Read the stretches of a jump from a clip of `count` frames."""
    begin, end = max(jump.leaves - 1, 0), min(jump.enters + transition + 1, count)
    left, entered = read(begin, jump.leaves + transition), read(jump.enters, end)
    return Stretches(left=left[-transition:], entered=entered[:transition], before=left[0], after=entered[-1])


def light_of(
    walk: Sequence[Jump],
    stretches: Mapping[Jump, Stretches],
    labels: Mapping[Jump, Mask],
    moving: Mask,
) -> tuple[Floats32, int]:
    """Compute the light that levels a loop, (P, h, w, C), and the side of its squares on these frames."""
    frames = walk_length(walk)
    side = max(1, math.ceil(math.sqrt(frames * moving.size / _MOST_LIGHT)))
    side = min(side, *moving.shape)
    at, changes = 0, []
    for place, jump in enumerate(walk):
        found = stretches[jump]
        apart = reduced_shares(found.entered, side, None) - reduced_shares(found.left, side, None)
        changes.append((at, apart, _reduced_mask(labels[jump], side)))
        at += walk[(place + 1) % len(walk)].leaves - jump.enters
    return levelling(changes, frames, _reduced_mask(moving[np.newaxis], side)[0]), side


def most_visible(
    walk: Sequence[Jump],
    stretches: Mapping[Jump, Stretches],
    labels: Mapping[Jump, Mask],
    moving: Mask,
    light: tuple[Floats32, int] | None,
    limits: tuple[Floats32, Floats32],
    survey: Survey,
) -> tuple[float, int, tuple[float, float]]:
    """Judge all transitions of a loop.

    Returns
    -------
    shows, frame, where
        As of :func:`toposeam.volume.clip.verdict.judged`, of the worst; the frame is the loop's.
    """
    at, worst = 0, (0.0, 0, (0.5, 0.5))
    seen: set[Jump] = set()
    for place, jump in enumerate(walk):
        if jump not in seen:
            seen.add(jump)
            found = stretches[jump]
            now = np.where(labels[jump][..., np.newaxis], found.entered, found.left)
            made = np.concatenate([found.before[np.newaxis], now, found.after[np.newaxis]])
            if light is not None:
                added, side = light
                for index, frame in enumerate(made):
                    extra = enlarged(added[(at - 1 + index) % len(added)], side, moving.shape)
                    made[index] += within(extra, frame, *limits)
            shown = Transition(
                made=made,
                left=found.left,
                entered=found.entered,
                labels=labels[jump],
                moving=moving,
                leaves=jump.leaves,
                enters=jump.enters,
            )
            shows, frame_number, where = judged(shown, survey)
            worst = max(worst, (shows, at + frame_number, where))
        at += walk[(place + 1) % len(walk)].leaves - jump.enters
    return worst


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """Trials of a clip's loops on frames of a middle size."""

    survey: Survey
    transition: int
    #: (H, W): False on pixels that stand still.
    moving: Mask
    cost: MatchCost
    spacing: Sequence[float]

    @cached_property
    def compared(self) -> Mask:
        """Pixels of small frames that count."""
        return self._mask(self.survey.small.shape[1:3])

    def choose(
        self, lengths: tuple[int, int], starts: tuple[int, int], level: bool | None
    ) -> tuple[Jump, bool, Jump | None]:
        """Choose a jump, and whether to level: the first likely one that will not be seen, else the best.

        Also returns the jump, in the clip, of a loop that is longer by a quarter, shows no more, and costs a
        little more; None if there is none.
        """
        likely, dear = likely_jumps(
            self.survey.small, self.transition, lengths, starts, self.compared, self.cost, self.spacing
        )
        if len(likely) == 1 and level is not None:
            return likely[0], level, None
        best = (np.inf, likely[0], bool(level))
        for jump in likely:
            labels = self._labels(jump)
            for levelled in (False, True) if level is None else (level,):
                shows = self._shows(jump, labels, levelled)
                if shows <= 1:
                    return jump, levelled, self._longer(jump, levelled, 1.0, dear)
                best = min(best, (shows, jump, levelled), key=lambda one: one[0])
        shows, jump, levelled = best
        return jump, levelled, self._longer(jump, levelled, shows, dear)

    def _longer(self, chosen: Jump, levelled: bool, shows: float, dear: Sequence[Jump]) -> Jump | None:
        """Find the longest jump that shows no more; some are tried."""
        longer = [jump for jump in dear if jump.period >= _LONGER * chosen.period][:_OFFERS]
        for jump in longer:
            if self._shows(jump, self._labels(jump), levelled) <= shows:
                return jump.later(self.survey.first)
        return None

    def shows(self, jump: Jump) -> float:
        """Return how much shows of a jump that is not levelled."""
        return self._shows(jump, self._labels(jump), False)

    def still_frame(self, used: Sequence[int]) -> int:
        """Find the frame for still pixels: it differs least from the moving pixels along their border."""
        border = ndimage.binary_dilation(~self.compared) & self.compared
        if not border.any():
            border = self.compared
        at_border = self.survey.small[list(used)][:, border]
        typical = np.median(at_border, axis=0)
        return int(used[int(np.abs(at_border - typical).mean(axis=(1, 2)).argmin())])

    def _mask(self, shape: tuple[int, ...]) -> Mask:
        mask = small_mask(self.moving, (shape[0], shape[1]))
        return mask if mask.any() else np.ones_like(mask)

    def _labels(self, jump: Jump) -> Mask:
        middle = self.survey.middle
        on = self._mask(middle.shape[1:3])
        return small_surface(middle, jump, self.transition, on, self.cost, self.spacing)[1]

    def _shows(self, jump: Jump, labels: Mask, levelled: bool) -> float:
        survey = self.survey
        middle = survey.middle
        on = self._mask(middle.shape[1:3])
        found = {
            jump: stretches_of(lambda first, last: middle[first:last], jump, self.transition, len(middle))
        }
        light = light_of([jump], found, {jump: labels}, on) if levelled else None
        low, high = (
            reduced_shares(values[np.newaxis], survey.middle_side, None)[0]
            for values in (survey.low, survey.high)
        )
        return most_visible([jump], found, {jump: labels}, on, light, (low, high), survey)[0]


def _reduced_mask(mask: Mask, side: int) -> Mask:
    """Reduce (D, h, w) masks: True where more than half of a square is."""
    if side == 1:
        return mask
    return reduced_shares(mask[..., np.newaxis].astype(np.float32), side, None)[..., 0] > 0.5
