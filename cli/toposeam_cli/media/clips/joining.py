"""Two clips that overlap in time and space, joined along a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import toposeam as ts
from toposeam.errors import ImageError
from toposeam.sentence import counted
from toposeam_cli.files.writing import all_or_nothing
from toposeam_cli.media.clips.clip import Clip
from toposeam_cli.media.clips.reading import most_loaded, read_clip
from toposeam_cli.media.clips.writing import check_clip_output, folder_for, write_clip
from toposeam_cli.media.pictures.picture import MAX_PIXELS

#: Distance between frames relative to that between pixels, as for loops: (t, y, x).
_SPACING = (0.7, 1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipJob:
    """Clips to join, and the options."""

    first: Path
    second: Path
    output: Path
    #: Offset of the second clip in the first: frames, px to the right, px down.
    offset: tuple[int, int, int]
    law: ts.typing.Law | None
    max_pixels: int
    force: bool


def join_clips(job: ClipJob, progress: Callable[[float], None] | None = None) -> str:
    """Join two clips and write the result; return a line about it.

    Raises
    ------
    ImageError
        When a clip cannot be read, or the clips differ in rate.
    OptionError, OverlapError
        When the output cannot be written, or the clips do not overlap.
    """
    check_clip_output(job.output, job.force)
    asked = None if job.max_pixels == MAX_PIXELS else job.max_pixels
    first, second = (read_clip(path, None, most_loaded(path, asked)) for path in (job.first, job.second))
    if first.rate != second.rate:
        raise ImageError(
            f"{job.first.name} has {float(first.rate):g} frames a second and {job.second.name} has "
            f"{float(second.rate):g}; convert one of them"
        )
    t, x, y = job.offset
    try:
        made = ts.volume(
            first.frames,
            second.frames,
            offset=(t, y, x),
            spacing=_SPACING,
            cost=None if job.law is None else ts.seam.MatchCost(law=job.law),
            cells=False,
            progress=progress,
        )
    except ts.OverlapError as error:
        raise ts.OverlapError(
            f"at offset {t},{x},{y} {job.first.name} ({_size(first.frames.shape)}) and {job.second.name} "
            f"({_size(second.frames.shape)}) have too little in common; check the offset: frames, x and y"
        ) from error
    with folder_for(job.output), all_or_nothing():
        write_clip(job.output, Clip(frames=made.volume, rate=first.rate), job.force)
    return f"{job.output}: {_size(made.places.canvas)}"


def _size(shape: tuple[int, ...]) -> str:
    count, height, width = shape[:3]
    return f"{counted(count, 'frame')} of {width} × {height} px"
