"""Turn pictures back that lie turned by quarter turns in their pixels, as where files lost how they lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from toposeam.arrays import Floats
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import (
    CameraTransform,
    MeshTransform,
    PlaneTransform,
    Transform,
    is_move,
)
from toposeam.layers.registration.placement import Placement, turned_back


def as_in_files(placement: Placement, quarters: Sequence[int], names: Sequence[str]) -> Placement:
    """Return the placement of pictures as they lie in their files from that of the turned ones; tell of it.

    Parameters
    ----------
    placement : Placement
    quarters : sequence of int
        By how many quarter turns each of all given pictures was turned, counterclockwise.
    names : sequence of str
        Of all given pictures.
    """
    own = [quarters[number] for number in placement.numbers]
    sizes = [size[::-1] if turn % 2 else size for size, turn in zip(placement.sizes, own, strict=True)]
    transforms = map(from_file, placement.transforms, own, sizes)
    told = turned_back([names[number] for number in placement.numbers], own)
    return replace(
        placement, sizes=tuple(sizes), transforms=tuple(transforms), doubts=(*told, *placement.doubts)
    )


def matrix_of(quarters: int, size: tuple[int, int]) -> Floats:
    """Return the (3, 3) map from the pixels of a picture of that width and height to the turned one's."""
    matrix = np.eye(3)
    for _ in range(quarters):
        matrix = np.array([[0, 1, 0], [-1, 0, size[0] - 1], [0, 0, 1.0]]) @ matrix
        size = size[::-1]
    return matrix


def turned(picture: Layer, quarters: int) -> Layer:
    """Turn a picture by quarter turns, counterclockwise."""
    if not quarters:
        return picture
    planes: dict[str, Any] = {
        name: np.rot90(np.asarray(plane), quarters)
        for name in ("image", "alpha", "mask", "keep")
        if (plane := getattr(picture, name)) is not None
    }
    return replace(picture, **planes)


def from_file(transform: Transform, quarters: int, size: tuple[int, int]) -> Transform:
    """Return the transform of a picture of that width and height from that of the same one turned."""
    if not quarters:
        return transform
    if isinstance(transform, PlaneTransform) and is_move(transform):
        # What is only moved comes to lie on whole pixels.
        transform = PlaneTransform(np.rint(transform.matrix))
    return _turned_first(transform, quarters, size)


def _turned_first(transform: Transform, quarters: int, size: tuple[int, int]) -> Transform:
    """Return the transform that turns a picture of that width and height, and then does as the given one."""
    if isinstance(transform, MeshTransform):
        base = _turned_first(transform.base, quarters, size)
        return replace(
            transform, base=base, size=size, coefficients=np.rot90(transform.coefficients, -quarters)
        )
    if isinstance(transform, PlaneTransform):
        return PlaneTransform(transform.matrix @ matrix_of(quarters, size))
    if not isinstance(transform, CameraTransform):
        raise TypeError(f"{type(transform).__name__} is no transform of a picture")
    return replace(transform, size=size, rotation=transform.rotation @ matrix_of(quarters, (1, 1)))
