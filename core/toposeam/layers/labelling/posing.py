"""Pose a labelling problem: from placed layers to the layers allowed at each pixel and their costs.

The rules of :mod:`toposeam.seam.problem.overlap`, whose `at_its_end` and `cores` apply them to one patch, are
extended to many layers:

- A layer is not allowed at its own end, where it has pixels but lacks a neighbour that another layer has,
  unless all layers there end.
- A connected piece of a layer that lies wholly inside one other layer keeps its *core*: the pixels at least
  half as deep as its deepest one. A piece that only several others together cover may vanish, unless
  ``core``, a fraction of the depth, is given; then all pieces without a pixel of their own keep a core.
  Specks keep none. Where cores of several layers overlap, only these layers are allowed; but a core that lies
  wholly inside another one has its pixels alone. Of two equal cores that is the later layer's.
- If only one of two neighbours is covered by both layers, its values count twice. If neither is, the cost
  is not known, and the interface costs 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Mask
from toposeam.errors import OptionError
from toposeam.images import box_of
from toposeam.layers.canvas.border_bands import full_within, rimmed
from toposeam.layers.canvas.canvas import Canvas, extent_of
from toposeam.layers.canvas.layer import Box, Layer, cut
from toposeam.layers.canvas.tile_map import (
    all_of,
    blocks,
    dense,
    ground,
    new_map,
    occupied_columns,
    uniform,
)
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.labelling.pair_cost import FORBIDDEN, LayerPairCost, Pictures, both_have
from toposeam.layers.labelling.problem import Labelling, PairCost
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.overlap import at_its_end, cores

#: Default of `core`: the fraction of its depth that a layer inside another one keeps.
CORE = 0.5

#: Largest number of overlapping pairs, in all or per layer, whichever is more: each takes memory and time.
_MOST_PAIRS, _PAIRS_PER_LAYER = 20_000, 64
#: So many times more pairs of rectangles are too many whatever is transparent in them: a picture turned by
#: 45° fills half of its own.
_SURELY = 2

_T = TypeVar("_T")


def pose_labelling(
    canvas: Canvas,
    *,
    core: float | None = None,
    speck: float | None = None,
    match: MatchCost | None = None,
    weight: npt.NDArray[Any] | None = None,
    avoid: Mask | None = None,
    given: Sequence[tuple[Pair, Mask]] = (),
    cut_out: bool = False,
) -> Labelling:
    """Pose the labelling problem of placed layers.

    Parameters
    ----------
    canvas : Canvas
        A flat one; a round one is cut open first (:meth:`Canvas.cut_open`).
    core, speck
        As for :func:`toposeam.stitch`.
    match
        As for :func:`toposeam.find_seam`.
    weight, avoid : (H, W) array, optional
        As for :func:`toposeam.find_seam`, on the canvas.
    given : sequence of ((int, int), (H, W) bool array)
        Seams that are given: a pair of layers, and the mask where the second one shows beside the first.
    cut_out : bool
        Whether the layers are cut out of larger ones, so that those that lie inside others have no cores.
    """
    places, covered = canvas.places, canvas.covers
    pairs = _overlapping(places, covered)
    allowed = _away_from_ends(places, covered)
    if not cut_out:
        _keep_cores(canvas.box, places, covered, allowed, core, speck)
    for pair, labels in given:
        _apply_seam(places, allowed, pair, labels)
    match = MatchCost() if match is None else match
    pictures = Pictures(canvas.layers, places, covered, allowed, match, weight, avoid, canvas.box)
    costs: dict[Pair, PairCost] = {pair: LayerPairCost(pair, pictures) for pair in pairs}
    forbidden = float("inf") if avoid is None else FORBIDDEN
    return Labelling(canvas.box, places, allowed, costs, forbidden)


def check_pairs(layers: Sequence[Layer]) -> None:
    """Refuse layers with too many overlapping pairs, before any work is done for each pair.

    Raises
    ------
    OptionError
    """
    canvas = extent_of(layers)
    top, left, bottom, right = np.array(canvas.places).T
    meet = (np.maximum.outer(top, top) < np.minimum.outer(bottom, bottom)) & (
        np.maximum.outer(left, left) < np.minimum.outer(right, right)
    )
    boxes, most = (int(np.count_nonzero(meet)) - len(layers)) // 2, _most_pairs(len(layers))
    if boxes > _SURELY * most:
        raise _too_many(len(layers), len(layers), boxes, most)
    if boxes > most:  # fewer, if transparent parts overlap
        _overlapping(canvas.places, canvas.covers)


def _most_pairs(count: int) -> int:
    return max(_MOST_PAIRS, _PAIRS_PER_LAYER * count)


def _too_many(some: int, count: int, pairs: int, most: int) -> OptionError:
    return OptionError(
        "the first {some} of {count} layers overlap in {pairs} pairs, more than {most}; merge those that lie "
        "on each other, or join fewer at a time",
        kind="too many pairs",
        some=some,
        count=count,
        pairs=pairs,
        most=most,
    )


def _overlapping(places: Sequence[Box], covered: Sequence[Mask]) -> list[Pair]:
    """Find the pairs of layers that share a pixel.

    Raises
    ------
    OptionError
        If there are more than can be kept.
    """
    pairs, most = [], _most_pairs(len(places))
    for j in range(len(places)):
        pairs += [(i, j) for i in range(j) if meets(places, covered, i, j)]
        if len(pairs) > most:
            raise _too_many(j + 1, len(places), len(pairs), most)
    return sorted(pairs)


def meets(places: Sequence[Box], covered: Sequence[Mask], i: int, j: int) -> bool:
    """Test whether two layers share a pixel."""
    return any(both_have(places, covered, i, j, box).any() for box in blocks(places[i].shared(places[j])))


def _away_from_ends(places: Sequence[Box], covered: Sequence[Mask]) -> list[Mask]:
    inner = [_without_ends(index, places, covered) for index in range(len(places))]

    def allowed(index: int, box: Box) -> Mask | bool:
        """Compute where a layer is allowed in a box: not at its end, unless all layers end there."""
        if uniform(inner[index], box):
            return True
        place = places[index]
        away, cover = inner[index][box.slices], covered[index][box.slices]
        if (away == cover).all():
            return away
        on_canvas = box.moved(*place[:2])
        return np.where(ground(places, inner, on_canvas), away, cover)

    return [
        rimmed(place.shape, full_within(inner[index]), partial(allowed, index))
        for index, place in enumerate(places)
    ]


def _without_ends(index: int, places: Sequence[Box], covered: Sequence[Mask]) -> Mask:
    place, cover = places[index], covered[index]
    whole = Box(0, 0, *place.shape)
    full = full_within(cover)

    def values(box: Box) -> Mask | bool:
        around = box.grown(1)
        if around.shared(whole) == around and uniform(cover, around):
            return True
        around = around.moved(*place[:2])
        here = cut(cover, place, around)
        away: Mask = (here & ~at_its_end(here, ground(places, covered, around)))[1:-1, 1:-1]
        return away

    return rimmed(place.shape, None if full is None else full.grown(-1), values)


def _keep_cores(
    canvas: Box,
    places: Sequence[Box],
    covered: Sequence[Mask],
    allowed: list[Mask],
    core: float | None,
    speck: float | None,
) -> None:
    """Restrict the allowed layers on cores to the layers whose cores these are, in place."""
    found = [_cores_of(index, places, covered, allowed[index], core, speck) for index in range(len(places))]
    there = [own for own in found if own is not None]
    if not there:
        return
    cored = new_map(canvas.shape, False, bool)
    for one in there:
        cored[one.box.slices] = cored[one.box.slices] | (one.piece[:, :] > 0)
    for mask, place, own in zip(allowed, places, found, strict=True):
        kept = None if own is None else own.without(there)
        for box in blocks(place):
            if uniform(cored, box) is not np.False_:
                at, free = box.within(place), ~cored[box.slices]
                if own is not None and kept is not None:
                    free |= cut(kept, own.box, box)
                mask[at] = mask[at] & free


@dataclass(frozen=True, slots=True, eq=False)
class _Cores:
    """The cores of one layer: the parts that it keeps inside other layers."""

    index: int
    #: A box of the canvas, and on it (h, w) int32: the number of the core at each pixel, 0 for none.
    box: Box
    piece: npt.NDArray[np.int32]
    #: (n + 1,) number of pixels of each core.
    size: npt.NDArray[np.intp]

    def without(self, others: Sequence[_Cores]) -> Mask:
        """(h, w) bool mask of the cores, without other layers' cores that lie inside them."""
        kept: Mask = new_map(self.box.shape, False, bool)
        kept[:, :] = self.piece[:, :] > 0
        for other in others:
            inner = other.lying_in(self)
            if inner.any():
                common = self.box.shared(other.box)
                at = common.within(self.box)
                kept[at] = kept[at] & ~inner[other.piece[common.within(other.box)]]
        return kept

    def lying_in(self, other: _Cores) -> npt.NDArray[np.bool_]:
        """(n + 1,) bool: test which cores lie inside one of another layer; of two equal ones the later one
        does.
        """
        common, none = self.box.shared(other.box), np.zeros(len(self.size), bool)
        if self.index == other.index or not all(common.shape) or (len(none) == 2 and common != self.box):
            return none
        own, theirs = self.piece[common.within(self.box)], other.piece[common.within(other.box)]
        enclosed = own[theirs > 0]
        enclosing = np.zeros(len(none), np.int32)
        enclosing[enclosed] = theirs[theirs > 0]
        inside: npt.NDArray[np.bool_] = np.bincount(enclosed, minlength=len(none)) == self.size
        if self.index < other.index:
            inside &= self.size < other.size[enclosing]
        inside[0] = False
        return inside


