"""Straight lines that cross a hole: kerbs, wires, painted lines, the edges of a road.

A line is found where an edge that runs towards a hole goes on beyond it: the picture is turned by every
angle, so that lines are rows, and the steps across each row are compared on both sides of the hole. Shifts
along the line, which lay it on itself to a fraction of a pixel, then bring what lies on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats, Floats32, Indices, Ints32, Mask
from toposeam.images import box_of

#: Length, px, of the two pieces of a line that are compared, on either side of the hole: this share of the
#: hole's longer side, but no less and no more.
_PIECE_SHARE, _LEAST_PIECE, _MOST_PIECE = 0.5, 20, 64
#: Distance, px, between the rim of the hole and these pieces: what has to go may reach a little beyond it.
_OFF_RIM = 2
#: Angles that are tried, in degrees, and those by which the best are refined.
_ANGLES, _REFINED = np.arange(0, 180, 1.5), np.arange(-1.25, 1.3, 0.25)
#: Standard deviation of the blur in which steps are measured, px.
_BLUR = 1.0
#: Least step across a line, as a share of white, in one px of the blurred picture; its least ratio to the
#: steps' deviation along the line; and the least ratio of the steps on both sides of the hole.
_LEAST_STEP, _LEAST_CLEAR, _LEAST_ALIKE = 0.012, 1.1, 0.4
#: Largest difference of brightness beside the line on both sides of the hole, as a multiple of the step.
_MOST_APART = 8.0
#: Distance from the line at which that is compared, px.
_BESIDE = 3
#: Side, px, to which the window is reduced where all angles are tried, about; and number of rows on either
#: side of an edge in which it is looked for again at full size.
_SEARCHED, _NEAR_ROWS = 100, 7
#: Value of the pixels of a hole.
_HOLE = 2.0
#: Least share of a piece that is known.
_KNOWN = 0.9
#: Lines nearer than this, px and degrees, where they cross the hole, are one; and edges nearer than this are
#: those of one band, as the two of a painted line, which is shifted as a whole.
_SAME_PX, _SAME_DEG, _BAND_PX, _BAND_DEG = 4.0, 6.0, 16.0, 1.0
#: Least of the same product of step and clearness for the clearest edge of a line: stripes of fur have 0.04.
_LEAST_BAND = 0.055
#: Largest number of edges.
_MOST = 12
#: Half the width, px, of the strip in which shifts along the line are asked for.
_HALF_STRIP = 4.0
#: Largest deviation, px, of a shift from a line that it lays on itself.
_OFF_LINE = 0.6
#: Lengths of shifts along a line, px: the first, and the ratio of each to the one before.
_FIRST_SHIFT, _SHIFT_RATIO = 10.0, 1.3


@dataclass(frozen=True, slots=True, eq=False)
class CrossingBand:
    """One line across a hole, or several edges side by side."""

    #: Unit vector along it, (y, x), and distances of its edges from the origin along the normal (x, -y), px.
    along: tuple[float, float]
    offsets: list[float]
    #: Where it enters the hole and leaves it, px along it.
    span: tuple[float, float]

    def shifts(self, reach: float) -> Indices:
        """List the shifts along it, (K, 2), that bring what lies within reach of the hole."""
        found, length = [], _FIRST_SHIFT
        while length <= self.span[1] - self.span[0] + reach:
            # Of about this length, the one that deviates least from the line.
            lengths = np.arange(length, length * _SHIFT_RATIO)
            steps = np.rint(lengths[:, np.newaxis] * np.array(self.along)).astype(np.intp)
            away = np.abs(steps[:, 0] * self.along[1] - steps[:, 1] * self.along[0])
            best = steps[int(away.argmin())]
            found += [best, -best]
            length *= _SHIFT_RATIO
        return np.array(found, np.intp).reshape(-1, 2)

    def keeps(self, shifts: Indices) -> Mask:
        """Test which shifts, (K, 2), lay it on itself."""
        away = shifts[:, 0] * self.along[1] - shifts[:, 1] * self.along[0]
        return np.asarray((np.abs(away) <= _OFF_LINE) & shifts.any(axis=1))

    def strip(self, shape: tuple[int, int]) -> Mask:
        """Mark the pixels of a picture beside it."""
        y, x = np.ogrid[: shape[0], : shape[1]]
        across = x * self.along[0] - y * self.along[1]
        t = y * self.along[0] + x * self.along[1]
        low, high = min(self.offsets) - _HALF_STRIP, max(self.offsets) + _HALF_STRIP
        found: Mask = (across >= low) & (across <= high) & (t >= self.span[0] - 1) & (t <= self.span[1] + 1)
        return found


@dataclass(frozen=True, slots=True)
class _Edge:
    """An edge on both sides of a hole: the step across it, larger where it is clear, its angle, and where it
    lies.
    """

    step: float
    angle: float
    offset: float
    span: tuple[float, float]


def crossing_bands(gray: Floats32, hole: Mask, known: Mask) -> list[CrossingBand]:
    """Find the straight lines that cross a hole.

    Parameters
    ----------
    gray : (H, W) float32 array
        Brightness, in shares of white; anything in the hole.
    hole, known : (H, W) bool array
        What has to go, and where the picture is known.
    """
    extent = max(side.stop - side.start for side in box_of(hole))
    piece = int(np.clip(_PIECE_SHARE * extent, _LEAST_PIECE, _MOST_PIECE))
    box = box_of(hole, piece + _OFF_RIM + 2)
    origin = box[0].start or 0, box[1].start or 0
    part = ndimage.gaussian_filter(np.where(known, gray, 0)[box], _BLUR)
    weight = ndimage.gaussian_filter(known[box].astype(np.float32), _BLUR)
    state = np.where(hole[box], _HOLE, known[box]).astype(np.float32)
    full = _Turning(part / np.maximum(weight, 1e-3), state, piece, 1)
    factor = max(1, math.isqrt(state.size) // _SEARCHED)
    first = full if factor == 1 else full.reduced(factor)
    edges = [one for angle in _ANGLES for one in first.edges(float(angle))]
    found: list[_Edge] = []
    for edge in sorted(edges, key=_step, reverse=True):
        if len(found) < _MOST and not any(_same(edge, other) for other in found):
            near = [one for turn in _REFINED for one in full.edges(edge.angle + float(turn), edge)]
            best = max((one for one in near if _same(one, edge)), key=_step, default=None)
            found += [] if best is None else [best]
    return [_moved(band, origin) for band in _bands(found)]


def _step(edge: _Edge) -> float:
    return edge.step


def _apart(one: _Edge, other: _Edge) -> tuple[float, float]:
    """Compute the distance of two edges where one crosses the middle of the hole, px, and their angle."""
    turn = (one.angle - other.angle + 90) % 180 - 90
    middle = sum(one.span) / 2
    a, b = math.radians(one.angle), math.radians(other.angle)
    y = middle * math.sin(a) - one.offset * math.cos(a)
    x = middle * math.cos(a) + one.offset * math.sin(a)
    return abs(x * math.sin(b) - y * math.cos(b) - other.offset), abs(turn)


def _same(one: _Edge, other: _Edge) -> bool:
    away, turn = _apart(one, other)
    return away < _SAME_PX and turn < _SAME_DEG


def _bands(edges: list[_Edge]) -> list[CrossingBand]:
    """Join edges that run side by side; all of a band take the direction of the clearest."""
    found: list[list[_Edge]] = []
    for edge in edges:
        for band in found:
            near = [_apart(edge, other) for other in band]
            if any(away < _BAND_PX and turn < _BAND_DEG for away, turn in near):
                band.append(edge)
                break
        else:
            found.append([edge])
    bands = []
    for band in found:
        if band[0].step < _LEAST_BAND:
            continue
        angle = math.radians(band[0].angle)
        along = math.sin(angle), math.cos(angle)
        offsets = [one.offset for one in band]
        if len(band) > 1:  # where each crosses the middle of the hole
            offsets = []
            for one in band:
                a, middle = math.radians(one.angle), sum(one.span) / 2
                y = middle * math.sin(a) - one.offset * math.cos(a)
                x = middle * math.cos(a) + one.offset * math.sin(a)
                offsets.append(x * along[0] - y * along[1])
        span = min(one.span[0] for one in band), max(one.span[1] for one in band)
        bands.append(CrossingBand(along, offsets, span))
    return bands


def _moved(band: CrossingBand, origin: tuple[int, int]) -> CrossingBand:
    """Express a band of a window in pixels of the picture."""
    (dy, dx), (top, left) = band.along, origin
    across, t = left * dy - top * dx, top * dy + left * dx
    return CrossingBand(
        band.along, [one + across for one in band.offsets], (band.span[0] + t, band.span[1] + t)
    )


class _Turning:
    """A window round a hole, turned so that lines of an angle are rows.

    Parameters
    ----------
    gray, state : (h, w) float32 arrays
        Brightness; and `_HOLE` in the hole, 1 where the picture is known, else 0.
    piece : int
        Length of the pieces of a line, px of the picture.
    factor : int
        By how much the window is reduced.
    """

    def __init__(self, gray: Floats32, state: Floats32, piece: int, factor: int) -> None:
        self._gray, self._state, self._piece, self._factor = gray, state, piece // factor, factor
        self._places = np.argwhere(state == _HOLE)

    def reduced(self, factor: int) -> _Turning:
        """Reduce the window."""
        height, width = (length // factor * factor for length in self._gray.shape)
        blocks = self._gray[:height, :width].reshape(height // factor, factor, width // factor, factor)
        middle = factor // 2
        state = self._state[middle:height:factor, middle:width:factor]
        return _Turning(blocks.mean(axis=(1, 3)), state, self._piece, factor)

    def edges(self, angle: float, near: _Edge | None = None) -> list[_Edge]:
        """List the edges along an angle, in degrees, x to the right and y down; all, or those near one."""
        turn = math.radians(angle)
        along = np.array([math.sin(turn), math.cos(turn)])
        normal = np.array([-along[1], along[0]])  # (y, x): across = x * along_y - y * along_x
        middle = (np.array(self._gray.shape) - 1.0) / 2
        # Row v and column u of the turned window: middle + (v + low) * normal + (u + left) * along. It holds
        # the hole, the pieces beside it, and the rows beside these.
        far, wide = ((self._places - middle) @ way for way in (normal, along))
        low, high = math.floor(far.min()) - 1 - _BESIDE, math.ceil(far.max()) + 1 + _BESIDE
        reach = 2 + _OFF_RIM + self._piece
        left, right = math.floor(wide.min()) - reach, math.ceil(wide.max()) + reach
        if near is not None:
            a, t = math.radians(near.angle), sum(near.span) / 2
            point = t * np.array([math.sin(a), math.cos(a)]) + near.offset * np.array(
                [-math.cos(a), math.sin(a)]
            )
            row = round(float((point - middle) @ normal))
            low, high = row - _NEAR_ROWS, row + _NEAR_ROWS
        matrix = np.stack([normal, along], axis=1)
        start = middle + low * normal + left * along
        count, side = high - low + 1, right - left + 1
        state = ndimage.affine_transform(
            self._state, matrix, start, (count, side), order=0, mode="constant", prefilter=False
        )
        there, steady = state == _HOLE, state == 1
        steady[1:-1] &= steady[2:] & steady[:-2]
        rows = np.flatnonzero(there.any(axis=1))
        rows = rows[(rows >= _BESIDE) & (rows < count - _BESIDE)]
        if not len(rows):
            return []
        first, last = there[rows].argmax(axis=1), side - 1 - there[rows, ::-1].argmax(axis=1)
        begins = np.stack([first - _OFF_RIM - self._piece, last + 1 + _OFF_RIM])
        columns = begins[..., np.newaxis] + np.arange(self._piece)
        inside = (columns >= 0) & (columns < side)
        columns = np.clip(columns, 0, side - 1)
        uses = steady[rows[:, np.newaxis], columns] & inside
        shares = uses.sum(axis=2) / self._piece
        known = (shares >= _KNOWN).all(axis=0)
        if not known.any():
            return []
        rows, first, last = (one[known] for one in (rows, first, last))
        seen = ndimage.affine_transform(self._gray, matrix, start, (count, side), order=1, mode="constant")
        steps = np.zeros_like(seen)
        steps[1:-1] = 0.5 * (seen[2:] - seen[:-2])
        means, clear, beside = [], [], []
        for own, use in zip(columns[:, known], uses[:, known], strict=True):
            at = rows[:, np.newaxis], own
            total = np.maximum(use.sum(axis=1), 1)
            mean = (steps[at] * use).sum(axis=1) / total
            spread = np.sqrt((np.square(steps[at] - mean[:, np.newaxis]) * use).sum(axis=1) / total)
            means.append(mean)
            clear.append(np.abs(mean) / (spread + 0.003))
            beside.append(
                np.stack(
                    [
                        (seen[rows[:, np.newaxis] + away, own] * use).sum(axis=1) / total
                        for away in (-_BESIDE, _BESIDE)
                    ]
                )
            )
        a, b = means
        step = np.where(a * b > 0, np.minimum(np.abs(a), np.abs(b)), 0)
        fits = (step >= _LEAST_STEP) & (step >= _LEAST_ALIKE * np.maximum(np.abs(a), np.abs(b)))
        fits &= np.minimum(*clear) >= _LEAST_CLEAR
        fits &= (np.abs(beside[0] - beside[1]) <= _MOST_APART * step).all(axis=0)
        score: Floats = np.where(fits, step * np.minimum(np.minimum(*clear), 3), 0)
        by_row = np.zeros(count)
        by_row[rows] = score
        best = (score > 0) & (score >= ndimage.maximum_filter1d(by_row, 5)[rows])
        found = []
        for k in np.flatnonzero(best).tolist():
            corner = start + rows[k] * normal
            # From pixels of the reduced window to those of the window.
            f, shift = self._factor, (self._factor - 1) / 2
            offset = f * float(corner[1] * along[0] - corner[0] * along[1]) + shift * (along[0] - along[1])
            t = f * float(corner @ along) + shift * (along[0] + along[1])
            span = t + f * int(first[k]), t + f * int(last[k])
            found.append(_Edge(float(score[k]), angle, float(offset), span))
        return found


def strips_of(bands: list[CrossingBand], hole: Mask) -> Ints32:
    """Number the pixels of a hole by the band that crosses it there, from 1 on; 0 for none, and where two
    cross.
    """
    found = np.zeros(hole.shape, np.int32)
    crossed = np.zeros(hole.shape, np.int32)
    for number, band in enumerate(bands, start=1):
        strip = band.strip((hole.shape[0], hole.shape[1])) & hole
        found[strip] = number
        crossed += strip
    found[crossed > 1] = 0
    return found


def kept_by(bands: list[CrossingBand], shifts: Indices) -> Mask:
    """Test which shifts, (K, 2), lay each band on itself: (K, bands + 1), the first for pixels on none."""
    return np.stack([np.ones(len(shifts), bool), *(band.keeps(shifts) for band in bands)], axis=1)
