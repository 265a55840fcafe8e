"""Smoothing of the borders of motifs after optimisation, so that no line shows where they meet.

A border may be more conspicuous than lines inside by chance, if no stroke or a thick one lies there. Where it
is (`border_visibility` above 1), the strokes along it are widened or thinned a little: densities are
multiplied by a factor that fades out to both sides. The factor is chosen so that the mean of the printed rows
at the border equals that of the rows beside it. Where that does not do, those rows change as well, the other
way.

Motifs that share no border and lie beside each other in any order may also differ in darkness there, and the
step shows as a line. Where it does, the tone of each motif fades into the mean tone of all towards the
border.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Floats32
from toposeam.colours import LUMA
from toposeam.motif.ink.mixing import mix
from toposeam.motif.ink.stroke_edges import coverage_beyond, level
from toposeam.motif.motif import Motif
from toposeam.motif.optimise.conduction import MIN_DENSITY
from toposeam.motif.optimise.hexagonal_lattice import tile_size, to_tile
from toposeam.motif.recipe.recipe import LayerRecipe, Recipe
from toposeam.motif.symmetry.borders import compared_distance, line_visibility
from toposeam.motif.symmetry.rules import HEXAGONAL, symmetry
from toposeam.motif.symmetry.tiling import period, tile

#: Maps a motif's density to its approximate print on the same elements.
Print = Callable[[Floats], Floats32]

#: Largest logarithm of a factor on strokes along a border, and bisections that find one.
_MAX_LOG_FACTOR, _BISECTIONS = 3.0, 10
#: Passes over rows and columns in turn, for motifs that join.
_PASSES = 3
#: Tones are evened out if a border's visibility exceeds this in one of the trial patterns of 4 × 4 motifs.
_MAX_TONE_VISIBILITY, _TRIAL_PATTERNS = 0.85, 64
#: Largest logarithm of a factor on tones, small so that motifs keep their character.
_MAX_LOG_TONE = 0.25
#: Depth at which factors on tones have faded out, in units of `compared_distance`.
_TONE_DEPTH = 4
#: Half the width of the changed band in wash that joins, in units of `compared_distance`.
_WASH_WIDTH = 4.0
#: Half the width of the changed band in each round, in units of `compared_distance`: narrow first, then wide.
#: The second number is the change, the other way, of the rows that a border is compared with, as its share:
#: where nothing lies on a border, no factor on it helps.
_ROUNDS = (*((1.0, 0.0),) * 2, *((3.0, 0.0),) * 8, *((1.0, 1.0),) * 6)


def smooth_borders(
    densities: Sequence[Floats32], recipe: Recipe, make: Callable[[list[Floats32]], Motif]
) -> Motif:
    """Smooth the borders of a motif's layers and return the motif whose borders show least.

    Parameters
    ----------
    densities : sequence of (h, w) float32 array
        Density of each layer; for hexagonal groups, on the lattice.
    recipe : Recipe
    make : callable
        Makes the motif of densities.
    """
    motif = make(list(densities))
    if recipe.repeat == "none" or recipe.layers[0].style == "thesis" or recipe.outline:
        return motif
    prints = [_laid(motif, index) for index in range(len(densities))]
    best, planes = motif, _visibilities(motif, prints)
    layers, least = list(densities), planes.max()
    for width, beside in _ROUNDS:
        if least <= 1:
            break
        changed = set[int]()
        for axis in np.flatnonzero(planes.max(axis=0) > 1):
            own = planes[:-1, axis] > 1  # if no layer shows it alone, change all
            for index in np.flatnonzero(own) if own.any() else range(len(layers)):
                layer = recipe.layers[index]
                changed.add(int(index))
                layers[index] = _evened_border(layers[index], int(axis), layer, recipe.repeat, width, beside)
        motif = make(layers)
        for index in changed:
            prints[index] = _laid(motif, index)
        planes = _visibilities(motif, prints)
        if planes.max() < least:
            best, least = motif, planes.max()
    return best


def border_visibilities(motif: Motif) -> npt.NDArray[np.float64]:
    """Compute the largest `border_visibility` of all inks and the composite, for rows and columns: (2,)."""
    prints = [_laid(motif, index) for index in range(len(motif.inks))]
    found: Floats = _visibilities(motif, prints).max(axis=0)
    return found


def _laid(motif: Motif, layer: int) -> Floats32:
    """Return one layer's print on the cells after which the pattern repeats by translation."""
    return tile(motif.coverage_of(layer), motif.repeat, period(motif.repeat))


def _visibilities(motif: Motif, prints: Sequence[Floats32]) -> Floats:
    """Compute `border_visibility` of rows and columns, for each ink and the composite: (n_L + 1, 2)."""
    rows, columns = motif.densities.shape[1:]
    planes = (*prints, mix(np.stack(prints), motif.inks, motif.paper, motif.inking) @ LUMA.astype(np.float32))
    return np.array([(line_visibility(one, rows), line_visibility(one.T, columns)) for one in planes])


