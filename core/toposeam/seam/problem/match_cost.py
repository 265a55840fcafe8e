"""The match cost of every pixel interface: how visible a seam would be between two neighbouring pixels.

There are three laws, for neighbours s and t in direction d (horizontal or vertical), with patches A and B.

*gradient* (thesis 2.4, after Kwatra et al. 2003, doi:10.1145/882262.882264)::

              |A(s) - B(s)| + |A(t) - B(t)|  +  flat ε
    M(s, t) = ------------------------------------------------  +  length
              |G_A^d(s)| + |G_A^d(t)| + |G_B^d(s)| + |G_B^d(t)| + ε

*colour* (3.22)::

    M(s, t) = |A(s) - B(s)| + |A(t) - B(t)|  +  length

*natural*, for photographs, with the masking m and the things W of :mod:`toposeam.seam.problem.natural`::

    V(s) = min(|A(s) - B(s)| / m(s), 12)  +  ½ |G_A^e(s) - G_B^e(s)| / m(s)  +  W(s)
    M(s, t) = V(s)²  +  V(t)²  +  length

where e is the direction of the seam, so that lines across the seam in one picture have to continue in the
other. The square makes one clear break cost more than many faint ones. Norms are Euclidean over channels,
gradients are central differences along d. Where the patch ends, its last pixel is repeated, so that the
gradient is half the one known step: noise makes ends no steeper than the inside.

*0/0 and small denominators.* ε keeps a pair in a flat place from costing infinitely much; a pair that is flat
*and* equal, 0/0 in (2.4), costs ``flat``. Its default of 0 says that a seam through equal pixels is
invisible; a larger value draws the seam to image edges even there, as in the thesis's Figure 3.11. *Zero
cost.* ``length`` is added to every interface, so that among equally good seams the shortest wins and no cost
is zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import prod
from typing import Any

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.checks import check_choice, check_range
from toposeam.errors import OptionError, Term
from toposeam.seam.problem.natural import LARGEST_MISMATCH, LOOK, perceived
from toposeam.seam.problem.overlap import FREE, KEPT_PIXELS, KEPT_SHAPES, NONE, Overlap, pairs_along
from toposeam.typing import LAWS as LAWS
from toposeam.typing import Law as Law

#: 1 where the step from a pixel to the next one along an axis is known, else 0. One line may stand for all of
#: them. Read-only.
Steps = Floats32
#: Most values, in all, of planes that are processed together; larger ones would not fit the caches.
_MOST_TOGETHER = 1 << 14
#: Cached steps: of two patches along two axes, for each of the shapes that are cached.
_KEPT_STEPS = 4 * KEPT_SHAPES


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchCost:
    """Options of the match cost.

    Raises
    ------
    OptionError
        For values out of range.

    Examples
    --------
    Equal flat pixels shall cost something, so that the seam follows edges through them (Figure 3.11):

    >>> MatchCost(law="gradient", flat=0.5)
    MatchCost(law='gradient', epsilon=0.02, flat=0.5, length=0.001, reach=None)
    """

    #: Formula of the cost: "natural" for photographs, "gradient" (2.4), "colour" (3.22).
    law: Law = "natural"
    #: ε of (2.4), added to the sum of the four gradients; in units of the image's range.
    epsilon: float = 0.02
    #: Of (2.4): cost of a pair that is equal in both patches and has no gradient.
    flat: float = 0.0
    #: Cost added to each interface.
    length: float = 1e-3
    #: Distance, px, over which the pictures will be blended: differences that near count, too
    #: (:mod:`toposeam.seam.problem.blend_reach`); 0 for a hard cut. By default as far as the blend reaches.
    #: Not in volumes and textures.
    reach: float | None = None

    def __post_init__(self) -> None:
        check_choice("law", self.law, LAWS)
        check_range(0, above=True, epsilon=self.epsilon, length=self.length)
        check_range(0, flat=self.flat, reach=0.0 if self.reach is None else self.reach)

    @property
    def look(self) -> int:
        """Distance, px, from an interface's own two pixels to others on which its cost depends."""
        return LOOK if self.law == "natural" else 1


@cache
def _of_law(law: Law) -> MatchCost:
    return MatchCost(law=law)


def match_options(gradient: bool | None, cost: MatchCost | None, usual: Law = "natural") -> MatchCost:
    """Choose the options of the match cost, of which a caller gave one or none.

    Parameters
    ----------
    gradient : bool, optional
        Short for the law "gradient", or "colour".
    cost : MatchCost, optional
    usual : {"natural", "gradient", "colour"}
        The law where neither is given.

    Raises
    ------
    OptionError
        When both are given, or one is of another kind.

    Examples
    --------
    >>> match_options(False, None).law, match_options(None, None).law
    ('colour', 'natural')
    """
    if gradient is not None:
        check_choice("gradient", gradient, (True, False))
        if cost is not None:
            raise OptionError(
                "{gradient} and {cost} are both given; write MatchCost(law=…) and leave {gradient} out",
                kind="conflict",
            )
        return _of_law("gradient" if gradient else "colour")
    if cost is None:
        return _of_law(usual)
    if not isinstance(cost, MatchCost):
        raise OptionError(
            "{parameter} is of class {type}; pass a MatchCost",
            kind="type",
            parameter=Term("cost"),
            value=cost,
            type=type(cost).__name__,
        )
    return cost


