"""The engine's operations on seams: functions from an :class:`~toposeam_engine.job.EngineJob` to what
goes into the result.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.layers.canvas.layer import Extent
from toposeam.vector.svg import SvgSeam
from toposeam_engine.job import EngineJob
from toposeam_engine.layers import changes_of, layers_of, masks_of, selected_on, with_alpha

#: The share of the work that finding places takes, about.
_FINDING = 0.5


def stitch(job: EngineJob) -> dict[str, Any]:
    """Layers, first the lowest, joined along seams: masks, seams, the layers' places where these were sought,
    their pixels where they have others now, and what blending changes.
    """
    given = layers_of(job)
    layers, found = stitched(job, given)
    result: dict[str, Any] = {}
    if job.options.get("places", "given") != "given":
        result["places"] = [list(layer.at) for layer in layers]
    if any(layer.image is not old.image for layer, old in zip(layers, given, strict=True)):
        result["pixels"] = [
            None if layer.image is old.image else job.write(with_alpha(layer.image, layer.alpha))
            for layer, old in zip(layers, given, strict=True)
        ]
    return result | {"hidden": found.hidden} | _joined(job, layers, found)


def stitched(job: EngineJob, layers: Sequence[ts.Layer]) -> tuple[list[ts.Layer], ts.Stitched]:
    """Return the layers, in the places and tones asked for, and what they make."""
    options, start = blending(job.options), 0.0
    places = options.pop("places", "given")
    if places == "near":
        layers = ts.align(layers).layers
    elif places == "anywhere":
        start = _FINDING
        found = ts.find_places(layers, progress=lambda share: job.progress(share * start))
        if found.left_out:
            names = [layers[number].name for number in found.left_out]
            kind, data = ("fits none", {"name": names[0]}) if len(names) == 1 else ("fit none", {})
            raise ts.OverlapError(
                "{reasons}",
                kind=kind,
                reasons="; ".join(found.left_out.values()),
                **data,
                names=", ".join(names),
            )
        layers = _on_canvas(found.layers, layers[0].at)
    elif places != "given":
        raise ts.OptionError(f"places is {places!r}; give 'given', 'near' or 'anywhere'")
    tones, shading = (options.pop(f"match_{what}", False) for what in ("tones", "shading"))
    if tones or shading:
        layers = ts.match_tones(layers, shading=shading)

    def report(share: float) -> None:
        job.progress(start + (1 - start) * share)

    return list(layers), ts.stitch(layers, avoid=outside(job, layers), progress=report, **options)


def _on_canvas(layers: Sequence[ts.Layer], first: tuple[int, int]) -> list[ts.Layer]:
    """Move layers together so that the first one lies where it lay, or as near to that as leaves nothing to
    the left of the asker's canvas or above it.
    """
    shift = [max(first[axis], -min(layer.at[axis] for layer in layers)) for axis in (0, 1)]
    return [
        dataclasses.replace(layer, at=(layer.at[0] + shift[0], layer.at[1] + shift[1])) for layer in layers
    ]


def patch(job: EngineJob) -> dict[str, Any]:
    """Return the second layer, where it is selected, laid on the first within a seam."""
    layers = patch_layers(job)
    return _joined(job, layers, ts.stitch(layers, progress=job.progress, **blending(job.options)))


def patch_layers(job: EngineJob) -> list[ts.Layer]:
    """Read the layer below, and the patch where it is selected."""
    below, above = layers_of(job)
    selected = selected_on(job, ts.common_canvas([above]))
    return [below, above if selected is None else dataclasses.replace(above, mask=selected)]


def restitch(job: EngineJob) -> dict[str, Any]:
    """Join layers along given paths.

    Of two layers the paths say everything. Of more, each pair whose path was touched divides anew what the
    two of them show.
    """
    layers = layers_of(job)
    canvas = ts.common_canvas(layers)
    masks = [np.zeros(canvas.shape, bool) for _ in layers]
    for layer, mask, shown in zip(layers, masks, job.request["shown"], strict=False):
        mask[canvas.place(layer).slices] = job.read(shown) >= 128
    seams = [seam for seam in job.request["seams"] if len(layers) == 2 or seam["touched"]]
    paths = {(int(seam["pair"][0]), int(seam["pair"][1])): _drawing(seam, canvas) for seam in seams}
    found = ts.restitch(layers, masks, paths, **blending(job.options))
    return {
        "masks": masks_of(job, layers, found.masks, canvas),
        "blended": changes_of(job, layers, found, canvas),
    }


def outside(job: EngineJob, layers: Sequence[ts.Layer]) -> Any:
    """(H, W) bool on the layers' canvas: what the selection leaves out; None without one."""
    selected = selected_on(job, ts.common_canvas(layers)) if job.request.get("selection") else None
    return None if selected is None else ~selected


def blending(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options; a width of 0 means the usual one, and some ways of blending have none."""
    chosen = dict(options)
    if law := chosen.pop("law", None):
        chosen["cost"] = ts.MatchCost(law=law)
    width = chosen.pop("blend_width", 0)
    if width and chosen.get("blend") in ("feather", "multiband", "gradient"):
        chosen["blend_width"] = float(width)
    return chosen


def _joined(job: EngineJob, layers: Sequence[ts.Layer], found: ts.Stitched) -> dict[str, Any]:
    canvas = ts.common_canvas(layers)
    return {
        "masks": masks_of(job, layers, found.masks, canvas),
        "seams": [
            {
                "pair": pair,
                "name": ts.pair_name(*(found.names[index] for index in pair)),
                "lines": _lines(seam, found.origin),
            }
            for pair, seam in zip(found.pairs, found.seams, strict=True)
        ],
        "blended": changes_of(job, layers, found, canvas),
    }


def _drawing(entry: Mapping[str, Any], canvas: Extent) -> SvgSeam:
    """Return the lines of a seam, on the canvas."""
    shift = np.array(canvas.origin, float)
    lines = tuple(
        ts.Polyline(np.array(line["points"], float).reshape(-1, 2) - shift, bool(line["closed"]))
        for line in entry["lines"]
    )
    height, width = canvas.shape
    return SvgSeam(lines, width, height, None, (str(entry["name"]),) * len(lines))


def _lines(seam: ts.Seam, origin: tuple[int, int]) -> list[dict[str, Any]]:
    """Return the lines of a seam as the asker needs them: exact, as few curves for people to bend, and what
    each of these stands for.
    """
    lines = []
    for path in seam.paths:
        line = ts.Polyline(path.points + np.array(origin, float), path.closed)
        smooth = ts.smooth_path(line)
        lines.append(
            {
                "closed": line.closed,
                "points": line.points.ravel().tolist(),
                "curves": smooth.curves.reshape(-1, 8).tolist(),
                "pieces": [smooth.piece(index).ravel().tolist() for index in range(len(smooth.curves))],
            }
        )
    return lines
