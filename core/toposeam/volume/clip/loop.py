"""`loop`: make a clip whose end runs into its beginning."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Mask, Volume
from toposeam.checks import Seed, check_choice, check_function, check_kind, check_pair, check_whole, seed_of
from toposeam.display import to_png
from toposeam.errors import ImageError, OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.images import MAX_PIXELS, as_mask
from toposeam.seam.problem.match_cost import MatchCost, check_no_reach, match_options
from toposeam.sentence import counted
from toposeam.volume.clip.levelling import level_loop, remove_light_difference
from toposeam.volume.clip.period import (
    Jump,
    best_jump,
    good_jumps,
    moving_weights,
    small_frames,
    small_mask,
    small_surface,
)
from toposeam.volume.clip.verdict import LoopVerdict, step_visibility, verdict_of, worst_squares
from toposeam.volume.clip.walk import closed_walk
from toposeam.volume.find import find_surface
from toposeam.volume.heat.method import SurfaceKeywords, SurfaceOptions
from toposeam.volume.problem.arrays import as_volume
from toposeam.volume.problem.posing import check_spacing
from toposeam.volume.surface import Surface

#: Largest number of frames of a clip: the time grows with its square.
_MAX_FRAMES = 10_000
#: Largest default number of frames of a transition.
_MAX_DEFAULT_TRANSITION = 24
#: Size, px, about, of the small frames on which the need for levelling is tested, and side of the squares.
_TEST_PIXELS, _TEST_SQUARE = 4000, 4
#: Least visibility of steps in the worst squares from which a loop is levelled without further trial.
_VISIBLE_STEPS = 3.0
#: Number of jumps among which a grown clip chooses.
_JUMPS = 12


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

    #: (P, H, W) or (P, H, W, C), of the given clip's dtype; the last frame runs into the first.
    frames: Volume = field(repr=False)
    #: (P, H, W) int32: number of the given clip's frame from which each pixel comes.
    source: npt.NDArray[np.int32] = field(repr=False)
    #: The jumps back (and forth) in order; a plain loop has one.
    jumps: tuple[Jump, ...]
    #: The surface of each jump, along which pixels change from one stretch to the other; axis 0 is time.
    surfaces: tuple[Surface, ...] = field(repr=False)
    #: Number of frames of the transition at each jump.
    transition: int
    #: Visibility of the changes.
    verdict: LoopVerdict
    #: The settings that make the loop again.
    settings: dict[str, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        count, height, width = self.source.shape
        return f"Loop({count} frames of {width} × {height} px, from frame {self.start}, cost {self.cost:.6g})"

    def _repr_png_(self) -> bytes:
        """Return six frames side by side, for notebooks."""
        chosen = np.linspace(0, len(self.frames), 6, endpoint=False).astype(int)
        strip: npt.NDArray[Any] = np.concatenate(list(self.frames[chosen]), axis=1)
        return to_png(strip)

    @property
    def start(self) -> int:
        """Number of the given clip's frame that the first jump enters."""
        return self.jumps[0].enters

    @property
    def cost(self) -> float:
        """Σ M over all surfaces."""
        return sum(surface.cost for surface in self.surfaces)


