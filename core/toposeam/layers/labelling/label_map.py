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
    #: Strokes, by number, that change nothing, as their layer has no pixels there, or no other one has.
    lost_strokes: tuple[int, ...] = ()
    #: Of a label map from which a search at a larger size begins: x and y of its upper left corner in the
    #: coordinates of the layers, and the size of one of its pixels there, px.
    at: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0

    def sampled(self, shape: tuple[int, int], step: int, period: int | None = None) -> Labels:
        """(h, w) int16: the labels at the middles of squares of `step` px of the layers' coordinates, from
        (0, 0) on; those of the nearest pixel beyond the map. On a round canvas columns come back after
        `period` px.
        """
        rows, columns = ((np.arange(side) + 0.5) * step for side in shape)
        if period is not None:
            columns = (columns - self.at[0]) % period + self.at[0]
        height, width = self.labels.shape
        y = np.clip(((rows - self.at[1]) / self.scale).astype(int), 0, height - 1)
        x = np.clip(((columns - self.at[0]) / self.scale).astype(int), 0, width - 1)
        return np.asarray(self.labels[:, :][np.ix_(y, x)], np.int16)


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
