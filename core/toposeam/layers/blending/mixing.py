"""The common interface of blends, and how they read the layers that they mix."""

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

#: Weights of a layer below this are treated as 0.
SETTLED = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Fading:
    """The label potential between two layers, on the window of their seam's problem."""

    pair: tuple[int, int]
    #: The box of the canvas that the arrays fill.
    box: Box
    #: (h, w) float32 potential, and (h, w) bool mask where both layers have pixels.
    potential: Floats32
    shared: Mask

    @classmethod
    def of(cls, pair: tuple[int, int], seam: Seam) -> Fading:
        """Copy the label potential of a seam, computing it if it is not known yet."""
        top, left = seam.problem.overlap.start
        potential, shared = potential_on_window(seam).copy(), seam.problem.overlap.shared.copy()
        for values in (potential, shared):
            values.setflags(write=False)  # read-only arrays may be passed as files
        height, width = potential.shape
        return cls(pair, Box(top, left, top + height, left + width), potential, shared)

    def moved(self, right: int) -> Fading:
        """Return the same potential, moved right by px."""
        return replace(self, box=self.box.moved(0, right))

    def part(self, box: Box) -> Fading | None:
        """Cut the potential to a box; None if they do not meet."""
        common = self.box.shared(box)
        if not all(common.shape):
            return None
        here = common.within(self.box)
        return replace(self, box=common, potential=self.potential[here], shared=self.shared[here])


#: Mixes the given layers in a box with a label map: returns (h, w, C) colours, (h, w) opacity or None if it
#: is unchanged, and an (h, w) bool mask of the pixels that change.
Mix = Callable[[Box, Labels, list[int]], tuple[Floats32, Floats32 | None, Mask]]


class Blending(ABC):
    """A blend across the seams, with its width.

    Parameters
    ----------
    width : float, optional
        Width of the transition, px; by default that of the class.
    """

    name: ClassVar[Blend]
    #: Whether a width can be given, and its default, px; None spreads over the whole picture.
    takes_width: ClassVar[bool] = False
    usual_width: ClassVar[float | None] = None
    #: Whether the whole picture is needed to compute any window.
    needs_whole: ClassVar[bool] = False
    #: Whether the label potentials of the seams are needed, and the blend used for seams without one.
    needs_potential: ClassVar[bool] = False
    without_potential: ClassVar[Blend]

    def __init__(self, width: float | None = None) -> None:
        self.width = self.usual_width if width is None else width

    @property
    def reach(self) -> float:
        """Distance from a seam, px, up to which differences are mixed, for the match cost; 0 for narrow
        blends.
        """
        return 0.0

    @property
    def changes_within(self) -> int | None:
        """Distance from a seam, px, up to which pixels change; None if label potentials determine it."""
        return 0

    @property
    def grid(self) -> int:
        """The multiple of px at which boxes that are mixed begin."""
        return 1

    @property
    def margin(self) -> int:
        """Distance, px, beyond a tile up to which its blend depends on pixels."""
        within = 1 if self.changes_within is None else self.changes_within
        return 2 * within + self.grid

    def mixer(self, canvas: Canvas, labels: Labels, fadings: Sequence[Fading]) -> Mix | None:
        """Return the function that mixes a box; None if nothing is mixed, or only the whole at once."""
        return None

    def spread(  # noqa: B027 - most blend tiles
        self, canvas: Canvas, labels: Labels, image: Image, *, goes_round: bool
    ) -> None:
        """Blend a whole composite in place, if the blend needs the whole."""


class HardCut(Blending):
    """No blend: every pixel is that of the layer that shows."""

    name = "none"


def planes_of(canvas: Canvas, index: int, box: Box, channels: int) -> tuple[Floats32, Mask]:
    """Read a layer in a box: its colours, (C, h, w), 0 where it has no pixels, and the (h, w) mask where it
    has some.

    The colours may be written to.
    """
    place, layer, cover = canvas.places[index], canvas.layers[index], canvas.covers[index]
    present = cut(cover, place, box)
    image = cut(layer.image, place, box)
    inside = box.shared(place).moved(-place.top, -place.left)
    if not uniform(cover, inside):  # beyond the layer the image is 0
        image[~present] = 0
    planes = as_planes(image, layer.title, layer.data_range)
    return planes if len(planes) == channels else np.repeat(planes, channels, axis=0), present


def channels_of(canvas: Canvas) -> int:
    """Return the number of channels in which layers are mixed."""
    return max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in canvas.layers)
