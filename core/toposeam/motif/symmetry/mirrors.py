r"""Balance of mass at mirrors, so that they do not show in a pattern.

Heat does not cross a mirror. Unless a source or a sink lies near it, strokes stop short of the mirror, or one
runs along it, and a pale or dark line goes through the whole pattern. So the optimisation has further
constraints: each row (column) within a band about a mirror has as much mass as the rows beyond the band,

.. math:: \sum_{e \in y} \rho_e = M_y .

Each constraint has a multiplier λ_y beside that of the whole mass. In an update by optimality criteria it is
a factor on the row, :math:`\rho_e\,(-\partial\Pi/\partial\rho_e\,/\,\lambda\lambda_y)^\eta`, and strokes
grow across the mirror where they lower the compliance most. Lines through centres of turns by 90° or 60°,
where many copies meet, are treated in the same way.

In ink wash, a row that differs from the next would show as a hairline, and so would the end of the band. So a
band in wash has one factor, which fades out towards its end. Along the borders of *reflect* a single factor
would show as a line; there rows have a factor each, smoothed from row to row, which fades out as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats
from toposeam.motif.symmetry.rules import GENERATORS, HEXAGONAL, Symmetry, operations, symmetry

#: Half the width of the band, as a share of the cell's side, and its least value, in elements.
_HALF_BAND, _MIN_HALF_BAND = 0.07, 2
#: Largest logarithm of a factor in one pass, and the number of passes.
_MAX_LOG_FACTOR, _PASSES = 1.0, 6
#: Standard deviation of the smoothing of factors from row to row, as a share of the band.
_FACTOR_SMOOTHING = 0.25


@dataclass(frozen=True, eq=False)
class _Line:
    """The band of rows (or columns) about one line, and the rows on both sides that it is compared with."""

    #: Indices of the band's rows.
    rows: npt.NDArray[np.intp]
    #: Weight, in each row's wanted mean, of the mean after the band; the mean before it has the rest.
    share: Floats
    #: Weight of the factor of each row in wash: 1 on the line, 0 at the end of the band.
    fade: Floats
    #: Indices of the rows before and after the band.
    before: npt.NDArray[np.intp]
    after: npt.NDArray[np.intp]

    def log_factors(self, mean: Floats, wash: bool, each: bool) -> Floats:
        """Compute the logarithms of the band's factors; in wash one for all rows, or one for `each` row."""
        wanted = (1 - self.share) * mean[self.before].mean() + self.share * mean[self.after].mean()
        if wash and not each:
            lacking = np.log((self.fade * wanted).sum() / (self.fade * mean[self.rows]).sum())
            whole: Floats = self.fade * np.clip(lacking, -_MAX_LOG_FACTOR, _MAX_LOG_FACTOR)
            return whole
        found: Floats = np.clip(np.log(wanted / mean[self.rows]), -_MAX_LOG_FACTOR, _MAX_LOG_FACTOR)
        if wash:
            width = _FACTOR_SMOOTHING * len(found)
            found = scipy.ndimage.gaussian_filter1d(found * self.fade, width, mode="nearest")
            found *= np.sqrt(self.fade)
        return found


