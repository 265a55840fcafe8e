"""The pages' content of a pattern book: one pattern round a theme, and one product, as jobs for worker processes."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.motif.conduction import nominal_conductivity
from toposeam.motif.kinds import measure
from toposeam.motif.palettes import Palette
from toposeam.motif.recipe import Recipe, pack_base, unpack_base
from toposeam.motif.sampling import resample
from toposeam_cli.colour import to_depth
from toposeam_cli.mockups import PRODUCTS, draw_product
from toposeam_cli.motif import Print, printable, read_theme
from toposeam_cli.picture import Picture, write_picture
from toposeam_cli.recipe_file import read_recipe

#: The four palettes that divide a book.
SEASONS = ("spring", "summer", "fall", "winter")
#: Rules of repetition; those that leave the theme as it is more often than those that fold it.
_REPEATS = (
    "translate", "translate", "translate", "rotate", "rotate", "reflect", "p2", "pm", "pg", "pmg", "pgg", "cmm", "p4", "p4m", "p4g", "p6m",
)  # fmt: skip
#: Motifs across and down of a swatch: it repeats by translation whatever the rule.
_SWATCH = 2


def book_recipe(theme: np.ndarray, seed: int, number: int, size: int) -> Recipe:
    """The recipe of one pattern of a book: everything about it is drawn by chance, but the season, which goes by turns.

    Half of the patterns are meant to have thick strokes, and half to show the theme; what came of it is measured.
    """
    rng = np.random.default_rng([seed, number])
    season = ts.palette(SEASONS[number % len(SEASONS)], 6)
    thick, shown = bool(rng.integers(2)), bool(rng.integers(2))
    layers = int(rng.integers(2, 4 if shown else 5))  # on one place more inks than three turn black
    inks = season.inks[rng.permutation(6)[:layers]]
    repeat = str(rng.choice(_REPEATS[:6] if shown else _REPEATS))
    strength = float(rng.uniform(0.7, 1.0) if shown else rng.uniform(0.05, 0.35))
    # Ink goes where the theme has less: a dark sign on light ground is drawn in ink, a light one on dark ground too.
    if unpack_base(pack_base(theme)).mean() > 0.5:
        strength = -strength
    few, many = (1, 4), (4, 10)

    def spots() -> list[tuple[float, float]]:
        count = int(rng.integers(*(few if thick else many)))
        return _inside(theme, strength, count, rng) if shown else [(float(x), float(y)) for x, y in rng.random((count, 2))]

    low, high = (0.0, 0.4) if thick else (0.5, 1.0)
    return ts.random_recipe(
        size, layers=layers, repeat=repeat, seed=int(rng.integers(2**31)), palette=Palette(paper=season.paper, inks=inks),
        sources=[spots() for _ in range(layers)], sinks=[spots() for _ in range(layers)],
        ambient=float(rng.uniform(0.6, 1.0) if shown else rng.uniform(low, high)),
        mass=[float(rng.uniform(0.2, 0.36) if thick else rng.uniform(0.08, 0.22)) for _ in range(layers)],
        penalty=float(rng.choice([1.0, 2.0, 3.0, 3.0, 3.0])), iterations=int(rng.integers(20, 51)),
        filter_radius=float(rng.uniform(1.5, 3.0) if thick else rng.uniform(0.6, 1.2)), base=theme, base_strength=strength,
    )  # fmt: skip


def _inside(theme: np.ndarray, strength: float, count: int, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Places in [0, 1], the likelier the better the theme conducts there."""
    base = unpack_base(pack_base(theme))
    weight = nominal_conductivity(base, strength, base.shape).ravel() ** 4
    chosen = rng.choice(weight.size, count, p=weight / weight.sum())
    rows, columns = np.unravel_index(chosen, base.shape)
    return [(float(x + 0.5) / base.shape[1], float(y + 0.5) / base.shape[0]) for x, y in zip(columns, rows, strict=True)]


def draw_pattern(theme: str, seed: int, number: int, size: int, motif: str, swatch: str) -> dict[str, Any]:
    """Make one pattern: the motif with its recipe, and a swatch that repeats by translation. Returns what was measured."""
    recipe = book_recipe(_theme(theme), seed, number, size)
    made = ts.generate_motif(recipe)
    write_picture(motif, printable(made.image(), None, {**Print().note(), "recipe": recipe.to_dict()}), force=True)
    write_picture(swatch, Picture(pixels=to_depth(ts.repeat(made, (_SWATCH, _SWATCH)), np.dtype(np.uint8))), force=True)
    # The theme as the plate had it, in the motif's own cell; hexagonal cells are sheared, and show none.
    upright = made.densities.shape[1:] == recipe.size
    base = resample(unpack_base(recipe.base), "none", recipe.size) if upright else None
    character = measure(made.image(), base)
    first = recipe.layers[0]
    return {
        "number": number,
        "kind": str(character.kind),
        "season": SEASONS[number % len(SEASONS)],
        "stroke": round(character.stroke, 4),
        "likeness": round(character.likeness, 3),
        "repeat": recipe.repeat,
        "layers": len(recipe.layers),
        "mass": [round(layer.mass, 3) for layer in recipe.layers],
        "p": first.penalty,
        "sources": [len(layer.sources) for layer in recipe.layers],
        "sinks": [len(layer.sinks) for layer in recipe.layers],
        "ambient": round(first.ambient, 2),
        "iterations": recipe.iterations,
        "filter": round(recipe.filter_radius, 2),
        "base_strength": round(recipe.base_strength, 2),
    }


def draw_on_product(motif: str, product: str, output: str, motif_mm: float | None = None, force: bool = True) -> None:
    """Make one mock-up from a motif's recipe."""
    recipe = read_recipe(Path(motif))
    made = ts.generate_motif(recipe)
    height, width = (2 * side for side in made.densities.shape[1:])
    pattern = to_depth(ts.repeat(made, (_SWATCH, _SWATCH), (height, width)), np.dtype(np.uint8))
    dark = made.inks[int(np.argmin(made.inks.sum(axis=1)))]
    # `width` px are one motif, of which `pattern` has two by two.
    drawn = draw_product(PRODUCTS[product], pattern, width, made.paper, dark, motif_mm)
    write_picture(output, Picture(pixels=drawn), force=force)


@functools.lru_cache(maxsize=2)
def _theme(path: str) -> np.ndarray:
    return read_theme(Path(path))
