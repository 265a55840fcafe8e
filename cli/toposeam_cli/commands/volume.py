"""``toposeam volume``: stacks joined along surfaces."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import toposeam as ts
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import (
    FILE,
    OUTPUT,
    FiniteRange,
    force_option,
    quiet_option,
    surface_cost_option,
)
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.temporary import claimed_folder, temporary_beside
from toposeam_cli.files.writing import all_or_nothing, check_output, replacing
from toposeam_cli.media.stacks.reading import MOST_VOXELS, read_stack
from toposeam_cli.media.stacks.stack import Stack, common_spacing
from toposeam_cli.media.stacks.writing import check_stack_output, write_stack

if TYPE_CHECKING:
    from toposeam.volume import JoinedVolume, SurfaceVerdict

#: Largest overlap that is joined whole, voxels; larger ones are joined by blocks.
_WHOLE = 20_000_000
#: Largest stack that is loaded whole, voxels; larger ones are joined by blocks.
_LOADED = 1_000_000_000
#: Logarithm of a gain that is told.
_UNLIKE = 0.05
Triple = tuple[int, int, int]


class TripleType(click.ParamType):  # type: ignore[type-arg]
    """Three numbers, z, y and x."""

    def __init__(self, whole: bool) -> None:
        self._whole = whole
        self.name = "Z,Y,X"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text."""
        if isinstance(value, tuple):
            return value
        if self._whole and re.fullmatch(r"[\d\s,.+-]*\d\.\d[\d\s,.+-]*", str(value)):
            self.fail(
                f"{value!r} has parts of voxels, and nothing is interpolated here; resample the stack so "
                "that whole numbers are right, like 0,-4,820",
                param,
                ctx,
            )
        number = r"[+-]?\d{1,9}" if self._whole else r"\d{1,9}(?:\.\d+)?"
        match = re.fullmatch(rf"\s*({number})\s*,\s*({number})\s*,\s*({number})\s*", str(value))
        if match is None or (not self._whole and not all(float(word) > 0 for word in match.groups())):
            example = "three whole numbers of voxels, like 0,-4,820" if self._whole else "like 2,0.5,0.5"
            self.fail(f"{value!r} is not z,y,x; write {example}", param, ctx)
        return tuple((int if self._whole else float)(word) for word in match.groups())


