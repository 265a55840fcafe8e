"""Different motifs of one size, laid by a grid or at random (Figure 4.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from toposeam.checks import Seed, check_items, check_pair, check_whole, check_whole_array, seed_of
from toposeam.errors import OptionError, Term
from toposeam.motif.ink.printing import MAX_PATTERN, Inked, checked_size
from toposeam.motif.ink.sampling import resample
from toposeam.motif.ink.stroke_edges import EDGES, fineness, print_layer, stroke_ends
from toposeam.motif.motif import Motif

#: Standard deviation, as a share of the cell's side, of the blur that mixes prints with unlike stroke edges.
_EDGE_BLUR = 0.03
#: Largest number of places of a random arrangement.
_MAX_PLACES = 1_000_000


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Arrangement(Inked):
    """Result of :func:`arrange`: many motifs as one cell, which repeats by translation.

    Examples
    --------
    >>> import toposeam as ts
    >>> given = dict(layers=1, repeat="translate", iterations=3, palette="sumi")
    >>> recipes = [ts.motif.random_recipe(16, seed=seed, **given) for seed in (1, 2)]
    >>> ts.motif.arrange(ts.motif.join_motifs(recipes).motifs, (2, 3), seed=0).grid.shape
    (2, 3)
    """

    #: (n_L, H, W) float32 in [0, 1].
    densities: npt.NDArray[np.float32]
    #: (n_L, 3) sRGB in [0, 1].
    inks: npt.NDArray[np.float64]
    #: (3,) sRGB in [0, 1].
    paper: npt.NDArray[np.float64]
    #: (rows, columns) int: index of the motif at each place.
    grid: npt.NDArray[np.intp]
    #: The motifs, by index.
    motifs: tuple[Motif, ...]
    #: The arrangement as a whole repeats by translation.
    repeat: str = "translate"

    @property
    def inking(self) -> str:
        """Kind of the inks, one of `INKINGS`."""
        return self.motifs[0].inking

    @property
    def edges(self) -> tuple[str, ...]:
        """Stroke edges of each layer in print: those of its motifs; "soft" if they differ between motifs, as
        `sampled` has then applied them already.
        """
        return tuple(kinds[0] if len(set(kinds)) == 1 else "soft" for kinds in self._kinds)

    @property
    def _kinds(self) -> list[tuple[str, ...]]:
        """Stroke edges of every motif, for each layer."""
        return list(zip(*(motif.edges for motif in self.motifs), strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inks."""
        return self.motifs[0].names

    @property
    def record(self) -> dict[str, Any]:
        """The grid and the recipes as plain values."""
        recipes = [motif.recipe.to_dict() for motif in self.motifs]
        return {"arrangement": {"grid": self.grid.tolist(), "recipes": recipes}}

    def sampled(self, layer: int, size: tuple[int, int]) -> npt.NDArray[np.float32]:
        """Return one layer's density, smoothly interpolated to (rows, columns).

        If the layer's stroke edges differ between motifs, such as ink wash beside strokes, the result is the
        print: each motif has its own edges, and the prints fade into each other along the borders.
        """
        smooth = partial(resample, self.densities[layer], self.repeat)
        kinds = self._kinds[layer]
        if len(set(kinds)) == 1:
            return smooth(size)
        elements = self.densities.shape[1], self.densities.shape[2]
        result = np.zeros(size, np.float32)
        left = np.ones(size, np.float32)
        for edge in sorted(set(kinds), key=EDGES.index):  # wash fades into strokes, not into nothing
            cells = np.isin(self.grid, [index for index, kind in enumerate(kinds) if kind == edge])
            share = left * np.minimum(2 * _blurred_cells(cells, size), 1)
            result += share * print_layer(smooth, edge, self.repeat, elements, size, self._ends[layer, edge])
            left -= share
        return result

    def resampled(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """Resample by `sampled` at every given size: for layers of unlike edges it returns the print."""
        return (
            super().resampled(size)
            if size is None
            else np.stack([self.sampled(index, checked_size(size)) for index in range(len(self.inks))])
        )

    def ends(self, layer: int) -> tuple[float, np.float32]:
        """Return the stroke ends of all motifs together, each counted once.

        A motif then looks the same wherever and however often it is laid, and strokes meet across borders as
        the optimisation left them.
        """
        return self._ends[check_whole("layer", layer, 0, len(self.inks) - 1), self.edges[layer]]

    @cached_property
    def _ends(self) -> dict[tuple[int, str], tuple[float, np.float32]]:
        """Level and gain of `stroke_ends` for every layer and each of its stroke edges."""
        rows, columns = self.motifs[0].densities.shape[1:]
        fine = fineness((rows, columns))
        found = {}
        for layer, kinds in enumerate(self._kinds):
            for edge in {*kinds, self.edges[layer]}:
                fields = (
                    motif.sampled(layer, (fine * rows, fine * columns))
                    for motif, kind in zip(self.motifs, kinds, strict=True)
                    if kind == edge
                )
                found[layer, edge] = stroke_ends(fields, edge, self.repeat, fine)
        return found

    def __repr__(self) -> str:
        rows, columns = self.grid.shape
        return f"Arrangement({columns} × {rows} places of {len(self.motifs)} motifs)"


def arrange(
    motifs: Sequence[Motif],
    arrangement: tuple[int, int] | npt.ArrayLike,
    *,
    seed: Seed = 0,
    reach: int | None = None,
) -> Arrangement:
    """Return a pattern of different motifs in free arrangement (Figure 4.9).

    Parameters
    ----------
    motifs : sequence of Motif
        Of the same size and inks, such as the motifs of `JoinedMotifs`.
    arrangement : (rows, columns) or (R, C) int array_like
        Number of places, for a random choice of motifs; or the index of the motif at each place.
    seed : int, Generator or None
        Seed of the random choice.
    reach : int, optional
        Largest distance, in the sequence, between random neighbours; unlimited by default.

    Returns
    -------
    Arrangement

    Raises
    ------
    OptionError

    Examples
    --------
    >>> import toposeam as ts
    >>> motifs = [ts.motif(16, seed=seed, repeat="p1", palette="sea", iterations=2) for seed in (1, 2)]
    >>> arrange(motifs, [[0, 1, 1], [1, 0, 0]]).image().shape
    (32, 48, 3)
    """
    motifs = check_items("motifs", motifs, Motif, "a sequence of Motifs")
    if not motifs:
        raise OptionError(
            "there are no motifs to arrange; give at least one",
            kind="count",
            parameter=Term("motifs"),
            count=0,
        )
    first = motifs[0]
    for other in motifs:
        if other.densities.shape != first.densities.shape or not np.array_equal(other.inks, first.inks):
            raise OptionError(
                "the motifs differ in size or inks; give motifs that were joined",
                kind="unlike",
                parameter=Term("motifs"),
            )
    grid = check_whole_array(Term("arrangement", "the arrangement"), arrangement)
    if grid.ndim == 1 and grid.shape == (2,):
        if float(grid[0]) * float(grid[1]) > MAX_PATTERN:
            raise OptionError(
                "the arrangement would have {rows} × {columns} places; ask for fewer motifs",
                kind="too large",
                parameter=Term("arrangement"),
                rows=int(grid[0]),
                columns=int(grid[1]),
            )
        grid = random_arrangement((int(grid[0]), int(grid[1])), len(motifs), seed=seed, reach=reach)
    if grid.ndim != 2 or grid.size == 0:
        raise OptionError(
            "the arrangement must be {allowed}",
            kind="shape",
            parameter=Term("arrangement"),
            value=arrangement,
            allowed="(rows, columns) or a grid of whole numbers, one for each place",
        )
    if grid.min() < 0 or grid.max() >= len(motifs):
        raise OptionError(
            "the arrangement has numbers from {lowest} to {highest}; there are motifs 0 to {last}",
            kind="choice",
            parameter=Term("arrangement"),
            value=arrangement,
            lowest=int(grid.min()),
            highest=int(grid.max()),
            last=len(motifs) - 1,
        )
    if grid.size * first.densities[0].size > MAX_PATTERN:
        raise OptionError(
            "the pattern would have {count} motifs; ask for fewer or smaller ones",
            kind="too large",
            count=grid.size,
        )
    layers = np.concatenate(
        [np.concatenate([motifs[index].densities for index in row], axis=2) for row in grid], axis=1
    )
    return Arrangement(
        densities=layers,
        inks=first.inks,
        paper=first.paper,
        grid=grid.astype(np.intp),
        motifs=tuple(motifs),
    )


def _blurred_cells(cells: npt.NDArray[np.bool_], size: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Enlarge a bool grid of cells to (rows, columns) px, blurred across the cells' borders."""
    places = [np.arange(px) * many // px for px, many in zip(size, cells.shape, strict=True)]
    field = cells[np.ix_(*places)].astype(np.float32)
    for axis, (px, many) in enumerate(zip(size, cells.shape, strict=True)):
        field = gaussian_filter1d(field, _EDGE_BLUR * px / many, axis=axis, mode="wrap")
    return field


def random_arrangement(
    counts: tuple[int, int], motifs: int, *, seed: Seed = 0, reach: int | None = None
) -> npt.NDArray[np.intp]:
    """Return indices of motifs at random, neighbours at most `reach` apart.

    Parameters
    ----------
    counts : (rows, columns)
    motifs : int
        Number of motifs to choose from.
    seed : int, Generator or None
    reach : int, optional
        Unlimited by default.

    Returns
    -------
    (rows, columns) int array

    Raises
    ------
    OptionError

    Examples
    --------
    >>> random_arrangement((2, 3), 2, seed=1).shape
    (2, 3)
    """
    counts = rows, columns = check_pair("counts", counts, 1)
    check_whole("motifs", motifs, 1, 2**62)
    if rows * columns > _MAX_PLACES:
        raise OptionError(
            "the arrangement would have {rows} × {columns} places; ask for at most {most}",
            kind="too large",
            parameter=Term("counts"),
            rows=rows,
            columns=columns,
            most=_MAX_PLACES,
        )
    if reach is not None:
        check_whole("reach", reach, 1)
    rng = np.random.default_rng(seed_of(seed))
    grid = np.zeros(counts, np.intp)
    far = motifs if reach is None else reach
    for y in range(rows):
        for x in range(columns):
            # The left and the upper neighbour both lie within reach of the one diagonally above, so there is
            # always a choice.
            beside = [int(grid[y, x - 1])] if x else []
            beside += [int(grid[y - 1, x])] if y else []
            least = max([0, *(other - far for other in beside)])
            most = min([motifs - 1, *(other + far for other in beside)])
            grid[y, x] = least + rng.choice(most - least + 1)
    return grid
