"""Resampling of densities: smooth enlargement, area means in reduction, both across the cell's borders."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import affine_transform, uniform_filter1d

from toposeam.motif.symmetry.tiling import extend

#: Elements beyond the border that still influence a cubic spline inside.
_MARGIN = 12


def resample(field: npt.NDArray[np.floating], repeat: str, size: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Resample a density, (h, w), to another number of elements.

    Enlarging interpolates by cubic splines; where an axis shrinks, it is first averaged over the width of the
    new elements.
    """
    h, w = field.shape
    if (h, w) == size:
        return field.astype(np.float32)
    scale = h / size[0], w / size[1]
    margin = _MARGIN + int(np.ceil(max(scale)))
    wide = extend(field, repeat, margin).astype(np.float64)
    for axis in (0, 1):
        if scale[axis] > 1:
            wide = _box(wide, scale[axis], axis)
    offset = [margin + 0.5 * s - 0.5 for s in scale]
    result: npt.NDArray[np.float32] = affine_transform(
        wide, scale, offset, output_shape=size, order=3, mode="nearest", output=np.float32
    )
    np.clip(result, 0.0, 1.0, out=result)
    return result


def _box(field: npt.NDArray[np.float64], width: float, axis: int) -> npt.NDArray[np.float64]:
    """Average over windows of any width, by blending the two nearest odd whole widths."""
    low = max(1, int((width - 1) // 2) * 2 + 1)
    share = (width - low) / 2
    narrow: npt.NDArray[np.float64] = uniform_filter1d(field, low, axis=axis, mode="nearest")
    if share == 0:
        return narrow
    blend: npt.NDArray[np.float64] = (1 - share) * narrow + share * uniform_filter1d(
        field, low + 2, axis=axis, mode="nearest"
    )
    return blend
