"""Positions of pictures, from the command line or from TIFF files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import toposeam as ts
from toposeam_cli.app.command import option
from toposeam_cli.app.options import Length, OffsetType, PairType
from toposeam_cli.media.layouts.tiff_place import FARTHEST, tiff_canvas, tiff_place

if TYPE_CHECKING:
    from toposeam_cli.media.pictures.picture import Picture

#: Extensions of files that say where their pictures lie.
LAYOUTS = (".toml", ".json", ".pto")
#: Extensions of files that are given alone.
ALONE = (".ora", *LAYOUTS)
#: The orders in which pictures fill a grid.
ORDERS = ("rows", "columns", "snake-rows", "snake-columns")


def position_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of the positions of pictures."""
    options = (
        option(
            "--at",
            heading="Place",
            type=OffsetType(),
            multiple=True,
            help="Where a picture's upper left corner lies; once for each, in their order.",
        ),
        option(
            "--grid",
            heading="Place",
            type=PairType(cells=True),
            help="With --overlap: the pictures fill a grid of this many columns and rows, row by row.",
        ),
        option(
            "--row", heading="Place", is_flag=True, help="With --overlap: the pictures continue to the right."
        ),
        option(
            "--column", heading="Place", is_flag=True, help="With --overlap: the pictures continue downwards."
        ),
        option(
            "--order",
            heading="Place",
            type=click.Choice(ORDERS),
            help="With --grid: how the pictures follow each other; rows by default.",
        ),
        option(
            "--align",
            heading="Place",
            kept=True,
            is_flag=True,
            help="Move pictures that lie only roughly right to where they agree.",
        ),
        option(
            "--align-radius",
            heading="Place",
            kept=True,
            type=click.IntRange(min=1),
            help="With --align: how many px they may be off; 32 by default.",
        ),
        option(
            "--wrap",
            heading="Place",
            kept=True,
            type=click.IntRange(min=0),
            is_flag=False,
            flag_value=0,
            help="A panorama that goes all the way round: its width in px, or as Hugin's nona wrote it.",
        ),
    )
    for each in reversed(options):
        command = each(command)
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """The positions of pictures, as given on the command line."""

    at: Sequence[tuple[int, int]] = ()
    offset: tuple[int, int] | None = None
    overlap: Length | None = None
    side: ts.typing.Side | None = None
    grid: tuple[int, int] | None = None  #: Columns and rows.
    row: bool = False
    column: bool = False
    order: str | None = None

    @property
    def arranged(self) -> bool:
        """True if the pictures follow each other in a grid, a row or a column."""
        return self.grid is not None or self.row or self.column


def places_of(
    files: Sequence[Path],
    pictures: Sequence[Picture],
    where: Where,
    numbers: Sequence[int] | None = None,
    count: int | None = None,
) -> list[tuple[float, float]] | None:
    """Return the positions of the pictures; None if they are not given.

    Parameters
    ----------
    files, pictures : sequence
    where : Where
    numbers : sequence of int, optional
        Which of those that the command line speaks of they are, where some could not be read.
    count : int, optional
        How many it speaks of.
    """
    count = len(files) if count is None or numbers is None else count
    numbers = range(count) if numbers is None else numbers
    ways = {
        "--at": bool(where.at),
        "--offset": where.offset is not None,
        "--grid": where.grid is not None,
        "--row": where.row,
        "--column": where.column,
        "--overlap": where.overlap is not None and not where.arranged,
    }
    given = [name for name, used in ways.items() if used]
    if len(given) > 1:
        raise ts.OptionError(f"{' and '.join(given)} both say where the pictures lie; leave one of them out")
    if where.order is not None and where.grid is None:
        raise ts.OptionError("--order belongs to --grid; add that or leave it out")
    if where.side is not None and (where.overlap is None or where.arranged):
        raise ts.OptionError(
            "--side belongs to --overlap of two pictures; leave it out, or give that instead"
        )
    if where.arranged:
        return _in_grid(pictures, where, given[0], numbers, count)
    if where.overlap is not None and count > 2:
        raise ts.OptionError(
            "--overlap alone is for two pictures; give --at X,Y for each, or add --grid, --row or --column"
        )
    if where.at:
        if len(where.at) != count:
            raise ts.OptionError(
                f"--at is given {'once' if len(where.at) == 1 else f'{len(where.at)} times'} for {count} "
                "pictures; give it once for each, in their order"
            )
        return [where.at[number] for number in numbers]
    if where.offset is not None and len(where.offset) != 2:
        raise ts.OptionError("--offset T,X,Y is for two clips, with toposeam stitch; write X,Y")
    if where.offset is not None:
        if count > 2:
            raise ts.OptionError("--offset is for two pictures; give --at X,Y for each instead")
        return [(0, 0), where.offset]
    if where.overlap is not None:
        return [(0, 0), _shifted(pictures[0], pictures[1], where.overlap, where.side or "right")]
    return _of_tiffs(files, pictures)


