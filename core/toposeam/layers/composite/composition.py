"""Placed layers, and which of them shows where: a composite before it is a picture.

The picture is made window by window, and nothing as large as the canvas is held but the label map
(:mod:`toposeam.layers.canvas.tile_map`): layers, too, are read where they are looked at
(:class:`toposeam.Windows`), and seams are made one after another. :func:`toposeam.stitch` is the same for
pictures that fit into memory.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from toposeam.arrays import Image, Labels
from toposeam.images import Windows, in_dtype
from toposeam.layers.blending.blend import Blend, Blender, Fading, Placed
from toposeam.layers.canvas.layer import Box, Extent, Layer
from toposeam.layers.canvas.painting import paint
from toposeam.layers.canvas.tile_map import BLOCK, blocks, part_of
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.labelling.problem import Pair
from toposeam.optimize.history import Termination
from toposeam.seam.result.seam import Seam, knows_potential
from toposeam.seam.result.verdict import Verdict, worst_of
from toposeam.sentence import counted
from toposeam.vector.polyline import Polyline

#: Over so many columns the end of a canvas that goes round fades into its beginning.
_JOINT = 64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """What a seam looks like and how it was found."""

    pair: Pair
    paths: tuple[Polyline, ...]
    cost: float
    method: str
    termination: Termination
    iterations: int
    seconds: float
    settings: Mapping[str, Any]
    verdict: Verdict | None = None

    @property
    def length(self) -> float:
        """Length of all its lines, px."""
        return sum(line.length for line in self.paths)


@dataclass(frozen=True, slots=True)
class Totals:
    """What all seams of a composition come to."""

    #: px.
    length: float
    cost: float
    seconds: float
    #: The engines that found them, as :attr:`Seam.method` has them, joined by "and".
    method: str
    #: Those of all of them; None each unless their match cost is that of the law "natural".
    verdicts: tuple[Verdict | None, ...] = ()

    @property
    def verdict(self) -> Verdict | None:
        """That of the seam most likely to be seen."""
        return worst_of(self.verdicts)


class _Blank(Windows):
    """Pixels that nobody looks at."""

    def read(self, rows: slice, columns: slice) -> Image:
        """Zeros."""
        size = len(range(*rows.indices(self.shape[0]))), len(range(*columns.indices(self.shape[1])))
        return np.zeros((*size, *self.shape[2:]), self.dtype)


def _unknown(pair: Pair, beside: bool) -> Seam:
    raise ValueError(f"part of a composition does not know the seam between {pair[0]} and {pair[1]}")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Composition:
    """Which layer shows where, and the picture of that by windows.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> composed = ts.layers.compose(ts.layers.overlapping(a, b, overlap=10))
    >>> composed.shape, composed.pairs
    ((30, 70), ((0, 1),))
    >>> image, alpha = composed.window(slice(0, 8), slice(60, 70))
    >>> bool((image == b[:8, 30:]).all()), alpha.min()
    (True, np.float64(1.0))
    """

    #: The layers as they show, after their tones were matched.
    layers: Sequence[Layer]
    #: Where the canvas lies, and its size.
    canvas: Extent
    #: Rounds of expansions that were made, 0 for two layers.
    rounds: int
    #: Which two layers each seam divides, by number.
    pairs: tuple[Pair, ...]
    #: The farthest by which layers were bent to meet at the seams, px.
    bent: float = 0.0
    _placed: Placed
    _channels: int | None
    _blend: Blend
    _blend_width: float | None
    _seam: Callable[[Pair, bool], Seam]
    #: Where the canvas begins on what `_placed` holds, which goes on beyond it where it goes round.
    _begin: int = 0
    _goes_round: bool = False
    #: Told without making the seams, where that is known.
    _totals: Callable[[Executor | None], Totals] | None = None
    #: Of a part, what fades there.
    _known_fadings: list[Fading] | None = None

    def __repr__(self) -> str:
        height, width = self.shape
        seams = counted(len(self.pairs), "seam")
        return f"Composition({len(self.layers)} layers, {width} × {height} px, {seams})"

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the canvas, px."""
        return self.canvas.shape

    @property
    def period(self) -> int | None:
        """The canvas's width, px, if it goes all the way round."""
        return self.shape[1] if self._goes_round else None

    @property
    def names(self) -> tuple[str, ...]:
        """The layers' names."""
        return tuple(layer.name for layer in self.layers)

    @property
    def origin(self) -> tuple[int, int]:
        """(x, y) of the canvas's upper left pixel in the layers' coordinates."""
        return self.canvas.origin

    @property
    def hidden(self) -> tuple[int, ...]:
        """The numbers of the layers that show nowhere, since others cover them and seams cost less so."""
        placed = self._placed
        return tuple(
            k
            for k, place in enumerate(placed.places)
            if not any((placed.label_map[box.slices] == k).any() for box in blocks(place))
        )

    def labels(self, rows: slice, columns: slice) -> Labels:
        """(h, w) int16, the number of the layer that shows in a window of the canvas; -1 where none does."""
        bounds = (part.indices(side)[:2] for part, side in zip((rows, columns), self.shape, strict=True))
        (top, bottom), (left, right) = bounds
        label_map = self._placed.label_map
        labels: Labels = label_map[top:bottom, left + self._begin : right + self._begin]
        return labels.copy() if isinstance(label_map, np.ndarray) else labels  # maps of tiles give copies

    def window(self, rows: slice, columns: slice) -> tuple[Image, Image]:
        """The picture in a window of the canvas, (h, w[, C]), and its opacity, (h, w), in the layers' dtype;
        0 where no layer has pixels.

        Windows whose edges are multiples of 1024 px cost the least. The blend "gradient" knows no windows:
        the first one computes the whole picture.
        """
        (top, bottom), (left, right) = (
            part.indices(side)[:2] for part, side in zip((rows, columns), self.shape, strict=True)
        )
        box = Box(top, left, max(top, bottom), max(left, right))
        if self._blend == "gradient":
            image, alpha = self._spread
            return image[box.slices].copy(), alpha[box.slices].copy()
        image, alpha = self._empty(box)
        canvas = self.canvas.box
        for row in range(top - top % BLOCK, bottom, BLOCK):
            for column in range(left - left % BLOCK, right, BLOCK):
                tile = Box(row, column, row + BLOCK, column + BLOCK).shared(canvas)
                common = tile.shared(box)
                here = common.within(box)
                if common == tile:
                    self._tile(tile, (image[here], alpha[here]))
                    continue
                part, opacity = self._tile(tile)
                image[here] = part[common.within(tile)]
                alpha[here] = opacity[common.within(tile)]
        return image, alpha

    def part(self, rows: slice, columns: slice) -> Composition:
        """The same as far as a window is concerned, to be handed to another process, which gives the same
        pixels there; without seams. It is all of it where blending needs all of it.
        """
        if not self.divides:
            return self
        (top, bottom), (left, right) = (
            part.indices(side)[:2] for part, side in zip((rows, columns), self.shape, strict=True)
        )
        top, left = top - top % BLOCK, left - left % BLOCK
        bottom, right = bottom + -bottom % BLOCK, right + -right % BLOCK
        window = Box(top, left, bottom, right).shared(self.canvas.box).moved(0, self._begin)
        margin = self._blender.margin
        boxes = [window.grown(margin).shared(self._placed.box)]
        end = self._begin + self.shape[1]
        if self._goes_round and self._blend == "multiband" and window.right > end - _JOINT:  # it is eased
            boxes.append(boxes[0].moved(0, -self.shape[1]).shared(self._placed.box))
        placed = self._placed
        layers, covered, places = [], [], []
        # Of a thousand layers nearly all are elsewhere: one thing that is pickled once stands for them.
        nowhere, nothing = Box(0, 0, 0, 0), np.zeros((0, 0), bool)
        blanks: dict[tuple[Any, ...], Layer] = {}
        for layer, place, cover in zip(placed.layers, placed.places, placed.covered, strict=True):
            common = [place.shared(box) for box in boxes]
            if any(all(one.shape) for one in common):
                layers.append(dataclasses.replace(layer, mask=None, keep=None))
                covered.append(part_of(cover, *(one.moved(-place.top, -place.left) for one in common)))
                places.append(place)
                continue
            kind = layer.image.shape[2:], layer.image.dtype, layer.data_range
            if kind not in blanks:
                blank = cast(Image, _Blank((1, 1, *kind[0]), layer.image.dtype))
                blanks[kind] = dataclasses.replace(layer.bare, image=blank, name="elsewhere", at=(0, 0))
            layers.append(blanks[kind])
            covered.append(nothing)
            places.append(nowhere)
        part = Placed(
            layers=layers,
            places=places,
            covered=covered,
            label_map=part_of(placed.label_map, *boxes),
        )
        fadings = None
        if self._blend == "soft":
            cut_out = (fading.part(box) for box in boxes for fading in self._fadings)
            fadings = [fading for fading in cut_out if fading is not None]
        return dataclasses.replace(
            self,
            layers=layers,
            pairs=(),
            _placed=part,
            _seam=_unknown,
            _totals=None,
            _known_fadings=fadings,
        )

    def seams(self) -> Iterator[tuple[Pair, Seam]]:
        """The seams with their pairs of layers, each made when its turn comes."""
        for pair in self.pairs:
            yield pair, self._seam(pair, False)

    def outlines(self) -> Iterator[Outline]:
        """The seams without the problems they solve, which may be larger than memory."""
        for pair in self.pairs:
            seam = self._seam(pair, True)
            yield Outline(
                pair=pair,
                paths=tuple(seam.paths),
                cost=seam.cost,
                method=seam.method,
                termination=seam.termination,
                iterations=len(seam.history),
                seconds=seam.seconds,
                settings=seam.settings,
                verdict=seam.verdict,
            )

    def totals(self, executor: Executor | None = None) -> Totals:
        """What all seams come to, which takes less than making them.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            Where costs along the seams are looked up, each seam by itself.

        Examples
        --------
        >>> import numpy as np, toposeam as ts
        >>> a, b = np.random.default_rng(0).random((2, 30, 40))
        >>> totals = ts.layers.compose(ts.layers.overlapping(a, b, overlap=10)).totals()
        >>> totals.method, totals.length >= 30
        ('shortest-path', True)
        """
        if self._totals is not None:
            return self._totals(executor)
        seams = tuple(self.outlines())
        return Totals(
            length=sum(seam.length for seam in seams),
            cost=sum(seam.cost for seam in seams),
            seconds=sum(seam.seconds for seam in seams),
            method=" and ".join(sorted({seam.method for seam in seams})),
            verdicts=tuple(seam.verdict for seam in seams),
        )

    @property
    def divides(self) -> bool:
        """Whether parts are smaller than all of it."""
        return self._blend != "gradient"

    def _empty(self, box: Box) -> tuple[Image, Image]:
        dtype = self.layers[0].image.dtype
        shape = box.shape if self._channels is None else (*box.shape, self._channels)
        return np.zeros(shape, dtype), np.zeros(box.shape, dtype)

    def _tile(self, tile: Box, onto: tuple[Image, Image] | None = None) -> tuple[Image, Image]:
        placed, tile = self._placed, tile.moved(0, self._begin)
        shows = placed.label_map[tile.slices]
        image, alpha = paint(placed.layers, placed.places, shows, tile, self._channels, onto)
        self._blender.blend(tile, image, alpha)
        if self._goes_round and self._blend == "multiband":
            self._ease(tile, image)
        return image, alpha

    def _ease(self, tile: Box, image: Image) -> None:
        """Let the last columns of a canvas that goes round fade into what its pyramids, which begin at the
        left edge, give there: the width need not be a multiple of their coarsest pixels.
        """
        period = self.shape[1]
        joint = min(_JOINT, period // 4)
        end = self._begin + period
        part = Box(tile.top, max(tile.left, end - joint), tile.bottom, tile.right)
        if not all(part.shape):
            return
        there = part.moved(0, -period)
        placed = self._placed
        shows = placed.label_map[there.slices]
        other, opacity = paint(placed.layers, placed.places, shows, there, self._channels)
        self._blender.blend(there, other, opacity)
        here = image[part.within(tile)]
        share = (np.arange(part.left, part.right) + joint + 1.0 - end) / (joint + 1)
        share = share.reshape((1, -1) + (1,) * (image.ndim - 2))
        mixed = here + share * (other.astype(np.float64) - here)
        here[...] = in_dtype(mixed, image.dtype)

    @cached_property
    def _blender(self) -> Blender:
        return Blender(self._placed, lambda: self._fadings, self._blend, self._blend_width, self._goes_round)

    @cached_property
    def _fadings(self) -> list[Fading]:
        """What fades between layers, on `_placed`; where the canvas goes round, at both ends."""
        if self._known_fadings is not None:
            return self._known_fadings
        period = self.shape[1]
        turns = (-period, 0, period) if self._goes_round else (0,)
        found = (Fading.of(pair, self._known_seam(pair)) for pair in self.pairs)
        return [fading.moved(self._begin + turn) for fading in found for turn in turns]

    def _known_seam(self, pair: Pair) -> Seam:
        """A seam with its label potential, for which costs are needed only where it was not kept."""
        seam = self._seam(pair, True)
        return seam if knows_potential(seam) else self._seam(pair, False)

    @cached_property
    def _spread(self) -> tuple[Image, Image]:
        box = self.canvas.box
        image, alpha = self._empty(box)
        for tile in blocks(box):
            image[tile.slices], alpha[tile.slices] = paint(
                self._placed.layers,
                self._placed.places,
                self._placed.label_map[tile.slices],
                tile,
                self._channels,
            )
        self._blender.spread(image)
        return image, alpha
