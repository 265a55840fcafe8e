"""Join placed pictures: translate the options of a command into one call of core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import toposeam as ts
from toposeam_cli.app.options import Keyed
from toposeam_cli.app.progress import share_bar
from toposeam_cli.stitching.inputs import PlacedPictures, canvas_megapixels, read_avoid
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
    if job.stored and means.store is not None and (given["match_tones"] or given["match_shading"]):
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
    if (avoid := find.of_stitch("avoid")) is not None:
        given["avoid"] = read_avoid(avoid, job.shape, limit)
    if "strokes" in given:
        given["strokes"] = [ts.layers.Stroke(**asdict(stroke)) for stroke in given["strokes"]]
    if "preview" in given:
        label_map, at, scale = given["preview"]
        given["preview"] = ts.layers.LabelMap(labels=label_map, at=at, scale=scale)
    if find.use_seam:
        given["use_path"] = given_seams(find.use_seam, job)
    given["max_megapixels"] = canvas_megapixels(limit)
    given["record_frames"] = out.history is not None
    return given


def _names(layers: Sequence[ts.Layer]) -> str:
    return f"{layers[0].name} and {layers[1].name}" if len(layers) == 2 else f"{len(layers)} pictures"


def given_seams(files: Sequence[Keyed], placed: PlacedPictures) -> dict[tuple[int, int], ts.vector.SvgSeam]:
    """Read the seams of ``--use-seam`` by pair.

    It is ``seam.svg``, ``0:1=seam.svg``, or a file in which paths are named after their pairs.
    """
    seams: dict[tuple[int, int], ts.vector.SvgSeam] = {}
    names = [layer.name for layer in placed.layers]
    for file in files:
        try:
            drawing = ts.vector.read_svg(file.path)
        except ts.PathError as error:
            if "file" in error.data:
                raise
            raise error.within("'{file}': {error}", file=str(file.path)) from error
        if file.key is not None:
            first, colon, second = file.key.partition(":")
            if not colon:
                raise ts.OptionError(
                    f"--use-seam {file.key}=… names no pair; write it as 0:1={file.path.name}"
                )
            i, j = placed.number(first), placed.number(second)
            found = {} if i is None or j is None else {(i, j): drawing}
        elif len(names) == 2:
            found = {(0, 1): drawing}
        else:
            found = _by_name(file.path, drawing, placed)
        for between, one in found.items():
            pair = (min(between), max(between))
            if pair in seams:
                raise ts.OptionError(
                    f"two seams are given between {names[pair[0]]} and {names[pair[1]]}; leave one of them "
                    "out"
                )
            seams[pair] = one
    return seams


def _by_name(
    path: Path, drawing: ts.vector.SvgSeam, placed: PlacedPictures
) -> dict[tuple[int, int], ts.vector.SvgSeam]:
    names = [layer.name for layer in placed.layers]
    pairs = {
        ts.layers.pair_name(names[i], names[j]): (i, j)
        for i in range(len(names))
        for j in range(i + 1, len(names))
    }
    gone = _of_lost(names, placed.lost)
    stranger = next((name for name in drawing.names if name not in pairs and name not in gone), None)
    if stranger is not None:
        raise ts.PathError(
            "'{file}': the path {name!r} names no pair; call it as {example!r}, or use "
            "--use-seam 0:1={file_name}",
            kind="no pair",
            file=str(path),
            name=stranger,
            example=next(iter(pairs)),
            file_name=path.name,
        )
    found = {}
    for name in dict.fromkeys(name for name in drawing.names if name in pairs):
        lines = tuple(line for line, own in zip(drawing.polylines, drawing.names, strict=True) if own == name)
        found[pairs[name]] = replace(drawing, polylines=lines, names=(name,) * len(lines))
    return found


def _of_lost(names: Sequence[str], lost: Sequence[str]) -> set[str]:
    """Name the seams of pictures that were left out."""
    every = [*names, *lost]
    return {
        ts.layers.pair_name(*pair) for one in lost for other in every for pair in ((one, other), (other, one))
    }