def check_no_reach(match: MatchCost, what: str) -> MatchCost:
    """Return the options unless they have a reach, for uses (`what`) that know none.

    Raises
    ------
    OptionError
        When they have a reach.
    """
    if match.reach:
        raise OptionError(
            "{parameter} has a reach of {value:g} px, which {what} do not know; leave reach out of it",
            kind="conflict",
            parameter=Term("cost"),
            value=match.reach,
            what=what,
        )
    return match


def match_cost(
    a: Floats32,
    b: Floats32,
    overlap: Overlap | None,
    on_a: Mask | None,
    on_b: Mask | None,
    options: MatchCost,
    weight: Floats32 | None = None,
    axes: tuple[int, ...] = (1, 0),
    nearby: Floats32 | None = None,
    start: Sequence[int] | None = None,
) -> tuple[Floats32, ...]:
    """Compute the match cost of the interfaces of an overlap.

    Parameters
    ----------
    a, b : (h, w, C) float32 arrays
        The patches on the overlap's window.
    overlap : Overlap, optional
        Not needed where both patches have all pixels.
    on_a, on_b : (h, w) bool arrays, optional
        Where each patch has pixels; everywhere by default.
    weight : (h, w) float32 array, optional
        A factor per pixel, positive; an interface takes the mean of its two pixels.
    axes : tuple of int
        The directions d. Volumes are (d, h, w, C) with (d, h, w) masks, and have three.
    nearby : (h, w) float32 array, optional
        R of :mod:`toposeam.seam.problem.blend_reach`, added to the differences.
    start : sequence of int, optional
        Index of the window's first pixel, which makes the law "natural" independent of windows; by default
        the overlap's, or 0.

    Returns
    -------
    right : (h, w - 1) float32 array
        Cost between each pixel and its right neighbour; 0 where the seam cannot run.
    down : (h - 1, w) float32 array
        Likewise for its lower neighbour; one such array for each of the `axes`, in their order.
    """
    # One plane after the other is several times as fast as pixel by pixel.
    a, b = (np.ascontiguousarray(np.moveaxis(one, -1, 0)) for one in (a, b))
    difference = _distance(a, b)
    if nearby is not None:
        difference += nearby
    shared, narrow = None, None
    if overlap is not None and not overlap.shared.all():
        shared = overlap.shared
        difference = np.where(shared, difference, np.float32(0))
        # Where the overlap is one pixel wide a free pixel lies beside ground that only one patch covers, and
        # only its own values are known.
        bare = (overlap.side != NONE) & ~shared
        if bare.any():
            narrow = (overlap.side == FREE) & shared, bare
    if options.law == "natural":
        first = start or ((0,) * difference.ndim if overlap is None else overlap.start)
        values = _natural(a, b, difference, shared, first, axes)
        return tuple(
            _along(axis, one, None, shared, narrow, options, weight)
            for axis, one in zip(axes, values, strict=True)
        )
    if options.law == "colour":
        return tuple(_along(axis, difference, None, shared, narrow, options, weight) for axis in axes)
    known_a = _steps(on_a, axes)
    known_b = known_a if on_b is on_a else _steps(on_b, axes)
    return tuple(
        _along(
            axis,
            difference,
            _gradient(a, steps_a, axis) + _gradient(b, steps_b, axis),
            shared,
            narrow,
            options,
            weight,
        )
        for axis, steps_a, steps_b in zip(axes, known_a, known_b, strict=True)
    )


def _natural(
    a: Floats32,
    b: Floats32,
    difference: Floats32,
    shared: Mask | None,
    start: Sequence[int],
    axes: tuple[int, ...],
) -> Iterator[Floats32]:
    """Yield V² of every pixel, for seams across each axis."""
    masking, things = perceived(a, b, shared, start)
    mismatch = difference / masking
    np.minimum(mismatch, LARGEST_MISMATCH, out=mismatch)
    mismatch += things
    planes = a - b
    steps = _steps(shared, axes)
    slopes = [_gradient(planes, known, axis) for known, axis in zip(steps, axes, strict=True)]
    for axis in axes:
        across = [slope for slope, other in zip(slopes, axes, strict=True) if other != axis]
        broken = across[0] if len(across) == 1 else np.sqrt(sum(np.square(slope) for slope in across))
        value = broken / masking
        value *= np.float32(0.5)
        value += mismatch
        yield np.square(value, out=value)


