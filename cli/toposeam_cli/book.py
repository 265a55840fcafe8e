"""``toposeam book``: hundreds of patterns round a theme, sorted, with contact sheets and mock-ups."""

from __future__ import annotations

import csv
import io
import json
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

import toposeam as ts
from toposeam.motif.kinds import Kind
from toposeam_cli.book_jobs import SEASONS, book_recipe
from toposeam_cli.interruption import Terminated
from toposeam_cli.mockups import PRODUCTS
from toposeam_cli.motif import read_theme
from toposeam_cli.output import atomic_write
from toposeam_cli.parameters import FILE
from toposeam_cli.progress import progress_bar
from toposeam_cli.runner import Job, run

#: The kinds a product is shown with: a fine pattern for a tie, a bold one for a canvas.
_FITTING = {
    "tie": (Kind.THIN_HIDDEN, Kind.THIN_CLEAR, Kind.THICK_HIDDEN, Kind.THICK_CLEAR),
    "scarf": (Kind.THICK_HIDDEN, Kind.THIN_HIDDEN, Kind.THIN_CLEAR, Kind.THICK_CLEAR),
    "shirt": (Kind.THIN_CLEAR, Kind.THIN_HIDDEN, Kind.THICK_CLEAR, Kind.THICK_HIDDEN),
    "canvas": (Kind.THICK_CLEAR, Kind.THICK_HIDDEN, Kind.THIN_CLEAR, Kind.THIN_HIDDEN),
}
Row = dict[str, Any]


@click.command()
@click.argument("theme", type=FILE)
@click.option("-n", "--number", type=click.IntRange(1, 10_000), default=400, show_default=True, help="How many patterns.")
@click.option("-o", "--output", "folder", type=FILE, required=True, help="Folder of the book; made if it is not there.")
@click.option("-j", "--jobs", "processes", type=click.IntRange(min=1), default=1, show_default=True, help="How many at a time.")
@click.option("--size", type=click.IntRange(32, 2048), default=128, show_default=True, help="Elements of a motif's side; even.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Everything follows from it and the theme.")
@click.option("--title", help="Of the book.  [default: the theme's name]")
@click.option("--no-pdf", is_flag=True, help="Write no book.pdf, which needs matplotlib.")
@click.option("--fresh", is_flag=True, help="Make everything again, also what a former run made.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def book(
    theme: Path, number: int, folder: Path, processes: int, size: int, seed: int, title: str | None, no_pdf: bool, fresh: bool, quiet: bool
) -> None:
    """Make a book of patterns round a theme: a logo, a symbol, a photograph.

    \b
    toposeam book logo.png -n 400 -o mybook -j 4

    The folder gets every motif as PNG with its recipe, patterns.csv, book.html and book.pdf. The same command again goes on after an
    interruption, and makes nothing twice.
    """  # noqa: D301 - click wants the character
    if size % 2:
        raise ts.OptionError(f"--size is {size}; mirrored and turned patterns need an even one, use {size + 1}")
    if not no_pdf:
        from toposeam_cli.book_pdf import require_matplotlib

        require_matplotlib()
    book_recipe(read_theme(theme), seed, 0, size)  # whatever is wrong with the theme is said before anything is written
    _make_folder(folder)
    journal = folder / "book.results.jsonl"
    start = time.monotonic()
    rows, failed = _run(_pattern_jobs(theme, number, folder, size, seed), processes, journal, fresh, quiet, "patterns")
    if rows:
        chosen = _choose(rows)
        _, lost = _run(_product_jobs(chosen, folder), processes, journal, fresh, quiet, "mock-ups")
        failed += lost
        name = title if title is not None else theme.stem
        atomic_write(folder / "patterns.csv", _table(rows), force=True)
        products = [(row, product) for row, product in chosen if (folder / _product_path(row, product)).exists()]
        from toposeam_cli.book_html import to_html

        atomic_write(
            folder / "book.html",
            to_html(name, rows, [(row, product, _product_path(row, product)) for row, product in products]),
            force=True,
        )
        if not no_pdf:
            from toposeam_cli.book_pdf import to_pdf

            atomic_write(folder / "book.pdf", to_pdf(name, folder, rows, products), force=True)
    if not quiet:
        kinds = Counter(row["kind"] for row in rows)
        shares = "; ".join(f"{kinds[kind]} {kind.words}" for kind in Kind)
        click.echo(f"{folder}: {len(rows)} patterns ({shares}) in {time.monotonic() - start:.0f} s; open {folder / 'book.html'}")
    if failed:
        click.get_current_context().exit(1)


