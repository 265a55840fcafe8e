"""Join placed pictures: translate the options of a command into one call of core."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import toposeam as ts
from toposeam_cli.app.progress import share_bar
from toposeam_cli.stitching.inputs import PlacedPictures, read_avoid
from toposeam_cli.stitching.outputs import Outputs
from toposeam_cli.stitching.resample import toned_layers
from toposeam_cli.stitching.search_options import Means, SeamOptions


def join(
    job: PlacedPictures, find: SeamOptions, out: Outputs, files: Sequence[Path], means: Means
) -> ts.layers.Composition:
    """Join the pictures along seams.

    Raises
    ------
    TopoSeamError
        As :func:`toposeam.stitch` raises it, with the name of the file.
    """
    given = _keywords(job, find, out)
    layers: Sequence[ts.Layer] = job.layers
    if job.stored and (given["match_tones"] or given["match_shading"]):
        # Invalid options are refused before the pixels are read.
        ts.layers.StitchOptions.of(given)
        ts.layers.common_canvas(layers, max_megapixels=given["max_megapixels"])
        with share_bar("matching tones", out.quiet) as progress:
            layers = toned_layers(layers, bool(given["match_shading"]), means.store, means.workers, progress)
        given.update(match_tones=False, match_shading=False)
    executor = means.workers if job.stored else None
    try:
        with share_bar(f"joining {_names(job.layers)}", out.quiet) as progress:
            return ts.stitch(layers, executor=executor, progress=progress, **given)
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


def _keywords(job: PlacedPictures, find: SeamOptions, out: Outputs) -> dict[str, Any]:
    """Return the options as keywords of :func:`toposeam.stitch`."""
    given, limit = dict(find.stitch), find.of_stitch("max_megapixels")
    if find.plain:
        form = {} if find.formulation is None else {"formulation": find.formulation}
        given["options"] = ts.seam.ThesisOptions.plain(**form)
    elif find.formulation is not None:
        given["formulation"] = find.formulation
    if find.law is not None:
        given["cost"] = ts.seam.MatchCost(law=find.law)
    if find.avoid is not None:
        given["avoid"] = read_avoid(find.avoid, job.shape, limit)
    if find.use_seam:
        from toposeam_cli.stitching.seam_files import given_seams

        given["use_path"] = given_seams(find.use_seam, job)
    given["max_megapixels"] = max(limit, ts.MAX_PIXELS / 1e6)
    given["record_frames"] = out.history is not None
    return given


def _names(layers: Sequence[ts.Layer]) -> str:
    return f"{layers[0].name} and {layers[1].name}" if len(layers) == 2 else f"{len(layers)} pictures"
