"""The motif: layers of ink on one cell, and the rule by which it repeats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.errors import OptionError
from toposeam.motif.arrange import tile
from toposeam.motif.hexagonal import to_tile
from toposeam.motif.layer import Step
from toposeam.motif.mixing import mix
from toposeam.motif.recipe import Recipe
from toposeam.motif.sampling import resample

#: Patterns with more pixels are refused.
MAX_PATTERN = 400_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motif:
    """What :func:`generate_motif` returns."""

    #: (n_L, H, W) float32 in [0, 1]: one layer of ink each, on the cell that `repeat` arranges. Hexagonal groups are arranged by the
    #: rectangle of 1 × √3 cells.
    densities: npt.NDArray[np.float32]
    #: (n_L, 3) sRGB in [0, 1].
    inks: npt.NDArray[np.float64]
    #: (3,) sRGB in [0, 1].
    paper: npt.NDArray[np.float64]
    #: The rule it repeats by, one of `REPEATS`.
    repeat: str
    #: Makes it again.
    recipe: Recipe
    #: Per layer, what every iteration did.
    history: tuple[tuple[Step, ...], ...]
    #: (n_L, n, n) float32: for hexagonal groups, the densities of the lattice's nodes.
    lattice: npt.NDArray[np.float32] | None = None

    def resampled(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """The densities on another number of elements, (n_L, H', W'), smoothly interpolated."""
        if size is None or size == self.densities.shape[1:]:
            return self.densities
        if min(size) < 1 or size[0] * size[1] > MAX_PATTERN:
            raise OptionError(f"size is {size[0]} × {size[1]}; give rows and columns of at least 1, at most {MAX_PATTERN:,} pixels in all")
        if self.lattice is not None:
            return np.stack([to_tile(layer, self.repeat, size) for layer in self.lattice])
        return np.stack([resample(layer, self.repeat, size) for layer in self.densities])

    def image(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """The motif in colour.

        Parameters
        ----------
        size : (rows, columns), optional
            Any; the cell's own without it.

        Returns
        -------
        (H, W, 3) float32 array in [0, 1]
        """
        return mix(self.resampled(size), self.inks, self.paper)


def repeat_densities(motif: Motif, counts: tuple[int, int] = (3, 3), size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
    """The layers of a pattern: rows × columns motifs by the motif's own rule.

    Parameters
    ----------
    motif : Motif
    counts : (rows, columns)
    size : (rows, columns), optional
        Size of one motif.

    Returns
    -------
    (n_L, H', W') float32 array

    Raises
    ------
    OptionError
        When there is nothing to arrange, or too much.
    """
    rows, columns = counts
    if rows < 1 or columns < 1:
        raise OptionError(f"{rows} × {columns} motifs were asked for; ask for at least 1 × 1")
    cell = size if size is not None else motif.densities.shape[1:]
    if rows * columns * cell[0] * cell[1] > MAX_PATTERN:
        raise OptionError(f"the pattern would have {rows * cell[0]:,} × {columns * cell[1]:,} pixels; ask for fewer or smaller motifs")
    return tile(motif.resampled(size), motif.repeat, (rows, columns))


def repeat(motif: Motif, counts: tuple[int, int] = (3, 3), size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
    """The pattern in colour, (H', W', 3) float32; parameters as in :func:`repeat_densities`."""
    return mix(repeat_densities(motif, counts, size), motif.inks, motif.paper)
