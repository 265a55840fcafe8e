"""The places of joined pictures as a layout, or as a project of Hugin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import toposeam as ts
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.canvas.transforms import CameraTransform, similarity
from toposeam_cli.media.layouts.hugin_project import ProjectPicture, project_text
from toposeam_cli.media.layouts.layout import Layout, LayoutLayer, layout_text
from toposeam_cli.stitching.inputs import PlacedPictures
from toposeam_cli.stitching.outputs import Outputs
from toposeam_cli.stitching.place_options import FindingOptions


def check_layout(out: Outputs, finding: FindingOptions) -> None:
    """Refuse a Hugin project of places that are none of cameras, before any work.

    Raises
    ------
    OptionError
    """
    of_no_camera = "--exact" if finding.exact else f"--model {finding.model}"
    if _is_project(out) and (finding.exact or finding.model not in ("auto", "rotation")):
        raise ts.OptionError(
            f"a Hugin project (.pto) is of a camera that turned, and {of_no_camera} finds none; save a "
            "layout (.toml) instead"
        )


def checked_layout(out: Outputs, job: PlacedPictures) -> tuple[Outputs, list[str]]:
    """Try the layout that is to be saved as soon as the places are known.

    Returns
    -------
    out : Outputs
        Without a layout that cannot be written of places that were found: it never costs the picture.
    unsaved : list of str
        Why it is not written.

    Raises
    ------
    OptionError
        When it cannot be written of places that were given.
    """
    if out.save_layout is None:
        return out, []
    try:
        saved_layout(job, out.save_layout)
    except ts.OptionError as error:
        if job.placement is None:
            raise
        return replace(out, save_layout=None), [f"{out.save_layout} was not written: {error}"]
    return out, []


def _is_project(out: Outputs) -> bool:
    return out.save_layout is not None and out.save_layout.suffix.lower() == ".pto"


def saved_layout(job: PlacedPictures, path: Path) -> str:
    """Return the places of the pictures as the text of a layout, or of a Hugin project, for that file.

    Raises
    ------
    OptionError
        When they are no files of their own.
    """
    if len(job.files) != len(job.layers):
        raise ts.OptionError("--save-layout names files, but layers of an .ora file have none; leave it out")
    if path.suffix.lower() == ".pto":
        return _project(job, path.parent)
    layers = [
        LayoutLayer(file=file, name=layer.name, transform=transform)
        if job.warped(index)
        else LayoutLayer(file=file, name=layer.name, transform=similarity(layer.at))
        for index, (file, layer, transform) in enumerate(
            zip(job.files, job.layers, job.transforms, strict=True)
        )
    ]
    return layout_text(path.parent, Layout(layers=tuple(layers), wrap=job.wrap))


def _project(job: PlacedPictures, folder: Path) -> str:
    """Return the cameras of the pictures as the text of a Hugin project in that folder."""
    cameras = [one for one in job.transforms if isinstance(one, CameraTransform)]
    if len(cameras) < len(job.layers):
        raise ts.OptionError(
            "a Hugin project is of pictures that one camera took from one place, and these are placed "
            "otherwise; save a layout (.toml) instead, or add --model rotation"
        )
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
