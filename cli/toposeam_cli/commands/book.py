"""``toposeam book``: hundreds of patterns round a theme, sorted, with contact sheets and mock-ups."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

import toposeam as ts
from toposeam.motif.book import FINISH, SEASONS, SECOND_PRODUCT, book_recipe, choose
from toposeam.motif.kinds import Kind
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, FiniteRange, PaperLengthType, jobs_option, quiet_option
from toposeam_cli.app.progress import progress_bar, say
from toposeam_cli.files.interruption import Terminated
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.writing import all_or_nothing, atomic_write, check_output
from toposeam_cli.jobs.journal import Journal
from toposeam_cli.jobs.runner import Job, run
from toposeam_cli.motifs.book.patterns import ROW
from toposeam_cli.motifs.printing import Print
from toposeam_cli.motifs.themes import read_theme

Row = dict[str, Any]

_FOLDERS = ("motifs", "swatches", "products")
#: Name of the row in the table of results that holds the digests of the pages.
_PAGES = "pages"


@click.command(cls=Command)
@click.argument("themes", metavar="THEME...", type=FILE, nargs=-1, required=True)
@click.option(
    "-n",
    "--number",
    type=click.IntRange(1, 10_000),
    default=400,
    show_default=True,
    help="How many patterns.",
)
@click.option(
    "-o", "--output", "folder", type=FILE, required=True, help="Folder of the book; made if it is not there."
)
@jobs_option
@click.option(
    "--size",
    type=click.IntRange(32, 2048),
    default=128,
    show_default=True,
    help="Elements of a motif's side; even.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Everything follows from it and the theme.",
)
@click.option(
    "--motif-width",
    "width_mm",
    type=PaperLengthType(),
    help="Print motifs so wide on paper: 80mm, 8cm or 3in.",
)
@click.option(
    "--dpi",
    type=FiniteRange(1, 10_000),
    help="Resolution of motifs, pixels per inch.  [default: 300 with --motif-width]",
)
@click.option("--title", help="Of the book.  [default: the theme's name]")
@click.option("--no-pdf", is_flag=True, help="Write no book.pdf.")
@click.option("--fresh", is_flag=True, help="Make everything again, also what a former run made.")
@click.option("--force", is_flag=True, help="Replace files in the folder that no former run made.")
@quiet_option
def book(
    themes: tuple[Path, ...],
    number: int,
    folder: Path,
    processes: int,
    size: int,
    seed: int,
    width_mm: float | None,
    dpi: float | None,
    title: str | None,
    no_pdf: bool,
    fresh: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Make a book of patterns round a theme: a logo, a symbol, a photograph.

    \b
    toposeam book logo.png -n 400 -o mybook -j 4
    toposeam book leaf.png bird.png shell.png -n 120 -o mybook

    The folder gets every motif as PNG with its recipe, patterns.csv, book.html and book.pdf. The same command
    again goes on after an interruption, and makes nothing twice. What it made may be made again; any other
    file is replaced only with --force.
    """  # noqa: D301 - click wants the character
    if size % 2:
        raise ts.OptionError(
            f"--size is {size}; mirrored and turned patterns need an even one, use {size + 1}"
        )
    paper = Print(width_mm=width_mm, dpi=dpi)
    for theme in themes:  # errors of any theme come before anything is written
        paper.check(book_recipe(read_theme(theme), seed, 0, size), False)
    journal = folder / "book.results.jsonl"
    _check_folder(folder, themes, journal, force)
    _make_folder(folder)
    start = time.monotonic()
    rows, failed = _run(
        _pattern_jobs(themes, number, folder, size, seed, paper, force),
        processes,
        journal,
        fresh,
        quiet,
        "patterns",
    )
    if rows:
        for row in rows:
            row["several"] = len(themes) > 1
        chosen = _beside(choose(rows))
        _, lost = _run(_product_jobs(chosen, folder, force), processes, journal, fresh, quiet, "mock-ups")
        failed += lost
        # Names that are not UTF-8 have characters that no page can hold.
        name = title if title is not None else ", ".join(theme.stem for theme in themes)
        name = click.format_filename(name)
        products = [
            (row, product) for row, product in chosen if (folder / _product_path(row, product)).exists()
        ]
        from toposeam_cli.motifs.book.html import to_html

        shown = [(row, product, _product_path(row, product)) for row, product in products]
        pages: dict[str, str | bytes] = {
            "patterns.csv": _table(rows),
            "book.html": to_html(name, rows, shown),
        }
        if not no_pdf:
            from toposeam_cli.motifs.book.pdf import to_pdf

            pages["book.pdf"] = to_pdf(name, folder, rows, products)
        with Journal(journal) as table:
            with all_or_nothing(_made(table), resumed=True, digests=True) as outputs:
                for page, content in pages.items():
                    atomic_write(folder / page, content, force)
            table.add({"name": _PAGES, "status": "done", "made": _made(table) | outputs.made})
    if not quiet:
        kinds = Counter(row["kind"] for row in rows)
        shares = "; ".join(f"{kinds[kind]} {kind.words}" for kind in Kind)
        say(
            f"{folder}: {len(rows)} patterns ({shares}) in {time.monotonic() - start:.0f} s; open "
            f"{folder / 'book.html'}"
        )
    if failed:
        click.get_current_context().exit(1)


def _made(table: Journal) -> dict[str, str]:
    """Return the digests of the pages that a former run made."""
    return dict(table.rows.get(_PAGES, {}).get("made", {}))