def _cores_of(
    index: int,
    places: Sequence[Box],
    covered: Sequence[Mask],
    allowed: Mask,
    core: float | None,
    speck: float | None,
) -> _Cores | None:
    """Find the cores of a layer's pieces that lie inside another layer, or, with `core`, inside the union of
    others.
    """
    place = places[index]
    whole = all_of(covered[index])  # the layer is one piece
    if whole and core is None and not any(place.shared(other) == place for other in _all_but(index, places)):
        return None
    if whole and core is not None and any((_depth(places, covered, box) == 1).any() for box in blocks(place)):
        return None
    if core is None and not whole:
        # A layer that lies at both ends of a round canvas leaves most columns empty.
        runs = _column_runs(covered[index])
        if sum(map(len, runs)) < place.shape[1] and not _lies_in_another(index, places, covered, runs):
            return None
    cover = dense(covered[index])
    piece = cover.astype(np.int32) if whole else scipy.ndimage.label(cover)[0]
    size = np.bincount(piece.ravel())
    if core is None:
        inside = _inside_another(index, places, covered, place, piece, size)
    else:
        inside = np.bincount(piece[_depth(places, covered, place) > 1], minlength=len(size)) == size
        inside[0] = False
    if not inside.any():
        return None
    share, own = CORE if core is None else core, int(size[1:].sum())
    middle = cores(cover, piece, inside, share, speck, own) & dense(allowed)
    if not middle.any():
        return None
    rows, columns = box_of(middle)
    piece = scipy.ndimage.label(middle[rows, columns])[0]
    numbers: npt.NDArray[np.int32] = new_map(piece.shape, 0, np.int32)
    numbers[:, :] = piece
    box = Box.of(rows, columns).moved(*place[:2])
    return _Cores(index, box, numbers, np.bincount(piece.ravel()))