def loop(
    frames: npt.ArrayLike,
    *,
    length: int | tuple[int, int] | None = None,
    start: int | None = None,
    transition: int | None = None,
    level: bool | None = None,
    still: npt.ArrayLike | None = None,
    grow: int | None = None,
    seed: Seed = 0,
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    spacing: Sequence[float] = (0.7, 1.0, 1.0),
    data_range: float | None = None,
    options: SurfaceOptions | None = None,
    progress: Callable[[float], None] | None = None,
    **given: Unpack[SurfaceKeywords],
) -> Loop:
    """Make a clip repeat without a visible jump.

    The function finds two similar moments and joins the stretches at them along a surface in time and space,
    so that every pixel changes from one to the other when it shows least. Nothing is blended.

    Parameters
    ----------
    frames : (T, H, W) or (T, H, W, C) array_like
        The clip.
    length : int or (int, int), optional
        Number of frames that repeat, or its least and greatest value; by default from a third of the clip to
        the largest number that leaves room for the transition.
    start : int, optional
        Number of the frame with which the loop begins; searched for by default.
    transition : int, optional
        Number of frames within which pixels change, at least 2; by default a quarter of the clip or half the
        loop, at most 24. The clip needs ``start + length + transition`` frames.
    level : bool, optional
        Level visible differences of light and form. Slow light is removed before the search for the surface,
        and the steps along it are spread over the frames and pixels around, by Poisson's equation in time and
        space. The wider a step, the more gradual it becomes; a step of the whole picture is spread over the
        whole loop. Values then differ from the clip's. By default a loop is levelled if it would show less.
    still : (H, W) array_like, optional
        True where the picture stands still (a cinemagraph). There the loop shows the frame that fits its
        surroundings best.
    grow : int, optional
        Least number of frames of a grown clip, instead of `length` and `start`. It jumps back and forth
        between similar moments, in an order drawn by `seed`.
    seed : int, Generator or None
        Seed of the order of jumps.
    spacing : three positive floats
        Weight of a frame against the height and the width of a pixel. A lower weight makes it dearer that
        many pixels change at once, which is seen as a jump, and cheaper that neighbours change at different
        moments, which is seen as a tear.
    gradient, cost, data_range, options
        As for :func:`find_surface`.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Loop

    Raises
    ------
    ImageError, OptionError
        The text states the value received and a remedy.

    Examples
    --------
    A wheel that turns once in twelve frames:

    >>> import numpy as np, toposeam as ts
    >>> y, x = np.indices((16, 16)) - 7.5
    >>> turn = np.arctan2(y, x) - 2 * np.pi * np.arange(32)[:, None, None] / 12
    >>> wheel = ts.loop(0.5 + 0.5 * np.cos(turn))
    >>> len(wheel.frames) % 12, wheel.frames.shape[1:]
    (0, (16, 16))
    """
    check_function("progress", progress)
    clip = as_volume(frames, "frames")
    flat = np.ndim(frames) == 3
    count = len(clip)
    if count < 4:
        raise ImageError(
            "the clip has {frames}; a loop needs at least {least}",
            kind="count",
            parameter=Term("frames"),
            frames=counted(count, "frame"),
            count=count,
            least=4,
        )
    if count > _MAX_FRAMES:
        raise ImageError(
            "the clip has {count} frames, of which every one is compared with every other; cut it, or take "
            "fewer frames a second, so that at most {most} are left",
            kind="count",
            parameter=Term("frames"),
            count=count,
            most=_MAX_FRAMES,
        )
    check_choice("level", level, (True, False, None))
    if grow is not None and (length is not None or start is not None):
        raise OptionError(
            "{parameter} decides where the clip is left and entered; leave {length} and {start} out",
            kind="conflict",
            parameter=Term("grow"),
            value=grow,
        )
    moving = np.ones(clip.shape[1:3], bool)
    if still is not None:
        moving = ~as_mask(still, (clip.shape[1], clip.shape[2]), "still")
        if not moving.any():
            raise OptionError(
                "{parameter} covers the whole picture; leave something that moves",
                kind="nothing moves",
                parameter=Term("still"),
            )
    transition = _transition(transition, count, length)
    if cost is not None:
        check_kind("cost", cost, MatchCost, "a MatchCost")
    match = check_no_reach(match_options(gradient, cost), "surfaces")
    chosen = seed_of(seed)
    spacing = check_spacing(spacing)
    settings = {
        "length": length,
        "start": start,
        "transition": transition,
        "grow": grow,
        "seed": chosen,
        "spacing": spacing,
        **dataclasses.asdict(match),
    }
    small = small_frames(clip, data_range)
    compared = small_mask(moving, (small.shape[1], small.shape[2]))
    if not compared.any():
        compared[:] = True
    with one_thread():
        if grow is None:
            lengths, starts = _bounds(length, start, transition, count)
            walk = [best_jump(small, transition, lengths, starts, compared, match, spacing)]
        else:
            check_whole("grow", grow, 2 * transition, 10**7)
            if grow * clip[0].size > MAX_PIXELS:
                raise OptionError(
                    "{parameter} is {value}, which makes more than {most} million values of this "
                    "clip; ask for fewer frames, or give a smaller clip",
                    kind="too large",
                    parameter=Term("grow"),
                    value=grow,
                    most=MAX_PIXELS // 10**6,
                )
            found = good_jumps(small, transition, compared, match, spacing, _JUMPS)
            walk = closed_walk(found, transition, grow, np.random.default_rng(chosen))
    distinct = list(dict.fromkeys(walk))
    weight = None
    if still is not None:
        weight = np.broadcast_to(moving_weights(moving), (transition, *moving.shape))

    def joined(level: bool) -> Loop:
        surfaces: dict[Jump, Surface] = {}
        for place, jump in enumerate(distinct):
            a, b = (clip[first : first + transition] for first in (jump.leaves, jump.enters))
            surfaces[jump] = find_surface(
                *(remove_light_difference(a, b, data_range) if level else (a, b)),
                cost=match,
                spacing=spacing,
                weight=weight,
                data_range=data_range,
                options=options,
                progress=_progress_part(progress, place, len(distinct)),
                **given,
            )
        source = _sources(walk, surfaces, transition, moving.shape)
        if still is not None:
            source[:, ~moving] = _still_frame(small, source, compared)
        made = np.take_along_axis(clip, source[..., np.newaxis].astype(np.intp), axis=0)
        labels = {jump: surface.labels for jump, surface in surfaces.items()}
        if level:
            made = level_loop(made, clip, walk, labels, transition, moving)
        return Loop(
            frames=made[..., 0] if flat else made,
            source=source,
            jumps=tuple(walk),
            surfaces=tuple(surfaces[jump] for jump in walk),
            transition=transition,
            verdict=verdict_of(made, clip, walk, labels, moving, data_range),
            settings={**settings, "level": level},
        )

    if level is not None:
        return joined(level)
    if _would_show(clip, distinct, transition, moving, match, spacing, data_range):
        return joined(True)
    made = joined(False)
    if made.verdict.unseen:
        return made
    return min(made, joined(True), key=lambda one: one.verdict.shows)


