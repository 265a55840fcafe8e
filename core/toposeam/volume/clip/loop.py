"""`loop`: make a clip whose end runs into its beginning."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask
from toposeam.checks import Seed, check_choice, check_function, check_kind, check_pair, check_whole, seed_of
from toposeam.errors import ImageError, OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.images import MAX_PIXELS, as_mask
from toposeam.seam.problem.match_cost import MatchCost, check_no_reach, match_options
from toposeam.sentence import counted
from toposeam.volume.clip.frames import ClipFrames, as_clip, reduced_shares
from toposeam.volume.clip.levelling import remove_light_difference
from toposeam.volume.clip.period import Jump, good_jumps, moving_weights, small_mask
from toposeam.volume.clip.result import Light, Loop, white_of
from toposeam.volume.clip.steady import steadied
from toposeam.volume.clip.survey import Survey, survey_of
from toposeam.volume.clip.trial import Stretches, Trial, light_of, most_visible, stretches_of
from toposeam.volume.clip.verdict import LoopVerdict, camera_motion
from toposeam.volume.clip.walk import closed_walk
from toposeam.volume.find import find_surface
from toposeam.volume.heat.method import SurfaceKeywords, SurfaceOptions
from toposeam.volume.problem.posing import check_spacing
from toposeam.volume.surface import Surface

#: Least number of frames of a clip, and largest default number of those of a transition.
_LEAST_FRAMES, _MAX_DEFAULT_TRANSITION = 4, 24
#: Voxels, about, of a transition on whose squares the surface is found.
_WORKING_VOXELS = 1_500_000
#: Gap between cost and bound at which the search for a surface ends, unless options are given.
_TOLERANCE = 0.01
#: Number of jumps among which a grown clip chooses.
_JUMPS = 12
#: Share of the progress that reading the clip takes.
_SURVEY_SHARE = 0.3
#: Share of the progress that measuring the camera takes.
_STEADY_SHARE = 0.3


def loop(
    frames: npt.ArrayLike,
    *,
    length: int | tuple[int, int] | None = None,
    start: int | None = None,
    transition: int | None = None,
    level: bool | None = None,
    still: npt.ArrayLike | None = None,
    stabilise: bool = False,
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
    so that every pixel changes from one to the other when it shows least. Nothing is blended. Of a clip with
    cuts the longest shot is taken. Of large frames the surface is found on reduced ones.

    Parameters
    ----------
    frames : (T, H, W) or (T, H, W, C) array_like
        The clip. Arrays that are not NumPy's, but have a shape, a dtype and slices, are read part by part:
        once from end to end, then the stretches that are joined, and what a loop shows when it is painted.
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
    stabilise : bool
        Take the shift and the turn of a trembling camera out of the longest shot first, and crop the frames
        to what all of them show. `still` is of the frames' size before.
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
    clip, flat = as_clip(frames)
    count = clip.count
    if count < _LEAST_FRAMES:
        raise ImageError(
            "the clip has {frames}; a loop needs at least {least}",
            kind="count",
            parameter=Term("frames"),
            frames=counted(count, "frame"),
            count=count,
            least=_LEAST_FRAMES,
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
    check_choice("stabilise", stabilise, (True, False))
    taken = None
    if stabilise:
        clip, moving, taken = _steady(clip, moving, data_range, _progress_part(progress, 0, _STEADY_SHARE))
        progress = _progress_part(progress, _STEADY_SHARE, 1 - _STEADY_SHARE)
    _check_moving(moving)
    if cost is not None:
        check_kind("cost", cost, MatchCost, "a MatchCost")
    match = check_no_reach(match_options(gradient, cost), "surfaces")
    chosen = seed_of(seed)
    spacing = check_spacing(spacing)
    if start is not None:
        check_whole("start", start, 0, count - 1)
    side = _working_side(clip.shape, _transition(transition, count, length, "the clip"))
    whole = survey_of(clip, side, data_range, _progress_part(progress, 0, _SURVEY_SHARE))
    shot = _shot(whole, start)
    survey = whole.part(*shot)
    count = shot[1] - shot[0]
    named = "the clip" if count == clip.count else f"the shot of frames {shot[0]} to {shot[1] - 1}"
    transition = _transition(transition, count, length, named)
    trial = Trial(survey=survey, transition=transition, moving=moving, cost=match, spacing=spacing)
    longer: Jump | None = None
    with one_thread():
        if grow is None:
            first = None if start is None else start - shot[0]
            bounds = _bounds(length, first, transition, count, named)
            jump, level, longer = trial.choose(*bounds, level)
            walk = [jump]
        else:
            _check_grown(check_whole("grow", grow, 2 * transition, 10**7), clip)
            found = good_jumps(survey.small, transition, trial.compared, match, spacing, _JUMPS)
            walk = closed_walk(found, transition, grow, np.random.default_rng(chosen))
            level = trial.shows(walk[0]) > 1 if level is None else level
    settings = {
        "length": length,
        "start": start,
        "transition": transition,
        "stabilise": stabilise,
        "grow": grow,
        "seed": chosen,
        "spacing": spacing,
        "level": level,
        **dataclasses.asdict(match),
    }
    if options is None and "tolerance" not in given:
        given["tolerance"] = _TOLERANCE
    part = ClipFrames(clip.array, shot[0], count)
    on = _working_mask(moving, side)
    distinct = list(dict.fromkeys(walk))
    stretches: dict[Jump, Stretches] = {}
    surfaces: dict[Jump, Surface] = {}
    for place, jump in enumerate(distinct):
        stretches[jump] = stretches_of(
            lambda first, last: _reduced(part, first, last, side, data_range), jump, transition, count
        )
        a, b = stretches[jump].left, stretches[jump].entered
        surfaces[jump] = find_surface(
            *(remove_light_difference(a, b) if level else (a, b)),
            cost=match,
            spacing=spacing,
            weight=None if still is None else np.broadcast_to(moving_weights(on), a.shape[:3]),
            data_range=1.0,
            options=options,
            progress=_progress_part(
                progress,
                _SURVEY_SHARE + (1 - _SURVEY_SHARE) * place / len(distinct),
                (1 - _SURVEY_SHARE) / len(distinct),
            ),
            **given,
        )
    labels = {jump: surface.labels for jump, surface in surfaces.items()}
    light = light_of(walk, stretches, labels, on) if level else None
    shows, frame, where = most_visible(walk, stretches, labels, on, light, (survey.low, survey.high), survey)
    made = Loop(
        jumps=tuple(jump.later(shot[0]) for jump in walk),
        longer=longer,
        surfaces=tuple(surfaces[jump] for jump in walk),
        side=side,
        transition=transition,
        shot=shot,
        verdict=LoopVerdict(
            shows=shows,
            frame=frame,
            where=(int(where[1] * clip.shape[2]), int(where[0] * clip.shape[1])),
            moved=camera_motion(survey, (clip.shape[1], clip.shape[2])),
        ),
        settings=settings,
        steadied=taken,
        _clip=clip,
        _flat=flat,
        _light=None
        if light is None
        else Light(
            added=light[0],
            side=light[1] * side,
            low=survey.low,
            high=survey.high,
            range_side=side,
            white=white_of(clip.dtype, data_range),
        ),
    )
    if still is None:
        return made
    used = np.unique(made.source) - shot[0]
    return dataclasses.replace(made, _moving=moving, _still_frame=shot[0] + trial.still_frame(used.tolist()))


def _check_moving(moving: Mask) -> None:
    if not moving.any():
        raise OptionError(
            "{parameter} covers the whole picture; leave something that moves",
            kind="nothing moves",
            parameter=Term("still"),
        )


def _steady(
    clip: ClipFrames, moving: Mask, data_range: float | None, progress: Callable[[float], None] | None
) -> tuple[ClipFrames, Mask, tuple[float, float, float] | None]:
    """Take the motion of the camera out of a clip; return it, its mask, and the ranges of the motion."""
    steady = steadied(clip, data_range, progress)
    if steady is None:
        return clip, moving, None
    return ClipFrames(steady, 0, clip.count), steady.cropped(moving), steady.ranges


def _check_grown(grow: int, clip: ClipFrames) -> None:
    if grow * math.prod(clip.shape[1:]) > MAX_PIXELS:
        raise OptionError(
            "{parameter} is {value}, which makes more than {most} million values of this "
            "clip; ask for fewer frames, or give a smaller clip",
            kind="too large",
            parameter=Term("grow"),
            value=grow,
            most=MAX_PIXELS // 10**6,
        )


def _progress_part(
    progress: Callable[[float], None] | None, begin: float, length: float
) -> Callable[[float], None] | None:
    return None if progress is None else lambda share: progress(begin + length * share)


def _working_side(shape: tuple[int, int, int, int], transition: int) -> int:
    """Return the side of the squares on which surfaces are found."""
    _, height, width, _ = shape
    return min(max(1, math.ceil(math.sqrt(transition * height * width / _WORKING_VOXELS))), height, width)


def _working_mask(moving: Mask, side: int) -> Mask:
    mask = small_mask(moving, (moving.shape[0] // side, moving.shape[1] // side))
    return mask if mask.any() else np.ones_like(mask)


def _reduced(clip: ClipFrames, first: int, last: int, side: int, data_range: float | None) -> Floats32:
    """Read frames reduced to the working size."""
    return np.concatenate([reduced_shares(frames, side, data_range) for frames in clip.parts(first, last)])


def _shot(survey: Survey, start: int | None) -> tuple[int, int]:
    """Choose the shot in which the loop stays: the longest one, or that of the first frame."""
    shots = survey.shots()
    if start is not None:
        return next(shot for shot in shots if shot[0] <= start < shot[1])
    shot = max(shots, key=lambda shot: shot[1] - shot[0])
    if shot[1] - shot[0] < _LEAST_FRAMES:
        raise ImageError(
            "the longest shot of the clip, between cuts, has {frames}; a loop needs at least {least}",
            kind="count",
            parameter=Term("frames"),
            frames=counted(shot[1] - shot[0], "frame"),
            count=shot[1] - shot[0],
            least=_LEAST_FRAMES,
        )
    return shot


def _transition(transition: int | None, count: int, length: int | tuple[int, int] | None, named: str) -> int:
    if transition is None:
        longest = length[-1] if isinstance(length, tuple | list) and length else length
        if not isinstance(longest, int):
            longest = count
        return max(2, min(_MAX_DEFAULT_TRANSITION, count // 4, longest // 2))
    check_whole("transition", transition, 2)
    if 2 * transition > count:
        raise OptionError(
            "{parameter} is {transition} frames, and {clip} has {count}: end and beginning "
            "would be the same frames; use at most {most}",
            kind="long transition",
            parameter=Term("transition"),
            value=transition,
            transition=transition,
            clip=named,
            count=count,
            most=count // 2,
        )
    return transition


def _bounds(
    length: int | tuple[int, int] | None, start: int | None, transition: int, count: int, named: str
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
            "{clip} has {count} frames; from its frame {first} on a loop of {length} and a "
            "transition of {transition} do not fit: use a length of at most {most}, or a "
            "shorter transition",
            kind="short clip",
            clip=named,
            count=count,
            first=first,
            length=lengths[0],
            transition=transition,
            most=room,
        )
    lengths = max(lengths[0], transition), min(lengths[1], room)
    return lengths, ((0, count) if start is None else (start, start))
