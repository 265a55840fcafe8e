"""The layout of a work: what it says beside places goes into a stitch, and a stitch is saved as one.

Options that a layout has are marked where they are defined (``kept``); nothing else about them is written
here but which of them one of the command line replaces.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from click.core import ParameterSource

import toposeam as ts
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.canvas.transforms import (
    CameraTransform,
    PlaneTransform,
    Transform,
    is_move,
    similarity,
    unbent,
)
from toposeam_cli.app.command import HeadedOption
from toposeam_cli.app.options import Keyed, KeyedFile, is_path
from toposeam_cli.files.regular import check_regular, real_path
from toposeam_cli.files.writing import check_output
from toposeam_cli.media.layouts.any_layout import layout_in
from toposeam_cli.media.layouts.hugin_project import ProjectPicture, project_text
from toposeam_cli.media.layouts.layout import (
    MOST_LAYERS,
    Layout,
    LayoutLabels,
    LayoutLayer,
    layout_text,
    named_from,
)
from toposeam_cli.stitching.inputs import STORED_PIXELS, PlacedPictures
from toposeam_cli.stitching.outputs import OPAQUE, Outputs, foreign_to, outputs_of
from toposeam_cli.stitching.search_options import SeamOptions

#: An option of the command line replaces these of a layout, too: they say the same otherwise, or belong to
#: what it replaces.
_REPLACED = {
    "crop": ("fill_edges",),
    "background": ("fill_edges",),
    "fill_edges": ("crop", "background"),
    "match_tones": ("match_shading",),
    "match_shading": ("match_tones",),
    "blend": ("blend_width",),
    "give": ("use_seam",),
    "use_seam": ("give", "method", "formulation", "plain"),
    "method": ("use_seam", "formulation", "plain"),
}
_NOT_TURNED = (
    "a Hugin project is of pictures that one camera took from one place, and these are placed otherwise; "
    "save a layout (.toml) instead, or add --model rotation"
)


def options_of(path: Path, layout: Layout, context: click.Context) -> dict[str, Any]:
    """Parse the options of a layout for a command, by the names of its parameters.

    Raises
    ------
    OptionError
        For options that a layout cannot have, and values that the command line would refuse.
    """
    known = _kept(context.command)
    found: dict[str, Any] = {}
    for key, value in layout.options.items():
        option = known.get(key.replace("_", "-"))
        if option is None:
            raise ts.OptionError(
                f"'{path}', stitch has {key[:80]!r}, which is none of {', '.join(sorted(known))}; correct or "
                "remove it"
            )
        if str(option.name) in found:
            raise ts.OptionError(f"'{path}', stitch: {key} is given twice; give it once")
        try:
            found[str(option.name)] = _parsed(option, value, path.parent, context)
        except click.UsageError as error:
            message = error.format_message() if type(error) is click.UsageError else error.message
            raise ts.OptionError(f"'{path}', stitch, {key}: {message.rstrip('.')}") from error
    return found


def taken_layout(path: Path, given: dict[str, Any]) -> Layout:
    """Read a layout, and put its options into the parameters of the running command; what the command line
    gives wins, and what the output's format has no use for, or cannot hold, is left out.
    """
    layout, context = layout_in(path), click.get_current_context()
    written = {name for name in given if _is_written(context, name)}
    skipped = written | foreign_to(given["output"].suffix.lower())
    skipped |= {other for name in written for other in _REPLACED.get(name, ())}
    found = options_of(path, layout, context)
    if found.get("crop") == "outside" and given["background"] is None and "background" not in found:
        skipped |= {"crop"} if given["output"].suffix.lower() in OPAQUE else set()
    for name, value in found.items():
        if name not in skipped:
            given[name] = context.params[name] = value
            context.set_parameter_source(name, ParameterSource.COMMANDLINE)
    return layout


def named_files(path: Path, command: click.Command) -> list[Path]:
    """List the files that a layout names, also in the options of a command."""
    layout = layout_in(path)
    files = [file for layer in layout.layers for file in (layer.file, layer.mask, layer.keep)]
    files += [None if layout.labels is None else layout.labels.file]
    with click.Context(command) as context:
        values = options_of(path, layout, context).values() if layout.options else ()
    each = [one for value in values for one in (value if isinstance(value, tuple) else (value,))]
    files += [one.path if isinstance(one, Keyed) else one for one in each if isinstance(one, Keyed | Path)]
    return [file for file in files if file is not None]


def painted(layout: Layout, job: PlacedPictures, find: SeamOptions) -> dict[str, Any]:
    """Return the strokes and the label map of a layout as keywords of :func:`toposeam.stitch`; the label map
    is that of one view of the canvas and its boundary.

    Raises
    ------
    ImageError
        If the label map cannot be used.
    OptionError
        If pictures that are warped, and painted on, would be aligned.
    """
    found: dict[str, Any] = {}
    strokes = [
        dataclasses.replace(stroke, layer=job.numbers.index(stroke.layer))
        for stroke in layout.strokes
        if stroke.layer in job.numbers
    ]
    if strokes:
        if find.align and any(map(job.warped, range(len(job.layers)))):
            raise ts.OptionError("--align moves warped pictures from under their strokes; leave it out")
        found["strokes"] = strokes
        found["transforms"] = [
            transform if job.warped(index) else None for index, transform in enumerate(job.onto_canvas)
        ]
    bent_alike = (layout.boundary is None) == (job.boundary is None)
    if (
        (labels := layout.labels) is not None
        and bent_alike
        and all(
            _same_view(transform, layout.layers[number].transform)
            for transform, number in zip(job.transforms, job.numbers, strict=True)
        )
    ):
        from toposeam_cli.media.layouts.label_picture import read_labels

        numbers = tuple(layout.numbers[number] for number in job.numbers)
        limit = min(round(find.of_stitch("max_megapixels") * 1e6), STORED_PIXELS)
        label_map = read_labels(labels.file, numbers, layout.count, limit)
        found["preview"] = label_map, labels.at, labels.scale
    return found


def check_saving(out: Outputs, files: Sequence[Path], layout: Layout | None, placed: bool) -> None:
    """Refuse to save a layout that could not be, as far as that is known before any work.

    Parameters
    ----------
    out : Outputs
    files : sequence of Path
        Those of the command line.
    layout : Layout, optional
        The one that is read.
    placed : bool
        Whether options place the pictures otherwise than by a camera.
    """
    path = out.save_layout
    if path is None:
        return
    if files[0].suffix.lower() == ".ora":
        raise ts.OptionError("--save-layout names files, but layers of an .ora file have none; leave it out")
    if layout is None:
        layers = [LayoutLayer(file=file, name=file.name, transform=similarity((0, 0))) for file in files]
    else:
        layers = list(layout.layers)
        placed = placed or not all(isinstance(layer.transform, CameraTransform) for layer in layers)
    if path.suffix.lower() == ".pto":
        if placed:
            raise ts.OptionError(_NOT_TURNED)
        return
    if len(layers) > MOST_LAYERS:
        raise ts.OptionError(
            f"a layout has {MOST_LAYERS} layers at most, and there are {len(layers)} pictures; leave "
            "--save-layout out"
        )
    layout_text(path.parent, Layout(layers=tuple(layers)))
    if layout is not None and layout.labels is not None:
        beside = labels_path(path)
        check_output(beside, out.force)
        if real_path(beside) in (real_path(each) for each in outputs_of(out)):
            raise ts.OptionError(
                f"'{beside}' is also where the labels of the layout go; give that output another name"
            )


def labels_path(path: Path) -> Path:
    """Return the name of the label map of a layout."""
    return path.with_suffix(".labels.png")


def saved_layout(
    job: PlacedPictures, unaligned: PlacedPictures, path: Path, kind: str, painting: Mapping[str, Any]
) -> dict[Path, bytes]:
    """Return a work as a layout, or its places as a Hugin project, with the file that it is for; and the
    file of its label map.

    Parameters
    ----------
    job, unaligned : PlacedPictures
        The same before it was aligned: warped pictures are saved there, to be aligned again.
    path : Path
    kind : {"photographs", "scans"}
        The defaults that it has.
    painting : mapping
        As :func:`painted` returns it.

    Raises
    ------
    OptionError
        When they are no files of their own, or a project cannot hold their places.
    """
    if path.suffix.lower() == ".pto":
        return {path: _project(job, path.parent).encode()}
    options = _chosen(job, path.parent)
    if any(map(job.warped, range(len(job.layers)))):
        job = unaligned
    else:
        options = {key: value for key, value in options.items() if key not in ("align", "align-radius")}
    documents, labels = dict[Path, bytes](), None
    if "preview" in painting:
        from toposeam_cli.media.layouts.label_picture import labels_png

        label_map, at, scale = painting["preview"]
        labels = LayoutLabels(file=labels_path(path), at=at, scale=scale)
        documents[labels.file] = labels_png(label_map, len(job.layers))
    layers = [
        LayoutLayer(
            file=file,
            name=name,
            transform=transform if job.warped(index) else similarity(layer.at),
            mask=mask,
            keep=keep,
        )
        for index, (file, name, layer, transform, mask, keep) in enumerate(
            zip(job.files, _own_names(job), job.layers, job.transforms, job.masks, job.keeps, strict=True)
        )
    ]
    layout = Layout(
        layers=tuple(layers),
        wrap=job.wrap,
        boundary=job.boundary,
        options={"as": kind} | options,
        strokes=tuple(painting.get("strokes", ())),
        labels=labels,
    )
    return {path: layout_text(path.parent, layout).encode()} | documents


def lost_in_project(job: PlacedPictures, path: Path | None, painting: Mapping[str, Any]) -> list[str]:
    """Say in a sentence what a Hugin project cannot hold of a work; empty if that is nothing."""
    if path is None or path.suffix.lower() != ".pto":
        return []
    lost = [*_chosen(job, path.parent)]
    lost += [name for name, files in (("mask-for", job.masks), ("keep", job.keeps)) if any(files)]
    lost += [name for name, key in (("strokes", "strokes"), ("labels", "preview")) if key in painting]
    if not lost:
        return []
    return [f"a Hugin project holds places, and not {', '.join(lost)}; save a layout (.toml) for all of it"]


def _same_view(one: Transform, other: Transform) -> bool:
    """Test whether two transforms of a picture lay it on the same canvas, wherever moves lay it."""
    one, other = unbent(one), unbent(other)
    if isinstance(one, CameraTransform) and isinstance(other, CameraTransform):
        same = bool(np.allclose(one.rotation, other.rotation, rtol=0, atol=1e-9))
        return same and (one.projection, one.fov) == (other.projection, other.fov)
    if isinstance(one, PlaneTransform) and isinstance(other, PlaneTransform):
        return is_move(one) or bool(np.allclose(one.matrix, other.matrix, rtol=0, atol=1e-6))
    return False


def _kept(command: click.Command) -> dict[str, HeadedOption]:
    """Return the options that a layout has, by their long names without dashes."""
    return {
        max(each.opts, key=len).lstrip("-"): each
        for each in command.params
        if isinstance(each, HeadedOption) and each.kept
    }


def _is_written(context: click.Context, name: str) -> bool:
    return context.get_parameter_source(name) is ParameterSource.COMMANDLINE


def _parsed(option: HeadedOption, value: Any, folder: Path, context: click.Context) -> Any:
    """Parse a value of a layout as the command line parses its text."""
    if option.is_flag:
        if not isinstance(value, bool):
            raise click.UsageError(f"{value!r} is neither true nor false")
        return value
    values = value if isinstance(value, list) and option.multiple else [value]
    if any(isinstance(each, bool) or not isinstance(each, str | int | float) for each in values):
        raise click.UsageError(f"{repr(value)[:80]} is neither a text nor a number")
    if is_path(option):
        values = [_file(option, each, folder) for each in values]
    return option.type_cast_value(context, tuple(values) if option.multiple else values[0])


def _file(option: HeadedOption, text: str | float, folder: Path) -> Path | Keyed:
    """Return a file that a layout names, perhaps with the key of its pictures."""
    if not isinstance(text, str) or not text.strip():
        raise click.UsageError(f"{text!r} is not the name of a file")
    if not isinstance(option.type, KeyedFile):
        return folder / text
    key, sign, name = text.partition("=")
    keyed = Keyed(key, folder / name) if sign and not (folder / text).exists() else Keyed(None, folder / text)
    check_regular(keyed.path)
    return keyed


def _chosen(job: PlacedPictures, folder: Path) -> dict[str, Any]:
    """Return the options that were given to the running command and that a layout has, as its values."""
    context = click.get_current_context()

    def value(given: Any) -> Any:
        if isinstance(given, tuple):
            return [one for each in given if (one := value(each)) is not None]
        if isinstance(given, Keyed):
            pair = [job.number(key) for key in given.key.split(":", 1)] if given.key else []
            key = ":".join(map(str, pair)) + "=" if pair else ""
            return None if None in pair else key + named_from(folder, given.path)
        return named_from(folder, given) if isinstance(given, Path) else given

    return {
        key: value(context.params[str(option.name)])
        for key, option in _kept(context.command).items()
        if _is_written(context, str(option.name))
    }


def _own_names(job: PlacedPictures) -> list[str]:
    """Return the names of the pictures; those that have the name of an earlier one get a number."""
    names: list[str] = []
    for layer in job.layers:
        name, number = layer.name, 2
        while name in names:
            name, number = f"{layer.name} {number}", number + 1
        names.append(name)
    return names


def _project(job: PlacedPictures, folder: Path) -> str:
    """Return the cameras of the pictures as the text of a Hugin project in that folder."""
    cameras = [one for one in job.transforms if isinstance(one, CameraTransform)]
    if len(cameras) < len(job.layers):
        raise ts.OptionError(_NOT_TURNED)
    canvas = extent_of(job.layers)
    (left, top), (height, width) = canvas.origin, canvas.shape
    size = 2 * max(-left, left + width), 2 * max(-top, top + height)
    if job.wrap is not None:
        size = job.wrap, size[1]
    pictures = [
        ProjectPicture(file=file, size=camera.size, transform=camera)
        for file, camera in zip(job.files, cameras, strict=True)
    ]
    return project_text(folder, pictures, cameras[0].projection, size, cameras[0].radius)
