"""How likely seams are to be seen, by squares, and the worst places.

As soon as a seam runs there, a square counts by the likeness of the two pictures; once the blended picture
has been looked at, by the largest step of tone, hue or grain, or the clearest break, that it shows: see
:mod:`toposeam.seam.result.verdict`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

import toposeam as ts
from toposeam.arrays import Floats, Labels
from toposeam.layers.canvas.layer import Box
from toposeam.seam.result.verdict import HALF_COST, SQUARE_PX, STEP_REACH, UNSEEN

#: Below this likeness a place is one of the worst; from this one on, it no longer shows.
BAD, GOOD = UNSEEN, 0.55
#: Most places that are listed, and how far apart they lie, px of the preview.
_MOST_PLACES, _APART_PX = 8, 80.0
#: A place that was listed is looked for again so far round it, px.
_NEARBY_PX = 40.0
#: The likeness of a square without a seam.
_NONE = 255


@dataclass(slots=True)
class SeamPlace:
    """One of the worst places along the seams."""

    x: float
    y: float
    #: In [0, 1].
    likeness: float
    #: True once the blended picture was looked at there.
    judged: bool = False

    @property
    def done(self) -> bool:
        """True if the seam no longer shows there."""
        return self.likeness >= GOOD


class LikenessMap:
    """The likeness along the seams of a canvas, by squares: 0 to 254, and 255 where no seam runs. Where
    squares were judged, it is 1 ÷ (1 + step).
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self.squares: npt.NDArray[np.uint8] = np.full(
            (-(-shape[0] // SQUARE_PX), -(-shape[1] // SQUARE_PX)), _NONE, np.uint8
        )
        self._sums = np.zeros((3, *self.squares.shape))
        self._likeness = np.ones(self.squares.shape)
        #: Those that were measured last; where a seam moves, they stay until they are measured again.
        self._steps = np.zeros(self.squares.shape)
        self._judged = np.zeros(self.squares.shape, bool)

    def update(self, labelling: ts.layers.Labelling, labels: Labels, box: Box) -> Box:
        """Compute the squares that a box of the canvas touches; return their box, counted in squares."""
        top, left = box.top // SQUARE_PX, box.left // SQUARE_PX
        bottom, right = -(-box.bottom // SQUARE_PX), -(-box.right // SQUARE_PX)
        squares = Box(top, left, bottom, right).shared(Box(0, 0, *self.squares.shape))
        whole = Box(*(side * SQUARE_PX for side in squares)).grown(1).shared(labelling.canvas)
        found = list(labelling.interfaces(labels, whole))
        none = (np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0, np.float32))
        parts = [none, *((x, y, cost) for _, x, y, _, cost in found)]
        x, y, cost = (np.concatenate(part) for part in zip(*parts, strict=True))
        row, column = y // SQUARE_PX - squares.top, x // SQUARE_PX - squares.left
        height, width = squares.shape
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        number = (row * width + column)[inside]
        sums = self._sums[(slice(None), *squares.slices)]
        for at, values in enumerate((None, x, y)):
            weights = None if values is None else values[inside]
            sums[at] = np.bincount(number, weights, height * width).reshape(height, width)
        total = np.bincount(number, cost[inside], height * width).reshape(height, width)
        self._likeness[squares.slices] = 1 / (1 + total / np.maximum(sums[0], 1) / HALF_COST)
        self._judged[squares.slices] = False
        return self._shown(squares)

    def poor(self, box: Box) -> Floats:
        """Return x, y and likeness of the places of a box where pictures show something else, (K, 3), the
        poorest first.
        """
        count, x, y = self._sums
        at = np.nonzero((count > 0) & (self._likeness < UNSEEN))
        x, y, likeness = x[at] / count[at], y[at] / count[at], self._likeness[at]
        inside = (x >= box.left) & (x < box.right) & (y >= box.top) & (y < box.bottom)
        found: Floats = np.stack([x, y, likeness], axis=1)[inside]
        return found[np.argsort(found[:, 2], kind="stable")]

    def judge(self, steps: Floats, box: Box) -> Box:
        """Take the steps and breaks that a part of the picture shows; return the box of the squares that are
        judged.

        Parameters
        ----------
        steps : (K, 3) float array
            x and y, px of the canvas, and step of each piece of the seams: 1 is just seen.
        box : Box
            Where they were measured, px of the canvas. They are not known within the reach of its edges,
            unless these are those of the canvas.
        """
        rim, (height, width) = STEP_REACH // SQUARE_PX, self.squares.shape
        top, left = (-(-side // SQUARE_PX) + rim if side > 0 else 0 for side in box[:2])
        bottom, right = (
            side // SQUARE_PX - rim if side < whole else -(-side // SQUARE_PX)
            for side, whole in zip(box[2:], self.shape, strict=True)
        )
        squares = Box(top, left, bottom, right).shared(Box(0, 0, height, width))
        if min(squares.shape) <= 0:
            return Box(0, 0, 0, 0)
        grid = np.zeros(self.squares.shape)
        columns, rows = (steps[:, :2] // SQUARE_PX).astype(np.intp).T
        np.maximum.at(grid, (rows, columns), steps[:, 2])
        # a piece is some squares long
        self._steps[squares.slices] = scipy.ndimage.maximum_filter(grid, 3)[squares.slices]
        self._judged[squares.slices] = True
        return self._shown(squares)

    def _shown(self, squares: Box) -> Box:
        """Set what is shown of squares."""
        at = squares.slices
        seen = 1 / (1 + self._steps[at])
        worst = np.where(self._judged[at], seen, np.minimum(self._likeness[at], seen))
        self.squares[at] = np.where(self._sums[0][at] > 0, np.rint(254 * worst), _NONE)
        return squares

    def worst(self, known: list[SeamPlace]) -> list[SeamPlace]:
        """Return the places that were listed, with their likeness now, and new ones that are bad. One that
        was listed before it was judged, and does not show, goes.
        """
        count, x, y = self._sums
        like = scipy.ndimage.uniform_filter(np.where(count > 0, self.squares / 254.0, 0) * count, 2)
        like /= np.maximum(scipy.ndimage.uniform_filter(count, 2), 1e-9)
        rows, columns = np.nonzero(count >= 4)
        likeness, judged = like[rows, columns], self._judged[rows, columns]
        at = np.stack([x[rows, columns], y[rows, columns]], axis=1) / count[rows, columns][:, np.newaxis]
        places: list[SeamPlace] = []
        for place in known:
            near = np.linalg.norm(at - (place.x, place.y), axis=1) < _NEARBY_PX
            value, known_now = float(likeness[near].min(initial=1)), bool(judged[near].all())
            if place.judged or not known_now or value < GOOD:
                places.append(SeamPlace(place.x, place.y, value, place.judged or known_now))
        for k in np.argsort(likeness):
            if likeness[k] >= BAD or sum(not place.done for place in places) >= _MOST_PLACES:
                break
            if all(_apart(at[k], place) for place in places):
                x_at, y_at = at[k].tolist()
                places.append(SeamPlace(x_at, y_at, float(likeness[k]), bool(judged[k])))
        return places[-2 * _MOST_PLACES :]


def _apart(at: Floats, place: SeamPlace) -> bool:
    return bool(np.hypot(at[0] - place.x, at[1] - place.y) > _APART_PX)