class Mirrors:
    """The mirrors of a rule on a cell.

    Parameters
    ----------
    repeat : str
    shape : (int, int)
        Rows and columns of elements.
    border : bool
        Treat the border like a mirror, whatever the rule, as other motifs lie beyond it.

    Attributes
    ----------
    symmetry : Symmetry
        The rule's orbits.
    any : bool
        True if the rule has mirrors.
    """

    def __init__(self, repeat: str, shape: tuple[int, int], border: bool = False) -> None:
        self.symmetry: Symmetry = symmetry(repeat, shape)
        self._free = repeat == "reflect"
        self._columns: npt.NDArray[np.intp] | None = None
        counts = shape
        if repeat in HEXAGONAL:  # columns on paper are those of 2u - v, see `hexagonal_lattice`
            v, u = np.ogrid[: shape[0], : shape[1]]
            self._columns = (2 * u - v) % (2 * shape[1])
            rows, columns = (np.arange(-2, side + 2) % side for side in shape)
            self._around = rows[:, np.newaxis] * shape[1] + columns
            counts = shape[0], 2 * shape[1]
        self._lines = tuple(
            [_line(place, count, repeat == "reflect") for place in sorted(places)]
            for places, count in zip(({0.0}, {0.0}) if border else mirror_places(repeat), counts, strict=True)
        )
        self.any = any(self._lines)

    def balance(
        self,
        density: Floats,
        mass: float,
        lowest: Floats,
        highest: Floats,
        *,
        wash: bool = False,
        axes: tuple[int, ...] = (0, 1),
    ) -> Floats:
        """Balance a design: as much mass on mirrors as beside them, and the given mass as a whole.

        Both hold as far as the bounds allow. Strokes are balanced in each row of the band. Wash is balanced
        in the band as a whole, except along the borders of `reflect`.

        Only rows are balanced with `axes` (0,), only columns with (1,).
        """
        if not self.any or not axes:
            return density
        for _ in range(_PASSES):
            density = np.clip(self._balance_once(density, wash, axes), lowest, highest)
            density = np.clip(density * (mass / density.mean()), lowest, highest)
        return self.symmetry.mean(density)

    def _balance_once(self, density: Floats, wash: bool, axes: tuple[int, ...]) -> Floats:
        rows = self._log_factors(0, density.mean(axis=1), wash)[:, np.newaxis]
        if self._columns is None:
            levelled: Floats = density * np.exp(rows) if 0 in axes else density.copy()
            if 1 not in axes:
                return levelled
            levelled *= np.exp(self._log_factors(1, levelled.mean(axis=0), wash))
            return levelled
        count = 2 * density.shape[1]
        # A column on paper has an element in every second row.
        mean = np.bincount(self._columns.ravel(), density.ravel(), count) / (density.shape[0] / 2)
        both = self.symmetry.mean(rows + self._log_factors(1, mean, wash)[self._columns])
        # Three passes smooth centres, where factors of all lines add up: along rows, columns and diagonals.
        wide: Floats = both.ravel()[self._around]
        wide = (wide[:, :-2] + 2 * wide[:, 1:-1] + wide[:, 2:]) / 4
        wide = (wide[:-2] + 2 * wide[1:-1] + wide[2:]) / 4
        wide = (wide[:-2, :-2] + 2 * wide[1:-1, 1:-1] + wide[2:, 2:]) / 4
        return density * np.exp(wide)

    def _log_factors(self, axis: int, mean: Floats, wash: bool) -> Floats:
        found = np.zeros(len(mean))
        for line in self._lines[axis]:
            found[line.rows] += line.log_factors(mean, wash, self._free)
        return found


def mirror_places(repeat: str) -> tuple[set[float], set[float]]:
    """Return the places of mirrors in a cell: those across as shares of its height, those down of its width.

    For "reflect", 0 and 1 are both edges of the cell.

    Examples
    --------
    >>> [sorted(places) for places in mirror_places("pm")]
    [[], [0.0, 0.5]]
    """
    if repeat == "reflect":
        return {0.0, 1.0}, {0.0, 1.0}
    if repeat in HEXAGONAL:
        return {0.0}, {0.0}
    down, across = set[float](), set[float]()
    if repeat in GENERATORS:
        for (a, b), (c, d), (t, u) in operations(repeat):
            if (a, b, c, d) == (0, -1, 1, 0):
                down.add(0.0)
                across.add(0.0)
            elif (a, b, c, d, t) == (1, 0, 0, -1, 0):
                down |= {u / 4, u / 4 + 0.5}
            elif (a, b, c, d, u) == (-1, 0, 0, 1, 0):
                across |= {t / 4, t / 4 + 0.5}
    return down, across


def _line(place: float, count: int, free: bool) -> _Line:
    band = max(_MIN_HALF_BAND, round(_HALF_BAND * count))
    if free:  # the mirror image lies beyond the edge
        rows = np.arange(band) if place == 0 else count - 1 - np.arange(band)
        beyond = np.arange(band, 2 * band) if place == 0 else count - 1 - np.arange(band, 2 * band)
        return _Line(rows, np.zeros(band), _fade_weights(np.arange(band) / band), beyond, beyond)
    offset = np.arange(-band, band)
    at = round(place * count)
    return _Line(
        (at + offset) % count,
        (offset + band + 0.5) / (2 * band),
        _fade_weights(np.abs(offset + 0.5) / band),
        (at + np.arange(-2 * band, -band)) % count,
        (at + np.arange(band, 2 * band)) % count,
    )


def _fade_weights(away: Floats) -> Floats:
    """Return weights that fall smoothly from 1 on a line to 0 at the band's end.

    A sudden end of the factors would show as a hairline in wash.
    """
    found: Floats = np.cos(np.pi / 2 * away) ** 2
    return found


@lru_cache(maxsize=16)
def mirrors(repeat: str, shape: tuple[int, int], border: bool = False) -> Mirrors:
    """Return the mirrors of a rule on a cell."""
    return Mirrors(repeat, shape, border)