def _evened_border(
    density: Floats32, axis: int, layer: LayerRecipe, repeat: str, width: float, beside: float
) -> Floats32:
    """Move a density half way towards one whose print is equal along a border and beside it."""
    bump = border_weight(density.shape, axis, repeat, width, beside)
    before = density.astype(np.float64)
    (balanced,) = _balance([before], bump, axis, [partial(_print, edge=layer.edge, repeat=repeat)], repeat)
    changed = np.sqrt(balanced * before)
    scaled: Floats32 = np.clip(changed * (layer.mass / changed.mean()), MIN_DENSITY, 1.0).astype(np.float32)
    return scaled


def _excess(density: Floats, axis: int, printed: Print, repeat: str) -> float:
    """Compute the mean darkness of the print along borders minus that beside them."""
    field = printed(density)
    side = field.shape[axis]
    mean = tile(field, repeat, period(repeat)).mean(axis=1 - axis, dtype=np.float64)
    border = np.arange(0, len(mean), side)
    reach = compared_distance(side)
    line = np.roll(mean, 1) + mean
    beside = np.roll(line, reach) + np.roll(line, -reach)
    return float((line / 2 - beside / 4)[border].mean())


def _print(density: Floats, edge: str, repeat: str, at: float | None = None) -> Floats32:
    """Compute the approximate print of a density on its own elements.

    Strokes end at the level `at`, by default that of equal mass.
    """
    field = density.astype(np.float32)
    if repeat in HEXAGONAL:
        field = to_tile(field, repeat, tile_size(len(field)))
    if edge == "soft":
        return field
    inside = coverage_beyond(field, level(field, float(field.mean())) if at is None else at, repeat)
    return inside if edge == "crisp" else inside * field


