"""``toposeam volume``: two stacks joined along a surface."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

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

#: Largest overlap that is joined whole, voxels; larger ones are joined by blocks.
_WHOLE = 20_000_000
#: Largest stack that is loaded whole, voxels; larger ones are joined by blocks.
_LOADED = 1_000_000_000


class TripleType(click.ParamType):  # type: ignore[type-arg]
    """Three numbers, z, y and x."""

    def __init__(self, whole: bool) -> None:
        self._whole = whole
        self.name = "Z,Y,X"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text."""
        if isinstance(value, tuple):
            return value
        number = r"[+-]?\d{1,9}" if self._whole else r"\d{1,9}(?:\.\d+)?"
        match = re.fullmatch(rf"\s*({number})\s*,\s*({number})\s*,\s*({number})\s*", str(value))
        if match is None or (not self._whole and not all(float(word) > 0 for word in match.groups())):
            example = "three whole numbers of voxels, like 0,-4,820" if self._whole else "like 2,0.5,0.5"
            self.fail(f"{value!r} is not z,y,x; write {example}", param, ctx)
        return tuple((int if self._whole else float)(word) for word in match.groups())


@click.command(cls=Command)
@click.argument("a", type=FILE)
@click.argument("b", type=FILE)
@click.option(
    "--offset", type=TripleType(True), required=True, help="Where B's first voxel lies in A, in voxels."
)
@click.option(
    "-o", "--output", type=OUTPUT, required=True, help="The joined stack: .ome.tif, .tif, .npy or .zarr."
)
@click.option("--spacing", type=TripleType(False), help="Size of a voxel in µm; the files' own by default.")
@surface_cost_option
@click.option("--labels", type=OUTPUT, help="Also write which stack shows where: 0 for A, 255 for B.")
@click.option("--mesh", type=OUTPUT, help="Also write the surface, in µm: .ply or .stl.")
@click.option(
    "--block",
    type=click.IntRange(16, 4096),
    help="Join by blocks of this side, in voxels; by default for overlaps of more than 20 million voxels.",
)
@click.option(
    "--white",
    type=FiniteRange(1e-30, 1e30),
    help="The value that counts as white; the depth's greatest by default, of floats the stacks' own.",
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
def volume(a: Path, b: Path, output: Path, **given: Any) -> None:
    """Join stacks A and B along the surface that shows least.

    A and B are TIFF, OME-TIFF, NumPy or zarr stacks of 8, 16 or 32 bits. Nothing is blended: every voxel is
    one of A or B. Large overlaps are joined by blocks, so that memory need not hold them.

    \b
    toposeam volume left.ome.tif right.ome.tif --offset 0,-3,820 -o joined.ome.tif
    toposeam volume a.zarr b.zarr --offset 400,0,0 -o joined.zarr --mesh surface.ply
    """  # noqa: D301 - click wants the character
    force, quiet = given["force"], given["quiet"]
    for path in (output, given["labels"]):
        if path is not None:
            check_stack_output(path, force)
    if given["mesh"] is not None:
        check_output(given["mesh"], force, (".ply", ".stl"))
    first, second = read_stack(a, given["max_voxels"]), read_stack(b, given["max_voxels"])
    _check_joined(first, second, given["offset"], given["max_voxels"])
    spacing, _ = common_spacing(first, second, given["spacing"])
    sides = spacing or (1.0, 1.0, 1.0)
    in_memory = (
        _common_voxels(first, second, given["offset"]) <= _WHOLE
        and max(math.prod(stack.voxels.shape) for stack in (first, second)) <= _LOADED
    )
    block = given["block"] or (None if in_memory else 160)
    with claimed_folder(temporary_beside(output.absolute())) as folder:
        with share_bar(f"joining {a.name} and {b.name}", quiet) as progress:
            made = ts.join_volumes(
                first.voxels if block else np.asarray(first.voxels),
                second.voxels if block else np.asarray(second.voxels),
                offset=given["offset"],
                spacing=sides,
                cost=ts.seam.MatchCost(law=given["law"]),
                data_range=_white(first, second, given["white"]),
                block=block,
                keep=folder / "labels.zarr" if block else None,
                progress=progress,
            )
        with all_or_nothing():
            with share_bar(f"writing {output.name}", quiet) as progress:
                write_stack(output, made.volume, spacing, force, progress)
            if given["labels"] is not None:
                write_stack(given["labels"], made.labels.astype(np.uint8) * np.uint8(255), spacing, force)
            if given["mesh"] is not None:
                with replacing(given["mesh"], force) as temporary:
                    mesh = made.mesh()
                    (mesh.to_ply if given["mesh"].suffix.lower() == ".ply" else mesh.to_stl)(temporary)
    if not quiet:
        size = " × ".join(map(str, made.places.canvas))
        proven = ""
        if made.surface is not None and made.surface.bound > 0:
            proven = f", cost {made.surface.cost / made.surface.bound - 1:.2%} above the least at most"
        say(f"{output}: {size} voxels{f', by blocks of {block}' if block else proven}")


def _common_voxels(a: Stack, b: Stack, offset: tuple[int, int, int]) -> int:
    """Count the voxels that both stacks have."""
    ends = (
        min(one, step + other) - max(0, step) for one, other, step in zip(a.size, b.size, offset, strict=True)
    )
    return int(np.prod([max(0, length) for length in ends]))


def _check_joined(a: Stack, b: Stack, offset: tuple[int, int, int], most: float) -> None:
    """Refuse a result of too many voxels.

    Raises
    ------
    OptionError
    """
    sides = [
        max(one, step + other) - min(0, step) for one, other, step in zip(a.size, b.size, offset, strict=True)
    ]
    if math.prod(sides) * math.prod(a.voxels.shape[3:]) > most:
        raise ts.OptionError(
            f"joined, the stacks have {'×'.join(map(str, sides))} voxels, more than the {most:.6g} allowed; "
            "check --offset, or raise --max-voxels"
        )


def _white(a: Stack, b: Stack, given: float | None) -> float | None:
    """Return the value of white: of floats the greatest in both stacks."""
    if given is not None or a.voxels.dtype.kind != "f":
        return given
    return max(1e-12, *(float(np.max(stack.voxels[at])) for stack in (a, b) for at in range(stack.size[0])))