@click.command(cls=Command)
@click.argument("stacks", type=FILE, nargs=-1, required=True)
@click.option(
    "--offset",
    type=TripleType(True),
    multiple=True,
    required=True,
    help="Where a stack's first voxel lies in A, in voxels; once for each stack after A, in their order.",
)
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    required=True,
    help="The joined stack: .ome.tif, .tif, .npy or .zarr.",
)
@click.option(
    "--spacing",
    type=TripleType(False),
    help="Size of a voxel in µm; the files' own by default.",
)
@click.option(
    "--avoid",
    type=FILE,
    multiple=True,
    help="A segmentation of a stack, of its size: numbers of cells, or a mask; the first one of A, the next "
    "of B. A cell is then cut or shown twice only where it cannot be helped. By default cells are what is "
    "bright among its surroundings.",
)
@click.option(
    "--cells",
    type=OUTPUT,
    help="Also write the segmentations, joined as the stacks are, a cell of both by one number.",
)
@click.option(
    "--match-tones/--no-match-tones",
    default=False,
    help="Give every stack the black and the brightness of A, as a smooth field: their values change. The "
    "search for the surface evens them out in any case.",
)
@surface_cost_option
@click.option(
    "--labels",
    type=OUTPUT,
    help="Also write which of two stacks shows where they overlap: 0 for A, 255 for B.",
)
@click.option("--mesh", type=OUTPUT, help="Also write the surface, in µm: .ply or .stl.")
@click.option(
    "--block",
    type=click.IntRange(16, 4096),
    help="Join by blocks of this side, in voxels; by default for overlaps of more than 20 million voxels.",
)
@click.option(
    "--white",
    type=FiniteRange(1e-30, 1e30),
    help="The difference between white and black; by default found from the stacks.",
)
@click.option(
    "--max-voxels",
    type=FiniteRange(min=1),
    default=MOST_VOXELS,
    show_default=True,
    help="Refuse stacks that have more, each or joined.",
)
@force_option
@quiet_option
def volume(stacks: tuple[Path, ...], output: Path, **given: Any) -> None:
    """Join stacks A, B and others along the surfaces that show least and cut the fewest cells.

    Stacks are TIFF, OME-TIFF, NumPy or zarr files of 8, 16 or 32 bits. Nothing is blended: every voxel is one
    of one stack. Each stack is joined to those before it, which it must overlap. Large overlaps are joined by
    blocks, so that memory need not hold them.

    \b
    toposeam volume left.ome.tif right.ome.tif --offset 0,-3,820 -o joined.ome.tif
    toposeam volume a.tif b.tif c.tif --offset 0,0,820 --offset 0,790,4 -o all.tif --match-tones
    toposeam volume a.zarr b.zarr --offset 400,0,0 -o joined.zarr --mesh surface.ply
    """  # noqa: D301 - click wants the character
    force, quiet, offsets = given["force"], given["quiet"], [(0, 0, 0), *given["offset"]]
    _check_given(stacks, given)
    for path in (output, given["labels"], given["cells"]):
        if path is not None:
            check_stack_output(path, force)
    if given["mesh"] is not None:
        check_output(given["mesh"], force, (".ply", ".stl"))
    read = [read_stack(path, given["max_voxels"]) for path in stacks]
    numbers = [_read_cells(path, stack) for path, stack in zip(given["avoid"], read, strict=False)]
    _check_joined(read, offsets, given["max_voxels"])
    spacing: tuple[float, float, float] | None = given["spacing"]
    for stack in read[1:]:
        spacing, _ = common_spacing(read[0], stack, spacing)
    block = given["block"] or (None if _fits(read, offsets) else 160)
    with claimed_folder(temporary_beside(output.absolute())) as folder:
        made, verdict = _joined(read, offsets, numbers, spacing or (1.0, 1.0, 1.0), block, folder, given)
        with all_or_nothing():
            with share_bar(f"writing {output.name}", quiet) as progress:
                write_stack(output, made.volume, spacing, force, progress)
            if given["labels"] is not None:
                write_stack(given["labels"], made.labels.astype(np.uint8) * np.uint8(255), spacing, force)
            if given["cells"] is not None:
                write_stack(given["cells"], _small_numbers(made.cells), spacing, force)
            if given["mesh"] is not None:
                with replacing(given["mesh"], force) as temporary:
                    mesh = made.mesh()
                    (mesh.to_ply if given["mesh"].suffix.lower() == ".ply" else mesh.to_stl)(temporary)
    if not quiet:
        size = " × ".join(map(str, made.places.canvas))
        proven = ""
        if made.surface is not None and made.surface.bound > 0:
            proven = f", cost {made.surface.cost / made.surface.bound - 1:.2%} above the least at most"
        say(f"{output}: {size} voxels{f', by blocks of {block}' if block else proven}: {verdict}")


def _joined(
    stacks: Sequence[Stack],
    offsets: Sequence[Triple],
    numbers: Sequence[Any],
    spacing: tuple[float, float, float],
    block: int | None,
    folder: Path,
    given: dict[str, Any],
) -> tuple[Any, SurfaceVerdict]:
    """Join stacks in turn; judge the surface that shows most."""
    cells = [*numbers, *[None] * (len(stacks) - len(numbers))]
    before: Any = stacks[0].voxels if block else np.asarray(stacks[0].voxels)
    known, origin, context = cells[0], np.zeros(3, int), click.get_current_context()
    from toposeam.volume.verdict import SurfaceVerdict  # loads what joins stacks

    worst = SurfaceVerdict(step=0.0)
    for place, (stack, offset) in enumerate(zip(stacks[1:], offsets[1:], strict=True), 1):
        context.params |= {"a": stacks[0].source, "b": stack.source}  # names for errors
        with share_bar(f"joining {stack.source.name}", given["quiet"]) as progress, _at_offset(offset):
            made: JoinedVolume = ts.volume(
                before,
                stack.voxels if block else np.asarray(stack.voxels),
                offset=[int(step) for step in np.array(offset) - origin],
                spacing=spacing,
                cost=ts.seam.MatchCost(law=given["law"]),
                cells=True if known is None and cells[place] is None else (known, cells[place]),
                match_tones=given["match_tones"],
                data_range=given["white"],
                block=block,
                keep=folder / f"labels{place}.zarr" if block else None,
                progress=progress,
            )
        before, known = made, made.cells
        origin = np.minimum(origin, offset)
        if not given["quiet"]:
            own = made.verdict.moved(origin)
            worst = own if own.step >= worst.step else worst
        light = 1.0 if made.tones is None else made.tones.gain
        if abs(math.log(light)) > _UNLIKE and not (given["match_tones"] or given["quiet"]):
            say(
                f"{stack.source} has {light:.2f} times the light of what it joins; --match-tones evens that "
                "out",
                err=True,
            )
    return before, worst.moved(-origin)