def _make_folder(folder: Path) -> None:
    try:
        for name in ("motifs", "swatches", "products"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ts.OptionError(
            f"the folder '{folder}' cannot be made ({(error.strerror or str(error)).lower()}); choose another place"
        ) from error


def _pattern_jobs(theme: Path, number: int, folder: Path, size: int, seed: int) -> list[Job]:
    jobs = []
    for index in range(1, number + 1):
        motif, swatch = (folder / kind / f"{index:04d}.png" for kind in ("motifs", "swatches"))
        arguments = {"theme": str(theme), "seed": seed, "number": index, "size": size, "motif": str(motif), "swatch": str(swatch)}
        jobs.append(Job(f"pattern {index:04d}", "toposeam_cli.book_jobs:draw_pattern", arguments, outputs=(motif, swatch), inputs=(theme,)))
    return jobs


def _product_jobs(chosen: Sequence[tuple[Row, str]], folder: Path) -> list[Job]:
    jobs = []
    for row, product in chosen:
        motif, output = folder / "motifs" / f"{row['number']:04d}.png", folder / _product_path(row, product)
        arguments = {"motif": str(motif), "product": product, "output": str(output)}
        jobs.append(
            Job(f"{product} {row['season']}", "toposeam_cli.book_jobs:draw_on_product", arguments, outputs=(output,), inputs=(motif,))
        )
    return jobs


def _product_path(row: Row, product: str) -> str:
    return f"products/{product}-{row['season']}.png"


def _run(jobs: Sequence[Job], processes: int, journal: Path, fresh: bool, quiet: bool, kind: str) -> tuple[list[Row], int]:
    """What the jobs returned, in their order, and how many failed."""
    results: dict[str, Row] = {}
    failed = done = 0
    try:
        with progress_bar(quiet) as bar:
            for outcome in run(jobs, processes=processes, journal=journal, resume=not fresh, progress=bar.report):
                done += 1
                if outcome.status == "failed":
                    failed += 1
                    bar.say(f"{outcome.job.name}: {outcome.message}")
                else:
                    results[outcome.job.name] = outcome.result
    except (KeyboardInterrupt, Terminated):
        click.echo(f"{done} of {len(jobs)} {kind} are made; run the same again to go on.", err=True)
        raise
    return [results[job.name] for job in jobs if job.name in results], failed


def _choose(rows: Sequence[Row]) -> list[tuple[Row, str]]:
    """For each season and product a pattern of the kind that suits it, a different one for each."""
    chosen = []
    for season in SEASONS:
        left = [row for row in rows if row["season"] == season]
        for product, kinds in _FITTING.items():
            if left:
                order = [str(kind) for kind in kinds]
                best = min(left, key=lambda row: (order.index(row["kind"]), -row["layers"], row["number"]))
                left.remove(best)
                chosen.append((best, product))
    assert {product for _, product in chosen} <= set(PRODUCTS)  # noqa: S101
    return chosen


def _table(rows: Sequence[Row]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["file", *rows[0]])
    for row in rows:
        values = [json.dumps(value) if isinstance(value, list) else value for value in row.values()]
        writer.writerow([f"motifs/{row['number']:04d}.png", *values])
    return buffer.getvalue()
