"""``toposeam compare``: every method on the same two pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

import toposeam as ts
from toposeam_cli.parameters import FILE, placement
from toposeam_cli.placing import Where, arrange, read_avoid


@click.command()
@click.argument("first", metavar="A", type=FILE)
@click.argument("second", metavar="B", type=FILE)
@placement
@click.option("--method", "methods", type=click.Choice(ts.METHODS), multiple=True, help="Only this method; may be repeated.")
@click.option("--json", "as_json", is_flag=True, help="Print the table as JSON.")
def compare(
    first: Path, second: Path, offset: Any, overlap: Any, side: ts.Side | None, avoid: Path | None, no_gradient: bool, core: float,
    max_megapixels: float, methods: tuple[ts.Method, ...], as_json: bool,
) -> None:  # fmt: skip
    """Find the seam between A and B with every method: cost, cost ÷ optimum, seconds.

    \b
    toposeam compare left.png right.png --overlap 25%
    """  # noqa: D301 - click wants the character
    pair = arrange([first, second], Where(offset=offset, overlap=overlap, side=side), max_megapixels=max_megapixels)
    away = None if avoid is None else read_avoid(avoid, pair.shape, max_megapixels)
    rows: list[dict[str, Any]] = []
    optimum: float | None = None  # the same for every method, and slow to compute
    for method in methods or ts.METHODS:
        row: dict[str, Any] = {"method": method}
        try:
            seam = ts.stitch(pair.layers, method=method, gradient=not no_gradient, core=core, avoid=away).seams[0]
        except ts.MissingPackageError as error:
            row["note"] = str(error)
        except ts.OverlapError as error:
            if method != "dp":
                raise
            row["note"] = str(error)
        else:
            if optimum is None:
                optimum = seam.cost / seam.optimum_ratio()
            row |= {"cost": seam.cost, "ratio": seam.cost / optimum, "seconds": seam.seconds, "iterations": len(seam.history)}
            if seam.termination == ts.Termination.ITERATIONS:
                row["note"] = "no single line"
        rows.append(row)
    if as_json:
        click.echo(json.dumps(rows, indent=2))
        return
    click.echo(f"{'method':<14}{'cost':>12}{'÷ optimum':>12}{'seconds':>11}{'iterations':>12}")
    for row in rows:
        if "cost" in row:
            line = f"{row['method']:<14}{row['cost']:>12.4f}{row['ratio']:>12.5f}{row['seconds']:>11.4f}{row['iterations'] or '–':>12}"
            click.echo(f"{line}  {row.get('note', '')}".rstrip())
        else:
            click.echo(f"{row['method']:<14}{'–':>12}  {row['note']}")
