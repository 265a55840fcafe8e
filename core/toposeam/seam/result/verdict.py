"""Verdicts: how likely a seam is to be seen, and where. For people, and for scripts that make many joins.

Along the seam the costs of the law "natural" (:mod:`toposeam.seam.problem.natural`) are averaged over squares
of 16 px. Of a mean cost c per interface, which is V² of one pixel plus V² of the other, the likeness is::

    1 / (1 + c / 18)

1 where both pictures show the same, ½ where each of the two pixels differs by three times the just
noticeable, near 0 where something is cut in two.

Likeness forgives small differences, which eyes find on plain ground all the same, and minds large ones that
leaves or a blend hide. So the picture that is shown decides, where it is known, by two things.

*Steps* of tone or hue. Beside a piece of the seam, bands at the same distance on either side are compared
with what one of the two pictures alone shows there: an edge of the scene is in both, a step of the seam is
not. With S the joined picture and A one that has pixels on both sides, in CIELAB, medians over a band::

    step = ΔE₀₀(S₊, S₊ - ((S₊ - A₊) - (S₋ - A₋))) / (T + 1.25 (σ_S + σ_A) + 0.1 E)

of A and the other picture the smaller one. T is the step that is just seen on plain ground; σ_S is the
deviation of L* in the plainer band, which hides steps, and σ_A that of S - A, as a picture that shows
something else there says nothing about tones; of noise, both count less. E is the edge of the scene that runs
along the seam, ΔE₀₀(S₊, S₋) less the step. ΔE₀₀ is CIEDE2000 (Sharma, Wu and Dalal 2005,
doi:10.1002/col.20070). A step that no piece beside it has counts less. Grain that ends at the seam is a step,
too.

*Breaks* of lines and things, where the likeness is below ½: :mod:`toposeam.seam.result.broken_lines`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Floats32, Image, Mask

#: Side of the squares over which costs are averaged, px.
SQUARE_PX = 16
#: Mean cost per interface at which the likeness is one half.
HALF_COST = 18.0
#: Share of a seam's interfaces that are its worst part.
_WORST_SHARE = 0.1
#: Distance at which a piece of a seam counts as near, px: half the longest one.
_NEAR_PX = 32
#: Least distance of places that are listed, px: about what is seen at once in a window at 100 %.
_APART_PX = 100
#: Least likeness of the worst part of a seam that counts as invisible.
UNSEEN = 0.5
#: Bands beside a seam: from and to which distance, px; the side of the pieces of the seam, px; T, ΔE.
_BANDS = (2, 8, 32, 0.75), (8, 24, 32, 1.25), (32, 64, 64, 1.8)
#: Distance from a seam, px, up to which a picture is looked at for steps.
STEP_REACH = _BANDS[-1][1]
#: The share of a band's pixels that both of its sides must have.
_LEAST_SHARE = 0.35
#: How much a unit of deviation of L* adds to T, and a unit of an edge of the scene along the seam.
_HIDDEN_BY_TEXTURE, _HIDDEN_BY_EDGE = 1.25, 0.1
#: Noise hides less than texture: a deviation counts no more than this many times that of means over squares
#: of so many halved px.
_NOISE_HIDES_LESS, _COARSE = 1.6, 4
#: The difference of grain that is just seen on plain ground, in percent of white; how much grain on both
#: sides adds to it, and a unit of deviation of L*.
_GRAIN, _HIDDEN_BY_GRAIN, _GRAIN_HIDDEN_BY_TEXTURE = 0.35, 0.5, 0.25
#: A step is seen where a piece beside it, up to this many sides away, has one, too, or if it is _ALONE times
#: as large.
_LASTING, _ALONE = 1.6, 1.6
#: Width of the rim beside holes, px, that is filled with them.
_RIM = 4
#: Of breaks: places that are looked at in a window, the poorest ones; px round a place; every how many-th
#: point of the seam; and the quantile of its points that is a place's break.
_MOST_PLACES, _AROUND, _EVERY, _CLEAREST = 64, 24, 3, 0.97
#: Median of the absolute values of normal noise ÷ its standard deviation.
_MEDIAN_DEVIATION = 0.6745


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The likeness of two pictures along a seam.

    Examples
    --------
    >>> str(Verdict(mean=0.97, worst=0.91, where=(12, 40))), str(Verdict(mean=0.8, worst=0.2, where=(12, 40)))
    ('no visible seam', 'look at 12,40')
    """

    #: Mean likeness of all interfaces, in [0, 1]; 1 where no seam is.
    mean: float
    #: That of the worst tenth.
    worst: float
    #: (x, y) on the canvas, px: the middle of the worst square.
    where: tuple[int, int] | None
    #: (K, 4): x, y, likeness and number of interfaces of each square.
    _squares: npt.NDArray[np.float64] | None = field(default=None, repr=False, compare=False)
    #: (K, 3): x, y and step of each piece; None if steps were not measured.
    _steps: npt.NDArray[np.float64] | None = field(default=None, repr=False, compare=False)

    @property
    def step(self) -> float | None:
        """The largest step of tone, hue or grain along the seam, or the clearest break of a line or a thing:
        1 is just seen; None if not measured.
        """
        if self._steps is None:
            return None
        return float(self._steps[:, 2].max(initial=0))

    @property
    def visibility(self) -> float:
        """How visible the seam is: 1 is just seen, 0 not at all. By :attr:`step`, or by :attr:`worst` where
        it was not measured.
        """
        return 1 / max(self.worst, 1e-9) - 1 if self.step is None else self.step

    @property
    def unseen(self) -> bool:
        """True if even the worst part of the seam is unlikely to be noticed."""
        return self.visibility <= 1

    @property
    def places(self) -> list[tuple[int, int]]:
        """Where the seam may be noticed, (x, y) on the canvas, px, the most visible first: the middles of
        squares and pieces, none within 100 px of a more visible one.
        """
        found = self._visibilities
        chosen = list[tuple[int, int]]()
        for x, y, seen in found[np.argsort(-found[:, 2])]:
            if seen > 1 and all(math.hypot(x - i, y - j) > _APART_PX for i, j in chosen):
                chosen.append((round(x), round(y)))
        return chosen

    def is_noticed_near(self, x: float, y: float) -> bool:
        """Test whether the seam may be noticed within 32 px of a place of the canvas."""
        at_x, at_y, seen = self._visibilities.T
        return bool((seen[np.hypot(at_x - x, at_y - y) <= _NEAR_PX] > 1).any())

    @property
    def _visibilities(self) -> npt.NDArray[np.float64]:
        """(K, 3): x, y and visibility of each piece, or of each square if steps were not measured."""
        if self._steps is not None:
            return self._steps
        if self._squares is None:
            return np.array([[*(self.where or (0, 0)), self.visibility]])
        return np.column_stack([self._squares[:, :2], 1 / np.maximum(self._squares[:, 2], 1e-9) - 1])

    def inside(self, box: tuple[int, int, int, int] | None) -> Verdict:
        """Judge the part of the seam inside a crop of the canvas, with places counted from its corner.

        Parameters
        ----------
        box : (int, int, int, int), optional
            left, top, width and height, px; by default the verdict stays.
        """
        if box is None or self._squares is None:
            return self
        judged = _of_squares(_inside(self._squares, box))
        return judged if self._steps is None else judged.with_steps(_inside(self._steps, box))

    def with_steps(self, steps: npt.NDArray[np.float64]) -> Verdict:
        """Return the verdict with the steps of the seam, (K, 3): x, y on the canvas and step."""
        judged = replace(self, _steps=steps)
        if not judged.unseen:
            x, y, _ = steps[int(np.argmax(steps[:, 2]))]
            judged = replace(judged, where=(round(x), round(y)))
        return judged

    @property
    def poor(self) -> npt.NDArray[np.float64]:
        """(K, 3): x, y and likeness of places where both pictures show something else, the poorest first."""
        if self._squares is None:
            return np.zeros((0, 3))
        found = self._squares[self._squares[:, 2] < UNSEEN, :3]
        return found[np.argsort(found[:, 2], kind="stable")]

    def __str__(self) -> str:
        if self.unseen or self.where is None:
            return "no visible seam"
        return f"look at {self.where[0]},{self.where[1]}"

    def summary(self) -> dict[str, Any]:
        """Return the verdict as in JSON: likeness, worst_likeness, step, look_at."""
        return {
            "likeness": round(self.mean, 4),
            "worst_likeness": round(self.worst, 4),
            "step": None if self.step is None else round(self.step, 3),
            "look_at": None if self.unseen or self.where is None else list(self.where),
        }


