"""``toposeam join``: different motifs whose strokes join each other, laid in any arrangement."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import toposeam as ts
from toposeam.motif.ink.printing import MAX_PATTERN
from toposeam.motif.join import JOINABLE
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import FILE, OUTPUT, FiniteRange, PairType, force_option, quiet_option
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.writing import check_output
from toposeam_cli.motifs.print_options import PrintOptions, check_print, print_options, write_print
from toposeam_cli.motifs.printing import SUFFIXES, ink_names
from toposeam_cli.motifs.recipe_files import read_recipe

if TYPE_CHECKING:
    from toposeam.motif import Recipe


@click.command(
    cls=Command, everyday=["output", "sheet", "grid", "stages", "weight", "seed", "motif-width", "force"]
)
@click.argument("files", metavar="MOTIF MOTIF...", type=FILE, nargs=-1, required=True)
@option(
    "-o", "--output", heading="Output", type=OUTPUT, required=True, help="The pattern: .png, .tif or .svg."
)
@option(
    "--sheet",
    heading="Arrangement",
    type=PairType(cells=True),
    default="6x6",
    show_default=True,
    help="Columns and rows, motifs chosen at random.",
)
@option(
    "--grid",
    heading="Arrangement",
    help="Instead of --sheet: which motif goes where, like '1 2 1 / 2 1 2'; stages count on between.",
)
@option(
    "--weight",
    heading="Motifs",
    type=FiniteRange(0, 1),
    default=0.5,
    show_default=True,
    help="How much the motifs care for each other.",
)
@option(
    "--stages",
    heading="Arrangement",
    type=click.IntRange(1, 5),
    default=2,
    show_default=True,
    help="From 2 on new motifs are put between neighbours.",
)
@option(
    "--between",
    heading="Arrangement",
    type=click.IntRange(1, 5),
    default=1,
    show_default=True,
    help="How many of them between two.",
)
@option(
    "--reach",
    heading="Arrangement",
    type=click.IntRange(1),
    help="Random neighbours are at most so far apart in the row of motifs.",
)
@option(
    "--seed",
    heading="Arrangement",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Of the random arrangement.",
)
@option(
    "--motif-pixels", heading="Arrangement", type=PairType(), help="Size of one motif in px, WIDTHxHEIGHT."
)
@option(
    "--shared",
    heading="Motifs",
    type=click.IntRange(0, 100),
    help="Elements along the border that all motifs have alike; 0 is the thesis's way.  [default: 3 % of the "
    "motif]",
)
@print_options
@force_option
@quiet_option
def join(
    files: tuple[Path, ...],
    output: Path,
    sheet: tuple[int, int],
    grid: str | None,
    weight: float,
    stages: int,
    between: int,
    reach: int | None,
    seed: int,
    motif_pixels: tuple[int, int] | None,
    shared: int | None,
    ink: PrintOptions,
    force: bool,
    quiet: bool,
) -> None:
    """Remake motifs so that they join each other, and lay them out.

    \b
    toposeam join a.png b.png -o mixed.png --sheet 6x6
    toposeam join a.png b.png c.png -o mixed.png --stages 1 --grid '1 2 3 / 3 1 2'

    Their sources, sinks, masses and strokes come from each file; size, colours and all else from the first.
    """  # noqa: D301 - click wants the character
    sheet = sheet[::-1]
    check_output(output, force, SUFFIXES)
    if len(files) < 2:
        raise ts.OptionError("one motif alone joins itself already; name two at least")
    recipes = _alike([read_recipe(path) for path in files], files)
    places = None if grid is None else _parse(grid)
    count = 1 + (len(files) - 1) * (1 + between) ** (stages - 1)
    if places is not None and places.max() > count:
        raise ts.OptionError(
            f"--grid names motif {places.max()}, but with those between there are {count}; use 1 to that"
        )
    if places is None and sheet[0] * sheet[1] * math.prod(recipes[0].size) > MAX_PATTERN:
        raise ts.OptionError(
            f"a sheet of {sheet[1]} × {sheet[0]} motifs has more than {MAX_PATTERN:,} px; ask for fewer"
        )
    paper = ink.over({})
    cell = paper.laid(recipes[0])[1] if motif_pixels is None else motif_pixels[::-1]
    if places is not None and places.size * math.prod(cell) > MAX_PATTERN:
        raise ts.OptionError(f"the pattern would have more than {MAX_PATTERN:,} px; ask for smaller motifs")
    check_print(output, ink_names(recipes[0]), ink, force)
    with share_bar(f"joining {len(files)} motifs", quiet) as bar:
        joined = ts.motif.join_motifs(
            recipes,
            weight=weight,
            stages=stages,
            between=between,
            shared=shared,
            progress=bar,
        )
    laid = ts.motif.arrange(joined.motifs, sheet if places is None else places - 1, seed=seed, reach=reach)
    settings = {
        "weight": weight,
        "stages": stages,
        "between": between,
        "shared": shared,
        "reach": reach,
        "seed": seed,
        "sheet": list(sheet),
        "recipes": [recipe.to_dict() for recipe in recipes],
    }
    rows, columns = laid.grid.shape
    height, width = (cell[0] * rows, cell[1] * columns)
    whole = dataclasses.replace(paper, width_mm=None if paper.width_mm is None else paper.width_mm * columns)
    extent = write_print(
        output, laid, lambda: laid.coverage((height, width)), whole, ink, force, note={"join": settings}
    )
    if not quiet:
        lost = sorted({read_recipe(path).repeat for path in files} - {recipes[0].repeat})
        if lost:
            say(
                f"joined motifs lie side by side as they are, so they repeat by {recipes[0].repeat} here, "
                f"not by {' or '.join(lost)}; motifs that share a rule like p2, pmm or p4m keep it",
                err=True,
            )
        steps, lines = joined.mismatch(), joined.visibility()
        say(
            f"{output}: {extent}, {len(joined.motifs)} motifs; across borders they step {steps:.2f} times as "
            f"far as beside them, and borders show {lines:.2f} times as much as inner lines"
        )


def _alike(recipes: list[Recipe], files: tuple[Path, ...]) -> list[Recipe]:
    """Return recipes with the first one's values but their own sources, sinks, masses and strokes."""
    first, rule = recipes[0], _rule(recipes)
    found = []
    for recipe, path in zip(recipes, files, strict=True):
        if len(recipe.layers) != len(first.layers):
            raise ts.OptionError(
                f"'{path}' has {len(recipe.layers)} layers, '{files[0]}' has {len(first.layers)}; join "
                "motifs of equally many (--layers)"
            )
        layers = tuple(
            dataclasses.replace(
                layer, ink=other.ink, iterations=other.iterations, filter_radius=other.filter_radius
            )
            for layer, other in zip(recipe.layers, first.layers, strict=True)
        )
        found.append(
            dataclasses.replace(
                recipe,
                size=first.size,
                repeat=rule,
                paper=first.paper,
                layers=layers,
                iterations=first.iterations,
                move=first.move,
                filter_radius=first.filter_radius,
                coarse=first.coarse,
            )
        )
    return found


def _rule(recipes: list[Recipe]) -> str:
    """Return the rule by which joined motifs lie: their common one where cells stay as they are by it."""
    rules = {recipe.repeat for recipe in recipes}
    return rules.pop() if rules <= {recipes[0].repeat} & set(JOINABLE) else "translate"


def _parse(grid: str) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Parse a grid: rows of numbers from 1 on."""
    try:
        rows = [[int(word) for word in row.split()] for row in grid.replace(";", "/").split("/")]
    except ValueError:
        rows = []
    if not rows or not rows[0] or len({len(row) for row in rows}) > 1:
        raise ts.OptionError(f"--grid is {grid!r}; write rows of as many numbers each, like '1 2 1 / 2 1 2'")
    if min(min(row) for row in rows) < 1:
        raise ts.OptionError(f"--grid is {grid!r}; motifs are counted from 1")
    if max(max(row) for row in rows) > np.iinfo(np.int32).max:
        raise ts.OptionError(
            f"--grid has a number of {len(str(max(max(row) for row in rows)))} digits; "
            "motifs are counted from 1"
        )
    return np.array(rows, np.intp)
