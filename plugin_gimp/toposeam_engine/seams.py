"""The engine's operations on seams: functions from an :class:`~toposeam_engine.job.EngineJob` to a result."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.images import box_of
from toposeam_engine.job import EngineJob
from toposeam_engine.kept import kept_of
from toposeam_engine.layers import (
    avoided_on,
    blending,
    changes_of,
    layers_of,
    masks_of,
    selected_on,
    with_alpha,
)
from toposeam_engine.lines import lines_of
from toposeam_engine.places import Framed, PlacedLayers, framed, placed
from toposeam_engine.standing_out import standing_out

#: Fraction of the progress bar that is given to finding places, about its share of the time.
_FINDING_SHARE = 0.5
#: Share of a patch that must show beside what stands out in it, and where nothing does.
_LEAST_CORE, _USUAL_CORE = 0.05, 0.5


def stitch(job: EngineJob) -> dict[str, Any]:
    """Join the layers of a request, the lowest first, along seams.

    The result has the numbers of the layers that were joined; their places, if these were searched; new
    pixels, if they changed; masks; seams; what blending changes; and what the user is told.
    """
    given = layers_of(job)
    placed, found = stitched(job, given)
    result = placed.about | {"hidden": [placed.numbers[index] for index in found.hidden]}
    result["blend"] = found.blending.name
    layers, old = placed.layers, [given[number] for number in placed.numbers]
    if "crop" in job.options:
        made = framed(placed, found, str(job.options["crop"]))
        layers, found, result["canvas"] = made.layers, made.found, made.size
        result["noticed"], result["filled"] = _noticed(made, placed.numbers), _filled(job, made.shown)
    if job.options.get("places", "given") != "given":
        result["places"] = [list(layer.at) for layer in layers]
    if any(layer.image is not before.image for layer, before in zip(layers, old, strict=True)):
        result["pixels"] = [
            None if layer.image is before.image else job.write(with_alpha(layer.image, layer.alpha))
            for layer, before in zip(layers, old, strict=True)
        ]
    return result | _joined(job, layers, found)


def stitched(job: EngineJob, layers: Sequence[ts.Layer]) -> tuple[PlacedLayers, ts.layers.Composition]:
    """Place the layers, match their tones and join them; return them with the composition."""
    options = blending(job.options)
    start = _FINDING_SHARE if options.get("places") == "anywhere" else 0.0
    scans = options.get("pictures") == "scans"
    if options.get("places", "given") != "given":
        job.step("places")
    place = placed(layers, options, lambda share: job.progress(share * start))
    tones, shading = (options.pop(f"match_{what}", False) for what in ("tones", "shading"))
    if "crop" in job.options:  # of a panorama, whose vignetting is corrected with its tones or not at all
        shading = shading and tones
    if scans:
        tones = shading = False
        options |= {"blend": "none"}
        options.pop("blend_width", None)

    def report(share: float) -> None:
        job.progress(start + (1 - start) * share)

    options |= {"match_tones": tones, "match_shading": shading}
    job.step("seams")
    found = ts.stitch(place.layers, avoid=outside(job, place.layers), progress=report, **options)
    return place._replace(layers=list(found.layers)), found


def _noticed(made: Framed, numbers: Sequence[int]) -> dict[str, Any] | None:
    """Return the place on the canvas where a seam is most likely to be noticed; None if none is."""
    width, height = made.size
    (left, top), verdicts = made.found.origin, made.found.verdicts()
    for pair in sorted(verdicts, key=lambda pair: -verdicts[pair].visibility):
        for x, y in verdicts[pair].places:
            if 0 <= x + left < width and 0 <= y + top < height:
                return {"between": [numbers[index] for index in pair], "at": [x + left, y + top]}
    return None


def _filled(job: EngineJob, shown: ts.layers.Composition) -> dict[str, Any] | None:
    """Return a raster of the pixels that were filled, as no layer shows there; None if there are none."""
    if not shown.filled:
        return None
    image, alpha = shown.image, np.zeros(shown.shape, shown.image.dtype)
    for patch in shown.patches:
        patch.onto(shown.view, image, alpha)
    rows, columns = box_of(alpha > 0)
    raster = job.write(with_alpha(image[rows, columns], alpha[rows, columns]))
    return {**raster, "at": [columns.start, rows.start]}


def patch(job: EngineJob) -> dict[str, Any]:
    """Lay the selected part of the second layer on the first, within a seam."""
    layers = patch_layers(job)
    return _joined(job, layers, stitched_patch(job, layers))


def stitched_patch(job: EngineJob, layers: Sequence[ts.Layer]) -> ts.layers.Composition:
    """Join the layer below and the patch."""
    avoid = avoided_on(job, ts.layers.common_canvas(layers))
    options = blending(job.options)
    if not options.get("core"):
        options["core"] = _LEAST_CORE if layers[1].keep is not None else _USUAL_CORE
    return ts.stitch(layers, avoid=avoid, progress=job.progress, **options)


def patch_layers(job: EngineJob) -> list[ts.Layer]:
    """Read the layer below, and the patch with the selection as its mask. Unless a share of the patch must
    show, what stands out in it must.
    """
    below, above = layers_of(job)
    selected = selected_on(job, ts.layers.common_canvas([above]))
    if selected is None:
        return [below, above]
    keep = None if job.options.get("core") else standing_out(above.image, selected)
    return [below, dataclasses.replace(above, mask=selected, keep=keep)]


def outside(job: EngineJob, layers: Sequence[ts.Layer]) -> Any:
    """(H, W) bool mask of the layers' canvas: pixels that are not selected or that seams must avoid; None
    without either.
    """
    canvas = ts.layers.common_canvas(layers)
    selected, avoided = selected_on(job, canvas), avoided_on(job, canvas)
    if selected is None or avoided is None:
        return avoided if selected is None else ~selected
    return ~selected | avoided


def _joined(job: EngineJob, layers: Sequence[ts.Layer], found: ts.layers.Composition) -> dict[str, Any]:
    canvas = ts.layers.common_canvas(layers)
    job.step("blending")
    return {
        "masks": masks_of(job, layers, found.label_map, canvas),
        "labels": kept_of(layers, found.label_map, canvas).pack(job),
        "margin": [found.blending.margin, found.blending.grid],
        "seams": [
            {
                "pair": pair,
                "name": ts.layers.pair_name(*(found.names[index] for index in pair)),
                "lines": lines_of(seam.paths, np.array(found.origin, float)),
            }
            for pair, seam in zip(found.pairs, found.seams, strict=True)
        ],
        "blended": changes_of(job, layers, found, canvas),
    }
