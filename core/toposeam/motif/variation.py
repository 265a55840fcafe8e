"""Random variations of a motif's recipe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toposeam.arrays import Mask
from toposeam.checks import Seed, check_kind, check_range, seed_of
from toposeam.motif.generate import random_recipe
from toposeam.motif.ink.palettes import Palette
from toposeam.motif.optimise.layer import outline_on_cell
from toposeam.motif.optimise.spot_layout import lies_in
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe, unpack_base
from toposeam.motif.recipe.styles import STYLES, draw_rule
from toposeam.motif.symmetry.rules import fits_twice

#: Amount up to which a variation keeps style and rule; from there on either changes with a probability that
#: reaches 1 at the amount 1.
_SAME_HAND = 0.5
#: The second number of the seed from which it is drawn whether they change.
_CHANGE_STREAM = 104


def vary(recipe: Recipe, *, amount: float = 1.0, seed: Seed = 0) -> Recipe:
    """Return a recipe with randomly changed places, strengths, masses and ambient heats.

    Masses and ambient heats approach the ranges of each layer's style. Above the amount 0.5 the rule of
    repetition and the style of all layers may change, too. Colours, size and base image stay.

    Parameters
    ----------
    recipe : Recipe
    amount : float
        From 0, no change, to 1, where rule and style are drawn anew.
    seed : int, Generator or None

    Raises
    ------
    OptionError
        For an amount or a seed out of range.

    Examples
    --------
    >>> from toposeam.motif.generate import random_recipe
    >>> recipe = random_recipe(32, seed=4, repeat="p4")
    >>> vary(recipe, amount=0.0) == recipe, vary(recipe, amount=0.2, seed=1).repeat
    (True, 'p4')
    """
    check_kind("recipe", recipe, Recipe, "a Recipe")
    check_range(0, 1, amount=amount)
    seed = seed_of(seed)
    if not amount:
        return recipe
    rng, change = np.random.default_rng(seed), np.random.default_rng([seed, _CHANGE_STREAM])
    other_rule, other_style = change.random(2) < amount / _SAME_HAND - 1
    if other_style:
        recipe = restyle(replace(recipe, seed=seed), None)
    if other_rule:
        styles = [layer.style for layer in recipe.layers]
        rule = draw_rule(styles, seed, recipe.size)
        if fits_twice(rule) or all(layer.scale % 2 for layer in recipe.layers):
            recipe = replace(recipe, repeat=rule)
    if other_style:
        return recipe
    layers = tuple(_varied(layer, recipe, amount, rng.spawn(1)[0]) for layer in recipe.layers)
    return replace(recipe, layers=layers, seed=seed)


def restyle(recipe: Recipe, style: str | Sequence[str] | None) -> Recipe:
    """Return a recipe with all layers drawn anew, by its seed, in one style or one for each layer.

    Colours and names of inks, size, rule, seed and base image stay.

    Parameters
    ----------
    recipe : Recipe
    style : str, one per layer, or None
        As in :func:`random_recipe`.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> from toposeam.motif.generate import random_recipe
    >>> [layer.style for layer in restyle(random_recipe(32, layers=2), "fern").layers]
    ['fern', 'fern']
    """
    check_kind("recipe", recipe, Recipe, "a Recipe")
    colours = Palette(paper=np.array(recipe.paper), inks=np.array([layer.ink for layer in recipe.layers]))
    drawn = random_recipe(
        recipe.size,
        style=style,
        repeat=recipe.repeat,
        layers=len(recipe.layers),
        seed=recipe.seed,
        palette=colours,
        base=unpack_base(recipe.base) if recipe.base else None,
        outline=1 - unpack_base(recipe.outline) if recipe.outline else None,
        place=[layer.place for layer in recipe.layers],
        scale=[layer.scale for layer in recipe.layers],
        one_piece=recipe.one_piece,
    )
    layers = [
        replace(new, ink=old.ink, name=old.name) for new, old in zip(drawn.layers, recipe.layers, strict=True)
    ]
    return replace(
        recipe, layers=tuple(layers), iterations=drawn.iterations, filter_radius=drawn.filter_radius
    )


def _varied(layer: LayerRecipe, recipe: Recipe, amount: float, rng: np.random.Generator) -> LayerRecipe:
    style, repeat = STYLES[layer.style], recipe.repeat
    inside = None
    if layer.place != "everywhere" and layer.scale == 1:
        inside = outline_on_cell(recipe.outline, layer.place, repeat, recipe.size)

    def towards(value: float, ends: tuple[float, float]) -> float:
        return (1 - amount) * value + amount * float(rng.uniform(*ends))

    return replace(
        layer,
        sources=_moved(layer.sources, repeat, amount, rng, inside),
        sinks=_moved(layer.sinks, repeat, amount, rng, inside),
        mass=towards(layer.mass, style.mass),
        ambient=towards(layer.ambient, style.ambient) if layer.ambient else 0.0,
    )


def _moved(
    points: tuple[Point, ...],
    repeat: str,
    amount: float,
    rng: np.random.Generator,
    inside: Mask | None,
) -> tuple[Point, ...]:
    """Move each point by up to `amount` half cells along each axis, and change its strength.

    At the border a point continues at the opposite one if the cell repeats so; else it is mirrored. A point
    that would leave a shape stays where it is.
    """
    moved = []
    for x, y, strength in points:
        place = np.array([x, y]) + amount * rng.uniform(-0.5, 0.5, 2)
        place = np.abs((place + 1) % 2 - 1) if repeat in ("none", "reflect", "rotate") else place % 1
        if inside is not None and not lies_in(inside, place):
            place = np.array([x, y])
        moved.append(
            (float(place[0]), float(place[1]), strength * float(np.exp(amount * rng.uniform(-0.5, 0.5))))
        )
    return tuple(moved)
