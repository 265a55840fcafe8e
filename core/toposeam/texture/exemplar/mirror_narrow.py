"""Exemplars a few pixels high or wide: mirrored at their borders, until patches fit in them."""

from __future__ import annotations

from typing import Any

import numpy as np

from toposeam.errors import ImageError
from toposeam.images import as_array

#: Least side of an exemplar, px, that is not mirrored.
NARROW = 4
#: Side that mirrored exemplars get, px: it leaves room for a patch of the size usual for small exemplars.
_WIDENED = 32


def widened(images: Any) -> Any:
    """Mirror the narrow sides of images, over and over, until they have 32 px; leave others as they are.

    A row of pixels says nothing about the other direction, so that each pixel goes on as a stripe. Whatever
    belongs to an exemplar (opacity, masks, maps, guides) is widened alike, as only the size matters.

    Parameters
    ----------
    images : (H, W[, C]) array_like, or a list of such or of lists, or None
        What is no picture at all is handed back, for others to refuse.

    Examples
    --------
    >>> widened([[np.zeros((1, 40)), None]])[0][0].shape
    (32, 40)
    """
    if images is None:
        return None
    if isinstance(images, list | tuple):
        return [widened(image) for image in images]
    try:
        image = as_array(images)
    except ImageError:
        return images
    sides = image.shape[:2]
    if min(sides) >= NARROW:
        return images
    more = [(0, _WIDENED - side if side < NARROW else 0) for side in sides]
    return np.pad(image, [*more, (0, 0)][: image.ndim], mode="symmetric")
