"""Subtractive colour mixing: layers of ink over paper (thesis 4.5)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def mix(
    densities: npt.NDArray[np.floating], inks: npt.NDArray[np.floating], paper: npt.NDArray[np.floating]
) -> npt.NDArray[np.float32]:
    """Compute the colour of layers of ink over paper: paper · Π_l (1 - ρ_l (1 - C_l)).

    Each layer absorbs light in proportion to its density ρ_l and to its ink's absorption 1 - C_l.

    Parameters
    ----------
    densities : (n_L, H, W) float array in [0, 1]
    inks : (n_L, 3) float array, sRGB in [0, 1]
    paper : (3,) float array

    Returns
    -------
    (H, W, 3) float32 array in [0, 1]
    """
    image = np.empty((*densities.shape[1:], 3), np.float32)
    taken = (1.0 - np.asarray(inks)).astype(np.float32)
    for channel in range(3):
        plane = np.full(densities.shape[1:], paper[channel], np.float32)
        for density, share in zip(densities, taken[:, channel], strict=True):
            plane *= 1.0 - density * share
        np.clip(plane, 0.0, 1.0, out=image[..., channel])
    return image