def width_round(wrap: int | None, files: Sequence[Path]) -> int | None:
    """Return the width of a panorama that goes round; 0 stands for the width that the first file states.

    Raises
    ------
    OptionError
        When it does not say it.
    """
    if wrap != 0:
        return wrap
    canvas = tiff_canvas(files[0])
    if canvas is None:
        raise ts.OptionError(f"'{files[0]}' does not say how wide the panorama is; give it, like --wrap 8000")
    return canvas[0]


def _of_tiffs(files: Sequence[Path], pictures: Sequence[Picture]) -> list[tuple[float, float]] | None:
    """Return the places that TIFF files state; None if one states none, or if all opaque ones would coincide.

    Raises
    ------
    OptionError
        When one lies too far away.
    """
    places = [tiff_place(path) for path in files]
    known = [place for place in places if place is not None]
    if len(known) < len(places):
        return None
    for path, (x, y) in zip(files, known, strict=True):
        if max(abs(x), abs(y)) > FARTHEST:
            raise ts.OptionError(
                f"'{path}' says that it lies at {x},{y}, which is too far away; export it again, or say "
                "where the pictures lie"
            )
    if len(set(known)) == 1 and any(picture.alpha is None for picture in pictures):
        return None
    return list(known)


def _in_grid(
    pictures: Sequence[Picture], where: Where, way: str, numbers: Sequence[int], count: int
) -> list[tuple[float, float]]:
    """Place pictures row by row, each overlapping the one before it and the row above.

    A picture that is missing has the size of the first one.
    """
    if where.overlap is None:
        raise ts.OptionError(f"{way} needs to know how far the pictures overlap; add --overlap, like 25%")
    columns, rows = where.grid or ((count, 1) if where.row else (1, count))
    if columns * rows != count:
        raise ts.OptionError(
            f"--grid {columns}x{rows} has {columns * rows} places for {count} pictures; say its columns "
            "and rows"
        )
    order = where.order or "rows"
    cells = []
    for index in range(count):
        down, along = divmod(index, columns if "rows" in order else rows)
        if order.startswith("snake") and down % 2:
            along = (columns if "rows" in order else rows) - 1 - along
        cells.append((down, along) if "rows" in order else (along, down))
    shapes = {number: picture.pixels.shape for number, picture in zip(numbers, pictures, strict=True)}
    sizes = {cell: shapes.get(index, pictures[0].pixels.shape) for index, cell in enumerate(cells)}
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for row in range(rows):
        for column in range(columns):
            x = y = 0
            if column:
                before = row, column - 1
                x = found[before][0] + sizes[before][1] - where.overlap.pixels(sizes[before][1])
                y = found[before][1]
            if row:
                above = row - 1, column
                y = found[above][1] + sizes[above][0] - where.overlap.pixels(sizes[above][0])
            found[row, column] = x, y
    return [found[cells[number]] for number in numbers]


def _shifted(a: Picture, b: Picture, overlap: Length | None, side: ts.typing.Side) -> tuple[int, int]:
    """Return the offset of B for an overlap with one side of A; both are aligned at the top or left."""
    if overlap is None:
        raise ts.OptionError("--overlap is missing")
    length = f"{overlap.value}%" if overlap.percent else overlap.value
    first, second = (ts.Layer(image=picture.pixels, name=name) for picture, name in ((a, "A"), (b, "B")))
    return ts.layers.overlapping(first, second, overlap=length, side=side)[1].at
