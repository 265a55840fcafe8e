"""The match cost of every pixel interface: how visible a seam would be between two neighbouring pixels.

For neighbours s and t in direction d (horizontal or vertical), with patches A and B (thesis 2.4, after Kwatra
et al. 2003, doi:10.1145/882262.882264)::

              |A(s) - B(s)| + |A(t) - B(t)|  +  flat ε
    M(s, t) = ------------------------------------------------  +  length
              |G_A^d(s)| + |G_A^d(t)| + |G_B^d(s)| + |G_B^d(t)| + ε

and without gradients (3.22) M(s, t) = |A(s) - B(s)| + |A(t) - B(t)| + length. Norms are Euclidean over
channels, gradients are central differences along d (one-sided where the patch ends).

*0/0 and small denominators.* ε keeps a pair in a flat place from costing infinitely much; a pair that is flat
*and* equal, 0/0 in (2.4), costs ``flat``. Its default of 0 says that nobody sees a seam through equal pixels;
a larger value draws the seam to image edges even there, as in the thesis's Figure 3.11. *Zero cost.*
``length`` is added to every interface, so that among equally good seams the shortest wins and no cost is
zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_choice, check_range
from toposeam.errors import OptionError
from toposeam.images import Mask
from toposeam.seam.overlap import FREE, KEPT_PIXELS, KEPT_SHAPES, NONE, Overlap

Floats32 = npt.NDArray[np.float32]
#: Planes of so many values in all are dealt with at once.
_CACHED = 1 << 14
#: Two patches and two axes for each of the shapes that are remembered.
_KEPT_STEPS = 4 * KEPT_SHAPES


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchCost:
    """How the match cost is computed.

    Raises
    ------
    OptionError
        For values out of range.

    Examples
    --------
    Equal flat pixels shall cost something, so that the seam follows edges through them (Figure 3.11):

    >>> MatchCost(flat=0.5)
    MatchCost(gradient=True, epsilon=0.02, flat=0.5, length=0.001, reach=0.0)
    """

    #: Divide by the image gradients (2.4), or not (3.22).
    gradient: bool = True
    #: ε, added to the sum of the four gradients; in units of the image's range.
    epsilon: float = 0.02
    #: Cost of a pair that is equal in both patches and has no gradient.
    flat: float = 0.0
    #: Cost added to each interface.
    length: float = 1e-3
    #: How far, px, the pictures will be blended: differences so near count too (:mod:`toposeam.seam.reach`);
    #: 0 for a hard cut. Only between two pictures, not in volumes and textures.
    reach: float = 0.0

    def __post_init__(self) -> None:
        check_choice("gradient", self.gradient, (True, False))
        check_range(0, above=True, epsilon=self.epsilon, length=self.length)
        check_range(0, flat=self.flat, reach=self.reach)


#: With and without gradients.
_USUAL = {gradient: MatchCost(gradient=gradient) for gradient in (True, False)}


def match_options(gradient: bool | None, cost: MatchCost | None) -> MatchCost:
    """The options of the match cost, of which a caller gave one or none.

    Raises
    ------
    OptionError
        When both are given, or one is of another kind.

    Examples
    --------
    >>> match_options(False, None).gradient, match_options(None, MatchCost(flat=0.5)).flat
    (False, 0.5)
    """
    if gradient is not None:
        check_choice("gradient", gradient, (True, False))
        if cost is not None:
            raise OptionError(
                "gradient and cost are both given; write MatchCost(gradient=…) and leave gradient out"
            )
    if cost is None:
        return _USUAL[gradient is not False]
    if not isinstance(cost, MatchCost):
        raise OptionError(f"cost is of class {type(cost).__name__}; pass a MatchCost")
    return cost


def check_no_reach(match: MatchCost, what: str) -> MatchCost:
    """The same options.

    Raises
    ------
    OptionError
        When they look farther than what they are used for knows to.
    """
    if match.reach:
        raise OptionError(
            f"cost has a reach of {match.reach:g} px, which {what} do not know; leave reach out of it"
        )
    return match


def match_cost(
    a: Floats32,
    b: Floats32,
    overlap: Overlap,
    on_a: Mask,
    on_b: Mask,
    options: MatchCost,
    weight: Floats32 | None = None,
    axes: tuple[int, ...] = (1, 0),
    nearby: Floats32 | None = None,
) -> tuple[Floats32, ...]:
    """Match cost of the interfaces of an overlap.

    Parameters
    ----------
    a, b : (h, w, C) float32 arrays
        The patches on the overlap's window.
    on_a, on_b : (h, w) bool arrays
        Where each patch has pixels.
    weight : (h, w) float32 array, optional
        A factor per pixel, positive; an interface takes the mean of its two pixels.
    axes : tuple of int
        The directions d. Volumes are (d, h, w, C) with (d, h, w) masks, and have three.
    nearby : (h, w) float32 array, optional
        What is added to the differences (:mod:`toposeam.seam.reach`).

    Returns
    -------
    right : (h, w - 1) float32 array
        Cost between each pixel and its right neighbour; 0 where the seam cannot run.
    down : (h - 1, w) float32 array
        Likewise for its lower neighbour; one such array for each of the `axes`, in their order.
    """
    # One plane after the other is several times as fast as pixel by pixel.
    a, b = (np.ascontiguousarray(np.moveaxis(one, -1, 0)) for one in (a, b))
    difference = _norm(a - b)
    if nearby is not None:
        difference += nearby
    difference = np.where(overlap.shared, difference, np.float32(0))
    # Where the overlap is one pixel wide a free pixel lies beside ground that only one patch covers, and only
    # its own values are known.
    free = (overlap.side == FREE) & overlap.shared
    bare = (overlap.side != NONE) & ~overlap.shared
    return tuple(
        _along(axis, a, b, difference, overlap.shared, free, bare, on_a, on_b, options, weight)
        for axis in axes
    )


def _along(
    axis: int,
    a: Floats32,
    b: Floats32,
    difference: Floats32,
    shared: Mask,
    free: Mask,
    bare: Mask,
    on_a: Mask,
    on_b: Mask,
    options: MatchCost,
    weight: Floats32 | None,
) -> Floats32:
    s, t = _pair(axis)
    possible = shared[s] & shared[t]
    narrow_s, narrow_t = free[s] & bare[t], free[t] & bare[s]
    has_narrow = bool(narrow_s.any() or narrow_t.any())

    cost = _both(difference, s, t, narrow_s, narrow_t, has_narrow)
    if options.gradient:
        known = _steps(on_a, axis)
        steepness = _gradient(a, *known, axis)
        steepness += _gradient(b, *(known if on_b is on_a else _steps(on_b, axis)), axis)
        epsilon = np.float32(options.epsilon)
        divisor = _both(steepness, s, t, narrow_s, narrow_t, has_narrow)
        divisor += epsilon
        cost += np.float32(options.flat) * epsilon
        cost /= divisor
    cost += np.float32(options.length)
    if weight is not None:
        cost *= np.float32(0.5) * _both(weight, s, t, narrow_s, narrow_t, has_narrow)
    if has_narrow:
        possible |= narrow_s
        possible |= narrow_t
    cost[~possible] = 0
    return cost


def _both(
    values: Floats32,
    s: tuple[slice, ...],
    t: tuple[slice, ...],
    narrow_s: Mask,
    narrow_t: Mask,
    has_narrow: bool,
) -> Floats32:
    """values(s) + values(t); where only one of the two is known, twice that one."""
    total = values[s] + values[t]
    if has_narrow:
        total[narrow_s] = 2 * values[s][narrow_s]
        total[narrow_t] = 2 * values[t][narrow_t]
    return total


def _pair(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    before = (slice(None),) * axis
    return (*before, slice(None, -1)), (*before, slice(1, None))


def _norm(planes: Floats32) -> Floats32:
    if len(planes) == 1:
        only: Floats32 = np.abs(planes[0])
        return only
    total: Floats32 = np.square(planes[0])
    for plane in planes[1:]:
        total += np.square(plane)
    np.sqrt(total, out=total)
    return total


def _steps(present: Mask, axis: int) -> tuple[Floats32 | None, Floats32]:
    """Where the steps to the next pixel along an axis are known, 1 or 0, None for everywhere; and one over
    how many are, of the two that each pixel takes part in, 0 for none, along this axis only where it is the
    same along the others. Neither may be written to.
    """
    if present.all():
        return _kept_inside(present.shape, axis)
    if present.size > KEPT_PIXELS:
        return _steps_of(present, axis)
    return _kept_steps(present.shape, present.tobytes(), axis)


def _steps_of(present: Mask, axis: int) -> tuple[Floats32 | None, Floats32]:
    s, t = _pair(axis)
    known = (present[s] & present[t]).astype(np.float32)
    count = np.zeros(present.shape, np.float32)
    count[s] += known
    count[t] += known
    share = np.float32(1.75) - np.float32(0.75) * count
    share *= count  # 0, 1 and a half for 0, 1 and 2
    return None if known.all() else known, share


@lru_cache(maxsize=_KEPT_STEPS)
def _kept_inside(shape: tuple[int, ...], axis: int) -> tuple[None, Floats32]:
    """The same where all pixels are present."""
    line = [length if number == axis else 1 for number, length in enumerate(shape)]
    return None, _steps_of(np.ones(line, bool), axis)[1]


@lru_cache(maxsize=_KEPT_STEPS)
def _kept_steps(shape: tuple[int, ...], present: bytes, axis: int) -> tuple[Floats32 | None, Floats32]:
    return _steps_of(np.frombuffer(present, bool).reshape(shape), axis)


def _gradient(planes: Floats32, known: Floats32 | None, share: Floats32, axis: int) -> Floats32:
    """|∂planes/∂axis| by central differences; one-sided where the neighbour on one side is not present, 0
    where both are not.
    """
    s, t = _pair(axis + 1)
    last = (slice(None),) * (axis + 1) + (slice(-1, None),)
    squares = np.zeros(planes.shape[1:], np.float32)
    # Planes of small images together, which takes fewer calls; those of large ones would not fit the caches.
    together = len(planes) if planes.size <= _CACHED else 1
    for part in (planes[first : first + together] for first in range(0, len(planes), together)):
        step = part[t] - part[s]
        if known is not None:
            step *= known
        total = np.empty(part.shape, np.float32)
        total[s] = step
        total[last] = 0
        total[t] += step
        for square in np.square(total, out=total):
            squares += square
    np.sqrt(squares, out=squares)
    squares *= share
    return squares
