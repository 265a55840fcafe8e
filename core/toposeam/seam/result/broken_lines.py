"""Where a seam breaks what the pictures show whole: lines that are displaced or end at it, things cut in two.

A patch of the joined picture S that lies on the seam is looked for in both pictures A and B, a few px round
its place. Where it is in neither, S shows something new; that is seen unless A and B hardly repeat themselves
there either, as in leaves, grass and waves::

    novelty = √(min |S - A₊|², |S - B₊|²) / √(max(min |A - A₊|², min |B - B₊|²) + T²)

|·|² is the variance of the difference of two patches in CIELAB, weighted by a Gaussian; ₊ is a displacement,
of A against itself one of at least 3 px. T is a difference that is just seen. A straight edge repeats itself
along its direction, and a step in it is new. Means of patches do not count: steps of tone are measured apart
(:func:`toposeam.seam.result.verdict.steps_beside`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Floats32, Mask

#: Half the side of a patch, px, and the deviation of its weights.
_HALF, _DEVIATION = 4, 2.67
#: Largest displacement, px, and the least one of a picture against itself.
_REACH, _LEAST = 6, 3
#: T, in units of CIELAB; the novelty that is just seen.
_JUST_SEEN, _SEEN = 2.0, 1.5
#: Patches that differ by less than this share of what is seen are not compared with the pictures themselves.
_LEAST_SEEN = 0.7
#: Patches that are compared at once.
_AT_ONCE = 64
#: The blur that hides noise, px, and how far it reaches.
_BLUR, _BLUR_REACH = 0.6, 2
#: A point of the seam is judged by the pixels up to this many px beside it.
_MARGIN = _HALF + _REACH + _BLUR_REACH


def broken_at(
    shown: Floats32,
    pictures: Sequence[Floats32],
    covers: Sequence[Mask],
    joined: Mask,
    rows: npt.NDArray[np.intp],
    columns: npt.NDArray[np.intp],
) -> Floats:
    """Measure how visibly a seam breaks what both pictures show.

    Parameters
    ----------
    shown : (h, w, 3) float32 array
        The joined picture, sRGB in [0, 1].
    pictures : two arrays of the same shape
    covers : two (h, w) bool arrays
        Where each of them has pixels.
    joined : (h, w) bool array
        Where the joined picture shows one of the two, and no filling. Other places are not judged.
    rows, columns : (n,) int arrays
        Points of the seam.

    Returns
    -------
    (n,) float array
        1 is just seen.

    Examples
    --------
    A line that goes on 4 px lower:

    >>> a = np.full((48, 48, 3), 0.5, np.float32)
    >>> b = a.copy()
    >>> a[20:23], b[24:27] = 0.2, 0.2
    >>> joined = np.where(np.arange(48)[:, np.newaxis] < 24, a, b)
    >>> there = np.ones((48, 48), bool)
    >>> broken_at(joined, (a, b), (there, there), there, np.array([23, 8]), np.array([24, 24])) > 1
    array([ True, False])
    """
    planes = [
        np.pad(one, ((_MARGIN, _MARGIN), (_MARGIN, _MARGIN), (0, 0)), "edge") for one in (shown, *pictures)
    ]
    known = [np.pad(cover, _MARGIN) for cover in (joined, *covers)]
    novelty = np.zeros(len(rows))
    for first in range(0, len(rows), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        novelty[part] = _novelty(planes, known, rows[part], columns[part])
    return novelty / _SEEN


def _novelty(
    planes: Sequence[Floats32],
    known: Sequence[Mask],
    rows: npt.NDArray[np.intp],
    columns: npt.NDArray[np.intp],
) -> Floats:
    """(n,) novelty of the patches at some points."""
    at = np.arange(2 * _MARGIN + 1)
    here = (rows[:, np.newaxis] + at)[:, :, np.newaxis], (columns[:, np.newaxis] + at)[:, np.newaxis]
    shown, *pictures = (_blurred_lab(plane[here]) for plane in planes)
    inner = np.s_[:, _BLUR_REACH:-_BLUR_REACH, _BLUR_REACH:-_BLUR_REACH]
    joined, *whole = (_there(cover[here][inner]) for cover in known)
    apart = np.full(len(rows), np.inf)
    for picture, there in zip(pictures, whole, strict=True):
        found = np.where(there, _distances(shown, picture), np.inf)
        apart = np.minimum(apart, found.min(axis=(1, 2)))
    apart[~joined[:, _REACH, _REACH]] = np.inf
    own = np.zeros(len(rows))
    new = np.flatnonzero(np.isfinite(apart) & (apart > (_LEAST_SEEN * _SEEN * _JUST_SEEN) ** 2))
    shift = np.arange(-_REACH, _REACH + 1)
    far = np.hypot(shift[:, np.newaxis], shift) >= _LEAST
    for picture, there in zip(pictures, whole, strict=True):
        mine = new[there[new, _REACH, _REACH]]
        found = np.where(there[mine] & far, _distances(picture[mine], picture[mine]), np.inf)
        least = found.min(axis=(1, 2))
        own[mine] = np.maximum(own[mine], np.where(np.isfinite(least), least, 0))
    novelty: Floats = np.where(np.isfinite(apart), np.sqrt(apart / (own + _JUST_SEEN**2)), 0)
    return novelty


def _blurred_lab(windows: Floats32) -> Floats32:
    """(n, 3, s, s) CIELAB of (n, s + 2 b, s + 2 b, 3) windows, blurred over b px."""
    from skimage.color import rgb2lab

    lab = np.moveaxis(np.asarray(rgb2lab(windows), np.float32), 3, 1)
    blurred = scipy.ndimage.gaussian_filter(
        lab, (0, 0, _BLUR, _BLUR), radius=(0, 0, _BLUR_REACH, _BLUR_REACH)
    )
    inner: Floats32 = blurred[..., _BLUR_REACH:-_BLUR_REACH, _BLUR_REACH:-_BLUR_REACH]
    return np.ascontiguousarray(inner)


def _there(cover: Mask) -> Mask:
    """(n, s, s) bool: where the displaced patches lie on pixels of a picture."""
    side = 2 * _REACH + 1
    if cover.all():
        return np.ones((len(cover), side, side), bool)
    eroded = scipy.ndimage.minimum_filter(cover.view(np.uint8), (1, 2 * _HALF + 1, 2 * _HALF + 1)).view(bool)
    inner: Mask = eroded[:, _HALF:-_HALF, _HALF:-_HALF]
    return inner


def _distances(first: Floats32, second: Floats32) -> Floats32:
    """(n, s, s) variance of the difference between the middle patches of n windows and all of others."""
    along = np.arange(-_HALF, _HALF + 1)
    weight = np.exp(-(along[:, np.newaxis] ** 2 + along**2) / (2 * _DEVIATION**2)).astype(np.float32)
    weight /= weight.sum()
    side = 2 * _HALF + 1
    middle = first[..., _REACH : _REACH + side, _REACH : _REACH + side]
    middle = middle - np.einsum("nchw,hw->nc", middle, weight)[..., np.newaxis, np.newaxis]
    views = np.lib.stride_tricks.sliding_window_view(second, (side, side), axis=(2, 3))
    count, channels, steps = views.shape[:3]
    flat = views.reshape(count, channels, steps * steps, side * side)
    weights = weight.reshape(-1)
    both = np.empty((count, channels, side * side, 2), np.float32)
    both[..., 0] = (middle * weight).reshape(count, channels, side * side)
    both[..., 1] = weights
    product, mean = np.moveaxis(flat @ both, -1, 0)
    squares = np.square(flat) @ weights
    own = np.einsum("nchw,nchw,hw->nc", middle, middle, weight)
    found = (squares - mean**2 - 2 * product + own[..., np.newaxis]).sum(axis=1)
    distances: Floats32 = np.maximum(found, 0).reshape(count, steps, steps)
    return distances
