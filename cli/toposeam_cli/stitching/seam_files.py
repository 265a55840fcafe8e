"""Read seams that were drawn or kept, with the pair of pictures that each divides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import toposeam as ts
from toposeam_cli.app.options import Keyed
from toposeam_cli.stitching.inputs import PlacedPictures


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
