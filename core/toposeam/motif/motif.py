"""The motif: layers of ink on one cell, and the rule by which it repeats."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_kind, check_pair
from toposeam.errors import OptionError
from toposeam.motif.ink.mixing import mix
from toposeam.motif.ink.palettes import Palette
from toposeam.motif.ink.printing import MAX_PATTERN, Inked
from toposeam.motif.ink.sampling import resample
from toposeam.motif.optimise.hexagonal_lattice import to_tile
from toposeam.motif.optimise.layer import Step
from toposeam.motif.recipe.recipe import Recipe
from toposeam.motif.symmetry.tiling import tile
from toposeam.sentence import counted


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Motif(Inked):
    """Result of :func:`toposeam.motif`.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, layers=2, repeat="p4m", seed=1, iterations=3)
    >>> motif.densities.shape, motif.repeat
    ((2, 16, 16), 'p4m')
    """

    #: (n_L, H, W) float32 in [0, 1]: density of each layer of ink on the cell that `repeat` arranges; for
    #: hexagonal groups, on a rectangle of 1 × √3 cells.
    densities: npt.NDArray[np.float32]
    #: (n_L, 3) sRGB in [0, 1].
    inks: npt.NDArray[np.float64]
    #: (3,) sRGB in [0, 1].
    paper: npt.NDArray[np.float64]
    #: The rule by which the motif repeats, one of `REPEATS`.
    repeat: str
    #: The recipe, which makes the motif again.
    recipe: Recipe
    #: The iterations of each layer.
    history: tuple[tuple[Step, ...], ...]
    #: (n_L, n, n) float32: for hexagonal groups, the densities of the lattice's nodes.
    lattice: npt.NDArray[np.float32] | None = None

    @property
    def inking(self) -> str:
        """Kind of the inks, one of `INKINGS`."""
        return self.recipe.inking

    @property
    def edges(self) -> tuple[str, ...]:
        """Stroke edges of each layer in print, of `EDGES`."""
        return tuple(layer.edge for layer in self.recipe.layers)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inks."""
        return tuple(layer.name or f"ink {number}" for number, layer in enumerate(self.recipe.layers, 1))

    @property
    def record(self) -> dict[str, Any]:
        """The recipe as plain values."""
        return {"recipe": self.recipe.to_dict()}

    def sampled(self, layer: int, size: tuple[int, int]) -> npt.NDArray[np.float32]:
        """Return one layer's density, smoothly interpolated to (rows, columns)."""
        if self.lattice is not None:
            return to_tile(self.lattice[layer], self.repeat, size)
        return resample(self.densities[layer], self.repeat, size)

    def recoloured(self, colours: Palette) -> Motif:
        """Return the motif in other colours, with the same densities: a colourway.

        Parameters
        ----------
        colours : Palette
            With as many inks as there are, or more.

        Raises
        ------
        OptionError
        """
        check_kind("colours", colours, Palette, "a Palette")
        count = len(self.inks)
        colours.check_layers(count)
        layers = [
            replace(layer, ink=tuple(ink))
            for layer, ink in zip(self.recipe.layers, colours.inks[:count], strict=True)
        ]
        recipe = replace(self.recipe, layers=tuple(layers), paper=tuple(colours.paper))
        return replace(self, inks=colours.inks[:count], paper=colours.paper, recipe=recipe)

    def _own_coverage(self) -> npt.NDArray[np.float32]:
        """Return a copy of the cached coverage at the motif's own size."""
        return self._own.copy()

    @cached_property
    def _own(self) -> npt.NDArray[np.float32]:
        return self._covered((self.densities.shape[1], self.densities.shape[2]))

    def __repr__(self) -> str:
        rows, columns = self.densities.shape[1:]
        inks, size = counted(len(self.inks), "ink"), f"{columns} × {rows} elements"
        return f"Motif({inks} on {size}, repeat={self.repeat!r}, seed={self.recipe.seed})"


def repeat_densities(
    motif: Motif, counts: tuple[int, int] = (3, 3), *, size: tuple[int, int] | None = None
) -> npt.NDArray[np.float32]:
    """Return the printed layers of a pattern of rows × columns motifs, arranged by the motif's rule.

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
        When a count is below 1, or the pattern has more pixels than `MAX_PATTERN`.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, layers=2, repeat="p4m", seed=1, iterations=3)
    >>> ts.motif.repeat_densities(motif, (2, 3)).shape
    (2, 32, 48)
    """
    pair = _counts(motif, counts, size)
    return tile(motif.coverage(size), motif.repeat, pair)


def _counts(motif: Motif, counts: Any, size: Any) -> tuple[int, int]:
    """Check and return the rows and columns of a pattern."""
    rows, columns = check_pair("counts", counts, 1)
    check_kind("motif", motif, Inked, "a Motif")
    cell = check_pair("size", size, 1) if size is not None else motif.densities.shape[1:]
    if rows * columns * cell[0] * cell[1] > MAX_PATTERN:
        raise OptionError(
            "the pattern would have {height:,} × {width:,} pixels; ask for fewer or smaller motifs",
            kind="too large",
            height=rows * cell[0],
            width=columns * cell[1],
        )
    return rows, columns


def repeat(
    motif: Motif, counts: tuple[int, int] = (3, 3), *, size: tuple[int, int] | None = None
) -> npt.NDArray[np.float32]:
    """Return the pattern in colour, (H', W', 3) float32 in [0, 1]; parameters as in :func:`repeat_densities`.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, repeat="p4m", seed=1, iterations=3)
    >>> ts.repeat(motif, (2, 3)).shape
    (32, 48, 3)
    """
    pair = _counts(motif, counts, size)
    image = mix(motif.coverage(size), motif.inks, motif.paper, motif.inking)
    return np.ascontiguousarray(np.moveaxis(tile(np.moveaxis(image, -1, 0), motif.repeat, pair), 0, -1))