def _column_runs(cover: Mask) -> list[range]:
    """Find the runs of columns in which a mask has pixels."""
    edges = np.flatnonzero(np.diff(np.pad(occupied_columns(cover), 1))).tolist()
    return [range(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def _lies_in_another(
    index: int, places: Sequence[Box], covered: Sequence[Mask], runs: Sequence[range]
) -> bool:
    """Test whether a connected piece of a layer, within runs of its columns, lies inside another layer."""
    place = places[index]
    for run in runs:
        piece = scipy.ndimage.label(dense(covered[index][:, run.start : run.stop]))[0]
        size = np.bincount(piece.ravel())
        box = Box(place.top, place.left + run.start, place.bottom, place.left + run.stop)
        if _inside_another(index, places, covered, box, piece, size).any():
            return True
    return False


def _inside_another(
    index: int,
    places: Sequence[Box],
    covered: Sequence[Mask],
    box: Box,
    piece: npt.NDArray[np.int32],
    size: npt.NDArray[np.intp],
) -> npt.NDArray[np.bool_]:
    """(n + 1,) bool: test which pieces of a layer in a box lie inside one other layer; `size` is their area,
    px.
    """
    inside = np.zeros(len(size), bool)
    for other, theirs in zip(_all_but(index, places), _all_but(index, covered), strict=True):
        common = box.shared(other)
        if all(common.shape):
            enclosed = piece[common.within(box)][cut(theirs, other, common)]
            inside |= np.bincount(enclosed, minlength=len(size)) == size
    inside[0] = False
    return inside


def _all_but(index: int, values: Sequence[_T]) -> Sequence[_T]:
    """Return all values but one."""
    return [*values[:index], *values[index + 1 :]]


def _depth(places: Sequence[Box], covered: Sequence[Mask], box: Box) -> npt.NDArray[np.uint16]:
    """(h, w) number of layers that have pixels, in a box of the canvas."""
    depth = np.zeros(box.shape, np.uint16)
    for place, cover in zip(places, covered, strict=True):
        common = place.shared(box)
        if all(common.shape):
            depth[common.within(box)] += cut(cover, place, common)
    return depth


def _apply_seam(places: Sequence[Box], allowed: list[Mask], pair: Pair, labels: Mask) -> None:
    """Forbid each of two layers the pixels that a given seam leaves to the other; `labels` on the canvas,
    True for the second layer.
    """
    common = places[pair[0]].shared(places[pair[1]])
    if not all(common.shape):
        return
    second = labels[common.slices]
    for index, other, shows in ((*pair, ~second), (*pair[::-1], second)):
        at, there = common.within(places[index]), common.within(places[other])
        taken = shows & allowed[other][there] & allowed[index][at]
        allowed[other][there] = allowed[other][there] & ~taken
