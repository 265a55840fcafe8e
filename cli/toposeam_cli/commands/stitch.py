"""``toposeam stitch``: overlapping pictures become one."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import toposeam as ts
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, check_inputs, force_option, placement, quiet_option, taken
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.app.registry import numerics_loading
from toposeam_cli.files.folders import in_folders
from toposeam_cli.files.writing import all_or_nothing
from toposeam_cli.stitching.outputs import Outputs, check_outputs, crop_of, numbered, output_options
from toposeam_cli.stitching.place_options import (
    FindingOptions,
    finding_options,
    is_fitted,
    kind_of,
    with_defaults,
)
from toposeam_cli.stitching.positions import ALONE, LAYOUTS, Where, position_options, width_round
from toposeam_cli.stitching.search_options import (
    Means,
    SeamOptions,
    by_windows,
    check_finding,
    means_of,
    seam_options,
    shared_work,
    strangers,
)

if TYPE_CHECKING:
    from toposeam_cli.media.layouts.layout import Layout
    from toposeam_cli.stitching.inputs import PlacedPictures


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
@output_options
@position_options
@placement(500.0)
@finding_options
@seam_options
@shared_work
@force_option
@quiet_option
def stitch(first: Path, second: Path | None, others: tuple[Path, ...], **given: Any) -> dict[str, Any]:
    """Join pictures where they overlap, along seams that nobody sees.

    A is the first picture, or a folder, an OpenRaster file (.ora), layout (.toml, .json) or Hugin project
    (.pto) with all of them; later pictures lie on top. Unless you say where
    they lie, or TIFF files by Hugin's nona do, places are found from what the pictures show, and pictures are
    warped as needed.

    \b
    toposeam stitch *.jpg -o all.jpg
    toposeam stitch holiday/ -o all.jpg   (every panorama in it: all.jpg, all-2.jpg, ...)
    toposeam stitch left.png right.png --overlap 120 -o joined.png
    toposeam stitch map1.tif map2.tif --offset 1830,-12 -o map.tif --seam seam.svg
    toposeam stitch a.jpg b.jpg c.jpg --at 0,0 --at 900,10 --at 450,700 --align -o all.ora
    toposeam stitch one.mp4 two.mp4 --offset 48,0,0 -o both.mp4   (clips: frames,x,y)
    """  # noqa: D301 - click wants the character
    files = [path for path in (first, second, *others) if path is not None]
    if given["offset"] is not None and len(given["offset"]) == 3:
        return _stitch_clips(files, given)
    if any(map(os.path.isdir, files)):
        files, left_out = in_folders(files, given["output"])
        given["skip_bad"] = True
        if left_out and not given["quiet"]:
            say(f"left out, as they are no pictures: {', '.join(left_out)}", err=True)
    layout = None
    if len(files) == 1 and files[0].suffix.lower() in LAYOUTS:
        from toposeam_cli.stitching.saved_layout import taken_layout

        layout = taken_layout(files[0], given)
    where, out, finding = taken(Where, given), taken(Outputs, given), taken(FindingOptions, given)
    check_outputs(out)
    if len(files) > 1 and not given["skip_bad"] and {path.suffix.lower() for path in files}.isdisjoint(ALONE):
        check_inputs(files)
    with numerics_loading():
        import toposeam_cli.stitching.joining
        import toposeam_cli.stitching.report  # noqa: F401 - what all stitches need
    find = SeamOptions.taken(given)
    check_finding(find, out, given["dask"])
    if out.save_layout is not None:
        from toposeam_cli.stitching.saved_layout import check_saving

        check_saving(out, files, layout, placed=where != Where() or finding.is_plane)
    one = {"--mask-for": given["masks"], "--keep": given["keeps"], "--use-seam": find.use_seam}
    finding = finding.with_groups([name for name, value in one.items() if value])
    if finding.groups:
        check_outputs(numbered(out, 2))

    def joined(
        members: Sequence[Path], finding: FindingOptions, out: Outputs
    ) -> tuple[PlacedPictures, dict[str, Any]]:
        with means_of(out.output.parent, members, given["processes"], given["dask"]) as means:
            return _stitch(members, where, finding, find, out, given, layout, means)

    job, result = joined(files, finding, out)
    written = [(out.output, str(result.get("report", out.output)))]
    for number, members in enumerate(() if finding.groups is False else job.other_groups, 2):
        own = numbered(out, number)
        try:
            check_outputs(own)
            found = joined(members, finding.without_names(files, members), own)[1]
            written.append((own.output, str(found.get("report", own.output))))
            result.setdefault("groups", []).append(found)
        except ts.OverlapError as error:
            say(f"left out: {error}", err=True)
    if out.contact is not None:
        from toposeam_cli.stitching.contact_sheet import write_contact_sheet

        write_contact_sheet(out.contact, written, out.force)
    if out.as_json:
        say(json.dumps(result, indent=2), lines=True)
    return result


def _stitch(
    files: Sequence[Path],
    where: Where,
    finding: FindingOptions,
    find: SeamOptions,
    out: Outputs,
    given: dict[str, Any],
    layout: Layout | None,
    means: Means,
) -> tuple[PlacedPictures, dict[str, Any]]:
    """Return the pictures and what is reported of them joined; as JSON, it is not printed yet."""
    from toposeam.images import Windows
    from toposeam_cli.stitching.inputs import arrange
    from toposeam_cli.stitching.joining import join
    from toposeam_cli.stitching.rendering import render, write
    from toposeam_cli.stitching.report import (
        documents_of,
        doubts,
        hidden,
        is_read,
        lines_of_job,
        lost_strokes,
        misfits,
        summary_of_job,
    )

    with share_bar("placing", out.quiet) as progress:
        job = arrange(
            files,
            where,
            masks=given["masks"],
            keeps=given["keeps"],
            max_megapixels=find.of_stitch("max_megapixels"),
            skip_bad=given["skip_bad"],
            progress=progress,
            scratch=means.store if by_windows(out, find) else None,
            executor=means.workers,
            stores=means.stores,
            finding=finding.of(files if layout is None else layout.files),
            fits=partial(is_fitted, finding=finding, out=out),
        )
    for reason in job.skipped:
        say(f"left out: {reason}", err=True)
    kind = kind_of(job.transforms, finding, found=job.placement is not None)
    find, out = with_defaults(find, out, kind)
    if not all(isinstance(layer.image, Windows) for layer in job.layers):
        means = dataclasses.replace(means, workers=None)
    _check_pictures(job, find, out)
    unaligned, aligned = job, None
    if find.align:
        radius = {} if find.align_radius is None else {"radius": find.align_radius}
        aligned = ts.layers.align(job.layers, executor=means.workers, **radius)
        job = dataclasses.replace(job, layers=aligned.layers)
    wrap = find.of_stitch("wrap")
    find = find.with_stitch(wrap=width_round(job.wrap if wrap is None else wrap, job.files or files))
    crop = crop_of(out, job.layers, find.of_stitch("wrap"))
    if len(job.layers) > 2:
        from toposeam.layers.labelling.posing import check_pairs

        check_pairs(job.layers)
    documents, warnings = dict[Path, bytes](), list[str]()
    if layout is not None or out.save_layout is not None:
        find, documents, warnings = _by_layout(layout, (job, unaligned), find, out, kind)
    if not out.quiet:
        warnings += [*doubts(job), *strangers(job, find.of_stitch("wrap"), means.workers)]
    composed = join(job, find, out, files, means)
    if not out.quiet:
        warnings += hidden(composed, _remedy_for_hidden(find))
        warnings += lost_strokes(composed, find.of_stitch("strokes"))
    with all_or_nothing():
        with share_bar("writing", out.quiet or not job.stored) as progress:
            rendered = render(composed, job, out, crop, means.store, progress, means.workers)
        warnings += [] if out.quiet else misfits(rendered, job, means.workers)
        documents |= documents_of(rendered, job, out, means.workers)
        report: dict[str, Any] = {}
        if out.as_json:
            report = summary_of_job(rendered, job, aligned)
        elif is_read(out.quiet):
            report = {"report": lines_of_job(rendered, job, aligned, out, means.workers)}
        write(out, job, rendered, documents, means.store)
    if "report" in report and not out.quiet:
        say(report["report"], lines=True)
    for warning in warnings:
        say(f"warning: {warning}", err=True)
    return job, report


def _by_layout(
    layout: Layout | None,
    jobs: tuple[PlacedPictures, PlacedPictures],
    find: SeamOptions,
    out: Outputs,
    kind: str,
) -> tuple[SeamOptions, dict[Path, bytes], list[str]]:
    """Return the options with what a layout has painted, the files of the one to be saved, and what it
    cannot hold, or why it is not written; `jobs` are the pictures as they are joined, and before alignment.
    """
    from toposeam_cli.stitching.saved_layout import lost_in_project, painted, saved_layout

    painting = {} if layout is None else painted(layout, jobs[0], find)
    find = find.with_stitch(**painting)
    saved = out.save_layout
    if saved is None:
        return find, {}, []
    try:
        documents = saved_layout(*jobs, saved, kind, painting)
    except ts.OptionError as error:
        if jobs[0].placement is None:
            raise
        return find, {}, [f"{saved} was not written: {error}"]  # it never costs the picture
    return find, documents, [] if out.quiet else lost_in_project(jobs[0], saved, painting)


def _check_pictures(job: PlacedPictures, find: SeamOptions, out: Outputs) -> None:
    """Refuse options that are for two pictures, or for another number."""
    if len(job.layers) == 2 and find.use_seam and find.of_stitch("method") != "auto":
        raise ts.OptionError("--method finds a seam and --use-seam gives it; leave one of them out")
    if len(job.layers) > 2 and out.history is not None:
        raise ts.OptionError(
            f"--history shows how one seam was found, but there are {len(job.layers)} pictures; leave it out"
        )


def _remedy_for_hidden(find: SeamOptions) -> str:
    """Return what lets pictures show that show nowhere."""
    core = find.of_stitch("core")
    middle = "--core 0.5 shows the middle of all pictures inside others, " if core is None else ""
    return f"{middle}--keep N=MASK what you want of one"


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
        say(told)
    return {}
