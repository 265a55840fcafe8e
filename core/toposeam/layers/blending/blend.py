"""What happens across the seams of a composite.

=============  ===========================================================================================
``none``       nothing: a hard cut
``feather``    along the seam the two layers fade into each other, over `width` px
``soft``       they fade as the label potential of the heat method does: wide where the layers agree,
               narrow elsewhere
``multiband``  coarse shades fade over `width` px, fine detail over few (`multiband`)
``gradient``   the step between the layers is spread (`gradient_domain`), all over the picture
               or over `width` px; a layer inside another one takes over its tones
=============  ===========================================================================================

Only pixels near seams change but with ``gradient``. Where one layer has no pixels, the others make up for it.
Work is done in tiles, so that memory does not grow with the picture but with ``gradient``. Opacity fades with
``feather`` and ``soft`` and stays as it is otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats32, Image, Labels, Mask
from toposeam.checks import check_choice
from toposeam.errors import OptionError, Term
from toposeam.images import as_planes, box_of, full_scale, in_dtype
from toposeam.layers.blending.gradient_domain import correction, lying_inside
from toposeam.layers.blending.multiband import Contribution, Mixture
from toposeam.layers.canvas.layer import Box, Layer, cut
from toposeam.layers.canvas.tile_map import dense, uniform
from toposeam.seam.result.seam import Seam, potential_on_window

Blend = Literal["none", "feather", "soft", "multiband", "gradient"]
BLENDS: tuple[Blend, ...] = get_args(Blend)

#: Width in px where none is given; None spreads over the whole picture.
WIDTHS: dict[Blend, float | None] = {"feather": 7.0, "multiband": 32.0, "gradient": None}
#: How far blends mix that have no width, px; ``gradient`` takes away what differs evenly over so many px.
_REACHES: dict[Blend, float] = {"soft": 32.0, "gradient": 8.0}
#: Widths that make sense: beyond, tiles would no longer bound the memory.
WIDEST = 512.0

_SETTLED = 1e-3  # shares below this count as none


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed:
    """Layers on a canvas and which of them shows where."""

    layers: Sequence[Layer]
    places: Sequence[Box]
    #: Per layer, on its place, where it has pixels it may show.
    covered: Sequence[Mask]
    #: (H, W) int16.
    label_map: Labels

    @property
    def box(self) -> Box:
        """The canvas."""
        return Box(0, 0, *self.label_map.shape)


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
        """What a blend needs of a seam."""
        top, left = seam.problem.overlap.start
        potential, shared = potential_on_window(seam).copy(), seam.problem.overlap.shared.copy()
        for values in (potential, shared):
            values.setflags(write=False)  # so that large ones go by files
        height, width = potential.shape
        return cls(pair, Box(top, left, top + height, left + width), potential, shared)

    def moved(self, right: int) -> Fading:
        """The same at another place."""
        return replace(self, box=self.box.moved(0, right))

    def part(self, box: Box) -> Fading | None:
        """As far as a box is concerned; None where it is not."""
        common = self.box.shared(box)
        if not all(common.shape):
            return None
        here = common.within(self.box)
        return replace(self, box=common, potential=self.potential[here], shared=self.shared[here])


def check_blend(blend: str, width: float | None) -> None:
    """Refuse what :func:`blend_seams` cannot do.

    Raises
    ------
    OptionError
    """
    check_choice("blend", blend, BLENDS)
    if width is None:
        return
    if not isinstance(width, int | float | np.number):
        raise OptionError(
            "{parameter} is of type {type}; choose 1 to {most:g} px",
            kind="number",
            parameter=Term("blend_width"),
            value=width,
            type=type(width).__name__,
            most=WIDEST,
        )
    if blend in ("none", "soft"):
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


def reach_of(blend: Blend, width: float | None) -> float:
    """How far from a seam, px, a blend mixes what differs; 0 for narrow ones."""
    if blend == "multiband":
        return WIDTHS[blend] or 0.0 if width is None else width
    return _REACHES.get(blend, 0.0)


class Blender:
    """Blends the hard cut of a composite, tile by tile.

    Parameters
    ----------
    placed : Placed
    fadings : callable
        Gives what fades between each two layers; called for ``soft`` only.
    blend, width
        See :func:`check_blend`; None for the default width.
    goes_round : bool
        Whether the canvas does.
    """

    def __init__(
        self,
        placed: Placed,
        fadings: Callable[[], Sequence[Fading]],
        blend: Blend,
        width: float | None,
        goes_round: bool = False,
    ) -> None:
        self._goes_round = goes_round
        self._placed, self._blend = placed, blend
        self._width = width = WIDTHS.get(blend) if width is None else width
        #: How far a seam changes pixels, how far beyond pixels matter to that, and on which grid.
        self._reach = self._beyond = self._step = 1
        self._mix: Callable[[Box, Labels, list[int]], tuple[Floats32, Floats32 | None, Mask]] | None = None
        if blend == "multiband":
            levels = max(1, round(np.log2(width or 1.0)))
            self._step = 2**levels
            self._reach = self._beyond = 4 * self._step
            self._mix = _Multiband(placed, levels).mix
        elif blend == "feather":
            size = max(2, round(width or 2))
            self._reach = self._beyond = 2 * size + 2
            self._mix = _Fade(placed, _Feather(placed, size).weights).mix
        elif blend == "soft":
            self._mix = _Fade(placed, _Soft(placed.places, fadings()).weights).mix

    @property
    def margin(self) -> int:
        """How far beyond a tile its blending looks, px."""
        return self._reach + self._step + self._beyond

    def spread(self, image: Image) -> None:
        """Blend a whole composite in place, as ``gradient`` does."""
        _spread(self._placed, image, self._width, self._goes_round)

    def blend(self, tile: Box, image: Image, alpha: Image) -> None:
        """Blend a tile in place.

        Parameters
        ----------
        tile : Box
            Its upper left corner at multiples of `BLOCK` px.
        image, alpha : (h, w[, C]) and (h, w) arrays
            The tile, a hard cut.
        """
        part = None if self._mix is None else self._near_seams(tile)
        if part is None or self._mix is None:
            return
        placed, step = self._placed, self._step
        top, left = (edge // step * step for edge in part[:2])
        bottom, right = (-(-edge // step) * step for edge in part[2:])
        around = Box(top, left, bottom, right).grown(self._beyond)
        if step > 1:  # beyond the canvas there is nothing to be mixed
            around = around.shared(Box(0, 0, *(-(-side // step) * step for side in placed.box.shape)))
        shows = cut(placed.label_map, placed.box, around, fill=-1)
        index = [k for k in range(len(placed.layers)) if all(placed.places[k].shared(around).shape)]
        if len(index) < 2:
            return
        colours, opacity, changed = self._mix(around, shows, index)
        inner, here = part.within(around), part.within(tile)
        now = changed[inner] & (shows[inner] >= 0)
        _write(image[here], colours[inner], now, placed.layers[0].white)
        if opacity is not None:
            _write(alpha[here], opacity[inner], now, float(full_scale(alpha.dtype)))

    def _near_seams(self, tile: Box) -> Box | None:
        """The part of a tile that seams may change."""
        if self._blend == "soft":
            return tile
        placed = self._placed
        around = tile.grown(self._reach).shared(placed.box)
        if uniform(placed.label_map, around) is not None:
            return None
        shows = placed.label_map[around.slices]
        beside = np.zeros(shows.shape, bool)
        for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            beside[s] |= (shows[s] != shows[t]) & (shows[s] >= 0) & (shows[t] >= 0)
        if not beside.any():
            return None
        rows, columns = box_of(beside)
        seams = Box(rows.start, columns.start, rows.stop + 1, columns.stop + 1).moved(*around[:2])
        part = seams.grown(self._reach).shared(tile)
        return part if all(part.shape) else None


def _write(target: npt.NDArray[Any], values: Floats32, where: Mask, white: float) -> None:
    """Put float values, of which 1 is `white`, where they have changed; both with or without channels."""
    if values.ndim == 3:
        planes = target[..., np.newaxis] if target.ndim == 2 else target
        for channel in range(values.shape[2]):
            _write(planes[..., channel], values[..., channel], where, white)
        return
    exact = np.float32 if target.dtype.itemsize <= 2 else np.float64
    np.copyto(target, in_dtype(values * exact(white), target.dtype), where=where)


def _planes(placed: Placed, index: int, box: Box, channels: int) -> tuple[Floats32, Mask]:
    """A layer's colours in a box, one plane after the other, (C, h, w), 0 where it has none, to be written;
    and where it has some.
    """
    place, layer = placed.places[index], placed.layers[index]
    present = cut(placed.covered[index], place, box)
    image = cut(layer.image, place, box)
    inside = box.shared(place).moved(-place.top, -place.left)
    if not uniform(placed.covered[index], inside):  # beyond the layer it is 0
        image[~present] = 0
    planes = as_planes(image, layer.title, layer.data_range)
    return planes if len(planes) == channels else np.repeat(planes, channels, axis=0), present


def _channels(placed: Placed) -> int:
    return max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in placed.layers)


class _Fade:
    """Layers mixed by weights that add up to 1, given on what each has in common with a box."""

    def __init__(
        self, placed: Placed, weights: Callable[[Box, Labels, list[int]], dict[int, Floats32]]
    ) -> None:
        self._placed, self._weights = placed, weights

    def mix(self, box: Box, shows: Labels, index: list[int]) -> tuple[Floats32, Floats32 | None, Mask]:
        placed = self._placed
        channels = _channels(placed)
        colour = np.zeros((channels, *box.shape), np.float32)
        opacity, total, own = (np.zeros(box.shape, np.float32) for _ in range(3))
        opaque = all(placed.layers[k].alpha is None for k in index)
        for k, weight in self._weights(box, shows, index).items():
            common = placed.places[k].shared(box)
            here = common.within(box)
            planes, present = _planes(placed, k, common, channels)
            weight = weight * present
            own[here] += weight * (shows[here] == k)
            total[here] += weight
            if (alpha := placed.layers[k].alpha) is not None:
                opacities = np.where(present, cut(alpha, placed.places[k], common), alpha.dtype.type(0))
                weight = weight * (opacities / full_scale(alpha.dtype)).astype(np.float32)
            opacity[here] += weight
            planes *= weight
            colour[:, *here] += planes
        colour /= np.maximum(opacity, np.float32(1e-9))
        changed = (own < (1 - _SETTLED) * total) & (opacity > 0)
        opacity /= np.maximum(total, np.float32(1e-9))
        return np.moveaxis(colour, 0, 2), None if opaque else opacity, changed


class _Feather:
    """Weights that change evenly across the seam, and end before a layer does."""

    def __init__(self, placed: Placed, size: int) -> None:
        self._placed, self._size = placed, size

    def weights(self, box: Box, shows: Labels, index: list[int]) -> dict[int, Floats32]:
        ground = shows >= 0
        reach: Floats32 = np.maximum(
            self._smooth(ground), np.float32(0.5 / self._size**2)
        )  # beyond the layers there is nothing to mix in
        result = {}
        for k in index:
            common = self._placed.places[k].shared(box)
            around = common.grown(self._size).shared(box)  # beyond, its weights are 0
            near, inner = around.within(box), common.within(around)
            own = shows[near] == k
            if not own.any():
                continue
            smooth = self._smooth(own)[inner] / reach[common.within(box)]
            present = cut(self._placed.covered[k], self._placed.places[k], around) | ~ground[near]
            inside = np.clip(2 * self._smooth(present)[inner] - 1, 0, 1)
            result[k] = smooth * inside
        return result

    def _smooth(self, mask: Mask) -> Floats32:
        smooth: Floats32 = scipy.ndimage.uniform_filter(mask.astype(np.float32), self._size, mode="nearest")
        return smooth


class _Soft:
    """Weights from the label potential of each pair of layers."""

    def __init__(self, places: Sequence[Box], fadings: Sequence[Fading]) -> None:
        self._places, self._fadings = places, fadings

    def weights(self, box: Box, shows: Labels, index: list[int]) -> dict[int, Floats32]:
        result = {k: (shows == k).astype(np.float32) for k in index}
        for fading in self._fadings:
            i, j = fading.pair
            common = fading.box.shared(box)
            if i not in result or j not in result or not all(common.shape):
                continue
            here, there = common.within(box), common.within(fading.box)
            potential, free = fading.potential[there], fading.shared[there]
            towards = np.clip(potential, 0, 1 - _SETTLED)
            back = np.clip(1 - potential, 0, 1 - _SETTLED)
            result[j][here] += np.where(free & (shows[here] == i), towards / (1 - towards), np.float32(0))
            result[i][here] += np.where(free & (shows[here] == j), back / (1 - back), np.float32(0))
        return {k: weight[self._places[k].shared(box).within(box)] for k, weight in result.items()}


class _Multiband:
    """Tiles mixed band by band."""

    def __init__(self, placed: Placed, levels: int) -> None:
        self._placed, self._levels = placed, levels

    def mix(self, box: Box, shows: Labels, index: list[int]) -> tuple[Floats32, None, Mask]:
        placed = self._placed
        channels = _channels(placed)
        mixed = np.zeros((channels, *box.shape), np.float32)
        found = []
        for k in index:
            common = placed.places[k].shared(box)
            # Pairs of pixels become one: the box's edges are even.
            part = Box(*(edge // 2 * 2 for edge in common[:2]), *(-(-edge // 2) * 2 for edge in common[2:]))
            here = part.within(box)
            own = shows[here] == k
            if not own.any():
                continue
            planes, present = _planes(placed, k, part, channels)
            np.copyto(mixed[:, *here], planes, where=own)
            found.append((part, here, own, planes, present & (shows[here] >= 0)))
        pieces = []
        for part, here, own, planes, known in found:
            planes -= mixed[:, *here]
            if not known.all():
                planes *= known
            pieces.append(
                Contribution(box=part.moved(-box.top, -box.left), difference=planes, known=known, shows=own)
            )
        changed = Mixture(pieces, box.shape, self._levels, _SETTLED).onto(mixed)
        return np.moveaxis(mixed, 0, 2), None, changed


def _spread(placed: Placed, image: Image, width: float | None, goes_round: bool) -> None:
    label_map = dense(placed.label_map)
    ground = label_map >= 0
    planes = [image] if image.ndim == 2 else [image[..., channel] for channel in range(image.shape[2])]
    inner = lying_inside(placed.covered, placed.places)
    for channel, plane in enumerate(planes):
        values = correction(
            placed.layers, placed.places, placed.covered, label_map, channel, width, goes_round, inner
        )
        values += plane
        np.copyto(plane, in_dtype(values, plane.dtype), where=ground)
