"""Simpler or sharper versions of motifs, for the product on which they are printed (thesis 4.5)."""

from __future__ import annotations

from dataclasses import replace

from toposeam.checks import check_kind, check_whole
from toposeam.motif.recipe.recipe import Recipe


def simplify(recipe: Recipe, *, inks: int | None = None, edge: str | None = None) -> Recipe:
    """Return a recipe with fewer inks or other stroke edges.

    Parameters
    ----------
    recipe : Recipe
    inks : int, optional
        Largest number of layers to keep; those of the largest mass are kept.
    edge : str, optional
        Stroke edges of all layers, one of `EDGES`; "crisp" turns ink wash into strokes.

    Returns
    -------
    Recipe
        Kept layers make the same densities; only their edges may differ.

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
