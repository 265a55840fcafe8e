"""Blend across the seams of a composite, tile by tile, by a blend that is chosen by name.

=============  ===========================================================================================
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
from importlib import import_module
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Image, Labels, Mask
from toposeam.checks import check_choice
from toposeam.errors import OptionError, Term
from toposeam.images import box_of, full_scale, in_dtype
from toposeam.layers.blending.mixing import Blend, Blending, Fading
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import uniform

BLENDS: tuple[Blend, ...] = get_args(Blend)
#: Module and class of each blend, imported on first use.
_CLASSES: dict[Blend, tuple[str, str]] = {
    "none": ("mixing", "HardCut"),
    "feather": ("fading", "Feather"),
    "soft": ("fading", "Soft"),
    "multiband": ("multiband", "Multiband"),
    "gradient": ("gradient_domain", "GradientDomain"),
}
#: Largest width, px: with wider margins tiles would no longer bound the memory.
WIDEST = 512.0


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
