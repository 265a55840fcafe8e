"""The overlap of two patches: the pixels that are fixed, and those that a seam may divide.

Every pixel of the canvas is on one *side*:

=======  =================================================================================================
`A`      ``a`` shows: only ``a`` has pixels there, or the pixel is fixed to ``a``
`B`      ``b`` shows, likewise
`FREE`   both patches have pixels; the seam decides
`NONE`   neither patch has pixels, or the pixel lies off the canvas
=======  =================================================================================================

Overlap pixels that touch (4-neighbourhood) ground which only one patch covers are fixed to that patch: there
the other patch ends, and a seam along its very end would show it. This is the thesis's border of elements
with M_max (Figure 3.6). Where the overlap is one pixel wide a pixel touches both grounds; it stays free, and
its border interfaces get a one-sided cost (:mod:`toposeam.seam.problem.match_cost`).

A component of the overlap that touches the ground of one patch only is a whole piece of the other patch lying
inside, and an option says how much of that piece must show. Its *core*, all but the outermost ``1 - core`` of
its depth, is fixed to the inner patch, and the seam closes round it. A component that touches neither ground
is covered identically by both patches and stays ``a``.

A core has at least ``speck`` pixels that are connected; a piece that is too small for that is a *speck*, as
ragged masks have many. It forces nothing and is the outer patch's, unless the inner one has hardly anything
else. Where one patch has a hole within the overlap, however small, the other one shows, as nothing else can:
the hole is ground of it like any other, and the seam may close tightly round it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Mask
from toposeam.checks import check_choice, check_number, check_range
from toposeam.errors import OverlapError
from toposeam.typing import SIDES as SIDES
from toposeam.typing import Side as Side

A, B, FREE, NONE = 0, 1, 2, 3

#: Largest window, in pixels, of which all that its shape decides is cached for later ones of the same shape.
KEPT_PIXELS = 1 << 14
#: Number of shapes that are cached.
KEPT_SHAPES = 16
#: Default bounds of a speck: it has fewer pixels than the larger of these, px and a share of its patch's own.
SPECK_PX, SPECK_SHARE = 64, 0.0005
#: Structuring element of the 4-neighbourhood.
TOUCHING: Mask = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """An overlap on a window of the canvas, with a margin of at least one pixel around it.

    Volumes have three axes, and voxels in the place of pixels.

    Parameters
    ----------
    side : (h, w) uint8 array
        `A`, `B`, `FREE` or `NONE` per pixel of the window.
    shared : (h, w) bool array
        Where both patches have pixels. Both arrays become read-only: overlaps of one shape share them.
    start : (int, int)
        Index of the window's first pixel on the canvas, (row, column); the margin may start at -1.
    canvas : (int, int)
        Height and width of the canvas.
    """

    side: npt.NDArray[np.uint8]
    shared: Mask
    start: tuple[int, ...]
    canvas: tuple[int, ...]

    def __post_init__(self) -> None:
        self.side.setflags(write=False)
        self.shared.setflags(write=False)

    @property
    def inside(self) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
        """Slices (of the canvas, of the window) that cover their common pixels."""
        on_canvas, on_window = [], []
        for begin, length, limit in zip(self.start, self.side.shape, self.canvas, strict=True):
            first, last = max(begin, 0), min(begin + length, limit)
            on_canvas.append(slice(first, last))
            on_window.append(slice(first - begin, last - begin))
        return tuple(on_canvas), tuple(on_window)

    def window(self, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Cut the window out of a canvas-sized array, zero off the canvas. (H, W, …) to (h, w, …)."""
        on_canvas, on_window = self.inside
        result = np.zeros((*self.side.shape, *array.shape[self.side.ndim :]), array.dtype)
        result[on_window] = array[on_canvas]
        return result


def side_by_side(shape: tuple[int, int], side: Side) -> Overlap:
    """Build the overlap that fills the canvas: ``b`` continues beyond the given side, ``a`` beyond the other.

    Raises
    ------
    OptionError
        When `side` is not one of `SIDES`.
    OverlapError
        When the overlap is less than two pixels wide across the seam, so that no seam fits between the two
        borders.
    """
    check_choice("side", side, SIDES)
    across = 1 if side in ("right", "left") else 0
    if shape[across] < 2:
        raise OverlapError(
            "the overlap is {width} px wide; a seam needs at least 2 px between the two {patches}",
            kind="narrow",
            width=shape[across],
        )
    small = shape[0] * shape[1] <= KEPT_PIXELS
    return _kept_side_by_side(shape, side) if small else _side_by_side(shape, side)