def _beside(chosen: Sequence[tuple[Row, str]]) -> list[tuple[Row, str]]:
    """Return the products, some with the number of a second pattern."""
    number = {(row["season"], product): row["number"] for row, product in chosen}
    return [
        ({**row, "beside": number.get((row["season"], SECOND_PRODUCT.get(product, "")))}, product)
        for row, product in chosen
    ]


def _check_folder(folder: Path, themes: Sequence[Path], journal: Path, force: bool) -> None:
    """Refuse a folder that cannot hold the book: a file, one with themes in it, or with foreign files."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise ts.OptionError(f"'{folder}' is no folder, which a book is; choose another name")
    for theme in themes:
        if any(real_path(theme).parent == real_path(folder / name) for name in _FOLDERS):
            raise ts.OptionError(
                f"the theme '{theme}' lies where the book's own pictures go; copy it elsewhere, or choose "
                "another folder"
            )
    own: dict[str, str] = {}
    if journal.is_file():
        with Journal(journal) as table:
            own = _made(table)
    with all_or_nothing(own):
        for name in ("patterns.csv", "book.html", "book.pdf"):
            if os.path.lexists(folder / name):
                check_output(folder / name, force, suffixes=None)


def _make_folder(folder: Path) -> None:
    try:
        for name in _FOLDERS:
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ts.OptionError(
            f"the folder '{folder}' cannot be made ({(error.strerror or str(error)).lower()}); choose "
            "another place"
        ) from error


def _pattern_jobs(
    themes: Sequence[Path], number: int, folder: Path, size: int, seed: int, paper: Print, force: bool
) -> list[Job]:
    jobs = []
    for index in range(1, number + 1):
        theme = themes[(index - 1) // len(SEASONS) % len(themes)]  # each in every season
        motif, swatch = (folder / kind / f"{index:04d}.png" for kind in ("motifs", "swatches"))
        arguments = {
            "theme": str(theme),
            "seed": seed,
            "number": index,
            "size": size,
            "motif": str(motif),
            "swatch": str(swatch),
            "width_mm": paper.width_mm,
            "dpi": paper.dpi,
        }
        jobs.append(
            Job(
                f"pattern {index:04d}",
                "toposeam_cli.motifs.book.patterns:draw_pattern",
                arguments,
                outputs=(motif, swatch),
                inputs=(theme,),
                manner={"force": force},
                remakes=True,
            )
        )
    return jobs


def _product_jobs(chosen: Sequence[tuple[Row, str]], folder: Path, force: bool) -> list[Job]:
    jobs = []
    for row, product in chosen:
        motif, output = folder / "motifs" / f"{row['number']:04d}.png", folder / _product_path(row, product)
        inks, edge = FINISH[product]
        second = None if row["beside"] is None else folder / "motifs" / f"{row['beside']:04d}.png"
        arguments = {
            "motif": str(motif),
            "product": product,
            "output": str(output),
            "second": None if second is None else str(second),
            "inks": inks,
            "edge": edge,
        }
        jobs.append(
            Job(
                f"{product} {row['season']}",
                "toposeam_cli.motifs.book.patterns:draw_on_product",
                arguments,
                outputs=(output,),
                inputs=(motif,) if second is None else (motif, second),
                manner={"force": force},
                remakes=True,
            )
        )
    return jobs


def _product_path(row: Row, product: str) -> str:
    return f"products/{product}-{row['season']}.png"


def _run(
    jobs: Sequence[Job], processes: int, journal: Path, fresh: bool, quiet: bool, kind: str
) -> tuple[list[Row], int]:
    """Run the jobs; return their results in order, and the number that failed."""
    results: dict[str, Row] = {}
    failed = done = 0
    try:
        with progress_bar(quiet) as bar:
            for outcome in run(
                jobs, processes=processes, journal=journal, resume=not fresh, progress=bar.report
            ):
                done += 1
                if outcome.status == "failed":
                    failed += 1
                    bar.say(f"{outcome.job.name}: {outcome.message}")
                elif kind == "patterns" and not _is_row(outcome.result):
                    raise ts.OptionError(
                        f"'{journal}' says of {outcome.job.name} what no book has measured; run it with "
                        "--fresh"
                    )
                else:
                    results[outcome.job.name] = outcome.result
    except (KeyboardInterrupt, Terminated):
        say(f"{done} of {len(jobs)} {kind} are made; run the same again to go on.", err=True)
        raise
    return [results[job.name] for job in jobs if job.name in results], failed


def _is_row(result: Any) -> bool:
    """Test whether a result holds the measurements of a pattern; a table of results can hold anything."""
    return (
        isinstance(result, dict)
        and set(result) == set(ROW)
        and all(type(result[name]) in (kind, int if kind is float else kind) for name, kind in ROW.items())
        and all(
            type(value) in (int, float)
            for values in result.values()
            if isinstance(values, list)
            for value in values
        )
        and all(math.isfinite(value) for value in result.values() if isinstance(value, float))
        and result["kind"] in [str(kind) for kind in Kind]
        and result["season"] in SEASONS
        and result["number"] >= 1
    )


def _table(rows: Sequence[Row]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["file", *ROW])
    for row in rows:
        values = [json.dumps(row[name]) if kind is list else row[name] for name, kind in ROW.items()]
        writer.writerow([f"motifs/{row['number']:04d}.png", *values])
    return buffer.getvalue()
