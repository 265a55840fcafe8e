"""The canvas: layers in their places on one rectangle, which may go all the way round."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Image, Indices, Labels, Mask
from toposeam.checks import check_items, check_number, check_whole
from toposeam.errors import ImageError, OptionError, OverlapError, Term
from toposeam.images import full_scale
from toposeam.layers.canvas.layer import MAX_MEGAPIXELS, Box, Layer
from toposeam.layers.canvas.tile_map import BLOCK, cover_of, dense, is_empty, made_map, new_map

#: Side of the tiles in which layers are painted, px: most tiles show one layer and are copied whole.
_PAINTED_TILE = 256


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Canvas:
    """Layers in their places on a rectangle of pixels, flat or going all the way round.

    Coordinates on the canvas begin at its upper left pixel, :attr:`origin` of the layers' coordinates.

    Examples
    --------
    >>> common_canvas([Layer(np.zeros((20, 30))), Layer(np.zeros((20, 30)), at=(25, -2))])
    Canvas(2 layers, 55 × 22 px at 0,-2)
    """

    layers: Sequence[Layer]
    #: (x, y) of the upper left pixel in the layers' coordinates.
    origin: tuple[int, int]
    #: Height and width, px.
    shape: tuple[int, int]
    #: The width, px, of a round canvas, whose right edge adjoins its left one; None for a flat canvas.
    period: int | None = None
    #: The box of the canvas that each layer fills; on a round canvas it may reach beyond the right edge.
    places: Sequence[Box] = ()
    #: The covers, if they are known already.
    _covers: Sequence[Mask] | None = None

    def __post_init__(self) -> None:
        if not self.places:
            object.__setattr__(self, "places", tuple(map(self.place, self.layers)))

    def __repr__(self) -> str:
        height, width = self.shape
        ends = ", all the way round" if self.period else ""
        where = f"{self.origin[0]},{self.origin[1]}"
        return f"Canvas({len(self.layers)} layers, {width} × {height} px at {where}{ends})"

    @property
    def box(self) -> Box:
        """The box of the whole canvas."""
        return Box(0, 0, *self.shape)

    @property
    def frame(self) -> Box:
        """The box of the canvas in the layers' coordinates."""
        return self.box.moved(self.origin[1], self.origin[0])

    @property
    def names(self) -> tuple[str, ...]:
        """The layers' names."""
        return tuple(layer.name for layer in self.layers)

    def place(self, layer: Layer) -> Box:
        """Return the box of the canvas that a layer fills."""
        x, y = layer.at[0] - self.origin[0], layer.at[1] - self.origin[1]
        return Box(y, x, y + layer.image.shape[0], x + layer.image.shape[1])

    @cached_property
    def covers(self) -> Sequence[Mask]:
        """Per layer, (h, w) bool mask on its place: its pixels that may show, without those that others must
        keep.

        Raises
        ------
        OptionError
            When two layers must both be kept at a pixel, or one where it has none.
        """
        return _exclusive_covers(self) if self._covers is None else self._covers

    def check_covers(self) -> None:
        """Refuse layers that can show at no pixel.

        Raises
        ------
        OverlapError
        """
        covers = self.covers if self.period is None else extent_of(self.layers).covers
        for index, (layer, cover) in enumerate(zip(self.layers, covers, strict=True)):
            if is_empty(cover):
                x, y = layer.at
                raise OverlapError(
                    "{name} (at {x},{y}): the {patches} do not overlap: no pixel of it shows, as it "
                    "is transparent or masked everywhere, or others keep all of it; leave it out, or "
                    "check what is transparent or masked",
                    kind="apart",
                    layers=(index,),
                    name=layer.name,
                    x=x,
                    y=y,
                )

    def of_layers(self, numbers: Sequence[int]) -> Canvas:
        """Return the same canvas with only some of its layers."""
        return dataclasses.replace(
            self,
            layers=[self.layers[k] for k in numbers],
            places=[self.places[k] for k in numbers],
            _covers=[self.covers[k] for k in numbers],
        )

    def seam_box(self, cell: int) -> Box:
        """Return the box in which the seam of two layers is searched: what their places share and two pixels
        round it, as far as gradients reach, from a multiple of `cell` px on.
        """
        box = self.places[1].shared(self.places[0]).grown(2)
        return Box(box.top - box.top % cell, box.left - box.left % cell, *box[2:]).shared(self.box)

    def with_layers(self, layers: Sequence[Layer]) -> Canvas:
        """Return the same canvas with other layers of the same sizes and places, as after matching tones."""
        return dataclasses.replace(self, layers=layers)

    def moved(self, right: int, down: int) -> Canvas:
        """Return the canvas and its layers moved right and down by px."""
        at = ((layer.at[0] + right, layer.at[1] + down) for layer in self.layers)
        layers = [dataclasses.replace(one, at=place) for one, place in zip(self.layers, at, strict=True)]
        return dataclasses.replace(
            self, layers=layers, origin=(self.origin[0] + right, self.origin[1] + down)
        )

    def cut_open(self, column: int = 0) -> Canvas:
        """Return a round canvas as a flat one that begins at a column of it; a flat canvas as it is."""
        if self.period is None:
            return self
        from toposeam.layers.canvas.cylinder import turned

        left, top = self.origin
        moved = (dataclasses.replace(one, at=(one.at[0] - left, one.at[1] - top)) for one in self.layers)
        parts = [turned(layer, self.period, column) for layer in moved]
        return Canvas(layers=parts, origin=(0, 0), shape=self.shape)

    def sparsest_column(self, away: int = 0) -> tuple[int, int]:
        """Find the column of a round canvas on which the fewest layers lie, and their number.

        Of the columns with that number it is the middle of the widest run. If several layers lie there,
        columns closer than `away` px to either end are left out.
        """
        from toposeam.layers.canvas.cylinder import occupied_on

        period, left = self.shape[1], self.origin[0]
        count = np.sum([occupied_on(layer, period, layer.at[0] - left) for layer in self.layers], axis=0)
        if count.min() > 1 and away:
            count[:away] = count[period - away :] = count.max() + 1
        fewest = count == count.min()
        if fewest.all():
            return 0, int(count[0])
        start = int(np.flatnonzero(~fewest)[0])
        edges = np.flatnonzero(np.diff(np.append(np.roll(fewest, -start), False).astype(np.int8)))
        first, last = edges[::2] + 1, edges[1::2] + 1
        longest = int(np.argmax(last - first))
        return (start + (int(first[longest]) + int(last[longest])) // 2) % period, int(count.min())

    def with_both_ends(self) -> Canvas:
        """Return a round canvas as a flat one that is extended on both sides by :attr:`beyond` px of the
        other end.

        So neighbourhoods near the edges hold the pixels that adjoin there.
        """
        if self.period is None:
            return self
        from toposeam.layers.canvas.cylinder import Turned, unrolled

        period, beyond, flat = self.period, self.beyond, self.cut_open()
        width = period + 2 * beyond
        left, top = self.origin
        moved = (dataclasses.replace(one, at=(one.at[0] - left, one.at[1] - top)) for one in self.layers)
        covers = [
            Turned(cover, place.left, period, -beyond, width)
            for cover, place in zip(flat.covers, flat.places, strict=True)
        ]
        return Canvas(
            layers=[unrolled(layer, period, beyond) for layer in moved],
            origin=(-beyond, 0),
            shape=(self.shape[0], width),
            _covers=covers,  # type: ignore[arg-type]  # reads like an array
        )

    @property
    def beyond(self) -> int:
        """The width, px, by which :meth:`with_both_ends` extends each side; 0 for a flat canvas."""
        if self.period is None:
            return 0
        return min(4 * BLOCK, self.period // BLOCK * BLOCK) or self.period


def common_canvas(
    layers: Sequence[Layer], *, max_megapixels: float = MAX_MEGAPIXELS, wrap: int | None = None
) -> Canvas:
    """Make the smallest canvas that holds all layers.

    Parameters
    ----------
    layers : sequence of Layer
    max_megapixels : float
    wrap : int, optional
        Width, px, of a round canvas. Its left edge is at 0 if all layers lie between 0 and `wrap`, else at
        the leftmost layer.

    Raises
    ------
    OptionError
        If the canvas would hold more than `max_megapixels` million pixels.

    Examples
    --------
    >>> common_canvas([Layer(np.zeros((20, 30))), Layer(np.zeros((20, 30)), at=(25, -2))]).shape
    (22, 55)
    """
    check_number("max_megapixels", max_megapixels, 0, above=True)
    layers = check_items("layers", layers, Layer, "a sequence of Layers")
    if not layers:
        raise OptionError(
            "there are no layers; give at least one", kind="count", parameter=Term("layers"), count=0
        )
    canvas = extent_of(layers)
    height, width = canvas.shape
    if height * width > max_megapixels * 1e6:
        raise OptionError(
            "the layers span {width} × {height} px, more than {most:g} megapixels; "
            "check where they lie{alone}",
            kind="too large",
            width=width,
            height=height,
            most=max_megapixels,
            alone=_outlying_layer(layers, max_megapixels * 1e6),
        )
    if wrap is None:
        return canvas
    period = check_whole("wrap", wrap, 2, max(2, int(max_megapixels * 1e6) // height))
    left, top = canvas.origin
    origin = 0 if left >= 0 and left + width <= period else left
    return Canvas(layers=layers, origin=(origin, top), shape=(height, period), period=period)


def _outlying_layer(layers: Sequence[Layer], pixels: float) -> str:
    """Name the one layer without which the canvas would be small enough, for an error; empty if there is
    none.
    """
    for index, layer in enumerate(layers if len(layers) > 2 else ()):
        height, width = extent_of([*layers[:index], *layers[index + 1 :]]).shape
        if height * width <= pixels:
            return f", {layer.name} first of all"
    return ""


def extent_of(layers: Sequence[Layer]) -> Canvas:
    """Make the smallest canvas that holds all layers, however large."""
    left, top = (min(layer.at[axis] for layer in layers) for axis in (0, 1))
    right = max(layer.at[0] + layer.image.shape[1] for layer in layers)
    bottom = max(layer.at[1] + layer.image.shape[0] for layer in layers)
    return Canvas(layers=layers, origin=(left, top), shape=(bottom - top, right - left))


def _exclusive_covers(canvas: Canvas) -> list[Mask]:
    """Compute the cover of each layer, without pixels that another layer must keep."""
    layers, places = canvas.layers, canvas.places
    covers = [cover_of(layer) for layer in layers]
    if all(layer.keep is None for layer in layers):
        return covers
    keeper: Labels = new_map(canvas.shape, -1, np.int16)
    for index, (layer, place) in enumerate(zip(layers, places, strict=True)):
        if layer.keep is None:
            continue
        kept = dense(covers[index]) & np.asarray(layer.keep)
        if not kept.any():
            raise OptionError(
                "{name} is to be kept where it has no pixels; check its keep mask",
                kind="kept nowhere",
                layers=(index,),
                name=layer.name,
            )
        before = keeper[place.slices]
        rivals = before[kept]
        if rivals.max() >= 0:
            rival = layers[int(rivals.max())].name
            count = np.count_nonzero(rivals >= 0)
            raise OptionError(
                "{other} and {name} are both to be kept at {count} pixels; keep only one of them there",
                kind="both kept",
                layers=(int(rivals.max()), index),
                other=rival,
                name=layer.name,
                count=count,
            )
        keeper[place.slices] = np.where(kept, np.int16(index), before)

    def exclusive(index: int, box: Box) -> Mask:
        place = places[index]
        keeps = keeper[box.moved(*place[:2]).slices]
        result: Mask = covers[index][box.slices] & ((keeps < 0) | (keeps == index))
        return result

    return [made_map(place.shape, bool, partial(exclusive, index)) for index, place in enumerate(places)]


def paint(
    layers: Sequence[Layer],
    places: Sequence[Box],
    label_map: Labels,
    at: Box,
    channels: int | None,
    onto: tuple[Image, Image] | None = None,
) -> tuple[Image, Image]:
    """Paint a label map in a box; return the picture, (h, w[, C]), and its opacity, (h, w), 0 where no layer
    shows.

    Parameters
    ----------
    label_map : (h, w) int16 array
        The layer that shows at each pixel of the box, -1 for none.
    at : Box
    channels : int or None
        None for a plane of gray.
    onto : (h, w[, C]) and (h, w) arrays, optional
        Arrays of zeros to paint on and return, instead of new ones.
    """
    dtype = layers[0].image.dtype
    if onto is None:
        image = np.zeros(at.shape if channels is None else (*at.shape, channels), dtype)
        alpha = np.zeros(at.shape, dtype)
    else:
        image, alpha = onto
    for index, (layer, place) in enumerate(zip(layers, places, strict=True)):
        common = place.shared(at)
        for top in range(common.top, common.bottom, _PAINTED_TILE):
            for left in range(common.left, common.right, _PAINTED_TILE):
                bottom, right = (
                    min(start + _PAINTED_TILE, end)
                    for start, end in ((top, common.bottom), (left, common.right))
                )
                tile = Box(top, left, bottom, right)
                here = tile.within(at)
                shows = label_map[here] == index
                if not shows.any():
                    continue
                there = tile.within(place)
                part = layer.image[there]
                if channels is not None and part.ndim == 2:
                    part = part[..., np.newaxis]
                own = full_scale(dtype) if layer.alpha is None else layer.alpha[there]
                if shows.all():
                    image[here], alpha[here] = part, own
                else:
                    on, planes = (
                        each if each.ndim == 3 else each[..., np.newaxis] for each in (image[here], part)
                    )
                    for channel in range(on.shape[2]):  # faster than copying whole pixels
                        values = planes[..., min(channel, planes.shape[2] - 1)]
                        np.copyto(on[..., channel], values, where=shows)
                    np.copyto(alpha[here], own, where=shows)
    return image, alpha


def channel_count(layers: Sequence[Layer]) -> int | None:
    """Return the number of channels of the composite, None for a plane of gray.

    Raises
    ------
    ImageError
        When layers have several but not equally many channels.
    """
    counts = {1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in layers}
    wide = counts - {1}
    if len(wide) > 1:
        raise ImageError(
            "the layers have {channels} channels; convert them to the same number, or to gray",
            kind="channels",
            channels=tuple(sorted(wide)),
        )
    if wide:
        return wide.pop()
    return None if all(layer.image.ndim == 2 for layer in layers) else 1


def groups(count: int, pairs: Iterable[tuple[int, int]]) -> Indices:
    """Label the groups of layers that pairs join: (N,)."""
    i, j = np.array(list(pairs), np.intp).reshape(-1, 2).T
    graph = csr_array((np.ones(len(i)), (i, j)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.intp)
