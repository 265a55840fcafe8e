"""``toposeam compare``: every method on the same two pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, placement
from toposeam_cli.app.progress import say
from toposeam_cli.app.terms import said
from toposeam_cli.stitching.inputs import PlacedPictures, arrange, read_avoid
from toposeam_cli.stitching.positions import Where

#: All methods but ``auto``, which chooses one of the others.
_COMPARED: tuple[ts.typing.Method, ...] = tuple(method for method in ts.seam.METHODS if method != "auto")


@click.command(cls=Command)
@click.argument("first", metavar="A", type=FILE)
@click.argument("second", metavar="B", type=FILE)
@placement(100.0)  # megapixels; both pictures are in memory
@click.option(
    "--method",
    "methods",
    type=click.Choice(_COMPARED),
    multiple=True,
    help="Only this method; may be repeated.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the table as JSON.")
def compare(
    first: Path,
    second: Path,
    offset: Any,
    overlap: Any,
    side: ts.typing.Side | None,
    avoid: Path | None,
    law: ts.typing.Law | None,
    core: float | None,
    speck: int | None,
    max_megapixels: float,
    methods: tuple[ts.typing.Method, ...],
    as_json: bool,
) -> None:
    """Find the seam between A and B with every method: cost, cost ÷ optimum, seconds.

    \b
    toposeam compare left.png right.png --overlap 25%

    The likeness says how like the two pictures are along the seam, to eyes: 1 where they show the same, ½
    where they differ by three times what is just seen; beside it that of the worst tenth, and where to look.
    """  # noqa: D301 - click wants the character
    pair = arrange(
        [first, second], Where(offset=offset, overlap=overlap, side=side), max_megapixels=max_megapixels
    )
    away = None if avoid is None else read_avoid(avoid, pair.shape, max_megapixels)
    cost = ts.seam.MatchCost(law=law or "natural")
    canvases = _on_canvas(pair, pair.shape)
    rows: list[dict[str, Any]] = []
    optimum: float | None = None  # the same for every method, and slow to compute
    for method in methods or _COMPARED:
        row: dict[str, Any] = {"method": method}
        try:
            stitched = ts.stitch(pair.layers, method=method, cost=cost, core=core, speck=speck, avoid=away)
            seam = stitched.seams[0]
        except ts.MissingPackageError as error:
            row["note"] = said(error)
        except ts.OverlapError as error:
            if method != "dp":
                raise
            row["note"] = said(error)
        else:
            if optimum is None:
                optimum = seam.cost / seam.optimum_ratio()
            row |= {
                "cost": seam.cost,
                "ratio": seam.cost / optimum,
                "seconds": seam.seconds,
                "iterations": len(seam.history),
            }
            verdict = ts.seam.seam_verdict(seam, *canvases, data_range=pair.layers[0].white)
            row |= {**verdict.summary(), "verdict": str(verdict)}
            if seam.termination == ts.optimize.Termination.ITERATIONS:
                row["note"] = "no single line"
        rows.append(row)
    if as_json:
        say(json.dumps(rows, indent=2), lines=True)
        return
    say(
        f"{'method':<14}{'cost':>12}{'÷ optimum':>12}{'seconds':>11}{'iterations':>12}{'likeness':>10}"
        f"{'worst':>8}"
    )
    for row in rows:
        if "cost" in row:
            likeness = f"{row['likeness']:>10.4f}{row['worst_likeness']:>8.4f}"
            numbers = f"{row['cost']:>12.4f}{row['ratio']:>12.5f}{row['seconds']:>11.4f}"
            line = f"{row['method']:<14}{numbers}{row['iterations'] or '–':>12}{likeness}"
            say(f"{line}  {'; '.join([row['verdict'], *([row['note']] if 'note' in row else [])])}")
        else:
            say(f"{row['method']:<14}{'–':>12}  {row['note']}")


def _on_canvas(pair: PlacedPictures, shape: tuple[int, int]) -> list[np.ndarray[Any, Any]]:
    """Return both pictures as arrays of the canvas's size, 0 where they have no pixels."""
    left, top = (min(layer.at[axis] for layer in pair.layers) for axis in (0, 1))
    placed = []
    for layer in pair.layers:
        image = np.atleast_3d(layer.image)
        whole = np.zeros((*shape, image.shape[2]), image.dtype)
        y, x = layer.at[1] - top, layer.at[0] - left
        whole[y : y + image.shape[0], x : x + image.shape[1]] = image
        placed.append(whole)
    return placed
