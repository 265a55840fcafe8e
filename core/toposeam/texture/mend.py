"""Mending: patches laid over the worst seams, as long as that makes them better (after Kwatra et al. 2003,
section 3.2).

The visibility of every seam is known from the map of sources alone: at the interface of pixels s and t that
come from different copies A and B, |A(s) - B(s)| + |A(t) - B(t)|, where A(t) is what follows s in the
exemplar, and B(s) what precedes t. A patch over a bad place must show where the bad interfaces are, and joins
what is round it along a seam that closes round them. It stays if the seams in its window cost less than
before.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from toposeam.images import Mask
from toposeam.texture.atlas import Floats32, Ints32, values_at
from toposeam.texture.lay import PatchPlacer, Site
from toposeam.texture.search import Ints

#: Side of the blocks of px by which bad places are found.
_BLOCK = 8
#: An interface is bad where it costs more than this share of the worst one in the window.
_BAD = 0.25
#: A patch stays if the seams in its window cost less than this share of what they did.
_BETTER = 0.97
#: After so many places in a row that could not be mended, the rest, which are better already, are left alone.
_PATIENCE = 8


def mend(
    placer: PatchPlacer, shape: tuple[int, int], count: int, progress: Callable[[float], None] | None = None
) -> int:
    """Lay patches over the worst seams.

    Parameters
    ----------
    placer : PatchPlacer
        Its canvas is full.
    shape : (int, int)
        Height and width of the patches.
    count : int
        How many places are tried.
    progress : callable, optional
        Called with the share of the places tried.

    Returns
    -------
    int
        How many patches were laid.
    """
    canvas = placer.canvas
    height, width = canvas.shape
    blocks = -(-height // _BLOCK), -(-width // _BLOCK)
    cost = np.zeros((blocks[0] * _BLOCK, blocks[1] * _BLOCK), np.float32)
    cost[:height, :width] = _seam_costs(placer, canvas.read(0, 0, height + 1, width + 1))
    worth = cost.reshape(blocks[0], _BLOCK, blocks[1], _BLOCK).sum(axis=(1, 3))
    tried = np.zeros(worth.shape, np.float32)
    mode = ["wrap" if wraps else "constant" for wraps in canvas.wrap]
    reach = [max(1, length // (2 * _BLOCK)) for length in shape]
    laid = failed = 0
    for step in range(count):
        if failed == _PATIENCE:
            break
        local = ndimage.uniform_filter(worth, reach, mode=mode) * (1 - tried)
        row, column = divmod(int(local.argmax()), local.shape[1])
        if local[row, column] <= 0:
            break
        middle = (_BLOCK * row + _BLOCK // 2, _BLOCK * column + _BLOCK // 2)
        top, left = (
            at - length // 2 if wraps else int(np.clip(at - length // 2, 0, max(limit - length, 0)))
            for at, length, wraps, limit in zip(middle, shape, canvas.wrap, canvas.shape, strict=True)
        )
        better = _try(placer, top, left, shape)
        laid += better
        failed = 0 if better else failed + 1
        if better:
            rows, columns, inside = canvas.window(top - 1, left - 1, shape[0] + 1, shape[1] + 1)
            new = _seam_costs(placer, canvas.read(top - 1, left - 1, shape[0] + 2, shape[1] + 2))
            cost[
                np.broadcast_to(rows, inside.shape)[inside], np.broadcast_to(columns, inside.shape)[inside]
            ] = new[inside]
            at = np.ix_(np.unique(rows // _BLOCK), np.unique(columns // _BLOCK))
            worth[at] = _block_sums(cost, at[0].ravel(), at[1].ravel())
        tried[row, column] = 1
        if progress is not None:
            progress((step + 1) / count)
    return laid


def _try(placer: PatchPlacer, top: int, left: int, shape: tuple[int, int]) -> bool:
    """Lay one patch over what is bad in a window, if that is better."""
    (h, w), m, canvas = shape, placer.margin, placer.canvas
    padded = canvas.read(top - 1, left - 1, h + 2, w + 2)
    before = _seam_costs(placer, padded)
    edge = min(shape) // 5
    inner = slice(1 + edge, 1 + h - edge), slice(1 + edge, 1 + w - edge)
    bad = np.zeros(before.shape, bool)
    bad[inner] = before[inner] > _BAD * before[inner].max()
    if not bad.any():
        return False
    bad |= np.roll(bad, 1, 0) | np.roll(bad, 1, 1)
    bad = np.pad(bad, (0, 1))[: h + 2, : w + 2]
    known = canvas.read(top - m, left - m, h + 2 * m, w + 2 * m)
    weight = np.where(known >= 0, np.float32(placer.options.context_weight), np.float32(0))
    weight[m : m + h, m : m + w] = ~bad[1:-1, 1:-1]
    _, _, inside = canvas.window(top, left, h, w)
    site = Site(at=(top, left), shape=shape, known=known, weight=weight, covers=inside)
    found = placer.choose(site, placer.fits(site))
    open_padded = np.where(bad, np.int32(-1), padded)
    shows = placer.cut(open_padded, found, inside, closed=True)
    after = padded.copy()
    np.copyto(after[1:-1, 1:-1], found, where=shows)
    if _seam_costs(placer, after).sum() >= _BETTER * before.sum():
        return False
    canvas.paint(top, left, found, shows)
    return True


def _seam_costs(placer: PatchPlacer, index: Ints32) -> Floats32:
    """Cost of the interfaces to the right and below each pixel of a window, summed, (h - 1, w - 1); 0 within
    a copy.
    """
    total = np.zeros((index.shape[0] - 1, index.shape[1] - 1), np.float32)
    usable = placer.atlas.usable.ravel()
    for step, first, second in (
        (1, index[:-1, :-1], index[:-1, 1:]),
        (placer.atlas.width, index[:-1, :-1], index[1:, :-1]),
    ):
        y, x = np.nonzero((second - first != step) & (first >= 0) & (second >= 0))
        s, t = first[y, x], second[y, x]
        beyond, ahead = (
            np.minimum(s + np.int32(step), np.int32(len(usable) - 1)),
            np.maximum(t - np.int32(step), 0),
        )
        at_s, at_t = values_at(placer.features, s), values_at(placer.features, t)
        difference = _norm(values_at(placer.features, beyond) - at_t, usable[beyond]) + _norm(
            at_s - values_at(placer.features, ahead), usable[ahead]
        )
        total[y, x] += difference
    return total


def _norm(values: Floats32, usable: Mask) -> Floats32:
    result: Floats32 = np.sqrt(np.square(values).sum(axis=1)) * usable
    return result


def _block_sums(cost: Floats32, rows: Ints, columns: Ints) -> Floats32:
    """Sums of some blocks: (len(rows), len(columns))."""
    steps = np.arange(_BLOCK)
    part = cost[
        np.ix_(
            (rows[:, np.newaxis] * _BLOCK + steps).ravel(), (columns[:, np.newaxis] * _BLOCK + steps).ravel()
        )
    ]
    result: Floats32 = part.reshape(len(rows), _BLOCK, len(columns), _BLOCK).sum(axis=(1, 3))
    return result
