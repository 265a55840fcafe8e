"""What a selection was made for: the part of it that looks unlike its border."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Image, Mask
from toposeam.images import box_of, full_scale

#: Most pixels that are looked at; larger selections are reduced.
_MOST = 250_000
#: Width of the border, as a share of the square root of the selection's area, and at least, px.
_BORDER, _LEAST_BORDER = 0.04, 2
#: Levels of each channel, and blur of their histogram, levels.
_LEVELS, _BLUR = 16, 0.8
#: Share of the border whose colours count as rare there.
_RARE = 0.03
#: Least share of the selection that one thing has; and least and largest share of all things together.
_SPECK, _LEAST, _MOST_SHARE = 0.005, 0.02, 0.4
#: Largest share of a thing that lies on the border.
_CUT = 0.03


def standing_out(image: Image, selected: Mask) -> Mask | None:
    """Return the (H, W) bool mask of the things in a selection: pixels whose colours are rare on its border,
    where hardly any of them lie there.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
    selected : (H, W) bool array

    Returns
    -------
    (H, W) bool array, or None where nothing stands out, or too much does
    """
    if not selected.any():
        return None
    rows, columns = box_of(selected)
    step = math.ceil(math.sqrt(np.count_nonzero(selected) / _MOST))
    picture = np.atleast_3d(image[rows, columns][::step, ::step])
    inside = np.pad(selected[rows, columns][::step, ::step], 1)
    depth = scipy.ndimage.distance_transform_edt(inside)[1:-1, 1:-1]
    inside = inside[1:-1, 1:-1]
    area = int(np.count_nonzero(inside))
    border = inside & (depth <= max(_LEAST_BORDER, _BORDER * math.sqrt(area)))
    white = 1.0 if picture.dtype.kind == "f" else float(full_scale(picture.dtype))
    blurred = scipy.ndimage.gaussian_filter(picture.astype(np.float32), (1, 1, 0))
    levels = np.clip(blurred * (_LEVELS / white), 0, _LEVELS - 1).astype(np.intp)
    shape = (_LEVELS,) * levels.shape[2]
    index = np.ravel_multi_index(tuple(np.moveaxis(levels, 2, 0)), shape)
    counts = np.bincount(index[border], minlength=math.prod(shape)).reshape(shape).astype(np.float32)
    often = scipy.ndimage.gaussian_filter(counts, _BLUR).ravel()[index]
    things = scipy.ndimage.binary_opening(inside & (often < np.quantile(often[border], _RARE)))
    things = scipy.ndimage.binary_fill_holes(scipy.ndimage.binary_closing(things, iterations=3)) & inside
    numbers: npt.NDArray[np.intp] = scipy.ndimage.label(things)[0]
    sizes = np.bincount(numbers.ravel())
    sizes[np.bincount(numbers[border], minlength=len(sizes)) > _CUT * sizes] = 0  # the selection cuts it
    sizes[0] = 0
    things = (sizes >= _SPECK * area)[numbers]
    if not _LEAST * area <= np.count_nonzero(things) <= _MOST_SHARE * area:
        return None
    found = np.zeros(selected.shape, bool)
    whole = np.repeat(np.repeat(things, step, axis=0), step, axis=1)
    height, width = selected[rows, columns].shape
    found[rows, columns] = whole[:height, :width]
    return found & selected
