"""The order of a texture: the lattice on which it repeats itself, and the sizes on which that lattice closes.

What repeats by two vectors (bricks, hexagons, threads) or along one direction only (lines of text, courses of
stones) shows in the autocorrelation: it is high at every sum of the vectors. An order is kept as its
reciprocal vectors k, in cycles per pixel: a shift d leaves the order in step when d · k is whole for each.
A texture that repeats after (H, W) px keeps step across its border when H k_y and W k_x are whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.fft as sf
from scipy import ndimage

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.checks import check_items, check_number, check_numbers
from toposeam.errors import OptionError, Term
from toposeam.texture.exemplar.scale import autocorrelation
from toposeam.texture.exemplar.sources import UNSEEN_STEP
from toposeam.texture.periodicity.lattice_fit import coarse_lattice, finest_lattice, mean_on

#: Least mean autocorrelation on the lattice of an ordered texture: by two vectors, and along one direction.
ORDERED, ORDERED_LINES = 0.25, 0.15
#: Largest autocorrelation half-way between two lattice points, as a share of that on them. It is little less
#: where the threads of one direction are pale; along stripes and courses it is as high everywhere.
_MOST_BETWEEN = 0.9
#: Least autocorrelation on multiples of a period of lines, as a share of that at 0, and on far points of a
#: lattice, as a share of that on all. A texture with less looks ordered, but its order wanders.
_LEAST_KEPT = 0.85
#: Largest difference from whole numbers, in periods, of shifts that belong to one lattice.
_SAME = 0.1
#: Least likeness at the shifts of an order that is only guessed.
_LIKELY = 0.4
#: Least number of its cells that a sample has room for: with fewer, nearly any two shifts look like one.
_LEAST_CELLS = 4
#: Largest stretch by which an order is made to close, and largest stretch that is not seen, as shares. Lines
#: that are bent a little where patches meet look better than broken ones; beyond, hexagons get borders twice.
STRETCH, UNSEEN = 0.12, 0.005
#: Shortest period that can be given, px.
_LEAST_PERIOD = 4
#: Largest side, px, of the middle part of an exemplar in which its order is measured.
_MEASURED_SIDE = 512
#: Side of a box, px: three of them, one after the other, blur like a Gaussian of 23.5 px. Slower changes
#: count as light.
_LIGHT_BOX = 47
#: Number of waves whose directions are tried, and the turns in degrees by which these are refined.
_WAVES, _TURNS_DEG = 6, (np.arange(-3, 3.1, 0.5), np.array([-0.25, 0.25]))


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """The lattice on which a texture repeats itself."""

    #: (n, 2) reciprocal vectors (y, x), cycles per px; n is 1 or 2.
    reciprocal: Floats
    #: Mean autocorrelation on the lattice.
    strength: float

    @property
    def periods(self) -> Floats:
        """(n, 2) shifts (y, x) in px that leave the order in step."""
        return np.asarray(np.linalg.pinv(self.reciprocal).T)

    def spans(self, other: Order) -> bool:
        """Test whether another order has the same lattice, nearly."""
        if self.reciprocal.shape != other.reciprocal.shape:
            return False
        whole = other.periods @ self.reciprocal.T
        return bool(
            np.abs(whole - np.rint(whole)).max() < _SAME
            and abs(abs(np.linalg.det(np.rint(whole))) - 1) < _SAME
        )

    def scaled(self, factor: float) -> Order:
        """Return the order of the texture reduced by a factor."""
        return Order(self.reciprocal * factor, self.strength)

    def fitted(self, size: tuple[int, int], wraps: tuple[bool, bool]) -> tuple[Floats, float]:
        """Find the reciprocal vectors nearest to these that close on a size, and the stretch that this needs,
        as a share.
        """
        length = np.asarray(size, float)
        whole = np.rint(self.reciprocal * length) / length
        closed = np.where(wraps, whole, self.reciprocal)
        return closed, float(
            (np.linalg.norm(closed - self.reciprocal, axis=1) / np.linalg.norm(self.reciprocal, axis=1)).max()
        )

    def closing_size(
        self, size: tuple[int, int], wraps: tuple[bool, bool], within: bool = False
    ) -> tuple[int, int]:
        """Find the size nearest to one wished for, or within it, on which the order nearly closes
        by itself.
        """
        if self.fitted(size, wraps)[1] <= UNSEEN:
            return size
        finest = float(np.linalg.norm(self.reciprocal, axis=1).max())
        height, width = (
            _closing(cycles, finest, length, within) if wrapping else length
            for cycles, length, wrapping in zip(self.reciprocal.T, size, wraps, strict=True)
        )
        return height, width

    def better_size(self, size: tuple[int, int], wraps: tuple[bool, bool]) -> tuple[int, int] | None:
        """Find the size nearest to one at which the order is stretched by half of it or less; None where
        there is none, or the stretching is invisible.
        """
        found = self.closing_size(size, wraps)
        stretch = self.fitted(size, wraps)[1]
        return found if stretch > UNSEEN and self.fitted(found, wraps)[1] <= stretch / 2 else None


def given_order(lattice: npt.ArrayLike) -> Order:
    """Make the order of a lattice: its periods down and to the right, px, 0 where nothing repeats, and how
    much further to the right each row lies than the one above, by default 0; or one or two shifts (y, x).

    Raises
    ------
    OptionError

    Examples
    --------
    >>> (given_order((16, 40, 20)).periods.round(6) + 0.0).tolist()
    [[16.0, 20.0], [0.0, 40.0]]
    >>> given_order((12.5, 0)).periods.round(6).tolist()
    [[12.5, 0.0]]
    """
    try:
        shifts = np.ndim(lattice) == 2
    except ValueError as error:  # rows of several lengths
        raise _no_lattice(lattice) from error
    if shifts:
        return _spanned(lattice)
    wanted = "two periods, px, and a shift of each row"
    given = [check_number("lattice", one) for one in check_items("lattice", lattice, object, wanted)]
    down, right, shear = (*given, 0.0)[:3] if len(given) in (2, 3) else (0.0, 0.0, 0.0)
    if any(one != 0 and one < _LEAST_PERIOD for one in (down, right)) or down == right == 0:
        raise _no_lattice(lattice)
    if not right:
        return Order(np.array([[1 / down, 0.0]]), 1.0)
    if not down:
        return Order(np.array([[0.0, 1 / right]]), 1.0)
    return Order(np.asarray(np.linalg.inv(np.array([[down, shear], [0.0, right]])).T, np.float64), 1.0)


def _spanned(lattice: npt.ArrayLike) -> Order:
    """Make the order of a lattice that one or two shifts (y, x) span."""
    shifts = check_numbers("lattice", lattice)
    if shifts.shape not in ((1, 2), (2, 2)) or not np.isfinite(shifts).all():
        raise _no_lattice(lattice)
    area = np.linalg.norm(shifts) if len(shifts) == 1 else abs(np.linalg.det(shifts)) ** 0.5
    if area < _LEAST_PERIOD:
        raise _no_lattice(lattice)
    return Order(np.asarray(np.linalg.pinv(shifts).T, np.float64), 1.0)


def _no_lattice(lattice: object) -> OptionError:
    return OptionError(
        "{parameter} is {value!r}; give its periods on both axes, {least} px or more, or 0 for one of "
        "them where nothing repeats, and by how much each row is shifted",
        kind="number",
        parameter=Term("lattice"),
        value=lattice,
        least=_LEAST_PERIOD,
    )


def _closing(cycles: Floats, finest: float, length: int, within: bool) -> int:
    """Find the length nearest to one at which every count of cycles is nearly whole; stretch is measured on
    the finest period.
    """
    if float(np.abs(cycles).max()) * length < 0.5:
        return length
    steep = np.abs(cycles)[np.abs(cycles) >= finest / 4]
    reach = max(math.ceil(1 / steep.min(initial=finest)), length // 20)
    lengths = np.arange(max(length - reach, 1), length + (0 if within else reach) + 1)
    count = lengths[:, np.newaxis] * cycles
    stretch = (np.abs(count - np.rint(count)) / lengths[:, np.newaxis]).max(axis=1) / finest
    return int(lengths[(stretch / UNSEEN + np.abs(lengths - length) / reach).argmin()])


def looked_at(shape: tuple[int, ...]) -> tuple[slice, ...]:
    """Select the rows and columns in which the order of an exemplar is measured: all, or the middle of a
    large one.
    """
    return tuple(
        slice(max(length - _MEASURED_SIDE, 0) // 2, (length + min(length, _MEASURED_SIDE)) // 2)
        for length in shape
    )


def find_order(features: Floats32, usable: Mask) -> Order | None:
    """Find the order of a texture, None where there is none, or nothing to be seen but slow light.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    found = _likeness(features, usable)
    if found is None:
        return None
    smooth, distance, element = found
    # The mean on a lattice is no higher than the highest value beyond the shortest vector.
    highest = float(smooth[distance >= 0.6 * element].max(initial=0))
    if highest < ORDERED_LINES:
        return None
    lattice = finest_lattice(smooth, element) if highest >= ORDERED else None
    if lattice is not None:
        strength = mean_on(smooth, lattice)
        far = mean_on(smooth, lattice, beyond=0.4)
        between = max(mean_on(smooth, lattice, half) for half in lattice / 2)
        if strength >= ORDERED and between <= _MOST_BETWEEN * strength and far >= _LEAST_KEPT * strength:
            return Order(np.asarray(np.linalg.inv(lattice).T, np.float64), strength)
    return _lines(smooth, element)


