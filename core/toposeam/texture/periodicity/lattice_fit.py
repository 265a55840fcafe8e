"""The lattice on which an autocorrelation is high: found among its maxima, and fitted to them.

An autocorrelation has the shift 0 in its middle and is as high at a shift as at the opposite one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats, Indices

#: Least correlation of a finer lattice that is taken instead of the best one, as a share of the best one's.
_FINER_SHARE = 0.85
#: Largest number of peaks of the autocorrelation that are tried as vectors, and of lattices that are fitted.
_MOST_PEAKS, _MOST_FITTED = 24, 20
#: Of a lattice of few points: the part of the room in which shifts are known, the factor by which likeness
#: has to differ, and the cell of a finer lattice, as a share of the other's.
_KNOWN, _ALIKE, _FINER = 0.98, 1.15, 0.8
#: Largest number of points by which a lattice is fitted.
_MOST_POINTS = 400


def finest_lattice(smooth: Floats, element: int) -> Floats | None:
    """Find the (2, 2) vectors of the finest lattice on which the autocorrelation is about as high
    as on any.
    """
    peaks = _peaks(smooth, element).tolist()
    loose = ndimage.maximum_filter(smooth, 5)
    room = smooth.size / 16
    found: dict[tuple[float, ...], Floats] = {}  # most pairs of peaks span the same few lattices
    for i, (a, b) in enumerate(peaks):
        for c, d in peaks[:i]:
            vectors = _reduced(a, b, c, d) if abs(a * d - b * c) <= room else None
            if vectors is not None and math.hypot(*vectors[0]) >= 0.7 * element:
                found.setdefault(tuple(vectors.ravel().tolist()), vectors)
    first = [(_near(loose, vectors), _area(vectors), vectors) for vectors in found.values()]
    if not first:
        return None
    most = max(score for score, _, _ in first)
    tried = sorted((one for one in first if one[0] >= 0.75 * most), key=lambda one: one[1])[:_MOST_FITTED]
    fitted, tops = [], _tops(smooth)
    for _, _, vectors in tried:
        better = _reduced(*_refined(tops, vectors).ravel().tolist())
        if better is not None:
            fitted.append((_least_on(smooth, better), _area(better), better))
    if not fitted:
        return None
    most = max(score for score, _, _ in fitted)
    fine = [one for one in fitted if one[0] >= _FINER_SHARE * most] or fitted
    return min(fine, key=lambda one: one[1])[2]


def coarse_lattice(smooth: Floats, element: int) -> tuple[Floats | None, float]:
    """Find the (2, 2) vectors of a lattice of few points, and the likeness on these: the least on the vectors
    themselves, or the mean on them, their sums and their doubles, if that is less. Of lattices about as alike
    the finer one counts.
    """
    found: Floats | None = None
    most, peaks = 0.0, _peaks(smooth, element).tolist()
    middle = np.array(smooth.shape) // 2
    for i, (a, b) in enumerate(peaks):
        for c, d in peaks[:i]:
            vectors = _reduced(a, b, c, d)
            if vectors is None or math.hypot(*vectors[0]) < 0.7 * element:
                continue
            one, two = vectors
            shifts = np.stack([one, two, one + two, one - two, 2 * one, 2 * two])
            known = (np.abs(shifts) <= _KNOWN * middle).all(axis=1)
            if not known[:2].all():
                continue
            values = ndimage.map_coordinates(smooth, (shifts[known] + middle).T, order=1, mode="nearest")
            score = float(min(values[0], values[1], values.mean()))
            finer = found is not None and _area(vectors) < _FINER * _area(found)
            if score > (most / _ALIKE if finer else most * _ALIKE):
                found, most = vectors, score
    return found, most


def _peaks(smooth: Floats, element: int) -> Floats:
    """Find (n, 2) maxima beyond one element, in one half-plane: the highest, and the nearest of the high
    ones.
    """
    height, width = (length // 2 for length in smooth.shape)
    y, x = np.nonzero(ndimage.maximum_filter(smooth, 7) == smooth)
    y, x = y - height, x - width
    kept = (np.hypot(y, x) > element) & ((y > 0) | ((y == 0) & (x > 0)))
    y, x = y[kept], x[kept]
    value, distance = smooth[y + height, x + width], np.hypot(y, x)
    highest = np.argsort(-value, kind="stable")[: _MOST_PEAKS // 2]
    nearest = np.argsort(np.where(value >= 0.4 * value.max(initial=0), distance, np.inf), kind="stable")
    chosen = np.unique(np.concatenate([highest, nearest[: _MOST_PEAKS // 2]]))
    return np.stack([y[chosen], x[chosen]], axis=1).astype(float)


def _reduced(a: float, b: float, c: float, d: float) -> Floats | None:
    """Find the shortest vectors of the lattice that (a, b) and (c, d) span (Lagrange's reduction), in one
    half-plane; None where they span none.
    """
    for _ in range(30):
        if a * a + b * b > c * c + d * d:
            a, b, c, d = c, d, a, b
        if not a * a + b * b > 9:
            return None
        times = round((a * c + b * d) / (a * a + b * b))
        if times == 0:
            found = np.array([one if one > (0, 0) else (-one[0], -one[1]) for one in ((a, b), (c, d))])
            return found if _area(found) > 30 else None
        c, d = c - times * a, d - times * b
    return None


def _area(vectors: Floats) -> float:
    """Compute the area of a lattice's cell."""
    (a, b), (c, d) = vectors
    return abs(float(a * d - b * c))


def _points(vectors: Floats, room: tuple[float, float]) -> tuple[Floats, Floats]:
    """List the whole coordinates and shifts of the lattice's points in one half of a box, but 0."""
    (a, b), (c, d) = vectors.tolist()
    area = max(_area(vectors), 1.0)
    first, second = (
        np.arange(-most, most + 1.0)
        for most in (
            int((abs(one) * room[0] + abs(other) * room[1]) / area) + 1 for one, other in ((d, c), (b, a))
        )
    )
    y, x = (first[:, np.newaxis] * one + second * other for one, other in ((a, c), (b, d)))
    kept = np.flatnonzero((y <= room[0]) & (np.abs(x) <= room[1]) & ((y > 0) | ((y == 0) & (x > 0))))
    i, j = np.divmod(kept, len(second))
    return np.stack([first[i], second[j]], axis=1), np.stack([y.take(kept), x.take(kept)], axis=1)


def _near(loose: Floats, vectors: Floats) -> float:
    """Compute the mean of what is near a lattice's points, whose vectors are whole."""
    height, width = (length // 2 for length in loose.shape)
    _, shifts = _points(vectors, (0.75 * height, 0.75 * width))
    if len(shifts) < 3:
        return 0.0
    return float(loose.take(_flat(shifts, loose.shape[1]) + height * loose.shape[1]).mean())


def mean_on(smooth: Floats, vectors: Floats, beside: Floats | float = 0.0, beyond: float = 0.0) -> float:
    """Compute the mean autocorrelation on the lattice's points, or beside them; on those beyond a share of
    the room.
    """
    height, width = (length // 2 for length in smooth.shape)
    _, shifts = _points(vectors, (0.75 * height, 0.75 * width))
    shifts = shifts[(np.abs(shifts) >= [beyond * height, beyond * width]).any(axis=1)]
    if len(shifts) < 3:
        return 0.0
    at = shifts + beside + [height, width]
    return float(ndimage.map_coordinates(smooth, at.T, order=1, mode="nearest").mean())


def _least_on(smooth: Floats, vectors: Floats) -> float:
    """Compute the least of the mean autocorrelations on the points of even and of odd coordinates: where pale
    threads are taken for twice as many, those between them are lower than the others.
    """
    middle = np.array(smooth.shape) // 2
    whole, shifts = _points(vectors, (0.75 * middle[0], 0.75 * middle[1]))
    if len(shifts) < 3:
        return 0.0
    values = ndimage.map_coordinates(smooth, (shifts + middle).T, order=1, mode="nearest")
    kind = (whole % 2 @ [1, 2]).astype(np.intp)
    count = np.bincount(kind)
    return float((np.bincount(kind, values)[count > 0] / count[count > 0]).min())


def _tops(smooth: Floats) -> tuple[Floats, Floats]:
    """Find the highest value within 2 px of each shift in the lower half, (h, w), and the tops of the
    parabolas through it and the values beside it, as shifts (2, h, w).
    """
    height, width = smooth.shape
    ways = (np.clip(np.arange(width) + away, 1, width - 2) for away in range(-2, 3))
    best, x = _highest((smooth.take(x, axis=1), x) for x in ways)
    lines = (np.clip(np.arange(height // 2, height) + away, 1, height - 2) for away in range(-2, 3))
    best, at = _highest((best.take(y, axis=0), y[:, np.newaxis] * width + x.take(y, axis=0)) for y in lines)
    exact = np.stack(np.divmod(at, width)).astype(float)
    for top, step in zip(exact, (width, 1), strict=True):
        before, here, after = (smooth.take(at + away) for away in (-step, 0, step))
        top += np.clip(0.5 * (before - after) / np.minimum(before - 2 * here + after, -1e-9), -0.5, 0.5)
    exact -= np.reshape([height // 2, width // 2], (2, 1, 1))
    return best, exact


def _highest(given: Iterable[tuple[Floats, Indices]]) -> tuple[Floats, Indices]:
    """Select the first of the highest values: it, and what stands for it."""
    each = iter(given)
    best, chosen = next(each)
    chosen = np.broadcast_to(chosen, best.shape).copy()
    for values, other in each:
        higher = values > best
        np.copyto(best, values, where=higher)
        np.copyto(chosen, other, where=higher)
    return best, chosen


def _refined(tops: tuple[Floats, Floats], vectors: Floats) -> Floats:
    """Fit a lattice by least squares to the maxima nearest to its points, from near ones outwards."""
    values, exact = tops
    height, width = len(values) - 1, values.shape[1] // 2
    for share in (0.35, 0.6, 0.8, 0.8):
        whole, shifts = _points(vectors, (share * height, share * width))
        if len(whole) > _MOST_POINTS:
            some = np.sort(np.random.default_rng(0).choice(len(whole), _MOST_POINTS, replace=False))
            whole, shifts = whole[some], shifts[some]
        at = _flat(shifts, values.shape[1])
        value = values.take(at)
        clear = value > 0.3 * value.max(initial=1e-9)
        if np.count_nonzero(clear) < 3:  # of a coarse lattice there are more farther out
            continue
        weight = np.sqrt(value[clear])[:, np.newaxis]
        found = exact.reshape(2, -1).take(at[clear], axis=1).T
        vectors = np.linalg.lstsq(whole[clear] * weight, found * weight, rcond=None)[0]
    return vectors


def _flat(shifts: Floats, wide: int) -> Indices:
    """Compute the flat places of the pixels nearest to some shifts in the lower half of an
    autocorrelation.
    """
    nearest = np.rint(shifts).astype(np.intp)
    return np.asarray(nearest[:, 0] * wide + nearest[:, 1] + wide // 2)