def _side_by_side(shape: tuple[int, int], side: Side) -> Overlap:
    across = 1 if side in ("right", "left") else 0
    padded = (shape[0] + 2, shape[1] + 2)
    ground_a, ground_b = np.zeros(padded, bool), np.zeros(padded, bool)
    first, last = [slice(1, -1), slice(1, -1)], [slice(1, -1), slice(1, -1)]
    first[across], last[across] = slice(0, 1), slice(-1, None)
    if side in ("left", "top"):
        first, last = last, first
    ground_a[tuple(first)] = True
    ground_b[tuple(last)] = True
    shared = np.zeros(padded, bool)
    shared[1:-1, 1:-1] = True
    return Overlap(_sides(shared, ground_a, ground_b), shared, (-1, -1), shape)


_kept_side_by_side = lru_cache(maxsize=KEPT_SHAPES)(_side_by_side)


def between_masks(mask_a: Mask, mask_b: Mask, core: float = 0.5, speck: float | None = None) -> Overlap:
    """Build the overlap of two patches from the masks of their pixels.

    Parameters
    ----------
    mask_a, mask_b : (H, W) bool arrays
    core : float in (0, 1]
        For a patch inside the other: the share of its depth, from its middle outwards, that is fixed to it.
        1 is all but its border, where the seam must run: pixels that touch ground of the other, corners
        included.
    speck : float, optional
        Least number of connected pixels that a piece must be able to show, to show at all; by default
        `SPECK_PX`, or `SPECK_SHARE` of its patch's own pixels if these are more.

    Raises
    ------
    OverlapError
        When the masks share no pixel, or no component of the overlap has anything to decide.
    OptionError
        When `core` or `speck` is out of range.
    """
    check_core(core, speck)
    if mask_a.size > KEPT_PIXELS or mask_a.ndim != 2:
        return _between_masks(mask_a, mask_b, core, speck)
    shape = (mask_a.shape[0], mask_a.shape[1])
    return _kept_between_masks(shape, mask_a.tobytes(), mask_b.tobytes(), core, speck)


def check_core(core: float | None, speck: float | None) -> None:
    """Refuse a `core` or a `speck` that is out of range; None stands for the default.

    Raises
    ------
    OptionError
    """
    if core is not None:
        check_range(0, 1, above=True, core=core)
    if speck is not None:
        check_number("speck", speck, 0)


@lru_cache(maxsize=KEPT_SHAPES)
def _kept_between_masks(
    shape: tuple[int, int], mask_a: bytes, mask_b: bytes, core: float, speck: float | None
) -> Overlap:
    one, other = (np.frombuffer(mask, bool).reshape(shape) for mask in (mask_a, mask_b))
    return _between_masks(one, other, core, speck)


def _between_masks(mask_a: Mask, mask_b: Mask, core: float, speck: float | None) -> Overlap:
    shared = mask_a & mask_b
    if not shared.any():
        raise OverlapError(
            "the {patches} do not overlap: no pixel is covered by both; move one of them, or "
            "check where they lie",
            kind="apart",
        )
    axes = range(shared.ndim)
    used = [np.flatnonzero(shared.any(axis=tuple(other for other in axes if other != axis))) for axis in axes]
    start = tuple(int(places[0]) - 1 for places in used)
    size = tuple(int(places[-1]) + 2 - first for places, first in zip(used, start, strict=True))
    frame = Overlap(np.zeros(size, np.uint8), np.zeros(size, bool), start, mask_a.shape)
    on_a, on_b = frame.window(mask_a).astype(bool), frame.window(mask_b).astype(bool)
    shared = on_a & on_b
    own = int(np.count_nonzero(mask_a)), int(np.count_nonzero(mask_b))
    side = _sides(shared, on_a & ~shared, on_b & ~shared, core, speck, own)
    overlap = Overlap(side, shared, start, frame.canvas)
    if not ((side[shared] == A).any() and (side[shared] == B).any()) and not (side == FREE).any():
        raise OverlapError(
            "nothing divides the {patches}: {why}", kind="nothing between", why=_why_undivided(shared, own)
        )
    return overlap


def _why_undivided(shared: Mask, covered: tuple[int, int]) -> str:
    """Say why patches that cover so many pixels each, and share some, have no seam, and what helps."""
    if int(np.count_nonzero(shared)) == max(covered):
        return (
            "both cover the same ground, so that there is nothing to join; leave one of them out, or let one "
            "of them reach beyond the other"
        )
    return (
        "wherever they overlap both cover the same ground, or one is too thin to hold a seam; let one of "
        "them reach beyond the other, or lie well inside it"
    )


