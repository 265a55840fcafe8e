r"""Different motifs that join: optimised together with the compound motif (thesis 4.10, 4.11), and by stages
(Figure 4.8).

Two motifs A and B, each periodic, minimise

.. math:: (1 - w)\,(f(\rho^A) + f(\rho^B)) + w\,f(\rho^{AB})

with a mass bound each, f being the thermal compliance. The compound motif AB has them side by side and
alternating in both directions, so that every border of one meets one of the other. Of more than two motifs,
every pair is a compound. By the rule "rotate" the second motif is turned by 180° in it.

*Stages.* A further stage fixes the motifs there are, and generates new ones between neighbours. A new motif
has the sources and sinks of both neighbours, in proportion; it starts as a blend of both, and forms compounds
with both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress, pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.checks import check_function, check_items, check_kind, check_range, check_whole
from toposeam.display import to_png
from toposeam.errors import OptionError, Term
from toposeam.motif.arrangement import arrange
from toposeam.motif.border_smoothing import (
    beside_weight,
    border_weight,
    smooth_row_borders,
    smooth_wash_borders,
)
from toposeam.motif.generate import MAX_MEGAPIXELS, check_work, make_motif
from toposeam.motif.ink.stroke_repair import repair_strokes
from toposeam.motif.motif import Motif
from toposeam.motif.optimise.compound import JoinOptions, Member, generate_row
from toposeam.motif.optimise.conduction import MIN_DENSITY
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe
from toposeam.motif.symmetry.borders import (
    BESIDE_STROKES,
    border_visibility,
    edge_visibility,
    fade_to_mean,
    line_visibility,
    restore_mass,
)
from toposeam.motif.symmetry.rules import GENERATORS, symmetry
from toposeam.motif.symmetry.tiling import copy_at

#: Rules by which cells lie side by side unchanged, or every second one turned, so that other cells may take
#: their places.
JOINABLE = ("translate", "rotate", *GENERATORS)
#: Visibility of borders up to which nothing is done about them, and the number of random patterns in which it
#: is measured.
_EVEN_ENOUGH, _LAID = 0.85, 8
#: Half the widths of the band along a border that is changed, as `border_weight` takes them, and the
#: logarithms of the factors that are tried on it.
_TRIED_WIDTHS = (4.0, 2.0)
_TRIED_POWERS = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
#: Most motifs of a row, new ones included.
_MOST_MOTIFS = 100
#: Default width of the border that motifs share, as a share of the cell's shorter side.
_SHARED_BORDER = 0.03


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class JoinedMotifs:
    """Result of :func:`join_motifs`: a row of motifs from the first given one to the last.

    Examples
    --------
    >>> import toposeam as ts
    >>> given = dict(layers=1, repeat="translate", iterations=3, palette="sumi")
    >>> recipes = [ts.motif.random_recipe(16, seed=seed, **given) for seed in (1, 2)]
    >>> len(ts.motif.join_motifs(recipes).motifs)
    2
    """

    #: The motifs in the order of the row. Joining their recipes again makes the same bytes.
    motifs: tuple[Motif, ...]
    #: The stage in which each motif was made, from 1.
    stages: tuple[int, ...]
    #: Weight w of the compound motifs.
    weight: float

    def at_stage(self, stage: int) -> tuple[Motif, ...]:
        """Return the row as it was after a stage."""
        return tuple(motif for motif, made in zip(self.motifs, self.stages, strict=True) if made <= stage)

    def mismatch(self, stage: int | None = None) -> float:
        """Return the mean border mismatch of neighbours in the row after a stage, by default the last one."""
        row = self.at_stage(max(self.stages) if stage is None else stage)
        return float(np.mean([border_mismatch(a, b) for a, b in pairwise(row)]))

    def visibility(self) -> float:
        """Compute the :func:`border_visibility` of a random pattern of all motifs."""
        laid = arrange(self.motifs, (4, 4), seed=0)
        return border_visibility(laid.image(), self.motifs[0].densities.shape[1:])

    def __repr__(self) -> str:
        return f"JoinedMotifs({len(self.motifs)} motifs of {max(self.stages)} stages, weight={self.weight:g})"

    def to_svg(self, path: str | Path | None = None) -> str:
        """Return the row as an SVG document; as a file too if a path is given.

        Parameters
        ----------
        path : str or Path, optional
            Written whole or not at all.

        Returns
        -------
        str

        Raises
        ------
        OSError
        """
        return arrange(self.motifs, [range(len(self.motifs))]).to_svg(path)

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[np.float32]:
        """Return the motifs side by side, for NumPy and matplotlib."""
        return np.array(np.concatenate([motif.image() for motif in self.motifs], axis=1), dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        return to_png(np.asarray(self))


def border_mismatch(a: Motif, b: Motif) -> float:
    """Compute the step across two motifs' common border relative to the steps within them.

    Parameters
    ----------
    a, b : Motif
        Of the same size and number of layers.

    Returns
    -------
    float
        Mean step of density across the borders a|b, b|a, a over b and b over a, divided by the mean step in
        the first and last two rows and columns of both. About 1 where the border cannot be seen. By the rule
        "rotate" b is turned.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, layers=1, repeat="translate", seed=1, iterations=3)
    >>> ts.motif.border_mismatch(motif, motif) >= 0
    True
    """
    for name, motif in (("a", a), ("b", b)):
        check_kind(name, motif, Motif, "a Motif")
    if a.densities.shape != b.densities.shape:
        raise OptionError(
            "a has densities of shape {a!s} and b of {b!s}; compare motifs of one size with equally many "
            "inks",
            kind="shape",
            a=a.densities.shape,
            b=b.densities.shape,
        )
    across, within = [], []
    beside = copy_at(b.densities, a.repeat, 0, int(a.repeat == "rotate"))
    for first, second in ((a.densities, beside), (beside, a.densities)):
        for one, two in ((first, second), (first.swapaxes(1, 2), second.swapaxes(1, 2))):
            across.append(np.abs(one[..., -1] - two[..., 0]).mean())
            within.append(np.abs(one[..., -1] - one[..., -2]).mean())
            within.append(np.abs(two[..., 1] - two[..., 0]).mean())
    inner = float(np.mean(within))
    return float(np.mean(across)) / inner if inner > 0 else 0.0


def join_motifs(
    recipes: Sequence[Recipe],
    *,
    weight: float = 0.5,
    stages: int = 1,
    between: int = 1,
    shared: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> JoinedMotifs:
    """Generate motifs that join each other and themselves.

    Parameters
    ----------
    recipes : sequence of Recipe
        At least two. They may differ only in seed, base image, and their layers' sources, sinks, ambient
        heat, mass and penalty.
    weight : float
        w in [0, 1]: with 0 every motif is optimised alone, with 1 only the compound motifs count.
    stages : int
        1 for one motif per recipe; each further stage puts new motifs between neighbours. N recipes make
        1 + (N - 1) (1 + `between`)^(stages - 1) motifs, which must not be more than 100.
    between : int
        Number of new motifs that a stage puts between two neighbours.
    shared : int
        Width, in elements, of a border that is equal in all motifs, so that any motif may lie beside any
        other; by default 3 % of the cell. With 0, as in the thesis, only the compound motifs make borders
        alike.
    progress : callable, optional
        Called with the share done, in [0, 1].

    Returns
    -------
    JoinedMotifs

    Raises
    ------
    OptionError
        When the recipes do not fit each other, an option is out of range, or there is too much to do.

    Examples
    --------
    >>> import toposeam as ts
    >>> given = dict(layers=1, repeat="translate", iterations=3, palette="sumi")
    >>> recipes = [ts.motif.random_recipe(16, seed=seed, **given) for seed in (1, 2)]
    >>> first, second = ts.motif.join_motifs(recipes).motifs
    >>> first.densities.shape
    (1, 16, 16)
    """
    check_function("progress", progress)
    recipes = check_items("recipes", recipes, Recipe, "a sequence of Recipes")
    if shared is None:
        shared = max(1, round(_SHARED_BORDER * min(recipes[0].size))) if recipes else 1
    _check_recipes(recipes, weight, stages, between, shared)
    first = recipes[0]
    per_stage = sum(first.of_layer(index).iterations for index in range(len(first.layers)))
    done = 0

    def report() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / (per_stage * stages))

    options = JoinOptions(weight, shared, report)
    row = [Member(recipe, None, 1) for recipe in recipes]
    generate_row(row, options)
    for stage in range(2, stages + 1):
        longer = row[:1]
        for left, right in pairwise(row):
            for index in range(between):
                recipe = _blend(left.recipe, right.recipe, (index + 1) / (between + 1))
                longer.append(Member(recipe, None, stage))
            longer.append(right)
        row = longer
        generate_row(row, options)
    layers = [_finish_layer(row, layer, shared, weight) for layer in range(len(first.layers))]

    def made(given: list[list[npt.NDArray[np.float32]]]) -> list[Motif]:
        return [
            make_motif(member.recipe, [layer[index] for layer in given], member.history)
            for index, member in enumerate(row)
        ]

    motifs = (
        made(layers)
        if weight == 0 and shared == 0
        else _with_even_borders(layers, made, [member.stage == 1 for member in row], shared)
    )
    return JoinedMotifs(motifs=tuple(motifs), stages=tuple(member.stage for member in row), weight=weight)


def _finish_layer(row: list[Member], layer: int, shared: int, weight: float) -> list[npt.NDArray[np.float32]]:
    """Return one layer of all members, with repaired strokes and with borders that do not show.

    Borders are left unchanged if members were optimised alone and share none.
    """
    found = []
    for member in row:
        assert member.densities is not None  # noqa: S101
        density, recipe = member.densities[layer], member.recipe.of_layer(layer)
        alone = weight == 0 and shared == 0
        if recipe.filter_radius:
            kept = 0 if alone else max(shared, 1)
            density = repair_strokes(density, recipe.repeat, recipe.layers[0].mass, kept)
        found.append(density.astype(np.float64))
    if weight == 0 and shared == 0:
        return [one.astype(np.float32) for one in found]
    first = row[0].recipe
    masses = [member.recipe.layers[layer].mass for member in row]
    edges = [member.recipe.layers[layer].edge for member in row]
    if shared and "soft" in edges:
        mixed = set(edges) != {"soft"}
        soft = fade_to_mean(np.stack(found), first.repeat, *((shared, BESIDE_STROKES) if mixed else ()))
        found = [soft[index] if edge == "soft" else found[index] for index, edge in enumerate(edges)]
    if shared and set(edges) == {"soft"}:
        found = smooth_wash_borders(found, first.repeat)
        return [symmetry(first.repeat, first.size).mean(one).astype(np.float32) for one in found]
    given = [index for index, member in enumerate(row) if member.stage == 1]
    for _ in range(2):  # correcting the mass changes the level at which strokes end a little
        found = smooth_row_borders(found, edges, first.repeat, shared, given)
        found = [restore_mass(one, mass) for one, mass in zip(found, masses, strict=True)]
    orbits = symmetry(first.repeat, first.size)
    return [orbits.mean(one).astype(np.float32) for one in found]


def _with_even_borders(
    layers: list[list[npt.NDArray[np.float32]]],
    made: Callable[[list[list[npt.NDArray[np.float32]]]], list[Motif]],
    first: Sequence[bool],
    shared: int,
) -> list[Motif]:
    """Return the motifs of layers, each a list of densities, whose borders show least where they are laid.

    Where a border shows more than the lines inside, all motifs get a common factor along it, and the best of
    some factors is kept. Where that is not enough, each of the `first` motifs gets one of its own beside the
    `shared` rows, and a second one when the others have theirs. The `first` motifs alone say which, so that
    further stages do not change them.
    """
    own = list(compress(range(len(first)), first))
    motifs = made(layers)
    for index in range(len(layers)):
        shape, repeat = layers[index][0].shape, motifs[0].repeat
        for axis in (0, 1):
            seeds = list(range(_LAID))
            worst = _laid_visibility([motifs[each] for each in own], index, axis, seeds)
            beside = beside_weight(shape, axis, shared)
            everyone = list(range(len(first)))
            changes = [(border_weight(shape, axis, repeat, width), everyone) for width in _TRIED_WIDTHS]
            changes += [(beside, [each]) for each in own] * 2
            before = layers[index]
            for weight, changed in changes:
                if worst <= _EVEN_ENOUGH:
                    break
                if changed is not everyone:  # one after the other, on what is best by then
                    before = layers[index]
                for power in _TRIED_POWERS:
                    factor = np.exp(power * weight)
                    tried = list(layers)
                    tried[index] = [
                        _scaled(one, factor, repeat) if each in changed else one
                        for each, one in enumerate(before)
                    ]
                    found = made(tried)
                    shown = _laid_visibility([found[each] for each in own], index, axis, seeds, worst)
                    if shown < worst:
                        motifs, layers, worst = found, tried, shown
    return motifs


def _scaled(density: npt.NDArray[np.float32], factor: Floats, repeat: str) -> npt.NDArray[np.float32]:
    """Return a density times a factor, with its mass restored inside."""
    changed = np.clip(density * factor, MIN_DENSITY, 1.0)
    restored = restore_mass(changed, float(density.mean(dtype=np.float64)))
    shape = (density.shape[0], density.shape[1])
    return symmetry(repeat, shape).mean(restored).astype(np.float32)


def _laid_visibility(
    motifs: list[Motif], layer: int, axis: int, seeds: list[int], below: float = np.inf
) -> float:
    """Compute how far borders across an axis show at worst, as lines or edges of one ink, in random patterns.

    It ends at the first pattern that shows them as much as `below`, whose seed becomes the first of `seeds`.
    """
    worst = 0.0
    for seed in seeds:
        inked = arrange(motifs, (4, 4), seed=seed).coverage_of(layer)
        side = motifs[0].densities.shape[1 + axis]
        inked = inked if axis == 0 else inked.T
        worst = max(worst, line_visibility(inked, side), edge_visibility(inked, side))
        if worst >= below:
            seeds.sort(key=lambda each: each != seed)
            break
    return worst


def _blend(a: Recipe, b: Recipe, share: float) -> Recipe:
    """Return a recipe between two others, with the sources and sinks of both in proportion."""
    layers = []
    for one, two in zip(a.layers, b.layers, strict=True):
        layers.append(
            LayerRecipe(
                ink=one.ink,
                sources=_scaled_points(one.sources, 1 - share) + _scaled_points(two.sources, share),
                sinks=_scaled_points(one.sinks, 1 - share) + _scaled_points(two.sinks, share),
                ambient=(1 - share) * one.ambient + share * two.ambient,
                mass=(1 - share) * one.mass + share * two.mass,
                penalty=(1 - share) * one.penalty + share * two.penalty,
                edge=one.edge,
                name=one.name,
                style=one.style,
                avoid=(1 - share) * one.avoid + share * two.avoid,
                iterations=one.iterations,
                filter_radius=one.filter_radius,
            )
        )
    return replace(a, layers=tuple(layers))


def _scaled_points(points: tuple[Point, ...], share: float) -> tuple[Point, ...]:
    total = sum(strength for *_, strength in points)
    return tuple((x, y, share * strength / total) for x, y, strength in points if total > 0)


def _check_recipes(recipes: Sequence[Recipe], weight: float, stages: int, between: int, shared: int) -> None:
    if len(recipes) < 2:
        raise OptionError(
            "{count} recipes were given; join at least two motifs", kind="count", count=len(recipes)
        )
    check_range(0, 1, weight=weight)  # 0: every motif alone, 1: compound motifs only
    check_whole("stages", stages, 1, 10)
    check_whole("between", between, 1, 10)
    check_whole("shared", shared, 0, min(recipes[0].size))
    _check_count(len(recipes), stages, between)
    first = recipes[0]
    for recipe in recipes:
        check_work(recipe, MAX_MEGAPIXELS)
        composed = {"outline": recipe.outline, "knock_out": recipe.knock_out, "one_piece": recipe.one_piece}
        composed["scale"] = any(layer.scale > 1 for layer in recipe.layers)
        for name, value in composed.items():
            if value:
                raise OptionError(
                    "motifs that join each other know no {parameter}; join motifs without",
                    kind="conflict",
                    parameter=Term(name),
                )
    if first.repeat not in JOINABLE:
        raise OptionError(
            "{parameter} is {value}; motifs that join each other must repeat by {allowed}",
            kind="choice",
            parameter=Term("repeat"),
            value=first.repeat,
            allowed=", ".join(JOINABLE),
        )
    if first.size[1] % 2:
        raise OptionError(
            "motifs that join need an even width, theirs is {width}; use {size}",
            kind="odd size",
            parameter=Term("size"),
            value=first.size,
            width=first.size[1],
            size=first.size[1] + 1,
        )
    for other in recipes[1:]:
        for name in ("size", "repeat", "paper", "iterations", "move", "filter_radius", "coarse", "guide"):
            if getattr(other, name) != getattr(first, name):
                raise OptionError(
                    "the recipes differ in {parameter} ({first!s} and {value!s}); give all the same",
                    kind="unlike",
                    parameter=Term(name),
                    value=getattr(other, name),
                    first=getattr(first, name),
                )
        pairs = zip(other.layers, first.layers, strict=False)
        if any((a.iterations, a.filter_radius) != (b.iterations, b.filter_radius) for a, b in pairs):
            raise OptionError(
                "the recipes have layers of other styles, which differ in {parameter}; give the same styles",
                kind="unlike",
                parameter=Term("filter_radius"),
            )
        if [part.ink for part in other.layers] != [part.ink for part in first.layers]:
            raise OptionError(
                "the recipes differ in their inks; give all the same palette and number of layers",
                kind="unlike",
                parameter=Term("layers"),
            )


def _check_count(given: int, stages: int, between: int) -> None:
    """Refuse a row of too many motifs."""
    if given > _MOST_MOTIFS:
        raise OptionError(
            "{value} recipes were given, more than {allowed}; join fewer",
            kind="too large",
            parameter=Term("recipes"),
            value=given,
            allowed=_MOST_MOTIFS,
        )
    count = 1 + (given - 1) * (1 + between) ** (stages - 1)
    if count > _MOST_MOTIFS:
        raise OptionError(
            "{value} stages with {between} new motifs between two make {count} of {given}, more than "
            "{allowed}; ask for fewer stages, or for fewer motifs between",
            kind="too large",
            parameter=Term("stages"),
            value=stages,
            allowed=_MOST_MOTIFS,
            between=between,
            given=given,
            count=count,
        )
