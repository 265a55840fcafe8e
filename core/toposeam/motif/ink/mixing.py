"""Colour mixing: layers of transparent (thesis 4.5) or opaque ink over paper."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Kinds of ink: such that lets the light of what lies below pass, or covers it.
INKINGS = ("transparent", "opaque")


def mix(
    densities: npt.NDArray[np.floating],
    inks: npt.NDArray[np.floating],
    paper: npt.NDArray[np.floating],
    inking: str = "transparent",
) -> npt.NDArray[np.float32]:
    """Compute the colour of layers of ink over paper.

    Transparent inks give paper · Π_l (1 - ρ_l (1 - C_l)): each layer absorbs light in proportion to its
    density ρ_l and to its ink's absorption 1 - C_l. An opaque ink covers the share ρ_l of what lies below.

    Parameters
    ----------
    densities : (n_L, H, W) float array in [0, 1]
    inks : (n_L, 3) float array, sRGB in [0, 1]
    paper : (3,) float array
    inking : str
        One of `INKINGS`.

    Returns
    -------
    (H, W, 3) float32 array in [0, 1]
    """
    image = np.empty((*densities.shape[1:], 3), np.float32)
    colours = np.asarray(inks).astype(np.float32)
    for channel in range(3):
        plane = np.full(densities.shape[1:], paper[channel], np.float32)
        for density, colour in zip(densities, colours[:, channel], strict=True):
            if inking == "opaque":
                plane += density * (colour - plane)
            else:
                plane *= 1.0 - density * (np.float32(1) - colour)
        np.clip(plane, 0.0, 1.0, out=image[..., channel])
    return image