@contextmanager
def _at_offset(offset: Triple) -> Iterator[None]:
    """Name the offset that was given in an error about where a stack lies."""
    try:
        yield
    except ts.OverlapError as error:
        if "value" in error.data:
            error.data["value"] = ",".join(map(str, offset))
        raise


def _check_given(stacks: Sequence[Path], given: dict[str, Any]) -> None:
    """Refuse options that do not fit the number of stacks.

    Raises
    ------
    OptionError
    """
    count = len(stacks)
    if count < 2:
        raise ts.OptionError("one stack is given; a second one is needed to join it to")
    if len(given["offset"]) != count - 1:
        raise ts.OptionError(
            f"{count} stacks need {count - 1} times --offset, once for each after {stacks[0].name}; given "
            f"are {len(given['offset'])}"
        )
    if len(given["avoid"]) > count:
        raise ts.OptionError(
            f"--avoid is given {len(given['avoid'])} times for {count} stacks; give one for each"
        )
    if given["cells"] is not None and not given["avoid"]:
        raise ts.OptionError("--cells writes the segmentations of --avoid joined; give --avoid, too")
    for name in ("labels", "mesh"):
        if given[name] is not None and count > 2:
            raise ts.OptionError(
                f"--{name} is of one surface, and {count} stacks have several; join two at a time"
            )


def _read_cells(path: Path, stack: Stack) -> Any:
    """Open the segmentation of a stack.

    Raises
    ------
    ImageError
        Unless it has whole numbers, one for each voxel.
    """
    found = read_stack(path).voxels
    if found.ndim != 3 or found.dtype.kind != "u" or tuple(found.shape) != stack.size:
        raise ts.ImageError(
            f"{path} has {'×'.join(map(str, found.shape))} values of {found.dtype}; --avoid takes whole "
            f"numbers, one for each of the {'×'.join(map(str, stack.size))} voxels of {stack.source.name}"
        )
    return np.asarray(found)


def _small_numbers(cells: Any) -> Any:
    """Return numbers of cells in a type that files hold."""
    return cells.astype(np.uint16 if int(np.asarray(cells.max())) < 1 << 16 else np.uint32)


def _fits(stacks: Sequence[Stack], offsets: Sequence[Triple]) -> bool:
    """Decide whether the stacks are loaded and joined whole."""
    low = high = None
    largest = max(math.prod(stack.voxels.shape) for stack in stacks)
    for stack, offset in zip(stacks, offsets, strict=True):
        begin, end = np.array(offset), np.array(offset) + stack.size
        if low is None or high is None:
            low, high = begin, end
            continue
        common = np.minimum(high, end) - np.maximum(low, begin)
        if math.prod(np.maximum(common, 0).tolist()) > _WHOLE:
            return False
        low, high = np.minimum(low, begin), np.maximum(high, end)
        largest = max(largest, math.prod((high - low).tolist()))
    return int(largest) <= _LOADED


def _check_joined(stacks: Sequence[Stack], offsets: Sequence[Triple], most: float) -> None:
    """Refuse a result of too many voxels.

    Raises
    ------
    OptionError
    """
    low = np.min(offsets, axis=0)
    high = np.max(
        [np.array(offset) + stack.size for stack, offset in zip(stacks, offsets, strict=True)], axis=0
    )
    sides = (high - low).tolist()
    if math.prod(sides) * math.prod(stacks[0].voxels.shape[3:]) > most:
        raise ts.OptionError(
            f"joined, the stacks have {'×'.join(map(str, sides))} voxels, more than the {most:.6g} allowed; "
            "check --offset, or raise --max-voxels"
        )
