"""Random variations of a motif's recipe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toposeam.checks import Seed, check_kind, check_range, seed_of
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe

#: Ranges of the random masses and ambient heats that a variation approaches.
_MASS_RANGE, _AMBIENT_RANGE = (0.16, 0.34), (0.2, 0.9)


def vary(recipe: Recipe, *, amount: float = 1.0, seed: Seed = 0) -> Recipe:
    """Return a recipe with randomly changed places, strengths, masses and ambient heats.

    Colours, size, rule of repetition, base image and options of the optimisation stay.

    Parameters
    ----------
    recipe : Recipe
    amount : float
        From 0, no change, to 1, which keeps only the numbers of sources and sinks.
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
    rng = np.random.default_rng(seed)
    layers = tuple(_varied(layer, recipe.repeat, amount, rng.spawn(1)[0]) for layer in recipe.layers)
    return replace(recipe, layers=layers, seed=seed) if amount else recipe


def _varied(layer: LayerRecipe, repeat: str, amount: float, rng: np.random.Generator) -> LayerRecipe:
    def towards(value: float, ends: tuple[float, float]) -> float:
        return (1 - amount) * value + amount * float(rng.uniform(*ends))

    return replace(
        layer,
        sources=_moved(layer.sources, repeat, amount, rng),
        sinks=_moved(layer.sinks, repeat, amount, rng),
        mass=towards(layer.mass, _MASS_RANGE),
        ambient=towards(layer.ambient, _AMBIENT_RANGE) if layer.ambient else 0.0,
    )


def _moved(
    points: tuple[Point, ...], repeat: str, amount: float, rng: np.random.Generator
) -> tuple[Point, ...]:
    """Move each point by up to `amount` half cells along each axis, and change its strength.

    At the border a point continues at the opposite one if the cell repeats so; else it is mirrored.
    """
    moved = []
    for x, y, strength in points:
        place = np.array([x, y]) + amount * rng.uniform(-0.5, 0.5, 2)
        place = np.abs((place + 1) % 2 - 1) if repeat in ("none", "reflect", "rotate") else place % 1
        moved.append(
            (float(place[0]), float(place[1]), strength * float(np.exp(amount * rng.uniform(-0.5, 0.5))))
        )
    return tuple(moved)
