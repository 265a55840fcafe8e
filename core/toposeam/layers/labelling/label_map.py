"""A label map of a canvas, with the figures of the search that found it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels
from toposeam.checks import is_masked
from toposeam.errors import ImageError, Term

#: Two layers by their numbers, the lower one first.
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelMap:
    """The layer that shows at each pixel of a canvas, as found for a :class:`toposeam.layers.Labelling`.

    A stitched picture has it as :attr:`toposeam.layers.Composition.solution`.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> found = ts.stitch(ts.layers.overlapping(a, b, overlap=10)).solution
    >>> found.labels[5, [0, 69]], found.method, found.rounds
    (array([0, 1], dtype=int16), 'shortest-path', 0)
    """

    #: (H, W) int16: the number of the layer that shows at each pixel, -1 where none does. An array, or for
    #: large canvases a map of tiles that is read by ``labels[rows, columns]`` with two slices.
    labels: Labels
    #: Name of the engine that decided, as :attr:`toposeam.seam.Seam.method`.
    method: str = "graph-cut"
    #: The options of the engine, by name.
    settings: Mapping[str, Any] = field(default_factory=dict)
    #: Number of rounds of expansions that were made, 0 for two layers.
    rounds: int = 0
    #: Duration of the search, s.
    seconds: float = 0.0


def as_labels(values: npt.ArrayLike, shape: tuple[int, int], name: str) -> Labels:
    """Return numbers of layers as an (H, W) int16 array of a shape.

    Raises
    ------
    ImageError
        If they are no whole numbers from -1 to 32,767, or of another shape.
    """
    try:
        labels = np.zeros(0) if is_masked(values) else np.asarray(values)
    except ValueError:  # rows of several lengths
        labels = np.zeros(0)
    if labels.shape != shape or labels.dtype.kind not in "iu":
        raise ImageError(
            "{parameter} has shape {shape!s} and dtype {dtype}; give whole numbers of shape {expected!s}, "
            "the layer at each pixel and -1 where any may show",
            kind="shape",
            parameter=Term(name),
            shape=labels.shape,
            dtype=str(labels.dtype),
            expected=shape,
        )
    if labels.size and not -1 <= int(labels.min()) <= int(labels.max()) <= np.iinfo(np.int16).max:
        raise ImageError(
            "{parameter} has numbers from {least} to {largest}; give those of layers, and -1 where any may "
            "show",
            kind="range",
            parameter=Term(name),
            least=int(labels.min()),
            largest=int(labels.max()),
        )
    return labels.astype(np.int16)
