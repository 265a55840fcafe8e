"""The last of a line that shows where motifs meet.

A border may be more conspicuous than what lies inside by chance alone, if no stroke or a thick one happens to
lie there. Where it is (`border_visibility` above 1), the strokes along it are widened or thinned a little:
the densities are multiplied by a factor that fades out to both sides, with which the row's print is what the
rows beside it are in the mean.

Motifs that lie beside each other in any order and share no border have one more reason to show it: one may
be darker than the other there, and the step between them is a line. Where it is, the tone of all goes over
into the mean of all towards the border.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Floats32
from toposeam.colours import LUMA
from toposeam.motif.ink.mixing import mix
from toposeam.motif.ink.stroke_edges import beyond, level
from toposeam.motif.motif import Motif, repeat_densities
from toposeam.motif.optimise.hexagonal_lattice import tile_size, to_tile
from toposeam.motif.optimise.layer import THINNEST
from toposeam.motif.recipe.recipe import Recipe
from toposeam.motif.symmetry.borders import line_visibility, reach_of
from toposeam.motif.symmetry.rules import HEXAGONAL, symmetry
from toposeam.motif.symmetry.tiling import period, tile

#: From a motif's densities to about what is printed of them, on its own elements.
Print = Callable[[Floats], Floats32]

#: Factors lie within e^±, and this many halvings find one.
_LARGEST, _HALVINGS = 3.0, 10
#: Of motifs that join, how often rows and columns take turns.
_TURNS = 3
#: Motifs that share no border are evened where it shows more than that in one of this many patterns of 4 × 4.
_SHOWN, _PATTERNS = 0.85, 64
#: Such factors lie within e^±, and fade out at this many times the distance of the rows compared.
_GENTLE, _DEPTH = 0.25, 4
#: Half the width of what is changed, in units of how far off it is compared, in each round.
_WIDTHS = (1.0, 1.0, *(3.0,) * 8)


def calmed(densities: Sequence[Floats32], recipe: Recipe, make: Callable[[list[Floats32]], Motif]) -> Motif:
    """Return the motif that `make` gives, of densities whose borders do not show in print.

    Parameters
    ----------
    densities : sequence of (h, w) float32 array
        Of the layers; for hexagonal groups, on the lattice.
    recipe : Recipe
    make : callable
    """
    motif = make(list(densities))
    if recipe.repeat == "none":
        return motif
    best, planes = motif, _visibilities(motif)
    layers, least = list(densities), planes.max()
    for width in _WIDTHS:
        if least <= 1:
            break
        for axis in np.flatnonzero(planes.max(axis=0) > 1):
            own = planes[:-1, axis] > 1  # what no layer shows by itself all of them change
            for index in np.flatnonzero(own) if own.any() else range(len(layers)):
                layer = recipe.layers[index]
                layers[index] = _level(layers[index], int(axis), layer.mass, layer.edge, recipe.repeat, width)
        motif = make(layers)
        planes = _visibilities(motif)
        if planes.max() < least:
            best, least = motif, planes.max()
    return best


def conspicuous(motif: Motif) -> npt.NDArray[np.float64]:
    """`border_visibility` of rows and of columns, the largest of all inks and of the composite."""
    found: Floats = _visibilities(motif).max(axis=0)
    return found


def _visibilities(motif: Motif) -> Floats:
    """Compute `border_visibility` of rows and columns, for each ink and the composite: (n_L + 1, 2)."""
    layers = repeat_densities(motif, period(motif.repeat))
    rows, columns = motif.densities.shape[1:]
    planes = (*layers, mix(layers, motif.inks, motif.paper) @ LUMA.astype(np.float32))
    return np.array([(line_visibility(one, rows), line_visibility(one.T, columns)) for one in planes])


def _level(density: Floats32, axis: int, mass: float, edge: str, repeat: str, width: float) -> Floats32:
    """Return a density half way to where the print along one border is what it is beside it."""
    bump, before = _bump(density.shape, axis, repeat, width), density.astype(np.float64)
    (balanced,) = _balanced([before], bump, axis, [partial(_print, edge=edge, repeat=repeat)], repeat)
    changed = np.sqrt(balanced * before)
    with_mass: Floats32 = np.clip(changed * (mass / changed.mean()), THINNEST, 1.0).astype(np.float32)
    return with_mass


def _excess(density: Floats, axis: int, printed: Print, repeat: str) -> float:
    """Compute by how much the print is darker along borders than beside them."""
    field = printed(density)
    side = field.shape[axis]
    mean = tile(field, repeat, period(repeat)).mean(axis=1 - axis, dtype=np.float64)
    border = np.arange(0, len(mean), side)
    reach = reach_of(side)
    line = np.roll(mean, 1) + mean
    beside = np.roll(line, reach) + np.roll(line, -reach)
    return float((line / 2 - beside / 4)[border].mean())


def _print(density: Floats, edge: str, repeat: str, at: float | None = None) -> Floats32:
    """About what is printed of a density, on its own elements, with strokes that end at a level, or at that
    of equal mass.
    """
    field = density.astype(np.float32)
    if repeat in HEXAGONAL:
        field = to_tile(field, repeat, tile_size(len(field)))
    if edge == "soft":
        return field
    inside = beyond(field, level(field, float(field.mean())) if at is None else at, repeat)
    return inside if edge == "crisp" else inside * field


def _bump(shape: tuple[int, ...], axis: int, repeat: str, width: float = 1.0) -> Floats:
    """1 on the border in the mean, 0 from where it is compared with on, but for what makes it equal along the
    rule's orbits.
    """
    h, w = shape
    if repeat in HEXAGONAL:
        v, u = np.ogrid[:h, :w]
        place = v / h if axis == 0 else ((2 * u - v) % (2 * w)) / (2 * w)
        side = tile_size(h)[axis]
    else:
        side = shape[axis]
        place = (np.arange(side)[:, np.newaxis] + 0.5) / side
        place = place if axis == 0 else place.T
    away = np.minimum(place, 1 - place) * side
    bump = 0.5 + 0.5 * np.cos(np.pi * np.clip(away / (width * reach_of(side) + 0.5), 0, 1))
    spread = symmetry(repeat, (h, w)).mean(np.broadcast_to(bump, (h, w)).astype(np.float64))
    on_border = np.broadcast_to(away <= away.min(), (h, w))
    return spread / float(spread[on_border].mean())


def calmed_row(
    fields: Sequence[Floats], edges: Sequence[str], repeat: str, shared: int, given: Sequence[int]
) -> list[Floats]:
    """Smooth one layer of motifs that lie beside each other in any order, so that none shows a border in
    print.

    Parameters
    ----------
    fields : sequence of (h, w) float array
        The layer's density in each motif.
    edges : sequence of str
        How its strokes end in each, of `EDGES`.
    repeat : str
        The rule of all.
    shared : int
        Rows and columns along the border that are the same in all motifs, and are left so: one factor serves
        all there, and what is left to do for a motif is done beside them.
    given : sequence of int
        Which motifs were there first: side by side all whose strokes end alike are printed with one level,
        which is taken from these, so that those that come later change nothing.
    """
    row = list(fields)
    for axis in (0, 1) * _TURNS:
        prints = _prints(row, edges, repeat, given)
        on, beside = _bump(row[0].shape, axis, repeat), _beside(row[0].shape, axis, shared)
        each = list(zip(row, prints, strict=True))
        if shared:
            row = _balanced(row, on, axis, prints, repeat)
            each = list(zip(row, prints, strict=True))
            row = [_balanced([one], -beside, axis, [own], repeat)[0] for one, own in each]
            continue
        row = [_balanced([one], on, axis, [own], repeat)[0] for one, own in each]
        tones = _Tones(axis, prints)
        if tones.shown(row, given) > _SHOWN:
            row = tones.evened(row, given)
            each = list(zip(row, prints, strict=True))
            row = [_balanced([one], on, axis, [own], repeat)[0] for one, own in each]
    return row


def _prints(row: list[Floats], edges: Sequence[str], repeat: str, given: Sequence[int]) -> list[Print]:
    """Return the print of every motif of a row."""
    levels = {}
    for edge in set(edges):
        alike = [index for index, kind in enumerate(edges) if kind == edge]
        first = [index for index in alike if index in given] or alike
        whole = np.stack([row[index] for index in first])
        levels[edge] = level(whole, float(whole.mean()))
    return [partial(_print, edge=edge, repeat=repeat, at=levels[edge]) for edge in edges]


class _Tones:
    """Darkness of printed motifs towards the borders across an axis."""

    def __init__(self, axis: int, prints: Sequence[Print]) -> None:
        self._axis, self._prints = axis, prints

    def of(self, density: Floats, index: int) -> Floats:
        """Return the mean of every row, or column, of a motif."""
        mean: Floats = self._prints[index](density).mean(axis=1 - self._axis, dtype=np.float64)
        return mean

    def shown(self, row: list[Floats], given: Sequence[int]) -> float:
        """Compute the visibility of borders, the greatest in some patterns of some motifs."""
        tones = np.stack([self.of(row[index], index) for index in given])
        rng = np.random.default_rng(0)
        grids = rng.integers(len(given), size=(_PATTERNS, 4, 4))
        side = tones.shape[1]
        return max(line_visibility(tones[grid].mean(axis=1).reshape(-1, 1), side) for grid in grids)

    def evened(self, row: list[Floats], given: Sequence[int]) -> list[Floats]:
        """Return densities multiplied by a little, with which all are nearer to the mean tone of some where
        they meet: first where a line is compared with, then on it.
        """
        side = row[0].shape[self._axis]
        reach = reach_of(side)
        tones = np.stack([self.of(row[index], index) for index in given])
        wanted = float(np.concatenate([tones[:, : reach + 1], tones[:, -reach - 1 :]], axis=1).mean())
        result = row
        for place in (np.arange(side), np.arange(side)[::-1]):
            deep = np.clip((place - reach) / ((_DEPTH - 1) * reach), 0, 1)
            for lines, away in (((place == reach) | (place == reach - 1), deep), (place == 0, place / reach)):
                factor = 0.5 + 0.5 * np.cos(np.pi * np.clip(away, 0, 1))
                bump = factor[:, np.newaxis] if self._axis == 0 else factor[np.newaxis]
                result = [self._nearer(one, index, bump, lines, wanted) for index, one in enumerate(result)]
        return result

    def _nearer(
        self, density: Floats, index: int, bump: Floats, lines: npt.NDArray[np.bool_], wanted: float
    ) -> Floats:
        """Return a density multiplied by the power of a bump with which some lines have the tone that is
        wanted.
        """
        return _multiplied(
            [density], bump, _GENTLE, lambda row: self.of(row[0], index)[lines].mean() - wanted
        )[0]


def _balanced(
    row: list[Floats], bump: Floats, axis: int, prints: Sequence[Print], repeat: str
) -> list[Floats]:
    """Return densities multiplied by one factor to the power of a bump, with which the print along the
    borders is that beside them in the mean over all.
    """
    return _multiplied(
        row,
        bump,
        _LARGEST,
        lambda changed: sum(
            _excess(one, axis, own, repeat) for one, own in zip(changed, prints, strict=True)
        ),
    )


def _multiplied(
    row: list[Floats], bump: Floats, largest: float, excess: Callable[[list[Floats]], float]
) -> list[Floats]:
    """Return densities times e to the power of a bump, by a factor within ± `largest` with which an excess,
    which grows with it, is about 0.
    """
    low, high = -largest, largest
    for _ in range(_HALVINGS):
        power = (low + high) / 2
        changed = [np.clip(one * np.exp(power * bump), THINNEST, 1.0) for one in row]
        low, high = (power, high) if excess(changed) < 0 else (low, power)
    return changed


def _beside(shape: tuple[int, ...], axis: int, shared: int) -> Floats:
    """1 on the rows that a border is compared with, 0 on it and on those that are shared."""
    side = shape[axis]
    away = np.minimum(np.arange(side), np.arange(side)[::-1]) + 0.5
    reach = reach_of(side)
    line = np.cos(np.pi / 2 * np.clip((away - 0.5 - reach) / max(reach + 0.5 - shared, 1), -1, 1)) ** 2
    line[away < shared] = 0
    inside = np.zeros(shape)
    inside[shared : shape[0] - shared, shared : shape[1] - shared] = 1
    result: Floats = inside * (line[:, np.newaxis] if axis == 0 else line)
    return result
