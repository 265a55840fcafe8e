"""Exemplars turned and mirrored: further exemplars beside them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.images import full_scale
from toposeam.texture.exemplar.sources import Sources
from toposeam.typing import TURNS as TURNS
from toposeam.typing import Turns as Turns

#: Quarter turns to the left, and whether they are mirrored before.
_KINDS: dict[Turns, tuple[tuple[int, bool], ...]] = {
    "none": ((0, False),),
    "mirror": ((0, False), (0, True)),
    "quarters": ((0, False), (1, False), (2, False), (3, False)),
    "all": tuple((quarter, mirrored) for mirrored in (False, True) for quarter in range(4)),
}


def count_of(turns: Turns) -> int:
    """Count the positions of each exemplar."""
    return len(_KINDS[turns])


def turned(images: Sequence[npt.NDArray[Any]], turns: Turns) -> list[npt.NDArray[Any]]:
    """Turn every image into each of its positions, one image after the other.

    Examples
    --------
    >>> [image.tolist() for image in turned([np.array([[1, 2]])], "quarters")]
    [[[1, 2]], [[2], [1]], [[2, 1]], [[1], [2]]]
    """
    return [
        np.ascontiguousarray(np.rot90(image[:, ::-1] if mirrored else image, quarter))
        for image in images
        for quarter, mirrored in _KINDS[turns]
    ]


def turned_sources(sources: Sources, turns: Turns) -> Sources:
    """Turn exemplars into all positions, with everything that belongs to them; vectors of normal maps turn as
    well.
    """
    if turns == "none":
        return sources
    planes = [turned(images, turns) for images in sources.planes]
    if sources.has_normal:
        normals = len(planes) - 1 - sources.has_alpha
        planes[normals] = _turned_normals(sources.planes[normals], planes[normals], turns)
    found = dataclasses.replace(
        sources,
        planes=tuple(map(tuple, planes)),
        features=tuple(turned(sources.features, turns)),
        present=tuple(turned(sources.present, turns)),
        usable=tuple(turned(sources.usable, turns)),
    )
    return found.with_features() if sources.has_normal and sources.features else found


def _turned_normals(
    given: Sequence[npt.NDArray[Any]], maps: Sequence[npt.NDArray[Any]], turns: Turns
) -> list[npt.NDArray[Any]]:
    """Turn the vectors of normal maps that were turned as pictures, each in all positions."""
    signed = given[0].dtype.kind == "f" and min(one.min() for one in given) < 0
    whole = 0 if signed else full_scale(given[0].dtype)
    down = _points_down(given, 0.5 * float(whole))
    result = []
    for number, image in enumerate(maps):
        quarter, mirrored = _KINDS[turns][number % count_of(turns)]
        x, y = image[..., 0], image[..., 1]
        if mirrored:
            x = whole - x
        for _ in range(quarter):  # to the left: what pointed to the right points up
            x, y = (y, whole - x) if down else (whole - y, x)
        result.append(np.stack([x, y, image[..., 2]], axis=2))
    return result


def _points_down(maps: Sequence[npt.NDArray[Any]], half: float) -> bool:
    """Test whether green counts downwards (DirectX), not upwards (OpenGL, Blender), which nothing in the file
    says: slopes of a surface have no curl, and with the wrong sign they have.
    """
    curls = np.zeros(2)
    for image in maps:
        vectors = image.astype(np.float32) - half
        right, green = (vectors[..., k] / np.maximum(vectors[..., 2], 0.1 * (half or 1.0)) for k in (0, 1))
        across, along = np.gradient(right, axis=0), np.gradient(green, axis=1)
        # slopes to the right are -right; downwards they are green, or -green where that points down
        curls += np.square(across + along).sum(), np.square(across - along).sum()
    return bool(curls[1] < curls[0])
