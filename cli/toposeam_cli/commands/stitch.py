"""``toposeam stitch``: overlapping pictures become one."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import click
import numpy as np
from click.core import ParameterSource

import toposeam as ts
from toposeam.images import Windows
from toposeam.layers.composite.local_warp import MOST
from toposeam.layers.composite.stitch import stitched as ts_stitched
from toposeam.layers.labelling.posing import check_pairs
from toposeam.layers.search.options import Effort
from toposeam.seam.result.drawing import draw_seams
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import (
    FILE,
    OUTPUT,
    FiniteRange,
    KeyedFile,
    OffsetType,
    PairType,
    force_option,
    placement,
    quiet_option,
    taken,
)
from toposeam_cli.app.progress import share_bar
from toposeam_cli.files.writing import all_or_nothing
from toposeam_cli.jobs.crew import processes_of
from toposeam_cli.media.pictures.picture import COMPRESSIONS
from toposeam_cli.stitching.inputs import PlacedPictures, arrange, read_avoid, saved_layout
from toposeam_cli.stitching.outputs import (
    Cropped,
    Outputs,
    check_outputs,
    crop_of,
    cropped,
    numbered,
    write,
)
from toposeam_cli.stitching.place_options import FindingOptions, finding_options, with_defaults
from toposeam_cli.stitching.placement_report import found_of, misfits
from toposeam_cli.stitching.positions import ORDERS, Where, width_round
from toposeam_cli.stitching.report import crop_at, describe, hidden, is_read, summary_of_all, told_of
from toposeam_cli.stitching.resample import toned_layers
from toposeam_cli.stitching.seam_files import given_seams
from toposeam_cli.stitching.search_options import (
    Means,
    SeamOptions,
    by_windows,
    check_finding,
    correlations,
    means_of,
    shared_work,
    strangers,
)
from toposeam_cli.stitching.windowed_output import describe_totals, make, summary_of_large, write_large


@click.command(
    cls=Command,
    everyday=[
        "output",
        "overlap",
        "offset",
        "align",
        "save-layout",
        "avoid",
        "blend",
        "match-tones",
        "crop",
        "force",
    ],
)
@click.argument("first", metavar="A", type=FILE)
@click.argument("second", metavar="[B]", type=FILE, required=False)
@click.argument("others", metavar="[C]...", type=FILE, nargs=-1)
@option(
    "-o",
    "--output",
    heading="Output",
    type=OUTPUT,
    required=True,
    help="The joined picture: .png, .tif, .jpg, .webp or .dzi; .ora keeps the layers.",
)
@option(
    "--at",
    heading="Place",
    type=OffsetType(),
    multiple=True,
    help="Where a picture's upper left corner lies; once for each, in their order.",
)
@option(
    "--grid",
    heading="Place",
    type=PairType(cells=True),
    help="With --overlap: the pictures follow each other row by row in so many columns and rows.",
)
@option("--row", heading="Place", is_flag=True, help="With --overlap: the pictures continue to the right.")
@option("--column", heading="Place", is_flag=True, help="With --overlap: the pictures continue downwards.")
@option(
    "--order",
    heading="Place",
    type=click.Choice(ORDERS),
    help="With --grid: how the pictures follow each other; rows by default.",
)
@placement(500.0)
@finding_options
@option(
    "--save-layout",
    heading="Output",
    type=OUTPUT,
    help="Also write where the pictures lie, as a layout (.toml) to give instead, or for Hugin (.pto).",
)
@option(
    "--report",
    heading="Output",
    type=OUTPUT,
    help="Also write a page (.html): the picture with its seams, before and after, what each seam costs.",
)
@option(
    "--skip-bad",
    heading="Output",
    is_flag=True,
    help="Leave out pictures that cannot be read, and name them.",
)
@option(
    "--align",
    heading="Place",
    is_flag=True,
    help="Move the pictures from about where they belong to where they agree.",
)
@option(
    "--align-radius",
    heading="Place",
    type=click.IntRange(min=1),
    help="With --align: how many px they may be off; 32 by default.",
)
@option(
    "--mask-for",
    "masks",
    heading="Seam",
    type=KeyedFile(needed=True),
    multiple=True,
    help="Picture (number from 0, or name) = where it may show: white.",
)
@option(
    "--keep",
    "keeps",
    heading="Seam",
    metavar="N=FILE",
    type=KeyedFile(needed=True),
    multiple=True,
    help="Where nothing but picture N may show: white.",
)
@option(
    "--method",
    heading="Seam",
    type=click.Choice(ts.seam.METHODS),
    default="auto",
    show_default=True,
    help="How seams are found; auto takes the exact solver that is fastest.",
)
@option(
    "--effort",
    heading="Seam",
    type=click.Choice(get_args(Effort)),
    help="Of the search for more than two pictures: fast by default up to 12, from there on best, which "
    "takes 2 to 4 times as long.",
)
@option(
    "--formulation",
    heading="Seam",
    type=click.IntRange(1, 2),
    help="With --method thesis: 1 (default), or 2 (unstable, see the docs).",
)
@option(
    "--plain",
    heading="Seam",
    is_flag=True,
    help="With --method thesis: its algorithms as they are written, without ours.",
)
@option(
    "--match-tones/--no-match-tones",
    heading="Tones and blend",
    default=None,
    help="First take exposure steps out: one gain per picture and channel.",
)
@option(
    "--match-shading/--no-match-shading",
    heading="Tones and blend",
    default=None,
    help="The same, and that lenses darken towards the corners: a smooth gain field per picture.",
)
@option(
    "--blend",
    heading="Tones and blend",
    type=click.Choice(ts.layers.BLENDS),
    help="What happens across the seams; multiband for photographs, else none.",
)
@option(
    "--blend-width",
    heading="Tones and blend",
    type=FiniteRange(min=0, min_open=True),
    help="With --blend feather, multiband, gradient: over how many px.",
)
@option(
    "--give",
    heading="Seam",
    type=click.IntRange(1, MOST),
    metavar="PX",
    help="Bend the pictures by up to PX pixels until what crosses a seam goes on behind it; for what stood "
    "near the camera.",
)
@option(
    "--wrap",
    heading="Place",
    type=click.IntRange(min=0),
    is_flag=False,
    flag_value=0,
    help="A panorama that goes all the way round: its width in px, or as Hugin's nona wrote it.",
)
@option(
    "--seam",
    heading="Output",
    type=OUTPUT,
    help="Also write the seams as SVG; edit them and give them back with --use-seam.",
)
@option(
    "--use-seam",
    heading="Seam",
    metavar="[N:M=]FILE",
    type=KeyedFile(needed=False),
    multiple=True,
    help="Join along the paths of this SVG instead of searching; 0:1=FILE for one pair of many.",
)
@option(
    "--crop",
    heading="Output",
    type=click.Choice(["inside", "outside"]),
    help="The largest rectangle without holes, or all of it; inside for formats without transparency.",
)
@option(
    "--fill-edges",
    heading="Output",
    type=click.IntRange(1, 1000),
    metavar="PX",
    help="Crop to what lies within PX pixels of the pictures, and fill there what none of them shows.",
)
@option(
    "--background",
    heading="Output",
    metavar="COLOUR",
    help="Fill holes with a colour, like white or #20304a.",
)
@option("--quality", heading="Output", type=click.IntRange(1, 100), help="Of .jpg; 95 by default.")
@option(
    "--compression", heading="Output", type=click.Choice(COMPRESSIONS), help="Of .tif; deflate by default."
)
@option(
    "--pyramid", heading="Output", is_flag=True, help="Write .tif in tiles and at every size; .dzi always is."
)
@option(
    "--labels",
    heading="Output",
    type=OUTPUT,
    help="Also write who shows where: black for A, white for the last, grays between.",
)
@option(
    "--overlay",
    heading="Output",
    type=OUTPUT,
    help="Also write the joined picture with the seams drawn over it.",
)
@option(
    "--history",
    heading="Output",
    type=OUTPUT,
    help="For two pictures: find the seam by heat, and also write how it converged: a figure (.png, .svg, "
    ".pdf), or an animation (.gif, .webp).",
)
@option(
    "--json",
    "as_json",
    heading="Output",
    is_flag=True,
    help="Print costs, optima, ratios, stages, iterations and seconds as JSON.",
)
@shared_work
@force_option
@quiet_option
def stitch(first: Path, second: Path | None, others: tuple[Path, ...], **given: Any) -> dict[str, Any]:
    """Join pictures where they overlap, along seams that nobody sees.

    A is the first picture, or an OpenRaster file (.ora), layout (.toml, .json) or Hugin project (.pto) with
    all of them; later pictures lie on top. Where nobody says where they lie, nor TIFF files as Hugin's nona
    writes them, that is found out from what they show, and pictures are warped as they need it.

    \b
    toposeam stitch *.jpg -o all.jpg
    toposeam stitch left.png right.png --overlap 120 -o joined.png
    toposeam stitch map1.tif map2.tif --offset 1830,-12 -o map.tif --seam seam.svg
    toposeam stitch a.jpg b.jpg c.jpg --at 0,0 --at 900,10 --at 450,700 --align -o all.ora
    toposeam stitch one.mp4 two.mp4 --offset 48,0,0 -o both.mp4   (clips: frames,x,y)
    """  # noqa: D301 - click wants the character
    files = [path for path in (first, second, *others) if path is not None]
    if given["offset"] is not None and len(given["offset"]) == 3:
        return _stitch_clips(files, given)
    where, find, out = taken(Where, given), taken(SeamOptions, given), taken(Outputs, given)
    finding = taken(FindingOptions, given)
    check_outputs(out)
    check_finding(find, out, given["dask"])
    if finding.groups:
        _check_groups(given, find)
        check_outputs(numbered(out, 2))

    def joined(
        members: Sequence[Path], finding: FindingOptions, out: Outputs
    ) -> tuple[PlacedPictures, dict[str, Any]]:
        with means_of(out.output.parent, members, processes_of(given["processes"]), given["dask"]) as means:
            return _stitch(members, where, finding, find, out, dict(given), means)

    job, result = joined(files, finding, out)
    if finding.groups:
        result["groups"] = []
        for number, members in enumerate(job.other_groups, 2):
            own = numbered(out, number)
            check_outputs(own)
            try:
                result["groups"].append(joined(members, finding.without_names(files, members), own)[1])
            except ts.OverlapError as error:
                click.echo(f"left out: {error}", err=True)
    if out.as_json:
        click.echo(json.dumps(result, indent=2))
    return result


def _check_groups(given: dict[str, Any], find: SeamOptions) -> None:
    """Refuse options that name pictures of one group."""
    one = {"--mask-for": given["masks"], "--keep": given["keeps"], "--use-seam": find.use_seam}
    for name, value in one.items():
        if value:
            raise ts.OptionError(f"{name} names pictures of one group; leave it or --groups out")


def _stitch(
    files: Sequence[Path],
    where: Where,
    finding: FindingOptions,
    find: SeamOptions,
    out: Outputs,
    given: dict[str, Any],
    means: Means,
) -> tuple[PlacedPictures, dict[str, Any]]:
    """Return the pictures and what is reported of them joined; as JSON, it is not printed yet."""
    with share_bar("placing", out.quiet) as progress:
        job = arrange(
            files,
            where,
            masks=given.pop("masks"),
            keeps=given.pop("keeps"),
            max_megapixels=find.max_megapixels,
            skip_bad=given.pop("skip_bad"),
            progress=progress,
            scratch=means.store if by_windows(out, find) else None,
            executor=means.workers,
            stores=means.stores,
            finding=finding.of(files),
        )
    find, out = with_defaults(find, out, job, finding)
    if not all(isinstance(layer.image, Windows) for layer in job.layers):
        means = dataclasses.replace(means, workers=None)
    for reason in job.skipped:
        click.echo(f"left out: {reason}", err=True)
    if len(job.layers) == 2 and find.use_seam and find.method != "auto":
        raise ts.OptionError("--method finds a seam and --use-seam gives it; leave one of them out")
    if len(job.layers) > 2 and out.history is not None:
        raise ts.OptionError(
            f"--history shows how one seam was found, but there are {len(job.layers)} pictures; leave it out"
        )
    aligned = None
    if find.align:
        radius = {} if find.align_radius is None else {"radius": find.align_radius}
        aligned = ts.layers.align(job.layers, executor=means.workers, **radius)
        job = dataclasses.replace(job, layers=aligned.layers)
    wrap = job.wrap if find.wrap is None else find.wrap
    find = dataclasses.replace(find, wrap=width_round(wrap, job.files or files))
    if find.wrap is None:
        crop = crop_of(out, job.layers)
    else:
        keeps_holes = out.fill_edges is None and (out.has_alpha or out.background is not None)
        crop = out.crop or ("outside" if keeps_holes else "inside")
    check_pairs(job.layers)
    warnings = [] if out.quiet else strangers(job, find.wrap, means.workers)
    if job.stored:
        return job, _stitch_large(job, find, out, files, crop, means, [*warnings], aligned)
    composed = _composed(job, find, out, files)
    warnings += _unseen(composed, find, out)
    asked = out.as_json or (out.overlay, out.seam, out.history, out.report) != (None,) * 4
    mapped = asked or out.labels is not None or out.output.suffix.lower() == ".ora"
    stitched = ts_stitched(composed, mapped)
    written = cropped(stitched, out) if crop == "inside" else Cropped(stitched=stitched)
    finished, at = written.stitched, written.at
    crop_box = crop_at(at, finished.image.shape)
    warnings += [] if out.quiet else misfits(job, at)
    overlay = None if out.overlay is None else draw_seams(stitched.image, stitched.seams)
    if overlay is not None and at is not None:
        (height, width), (left, top) = finished.image.shape[:2], at
        overlay = overlay[top : top + height, left : left + width]
    documents: list[tuple[Path, bytes]] = []
    if out.seam is not None:
        one = stitched.seams[0] if len(job.layers) == 2 else stitched
        documents.append((out.seam, one.to_svg().encode()))
    if out.history is not None:
        from toposeam_cli.figures.search import draw_search

        documents.append((out.history, draw_search(stitched.seams[0], out.history.suffix)))
    if out.save_layout is not None:
        documents.append((out.save_layout, saved_layout(job, out.save_layout).encode()))
    if out.report is not None:
        from toposeam_cli.stitching.seam_page import Joined, seam_page

        page = Joined(
            title=out.output.name,
            layers=job.layers,
            origin=stitched.origin,
            image=stitched.image,
            alpha=stitched.alpha,
            seams=list(zip(stitched.pairs, stitched.seams, strict=True)),
            shown=np.bincount(stitched.label_map.ravel() + 1, minlength=len(job.layers) + 1)[1:].tolist(),
            correlations=correlations(job),
        )
        documents.append((out.report, seam_page(page).encode(errors="backslashreplace")))
    report: str | dict[str, Any] = ""
    if out.as_json:
        found = summary_of_all(stitched, job.layers, aligned, job.placement, crop_box)
        bent = {"bent_px": composed.bent} if find.give else {}
        report = found | bent | found_of(job)
    elif is_read(out.quiet):
        two = len(job.layers) == 2
        told = describe(stitched.seams[0], crop_box) if two else describe_totals(composed, crop=crop_box)
        report = told_of(out, finished.image.shape, told, at, job.shape, job.layers, job.placement, aligned)
        if find.give:
            report += f", bent by up to {composed.bent:.1f} px" if composed.bent else ", bent nowhere"
        if written.filled:
            report += f", {100 * written.filled:.1f} % of its pixels filled"
    write(out, job, finished, documents, overlay)
    return job, _reported(report, warnings, out)


def _composed(
    job: PlacedPictures,
    find: SeamOptions,
    out: Outputs,
    files: Sequence[Path],
    means: Means | None = None,
) -> ts.layers.Composition:
    """Join the layers along seams; with `means`, layers whose pixels wait in files.

    Raises
    ------
    TopoSeamError
        As :func:`toposeam.layers.compose` raises it, with the file that is meant.
    """
    given = find.keywords
    if find.plain:
        form = {} if find.formulation is None else {"formulation": find.formulation}
        given["options"] = ts.seam.ThesisOptions.plain(**form)
    elif find.formulation is not None:
        given["formulation"] = find.formulation
    if find.law is not None:
        given["cost"] = ts.seam.MatchCost(law=find.law)
    if find.avoid is not None:
        given["avoid"] = read_avoid(find.avoid, job.shape, find.max_megapixels)
    given["max_megapixels"] = max(find.max_megapixels, ts.MAX_PIXELS / 1e6)
    given["use_path"] = given_seams(find.use_seam, job)
    given["record_frames"] = out.history is not None
    layers: Sequence[ts.Layer] = job.layers
    if means is not None and (find.match_tones or find.match_shading):
        # What is refused is refused before the pixels are gone through.
        ts.layers.StitchOptions.of(given)
        ts.layers.common_canvas(layers, max_megapixels=given["max_megapixels"])
        with share_bar("matching tones", out.quiet) as progress:
            layers = toned_layers(layers, bool(find.match_shading), means.store, means.workers, progress)
        given.update(match_tones=False, match_shading=False)
    executor = None if means is None else means.workers
    try:
        with share_bar(f"joining {_names(job.layers)}", out.quiet) as progress:
            return ts.layers.compose(layers, executor=executor, progress=progress, **given)
    except ts.OverlapError as error:
        if files[0].suffix.lower() != ".ora":
            raise
        hint = "if TopoSeam wrote this file, hide the layers it cut and show its group originals"
        raise error.within("{error}; {hint}", hint=hint) from error
    except ts.PathError as error:
        one = find.use_seam[0].path if len(find.use_seam) == 1 else None
        if one is None or "file" in error.data:
            raise
        raise error.within("'{file}': {error}", file=str(one)) from error


def _names(layers: Sequence[ts.Layer]) -> str:
    return f"{layers[0].name} and {layers[1].name}" if len(layers) == 2 else f"{len(layers)} pictures"


def _reported(report: str | dict[str, Any], warnings: Sequence[str], out: Outputs) -> dict[str, Any]:
    """Print a report, unless it becomes JSON, and warnings; return the report."""
    found = report if isinstance(report, dict) else {"report": report}
    if found is not report and not out.quiet:
        click.echo(report)
    for warning in warnings:
        click.echo(f"warning: {warning}", err=True)
    return found


def _unseen(composed: ts.layers.Composition, find: SeamOptions, out: Outputs) -> list[str]:
    """Compose the warnings about pictures that show nowhere."""
    middle = "--core 0.5 shows the middle of all pictures inside others, " if find.core is None else ""
    return [] if out.quiet else hidden(composed, f"{middle}--keep N=MASK what you want of one")


def _stitch_large(
    job: PlacedPictures,
    find: SeamOptions,
    out: Outputs,
    files: Sequence[Path],
    crop: str,
    means: Means,
    warnings: Sequence[str],
    aligned: ts.layers.Aligned | None,
) -> dict[str, Any]:
    """Return the same for pictures larger than memory."""
    composed = _composed(job, find, out, files, means)
    warnings = [*warnings, *_unseen(composed, find, out)]
    with all_or_nothing():
        with share_bar("writing", out.quiet) as progress:
            large = make(composed, job, out, crop, means.store, progress, means.workers)
        warnings += [] if out.quiet else misfits(job, large.at)
        documents: list[tuple[Path, bytes]] = []
        if out.save_layout is not None:
            documents.append((out.save_layout, saved_layout(job, out.save_layout).encode()))
        if out.report is not None:
            from toposeam_cli.stitching.seam_page import Joined, seam_page

            page = Joined(
                title=out.output.name,
                layers=job.layers,
                origin=composed.origin,
                corner=large.at or (0, 0),
                image=large.picture.pixels,
                alpha=large.picture.alpha,
                seams=[(seam.pair, seam) for seam in large.seams],
                shown=large.shown,
                correlations=correlations(job, means.workers),
            )
            documents.append((out.report, seam_page(page).encode(errors="backslashreplace")))
        report: str | dict[str, Any] = ""
        if out.as_json:
            report = summary_of_large(composed, large) | found_of(job)
        elif is_read(out.quiet):
            told = describe_totals(composed, means.workers, large.crop)
            report = told_of(
                out,
                large.picture.pixels.shape,
                told,
                large.at,
                job.shape,
                job.layers,
                job.placement,
                aligned,
            )
        write_large(out, composed, large, documents, means.store)
    return _reported(report, warnings, out)


def _stitch_clips(files: list[Path], given: dict[str, Any]) -> dict[str, Any]:
    """Join two clips; of the other options none means anything for them."""
    from toposeam_cli.media.clips.joining import ClipJob, join_clips
    from toposeam_cli.media.clips.reading import OneFrameError

    context = click.get_current_context()
    meant = {"first", "second", "output", "offset", "law", "max_megapixels", "force", "quiet"}
    for parameter in context.command.params:
        name = parameter.name or ""
        if name not in meant and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise ts.OptionError(
                f"{parameter.opts[0]} is for pictures, and --offset T,X,Y for clips; leave one out"
            )
    if len(files) != 2:
        raise ts.OptionError(f"--offset T,X,Y joins two clips, but {len(files)} are given; join them in turn")
    job = ClipJob(
        first=files[0],
        second=files[1],
        output=given["output"],
        offset=given["offset"],
        law=given["law"],
        max_pixels=round(given["max_megapixels"] * 1e6),
        force=given["force"],
    )
    with share_bar(f"joining {files[0].name} and {files[1].name}", given["quiet"]) as progress:
        try:
            told = join_clips(job, progress)
        except OneFrameError as error:
            raise click.UsageError(
                f"{error}; three numbers are for clips, and two pictures take X,Y, like 120,-4"
            ) from error
    if not given["quiet"]:
        click.echo(told)
    return {}
