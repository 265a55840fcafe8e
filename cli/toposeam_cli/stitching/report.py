"""Report of ``toposeam stitch`` on its result: for people on one line, for programs as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import click
import numpy as np
from click.core import ParameterSource

import toposeam as ts
from toposeam.sentence import counted
from toposeam_cli.stitching.outputs import Outputs
from toposeam_cli.stitching.placement_report import best_correlation, describe_placement

#: left, top, width and height of what is written of the canvas, px.
Crop: TypeAlias = tuple[int, int, int, int]


def crop_at(corner: tuple[int, int] | None, shape: tuple[int, ...]) -> Crop | None:
    """Return the crop of that shape, (height, width, ...), at a corner; None where nothing was cropped."""
    return None if corner is None else (*corner, shape[1], shape[0])


def is_read(quiet: bool) -> bool:
    """Test whether the report is read: by people who did not ask for quiet, and by batches, which take what
    it returns and run it without its group.
    """
    return not quiet or click.get_current_context().parent is None


def told_of(
    out: Outputs,
    shape: tuple[int, ...],
    seams: str,
    at: tuple[int, int] | None,
    whole: tuple[int, int],
    layers: tuple[ts.Layer, ...],
    placement: ts.layers.Placement | None,
    aligned: ts.layers.Aligned | None,
) -> str:
    """Describe a result of a shape, cropped from a corner of a whole, for people."""
    text = f"{out.output}: {shape[1]} × {shape[0]} px, {seams}"
    if at is not None:
        text += f", cropped to what has no holes, from {at[0]},{at[1]}"
        text += f" ({100 * shape[0] * shape[1] / math.prod(whole):.0f} % of it)"
        text += _kept_by(out) if shape[:2] != tuple(whole) else ""
    return "\n".join([*describe_placement(layers, placement), *describe_alignment(layers, aligned), text])


def _kept_by(out: Outputs) -> str:
    """Return which options keep all of a picture, unless its crop was asked for."""
    context = click.get_current_context()
    given = (context.get_parameter_source(name) for name in ("crop", "fill_edges"))
    if ParameterSource.COMMANDLINE in given:
        return ""
    ground = "" if out.has_alpha else " --background white"
    return f"; --crop outside{ground} keeps all"


def summary_of_all(
    stitched: ts.layers.Stitched,
    layers: tuple[ts.Layer, ...],
    aligned: ts.layers.Aligned | None,
    placement: ts.layers.Placement | None = None,
    crop: Crop | None = None,
) -> dict[str, Any]:
    """Summarise a result for ``--json``: the seam of two pictures, or layers and seams of more. Verdicts are
    about what the crop shows.
    """
    places = {"layers": [_place(index, stitched, layers[index], aligned) for index in range(len(layers))]}
    if placement is not None:
        for index, place in enumerate(places["layers"]):
            place["correlation"] = best_correlation(placement.correlations, index)
            place["turn"], place["scale"] = float(placement.turns[index]), float(placement.scales[index])
    if len(layers) == 2:
        told = aligned is not None or placement is not None
        seam = stitched.seams[0]
        return seam.summary() | summary_inside([seam.verdict], crop) | (places if told else {})
    seams = [
        {
            "between": [layers[i].name, layers[j].name],
            **seam.summary(),
            **summary_inside([seam.verdict], crop),
        }
        for (i, j), seam in zip(stitched.pairs, stitched.seams, strict=True)
    ]
    likeness = summary_inside([seam.verdict for seam in stitched.seams], crop)
    return {"cost": stitched.cost, "rounds": stitched.rounds, **likeness, **places, "seams": seams}


def summary_inside(verdicts: Sequence[ts.seam.Verdict | None], crop: Crop | None) -> dict[str, Any]:
    """Summarise the worst of some verdicts about what a crop shows; nothing where there are none."""
    verdict = worst_inside(verdicts, crop)
    return {} if verdict is None else verdict.summary()


def worst_inside(verdicts: Sequence[ts.seam.Verdict | None], crop: Crop | None) -> ts.seam.Verdict | None:
    """Choose the worst of some verdicts about what a crop shows."""
    known = [verdict.inside(crop) for verdict in verdicts if verdict is not None]
    return min(known, key=lambda verdict: verdict.worst) if known else None


def _place(
    index: int, stitched: ts.layers.Stitched, layer: ts.Layer, aligned: ts.layers.Aligned | None
) -> dict[str, Any]:
    place: dict[str, Any] = {
        "name": layer.name,
        "at": list(layer.at),
        "shown_px": int(np.count_nonzero(stitched.label_map == index)),
    }
    if aligned is not None:
        place["moved"] = aligned.shifts[index].tolist()
        place["correlation"] = best_correlation(aligned.correlations, index)
    return place


def hidden(composed: ts.layers.Composition, remedy: str) -> list[str]:
    """Return a sentence about the pictures that show nowhere, where there are any, and what lets them
    show.
    """
    names = [composed.names[index] for index in composed.hidden]
    if not names:
        return []
    do, them = ("does", "it") if len(names) == 1 else ("do", "them")
    return [f"{', '.join(names)} {do} not show, as others cover {them} and join better without; {remedy}"]


def describe_alignment(layers: tuple[ts.Layer, ...], aligned: ts.layers.Aligned | None) -> list[str]:
    """Return one line per layer that was moved."""
    if aligned is None:
        return []
    lines = []
    for index, layer in enumerate(layers):
        x, y = aligned.shifts[index]
        correlation = best_correlation(aligned.correlations, index) or 0.0
        lines.append(
            f"{layer.name}: at {layer.at[0]},{layer.at[1]}, moved by {x},{y} (correlation {correlation:.2f})"
        )
    return lines


def describe(seam: ts.seam.Seam, crop: Crop | None = None) -> str:
    """Return one line about the seam of two layers for people, of a picture that may be cropped."""
    effort = f" in {counted(len(seam.history), 'iteration')}" if seam.history else ""
    verdict = worst_inside([seam.verdict], crop)
    text = (
        f"seam of {round(seam.length)} px by {seam.method}{effort}, cost {seam.cost:.4g}, "
        f"{seam.seconds:.2f} s{'' if verdict is None else f': {verdict}'}"
    )
    if seam.termination == ts.optimize.Termination.ITERATIONS:
        text += "; the heat did not settle on a single line, so this is the best cut of what it left"
    return text
