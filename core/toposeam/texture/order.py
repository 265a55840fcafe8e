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

from toposeam.images import Mask
from toposeam.texture.atlas import Floats32
from toposeam.texture.scale import autocorrelation
from toposeam.texture.sources import UNSEEN_STEP

#: Mean correlation with itself on the lattice from which on a texture counts as ordered, by two vectors and
#: along one direction.
ORDERED, ORDERED_LINES = 0.25, 0.15
#: Share of the best lattice's correlation that a finer one must reach to be taken, on all of its points.
_FINER = 0.85
#: Largest correlation half-way between two lattice points, as a share of that on them: little less than that
#: where the threads of one direction are pale; along stripes and courses it is as high everywhere.
_BETWEEN = 0.9
#: Lines that keep step correlate with the next ones at least this much of how they do with themselves; and
#: lattices as much far away as near by. What does not is ordered by eye, but wanders.
_KEPT = 0.85
#: How much an order may be stretched, as a share, so that it closes, and how much nobody sees. Lines that are
#: bent a little where patches meet look better than such as break; beyond, hexagons get borders twice.
STRETCH, UNSEEN = 0.12, 0.005
#: Of larger exemplars, px a side, the middle tells the order.
_LOOKED_AT = 512
#: Peaks of the autocorrelation that are tried as vectors, and lattices that are fitted.
_PEAKS, _FITTED = 24, 20
#: Points of a lattice, at most, by which it is fitted.
_POINTS = 400
#: Three boxes of so many px, one after the other, blur like a Gaussian of 23.5 px: what is slower is light.
_SLOW = 47
#: Waves whose directions are tried, and by how many degrees these are turned to be exact.
_WAVES, _TURNS = 6, (np.arange(-3, 3.1, 0.5), np.array([-0.25, 0.25]))

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """On which lattice a texture repeats itself."""

    #: (n, 2) reciprocal vectors (y, x), cycles per px; n is 1 or 2.
    reciprocal: Floats
    #: Mean autocorrelation on the lattice.
    strength: float

    @property
    def periods(self) -> Floats:
        """(n, 2) shifts (y, x) in px that leave the order in step."""
        return np.asarray(np.linalg.pinv(self.reciprocal).T)

    def fitted(self, size: tuple[int, int], wraps: tuple[bool, bool]) -> tuple[Floats, float]:
        """The reciprocal vectors nearest to these that close on a size, and the stretch that this needs, as
        a share.
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
        """The size nearest to one wished for, or within it, on which the order nearly closes by itself."""
        if self.fitted(size, wraps)[1] <= UNSEEN:
            return size
        finest = float(np.linalg.norm(self.reciprocal, axis=1).max())
        height, width = (
            _closing(cycles, finest, length, within) if wrapping else length
            for cycles, length, wrapping in zip(self.reciprocal.T, size, wraps, strict=True)
        )
        return height, width

    def better_size(self, size: tuple[int, int], wraps: tuple[bool, bool]) -> tuple[int, int] | None:
        """The size nearest to one at which the order is stretched by half of it or less, None where there is
        none, or nobody sees that it is stretched.
        """
        found = self.closing_size(size, wraps)
        stretch = self.fitted(size, wraps)[1]
        return found if stretch > UNSEEN and self.fitted(found, wraps)[1] <= stretch / 2 else None


def _closing(cycles: Floats, finest: float, length: int, within: bool) -> int:
    """The length nearest to one at which every count of cycles is nearly whole; stretch is told by the
    finest period.
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
    """The rows and columns that tell the order of an exemplar: all of it, or the middle of a large one."""
    return tuple(
        slice(max(length - _LOOKED_AT, 0) // 2, (length + min(length, _LOOKED_AT)) // 2) for length in shape
    )


def find_order(features: Floats32, usable: Mask) -> Order | None:
    """The order of a texture, None where there is none, or nothing to be seen but slow light.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
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
    element = max(int(ends[0]), 4)
    smooth = ndimage.gaussian_filter(near, 1.0)
    # The mean on a lattice is no higher than the highest value beyond the shortest vector.
    highest = float(smooth[distance >= 0.6 * element].max(initial=0))
    if highest < ORDERED_LINES:
        return None
    lattice = _lattice(smooth, element) if highest >= ORDERED else None
    if lattice is not None:
        strength = _on(smooth, lattice)
        far = _on(smooth, lattice, beyond=0.4)
        between = max(_on(smooth, lattice, half) for half in lattice / 2)
        if strength >= ORDERED and between <= _BETWEEN * strength and far >= _KEPT * strength:
            return Order(np.asarray(np.linalg.inv(lattice).T, np.float64), strength)
    return _lines(smooth, element)


def _detail(features: Floats32) -> Floats32:
    """What is left without slow light."""
    slow = features
    for axis in (0, 1) * 3:
        slow = ndimage.uniform_filter1d(slow, _SLOW, axis)
    return features - slow


def _lattice(smooth: Floats, element: int) -> Floats | None:
    """The (2, 2) vectors of the finest lattice on which the autocorrelation is about as high as on any."""
    peaks = _peaks(smooth, element)
    loose = ndimage.maximum_filter(smooth, 5)
    room = smooth.size / 16
    found: dict[tuple[float, ...], Floats] = {}  # most pairs of peaks span the same few lattices
    for i, one in enumerate(peaks):
        for other in peaks[:i]:
            vectors = _reduced(np.stack([one, other]))
            if vectors is not None and np.linalg.norm(vectors[0]) >= 0.7 * element and _area(vectors) <= room:
                found.setdefault(tuple(vectors.ravel().tolist()), vectors)
    first = [(_on(loose, vectors), _area(vectors), vectors) for vectors in found.values()]
    if not first:
        return None
    most = max(score for score, _, _ in first)
    tried = sorted((one for one in first if one[0] >= 0.75 * most), key=lambda one: one[1])[:_FITTED]
    fitted = []
    for _, _, vectors in tried:
        better = _reduced(_refined(smooth, vectors))
        if better is not None:
            fitted.append((_least_on(smooth, better), _area(better), better))
    if not fitted:
        return None
    most = max(score for score, _, _ in fitted)
    fine = [one for one in fitted if one[0] >= _FINER * most] or fitted
    return min(fine, key=lambda one: one[1])[2]


def _peaks(smooth: Floats, element: int) -> Floats:
    """(n, 2) maxima beyond one element, in one half-plane: the highest, and the nearest of the high ones."""
    height, width = (length // 2 for length in smooth.shape)
    y, x = np.nonzero(ndimage.maximum_filter(smooth, 7) == smooth)
    y, x = y - height, x - width
    kept = (np.hypot(y, x) > element) & ((y > 0) | ((y == 0) & (x > 0)))
    y, x = y[kept], x[kept]
    value, distance = smooth[y + height, x + width], np.hypot(y, x)
    highest = np.argsort(-value, kind="stable")[: _PEAKS // 2]
    nearest = np.argsort(np.where(value >= 0.4 * value.max(initial=0), distance, np.inf), kind="stable")
    chosen = np.unique(np.concatenate([highest, nearest[: _PEAKS // 2]]))
    return np.stack([y[chosen], x[chosen]], axis=1).astype(float)


def _reduced(vectors: Floats) -> Floats | None:
    """The shortest vectors of the same lattice (Lagrange's reduction), in one half-plane; None where they
    span none.
    """
    short, long = vectors
    for _ in range(30):
        if short @ short > long @ long:
            short, long = long, short
        if not short @ short > 9:
            return None
        times = np.rint(short @ long / (short @ short))
        if times == 0:
            found = np.stack([one if tuple(one) > (0, 0) else -one for one in (short, long)])
            return found if _area(found) > 30 else None
        long = long - times * short
    return None


def _area(vectors: Floats) -> float:
    """The area of a lattice's cell."""
    (a, b), (c, d) = vectors
    return abs(float(a * d - b * c))


def _points(vectors: Floats, room: tuple[float, float]) -> tuple[Floats, Floats]:
    """Whole coordinates and shifts of the lattice's points in one half of a box, but 0."""
    (a, b), (c, d) = vectors
    area = max(_area(vectors), 1.0)
    lines = []
    for one, other in ((d, c), (b, a)):
        most = int((abs(one) * room[0] + abs(other) * room[1]) / area) + 1
        lines.append(np.arange(-most, most + 1))
    y, x = (lines[0][:, np.newaxis] * vectors[0, axis] + lines[1] * vectors[1, axis] for axis in (0, 1))
    kept = (y <= room[0]) & (np.abs(x) <= room[1]) & ((y > 0) | ((y == 0) & (x > 0)))
    whole = np.argwhere(kept).astype(float) + np.array([lines[0][0], lines[1][0]])
    return whole, np.stack([y[kept], x[kept]], axis=1)


def _on(smooth: Floats, vectors: Floats, beside: Floats | float = 0.0, beyond: float = 0.0) -> float:
    """Mean autocorrelation on the lattice's points, or beside them; on those beyond a share of the room."""
    height, width = (length // 2 for length in smooth.shape)
    _, shifts = _points(vectors, (0.75 * height, 0.75 * width))
    shifts = shifts[(np.abs(shifts) >= [beyond * height, beyond * width]).any(axis=1)]
    if len(shifts) < 3:
        return 0.0
    at = shifts + beside + [height, width]
    return float(ndimage.map_coordinates(smooth, at.T, order=1, mode="nearest").mean())


def _least_on(smooth: Floats, vectors: Floats) -> float:
    """The least of the mean autocorrelations on the points of even and of odd coordinates: where pale threads
    are taken for twice as many, those between them are lower than the others.
    """
    middle = np.array(smooth.shape) // 2
    whole, shifts = _points(vectors, (0.75 * middle[0], 0.75 * middle[1]))
    if len(shifts) < 3:
        return 0.0
    values = ndimage.map_coordinates(smooth, (shifts + middle).T, order=1, mode="nearest")
    kind = (whole % 2 @ [1, 2]).astype(np.intp)
    count = np.bincount(kind)
    return float((np.bincount(kind, values)[count > 0] / count[count > 0]).min())


def _refined(smooth: Floats, vectors: Floats) -> Floats:
    """Least squares over the maxima nearest to the lattice's points, from near ones outwards."""
    height, width = (length // 2 for length in smooth.shape)
    values_of, wide = smooth.ravel(), smooth.shape[1]
    for share in (0.35, 0.6, 0.8, 0.8):
        whole, shifts = _points(vectors, (share * height, share * width))
        if len(whole) > _POINTS:
            some = np.sort(np.random.default_rng(0).choice(len(whole), _POINTS, replace=False))
            whole, shifts = whole[some], shifts[some]
        middles = np.rint(shifts).astype(int) + np.array([height, width])
        y, x = (
            np.clip(middle[:, np.newaxis] + np.arange(-2, 3), 1, length - 2)
            for middle, length in zip(middles.T, smooth.shape, strict=True)
        )
        around = (y[:, :, np.newaxis] * wide + x[:, np.newaxis]).reshape(len(y), 25)
        values = values_of.take(around)
        best = values.argmax(axis=1)
        top = np.stack(np.divmod(around[np.arange(len(best)), best], wide), axis=1)
        value = values.max(axis=1, initial=0)
        clear = value > 0.3 * value.max(initial=1e-9)
        if np.count_nonzero(clear) < 3:  # of a coarse lattice there are more farther out
            continue
        top, value = top[clear], value[clear]
        exact = top.astype(float)
        for axis in (0, 1):  # the top of the parabola through three values
            step = np.eye(2, dtype=int)[axis]
            before, after = (smooth[tuple((top + way * step).T)] for way in (-1, 1))
            bend = np.minimum(before - 2 * smooth[tuple(top.T)] + after, -1e-9)
            exact[:, axis] += np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
        weight = np.sqrt(value)[:, np.newaxis]
        vectors = np.linalg.lstsq(whole[clear] * weight, (exact - [height, width]) * weight, rcond=None)[0]
    return vectors


def _lines(smooth: Floats, element: int) -> Order | None:
    """The order of a texture that repeats across one direction only: the direction and the period at which
    the mean autocorrelation along lines rises and falls most regularly.
    """
    best, angle, period = 0.0, 0.0, 0.0
    for turns in (_directions(smooth), *map(np.deg2rad, _TURNS)):
        for turn in np.unique(turns + angle):  # harmonics have one direction
            score, length = _rhythm(_profile(smooth, turn), element)
            if score > best:
                best, angle, period = score, float(turn), length
        if best < 0.5 * ORDERED_LINES:
            return None
    return Order(np.array([[np.sin(angle), np.cos(angle)]]) / period, best) if best >= ORDERED_LINES else None


def _directions(smooth: Floats) -> Floats:
    """Angles of the strongest waves in the autocorrelation."""
    window = np.outer(*[np.hanning(length) for length in smooth.shape])
    power = np.abs(sf.rfft2((smooth - smooth.mean()) * window))
    power[np.hypot(*np.ogrid[: power.shape[0], : power.shape[1]]) < 2] = 0
    tops = np.argwhere((ndimage.maximum_filter(power, 3, mode="wrap") == power) & (power > 0))
    tops = tops[np.argsort(-power[tuple(tops.T)], kind="stable")[:_WAVES]]
    y, x = sf.fftfreq(smooth.shape[0])[tops[:, 0]], sf.rfftfreq(smooth.shape[1])[tops[:, 1]]
    return np.asarray(np.arctan2(y, x))


def _profile(smooth: Floats, angle: float) -> Floats:
    """Mean autocorrelation along lines, as far as it is known, by their distance from 0 in px; the angle is
    the normal's.
    """
    height, width = (length // 2 for length in smooth.shape)
    reach = int(0.9 * min(height, width))
    normal = np.array([np.sin(angle), np.cos(angle)])
    line, away = np.arange(-reach, reach + 1, 2.0), np.arange(0, reach)[:, np.newaxis]
    at = np.empty((2, len(away), len(line)))
    for axis, (along, middle) in enumerate(zip((normal[1], -normal[0]), (height, width), strict=True)):
        np.add(away * normal[axis], line * along, out=at[axis])
        at[axis] += middle
    known = ((at >= 0) & (at <= np.array([[[2 * height]], [[2 * width]]]))).all(axis=0)
    values = ndimage.map_coordinates(smooth, at, order=1, mode="nearest")
    return np.asarray(np.average(values, axis=1, weights=known))


def _rhythm(profile: Floats, element: int) -> tuple[float, float]:
    """How much higher a profile is at multiples of a period than half-way between them, for the period (px)
    at which that is most; the shortest of those that do about as well.
    """
    periods = np.arange(max(0.7 * element, 4.0), 0.5 * len(profile), 0.25)
    if not len(periods):
        return 0.0, 1.0
    distance = np.arange(len(profile))
    counts = (distance[-1] / periods).astype(int)
    starts = np.cumsum(counts) - counts
    multiples = (np.arange(counts.sum()) - starts.repeat(counts) + 1) * periods.repeat(counts)
    on, off = (np.interp(multiples - away, distance, profile) for away in (0, (periods / 2).repeat(counts)))
    regular = np.minimum.reduceat(on, starts) >= _KEPT * profile[0]
    scores = np.zeros(len(periods))
    for number in np.flatnonzero(regular).tolist():
        part = slice(int(starts[number]), int(starts[number] + counts[number]))
        high, low = on[part].mean(), off[part].mean()
        scores[number] = min(high, 0.5 * (high - low))
    if scores.max() <= 0:
        return 0.0, 1.0
    tops = np.flatnonzero(scores >= 0.9 * scores.max())
    first = tops[: 1 + int(np.flatnonzero(np.diff(tops, append=len(scores) + 2) > 1)[0])]
    best = int(first[scores[first].argmax()])
    return float(scores[best]), float(periods[best])
