"""Report of ``toposeam stitch`` on its result: a line for people, JSON for programs, a page to look at.

All are views of one summary (:meth:`toposeam.layers.Composition.summary`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from click.core import ParameterSource

import toposeam as ts
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.canvas.transforms import fitted_transforms, similarity
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.registration.placement import Residual, large_canvas
from toposeam.sentence import counted, printable
from toposeam_cli.media.pictures.lens import equivalent_mm
from toposeam_cli.stitching.inputs import PlacedPictures
from toposeam_cli.stitching.outputs import Outputs, box_of_crop
from toposeam_cli.stitching.rendering import Rendered
from toposeam_cli.stitching.search_options import correlations

if TYPE_CHECKING:
    from toposeam_cli.media.layouts.layout import LayoutStroke

#: Share of what pictures show below which a crop is told first.
_LITTLE = 0.75


def is_read(quiet: bool) -> bool:
    """Test whether anyone reads the report: people who did not pass ``--quiet``, or a batch.

    A batch uses what the command returns, and calls the command without its group.
    """
    return not quiet or click.get_current_context().parent is None


def summary_of_job(
    rendered: Rendered, job: PlacedPictures, aligned: ts.layers.Aligned | None
) -> dict[str, Any]:
    """Summarise a result for ``--json``.

    To the summary of the composition are added: `placement`, the places that were found, or None; `filled`,
    the share of the pixels that ``--fill-edges`` filled; `left_out`, a sentence for each picture that was
    left out; and `groups`, the summaries of further pictures that ``--groups`` made. For pictures that are
    stored in files the optima are left out, as they take longer than the seams.
    """
    rendered.verdicts()  # of the pixels that are there; the summary would render them again
    summary = rendered.composition.summary(optima=not job.stored)
    for index, place in enumerate(summary["layers"]):
        if aligned is not None:
            place["moved"] = aligned.shifts[index].tolist()
            place["correlation"] = _best_correlation(aligned.correlations, index)
        if job.placement is not None:
            place["correlation"] = _best_correlation(job.placement.correlations, index)
            place["turn"] = float(job.placement.turns[index])
            place["scale"] = float(job.placement.scales[index])
    more = {"filled": rendered.filled, "left_out": list(job.skipped), "groups": []}
    return summary | {"placement": _placement_summary(job)} | more


def lines_of_job(
    rendered: Rendered,
    job: PlacedPictures,
    aligned: ts.layers.Aligned | None,
    out: Outputs,
    executor: Executor | None = None,
) -> str:
    """Describe a result for people: its size, the share kept, and whether its seams are visible, in one line;
    with ``--verbose`` before that the places of its pictures, and its seams.
    """
    composed = rendered.composition
    height, width = composed.shape
    size, kept = f"{width} × {height} px", f"{100 * composed.kept:.0f} % kept"
    if rendered.at is not None and composed.kept < _LITTLE and box_of_crop(out.crop) is None:
        size = f"only {kept}{_kept_by(out)}; {size}"
    elif rendered.at is not None:
        size = f"{size}, {kept}"
    if rendered.filled:
        size += f", {100 * rendered.filled:.1f} % filled"
    if click.get_current_context().params.get("give"):
        size += f", bent by up to {composed.bent:.1f} px" if composed.bent else ", bent nowhere"
    lines = [f"{out.output}: {size}{_judged(rendered, executor)}"]
    if out.verbose:
        found = [*_placement_lines(job.layers, job.placement), *_describe_alignment(job.layers, aligned)]
        lines = [*found, _describe_seams(composed, executor), *lines]
    return "\n".join(map(printable, lines))


def _judged(rendered: Rendered, executor: Executor | None) -> str:
    """Say whether seams are visible in the picture, and whether the search of one failed."""
    composed = rendered.composition
    if not composed.pairs:
        return f", {len(composed.names)} layers without a seam"
    verdict = max(rendered.verdicts(executor), key=lambda one: one.visibility, default=None)
    judged = "" if verdict is None else f": {verdict}"
    if len(composed.names) == 2:
        (seam,) = composed.outlines
        if seam.termination == ts.optimize.Termination.ITERATIONS:
            judged += "; the heat did not settle on a single line, so this is the best cut of what it left"
    return judged


def _describe_seams(composed: ts.layers.Composition, executor: Executor | None) -> str:
    """Describe the search of the seams of a composition."""
    figures, solution = composed.figures(executor).values(), composed.solution
    length, cost = round(sum(one.length for one in figures)), sum(one.cost for one in figures)
    if len(composed.names) == 2 and composed.pairs:
        (seam,) = composed.outlines
        steps = f" in {counted(seam.iterations, 'iteration')}" if seam.iterations else ""
        found = f"seam of {length} px by {solution.method}{steps}"
    else:
        found = (
            f"{len(composed.names)} layers, {counted(len(composed.pairs), 'seam')} of {length} px in all by "
            f"{solution.method}, {counted(solution.rounds, 'round')}"
        )
    return f"{found}, cost {cost:.4g}, {solution.seconds:.2f} s"


def _kept_by(out: Outputs) -> str:
    """Name the options that keep the whole picture, unless a crop was given."""
    context = click.get_current_context()
    given = (context.get_parameter_source(name) for name in ("crop", "fill_edges"))
    if ParameterSource.COMMANDLINE in given:
        return ""
    ground = "" if out.has_alpha else " --background white"
    return f", --crop outside{ground} keeps all"


def _describe_alignment(layers: tuple[ts.Layer, ...], aligned: ts.layers.Aligned | None) -> list[str]:
    """Describe each layer that was moved, in one line."""
    if aligned is None:
        return []
    lines = []
    for index, layer in enumerate(layers):
        x, y = aligned.shifts[index]
        correlation = _best_correlation(aligned.correlations, index) or 0.0
        lines.append(
            f"{layer.name}: at {layer.at[0]},{layer.at[1]}, moved by {x},{y} (correlation {correlation:.2f})"
        )
    return lines


def hidden(composed: ts.layers.Composition, remedy: str) -> list[str]:
    """Name the pictures that show nowhere, in a sentence, with the option that makes them show; empty if
    there are none.
    """
    names = [composed.names[index] for index in composed.hidden]
    if not names:
        return []
    do, them = ("does", "it") if len(names) == 1 else ("do", "them")
    return [f"{', '.join(names)} {do} not show, as others cover {them} and join better without; {remedy}"]


def lost_strokes(composed: ts.layers.Composition, strokes: Sequence[LayoutStroke] | None) -> list[str]:
    """Say in a sentence which of the strokes change nothing."""
    lost = composed.solution.lost_strokes
    if not lost or strokes is None:
        return []
    names = ", ".join(dict.fromkeys(composed.names[strokes[number].layer] for number in lost))
    return [
        f"{counted(len(lost), 'stroke')} on {names} changed nothing, as the picture has no pixels there "
        "or no other one has; paint where pictures overlap"
    ]


def documents_of(
    rendered: Rendered, job: PlacedPictures, out: Outputs, executor: Executor | None
) -> dict[Path, bytes]:
    """Return the documents of a result, by their files: seams, history and page."""
    composed, documents = rendered.composition, dict[Path, bytes]()
    if out.seam is not None:
        documents[out.seam] = composed.to_svg().encode()
    if out.history is not None:
        from toposeam_cli.figures.search import draw_search

        documents[out.history] = draw_search(composed.seams[0], out.history.suffix)
    if out.report is not None:
        from toposeam_cli.stitching.seam_page import seam_page

        page = seam_page(out.output.name, job.layers, rendered, correlations(job, executor))
        documents[out.report] = page.encode(errors="backslashreplace")
    return documents


def _placement_lines(layers: tuple[ts.Layer, ...], placement: ts.layers.Placement | None) -> list[str]:
    """Describe the places that were found, in lines of text."""
    if placement is None:
        return []
    if placement.model in ("shift", "similarity"):
        return [_moved(layers, placement, index) for index in range(len(layers))]
    pairs = counted(len(placement.residuals), "pair")
    left = f"{placement.misfit:.2f} px" if placement.misfit < 10 else f"{placement.misfit:.0f} px"
    mesh = f", bent by up to {placement.bent:.0f} px" if placement.bent else ""
    if placement.model == "plane" or placement.focal is None:
        return [
            f"{len(layers)} pictures of one plane by {pairs}{mesh}, at most {left} left in the median of one"
        ]
    several = zip(placement.focals, placement.sizes, strict=True)
    lengths = sorted({round(equivalent_mm(focal, size)) for focal, size in several})
    length = f"length {lengths[0]}" if len(lengths) == 1 else f"lengths {lengths[0]} to {lengths[-1]}"
    bent = f", distortion {placement.distortion:+.4f}" if placement.distortion else ""
    wide = ", all the way round" if placement.wrap else ""
    return [
        f"{len(layers)} pictures of a camera that turned, by {pairs}{mesh}, at most {left} left in the "
        f"median of one; focal {length} mm of 24 × 36{bent}, projection {placement.projection}{wide}"
    ]


def _best_correlation(correlations: dict[tuple[int, int], float], index: int) -> float | None:
    """Return the best correlation of a picture with another one; None if none is known."""
    found = [value for pair, value in correlations.items() if index in pair and np.isfinite(value)]
    return max(found) if found else None


def _moved(layers: tuple[ts.Layer, ...], placement: ts.layers.Placement, index: int) -> str:
    x, y = placement.places[index]
    correlation = _best_correlation(placement.correlations, index)
    how = "by given points" if correlation is None else f"correlation {correlation:.2f}"
    text = f"{layers[index].name}: found at {x:.1f},{y:.1f} ({how}"
    if placement.turns.any():
        text += f", turned by {placement.turns[index]:.2f}°, scaled by {placement.scales[index]:.4f}"
    return f"{text})"


def doubts(job: PlacedPictures) -> list[str]:
    """Return what is doubtful about the places of pictures, in sentences."""
    if job.placement is not None:
        return [*job.placement.doubts, *_within_others(job.layers)]
    pixels = sum(picture.pixels.shape[0] * picture.pixels.shape[1] for picture in job.pictures)
    return large_canvas(job.layers, pixels)


def _within_others(layers: Sequence[ts.Layer]) -> list[str]:
    """Name the one of two pictures that lies within the other, in a sentence."""
    if len(layers) != 2 or layers[0].alpha is not None or layers[1].alpha is not None:
        return []  # of more, those that do not show are named
    a, b = extent_of(layers).places
    inside = [index for index in (1, 0) if a.shared(b) == (a, b)[index]]
    return [
        f"{layers[index].name} shows nothing that {layers[1 - index].name} does not show as well; leave "
        "it out unless it is to cover what is there"
        for index in inside[:1]
    ]


def misfits(rendered: Rendered, job: PlacedPictures, executor: Executor | None) -> list[str]:
    """Say in a sentence where a seam passes what does not fit, if it is likely to be noticed."""
    if job.placement is None:
        return []
    (bent,) = fitted_transforms([similarity((0, 0))], job.boundary, job.wrap)
    rendered.verdicts(executor)  # of the pixels that are there
    found = rendered.composition.misfits(job.placement, bent.to_canvas, executor)
    if not found:
        return []
    (i, j), off, (x, y) = found[0]
    more = f" ({counted(len(found) - 1, 'more such seam')})" if len(found) > 1 else ""
    return [
        f"the seam between {job.layers[i].name} and {job.layers[j].name} passes what is {off:.0f} px apart "
        f"near {x},{y}{more}; toposeam edit moves it"
    ]


def _placement_summary(job: PlacedPictures) -> dict[str, Any] | None:
    """Summarise the places that were found, for ``--json``; None if they were given.

    What is unknown of a camera is None.
    """
    placement = job.placement
    if placement is None:
        return None
    names = [layer.name for layer in job.layers]
    camera = dict.fromkeys(("focal_px", "focal_mm", "distortion", "projection", "wrap"))
    if placement.focal is not None:
        camera = {
            "focal_px": placement.focal,
            "focal_mm": equivalent_mm(placement.focal, placement.sizes[0]),
            "distortion": placement.distortion,
            "projection": placement.projection,
            "wrap": placement.wrap,
        }
    pairs = [
        {"between": [names[i], names[j]], **_pair_summary(residual, placement.correlations[i, j])}
        for (i, j), residual in placement.residuals.items()
    ]
    found = {"model": placement.model, "misfit_px": placement.misfit, **camera, "pairs": pairs}
    told = {"left_out": list(placement.left_out.values()), "doubts": list(placement.doubts)}
    return found | {"bent_px": round(placement.bent, 2), "used": len(names)} | told


def _pair_summary(residual: Residual, correlation: float) -> dict[str, Any]:
    return {
        "features": residual.features,
        "points": residual.points,
        "median_px": residual.median,
        "farthest_px": residual.farthest,
        "correlation": correlation if np.isfinite(correlation) else None,
    }
