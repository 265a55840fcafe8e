r"""The edges of strokes: what is printed where the optimisation left a density between paper and ink.

An optimised density is nearly 0 or 1, but for a haze a few elements wide round every stroke. Interpolated to
print size the haze is a blur. Its contours are not: the line where the density, smoothed by a quarter of an
element, crosses a level t is as sharp at any size, and t is chosen so that what lies above it is as much as
the mean density. A stroke is then as wide as the mass that was spent on it. Pieces and holes that
are too small to be meant are left out (:mod:`toposeam.motif.ink.stroke_repair`).

On pixels the contour is drawn by its distance. Near it a density f rises by about \|f_x\| + \|f_y\| over the
pixel, so that a pixel's share beyond the contour is (f - t) / (\|f_x\| + \|f_y\|) + 1/2, in [0, 1]: exact for
a straight edge along the pixels, and within 1/8 for any other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32
from toposeam.checks import check_choice
from toposeam.motif.ink.stroke_repair import crumbs, holes
from toposeam.motif.symmetry.tiling import extend

#: How a layer's strokes end: the haze unchanged; a line at the level of equal mass; or a line that keeps half
#: of the haze, inside of which the ink shades.
EDGES = ("soft", "crisp", "ink")
#: Smoothing before contours are taken, in elements: takes the staircase off hard edges.
SMOOTHING = 0.25
#: Share of a pixel from which on it is seen as ink.
_SEEN = 0.1
#: Ink goes on to this share of the level of equal mass.
_WET = 0.5
#: Cells smaller than this are doubled before their contours are taken.
_FINE = 512
#: Rows that are worked on at once have at most this many px.
_STRIP_PX = 8_000_000


def level(field: npt.NDArray[np.floating], mass: float) -> float:
    """Return the level above which a share `mass` of a field lies.

    Examples
    --------
    >>> level(np.linspace(0, 1, 101), 0.3)
    0.7
    """
    return round(float(np.quantile(field, 1.0 - mass)), 6)


def smoothed(field: Floats32, repeat: str, px_per_element: tuple[float, float]) -> Floats32:
    """Blur a density as its contours are taken from, with the pattern's neighbours beyond its border."""
    sigma = [SMOOTHING * px for px in px_per_element]
    margin = int(np.ceil(4 * max(sigma)))
    wide = extend(field, repeat, margin)
    blurred: Floats32 = ndimage.gaussian_filter(wide, sigma, mode="nearest")
    return blurred[margin : margin + field.shape[0], margin : margin + field.shape[1]]


def beyond(field: Floats32, at: float, repeat: str) -> Floats32:
    """Return the share of every pixel in which a field exceeds a level, in [0, 1]."""
    result = np.empty(field.shape, np.float32)
    wide = extend(field, repeat, 1)
    rows = max(1, _STRIP_PX // wide.shape[1])
    for start in range(0, len(field), rows):
        part = wide[start : start + rows + 2]
        slope = np.abs(part[2:, 1:-1] - part[:-2, 1:-1]) + np.abs(part[1:-1, 2:] - part[1:-1, :-2])
        share = (part[1:-1, 1:-1] - np.float32(at)) / np.maximum(0.5 * slope, 1e-6) + 0.5
        np.clip(share, 0.0, 1.0, out=result[start : start + rows])
    return result


def printed(
    sample: Callable[[tuple[int, int]], Floats32],
    edge: str,
    repeat: str,
    elements: tuple[int, int],
    size: tuple[int, int],
    ends: tuple[float, np.float32],
) -> Floats32:
    """Print a layer with its stroke edges.

    Parameters
    ----------
    sample : callable
        The density interpolated to (rows, columns).
    edge : str
        One of `EDGES`.
    repeat : str
        The rule by which it goes on beyond its border.
    elements : (rows, columns)
        Of the optimisation.
    size : (rows, columns)
        Of the print, px. Fewer than elements are the means of a print with more.
    ends : (level, gain)
        Where strokes end, and by what densities inside are multiplied: what `shading` found. Nothing for
        soft ones.

    Returns
    -------
    (rows, columns) float32 array in [0, 1]

    Raises
    ------
    OptionError
    """
    check_choice("edge", edge, EDGES)
    if edge == "soft":
        return sample(size)
    at, gain = ends
    down, across = (-(-many // px) for many, px in zip(elements, size, strict=True))
    wide = down * size[0], across * size[1]
    field = smoothed(sample(wide), repeat, (wide[0] / elements[0], wide[1] / elements[1]))
    inside = beyond(field, at, repeat)
    for least in (0.5, _SEEN):  # and what of the pixels round a crumb is left on its own
        inside[crumbs(inside > least, repeat)] = 0
    inside[holes(inside > 0.5, repeat)] = 1
    if edge == "ink":
        inside *= np.clip(field * gain, 0.0, 1.0)
    if down * across > 1:
        inside = inside.reshape(size[0], down, size[1], across).mean(axis=(1, 3))
    return inside


def fineness(elements: tuple[int, int]) -> int:
    """Px per element at which levels are found and contours drawn: two, for the sake of fine strokes, where
    that is not too many.
    """
    return 2 if max(elements) < _FINE else 1


def shading(
    densities: Iterable[Floats32], edge: str, repeat: str, px_per_element: int
) -> tuple[float, np.float32]:
    """Return the level at which a layer's strokes end, and the factor of the densities inside: with both the
    mean stays what it is, of several cells that of all together. Soft ones do not end, and no density is
    asked for.
    """
    if edge == "soft":
        return 0.0, np.float32(1.0)
    densities = list(densities)
    mass = float(np.mean([density.mean() for density in densities]))
    field = np.stack([smoothed(density, repeat, (px_per_element, px_per_element)) for density in densities])
    at = level(field, mass)
    if edge == "crisp":
        return at, np.float32(1.0)
    at *= _WET
    tone = np.where(field > at, np.clip(field, 0.0, 1.0), 0.0)
    low, high = 1.0, 4.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.minimum(tone * middle, 1.0).mean() < mass else (low, middle)
    return at, np.float32(high)
