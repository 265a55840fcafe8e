"""The match cost of two layers, computed from their pixels on demand."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask
from toposeam.images import as_planes, widen
from toposeam.layers.canvas.layer import Box, Layer, cut
from toposeam.layers.canvas.tile_map import part_of, uniform
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.labelling.table_costs import AROUND, spread
from toposeam.seam.problem.blend_reach import STEP, Reach, any_by_steps, within_reach
from toposeam.seam.problem.match_cost import MatchCost, match_cost
from toposeam.seam.problem.overlap import FREE, NONE, A, B, Overlap
from toposeam.seam.problem.posing import forbid
from toposeam.seam.problem.seam_problem import M_MAX

#: The costs of a pair are kept in memory if its box holds at most this many pixels, and computed again for
#: each box that is asked for if it holds more.
KEPT_PIXELS = 1 << 20
#: Number of pixels that are computed at once, in whole rows: bounds the copies in float32.
_BLOCK_PIXELS = 1 << 18
#: Boxes of at most this many pixels are not divided, since overheads would outweigh the gain.
_WHOLE_PIXELS = 1 << 15
#: Number of rows of a band that are computed at once.
_BAND_ROWS = 48
#: Least side, px, of the part covered by both layers for it to be computed apart from the border, as its
#: costs need no masks.
_LEAST_INSIDE = 16
#: The cost of a forbidden interface, far above any match cost.
FORBIDDEN = float(np.float32(M_MAX * 1e3))


def both_have(
    places: Sequence[Box] | Mapping[int, Box],
    covered: Sequence[Mask] | Mapping[int, Mask],
    i: int,
    j: int,
    box: Box,
) -> Mask:
    """(h, w) bool mask of a box of the canvas, True where two layers have pixels."""
    shared: Mask = cut(covered[i], places[i], box) & cut(covered[j], places[j], box)
    return shared


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """The layers, places, masks and weights from which match costs are computed."""

    layers: Sequence[Layer] | Mapping[int, Layer]
    places: Sequence[Box] | Mapping[int, Box]
    covered: Sequence[Mask] | Mapping[int, Mask]
    allowed: Sequence[Mask] | Mapping[int, Mask]
    match: MatchCost
    weight: npt.NDArray[Any] | None
    avoid: Mask | None
    canvas: Box
    #: Whether the costs of small overlaps are kept in memory.
    keeps: bool = True

    def part(self, box: Box, shared_parts: dict[int, Any]) -> Pictures:
        """Cut out what costs in a box depend on; `shared_parts` shares one such part among several costs."""
        found: Pictures | None = shared_parts.get(id(self))
        if found is None:
            box = box.grown(AROUND + self.match.look)
            number = range(len(self.layers)) if isinstance(self.layers, Sequence) else list(self.layers)
            near = [index for index in number if all(self.places[index].shared(box).shape)]

            def parts(masks: Sequence[Mask] | Mapping[int, Mask]) -> dict[int, Mask]:
                inside = {k: box.moved(-self.places[k].top, -self.places[k].left) for k in near}
                return {k: part_of(masks[k], inside[k].shared(Box(0, 0, *masks[k].shape))) for k in near}

            found = shared_parts[id(self)] = dataclasses.replace(
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
    """The match cost of two layers, computed from their pixels on demand."""

    def __init__(self, pair: Pair, pictures: Pictures) -> None:
        self._pair, self._pictures = pair, pictures
        self._box = pictures.places[pair[0]].shared(pictures.places[pair[1]]).grown(1)
        self._kept: tuple[Floats32, Floats32] | None = None
        self._nearby: Reach | None = None

    @property
    def box(self) -> Box:
        """The overlap of the two places, grown by one pixel."""
        return self._box

    def shared(self, box: Box) -> Mask:
        """(h, w) bool mask of a box, True where both layers have pixels."""
        return both_have(self._pictures.places, self._pictures.covered, *self._pair, box)

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Compute the costs in a box; on large overlaps only at the pixels of `beside`."""
        if not self._pictures.keeps or self.box.shape[0] * self.box.shape[1] > KEPT_PIXELS:
            common = self.box.shared(box)
            if min(common.shape) < 2:
                return spread(None, common, box)
            wanted = None if beside is None else beside[common.within(box)]
            return spread(self._computed(common, wanted), common, box)
        if self._kept is None:
            self._kept = self._computed(self.box)
        return spread(self._kept, self.box, box)

    def part(self, box: Box, shared_parts: dict[int, Any]) -> LayerPairCost:
        """Return the same cost for use inside a box only, in another process."""
        whole = box.shared(self.box) == self.box
        result = LayerPairCost(self._pair, self._pictures.part(box, shared_parts))
        result._nearby = self._nearby if whole else self._reach
        return result

    def looked_at(self) -> Reach | None:
        """Return what was computed over the whole overlap, for :meth:`know` in another process; None if
        nothing.
        """
        return self._nearby

    def know(self, nearby: Reach | None) -> None:
        """Take over what another process has computed over the whole overlap."""
        self._nearby = nearby

    def _computed(self, box: Box, wanted: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Compute the costs block by block, so that only a few rows of the layers are float32 at once."""
        height, width = box.shape
        right, down = np.zeros((height, width - 1), np.float32), np.zeros((height - 1, width), np.float32)
        for part in self._blocks(box) if wanted is None else _rows_of(box, wanted):
            across, below = self._block(part)
            at = part.moved(-box.top, -box.left)
            rows = at.bottom - at.top - (at.bottom < height)  # the next block begins with the last row
            right[at.top : at.top + rows, at.left : at.right - 1] = across[:rows]
            down[at.top : at.bottom - 1, at.left : at.right] = below
        return right, down

    def _blocks(self, box: Box) -> Iterator[Box]:
        """Yield the blocks of a box; neighbouring ones share the rows and columns of pixels at their border.

        The part that both layers cover is divided from the rest, since its costs are computed faster. A small
        box is one block.
        """
        if math.prod(box.shape) <= _WHOLE_PIXELS:
            yield box
            return
        inside = self._box.grown(-1 - self._pictures.match.look).shared(box)
        rows, columns = (
            sorted({low, first, last - 1, high - 1}) if last - first > _LEAST_INSIDE else [low, high - 1]
            for low, high, first, last in (
                (box.top, box.bottom, inside.top, inside.bottom),
                (box.left, box.right, inside.left, inside.right),
            )
        )
        for left, right in pairwise(columns):
            step = max(1, _BLOCK_PIXELS // (right - left))
            for top, bottom in pairwise(rows):
                for first in range(top, bottom, step):
                    yield Box(first, left, min(first + step, bottom) + 1, right + 1)

    def _block(self, box: Box) -> tuple[Floats32, Floats32]:
        pictures = self._pictures
        look = pictures.match.look
        around = box.grown(look)
        on_a, on_b = (cut(pictures.covered[k], pictures.places[k], around) for k in self._pair)
        overlap, known = None, cast(tuple[Mask | None, Mask | None], (None, None))
        if not (on_a.all() and on_b.all()):
            known = on_a, on_b
            may_a, may_b = (cut(pictures.allowed[k], pictures.places[k], around) for k in self._pair)
            side = np.full(around.shape, NONE, np.uint8)
            side[may_a], side[may_b] = A, B
            side[may_a & may_b] = FREE
            overlap = Overlap(side, on_a & on_b, (around.top, around.left), pictures.canvas.shape)
        a, b = widen(*(self._colours(k, around, on) for k, on in zip(self._pair, (on_a, on_b), strict=True)))
        weight = None
        if pictures.weight is not None:
            weight = cut(pictures.weight, pictures.canvas, around).astype(np.float32)
        at = around.moved(-self.box.top, -self.box.left)
        nearby = None
        if self._reach is not None:
            a, weight, nearby = within_reach(self._reach, a, weight, *at.slices, pictures.match)
        right, down = match_cost(
            a, b, overlap, *known, pictures.match, weight, nearby=nearby, start=(around.top, around.left)
        )
        if pictures.avoid is not None:
            away = cut(pictures.avoid, pictures.canvas, around)
            forbid((down, right), away, FORBIDDEN)
        inner = slice(look, -look), slice(look, -look)
        return right[inner], down[inner]

    @property
    def _reach(self) -> Reach | None:
        reach = self._pictures.match.reach
        if self._nearby is None and reach:
            self._nearby = self._computed_reach(reach)
        return self._nearby

    def _computed_reach(self, reach: float) -> Reach:
        def part(rows: slice) -> tuple[Floats32, Mask, Mask] | None:
            top = self.box.top
            here = Box(top + rows.start, self.box.left, top + rows.stop, self.box.right)
            pictures = self._pictures
            on_a, on_b = (cut(pictures.covered[k], pictures.places[k], here) for k in self._pair)
            if not (on_a.any() or on_b.any()):
                return None
            both = on_a & on_b
            a, b = widen(*(self._colours(k, here, both, STEP) for k in self._pair))
            return a - b, both[::STEP, ::STEP], any_by_steps(on_a != on_b)

        return Reach.by_rows(self.box.shape, part, reach)

    def _colours(self, index: int, box: Box, present: Mask, step: int = 1) -> Floats32:
        layer, place = self._pictures.layers[index], self._pictures.places[index]
        whole = bool(present.all())
        common = box.shared(place)
        inside = common.moved(-place.top, -place.left)
        # The first row and column of the step grid on a layer that begins inside the box.
        top, left = (-(-(begin - edge) // step) for begin, edge in zip(common[:2], box[:2], strict=True))
        image = layer.image[
            box.top + top * step - place.top : max(inside.bottom, 0) : step,
            box.left + left * step - place.left : max(inside.right, 0) : step,
        ]
        if not whole:
            pixels = image
            image = np.zeros((*present[::step, ::step].shape, *pixels.shape[2:]), pixels.dtype)
            image[top : top + len(pixels), left : left + pixels.shape[1]] = pixels
        if not whole and not uniform(self._pictures.covered[index], inside):  # beyond the layer it is 0
            image[~present[::step, ::step]] = 0
        return np.moveaxis(as_planes(image, layer.title, layer.data_range), 0, -1)


def _rows_of(box: Box, wanted: Mask) -> Iterator[Box]:
    """Yield blocks of a few rows of a box, as wide as the (h, w) bool `wanted` pixels and one pixel more."""
    for start in range(0, box.shape[0], _BAND_ROWS):
        stop = min(start + _BAND_ROWS, box.shape[0])
        columns = np.flatnonzero(wanted[max(start - 1, 0) : stop + 1].any(axis=0))
        if len(columns):
            left, right = max(int(columns[0]) - 1, 0), min(int(columns[-1]) + 2, box.shape[1])
            yield Box(start, left, min(stop + 1, box.shape[0]), right).moved(*box[:2])
