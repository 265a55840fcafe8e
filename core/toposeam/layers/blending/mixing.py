"""What every blend says of itself, and how it reads the layers that it mixes."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from toposeam.arrays import Floats32, Image, Labels, Mask
from toposeam.images import as_planes
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import uniform
from toposeam.seam.result.seam import Seam, potential_on_window

Blend = Literal["none", "feather", "soft", "multiband", "gradient"]

#: Shares of a layer below this count as none.
SETTLED = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Fading:
    """Between two layers, the label potential on the window of their seam's problem."""

    pair: tuple[int, int]
    #: Where the window lies, and what is held of it.
    box: Box
    #: (h, w) float32; (h, w) bool, where both have pixels.
    potential: Floats32
    shared: Mask

    @classmethod
    def of(cls, pair: tuple[int, int], seam: Seam) -> Fading:
        """Take from a seam what a blend needs of it; the overlap is heated where it was not before."""
        top, left = seam.problem.overlap.start
        potential, shared = potential_on_window(seam).copy(), seam.problem.overlap.shared.copy()
        for values in (potential, shared):
            values.setflags(write=False)  # so that large ones go by files
        height, width = potential.shape
        return cls(pair, Box(top, left, top + height, left + width), potential, shared)

    def moved(self, right: int) -> Fading:
        """Return the same at another place."""
        return replace(self, box=self.box.moved(0, right))

    def part(self, box: Box) -> Fading | None:
        """Return it as far as a box is concerned; None where it is not."""
        common = self.box.shared(box)
        if not all(common.shape):
            return None
        here = common.within(self.box)
        return replace(self, box=common, potential=self.potential[here], shared=self.shared[here])


#: Mixes a box in which the given layers lie and the map says who shows: (h, w, C) colours, (h, w) opacity or
#: None where it stays as it is, and (h, w) bool, which pixels change.
Mix = Callable[[Box, Labels, list[int]], tuple[Floats32, Floats32 | None, Mask]]


class Blending(ABC):
    """What happens across the seams, by a method and its width.

    Parameters
    ----------
    width : float, optional
        px; that of the class by default.
    """

    name: ClassVar[Blend]
    #: Whether a width can be given, and the one taken by default; None spreads over the whole picture.
    takes_width: ClassVar[bool] = False
    usual_width: ClassVar[float | None] = None
    #: Whether the whole picture has to be known, so that windows are no cheaper.
    needs_whole: ClassVar[bool] = False
    #: Whether it follows the label potentials of the seams, and what takes its place where there are none.
    needs_potential: ClassVar[bool] = False
    without_potential: ClassVar[Blend]

    def __init__(self, width: float | None = None) -> None:
        self.width = self.usual_width if width is None else width

    @property
    def reach(self) -> float:
        """How far from a seam what differs is mixed, px, as the match cost needs to know it; 0 of narrow
        blends.
        """
        return 0.0

    @property
    def changes_within(self) -> int | None:
        """How far a seam changes pixels, px; None where potentials say so."""
        return 0

    @property
    def grid(self) -> int:
        """Boxes that are mixed begin at multiples of this many px."""
        return 1

    @property
    def margin(self) -> int:
        """How far beyond a tile its blending looks, px."""
        within = 1 if self.changes_within is None else self.changes_within
        return 2 * within + self.grid

    def mixer(self, canvas: Canvas, labels: Labels, fadings: Sequence[Fading]) -> Mix | None:
        """Return what mixes a box of a composite; None where nothing is mixed, or all of it at once."""
        return None

    def spread(  # noqa: B027 - most blend tiles
        self, canvas: Canvas, labels: Labels, image: Image, *, goes_round: bool
    ) -> None:
        """Blend a whole composite in place, where that is needed."""


class HardCut(Blending):
    """Nothing happens."""

    name = "none"


def planes_of(canvas: Canvas, index: int, box: Box, channels: int) -> tuple[Floats32, Mask]:
    """Read a layer's colours in a box, one plane after the other, (C, h, w), 0 where it has none, to be
    written; and where it has some.
    """
    place, layer, cover = canvas.places[index], canvas.layers[index], canvas.covers[index]
    present = cut(cover, place, box)
    image = cut(layer.image, place, box)
    inside = box.shared(place).moved(-place.top, -place.left)
    if not uniform(cover, inside):  # beyond the layer it is 0
        image[~present] = 0
    planes = as_planes(image, layer.title, layer.data_range)
    return planes if len(planes) == channels else np.repeat(planes, channels, axis=0), present


def channels_of(canvas: Canvas) -> int:
    """Return the number of channels in which layers are mixed."""
    return max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in canvas.layers)