def _along(
    axis: int,
    values: Floats32,
    steepness: Floats32 | None,
    shared: Mask | None,
    narrow: tuple[Mask, Mask] | None,
    options: MatchCost,
    weight: Floats32 | None,
) -> Floats32:
    """Add up the values of the two pixels of each interface across an axis, and divide by their steepness."""
    s, t = pairs_along(axis)
    beside = None
    if narrow is not None:
        free, bare = narrow
        beside = free[s] & bare[t], free[t] & bare[s]
        if not beside[0].any() and not beside[1].any():
            beside = None

    cost = _both(values, s, t, beside)
    if steepness is not None:
        epsilon = np.float32(options.epsilon)
        divisor = _both(steepness, s, t, beside)
        divisor += epsilon
        if options.flat:
            cost += np.float32(options.flat) * epsilon
        cost /= divisor
    cost += np.float32(options.length)
    if weight is not None:
        cost *= np.float32(0.5) * _both(weight, s, t, beside)
    cost = np.ascontiguousarray(cost[s])
    if shared is not None:
        possible = shared[s] & shared[t]
        if beside is not None:
            possible |= beside[0]
            possible |= beside[1]
        cost[~possible] = 0
    return cost


def _both(
    values: Floats32, s: tuple[slice, ...], t: tuple[slice, ...], beside: tuple[Mask, Mask] | None
) -> Floats32:
    """Compute values(s) + values(t), or twice the one of them that is known.

    The array is as large as that of the values, with arbitrary values at the end of the axis: that is faster
    than an array with shorter rows.
    """
    total = np.empty(values.shape, np.float32)
    step = prod(values.shape[len(s) :])
    flat, sums = values.ravel(), total.ravel()
    np.add(flat[:-step], flat[step:], out=sums[:-step])
    sums[-step:] = flat[-step:]
    if beside is not None:
        for known, place in zip(beside, (s, t), strict=True):
            total[s][known] = 2 * values[place][known]
    return total


def _distance(a: Floats32, b: Floats32) -> Floats32:
    """Compute |a - b| over the channels, which come first."""
    total: Floats32 = a[0] - b[0]
    if len(a) == 1:
        return np.abs(total, out=total)
    np.square(total, out=total)
    for one, other in zip(a[1:], b[1:], strict=True):
        step = one - other
        np.square(step, out=step)
        total += step
    np.sqrt(total, out=total)
    return total


def _steps(present: Mask | None, axes: tuple[int, ...]) -> Sequence[Steps | None]:
    """Return the steps along each axis; None where all are known."""
    if present is None or present.all():
        return [None] * len(axes)
    every = range(present.ndim)
    others = (tuple(k for k in every if k != axis) for axis in every)
    lines: list[Mask] = [np.asarray(present.any(axis=away, keepdims=True)) for away in others]
    if prod(map(np.count_nonzero, lines)) == np.count_nonzero(present):  # a box: all lines are alike
        return [_steps_of(lines[axis], axis) for axis in axes]
    if present.size > KEPT_PIXELS:
        return [_steps_of(present, axis) for axis in axes]
    shape, packed = present.shape, present.tobytes()
    return [_kept_steps(shape, packed, axis) for axis in axes]


def _steps_of(present: Mask, axis: int) -> Steps:
    s, t = pairs_along(axis)
    known = np.zeros(present.shape, np.float32)
    known[s] = present[s] & present[t]
    return known


@lru_cache(maxsize=_KEPT_STEPS)
def _kept_steps(shape: tuple[int, ...], present: bytes, axis: int) -> Steps:
    return _steps_of(np.frombuffer(present, bool).reshape(shape), axis)


def _gradient(planes: Floats32, known: Steps | None, axis: int) -> Floats32:
    """Compute |∂planes/∂axis| by central differences; a neighbour that is not present counts as equal."""
    squares = _squares(planes, known, axis + 1)
    total = next(squares)
    for square in squares:
        total += square
    np.sqrt(total, out=total)
    total *= np.float32(0.5)
    return total


def _squares(planes: Floats32, known: Steps | None, axis: int) -> Iterator[Floats32]:
    """Yield, plane by plane, the squared change over two steps along an axis, and over one at its ends."""
    before: tuple[Any, ...] = (slice(None),) * axis
    along = prod(planes.shape[axis + 1 :])
    # Planes of small images together, which takes fewer calls; those of large ones would not fit the caches.
    together = len(planes) if planes.size <= _MOST_TOGETHER else 1
    for part in (planes[begin : begin + together] for begin in range(0, len(planes), together)):
        if part.shape[axis] == 1:
            yield from np.zeros(part.shape, np.float32)
            continue
        # Flattened, which is faster than row by row; differences across ends of rows are corrected below.
        total, step, flat = np.empty(part.shape, np.float32), np.empty(part.shape, np.float32), part.ravel()
        sums, steps = total.ravel(), step.ravel()
        np.subtract(flat[along:], flat[:-along], out=steps[:-along])
        steps[-along:] = 0
        if known is not None:
            step *= known
        sums[:along] = steps[:along]
        np.add(steps[:-along], steps[along:], out=sums[along:])
        if known is None:
            for at, here, there in ((0, 1, 0), (-1, -1, -2)):
                np.subtract(part[*before, here], part[*before, there], out=total[*before, at])
        yield from np.square(total, out=total)
