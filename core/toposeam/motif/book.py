"""Pattern books on a theme (thesis 4.5): the recipe of each pattern, and the product that it suits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_whole
from toposeam.motif.generate import random_recipe
from toposeam.motif.ink.palettes import Palette, palette
from toposeam.motif.kinds import Kind
from toposeam.motif.optimise.conduction import nominal_conductivity
from toposeam.motif.recipe.recipe import Recipe, pack_base, unpack_base

#: The four palettes that divide a book.
SEASONS = ("spring", "summer", "fall", "winter")
#: Rules of repetition that leave a theme whole which shows.
_WHOLE = ("translate", "translate", "translate", "rotate", "rotate", "reflect")
#: Styles of patterns in which the theme hides, with thick and with thin strokes.
_THICK = ("cutout", "leaf", "folk", "bone", "pebble", "batik")
_THIN = ("vein", "chain", "seed", "key", "rosette", "brush", "fern", "thread", "daisy")
#: Kinds of pattern for each product, the best first: fine ones for a tie, bold ones for a canvas.
FITTING_KINDS: dict[str, tuple[Kind, ...]] = {
    "tie": (Kind.THIN_HIDDEN, Kind.THIN_CLEAR, Kind.THICK_HIDDEN, Kind.THICK_CLEAR),
    "scarf": (Kind.THICK_HIDDEN, Kind.THIN_HIDDEN, Kind.THIN_CLEAR, Kind.THICK_CLEAR),
    "shirt": (Kind.THIN_CLEAR, Kind.THIN_HIDDEN, Kind.THICK_CLEAR, Kind.THICK_HIDDEN),
    "canvas": (Kind.THICK_CLEAR, Kind.THICK_HIDDEN, Kind.THIN_CLEAR, Kind.THIN_HIDDEN),
}

#: Largest number of inks and stroke edges of each product; None leaves the pattern's own. Ties are woven of
#: few threads, scarves are vivid.
FINISH: dict[str, tuple[int | None, str | None]] = {
    "tie": (2, "crisp"),
    "scarf": (None, "crisp"),
    "shirt": (None, None),
    "canvas": (None, None),
}
#: The product whose pattern of the same season serves as the second one, such as on a collar or a border.
SECOND_PRODUCT = {"shirt": "tie", "scarf": "shirt", "tie": "scarf"}


def book_recipe(theme: npt.ArrayLike, seed: int, number: int, size: int) -> Recipe:
    """Draw the recipe of one pattern of a book; only its season is not random, but taken in turn.

    Half of the recipes aim at thick strokes, and half at a theme that shows; where it hides, style and rule
    are drawn. :func:`measure` finds the kind that resulted.

    Parameters
    ----------
    theme : (H, W[, C]) array_like
    seed : int
        Seed of the whole book.
    number : int
        Number of the pattern, from 1.
    size : int
        Side of a motif, in elements; even.

    Returns
    -------
    Recipe

    Raises
    ------
    OptionError, ImageError
    """
    check_whole("seed", seed, 0)
    check_whole("number", number, 0)
    rng = np.random.default_rng([seed, number])
    season = palette(SEASONS[number % len(SEASONS)], 6)
    thick, shown = bool(rng.integers(2)), bool(rng.integers(2))
    layers = int(rng.integers(2, 4))  # more than three inks on one place turn black
    inks = season.inks[rng.permutation(6)]
    whole = str(rng.choice(_WHOLE))
    # With conductivity in proportion to brightness and full strength, black parts keep strokes out, so that
    # strokes draw the theme's outline. A lower strength lets them in, and the theme is not recognised.
    hint = float(rng.uniform(0.05, 0.35))
    strength = 1.0 if shown else hint
    # Ink goes to the smaller part: a dark sign on light ground is drawn in ink, and so is a light sign on a
    # dark one.
    if unpack_base(pack_base(theme)).mean() > 0.5:
        strength = -strength
    if not shown:
        return random_recipe(
            size,
            style=str(rng.choice(_THICK if thick else _THIN)),
            repeat=None,
            seed=int(rng.integers(2**31)),
            palette=Palette(paper=season.paper, inks=inks),
            base=theme,
            base_strength=strength,
        )
    few, many = (1, 4), (4, 10)

    def spots() -> list[tuple[float, float]]:
        return _inside(theme, strength, int(rng.integers(*(few if thick else many))), rng)

    return random_recipe(
        size,
        layers=layers,
        repeat=whole,
        seed=int(rng.integers(2**31)),
        palette=Palette(paper=season.paper, inks=inks),
        sources=[spots() for _ in range(layers)],
        sinks=[spots() for _ in range(layers)],
        ambient=float(rng.uniform(0.6, 1.0)),
        mass=[float(rng.uniform(0.2, 0.36) if thick else rng.uniform(0.08, 0.22)) for _ in range(layers)],
        penalty=float(rng.choice([1.0, 2.0, 3.0, 3.0, 3.0])),
        iterations=int(rng.integers(20, 51)),
        filter_radius=float(rng.uniform(1.5, 3.0) if thick else rng.uniform(0.6, 1.2)),
        base=theme,
        base_strength=strength,
        base_law="brightness",
    )


def _inside(
    theme: npt.ArrayLike, strength: float, count: int, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Draw places in [0, 1], with probabilities that grow with the theme's conductivity."""
    base = unpack_base(pack_base(theme))
    weight = nominal_conductivity(base, strength, base.shape).ravel() ** 4
    chosen = rng.choice(weight.size, count, p=weight / weight.sum())
    rows, columns = np.unravel_index(chosen, base.shape)
    return [
        (float(x + 0.5) / base.shape[1], float(y + 0.5) / base.shape[0])
        for x, y in zip(columns, rows, strict=True)
    ]


def choose(rows: Sequence[dict[str, Any]]) -> list[tuple[dict[str, Any], str]]:
    """Choose a pattern of a fitting kind for each season and product, each pattern at most once.

    Parameters
    ----------
    rows : sequence of dict
        With the season, kind, layers and number of each pattern.

    Examples
    --------
    >>> rows = [{"season": "fall", "kind": kind, "layers": 2, "number": n} for n, kind in enumerate("AD", 1)]
    >>> [(row["number"], product) for row, product in choose(rows)]
    [(2, 'tie'), (1, 'scarf')]
    """
    chosen = []
    for season in SEASONS:
        left = [row for row in rows if row["season"] == season]
        for product, kinds in FITTING_KINDS.items():
            if left:
                order = [str(kind) for kind in kinds]
                best = min(left, key=lambda row: (order.index(row["kind"]), -row["layers"], row["number"]))
                left.remove(best)
                chosen.append((best, product))
    return chosen