def verdict_of(
    cost: npt.NDArray[np.floating[Any]], x: npt.NDArray[np.integer[Any]], y: npt.NDArray[np.integer[Any]]
) -> Verdict:
    """Judge a seam by the cost of each of its interfaces, by the law "natural".

    Parameters
    ----------
    cost : (n,) float array
    x, y : (n,) int arrays
        Where the interfaces lie on the canvas, px.

    Returns
    -------
    Verdict
    """
    if not len(cost):
        return Verdict(mean=1.0, worst=1.0, where=None)
    _, square = np.unique(np.stack([y // SQUARE_PX, x // SQUARE_PX]), axis=1, return_inverse=True)
    square = square.ravel()
    count = np.bincount(square)
    likeness = 1 / (1 + np.bincount(square, cost) / count / HALF_COST)
    means = (np.bincount(square, along) / count for along in (x, y))
    return _of_squares(np.stack([*means, likeness, count], axis=1))


def _of_squares(squares: npt.NDArray[np.float64]) -> Verdict:
    """Judge a seam by its (K, 4) squares: x, y, likeness, number of interfaces."""
    if not len(squares):
        return Verdict(mean=1.0, worst=1.0, where=None)
    likeness, count = squares[:, 2], squares[:, 3]
    order = np.argsort(likeness)
    share = np.cumsum(count[order]) / count.sum()
    worst = order[: int(np.searchsorted(share, _WORST_SHARE)) + 1]
    return Verdict(
        mean=float(np.average(likeness, weights=count)),
        worst=float(np.average(likeness[worst], weights=count[worst])),
        where=(round(squares[order[0], 0]), round(squares[order[0], 1])),
        _squares=squares,
    )


def worst_of(verdicts: Iterable[Verdict | None]) -> Verdict | None:
    """Choose the verdict on the most visible seam; None where one is missing, or all are."""
    found = list(verdicts)
    known = [verdict for verdict in found if verdict is not None]
    return max(known, key=lambda verdict: verdict.visibility) if known and len(known) == len(found) else None


def adjoining(first: Mask, second: Mask) -> Mask:
    """(h, w) bool: the pixels of two sides that lie beside one of the other side."""
    border = np.zeros(first.shape, bool)
    for s, t in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        across = (first[s] & second[t]) | (second[s] & first[t])
        border[s] |= across
        border[t] |= across
    return border


def steps_beside(
    shown: Image, pictures: Sequence[Image], covers: Sequence[Mask], sides: Sequence[Mask], white: float
) -> npt.NDArray[np.float64]:
    """Measure the steps of tone, hue and grain across the seam of two pictures in a window.

    Parameters
    ----------
    shown : (h, w) or (h, w, C) array
        The joined picture.
    pictures : two arrays of the same shape, or none
        The two pictures. Without them, both sides are compared as they are, and an edge of the scene that
        runs along the seam counts as a step.
    covers : two (h, w) bool arrays, or none
        Where each of them has pixels.
    sides : two (h, w) bool arrays
        Where each of them is shown.
    white : float
        The value of white.

    Returns
    -------
    (K, 3) float array
        x, y (px of the window) and step of each piece of the seam: 1 is just seen.
    """
    shown, *pictures = (_halved(_rgb(one, white)) for one in (shown, *pictures))
    size = shown.shape[:2]
    there = [_halved(cover.astype(np.float32)) == 1 for cover in covers]
    first, second = (side[: 2 * size[0] : 2, : 2 * size[1] : 2] for side in sides)
    border = adjoining(first, second)
    if not border.any():
        return np.zeros((0, 3))
    distance, nearest = scipy.ndimage.distance_transform_edt(~border, return_indices=True)
    distance *= 2
    near = (first | second) & (distance >= _BANDS[0][0]) & (distance < STEP_REACH)
    colours = _lab(shown[near])
    pieces = _Pieces(
        distance=distance[near],
        at=2 * nearest[:, near],
        beyond=second[near],
        shown=colours,
        pictures=[_lab(one[near]) for one in pictures] or [np.zeros_like(colours)],
        there=[cover[near] for cover in there] or [np.ones(len(colours), bool)],
        coarse=[_averaged(one)[near] for one in (shown, *pictures)],
        grain=[_grain(one)[near] for one in (shown, *pictures)],
    )
    return np.concatenate([pieces.steps(*band) for band in _BANDS])


def breaks_at(
    shown: Image,
    pictures: Sequence[Image],
    covers: Sequence[Mask],
    sides: Sequence[Mask],
    white: float,
    places: npt.NDArray[np.float64],
) -> npt.NDArray[np.float64]:
    """Measure how visibly a seam breaks lines and things near some places of a window.

    Parameters
    ----------
    shown, pictures, covers, sides, white
        As of :func:`steps_beside`.
    places : (N, 2) float array
        x and y of the places, px of the window.

    Returns
    -------
    (K, 3) float array
        x, y and the break: 1 is just seen (:mod:`toposeam.seam.result.broken_lines`).
    """
    from toposeam.seam.result.broken_lines import broken_at  # most seams have no such place

    found = [np.zeros((0, 3))]
    size = shown.shape[:2]
    joined = _joined(sides)
    for x, y in places[:_MOST_PLACES]:
        rows, columns = (
            slice(max(0, round(at) - _AROUND), min(side, round(at) + _AROUND + 1))
            for at, side in zip((y, x), size, strict=True)
        )
        first, second = (side[rows, columns] for side in sides)
        at_y, at_x = np.nonzero(adjoining(first, second))
        near = np.maximum(np.abs(at_y + rows.start - y), np.abs(at_x + columns.start - x)) <= SQUARE_PX / 2
        at_y, at_x = at_y[near][::_EVERY], at_x[near][::_EVERY]
        if not len(at_y):
            continue
        values = broken_at(
            _rgb(shown[rows, columns], white),
            [_rgb(one[rows, columns], white) for one in pictures],
            [cover[rows, columns] for cover in covers],
            joined[rows, columns],
            at_y,
            at_x,
        )
        found.append(np.array([[x, y, np.quantile(values, _CLEAREST)]]))
    return np.concatenate(found)


def _joined(sides: Sequence[Mask]) -> Mask:
    """(h, w) bool: what shows one of two sides, and lies apart from where neither of them is shown."""
    first, second = sides
    beyond = scipy.ndimage.binary_dilation(~(first | second), iterations=_RIM)
    kept: Mask = ~beyond
    return kept


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pieces:
    """The n pixels beside a seam: what they show, and what each picture has there."""

    distance: npt.NDArray[np.float64]
    #: (2, n) y and x of the nearest point of the seam, and (n,) whether they lie on the second side.
    at: npt.NDArray[np.intp]
    beyond: Mask
    #: (n, 3) CIELAB of the joined picture, and of both pictures, with where they have pixels.
    shown: Floats32
    pictures: Sequence[Floats32]
    there: Sequence[Mask]
    #: (n, 1) L* of the joined picture and of both pictures, averaged.
    coarse: Sequence[Floats32]
    #: (n,) Fine detail of the joined picture and of both pictures, percent of white.
    grain: Sequence[Floats32]

    def steps(self, near: float, far: float, side: int, least: float) -> npt.NDArray[np.float64]:
        """Return (K, 3): x, y and step of the pieces of the seam, by one band of distances."""
        from skimage.color import deltaE_ciede2000

        band = (self.distance >= near) & (self.distance < far)
        at = self.at[:, band]
        squares, piece = np.unique(at // side, axis=1, return_inverse=True)
        count, piece = squares.shape[1], piece.ravel()
        half = 2 * piece + self.beyond[band]
        enough = _LEAST_SHARE * (far - near) * side / 4
        shown = self.shown[band]
        middle, spread = _middles(half, shown, 2 * count)
        averaged = [one[band] for one in self.coarse]
        spread = np.minimum(spread, _NOISE_HIDES_LESS * _middles(half, averaged[0], 2 * count)[1])
        plainer = spread.reshape(count, 2).min(axis=1)
        contrast: Floats = deltaE_ciede2000(middle[1::2], middle[::2])  # type: ignore[no-untyped-call]
        step = np.full(count, np.inf)
        for number, (picture, there) in enumerate(zip(self.pictures, self.there, strict=True), start=1):
            known = there[band]
            apart, varies = _middles(half[known], (shown - picture[band])[known], 2 * count)
            if number < len(averaged):
                change = (averaged[0] - averaged[number])[known]
                varies = np.minimum(varies, _NOISE_HIDES_LESS * _middles(half[known], change, 2 * count)[1])
            pixels = np.bincount(half[known], minlength=2 * count).reshape(count, 2).min(axis=1)
            change = apart[1::2] - apart[::2]
            seen: Floats = deltaE_ciede2000(middle[1::2], middle[1::2] - change)  # type: ignore[no-untyped-call]
            hidden = plainer + varies.reshape(count, 2).max(axis=1)
            edge = np.maximum(contrast - seen, 0)
            seen /= least + _HIDDEN_BY_TEXTURE * hidden + _HIDDEN_BY_EDGE * edge
            step = np.where(pixels >= enough, np.minimum(step, seen), step)
        if near == _BANDS[0][0]:
            step = np.maximum(step, self._grain_steps(band, half, plainer, enough))
        x, y = (np.bincount(piece, along, count) / np.bincount(piece, minlength=count) for along in at[::-1])
        known = np.isfinite(step)
        found = np.stack([x[known], y[known], step[known]], axis=1)
        return _lasting(found, _LASTING * side)

    def _grain_steps(
        self, band: Mask, half: npt.NDArray[np.intp], plainer: Floats, enough: float
    ) -> npt.NDArray[np.float64]:
        """(K,): how visibly grain changes along the pieces of a seam; 0 where that is not known. `plainer` is
        the deviation of L* on the plainer side.
        """
        power, count = [], len(plainer)
        everywhere = np.ones(len(band), bool)
        for grain, there in zip(self.grain, (everywhere, *self.there), strict=False):
            known = there[band]
            pixels = np.bincount(half[known], minlength=2 * count)
            middle, _ = _middles(half[known], np.abs(grain[band][known])[:, np.newaxis], 2 * count)
            deviation = middle[:, 0] / _MEDIAN_DEVIATION
            power.append(np.where(pixels >= enough, deviation, np.nan).reshape(count, 2))
        if len(power) == 1:
            (shown,) = power
            apart = np.abs(shown[:, 1] - shown[:, 0])[np.newaxis]
        else:
            shown, first, second = power
            apart = np.stack([np.abs(shown[:, 1] - first[:, 1]), np.abs(shown[:, 0] - second[:, 0])])
        apart = np.where(np.isnan(apart), np.inf, apart).min(axis=0)
        hidden = _HIDDEN_BY_GRAIN * np.nan_to_num(shown).min(axis=1) + _GRAIN_HIDDEN_BY_TEXTURE * plainer
        seen = apart / (_GRAIN + hidden)
        return np.where(np.isfinite(seen), seen, 0.0)


def _lasting(steps: npt.NDArray[np.float64], reach: float) -> npt.NDArray[np.float64]:
    """Lessen steps, (K, 3), that pieces of the seam within a reach, px, do not have as well."""
    apart = scipy.spatial.distance.squareform(scipy.spatial.distance.pdist(steps[:, :2]))
    beside = (apart <= reach) & (apart > 0)
    others = np.where(beside, steps[:, 2], 0).max(axis=1, initial=0)
    alone = np.where(beside.any(axis=1), steps[:, 2] / _ALONE, steps[:, 2])
    lasting = steps.copy()
    lasting[:, 2] = np.maximum(alone, np.minimum(steps[:, 2], others))
    return lasting


def _inside(rows: npt.NDArray[np.float64], box: tuple[int, int, int, int]) -> npt.NDArray[np.float64]:
    """Return the rows x, y, … that lie in a box (left, top, width, height), counted from its corner."""
    left, top, width, height = box
    moved = rows.copy()
    moved[:, :2] -= (left, top)
    x, y = moved[:, 0], moved[:, 1]
    return moved[(x >= 0) & (y >= 0) & (x < width) & (y < height)]


def _middles(
    group: npt.NDArray[np.intp], values: Floats32, count: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return (count, 3) medians of the values of each group, and (count,) the deviation of the first of them,
    by their quartiles; 0 for groups without values.
    """
    size = np.bincount(group, minlength=count)
    first = np.cumsum(size) - size
    middle, spread = np.zeros((count, values.shape[1])), np.zeros(count)
    if not len(values):
        return middle, spread
    low, half, high = (np.minimum(first + size * k // 4, len(values) - 1) for k in (1, 2, 3))
    for channel, each in enumerate(values.T):
        ordered = each[np.lexsort((each, group))]
        middle[:, channel] = ordered[half]
        if channel == 0:
            spread = (ordered[high] - ordered[low]) / 1.35
    none = size == 0
    middle[none], spread[none] = 0, 0
    return middle, spread


def _rgb(pixels: Image, white: float) -> Floats32:
    """(h, w, 3) float32 sRGB in [0, 1] of a picture of any kind."""
    planes = pixels if pixels.ndim == 3 else pixels[..., np.newaxis]
    planes = planes[..., :3] if planes.shape[2] >= 3 else planes[..., :1].repeat(3, axis=2)
    rgb: Floats32 = np.clip(planes.astype(np.float32) / np.float32(white), 0, 1)
    return rgb


def _halved(values: Floats32) -> Floats32:
    """Average 2 × 2 pixels; a last odd row or column is left out."""
    height, width = (side // 2 for side in values.shape[:2])
    part = values[: 2 * height, : 2 * width]
    quarters = part[::2, ::2], part[1::2, ::2], part[::2, 1::2], part[1::2, 1::2]
    mean: Floats32 = np.mean(quarters, axis=0, dtype=np.float32)
    return mean


def _lab(colours: Floats32) -> Floats32:
    """(n, 3) CIELAB of (n, 3) sRGB colours."""
    from skimage.color import rgb2lab

    return np.asarray(rgb2lab(colours), np.float32)


def _averaged(picture: Floats32) -> Floats32:
    """(h, w, 1) L* of a picture averaged over squares."""
    mean = scipy.ndimage.uniform_filter(picture, (_COARSE, _COARSE, 0))
    return _lab(mean)[..., :1]


def _grain(picture: Floats32) -> Floats32:
    """(h, w) what differs from the mean of 3 × 3 pixels, percent of white."""
    bright = 100 * picture.mean(axis=2)
    return np.asarray(bright - scipy.ndimage.uniform_filter(bright, 3))
