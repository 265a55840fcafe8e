"""``toposeam stitch``: overlapping pictures become one."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam_cli.openraster import write_ora
from toposeam_cli.output import PICTURE_SUFFIXES, all_or_nothing, atomic_write, check_output
from toposeam_cli.overlay import draw_seams
from toposeam_cli.parameters import FILE, OUTPUT, FiniteRange, Keyed, KeyedFile, OffsetType, placement
from toposeam_cli.picture import Picture, write_picture
from toposeam_cli.placing import Where, arrange, given_seams, read_avoid
from toposeam_cli.progress import share_bar
from toposeam_cli.report import describe, describe_alignment, summary_of_all


@click.command()
@click.argument("first", metavar="A", type=FILE)
@click.argument("second", metavar="[B]", type=FILE, required=False)
@click.argument("others", metavar="[C]...", type=FILE, nargs=-1)
@click.option("-o", "--output", type=OUTPUT, required=True, help="The joined picture: .png, .tif, .jpg or .webp; .ora keeps the layers.")
@click.option("--at", type=OffsetType(), multiple=True, help="Where a picture's upper left corner lies; once for each, in their order.")
@placement
@click.option("--align", is_flag=True, help="Move the pictures from about where they belong to where they agree.")
@click.option("--align-radius", type=click.IntRange(min=1), help="With --align: how many px they may be off; 32 by default.")
@click.option(
    "--mask-for", "masks", type=KeyedFile(needed=True), multiple=True, help="Picture (number from 0, or name) = where it may show: white."
)
@click.option(
    "--keep", "keeps", metavar="N=FILE", type=KeyedFile(needed=True), multiple=True, help="Where nothing but picture N may show: white."
)
@click.option("--method", type=click.Choice(ts.METHODS), help="How seams are found; heat by default.")
@click.option("--formulation", type=click.IntRange(1, 2), help="With --method thesis: 1 (default), or 2 (unstable, see the docs).")
@click.option("--match-tones", is_flag=True, help="First take exposure steps out: one gain per picture and channel.")
@click.option("--blend", type=click.Choice(ts.BLENDS), default="none", show_default=True, help="What happens across the seams.")
@click.option("--blend-width", type=FiniteRange(min=0, min_open=True), help="With --blend feather, multiband, gradient: over how many px.")
@click.option("--seam", type=OUTPUT, help="Also write the seams as SVG; edit them and give them back with --use-seam.")
@click.option("--use-seam", metavar="[N:M=]FILE", type=KeyedFile(needed=False), multiple=True,
              help="Join along the paths of this SVG instead of searching; 0:1=FILE for one pair of many.")  # fmt: skip
@click.option("--labels", type=OUTPUT, help="Also write who shows where: black for A, white for the last, grays between.")
@click.option("--overlay", type=OUTPUT, help="Also write the joined picture with the seams drawn over it.")
@click.option("--history", type=OUTPUT, help="For two pictures: also write a figure (.png, .svg, .pdf) of how the heat converged.")
@click.option("--json", "as_json", is_flag=True, help="Print costs, optima, ratios, stages, iterations and seconds as JSON.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def stitch(
    first: Path, second: Path | None, others: tuple[Path, ...], output: Path, at: tuple[tuple[int, int], ...], offset: Any, overlap: Any,
    side: ts.Side | None, avoid: Path | None, no_gradient: bool, core: float, max_megapixels: float, align: bool,
    align_radius: int | None, masks: tuple[Keyed, ...], keeps: tuple[Keyed, ...], method: ts.Method | None, formulation: int | None,
    match_tones: bool, blend: ts.Blend, blend_width: float | None, seam: Path | None, use_seam: tuple[Keyed, ...], labels: Path | None,
    overlay: Path | None, history: Path | None, as_json: bool, force: bool, quiet: bool,
) -> dict[str, Any]:  # fmt: skip
    """Join pictures where they overlap, along seams that nobody sees.

    A is the first picture, or an OpenRaster file (.ora) or layout (.toml, .json) with all of them; later pictures lie on top.

    \b
    toposeam stitch left.png right.png --overlap 120 -o joined.png
    toposeam stitch map1.tif map2.tif --offset 1830,-12 -o map.tif --seam seam.svg
    toposeam stitch a.jpg b.jpg c.jpg --at 0,0 --at 900,10 --at 450,700 --align -o all.ora
    """  # noqa: D301 - click wants the character
    files = [path for path in (first, second, *others) if path is not None]
    _check_files(output=output, seam=seam, labels=labels, overlay=overlay, history=history, force=force)
    iterates = not use_seam and method in (None, "heat", "thesis")
    if history is not None:
        if not iterates:
            raise ts.OptionError(
                "--history shows iterations, and only the methods heat and thesis iterate; choose one of them or leave it out"
            )
        from toposeam_cli.history_figure import check_matplotlib, history_figure

        check_matplotlib()
    if formulation is not None and (method != "thesis" or use_seam):
        raise ts.OptionError("--formulation belongs to --method thesis; add that or leave it out")
    if align_radius is not None and not align:
        raise ts.OptionError("--align-radius belongs to --align; add that or leave it out")
    place = Where(at=at, offset=offset, overlap=overlap, side=side)
    job = arrange(files, place, masks=masks, keeps=keeps, max_megapixels=max_megapixels)
    if len(job.layers) == 2 and use_seam and method is not None:
        raise ts.OptionError("--method finds a seam and --use-seam gives it; leave one of them out")
    if len(job.layers) > 2 and history is not None:
        raise ts.OptionError(f"--history shows how one seam was found, but there are {len(job.layers)} pictures; leave it out")
    aligned = None
    if align:
        aligned = ts.align(job.layers) if align_radius is None else ts.align(job.layers, align_radius)
        job = dataclasses.replace(job, layers=aligned.layers)
    _check_opaque([path for path in (output,) if path.suffix.lower() in (".jpg", ".jpeg")], job.layers)
    paths = given_seams(use_seam, job)
    options: dict[str, Any] = {"gradient": not no_gradient, "core": core, "match_tones": match_tones, "blend": blend}
    options |= {"blend_width": blend_width, "avoid": None if avoid is None else read_avoid(avoid, job.shape, max_megapixels)}
    if formulation is not None:
        options["formulation"] = formulation
    try:
        with share_bar(f"joining {_names(job.layers)}", quiet) as progress:
            stitched = ts.stitch(
                job.layers, method=method or "heat", use_path=paths, record_frames=history is not None, progress=progress, **options
            )
    except ts.OverlapError as error:
        if files[0].suffix.lower() != ".ora":
            raise
        hint = "if TopoSeam wrote this file, hide the layers it cut and show its group originals"
        raise ts.OverlapError(f"{error}; {hint}") from error
    except ts.PathError as error:
        raise error if len(use_seam) != 1 else ts.PathError(f"'{use_seam[0].path}': {error}") from error
    # Every result exists before the first file is written.
    documents: list[tuple[Path, bytes]] = []
    if seam is not None:
        documents.append((seam, (stitched.seams[0].to_svg() if len(job.layers) == 2 else stitched.to_svg()).encode()))
    if history is not None:
        documents.append((history, history_figure(stitched.seams[0], history.suffix)))
    height, width = stitched.image.shape[:2]
    report = json.dumps(summary_of_all(stitched, job.layers, aligned), indent=2) if as_json else "\n".join([
        *(describe_alignment(job.layers, aligned) if aligned is not None else ()),
        f"{output}: {width} × {height} px, {describe(stitched)}",
    ])  # fmt: skip
    with all_or_nothing():
        if output.suffix.lower() == ".ora":
            write_ora(output, stitched, job.pictures, job.layers, force)
        else:
            write_picture(output, dataclasses.replace(job.pictures[0], pixels=stitched.image, alpha=stitched.alpha), force)
        for path, document in documents:
            atomic_write(path, document, force)
        if labels is not None:
            write_picture(labels, Picture(pixels=_labels(stitched)), force)
        if overlay is not None:
            write_picture(overlay, Picture(pixels=draw_seams(stitched.image, stitched.seams)), force)
    if as_json or not quiet:
        click.echo(report)
    result: dict[str, Any] = json.loads(report) if as_json else {"report": report}
    return result


def _names(layers: Sequence[ts.Layer]) -> str:
    return f"{layers[0].name} and {layers[1].name}" if len(layers) == 2 else f"{len(layers)} pictures"


def _labels(stitched: ts.Stitched) -> Any:
    """(H, W) uint8: grays from black for the first layer to white for the last; black where there is none."""
    labels = np.zeros(stitched.masks[0].shape, np.uint8)
    for index, mask in enumerate(stitched.masks):
        labels[mask] = round(255 * index / (len(stitched.masks) - 1))
    return labels


def _check_files(*, output: Path, force: bool, seam: Path | None, labels: Path | None, overlay: Path | None, history: Path | None) -> None:
    """Refuse outputs that cannot be written, before any work is spent on them."""
    check_output(output, force, (*PICTURE_SUFFIXES, ".ora"))
    for path, suffixes in ((seam, (".svg",)), (history, (".png", ".svg", ".pdf"))):
        if path is not None:
            check_output(path, force, suffixes)
    for path in (labels, overlay):
        if path is not None:
            check_output(path, force)
    given = [path.resolve() for path in (output, seam, labels, overlay, history) if path is not None]
    if len(set(given)) < len(given):
        raise ts.OptionError("two outputs have the same name; give each a name of its own")


def _check_opaque(paths: Sequence[Path], layers: Sequence[ts.Layer]) -> None:
    """Refuse, before any work is spent on them, outputs that cannot be transparent where no layer is opaque."""
    if not paths:
        return
    canvas = ts.common_canvas(layers, ts.MAX_PIXELS)
    opaque = np.zeros(canvas.shape, bool)
    for layer in layers:
        full = full_scale(layer.image.dtype)
        opaque[canvas.place(layer).slices] |= layer.covered if layer.alpha is None else layer.covered & (layer.alpha >= full)
    if not opaque.all():
        raise ts.ImageError(
            f"'{paths[0]}' cannot be written: the picture is partly transparent, which {paths[0].suffix} cannot hold; use .png or .tif"
        )
