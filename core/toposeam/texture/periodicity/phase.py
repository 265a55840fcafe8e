"""Ordered textures: places that keep step with their order, and sizes on which it closes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.checks import check_choice, check_pair
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.canvas.tileable import Tileable, wraps_of
from toposeam.texture.exemplar.sources import DataRange, Images, read_sources
from toposeam.texture.periodicity.period import Order, find_order, given_order


class Phase:
    """The places on a canvas at which pixels of the exemplar keep step with its order.

    Parameters
    ----------
    order : Order
        Of the exemplar.
    closed : (n, 2) float array
        The reciprocal vectors on the canvas: where it closes, those that close (:meth:`Order.fitted`).
    factor : int
        By how much patches are searched reduced: by three quarters of it, or one px, a patch may be out of
        step, measured in its middle.
    """

    def __init__(self, order: Order, closed: Floats, factor: int) -> None:
        self._given, self._closed, self._periods = order.reciprocal, closed, order.periods
        self._tolerance = max(1.0, 0.75 * factor)
        self._start: Floats | None = None
        #: Places of the last call, and their phases, one plane for each reciprocal vector.
        self._places: tuple[bytes, bytes] | None = None
        self._phases = np.empty((0, 0, 0), np.float32)

    def begin(self, at: tuple[int, int], place: tuple[int, int], shape: tuple[int, int]) -> None:
        """Fix the phase by the first patch: laid at a place of the canvas, taken from one of the exemplar."""
        if self._start is None:
            middle = np.array(shape) / 2
            self._start = self._closed @ (at + middle) - self._given @ (place + middle)

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places: (n, m) float32, inf where they are out of step."""
        in_step = self.allows(places.at, places.shape, *places.axes)
        return np.where(in_step, np.float32(1), np.float32(np.inf))

    def allows(
        self,
        at: tuple[int, int],
        shape: tuple[int, int],
        rows: npt.NDArray[np.intp],
        columns: npt.NDArray[np.intp],
    ) -> Mask:
        """Find the rows and columns of the exemplar from which a patch may be taken: (n, m) bool.

        Parameters
        ----------
        at, shape : (int, int)
            First pixel of the window, and its height and width.
        rows, columns : (n,) and (m,) int arrays
            First row and column of the patch in the exemplar.
        """
        if self._start is None:
            return np.ones((len(rows), len(columns)), bool)
        middle = np.array(shape) / 2
        wanted = self._closed @ (at + middle) - self._start - self._given @ middle
        away = np.zeros((2, len(rows), len(columns)), np.float32)
        for phases, one, period in zip(self._known(rows, columns), wanted, self._periods, strict=True):
            apart = np.float32(one % 1) - phases
            apart -= np.rint(apart)
            away[0] += np.float32(period[0]) * apart
            away[1] += np.float32(period[1]) * apart
        np.square(away, out=away)
        return np.asarray(away[0] + away[1] <= np.float32(self._tolerance**2))

    def _known(self, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> Floats32:
        """Compute the phases of places, (vectors, n, m)."""
        places = rows.tobytes(), columns.tobytes()
        if self._places != places:
            lines = self._given[:, :1] * rows, self._given[:, 1:] * columns
            self._phases = ((lines[0][:, :, np.newaxis] + lines[1][:, np.newaxis]) % 1).astype(np.float32)
            self._places = places
        return self._phases


def closing_size(
    source: Images,
    size: tuple[int, int],
    *,
    tileable: Tileable = "both",
    within: bool = False,
    alpha: Images | None = None,
    source_mask: Images | None = None,
    transparent: bool = False,
    data_range: DataRange = None,
    lattice: npt.ArrayLike | None = None,
) -> tuple[int, int]:
    """Find the size nearest to one wished for on which an ordered texture repeats without being stretched.

    Bricks, hexagons, threads and lines of text close after whole numbers of them only. Where there is no such
    order any size will do, and the one wished for comes back.

    Parameters
    ----------
    source : (H, W[, C]) array_like, or a list of such
        The exemplars; the first one's order counts.
    size : (int, int)
        Height and width wished for, px.
    tileable : {"both", "x", "y", "none"} or bool
        The axes on which the texture is to repeat.
    within : bool
        Whether the size must not be larger, as when a picture is cropped to it.
    alpha, source_mask : (H, W) array_like, or a list with one per exemplar
        Opacity, and what may be copied.
    transparent : bool
        Whether opacity is part of the texture, as for :func:`toposeam.synth`.
    data_range : float, optional
        The value that counts as white, as for :func:`toposeam.synth`.
    lattice : array_like, optional
        Instead of the order that is found, as for :func:`toposeam.synth`.

    Returns
    -------
    (int, int)
        Height and width, px.

    Raises
    ------
    ImageError
        For images or masks that cannot be used.
    OptionError
        For a size that is none.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> stripes = np.tile(np.repeat([40, 200], 8), (128, 8)).astype(np.uint8)
    >>> ts.texture.closing_size(stripes, (100, 100), tileable="x")
    (100, 96)
    """
    height, width = check_pair("size", size, 1)
    check_choice("within", within, (True, False))
    check_choice("transparent", transparent, (True, False))
    wraps = wraps_of(tileable)
    sources = read_sources(
        source, alpha=alpha, mask=source_mask, data_range=data_range, transparent=transparent
    )
    if lattice is not None:
        return given_order(lattice).closing_size((height, width), wraps, within)
    order = find_order(sources.features[0], sources.usable[0])
    return (height, width) if order is None else order.closing_size((height, width), wraps, within)
