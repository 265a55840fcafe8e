"""The growth of a motif as an animation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

import toposeam as ts
from toposeam.motif.animation import Animation, animate
from toposeam.motif.ink.mixing import mix
from toposeam.motif.motif import Motif
from toposeam.motif.recipe.recipe import Recipe
from toposeam_cli.files.writing import atomic_write, check_output
from toposeam_cli.media.clips.clip import Clip
from toposeam_cli.media.clips.writing import SUFFIXES, check_clip_output, write_clip
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.motifs.print_options import drawing_options
from toposeam_cli.motifs.printing import Print, sheet_coverage

#: Frames per second, and how long the finished motif stands still, s.
_RATE, _PAUSE = 24, 1.5
#: Frames of a growth, and of one that is drawn, whose file has the curves of all.
_FRAMES, _DRAWN_FRAMES = 72, 36
#: Largest animation, px in all frames.
_LARGEST_PX = 2_000_000_000


def check_growth(path: Path | None, frames: int | None, force: bool) -> None:
    """Refuse an animation that cannot be written, before any work.

    Raises
    ------
    OptionError, MissingPackageError
    """
    if path is None:
        if frames is not None:
            raise ts.OptionError(
                "--frames is for --animate; say where the growth goes with --animate growth.webp"
            )
        return
    if path.suffix.lower() == ".svg":
        check_output(path, force, (".svg",))
        return
    check_output(path, force, (*SUFFIXES, ".svg"))
    check_clip_output(path, force)


def grown(
    recipe: Recipe, path: Path | None, max_megapixels: float, progress: Callable[[float], None] | None
) -> tuple[Motif, Animation | None]:
    """Return the motif of a recipe, and its growth if that is to be written."""
    if path is None:
        return ts.motif(recipe, max_megapixels=max_megapixels, progress=progress), None
    growth = animate(recipe, max_megapixels=max_megapixels, progress=progress)
    return growth.motif, growth


def write_growth(
    path: Path | None,
    growth: Animation | None,
    paper: Print,
    frames: int | None,
    force: bool,
) -> None:
    """Write the growth of a motif, if it is wanted, on the sheet on which the motif is printed.

    Raises
    ------
    OptionError, OutputError
    """
    if path is None or growth is None:
        return
    if path.suffix.lower() == ".svg":
        many = frames or _DRAWN_FRAMES
        document = growth.to_svg(
            paper.counts,
            frames=many,
            seconds=many / (_RATE * _DRAWN_FRAMES / _FRAMES),
            pause=_PAUSE,
            options=drawing_options(growth.motif, paper),
        )
        atomic_write(path, document, force)
        return
    shown = _Frames(growth, paper, frames or _FRAMES)
    (rows, columns), (height, width) = paper.laid(growth.motif.recipe)
    if rows * columns * height * width * shown.count > _LARGEST_PX:
        raise ts.OptionError(
            f"the growth has {shown.count} frames of {columns * width:,} × {rows * height:,} px; ask for "
            "fewer --frames, or for a smaller sheet"
        )
    write_clip(path, Clip(frames=shown, rate=Fraction(_RATE)), force)


@dataclass(frozen=True, slots=True)
class _Frames:
    """The frames of an animation, printed one by one; the last one stands still for a while."""

    growth: Animation
    paper: Print
    count: int

    def __len__(self) -> int:
        return self.count + round(_PAUSE * _RATE)

    def __iter__(self) -> Iterator[np.ndarray]:
        frame = np.zeros(0)
        for motif in self.growth.frames(self.count):
            printed = mix(sheet_coverage(motif, self.paper), motif.inks, motif.paper, motif.inking)
            frame = to_depth(np.ascontiguousarray(printed), np.dtype(np.uint8))
            yield frame
        for _ in range(len(self) - self.count):
            yield frame