def pairs_along(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the indices of all pixels that have a next one along an axis, and of these next ones."""
    before = (slice(None),) * axis
    return (*before, slice(None, -1)), (*before, slice(1, None))


def neighbours(mask: Mask) -> Mask:
    """Return the pixels with a 4-neighbour, or the voxels with a 6-neighbour, in the mask."""
    result = np.zeros_like(mask)
    for axis in range(mask.ndim):
        s, t = pairs_along(axis)
        result[t] |= mask[s]
        result[s] |= mask[t]
    return result


def at_its_end(covered: Mask, ground: Mask) -> Mask:
    """Return the end of a patch: its pixels beside ground that it does not cover.

    Examples
    --------
    >>> at_its_end(np.array([[True, True, False]]), np.array([[True, True, True]]))
    array([[False,  True, False]])
    """
    return covered & neighbours(ground & ~covered)


def cores(
    covered: Mask,
    piece: npt.NDArray[np.int32],
    inside: npt.NDArray[np.bool_],
    share: float,
    speck: float | None,
    own: int,
) -> Mask:
    """Find the cores of those pieces of a patch that lie wholly inside others: the pixels that must show.

    Parameters
    ----------
    covered : (H, W) bool array
    piece : (H, W) int array
        The number of the piece that each of its pixels belongs to; 0 for all others.
    inside : (n + 1,) bool array
        Per piece, whether it lies inside; that of number 0 is False.
    share : float in (0, 1]
        A core's pixels are at least (1 - `share`) times as deep as the deepest one, and at least 2 px deep.
        In small pieces the first bound is lowered until `speck` of them are connected.
    speck : float or None
        Least number of connected pixels of a core, as for :func:`between_masks`. Only the largest core of a
        patch that has hardly anything else may be smaller.
    own : int
        Number of pixels of the patch, here and elsewhere.

    Examples
    --------
    >>> disc = np.pad(np.ones((5, 5), np.int32), 1)
    >>> [int(cores(disc > 0, disc, np.array([False, True]), share, 0, 25).sum()) for share in (0.1, 0.5, 1)]
    [1, 9, 9]
    """
    least = max(SPECK_PX, SPECK_SHARE * own) if speck is None else speck
    depth = scipy.ndimage.distance_transform_edt(np.pad(covered, 1))[(slice(1, -1),) * covered.ndim]
    threshold = np.asarray(scipy.ndimage.maximum(depth, piece, np.arange(len(inside)))) * (1 - share)
    first: Mask | None = None
    while True:
        part, count = scipy.ndimage.label(inside[piece] & (depth >= np.maximum(threshold, 2.0)[piece]))
        size = np.bincount(part.ravel(), minlength=count + 1)
        size[0] = 0
        large = size >= max(least, 1)
        if first is None:
            first = part == max(int(np.argmax(size)), 1)
        found: Mask = large[part]
        small = inside & (threshold > 2.0)
        small[piece[found]] = False
        if not small.any():
            break
        threshold[small] *= 0.8
    only_specks = not found.any() and own - np.count_nonzero(inside[piece]) < least
    return first if only_specks else found


def _sides(
    shared: Mask,
    ground_a: Mask,
    ground_b: Mask,
    core: float = 0.5,
    speck: float | None = None,
    own: tuple[int, int] = (0, 0),
) -> npt.NDArray[np.uint8]:
    side = np.full(shared.shape, NONE, np.uint8)
    side[ground_a], side[ground_b] = A, B
    # b ends beside ground that only a covers, and vice versa.
    touches_a, touches_b = at_its_end(shared, shared | ground_a), at_its_end(shared, shared | ground_b)
    side[shared] = FREE
    side[touches_a & ~touches_b], side[touches_b & ~touches_a] = A, B
    piece, count = scipy.ndimage.label(shared)
    if count == 0:
        return side
    has_a = np.bincount(piece[touches_a], minlength=count + 1) > 0
    has_b = np.bincount(piece[touches_b], minlength=count + 1) > 0
    has_a[0] = has_b[0] = True
    if (has_a & has_b).all():
        return side
    without = ~(has_a & has_b)
    middles = []
    for inside, inner in ((has_a & ~has_b, B), (has_b & ~has_a, A)):
        if inside.any():
            middles.append((cores(shared, piece, inside, core, speck, own[inner]), inner))
            without[piece[middles[-1][0]]] = False
    outer = np.where(has_b & ~has_a, np.uint8(B), np.uint8(A))
    side[without[piece]] = outer[piece[without[piece]]]
    for middle, inner in middles:
        side[middle] = inner
    return side
