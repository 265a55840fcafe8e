"""Repair of strokes: gaps are closed, pinholes filled, crumbs dropped.

Heat does not cross the watershed between two sinks, nor the middle of a source. So strokes that meet there
end a few elements from each other, as if cut, and the middle of a source with many strokes stays pale. A
contour also cuts off the thin tips of twigs, which are left as crumbs. None of this is intended. Densities
are closed by a small disc, which joins strokes nearer than its width, and by an area closing (Vincent 1993).
Crumbs and holes of a print are found in the print itself, at its size.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.motif.symmetry.rules import HEXAGONAL
from toposeam.motif.symmetry.tiling import extend

#: Radius of the disc that closes gaps, as a share of the cell's shorter side; it rounds to 0 on cells of 90
#: elements or fewer.
_GAP_RADIUS = 1 / 180
#: Largest area, as a share of the cell's, of holes that are filled and pieces that are dropped.
MAX_CRUMB = 1 / 1500
#: Footprints of which the disc is composed.
_SQUARE = np.ones((3, 3), bool)
_DIAMOND = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
_HEXAGON = np.array([[1, 1, 0], [1, 1, 1], [0, 1, 1]], bool)
#: Largest value of densities as uint16; a change by 1 is rounding.
_STEPS = 65535


def repair_strokes(density: Floats32, repeat: str, mass: float, kept: int = 0) -> Floats32:
    """Close the gaps and pinholes of a layer's strokes.

    Parameters
    ----------
    density : (h, w) float32 array in [0, 1]
        For hexagonal groups, on the lattice.
    repeat : str
        The rule by which the pattern continues beyond the border.
    mass : float
        Mean of the result, where its bounds allow.
    kept : int
        Number of rows and columns along the border that stay unchanged, as other motifs share them. With any,
        `mass` is not restored.

    Returns
    -------
    (h, w) float32 array in [0, 1]
    """
    from skimage.morphology import area_closing  # takes a while to load

    smallest, hexagonal = _smallest(density.shape), repeat in HEXAGONAL
    reach = round(min(density.shape) * _GAP_RADIUS)
    margin = min(_reach(smallest) + 2 * reach, *density.shape)
    wide = np.pad(density, margin, "wrap") if hexagonal else extend(density, repeat, margin)
    steps = _closed(np.rint(wide * _STEPS).astype(np.uint16), reach, hexagonal=hexagonal)
    # Pieces that reach the end of the margin may be larger: the padding by 0 keeps them open.
    neighbours = _HEXAGON if hexagonal else _DIAMOND
    steps = area_closing(np.pad(steps, 1), smallest + 1, connectivity=neighbours)  # type: ignore[no-untyped-call]
    steps = steps[margin + 1 : -margin - 1, margin + 1 : -margin - 1]
    changed = steps - density * _STEPS > 1
    if kept:
        changed[:kept] = changed[-kept:] = changed[:, :kept] = changed[:, -kept:] = False
    if not changed.any():
        return density
    result: Floats32 = np.where(changed, (steps / _STEPS).astype(np.float32), density)
    if kept:
        return result
    scaled: Floats32 = np.clip(result * np.float32(mass / result.mean(dtype=np.float64)), density.min(), 1)
    return scaled


def find_crumbs(inside: Mask, repeat: str) -> Mask:
    """Mark the pieces of a printed cell that are too small to be intended, with the pixels round them.

    Parameters
    ----------
    inside : (H, W) bool array
        The printed pixels of a whole cell, at any size.
    repeat : str

    Returns
    -------
    (H, W) bool array
    """
    return _small(inside, repeat, _SQUARE)


def find_holes(inside: Mask, repeat: str) -> Mask:
    """Mark the holes of a printed cell that are too small to be intended, with the pixels round them."""
    return _small(~inside, repeat, _DIAMOND)


def _smallest(shape: tuple[int, ...]) -> int:
    return round(math.prod(shape) * MAX_CRUMB)


def _reach(smallest: int) -> int:
    """Return the margin, px, in which pieces of at most that area lie, unless they are thin lines."""
    return 4 * math.isqrt(smallest) + 2


def _small(mask: Mask, repeat: str, neighbours: Mask) -> Mask:
    """Mark the small pieces of a mask that end within the margin, with the pixels round them."""
    smallest = _smallest(mask.shape)
    margin = min(_reach(smallest), *mask.shape)
    labels, count = ndimage.label(extend(mask, repeat, margin), neighbours)
    small = np.bincount(labels.ravel(), minlength=count + 1) <= smallest
    small[0] = False
    for end in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        small[end] = False
    if not small.any():
        return np.zeros(mask.shape, bool)
    wide = ndimage.binary_dilation(small[labels], neighbours)
    return np.asarray(wide[margin:-margin, margin:-margin])


def _closed(steps: npt.NDArray[np.uint16], radius: int, *, hexagonal: bool) -> npt.NDArray[np.uint16]:
    """Close by an approximate disc: by diamonds and squares in turn, on a hexagonal lattice by hexagons."""
    shapes = [_HEXAGON] * 3 if hexagonal else [_DIAMOND, _DIAMOND, _SQUARE]
    footprints = [shapes[k % 3] for k in range(radius)]
    for step in (ndimage.grey_dilation, ndimage.grey_erosion):
        for footprint in footprints:
            steps = step(steps, footprint=footprint, mode="nearest")
    return steps