def border_weight(
    shape: tuple[int, ...], axis: int, repeat: str, width: float = 1.0, beside: float = 0.0
) -> Floats:
    """Return a weight that is 1 in the mean on the border and falls to 0 at the rows it is compared with.

    On those it is minus `beside`. The weight is averaged over the rule's orbits.
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
    reach = compared_distance(side)

    def bump(distance: Floats) -> Floats:
        found: Floats = 0.5 + 0.5 * np.cos(np.pi * np.clip(distance / (width * reach + 0.5), 0, 1))
        return found

    weight = bump(away) - beside * bump(np.abs(away - reach)) if beside else bump(away)
    spread = symmetry(repeat, (h, w)).mean(np.broadcast_to(weight, (h, w)).astype(np.float64))
    on_border = np.broadcast_to(away <= away.min(), (h, w))
    return spread / float(spread[on_border].mean())


def smooth_row_borders(
    fields: Sequence[Floats], edges: Sequence[str], repeat: str, shared: int, given: Sequence[int]
) -> list[Floats]:
    """Smooth the borders of one layer of motifs that lie beside each other in any order.

    Parameters
    ----------
    fields : sequence of (h, w) float array
        The layer's density in each motif.
    edges : sequence of str
        Stroke edges of the layer in each motif, of `EDGES`.
    repeat : str
        The rule by which all motifs repeat.
    shared : int
        Number of rows and columns along the border that are equal in all motifs. They stay equal: all motifs
        have the same factor there, and further factors of one motif lie beside them.
    given : sequence of int
        Indices of the motifs of the first stage. All motifs of the same edges are printed with one level,
        which is taken from these motifs, so that motifs of later stages do not change it.
    """
    row = list(fields)
    for axis in (0, 1) * _PASSES:
        prints = _prints(row, edges, repeat, given)
        on, beside = border_weight(row[0].shape, axis, repeat), beside_weight(row[0].shape, axis, shared)
        each = list(zip(row, prints, strict=True))
        if shared:
            row = _balance(row, on, axis, prints, repeat)
            each = list(zip(row, prints, strict=True))
            row = [_balance([one], -beside, axis, [own], repeat)[0] for one, own in each]
            continue
        row = [_balance([one], on, axis, [own], repeat)[0] for one, own in each]
        tones = _Tones(axis, prints, repeat)
        if tones.visibility(row, given) > _MAX_TONE_VISIBILITY:
            row = tones.even_out(row, given)
            each = list(zip(row, prints, strict=True))
            row = [_balance([one], on, axis, [own], repeat)[0] for one, own in each]
    return row


def smooth_wash_borders(fields: Sequence[Floats], repeat: str) -> list[Floats]:
    """Smooth the borders of one layer of wash that has faded into one mean in all motifs.

    All have the same factor, over a wide band, so that it makes no line of its own.
    """
    row = list(fields)
    for axis in (0, 1):
        wide = border_weight(row[0].shape, axis, repeat, _WASH_WIDTH)
        prints = [partial(_print, edge="soft", repeat=repeat)] * len(row)
        evened = _balance(row, wide, axis, prints, repeat, _MAX_LOG_TONE)
        # The rows beside the border change with it, so that the factor may not help.
        before, after = (
            abs(sum(_excess(one, axis, own, repeat) for one, own in zip(tried, prints, strict=True)))
            for tried in (row, evened)
        )
        row = evened if after < before else row
    return row


def _prints(row: list[Floats], edges: Sequence[str], repeat: str, given: Sequence[int]) -> list[Print]:
    """Return the function that prints each motif of a row."""
    levels = {}
    for edge in set(edges):
        alike = [index for index, kind in enumerate(edges) if kind == edge]
        first = [index for index in alike if index in given] or alike
        whole = np.stack([row[index] for index in first])
        levels[edge] = level(whole, float(whole.mean()))
    return [partial(_print, edge=edge, repeat=repeat, at=levels[edge]) for edge in edges]


class _Tones:
    """Darkness of printed motifs towards the borders across an axis."""

    def __init__(self, axis: int, prints: Sequence[Print], repeat: str) -> None:
        self._axis, self._prints, self._turning = axis, prints, repeat == "rotate"

    def of(self, density: Floats, index: int) -> Floats:
        """Return the mean of every row, or column, of a motif."""
        mean: Floats = self._prints[index](density).mean(axis=1 - self._axis, dtype=np.float64)
        return mean

    def visibility(self, row: list[Floats], given: Sequence[int]) -> float:
        """Compute the largest visibility of borders in random patterns of the given motifs."""
        tones = np.stack([self.of(row[index], index) for index in given])
        rng = np.random.default_rng(0)
        grids = rng.integers(len(given), size=(_TRIAL_PATTERNS, 4, 4))
        side = tones.shape[1]
        turned = np.zeros((4, 4, 1), bool)
        if self._turning:  # every second motif
            turned = np.add.outer(np.arange(4), np.arange(4))[..., np.newaxis] % 2 == 1
        laid = (np.where(turned, tones[grid][..., ::-1], tones[grid]) for grid in grids)
        return max(line_visibility(each.mean(axis=1).reshape(-1, 1), side) for each in laid)

    def even_out(self, row: list[Floats], given: Sequence[int]) -> list[Floats]:
        """Move the tones of all motifs at their borders towards the mean tone of the given ones.

        This is done first for the rows that the border is compared with, then for the border itself.
        """
        side = row[0].shape[self._axis]
        reach = compared_distance(side)
        tones = np.stack([self.of(row[index], index) for index in given])
        wanted = float(np.concatenate([tones[:, : reach + 1], tones[:, -reach - 1 :]], axis=1).mean())
        result = row
        for place in (np.arange(side), np.arange(side)[::-1]):
            deep = np.clip((place - reach) / ((_TONE_DEPTH - 1) * reach), 0, 1)
            for lines, away in (((place == reach) | (place == reach - 1), deep), (place == 0, place / reach)):
                factor = 0.5 + 0.5 * np.cos(np.pi * np.clip(away, 0, 1))
                bump = factor[:, np.newaxis] if self._axis == 0 else factor[np.newaxis]
                result = [self._nearer(one, index, bump, lines, wanted) for index, one in enumerate(result)]
        return result

    def _nearer(
        self, density: Floats, index: int, bump: Floats, lines: npt.NDArray[np.bool_], wanted: float
    ) -> Floats:
        """Return a density times e to a multiple of a weight, so that some lines have the wanted tone."""
        return _scale_until_even(
            [density], bump, _MAX_LOG_TONE, lambda row: self.of(row[0], index)[lines].mean() - wanted
        )[0]


def _balance(
    row: list[Floats],
    bump: Floats,
    axis: int,
    prints: Sequence[Print],
    repeat: str,
    largest: float = _MAX_LOG_FACTOR,
) -> list[Floats]:
    """Return densities times e to a common multiple of a weight, so that the mean print of all is equal along
    the borders and beside them.
    """
    return _scale_until_even(
        row,
        bump,
        largest,
        lambda changed: sum(
            _excess(one, axis, own, repeat) for one, own in zip(changed, prints, strict=True)
        ),
    )


def _scale_until_even(
    row: list[Floats], bump: Floats, largest: float, excess: Callable[[list[Floats]], float]
) -> list[Floats]:
    """Return densities times exp(s · `bump`), with s within ± `largest` such that `excess` is about 0.

    `excess` must grow with s.
    """
    low, high = -largest, largest
    for _ in range(_BISECTIONS):
        power = (low + high) / 2
        changed = [np.clip(one * np.exp(power * bump), MIN_DENSITY, 1.0) for one in row]
        low, high = (power, high) if excess(changed) < 0 else (low, power)
    return changed


def beside_weight(shape: tuple[int, ...], axis: int, shared: int) -> Floats:
    """Return a weight that is 1 on the rows that a border is compared with, and 0 on shared rows."""
    side = shape[axis]
    away = np.minimum(np.arange(side), np.arange(side)[::-1]) + 0.5
    reach = compared_distance(side)
    line = np.cos(np.pi / 2 * np.clip((away - 0.5 - reach) / max(reach + 0.5 - shared, 1), -1, 1)) ** 2
    line[away < shared] = 0
    inside = np.zeros(shape)
    inside[shared : shape[0] - shared, shared : shape[1] - shared] = 1
    result: Floats = inside * (line[:, np.newaxis] if axis == 0 else line)
    return result
