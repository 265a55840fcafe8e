r"""Edges of strokes in print, where the optimised density lies between paper and ink.

An optimised density is nearly 0 or 1, except in a haze a few elements wide round every stroke. At print size
the interpolated haze is a blur. A contour is sharp at any size: the line where the density, smoothed by a
quarter of an element, crosses a level t. The level is chosen so that the share of the area above it equals
the mean density; a stroke is then as wide as its mass allows. Pieces and holes that are too small to be
intended are left out (:mod:`toposeam.motif.ink.stroke_repair`).

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
from toposeam.motif.ink.stroke_repair import find_crumbs, find_holes
from toposeam.motif.symmetry.tiling import extend

#: Stroke edges: the unchanged haze; a line at the level of equal mass; or a line at a lower level, inside of
#: which the ink shades off.
EDGES = ("soft", "crisp", "ink")
#: Standard deviation of the blur before contours are taken, in elements: it removes stairs from hard edges.
SMOOTHING = 0.25
#: Least coverage of a pixel that is visible as ink.
_MIN_VISIBLE = 0.1
#: Level at which strokes of edge "ink" end, as a share of the level of equal mass.
_INK_LEVEL = 0.5
#: Least longer side, in elements, of cells whose contours are taken at one px per element; smaller cells take
#: two.
_FINE_SIDE = 512
#: Largest number of px that are worked on at once, in strips of rows, to bound memory.
_STRIP_PX = 8_000_000


def level(field: npt.NDArray[np.floating], mass: float) -> float:
    """Return the level above which the share `mass` of a field's elements lies.

    Examples
    --------
    >>> level(np.linspace(0, 1, 101), 0.3)
    0.7
    """
    return round(float(np.quantile(field, 1.0 - mass)), 6)


def smooth_for_contours(field: Floats32, repeat: str, px_per_element: tuple[float, float]) -> Floats32:
    """Blur a density for its contours, with the pattern's neighbours beyond its border."""
    sigma = [SMOOTHING * px for px in px_per_element]
    margin = int(np.ceil(4 * max(sigma)))
    wide = extend(field, repeat, margin)
    blurred: Floats32 = ndimage.gaussian_filter(wide, sigma, mode="nearest")
    return blurred[margin : margin + field.shape[0], margin : margin + field.shape[1]]


def coverage_beyond(field: Floats32, at: float, repeat: str) -> Floats32:
    """Compute the share of each pixel's area in which a field exceeds a level, in [0, 1]."""
    result = np.empty(field.shape, np.float32)
    wide = extend(field, repeat, 1)
    rows = max(1, _STRIP_PX // wide.shape[1])
    for start in range(0, len(field), rows):
        part = wide[start : start + rows + 2]
        slope = np.abs(part[2:, 1:-1] - part[:-2, 1:-1]) + np.abs(part[1:-1, 2:] - part[1:-1, :-2])
        share = (part[1:-1, 1:-1] - np.float32(at)) / np.maximum(0.5 * slope, 1e-6) + 0.5
        np.clip(share, 0.0, 1.0, out=result[start : start + rows])
    return result


def print_layer(
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
        Returns the density interpolated to (rows, columns).
    edge : str
        One of `EDGES`.
    repeat : str
        The rule by which the pattern continues beyond the border.
    elements : (rows, columns)
        Size of the optimised density.
    size : (rows, columns)
        Size of the print, px. If smaller than `elements`, the print is made larger and averaged.
    ends : (level, gain)
        Level at which strokes end and factor on densities inside, of `stroke_ends`; not used for "soft".

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
    field = smooth_for_contours(sample(wide), repeat, (wide[0] / elements[0], wide[1] / elements[1]))
    inside = coverage_beyond(field, at, repeat)
    for least in (0.5, _MIN_VISIBLE):  # then faint rests round a crumb
        inside[find_crumbs(inside > least, repeat)] = 0
    inside[find_holes(inside > 0.5, repeat)] = 1
    if edge == "ink":
        inside *= np.clip(field * gain, 0.0, 1.0)
    if down * across > 1:
        inside = inside.reshape(size[0], down, size[1], across).mean(axis=(1, 3))
    return inside


def fineness(elements: tuple[int, int]) -> int:
    """Return the px per element at which contours are drawn: 2 on small cells, for fine strokes, else 1."""
    return 2 if max(elements) < _FINE_SIDE else 1


def stroke_ends(
    densities: Iterable[Floats32], edge: str, repeat: str, px_per_element: int
) -> tuple[float, np.float32]:
    """Find the level at which a layer's strokes end, and the factor on densities inside.

    With both the print keeps the mean of the densities, taken over all given cells. For edge "soft" the level
    is 0 and the factor 1, and `densities` is not read.
    """
    if edge == "soft":
        return 0.0, np.float32(1.0)
    densities = list(densities)
    mass = float(np.mean([density.mean() for density in densities]))
    field = np.stack(
        [smooth_for_contours(density, repeat, (px_per_element, px_per_element)) for density in densities]
    )
    at = level(field, mass)
    if edge == "crisp":
        return at, np.float32(1.0)
    at *= _INK_LEVEL
    tone = np.where(field > at, np.clip(field, 0.0, 1.0), 0.0)
    low, high = 1.0, 4.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.minimum(tone * middle, 1.0).mean() < mass else (low, middle)
    return at, np.float32(high)
