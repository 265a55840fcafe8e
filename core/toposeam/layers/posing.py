"""A labelling problem posed: placed layers in; what is allowed where, and the costs, out.

The rules of :mod:`toposeam.seam.overlap`, whose `at_its_end` and `cores` state them for one patch, for many
layers:

- A layer does not show at its own end, where it has pixels but not the neighbour that another layer has,
  unless all layers there end.
- A connected piece of a layer that has no pixel to itself keeps its *core*, the pixels at least ``core``
  times as deep as its deepest. Where the cores of two layers meet, the later one has it.
- Where only one of two neighbours is covered by both layers, its values count twice; where neither is,
  nothing is known and their interface costs 0.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.errors import OptionError
from toposeam.images import Mask, as_float, widen
from toposeam.layers.labelling import Labelling, Pair, PairCost
from toposeam.layers.layer import Box, Extent, Layer, cut
from toposeam.layers.maps import (
    EDGES,
    all_of,
    blocks,
    cover_of,
    dense,
    ground,
    made_map,
    new_map,
    part_of,
    uniform,
)
from toposeam.layers.table_costs import AROUND, spread
from toposeam.seam.match_cost import Floats32, MatchCost, match_cost
from toposeam.seam.overlap import FREE, NONE, A, B, Overlap, at_its_end, cores
from toposeam.seam.posing import forbid
from toposeam.seam.problem import M_MAX
from toposeam.seam.reach import STEP, Reach

#: Costs of pairs whose box holds up to so many pixels are kept; others are computed again where they are
#: looked at.
KEPT_PIXELS = 1 << 20
#: Rows of about so many pixels are computed at once.
_BLOCK_PIXELS = 1 << 17
#: Rows of a band that are computed at once.
_WANTED_ROWS = 48
#: What forbids an interface; far above what any match cost amounts to.
_FORBIDDEN = float(np.float32(M_MAX * 1e3))


def pose_labelling(
    layers: Sequence[Layer],
    extent: Extent,
    covered: Sequence[Mask],
    *,
    core: float = 0.5,
    match: MatchCost | None = None,
    weight: npt.NDArray[Any] | None = None,
    avoid: Mask | None = None,
    given: Sequence[tuple[Pair, Mask]] = (),
) -> Labelling:
    """The labelling problem of placed layers.

    Parameters
    ----------
    layers : sequence of Layer
    extent : Extent
        Their canvas.
    covered : sequence of (h, w) bool arrays
        Per layer, on its place, where it has pixels it may show (:func:`exclusive_covers`).
    core, match
        As for :func:`toposeam.find_seam`.
    weight, avoid : (H, W) array, optional
        As for :func:`toposeam.find_seam`, on the canvas.
    given : sequence of ((int, int), (H, W) bool array)
        Seams that are known: two layers, and where the second one shows beside the first.
    """
    places = [extent.place(layer) for layer in layers]
    allowed = _away_from_ends(places, covered)
    _keep_cores(extent.box, places, covered, allowed, core)
    for pair, labels in given:
        _divide(places, allowed, pair, labels)
    match = MatchCost() if match is None else match
    context = _Context(layers, places, covered, allowed, match, weight, avoid, extent.box)
    costs: dict[Pair, PairCost] = {}
    for i in range(len(layers)):
        for j in range(i + 1, len(layers)):
            if meets(places, covered, i, j):
                costs[i, j] = LayerPairCost((i, j), context)
    forbidden = float("inf") if avoid is None else _FORBIDDEN
    return Labelling(extent.box, places, allowed, costs, forbidden)


def meets(places: Sequence[Box], covered: Sequence[Mask], i: int, j: int) -> bool:
    """Whether two layers share a pixel."""
    return any(_both(places, covered, i, j, box).any() for box in blocks(places[i].shared(places[j])))


def _both(
    places: Sequence[Box] | Mapping[int, Box],
    covered: Sequence[Mask] | Mapping[int, Mask],
    i: int,
    j: int,
    box: Box,
) -> Mask:
    shared: Mask = cut(covered[i], places[i], box) & cut(covered[j], places[j], box)
    return shared


def _away_from_ends(places: Sequence[Box], covered: Sequence[Mask]) -> list[Mask]:
    inner = [_without_ends(index, places, covered) for index in range(len(places))]

    def allowed(index: int, box: Box) -> Mask | bool:
        """Where all layers end, they are allowed to."""
        if uniform(inner[index], box):
            return True
        place = places[index]
        away, cover = inner[index][box.slices], covered[index][box.slices]
        if (away == cover).all():
            return away
        on_canvas = box.moved(*place[:2])
        return np.where(ground(places, inner, on_canvas), away, cover)

    return [made_map(place.shape, bool, partial(allowed, index), EDGES) for index, place in enumerate(places)]


def _without_ends(index: int, places: Sequence[Box], covered: Sequence[Mask]) -> Mask:
    place, cover = places[index], covered[index]
    whole = Box(0, 0, *place.shape)

    def values(box: Box) -> Mask | bool:
        around = box.grown(1)
        if around.shared(whole) == around and uniform(cover, around):
            return True
        around = around.moved(*place[:2])
        here = cut(cover, place, around)
        away: Mask = (here & ~at_its_end(here, ground(places, covered, around)))[1:-1, 1:-1]
        return away

    return made_map(place.shape, bool, values, EDGES)


def _keep_cores(
    canvas: Box, places: Sequence[Box], covered: Sequence[Mask], allowed: list[Mask], core: float
) -> None:
    claimed: Mask | None = None
    for index in reversed(range(len(places))):
        place = places[index]
        whole = all_of(covered[index])  # one piece
        if whole and any((_depth(places, covered, box) == 1).any() for box in blocks(place)):
            continue
        cover = dense(covered[index])
        piece, count = (cover.astype(np.int32), 1) if whole else ndimage.label(cover)
        alone = np.bincount(piece[_depth(places, covered, place) == 1], minlength=count + 1) > 0
        alone[0] = True
        if alone.all():
            continue
        middle = cores(cover, piece, ~alone, core) & dense(allowed[index])
        if claimed is None:
            claimed = new_map(canvas.shape, False, bool)
        before = claimed[place.slices]
        middle &= ~before
        claimed[place.slices] = before | middle
        for other, there in enumerate(places):  # no layer but this one is allowed in its core
            common = place.shared(there)
            if other != index and all(common.shape):
                at = common.within(there)
                allowed[other][at] = allowed[other][at] & ~middle[common.within(place)]


def _depth(places: Sequence[Box], covered: Sequence[Mask], box: Box) -> npt.NDArray[np.uint16]:
    """(h, w): how many layers have pixels in a box of the canvas."""
    depth = np.zeros(box.shape, np.uint16)
    for place, cover in zip(places, covered, strict=True):
        common = place.shared(box)
        if all(common.shape):
            depth[common.within(box)] += cut(cover, place, common)
    return depth


def _divide(places: Sequence[Box], allowed: list[Mask], pair: Pair, labels: Mask) -> None:
    """Forbid each of two layers what a given seam leaves to the other; `labels` on the canvas, True for the
    second layer.
    """
    common = places[pair[0]].shared(places[pair[1]])
    if not all(common.shape):
        return
    second = labels[common.slices]
    for index, other, shows in ((*pair, ~second), (*pair[::-1], second)):
        at, there = common.within(places[index]), common.within(places[other])
        taken = shows & allowed[other][there] & allowed[index][at]
        allowed[other][there] = allowed[other][there] & ~taken


@dataclass(frozen=True, slots=True, eq=False)
class _Context:
    layers: Sequence[Layer] | Mapping[int, Layer]
    places: Sequence[Box] | Mapping[int, Box]
    covered: Sequence[Mask] | Mapping[int, Mask]
    allowed: Sequence[Mask] | Mapping[int, Mask]
    match: MatchCost
    weight: npt.NDArray[Any] | None
    avoid: Mask | None
    canvas: Box
    #: Whether costs of small overlaps are kept.
    keeps: bool = True

    def part(self, box: Box, seen: dict[int, Any]) -> _Context:
        """As far as a box is concerned."""
        found: _Context | None = seen.get(id(self))
        if found is None:
            box = box.grown(AROUND)
            number = range(len(self.layers)) if isinstance(self.layers, Sequence) else list(self.layers)
            near = [index for index in number if all(self.places[index].shared(box).shape)]

            def parts(masks: Sequence[Mask] | Mapping[int, Mask]) -> dict[int, Mask]:
                inside = {k: box.moved(-self.places[k].top, -self.places[k].left) for k in near}
                return {k: part_of(masks[k], inside[k].shared(Box(0, 0, *masks[k].shape))) for k in near}

            found = seen[id(self)] = dataclasses.replace(
                self,
                layers={k: self.layers[k].bare for k in near},
                places={k: self.places[k] for k in near},
                covered=parts(self.covered),
                weight=None if self.weight is None else part_of(self.weight, box),
                avoid=None if self.avoid is None else part_of(self.avoid, box),
                allowed=parts(self.allowed),
                keeps=False,
            )
        return found


class LayerPairCost:
    """The match cost of two layers, computed from their pixels where it is looked at."""

    def __init__(self, pair: Pair, context: _Context) -> None:
        self._pair, self._context = pair, context
        self._box = context.places[pair[0]].shared(context.places[pair[1]]).grown(1)
        self._kept: tuple[Floats32, Floats32] | None = None
        self._nearby: Reach | None = None

    @property
    def box(self) -> Box:
        """What their places have in common, and one pixel around."""
        return self._box

    def shared(self, box: Box) -> Mask:
        """(h, w) bool, where both layers have pixels."""
        return _both(self._context.places, self._context.covered, *self._pair, box)

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """The costs in a box, of large overlaps only those of interfaces of the pixels asked for."""
        if not self._context.keeps or self.box.shape[0] * self.box.shape[1] > KEPT_PIXELS:
            common = self.box.shared(box)
            if min(common.shape) < 2:
                return spread(None, common, box)
            wanted = None if beside is None else beside[common.within(box)]
            return spread(self._computed(common, wanted), common, box)
        if self._kept is None:
            self._kept = self._computed(self.box)
        return spread(self._kept, self.box, box)

    def part(self, box: Box, seen: dict[int, Any]) -> LayerPairCost:
        """The same cost as far as a box is concerned."""
        whole = box.shared(self.box) == self.box
        result = LayerPairCost(self._pair, self._context.part(box, seen))
        result._nearby = self._nearby if whole else self._reach
        return result

    def looked_at(self) -> Reach | None:
        """What was seen of all of the overlap, and needs not be looked at again (:meth:`know`)."""
        return self._nearby

    def know(self, nearby: Reach | None) -> None:
        """Take over what another process has seen."""
        self._nearby = nearby

    def _computed(self, box: Box, wanted: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Block by block, so that only a few rows of the layers are held as float32."""
        height, width = box.shape
        right, down = np.zeros((height, width - 1), np.float32), np.zeros((height - 1, width), np.float32)
        step = max(1, _BLOCK_PIXELS // width) if wanted is None else _WANTED_ROWS
        for start in range(0, height, step):
            stop = min(start + step, height)
            first, last = 0, width
            if wanted is not None:
                columns = np.flatnonzero(wanted[max(start - 1, 0) : stop + 1].any(axis=0))
                if not len(columns):
                    continue
                first, last = max(int(columns[0]) - 1, 0), min(int(columns[-1]) + 2, width)
            part = Box(box.top + start, box.left + first, box.top + min(stop + 1, height), box.left + last)
            across, below = self._block(part)
            right[start:stop, first : last - 1] = across[: stop - start]
            down[start:stop, first:last] = below[: stop - start]
        return right, down

    def _block(self, box: Box) -> tuple[Floats32, Floats32]:
        context = self._context
        around = box.grown(1)  # gradients look one pixel farther
        on_a, on_b = (cut(context.covered[k], context.places[k], around) for k in self._pair)
        may_a, may_b = (cut(context.allowed[k], context.places[k], around) for k in self._pair)
        side = np.full(around.shape, NONE, np.uint8)
        side[may_a], side[may_b] = A, B
        side[may_a & may_b] = FREE
        overlap = Overlap(side, on_a & on_b, (around.top, around.left), context.canvas.shape)
        a, b = widen(*(self._colours(k, around, on) for k, on in zip(self._pair, (on_a, on_b), strict=True)))
        weight = None
        if context.weight is not None:
            weight = cut(context.weight, context.canvas, around).astype(np.float32)
        at = around.moved(-self.box.top, -self.box.left)
        nearby = None if self._reach is None else self._reach.on(*at.slices)
        right, down = match_cost(a, b, overlap, on_a, on_b, context.match, weight, nearby=nearby)
        if context.avoid is not None:
            away = cut(context.avoid, context.canvas, around)
            forbid((down, right), away, _FORBIDDEN)
        return right[1:-1, 1:-1], down[1:-1, 1:-1]

    @property
    def _reach(self) -> Reach | None:
        reach = self._context.match.reach
        if self._nearby is None and reach:
            self._nearby = self._seen_by(reach)
        return self._nearby

    def _seen_by(self, reach: float) -> Reach:
        def part(rows: slice) -> tuple[Floats32, Mask] | None:
            top = self.box.top
            here = Box(top + rows.start, self.box.left, top + rows.stop, self.box.right)
            both = self.shared(here)
            if not both.any():
                return None
            a, b = widen(*(self._colours(k, here, both, STEP) for k in self._pair))
            return a - b, both[::STEP, ::STEP]

        return Reach.by_rows(self.box.shape, part, reach)

    def _colours(self, index: int, box: Box, present: Mask, step: int = 1) -> Floats32:
        layer = self._context.layers[index]
        image = cut(layer.image, self._context.places[index], box)
        image[~present] = 0
        return as_float(image[::step, ::step], layer.name, layer.data_range)


def exclusive_covers(layers: Sequence[Layer], places: Sequence[Box], canvas: Extent) -> list[Mask]:
    """Per layer, on its place, where it has pixels that may show and no other layer must be kept.

    Raises
    ------
    OptionError
        When two layers must both be kept at a pixel, or one is to be kept nowhere that it has pixels.
    """
    covered = [cover_of(layer) for layer in layers]
    if all(layer.keep is None for layer in layers):
        return covered
    keeper = new_map(canvas.shape, -1, np.int16)
    for index, (layer, place) in enumerate(zip(layers, places, strict=True)):
        if layer.keep is None:
            continue
        kept = dense(covered[index]) & np.asarray(layer.keep)
        if not kept.any():
            raise OptionError(f"{layer.name} is to be kept where it has no pixels; check its keep mask")
        before = keeper[place.slices]
        rivals = before[kept]
        if rivals.max() >= 0:
            rival = layers[int(rivals.max())].name
            count = np.count_nonzero(rivals >= 0)
            raise OptionError(
                f"{rival} and {layer.name} are both to be kept at {count} pixels; keep only one of them there"
            )
        keeper[place.slices] = np.where(kept, np.int16(index), before)

    def exclusive(index: int, box: Box) -> Mask:
        place = places[index]
        keeps = keeper[box.moved(*place[:2]).slices]
        result: Mask = covered[index][box.slices] & ((keeps < 0) | (keeps == index))
        return result

    return [made_map(place.shape, bool, partial(exclusive, index)) for index, place in enumerate(places)]
