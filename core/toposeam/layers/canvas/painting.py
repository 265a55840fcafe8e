"""Paint a label map: every pixel takes the colour of the layer that shows there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Image, Labels
from toposeam.errors import ImageError
from toposeam.images import full_scale
from toposeam.layers.canvas.layer import Box, Layer

#: Side of the tiles in which layers are painted, px: most tiles show one layer and are copied whole.
_PAINTED_TILE = 256


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
                tile = Box(top, left, top + _PAINTED_TILE, left + _PAINTED_TILE).shared(common)
                here, there = tile.within(at), tile.within(place)
                shows = label_map[here] == index
                if not shows.any():
                    continue
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