def likely_order(features: Floats32, usable: Mask) -> Order | None:
    """Guess an order of two or three periods, too few to be sure of: the lattice of the two shifts at which a
    texture, and at their sums as far as these are known, is most like itself. Whoever asks has to try it.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    found = _likeness(features, usable)
    if found is None:
        return None
    smooth, _, element = found
    lattice, strength = coarse_lattice(smooth, element)
    if lattice is None or strength < _LIKELY:
        return None
    if _LEAST_CELLS * abs(np.linalg.det(lattice)) > np.count_nonzero(usable):
        return None
    return Order(np.asarray(np.linalg.inv(lattice).T, np.float64), strength)


def _likeness(features: Floats32, usable: Mask) -> tuple[Floats, Floats, int] | None:
    """Compute how alike a sample is at every distance, each distance in px, and the size of an element; None
    where there is nothing to be seen but slow light.
    """
    middle = looked_at(usable.shape)
    if not usable[middle].any():
        return None
    detail = _detail(features[middle])
    if float(np.square(detail).mean(axis=(0, 1)).max()) < UNSEEN_STEP**2:
        return None
    near = autocorrelation(detail, usable[middle], tapered=True).astype(np.float64)
    height, width = (length // 2 for length in near.shape)
    distance = np.hypot(*np.ogrid[-height : height + 1, -width : width + 1])
    rings = distance.astype(np.intp).ravel()
    ring = np.bincount(rings, near.ravel()) / np.maximum(np.bincount(rings), 1)
    ends = np.flatnonzero(ring[: min(height, width)] < 0.05)
    if not len(ends):
        return None
    return ndimage.gaussian_filter(near, 1.0), distance, max(int(ends[0]), 4)


def _detail(features: Floats32) -> Floats32:
    """Take slow light out of features."""
    slow = features
    for axis in (0, 1) * 3:
        slow = ndimage.uniform_filter1d(slow, _LIGHT_BOX, axis)
    return features - slow


def _lines(smooth: Floats, element: int) -> Order | None:
    """Find the order of a texture that repeats across one direction only: the direction and the period at
    which the mean autocorrelation along lines rises and falls most regularly.
    """
    best, angle, period = 0.0, 0.0, 0.0
    for turns in (_directions(smooth), *map(np.deg2rad, _TURNS_DEG)):
        for turn in np.unique(turns + angle):  # harmonics have one direction
            score, length = _rhythm(_profile(smooth, turn), element)
            if score > best:
                best, angle, period = score, float(turn), length
        if best < 0.5 * ORDERED_LINES:
            return None
    return Order(np.array([[np.sin(angle), np.cos(angle)]]) / period, best) if best >= ORDERED_LINES else None


def _directions(smooth: Floats) -> Floats:
    """Find the angles of the strongest waves in the autocorrelation."""
    window = np.outer(*[np.hanning(length) for length in smooth.shape])
    power = np.abs(sf.rfft2((smooth - smooth.mean()) * window))
    power[np.hypot(*np.ogrid[: power.shape[0], : power.shape[1]]) < 2] = 0
    tops = np.argwhere((ndimage.maximum_filter(power, 3, mode="wrap") == power) & (power > 0))
    tops = tops[np.argsort(-power[tuple(tops.T)], kind="stable")[:_WAVES]]
    y, x = sf.fftfreq(smooth.shape[0])[tops[:, 0]], sf.rfftfreq(smooth.shape[1])[tops[:, 1]]
    return np.asarray(np.arctan2(y, x))


def _profile(smooth: Floats, angle: float) -> Floats:
    """Average the known autocorrelation along lines, by their distance from 0 in px; the angle is the
    normal's.
    """
    middle = [length // 2 for length in smooth.shape]
    reach = int(0.9 * min(middle))
    normal = np.array([np.sin(angle), np.cos(angle)])
    line, away = np.arange(-reach, reach + 1, 2.0), np.arange(0, reach)[:, np.newaxis]
    at = np.empty((2, len(away), len(line)))
    known = np.ones(at.shape[1:], bool)
    for axis, along in enumerate((normal[1], -normal[0])):
        np.add(away * normal[axis], line * along, out=at[axis])
        known &= np.abs(at[axis]) <= middle[axis]
        at[axis] += middle[axis]
    values = ndimage.map_coordinates(smooth, at, order=1, mode="nearest")
    return np.asarray((values * known).sum(axis=1) / known.sum(axis=1))


def _rhythm(profile: Floats, element: int) -> tuple[float, float]:
    """Compute how much higher a profile is at multiples of a period than half-way between them, for the
    period (px) at which that is most; the shortest of those that do about as well.
    """
    periods = np.arange(max(0.7 * element, 4.0), 0.5 * len(profile), 0.25)
    if not len(periods):
        return 0.0, 1.0
    distance = np.arange(len(profile))
    counts = (distance[-1] / periods).astype(int)
    starts = np.cumsum(counts) - counts
    multiples = (np.arange(counts.sum()) - starts.repeat(counts) + 1) * periods.repeat(counts)
    on, between = (
        np.interp(multiples - away, distance, profile) for away in (0, (periods / 2).repeat(counts))
    )
    regular = np.minimum.reduceat(on, starts) >= _LEAST_KEPT * profile[0]
    scores = np.zeros(len(periods))
    for number in np.flatnonzero(regular).tolist():
        part = slice(int(starts[number]), int(starts[number] + counts[number]))
        on_mean, between_mean = on[part].mean(), between[part].mean()
        scores[number] = min(on_mean, 0.5 * (on_mean - between_mean))
    if scores.max() <= 0:
        return 0.0, 1.0
    tops = np.flatnonzero(scores >= 0.9 * scores.max())
    first = tops[: 1 + int(np.flatnonzero(np.diff(tops, append=len(scores) + 2) > 1)[0])]
    best = int(first[scores[first].argmax()])
    return float(scores[best]), float(periods[best])
