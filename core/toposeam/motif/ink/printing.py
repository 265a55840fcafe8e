"""Common base of layers of ink on paper: printing, mixing and drawing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_pair, check_whole
from toposeam.display import to_png
from toposeam.errors import OptionError, Term
from toposeam.motif.ink.mixing import mix
from toposeam.motif.ink.stroke_edges import fineness, print_layer, stroke_ends
from toposeam.motif.ink.svg import draw_svg
from toposeam.picture_files import PictureResult
from toposeam.saving import save

#: Largest pattern, px: larger ones do not fit into the memory of usual machines.
MAX_PATTERN = 400_000_000


class Inked(PictureResult, ABC):
    """Base class of printed patterns: densities of inks on a cell that repeats."""

    __slots__ = ()

    #: (n_L, H, W) float32 in [0, 1], as the optimisation left them.
    densities: npt.NDArray[np.float32]
    #: (n_L, 3) sRGB in [0, 1].
    inks: npt.NDArray[np.float64]
    #: (3,) sRGB in [0, 1].
    paper: npt.NDArray[np.float64]
    #: The rule by which the cell repeats, one of `REPEATS`.
    repeat: str

    @property
    @abstractmethod
    def inking(self) -> str:
        """Kind of the inks, one of `INKINGS`."""

    @property
    @abstractmethod
    def edges(self) -> tuple[str, ...]:
        """Stroke edges of each layer in print, of `EDGES`."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the inks."""

    @property
    @abstractmethod
    def record(self) -> Mapping[str, Any]:
        """Record for files that reproduces the pattern; any values that JSON can hold."""

    @abstractmethod
    def sampled(self, layer: int, size: tuple[int, int]) -> npt.NDArray[np.float32]:
        """Return one layer's density, smoothly interpolated to (rows, columns)."""

    def ends(self, layer: int) -> tuple[float, np.float32]:
        """Return the density at which a layer's strokes end in print, and the factor on densities inside."""
        check_whole("layer", layer, 0, len(self.inks) - 1)
        fine = fineness((self.densities.shape[1], self.densities.shape[2]))
        size = fine * self.densities.shape[1], fine * self.densities.shape[2]
        return stroke_ends(map(self.sampled, [layer], [size]), self.edges[layer], self.repeat, fine)

    def resampled(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """Return the densities on another number of elements, (n_L, H', W') float32, smoothly interpolated.

        They have no stroke edges yet; `coverage` adds these.

        Parameters
        ----------
        size : (rows, columns), optional

        Raises
        ------
        OptionError
        """
        size = None if size is None else checked_size(size)
        if size is None or size == self.densities.shape[1:]:
            return self.densities
        return np.stack([self.sampled(index, size) for index in range(len(self.inks))])

    def coverage(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """Compute the coverage by each layer's ink, (n_L, H', W') float32 in [0, 1].

        Strokes end as `edges` says; see :mod:`toposeam.motif.ink.stroke_edges`.

        Parameters
        ----------
        size : (rows, columns), optional
            The cell's own by default.

        Raises
        ------
        OptionError
        """
        elements = self.densities.shape[1], self.densities.shape[2]
        size = elements if size is None else checked_size(size)
        return self._own_coverage() if size == elements else self._covered(size)

    def _own_coverage(self) -> npt.NDArray[np.float32]:
        return self._covered((self.densities.shape[1], self.densities.shape[2]))

    def _covered(self, size: tuple[int, int]) -> npt.NDArray[np.float32]:
        return np.stack([self.coverage_of(index, size) for index in range(len(self.inks))])

    def coverage_of(self, layer: int, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """Compute the coverage by one layer's ink, (H', W') float32 in [0, 1], as :meth:`coverage` does.

        Parameters
        ----------
        layer : int
        size : (rows, columns), optional
            The cell's own by default.
        """
        elements = self.densities.shape[1], self.densities.shape[2]
        sample, edge = partial(self.sampled, layer), self.edges[layer]
        return print_layer(sample, edge, self.repeat, elements, size or elements, self.ends(layer))

    def image(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """Return the print in colour.

        Parameters
        ----------
        size : (rows, columns), optional
            The cell's own by default.

        Returns
        -------
        (H, W, 3) float32 array in [0, 1]
        """
        return mix(self.coverage(size), self.inks, self.paper, self.inking)

    def to_svg(self, path: str | Path | None = None, *, counts: tuple[float, float] = (1, 1)) -> str:
        """Return the print as an SVG document, and write it if a path is given.

        Parameters
        ----------
        path : str or Path, optional
            Written whole or not at all.
        counts : (rows, columns)
            Number of copies in the document; see :func:`draw_svg`.

        Returns
        -------
        str

        Raises
        ------
        OptionError, OSError
        """
        document = draw_svg(self, counts)
        if path is not None:
            save(path, document)
        return document

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """Return the print in colour, for NumPy and matplotlib."""
        return np.array(self.image(), dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        return to_png(self.image())


def checked_size(size: tuple[int, int]) -> tuple[int, int]:
    """Check and return the (rows, columns) of a print.

    Raises
    ------
    OptionError
    """
    rows, columns = check_pair("size", size, 1)
    if rows * columns > MAX_PATTERN:
        raise OptionError(
            "{parameter} is {rows} × {columns}; give rows and columns of {most:,} pixels at most",
            kind="too large",
            parameter=Term("size"),
            rows=rows,
            columns=columns,
            most=MAX_PATTERN,
        )
    return rows, columns
