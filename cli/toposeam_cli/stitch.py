"""``toposeam stitch``: two overlapping pictures become one."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam_cli.output import atomic_write, check_output
from toposeam_cli.overlay import draw_seam
from toposeam_cli.parameters import FILE, OUTPUT, placement
from toposeam_cli.picture import Picture, write_picture
from toposeam_cli.placing import read_pair


@click.command()
@placement
@click.option("-o", "--output", type=OUTPUT, required=True, help="The joined picture: .png, .tif, .jpg or .webp.")
@click.option("--method", type=click.Choice(ts.METHODS), default="heat", show_default=True, help="How the seam is found.")
@click.option("--formulation", type=click.IntRange(1, 2), help="With --method thesis: 1 (default), or 2 (unstable, see the docs).")
@click.option("--seam", type=OUTPUT, help="Also write the seam as SVG; edit it and give it back with --use-seam.")
@click.option("--use-seam", type=FILE, help="Join along the paths of this SVG instead of searching.")
@click.option("--labels", type=OUTPUT, help="Also write the mask: white where B shows.")
@click.option("--overlay", type=OUTPUT, help="Also write the joined picture with the seam drawn over it.")
@click.option("--history", type=OUTPUT, help="Also write a figure (.png, .svg, .pdf) of how the heat converged.")
@click.option("--json", "as_json", is_flag=True, help="Print cost, optimum, ratio, stages, iterations and seconds as JSON.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def stitch(
    first: Path, second: Path, offset: Any, overlap: Any, side: str, avoid: Path | None, no_gradient: bool, core: float,
    max_megapixels: float, output: Path, method: ts.Method, formulation: int | None, seam: Path | None, use_seam: Path | None,
    labels: Path | None, overlay: Path | None, history: Path | None, as_json: bool, force: bool, quiet: bool,
) -> None:  # fmt: skip
    """Join pictures A and B where they overlap, along a seam that nobody sees.

    \b
    toposeam stitch left.png right.png --overlap 120 -o joined.png
    toposeam stitch map1.tif map2.tif --offset 1830,-12 -o map.tif --seam seam.svg
    """  # noqa: D301 - click wants the character
    _check_files(output=output, seam=seam, labels=labels, overlay=overlay, history=history, force=force)
    iterates = use_seam is None and method in ("heat", "thesis")
    if history is not None and not iterates:
        raise ts.OptionError("--history shows iterations, and only the methods heat and thesis iterate; choose one of them or leave it out")
    if formulation is not None and (method != "thesis" or use_seam is not None):
        raise ts.OptionError("--formulation belongs to --method thesis; add that or leave it out")
    drawing = None if use_seam is None else ts.read_svg(use_seam)
    pair = read_pair(first, second, offset=offset, overlap=overlap, side=side, avoid=avoid, max_megapixels=max_megapixels)
    options: dict[str, Any] = {"gradient": not no_gradient, "core": core, "avoid": pair.avoid}
    if drawing is not None:
        stitched = ts.stitch(pair.layers, use_path=drawing, **options)
    else:
        if formulation is not None:
            options["formulation"] = formulation
        with _progress(f"joining {first.name} and {second.name}", quiet) as progress:
            stitched = ts.stitch(pair.layers, method=method, record_frames=history is not None, progress=progress, **options)
    found = stitched.seams[0]
    # Every result exists before the first file is written.
    documents: list[tuple[Path, bytes]] = []
    if seam is not None:
        documents.append((seam, found.to_svg().encode()))
    if history is not None:
        from toposeam_cli.history_figure import history_figure

        documents.append((history, history_figure(found, history.suffix)))
    if as_json:
        report = json.dumps(summary(found), indent=2)
    else:
        height, width = stitched.image.shape[:2]
        report = f"{output}: {width} × {height} px, {describe(found)}"
    result = dataclasses.replace(pair.pictures[0], pixels=stitched.image, alpha=stitched.alpha)
    write_picture(output, result, force)
    for path, document in documents:
        atomic_write(path, document, force)
    if labels is not None:
        write_picture(labels, _plain(stitched.masks[1].astype(np.uint8) * np.uint8(255)), force)
    if overlay is not None:
        write_picture(overlay, _plain(draw_seam(stitched.image, found)), force)
    if as_json or not quiet:
        click.echo(report)


def summary(seam: ts.Seam) -> dict[str, Any]:
    """What ``--json`` prints. The optimum can take longer to compute than the seam took."""
    ratio = seam.optimum_ratio()
    return {
        "method": seam.method,
        "cost": seam.cost,
        "optimum": seam.cost / ratio,
        "ratio": ratio,
        "stages": seam.history[-1].stage if seam.history else 0,
        "iterations": len(seam.history),
        "termination": str(seam.termination),
        "paths": len(seam.paths),
        "length_px": round(sum(line.length for line in seam.paths)),
        "seconds": round(seam.seconds, 6),
    }


def describe(seam: ts.Seam) -> str:
    """One line about a seam for people."""
    length = round(sum(line.length for line in seam.paths))
    effort = f" in {len(seam.history)} iterations" if seam.history else ""
    text = f"seam of {length} px by {seam.method}{effort}, cost {seam.cost:.4g}, {seam.seconds:.2f} s"
    if seam.termination == ts.Termination.ITERATIONS:
        text += "; the heat did not settle on a single line, so this is the best cut of what it left"
    return text


def _plain(pixels: Any) -> Picture:
    return Picture(pixels=pixels)


def _check_files(*, output: Path, force: bool, seam: Path | None, labels: Path | None, overlay: Path | None, history: Path | None) -> None:
    """Refuse outputs that cannot be written, before any work is spent on them."""
    check_output(output, force)
    for path, suffixes in ((seam, (".svg",)), (history, (".png", ".svg", ".pdf"))):
        if path is not None:
            check_output(path, force, suffixes)
    for path in (labels, overlay):
        if path is not None:
            check_output(path, force)
    given = [path.resolve() for path in (output, seam, labels, overlay, history) if path is not None]
    if len(set(given)) < len(given):
        raise ts.OptionError("two outputs have the same name; give each a name of its own")


@contextmanager
def _progress(label: str, quiet: bool) -> Iterator[Callable[[float], None] | None]:
    """A progress bar on a terminal, nothing in a pipe."""
    if quiet or not (sys.stderr and sys.stderr.isatty()):  # there is none when it was closed
        yield None
        return
    with click.progressbar(length=1000, label=label, file=sys.stderr) as bar:
        yield lambda share: bar.update(max(0, round(1000 * share) - bar.pos))
