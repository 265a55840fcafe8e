"""Mend a texture: lay patches over the worst seams, as long as that lowers the seams' cost (after Kwatra et
al. 2003, section 3.2).

The cost of every seam follows from the map of sources alone: at the interface of pixels s and t that come
from different copies A and B it is |A(s) - B(s)| + |A(t) - B(t)|, where A(t) is the pixel that follows s in
the exemplar, and B(s) the one that precedes t. A patch over a bad place must show where the bad interfaces
are, and is cut along a seam that closes round them. It stays if the seams in its window cost less than
before.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Indices, Ints32, Mask
from toposeam.texture.canvas.copy_borders import ROWS
from toposeam.texture.canvas.places import Offers, Site
from toposeam.texture.exemplar.atlas import values_at
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.scheduling.process_pool import Crew
from toposeam.texture.scheduling.wavefronts import At, lay_wave

#: Side of the blocks by whose costs bad places are found, px.
_BLOCK = 8
#: Least cost of a bad interface, as a share of the worst one's in its window.
_BAD_SHARE = 0.25
#: Largest cost of the seams in a window after a patch that stays, as a share of their cost before.
_STAYING_SHARE = 0.97
#: Number of places, far enough from one another, that are mended at the same time.
_PLACES_AT_ONCE = 8
#: Number of failures in a row after which mending ends, as the remaining seams are better already.
_MOST_FAILURES = 8


class Mending:
    """Patches over bad seams in windows of one shape, each laid in two halves as by
    :class:`toposeam.texture.scheduling.wavefronts.Laying`.
    """

    def __init__(self, placer: PatchPlacer, shape: tuple[int, int]) -> None:
        self._placer, self._shape = placer, shape
        placer.refresh()
        self._found: dict[At, tuple[Site, Ints32, Mask, float]] = {}

    def offers(self, at: At) -> Offers | None:
        """Find the best places for a patch over the bad seams of a window; None where there are none."""
        found = self._look(at)
        if found is None:
            return None
        self._found[at] = found
        return self._placer.ranking.offers(found[0])

    def shows(self, at: At, place: At) -> Mask | None:
        """Find where the patch from a place shows; None if the seams would hardly cost less."""
        found = self._found.pop(at, None) or self._look(at)
        if found is None:
            return None
        placer, (site, padded, bad, before) = self._placer, found
        source = placer.patch(place, self._shape)
        shows = placer.cut(np.where(bad, np.int32(-1), padded), source, site.covers, closed=True)
        after = padded.copy()
        np.copyto(after[1:-1, 1:-1], source, where=shows)
        return None if _seam_costs(placer, after).sum() >= _STAYING_SHARE * before else shows

    def _look(self, at: At) -> tuple[Site, Ints32, Mask, float] | None:
        """Read a window and one pixel round it: the pixels that show, the bad ones, and the cost of the
        seams; None where no seam is bad.
        """
        placer, m, (top, left), (h, w) = self._placer, self._placer.margin, at, self._shape
        known = placer.canvas.read(top - m, left - m, h + 2 * m, w + 2 * m)
        padded = known[m - 1 : m + h + 1, m - 1 : m + w + 1]
        before = _seam_costs(placer, padded)
        edge = min(self._shape) // 5
        inner = slice(1 + edge, 1 + h - edge), slice(1 + edge, 1 + w - edge)
        bad = np.zeros(before.shape, bool)
        bad[inner] = before[inner] > _BAD_SHARE * before[inner].max()
        if not bad.any():
            return None
        bad |= np.roll(bad, 1, 0) | np.roll(bad, 1, 1)
        bad = np.pad(bad, (0, 1))[: h + 2, : w + 2]
        _, _, inside = placer.canvas.window(top, left, h, w)
        site = Site.of(at, self._shape, known, ~bad[1:-1, 1:-1], inside, placer.options.context_weight)
        return site, padded, bad, float(before.sum())


def mend(
    placer: PatchPlacer,
    shape: tuple[int, int],
    count: int,
    crew: Crew,
    progress: Callable[[float], None] | None = None,
) -> int:
    """Lay patches over the worst seams.

    Parameters
    ----------
    placer : PatchPlacer
        Its canvas is full, and there are no objects that seams spare.
    shape : (int, int)
        Height and width of the patches.
    count : int
        Number of places that are tried.
    crew : Crew
        The processes that lay them; its tool is the placer.
    progress : callable, optional
        Called with the share of the places tried.

    Returns
    -------
    int
        Number of patches that were laid.
    """
    canvas = placer.canvas
    height, width = canvas.shape
    blocks = -(-height // _BLOCK), -(-width // _BLOCK)
    cost = np.zeros((blocks[0] * _BLOCK, blocks[1] * _BLOCK), np.float32)
    for top in range(0, height, ROWS):
        part = cost[top : min(top + ROWS, height), :width]
        part[...] = _seam_costs(placer, canvas.read(top, 0, len(part) + 1, width + 1))
    worth = cost.reshape(blocks[0], _BLOCK, blocks[1], _BLOCK).sum(axis=(1, 3))
    tried = np.zeros(worth.shape, np.float32)
    mode = ["wrap" if wraps else "constant" for wraps in canvas.wrap]
    reach = [max(1, length // (2 * _BLOCK)) for length in shape]
    laid = failed = steps = 0
    while steps < count and failed < _MOST_FAILURES:
        local = ndimage.uniform_filter(worth, reach, mode=mode) * (1 - tried)
        worst = _worst(placer, local, shape, min(_PLACES_AT_ONCE, count - steps))
        if not worst:
            break
        for block in worst.values():
            tried[block] = 1
        steps += len(worst)
        for at, better in zip(worst, lay_wave(placer, crew, Mending, list(worst), shape), strict=True):
            laid += better
            failed = 0 if better else failed + 1
            if not better:
                continue
            top, left = at
            rows, columns, inside = canvas.window(top - 1, left - 1, shape[0] + 1, shape[1] + 1)
            new = _seam_costs(placer, canvas.read(top - 1, left - 1, shape[0] + 2, shape[1] + 2))
            cost[
                np.broadcast_to(rows, inside.shape)[inside], np.broadcast_to(columns, inside.shape)[inside]
            ] = new[inside]
            near = np.ix_(np.unique(rows // _BLOCK), np.unique(columns // _BLOCK))
            worth[near] = _block_sums(cost, near[0].ravel(), near[1].ravel())
        if progress is not None:
            progress(steps / count)
    return laid


def _worst(
    placer: PatchPlacer, local: Floats32, shape: tuple[int, int], count: int
) -> dict[At, tuple[int, int]]:
    """Select windows over some of the worst blocks, which do not wait for one another, and these blocks."""
    found: dict[At, tuple[int, int]] = {}
    canvas, apart = placer.canvas, placer.reach(shape)
    starts: list[Indices] = []  # of the window over each block, by row and by column
    for number, length, wraps, limit in zip(local.shape, shape, canvas.wrap, canvas.shape, strict=True):
        start = _BLOCK * np.arange(number) + _BLOCK // 2 - length // 2
        starts.append(start if wraps else np.clip(start, 0, max(limit - length, 0)))
    while len(found) < count:
        row, column = divmod(int(local.argmax()), local.shape[1])
        if local[row, column] <= 0:
            break
        at = int(starts[0][row]), int(starts[1][column])
        found[at] = row, column
        near = [
            np.flatnonzero(canvas.distance(axis, starts[axis] - at[axis]) < shape[axis] + apart)
            for axis in (0, 1)
        ]
        local[np.ix_(*near)] = 0
    return found


def _seam_costs(placer: PatchPlacer, index: Ints32) -> Floats32:
    """Compute the cost of the interfaces to the right and below each pixel of a window, summed, (h - 1, w -
    1); 0 within a copy.
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
        after, before = values_at(placer.features, beyond), values_at(placer.features, ahead)
        difference = _norm(after - at_t, usable[beyond])
        difference += _norm(at_s - before, usable[ahead])
        total[y, x] += difference
    return total


def _norm(values: Floats32, usable: Mask) -> Floats32:
    result: Floats32 = np.sqrt(np.square(values).sum(axis=1)) * usable
    return result


def _block_sums(cost: Floats32, rows: Indices, columns: Indices) -> Floats32:
    """Sum the costs of some blocks: (len(rows), len(columns))."""
    steps = np.arange(_BLOCK)
    part = cost[
        np.ix_(
            (rows[:, np.newaxis] * _BLOCK + steps).ravel(), (columns[:, np.newaxis] * _BLOCK + steps).ravel()
        )
    ]
    result: Floats32 = part.reshape(len(rows), _BLOCK, len(columns), _BLOCK).sum(axis=(1, 3))
    return result
