"""Light that differs from one border to the opposite one, taken out of a picture that is to repeat.

The step across a border, blurred along it so that only light is left, is spread over the whole picture, so
that neighbours change as little as possible (Poisson's equation on the torus; after Moisan 2011,
doi:10.1007/s10851-010-0227-1, who spreads all of the step).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.heat.poisson import add_steps, spread
from toposeam.images import in_dtype

#: Standard deviation of the blur along a border, as a share of its length.
_BLUR_SHARE = 0.08
#: Number of lines beside a border that are averaged.
_LINES = 8
#: Largest step across a border that counts as light, as a share of white.
_MOST_STEP = 0.3


def levelled_borders(image: npt.NDArray[Any], wraps: tuple[bool, bool], white: float) -> npt.NDArray[Any]:
    """Return a picture whose light is the same on opposite borders.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
    wraps : (bool, bool)
        Whether the last row is followed by the first one, and the last column by the first one.
    white : float

    Returns
    -------
    array of its shape and dtype, within its own range of values

    Examples
    --------
    >>> ramp = np.tile(np.linspace(0.2, 0.4, 64), (64, 1))
    >>> made = levelled_borders(ramp, (False, True), 1.0)
    >>> bool(np.abs(made[:, 0] - made[:, -1]).max() < 0.2 * (0.4 - 0.2))
    True
    """
    result = np.empty_like(image)
    deep = image[..., np.newaxis] if image.ndim == 2 else image
    for channel in range(deep.shape[2]):
        plane = deep[..., channel].astype(np.float64)
        unwanted = np.zeros(plane.shape)
        for axis, on in enumerate(wraps):
            if on:
                first = [slice(None)] * 2
                last = list(first)
                first[axis], last[axis] = slice(0, 1), slice(-1, None)
                add_steps(unwanted, tuple(last), tuple(first), _step(plane, axis, wraps[1 - axis], white))
        even = np.clip(plane + spread(unwanted, None, wraps), plane.min(), plane.max())
        target = result if image.ndim == 2 else result[..., channel]
        target[...] = in_dtype(even, image.dtype)
    return result


def _step(plane: npt.NDArray[np.float64], axis: int, closed: bool, white: float) -> npt.NDArray[np.float64]:
    """Compute by how much the light is brighter at the beginning of an axis than at its end, as one line."""
    lines = min(_LINES, plane.shape[axis] // 2)
    near = np.moveaxis(plane, axis, 0)
    apart = near[:lines].mean(axis=0) - near[-lines:].mean(axis=0)
    reach = _BLUR_SHARE * len(apart)
    smooth = ndimage.gaussian_filter1d(
        np.clip(apart, -_MOST_STEP * white, _MOST_STEP * white), reach, mode="wrap" if closed else "nearest"
    )
    line: npt.NDArray[np.float64] = np.expand_dims(smooth, axis)
    return line
