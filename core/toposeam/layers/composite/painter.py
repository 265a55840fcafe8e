"""Paint the picture of a label map, window by window, with its blend.

The label map is the only thing in memory that is as large as the canvas
(:mod:`toposeam.layers.canvas.tile_map`): layers are read where they are painted (:class:`toposeam.Windows`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple, cast

import numpy as np

from toposeam.arrays import Image, Labels, Mask
from toposeam.images import Windows, full_scale, in_dtype
from toposeam.layers.blending.blend import Blender, Blending, Fading
from toposeam.layers.canvas.canvas import Canvas, paint
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.tile_map import BLOCK, blocks, part_of

#: Width of the strip, px, in which the right end of a round canvas fades into its left end.
_JOINT_WIDTH = 64


class Filling(NamedTuple):
    """Pixels that stand where no layer shows."""

    #: Where they lie on the canvas.
    box: Box
    #: (h, w[, C]) in the layers' dtype, and (h, w), which of them count.
    image: Image
    where: Mask

    def onto(self, box: Box, image: Image, alpha: Image) -> None:
        """Put them onto the pixels and the opacity of a box of the canvas."""
        common = self.box.shared(box)
        if all(common.shape):
            here, own = common.within(box), common.within(self.box)
            image[here][self.where[own]] = self.image[own][self.where[own]]
            alpha[here][self.where[own]] = full_scale(alpha.dtype)


@dataclass(frozen=True, kw_only=True, eq=False)
class Painter:
    """Paints windows of a canvas. :meth:`part` of it, made for another process, paints the same pixels."""

    #: A flat canvas; a round one is extended by some of the other end on both sides.
    canvas: Canvas
    #: (H, W) int16 on that canvas.
    labels: Labels
    blending: Blending
    #: The number of channels, None for a plane of gray.
    channels: int | None
    #: Return the label potentials of the seams on `canvas`.
    fadings: Callable[[], Sequence[Fading]]
    #: The column of `canvas` at which the picture begins, and its width, px.
    begin: int
    width: int
    #: Whether the picture's right edge adjoins its left edge.
    goes_round: bool = False

    @classmethod
    def of(
        cls,
        canvas: Canvas,
        labels: Labels,
        blending: Blending,
        channels: int | None,
        fadings: Callable[[], Sequence[Fading]],
    ) -> Painter:
        """Make the painter of a canvas, flat or round, with its label map and the label potentials of its
        seams.
        """
        period, begin = canvas.period, 0
        whole = canvas.cut_open()
        if period is not None and not blending.needs_whole:  # those handle a round canvas themselves
            from toposeam.layers.canvas.cylinder import turned_map

            whole, begin = canvas.with_both_ends(), canvas.beyond
            labels = turned_map(labels, period, -begin, whole.shape[1])

        def moved() -> list[Fading]:
            turns = (0,) if period is None else (-period, 0, period)
            return [fading.moved(begin + turn) for fading in fadings() for turn in turns]

        return cls(
            canvas=whole,
            labels=labels,
            blending=blending,
            channels=channels,
            fadings=moved,
            begin=begin,
            width=canvas.shape[1],
            goes_round=period is not None,
        )

    @property
    def box(self) -> Box:
        """The box of the picture."""
        return Box(0, 0, self.canvas.shape[0], self.width)

    def window(self, box: Box) -> tuple[Image, Image]:
        """Return the picture in a box, (h, w[, C]), and its opacity, (h, w), both in the layers' dtype; 0
        where no layer has pixels. Boxes whose edges are multiples of 1024 px are the fastest.
        """
        if self.blending.needs_whole:
            image, alpha = self._whole
            return image[box.slices].copy(), alpha[box.slices].copy()
        image, alpha = self._empty(box)
        top, left, bottom, right = box
        for row in range(top - top % BLOCK, bottom, BLOCK):
            for column in range(left - left % BLOCK, right, BLOCK):
                tile = Box(row, column, row + BLOCK, column + BLOCK).shared(self.box)
                common = tile.shared(box)
                here = common.within(box)
                if common == tile:
                    self._tile(tile, (image[here], alpha[here]))
                    continue
                part, opacity = self._tile(tile)
                image[here] = part[common.within(tile)]
                alpha[here] = opacity[common.within(tile)]
        return image, alpha

    def part(self, box: Box) -> Painter:
        """Return a painter of one box, small enough to be pickled for another process.

        A blend that needs the whole picture returns the painter itself.
        """
        if self.blending.needs_whole:
            return self
        top, left = box.top - box.top % BLOCK, box.left - box.left % BLOCK
        bottom, right = box.bottom + -box.bottom % BLOCK, box.right + -box.right % BLOCK
        canvas = self.canvas
        window = Box(top, left, bottom, right).shared(self.box).moved(0, self.begin)
        boxes = [window.grown(self.blending.margin).shared(canvas.box)]
        if self._fades_at_end and window.right > self._end - _JOINT_WIDTH:
            boxes.append(boxes[0].moved(0, -self.width).shared(canvas.box))
        fadings: list[Fading] = []
        if self.blending.needs_potential:
            cut_out = (fading.part(box) for box in boxes for fading in self._fadings)
            fadings = [fading for fading in cut_out if fading is not None]
        return dataclasses.replace(
            self,
            canvas=_part_of_canvas(canvas, boxes),
            labels=part_of(self.labels, *boxes),
            fadings=partial(tuple, fadings),
        )

    def _empty(self, box: Box) -> tuple[Image, Image]:
        dtype = self.canvas.layers[0].image.dtype
        shape = box.shape if self.channels is None else (*box.shape, self.channels)
        return np.zeros(shape, dtype), np.zeros(box.shape, dtype)

    def _tile(self, tile: Box, onto: tuple[Image, Image] | None = None) -> tuple[Image, Image]:
        tile = tile.moved(0, self.begin)
        image, alpha = self._hard_cut(tile, onto)
        self._blender.blend(tile, image, alpha)
        if self._fades_at_end:
            self._fade_end(tile, image)
        return image, alpha

    def _hard_cut(self, box: Box, onto: tuple[Image, Image] | None = None) -> tuple[Image, Image]:
        canvas = self.canvas
        return paint(canvas.layers, canvas.places, self.labels[box.slices], box, self.channels, onto)

    @property
    def _end(self) -> int:
        """The column of `canvas` at which the picture ends."""
        return self.begin + self.width

    @property
    def _fades_at_end(self) -> bool:
        """Whether the last columns must fade: the blend's grid begins at the left edge and does not fit the
        width.
        """
        return self.goes_round and self.blending.grid > 1

    def _fade_end(self, tile: Box, image: Image) -> None:
        """Fade the last columns of a round canvas into those beyond its left edge, for pyramids.

        Pyramids begin at the left edge, and the width need not be a multiple of their coarsest pixels.
        """
        joint, end = min(_JOINT_WIDTH, self.width // 4), self._end
        part = Box(tile.top, max(tile.left, end - joint), tile.bottom, tile.right)
        if not all(part.shape):
            return
        there = part.moved(0, -self.width)
        other, opacity = self._hard_cut(there)
        self._blender.blend(there, other, opacity)
        here = image[part.within(tile)]
        share = (np.arange(part.left, part.right) + joint + 1.0 - end) / (joint + 1)
        share = share.reshape((1, -1) + (1,) * (image.ndim - 2))
        mixed = here + share * (other.astype(np.float64) - here)
        here[...] = in_dtype(mixed, image.dtype)

    @cached_property
    def _blender(self) -> Blender:
        return Blender(self.canvas, self.labels, self.blending, lambda: self._fadings)

    @cached_property
    def _fadings(self) -> Sequence[Fading]:
        return self.fadings()

    @cached_property
    def _whole(self) -> tuple[Image, Image]:
        image, alpha = self._empty(self.box)
        for tile in blocks(self.box):
            image[tile.slices], alpha[tile.slices] = self._hard_cut(tile)
        self.blending.spread(self.canvas, self.labels, image, goes_round=self.goes_round)
        return image, alpha


class _Blank(Windows):
    """Zeros in place of the pixels of a layer that lies elsewhere."""

    def read(self, rows: slice, columns: slice) -> Image:
        """Return zeros."""
        size = len(range(*rows.indices(self.shape[0]))), len(range(*columns.indices(self.shape[1])))
        return np.zeros((*size, *self.shape[2:]), self.dtype)


def _part_of_canvas(canvas: Canvas, boxes: Sequence[Box]) -> Canvas:
    """Return a canvas with the layers that lie on some boxes; all others become blanks.

    Of a thousand layers nearly all lie elsewhere: they share one blank, which is pickled once.
    """
    layers, covers, places = [], [], []
    nowhere, nothing = Box(0, 0, 0, 0), np.zeros((0, 0), bool)
    blanks: dict[tuple[Any, ...], Layer] = {}
    for layer, place, cover in zip(canvas.layers, canvas.places, canvas.covers, strict=True):
        common = [place.shared(box) for box in boxes]
        if any(all(one.shape) for one in common):
            layers.append(dataclasses.replace(layer, mask=None, keep=None))
            covers.append(part_of(cover, *(one.moved(-place.top, -place.left) for one in common)))
            places.append(place)
            continue
        kind = layer.image.shape[2:], layer.image.dtype, layer.data_range
        if kind not in blanks:
            blank = cast(Image, _Blank((1, 1, *kind[0]), layer.image.dtype))
            blanks[kind] = dataclasses.replace(layer.bare, image=blank, name="elsewhere", at=(0, 0))
        layers.append(blanks[kind])
        covers.append(nothing)
        places.append(nowhere)
    return dataclasses.replace(canvas, layers=layers, places=places, _covers=covers)
