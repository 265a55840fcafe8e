"""Exemplars turned and mirrored: further exemplars beside them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

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
    """Turn exemplars into all positions, with everything that belongs to them. Values are as they were: a
    normal that pointed to the right still does.
    """
    if turns == "none":
        return sources
    return dataclasses.replace(
        sources,
        planes=tuple(tuple(turned(images, turns)) for images in sources.planes),
        features=tuple(turned(sources.features, turns)),
        present=tuple(turned(sources.present, turns)),
        usable=tuple(turned(sources.usable, turns)),
    )
