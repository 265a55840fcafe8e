"""The options of ``toposeam motif`` that say what a motif is like, and what it begins with."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from toposeam.motif.recipe.recipe import LAWS
from toposeam_cli.app.options import FILE, FiniteRange, NumbersType, PairType, grouped
from toposeam_cli.motifs.print_options import RepeatType


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Requested properties of a motif; None is left to its seed, or unchanged."""

    size: tuple[int, int] | None
    layers: int | None
    repeat: str | None
    seed: int | None
    palette: str | None
    base: Path | None
    base_strength: float | None
    base_law: str | None
    strengths: Any
    mass: Any
    penalty: Any
    iterations: int | None
    move: float | None
    sources: Any
    sinks: Any
    distance: float | None
    ambient: float | None
    filter_radius: float | None

    def given(self) -> dict[str, Any]:
        """Return the requested properties."""
        asked = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: value for name, value in asked.items() if value is not None}


@dataclass(frozen=True, slots=True, kw_only=True)
class Beginning:
    """The motif, or the parameters, to begin with, and how far to go from there."""

    config: Path | None
    like: Path | None
    source: Path | None
    number: int | None
    amount: float | None


_RECIPE: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--size", type=PairType(), help="Elements of one motif: N, or WIDTHxHEIGHT.  [default: 256]"
    ),
    click.option("--layers", type=click.IntRange(1, 16), help="Number of inks.  [default: 3]"),
    click.option(
        "--repeat",
        type=RepeatType(),
        help="The rule it repeats by; also 'drop 1/3', 'brick 1/4'.  [default: translate]",
    ),
    click.option(
        "--seed", type=click.IntRange(0), help="Everything that is not given follows from it.  [default: 0]"
    ),
    click.option(
        "--palette", help="A name, a picture, or colours: '#paper #ink #ink'.  [default: from the seed]"
    ),
    click.option("--base", type=FILE, help="A logo, symbol or photograph that shapes the strokes."),
    click.option(
        "--base-strength",
        type=FiniteRange(-1, 1),
        help="How strongly it shows; below 0 strokes keep to its dark parts.",
    ),
    click.option(
        "--base-law",
        type=click.Choice(LAWS),
        help="How its brightness conducts: in proportion in the thesis.  [default: contrast]",
    ),
    click.option(
        "--strengths",
        type=NumbersType(float),
        help="Range of the random strengths of sources and sinks: LOW,HIGH.  [default: 0.5,1.5]",
    ),
    click.option(
        "--mass",
        type=NumbersType(float),
        help="Share of the area that is inked; one number, or one per layer: 0.2,0.3.",
    ),
    click.option(
        "--penalty",
        type=NumbersType(float),
        help="Penalty exponent: 1 for ink wash, 3 for distinct strokes.",
    ),
    click.option(
        "--iterations",
        type=click.IntRange(1, 10_000),
        help="Strokes become more distinct with each.  [default: 40]",
    ),
    click.option(
        "--move", type=FiniteRange(0, 1, min_open=True), help="Largest change of a density in an iteration."
    ),
    click.option("--sources", type=NumbersType(int), help="Number of heat sources, or one number per layer."),
    click.option("--sinks", type=NumbersType(int), help="Number of heat sinks, or one number per layer."),
    click.option(
        "--distance",
        type=FiniteRange(0, 1, min_open=True),
        help="From sinks to sources, as a share of the cell.",
    ),
    click.option(
        "--ambient",
        type=FiniteRange(0, 1),
        help="Share of the heat that comes from everywhere; it makes strokes branch.",
    ),
    click.option(
        "--filter",
        "filter_radius",
        type=FiniteRange(0, 10),
        help="Radius of the filter, in hundredths of the cell.",
    ),
)
_BEGINNING: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--config", type=FILE, help="TOML file with these options, or a whole recipe; see --show-recipe."
    ),
    click.option(
        "--like",
        type=FILE,
        help="Make the motif in this file again; with --seed or --vary, a relative of it.",
    ),
    click.option(
        "--from",
        "source",
        type=FILE,
        help="Go on from a motif on a page of --explore; also from what --like or --config take.",
    ),
    click.option("--number", type=click.IntRange(1), help="With --from: which motif of the page."),
    click.option(
        "--vary",
        "amount",
        type=FiniteRange(0, 1),
        help="With --from, --like or --config: how far a relative may be, 0 to 1.",
    ),
)

#: Add the options that say what a motif is like (``wanted``), and what it begins with (``beginning``).
recipe_options = grouped("wanted", Wanted, _RECIPE)
beginning_options = grouped("beginning", Beginning, _BEGINNING)
