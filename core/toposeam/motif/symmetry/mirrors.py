r"""Mirrors that cannot be found in a pattern: as much ink along them as beside them.

Heat does not cross a mirror, so nothing lies near one unless a source or a sink does: strokes stop short of
it, or one runs along it, and a pale or a dark line goes through the whole pattern. So the optimisation has
further constraints: the rows (columns) within a band about a mirror hold as much mass as the rows beyond,
each

.. math:: \sum_{e \in y} \rho_e = M_y .

Each has a multiplier of its own, λ_y, beside that of the whole mass. In an update by optimality criteria it
is a factor on the row, :math:`\rho_e\,(-\partial\Pi/\partial\rho_e\,/\,\lambda\lambda_y)^\eta`, and strokes
grow across the mirror where they help most. Lines through centres of turns by 90° or 60°, where many copies
meet, are treated alike. In ink wash rows that differ from the next would show as hairlines, and so would the
band's end: there the band has one factor, which fades out towards its end. Along the borders of *reflect* one
factor would show as a line: rows have factors of their own, smoothed from row to row, which fade out as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats
from toposeam.motif.symmetry.rules import GENERATORS, HEXAGONAL, Symmetry, operations, symmetry

#: Half the width of the band, as a share of the cell's side, and in elements at least.
_BAND, _LEAST = 0.07, 2
#: Factors of one pass lie within e^±1, and this many passes are made.
_LARGEST, _PASSES = 1.0, 6
#: Factors of rows are smoothed over this share of the band.
_SMOOTH = 0.25


@dataclass(frozen=True, eq=False)
class _Line:
    """The rows near one line, what shares of the means before and after they should have, and whose; and how
    fully they get it in wash.
    """

    rows: npt.NDArray[np.intp]
    share: Floats
    fully: Floats
    before: npt.NDArray[np.intp]
    after: npt.NDArray[np.intp]

    def factors(self, mean: Floats, wash: bool, each: bool) -> Floats:
        wanted = (1 - self.share) * mean[self.before].mean() + self.share * mean[self.after].mean()
        if wash and not each:
            lacking = np.log((self.fully * wanted).sum() / (self.fully * mean[self.rows]).sum())
            whole: Floats = self.fully * np.clip(lacking, -_LARGEST, _LARGEST)
            return whole
        found: Floats = np.clip(np.log(wanted / mean[self.rows]), -_LARGEST, _LARGEST)
        if wash:
            width = _SMOOTH * len(found)
            found = scipy.ndimage.gaussian_filter1d(found * self.fully, width, mode="nearest")
            found *= np.sqrt(self.fully)
        return found


class Mirrors:
    """The mirrors of a rule on a cell.

    Parameters
    ----------
    repeat : str
    shape : (int, int)
        Elements down and across.
    border : bool
        Treat the border like a mirror, whatever the rule: other motifs lie beyond it.

    Attributes
    ----------
    symmetry : Symmetry
        The rule's orbits.
    any : bool
        Whether there are some.
    """

    def __init__(self, repeat: str, shape: tuple[int, int], border: bool = False) -> None:
        self.symmetry: Symmetry = symmetry(repeat, shape)
        self._free = repeat == "reflect"
        self._columns: npt.NDArray[np.intp] | None = None
        counts = shape
        if repeat in HEXAGONAL:  # upright on paper are the columns of 2u - v, see `hexagonal`
            v, u = np.ogrid[: shape[0], : shape[1]]
            self._columns = (2 * u - v) % (2 * shape[1])
            counts = shape[0], 2 * shape[1]
        self._lines = tuple(
            [_line(place, count, repeat == "reflect") for place in sorted(places)]
            for places, count in zip(({0.0}, {0.0}) if border else places_of(repeat), counts, strict=True)
        )
        self.any = any(self._lines)

    def held(
        self, density: Floats, mass: float, lowest: Floats, highest: Floats, *, wash: bool = False
    ) -> Floats:
        """Return a design with as much on mirrors as beside them, within bounds, and with the mass that it
        should have where they allow: each row of the band, or, of wash, the band as a whole, but for the
        borders of `reflect`.
        """
        if not self.any:
            return density
        for _ in range(_PASSES):
            density = np.clip(self._levelled(density, wash), lowest, highest)
            density = np.clip(density * (mass / density.mean()), lowest, highest)
        return self.symmetry.mean(density)

    def _levelled(self, density: Floats, wash: bool) -> Floats:
        rows = self._factors(0, density.mean(axis=1), wash)[:, np.newaxis]
        if self._columns is None:
            levelled: Floats = density * np.exp(rows)
            levelled *= np.exp(self._factors(1, levelled.mean(axis=0), wash))
            return levelled
        count = 2 * density.shape[1]
        # Every second row has an element in a column.
        mean = np.bincount(self._columns.ravel(), density.ravel(), count) / (density.shape[0] / 2)
        both = self.symmetry.mean(rows + self._factors(1, mean, wash)[self._columns])
        for along in ((0, 1), (1, 0), (1, 1)):  # else centres, where all lines cross, have more than the rest
            back = (-along[0], -along[1])
            both = (np.roll(both, along, (0, 1)) + 2 * both + np.roll(both, back, (0, 1))) / 4
        return density * np.exp(both)

    def _factors(self, axis: int, mean: Floats, wash: bool) -> Floats:
        found = np.zeros(len(mean))
        for line in self._lines[axis]:
            found[line.rows] += line.factors(mean, wash, self._free)
        return found


def places_of(repeat: str) -> tuple[set[float], set[float]]:
    """Return the mirrors across and down a cell, as shares of its height and width: at (0, 1) both edges.

    Examples
    --------
    >>> [sorted(places) for places in places_of("pm")]
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
    band = max(_LEAST, round(_BAND * count))
    if free:  # beyond the edge is the mirror image
        rows = np.arange(band) if place == 0 else count - 1 - np.arange(band)
        beyond = np.arange(band, 2 * band) if place == 0 else count - 1 - np.arange(band, 2 * band)
        return _Line(rows, np.zeros(band), _fading(np.arange(band) / band), beyond, beyond)
    offset = np.arange(-band, band)
    at = round(place * count)
    return _Line(
        (at + offset) % count,
        (offset + band + 0.5) / (2 * band),
        _fading(np.abs(offset + 0.5) / band),
        (at + np.arange(-2 * band, -band)) % count,
        (at + np.arange(band, 2 * band)) % count,
    )


def _fading(away: Floats) -> Floats:
    """Return 1 on a line and 0 at the band's end: where a factor began at once, its end would show as a
    hairline in wash.
    """
    found: Floats = np.cos(np.pi / 2 * away) ** 2
    return found


@lru_cache(maxsize=16)
def mirrors(repeat: str, shape: tuple[int, int], border: bool = False) -> Mirrors:
    """Return the mirrors of a rule on a cell."""
    return Mirrors(repeat, shape, border)
