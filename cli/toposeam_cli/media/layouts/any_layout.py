"""Layouts of ours, or projects of Hugin, read by their suffix."""

from __future__ import annotations

from pathlib import Path

from toposeam_cli.media.layouts.hugin_project import read_project
from toposeam_cli.media.layouts.layout import Layout, LayoutLayer, read_layout


def layout_in(path: Path) -> Layout:
    """Read our own layout, or a project of Hugin."""
    if path.suffix.lower() != ".pto":
        return read_layout(path)
    project = read_project(path)
    layers = tuple(
        LayoutLayer(file=picture.file, name=picture.file.name, transform=picture.transform)
        for picture in project.pictures
    )
    return Layout(layers=layers, wrap=project.size[0] if project.whole_turn else None)
