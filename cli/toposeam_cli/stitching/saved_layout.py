"""The places of joined pictures as a layout, or as a project of Hugin."""

from __future__ import annotations

from pathlib import Path

import toposeam as ts
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.canvas.transforms import CameraTransform, similarity
from toposeam_cli.media.layouts.hugin_project import ProjectPicture, project_text
from toposeam_cli.media.layouts.layout import Layout, LayoutLayer, layout_text
from toposeam_cli.stitching.inputs import PlacedPictures


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
