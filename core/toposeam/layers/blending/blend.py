"""Blend across the seams of a composite, tile by tile, by a blend that is chosen by name.

=============  ===========================================================================================
``auto``       `gradient` where much of an overlap is burnt out in one of two layers, whose exposures
               differ, and tones are matched (:func:`toposeam.layers.exposure.burnt_apart`); else `multiband`
``none``       nothing: a hard cut
``feather``    the two layers fade into each other across the seam, over `width` px (`fading`)
``soft``       they fade as the label potential of the heat method does: wide where the layers agree,
               narrow elsewhere (`fading`)
``multiband``  coarse shades fade over `width` px, fine detail over few (`multiband`)
``gradient``   the step between the layers is spread (`gradient_domain`), all over the picture
               or over `width` px; a layer inside another one takes over its tones
=============  ===========================================================================================

Only pixels near seams change, except with ``gradient``. Where a layer has no pixels, the weights of the
others are scaled up. Blends work in tiles, so that memory does not grow with the picture, again except with
``gradient``. Opacity fades with ``feather`` and ``soft`` and is unchanged otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Image, Labels, Mask
from toposeam.checks import check_choice
from toposeam.errors import OptionError, Term
from toposeam.images import as_planes, box_of, full_scale, in_dtype
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import uniform
from toposeam.seam.result.seam import Seam, potential_on_window
from toposeam.typing import BLENDS as BLENDS
from toposeam.typing import Blend as Blend

#: Module and class of each blend, imported on first use.
_CLASSES: dict[Blend, tuple[str, str]] = {
    "auto": ("multiband", "Multiband"),
    "none": ("blend", "Blending"),
    "feather": ("fading", "Feather"),
    "soft": ("fading", "Soft"),
    "multiband": ("multiband", "Multiband"),
    "gradient": ("gradient_domain", "GradientDomain"),
}
#: Largest width, px: with wider margins tiles would no longer bound the memory.
WIDEST = 512.0
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


class Blending:
    """A blend across the seams, with its width.

    Parameters
    ----------
    width : float, optional
        Width of the transition, px; by default that of the class.
    """

    name: ClassVar[Blend] = "none"
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

    def spread(self, canvas: Canvas, labels: Labels, image: Image, *, goes_round: bool) -> None:
        """Blend a whole composite in place, if the blend needs the whole."""


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


def blending_of(blend: str, width: float | None = None) -> Blending:
    """Return a blend by its name, with a width in px.

    Raises
    ------
    OptionError
        If there is no such blend, it takes no width, or the width is out of range.

    Examples
    --------
    >>> blending_of("multiband").reach, blending_of("gradient").needs_whole
    (32.0, True)
    """
    check_choice("blend", blend, BLENDS)
    module, name = _CLASSES[blend]  # type: ignore[index]  # checked
    kind: type[Blending] = getattr(import_module(f"toposeam.layers.blending.{module}"), name)
    if width is None:
        return kind()
    if not isinstance(width, int | float | np.number):
        raise OptionError(
            "{parameter} is of type {type}; choose 1 to {most:g} px",
            kind="number",
            parameter=Term("blend_width"),
            value=width,
            type=type(width).__name__,
            most=WIDEST,
        )
    if not kind.takes_width:
        raise OptionError(
            "{parameter} {value} has no width, but {width:g} px was given; leave it out, or "
            "choose feather, multiband or gradient",
            kind="conflict",
            parameter=Term("blend"),
            value=blend,
            width=width,
        )
    if not 1 <= width <= WIDEST:
        raise OptionError(
            "{parameter} is {value:g} px; choose 1 to {most:g}",
            kind="number",
            parameter=Term("blend_width"),
            value=width,
            most=WIDEST,
        )
    return kind(width)


class Blender:
    """Blends the hard cut of a composite, tile by tile.

    Parameters
    ----------
    canvas : Canvas
    labels : (H, W) int16 array
        The layer that shows at each pixel.
    blending : Blending
    fadings : callable
        Return the label potentials of the seams; called only if the blend needs them.
    """

    def __init__(
        self,
        canvas: Canvas,
        labels: Labels,
        blending: Blending,
        fadings: Callable[[], Sequence[Fading]],
    ) -> None:
        self._canvas, self._labels, self._blending = canvas, labels, blending
        self._mix = blending.mixer(canvas, labels, fadings() if blending.needs_potential else ())

    def blend(self, tile: Box, image: Image, alpha: Image) -> None:
        """Blend a tile in place.

        Parameters
        ----------
        tile : Box
            A box of the canvas; its upper left corner is at multiples of `BLOCK` px.
        image, alpha : (h, w[, C]) and (h, w) arrays
            The hard cut in the tile, and its opacity.
        """
        part = None if self._mix is None else self._near_seams(tile)
        if part is None or self._mix is None:
            return
        canvas, step, within = self._canvas, self._blending.grid, self._blending.changes_within
        top, left = (edge // step * step for edge in part[:2])
        bottom, right = (-(-edge // step) * step for edge in part[2:])
        around = Box(top, left, bottom, right).grown(1 if within is None else within)
        if step > 1:  # nothing is mixed beyond the canvas
            around = around.shared(Box(0, 0, *(-(-side // step) * step for side in canvas.shape)))
        shows = cut(self._labels, canvas.box, around, fill=-1)
        index = [k for k, place in enumerate(canvas.places) if all(place.shared(around).shape)]
        if len(index) < 2:
            return
        colours, opacity, changed = self._mix(around, shows, index)
        inner, here = part.within(around), part.within(tile)
        now = changed[inner] & (shows[inner] >= 0)
        _write(image[here], colours[inner], now, canvas.layers[0].white)
        if opacity is not None:
            _write(alpha[here], opacity[inner], now, float(full_scale(alpha.dtype)))

    def _near_seams(self, tile: Box) -> Box | None:
        """Return the part of a tile that the blend of nearby seams may change; None if there is none."""
        reach = self._blending.changes_within
        if reach is None:
            return tile
        around = tile.grown(reach).shared(self._canvas.box)
        if uniform(self._labels, around) is not None:
            return None
        shows = self._labels[around.slices]
        beside = np.zeros(shows.shape, bool)
        for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            beside[s] |= (shows[s] != shows[t]) & (shows[s] >= 0) & (shows[t] >= 0)
        if not beside.any():
            return None
        rows, columns = box_of(beside)
        seams = Box(rows.start, columns.start, rows.stop + 1, columns.stop + 1).moved(*around[:2])
        part = seams.grown(reach).shared(tile)
        return part if all(part.shape) else None


def _write(target: npt.NDArray[Any], values: Floats32, where: Mask, white: float) -> None:
    """Convert float values, in which 1 is `white`, to the target's dtype and write them at `where`."""
    if values.ndim == 3:
        planes = target[..., np.newaxis] if target.ndim == 2 else target
        for channel in range(values.shape[2]):
            _write(planes[..., channel], values[..., channel], where, white)
        return
    exact = np.float32 if target.dtype.itemsize <= 2 else np.float64
    np.copyto(target, in_dtype(values * exact(white), target.dtype), where=where)