def _progress_part(
    progress: Callable[[float], None] | None, place: int, count: int
) -> Callable[[float], None] | None:
    return None if progress is None else lambda share: progress((place + share) / count)


def _would_show(
    clip: Volume,
    jumps: Sequence[Jump],
    transition: int,
    moving: Mask,
    match: MatchCost,
    spacing: Sequence[float],
    data_range: float | None,
) -> bool:
    """Return whether surfaces without levelling would show, tested on small frames."""
    small = small_frames(clip, data_range, _TEST_PIXELS)
    on = small_mask(moving, (small.shape[1], small.shape[2]))
    if not on.any():
        return False
    with one_thread():
        for jump in jumps:
            _, labels = small_surface(small, jump, transition, on, match, spacing)
            a, b = (small[first : first + transition] for first in (jump.leaves, jump.enters))
            made = np.where(labels[..., np.newaxis], b, a)
            if worst_squares(step_visibility(made, a, b), _TEST_SQUARE, on).max() > _VISIBLE_STEPS:
                return True
    return False


def _transition(transition: int | None, count: int, length: int | tuple[int, int] | None) -> int:
    if transition is None:
        longest = length[-1] if isinstance(length, tuple | list) and length else length
        if not isinstance(longest, int):
            longest = count
        return max(2, min(_MAX_DEFAULT_TRANSITION, count // 4, longest // 2))
    check_whole("transition", transition, 2)
    if 2 * transition > count:
        raise OptionError(
            "{parameter} is {transition} frames, and the clip has {count}: end and beginning "
            "would be the same frames; use at most {most}",
            kind="long transition",
            parameter=Term("transition"),
            value=transition,
            transition=transition,
            count=count,
            most=count // 2,
        )
    return transition


def _bounds(
    length: int | tuple[int, int] | None, start: int | None, transition: int, count: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the least and greatest period, and the least and greatest first frame."""
    first = 0 if start is None else check_whole("start", start, 0, count - 1)
    room = count - transition - first
    if length is None:
        lengths = min(max(transition, count // 3), room), room
    elif isinstance(length, tuple | list):
        lengths = check_pair("length", length, 1)
        if lengths[0] > lengths[1]:
            raise OptionError(
                "{parameter} is {value!r}; write the least number of frames first",
                kind="number",
                parameter=Term("length"),
                value=length,
            )
    else:
        lengths = (check_whole("length", length, 1),) * 2
    if lengths[1] < transition or room < transition:
        raise OptionError(
            "a loop of at most {most} frames is shorter than its transition of {transition}; "
            "use a shorter transition, or a longer length",
            kind="short loop",
            most=min(lengths[1], max(room, 0)),
            transition=transition,
        )
    if lengths[0] > room:
        raise OptionError(
            "the clip has {count} frames; from frame {first} on a loop of {length} and a "
            "transition of {transition} do not fit: use a length of at most {most}, or a "
            "shorter transition",
            kind="short clip",
            count=count,
            first=first,
            length=lengths[0],
            transition=transition,
            most=room,
        )
    lengths = max(lengths[0], transition), min(lengths[1], room)
    return lengths, ((0, count) if start is None else (start, start))


def _sources(
    walk: list[Jump], surfaces: dict[Jump, Surface], transition: int, shape: tuple[int, ...]
) -> npt.NDArray[np.int32]:
    """Return the number of the clip's frame for every pixel of the loop, (P, H, W).

    Each jump is followed by its transition, then by the clip until the next jump.
    """
    parts = []
    step = np.arange(transition, dtype=np.int32)[:, np.newaxis, np.newaxis]
    for jump, after in zip(walk, [*walk[1:], walk[0]], strict=True):
        parts.append(np.where(surfaces[jump].labels, jump.enters + step, jump.leaves + step).astype(np.int32))
        plain = np.arange(jump.enters + transition, after.leaves, dtype=np.int32)
        parts.append(np.broadcast_to(plain[:, np.newaxis, np.newaxis], (len(plain), *shape)))
    return np.concatenate(parts)


def _still_frame(small: Floats32, source: npt.NDArray[np.int32], moving: Mask) -> int:
    """Find the frame for still pixels: it differs least from the moving pixels along their border."""
    border = ndimage.binary_dilation(~moving) & moving
    if not border.any():
        border = moving
    used = np.unique(source)
    at_border = small[used][:, border]
    typical = np.median(at_border, axis=0)
    return int(used[np.abs(at_border - typical).mean(axis=(1, 2)).argmin()])
