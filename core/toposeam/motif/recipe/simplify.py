"""Motifs made simpler or sharper for what they are printed on (thesis 4.5)."""

from __future__ import annotations

from dataclasses import replace

from toposeam.checks import check_kind, check_whole
from toposeam.motif.recipe.recipe import Recipe


def simplify(recipe: Recipe, *, inks: int | None = None, edge: str | None = None) -> Recipe:
    """Return a recipe with fewer inks, or other edges.

    Parameters
    ----------
    recipe : Recipe
    inks : int, optional
        So many are kept at most: those with the most ink.
    edge : str, optional
        How all strokes end, one of `EDGES`; "crisp" makes strokes of ink wash.

    Returns
    -------
    Recipe
        Layers that are kept stay the same to the pixel but for their edges.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> import toposeam as ts
    >>> recipe = ts.motif.random_recipe(32, layers=3, mass=[0.1, 0.3, 0.2], seed=1)
    >>> [layer.mass for layer in simplify(recipe, inks=2, edge="crisp").layers]
    [0.3, 0.2]
    """
    check_kind("recipe", recipe, Recipe, "a Recipe")
    layers = recipe.layers
    if inks is not None:
        check_whole("inks", inks, 1)
        heaviest = sorted(range(len(layers)), key=lambda index: -layers[index].mass)[:inks]
        layers = tuple(layer for index, layer in enumerate(layers) if index in heaviest)
    if edge is not None:
        layers = tuple(replace(layer, edge=edge) for layer in layers)
    return replace(recipe, layers=layers)
