"""The options of ``toposeam motif`` for the properties of a motif and for the motif that it begins with."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

import toposeam as ts
from toposeam.motif.ink.mixing import INKINGS
from toposeam.motif.recipe.recipe import LAWS, PLACES
from toposeam.motif.recipe.styles import STYLES
from toposeam_cli.app.command import option
from toposeam_cli.app.options import FILE, FiniteRange, NumbersType, PairType, grouped
from toposeam_cli.motifs.print_options import RepeatType


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Requested properties of a motif; those that are None depend on its seed, or stay unchanged."""

    style: Any
    size: tuple[int, int] | None
    layers: int | None
    repeat: str | None
    seed: int | None
    palette: str | None
    paper: str | None
    inking: str | None
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
    avoid: float | None
    outline: str | None
    place: Any
    scale: Any
    guide: Path | None
    knock_out: bool
    trap: Share | None
    one_piece: bool
    stencil: bool
    bridge: Share | None

    def given(self) -> dict[str, Any]:
        """Return the requested properties."""
        asked = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        if self.one_piece and self.stencil:
            raise ts.OptionError(
                "--one-piece is what is inked, --stencil what is left of the sheet; leave one of them out"
            )
        del asked["stencil"]
        asked["one_piece"] = "ink" if self.one_piece else "paper" if self.stencil else None
        asked["knock_out"] = self.knock_out or None
        return {name: value for name, value in asked.items() if value is not None}


@dataclass(frozen=True, slots=True, kw_only=True)
class Beginning:
    """The motif or the parameters to begin with, and the amount of variation."""

    config: Path | None
    like: Path | None
    source: Path | None
    number: int | None
    amount: float | None


@dataclass(frozen=True, slots=True)
class Share:
    """A length: in hundredths of the cell's shorter side, or in mm on paper."""

    value: float
    mm: bool

    def hundredths(self, width_mm: float | None, size: tuple[int, int]) -> float:
        """Return it in hundredths of the shorter side of a cell of (rows, columns) that is so wide on paper.

        Raises
        ------
        OptionError
            For a length in mm on paper of unknown width.
        """
        if not self.mm:
            return self.value
        if width_mm is None:
            raise ts.OptionError(
                f"{self.value:g} mm is a length on paper; add --motif-width, or give a "
                "share of the motif, like 2%"
            )
        return self.value / (width_mm * min(size) / size[1]) * 100


class ShareType(click.ParamType[Any]):
    """A share of the cell, like 2%, or a length on paper, like 1.5mm."""

    name = "LENGTH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text, or a number from a file, which is in hundredths."""
        if isinstance(value, Share):
            return value
        match = re.fullmatch(r"\s*(-?\d{1,4}(?:\.\d+)?)\s*(%|mm|cm|in|)\s*", str(value))
        if match is None:
            self.fail(f"{value!r} is no length; write it like 2%, of the motif, or 1.5mm", param, ctx)
        number, unit = float(match[1]), match[2]
        return Share(number * {"cm": 10.0, "in": 25.4}.get(unit, 1.0), unit not in ("%", ""))


class PlacesType(NumbersType):
    """A number of places, or one per layer, or the name of a file that shows them."""

    def __init__(self) -> None:
        super().__init__(int)
        self.name = "N|FILE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text; names of files stay texts."""
        if isinstance(value, str) and Path(value).suffix[1:2].isalpha():
            return value
        return super().convert(value, param, ctx)


class PlaceType(click.ParamType[Any]):
    """Where layers lie: one word, or one for each layer."""

    name = "PLACE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text, or a list from a file."""
        words = value if isinstance(value, list | tuple) else str(value).split(",")
        names = [str(word).strip() for word in words]
        for name in names:
            if name not in PLACES:
                self.fail(f"{name!r} is no place; use one of {', '.join(PLACES)}", param, ctx)
        return names[0] if len(names) == 1 else tuple(names)


class StyleType(click.ParamType[Any]):
    """A style of a motif, or one for each layer, separated by commas."""

    name = "STYLE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text, or a list from a file."""
        words = value if isinstance(value, list | tuple) else str(value).split(",")
        names = [str(word).strip() for word in words]
        for name in names:
            if name not in STYLES:
                self.fail(f"{name!r} is no style; use one of {', '.join(STYLES)}", param, ctx)
        return names[0] if len(names) == 1 else tuple(names)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the styles that begin so."""
        return [CompletionItem(name) for name in STYLES if name.startswith(incomplete)]


_RECIPE: tuple[Callable[[Any], Any], ...] = (
    option(
        "--style",
        heading="Motif",
        type=StyleType(),
        help="How it looks: one of --styles, or one per layer.  [default: from the seed]",
    ),
    option(
        "--size",
        heading="Motif",
        type=PairType(),
        help="Elements of one motif: N, or WIDTHxHEIGHT.  [default: 256]",
    ),
    option(
        "--layers",
        heading="Motif",
        type=click.IntRange(1, 16),
        help="Number of inks.  [default: the style's]",
    ),
    option(
        "--repeat",
        heading="Motif",
        type=RepeatType(),
        help="The rule it repeats by; also 'drop 1/3', 'brick 1/4'.  [default: from the seed]",
    ),
    option(
        "--seed",
        heading="Motif",
        type=click.IntRange(0),
        help="Decides everything that you do not give.  [default: 0]",
    ),
    option(
        "--palette",
        heading="Motif",
        help="A name, a picture, or colours: '#paper #ink #ink'.  [default: from the seed]",
    ),
    option("--paper", heading="Motif", help="Colour of the paper: #rrggbb.  [default: the palette's]"),
    option(
        "--ink",
        "inking",
        heading="Motif",
        type=click.Choice(INKINGS),
        help="Opaque inks cover what lies below and are seen on dark paper.  [default: transparent]",
    ),
    option(
        "--base", heading="Motif", type=FILE, help="A logo, symbol or photograph that shapes the strokes."
    ),
    option(
        "--base-strength",
        heading="Motif",
        type=FiniteRange(-1, 1),
        help="How strongly it shows; below 0 strokes keep to its dark parts.",
    ),
    option(
        "--base-law",
        heading="Motif",
        type=click.Choice(LAWS),
        help="How its brightness conducts: in proportion in the thesis.  [default: contrast]",
    ),
    option(
        "--strengths",
        heading="Heat and ink",
        type=NumbersType(float),
        help="Range of the random strengths of sources and sinks: LOW,HIGH.  [default: 0.5,1.5]",
    ),
    option(
        "--mass",
        heading="Heat and ink",
        type=NumbersType(float),
        help="Share of the area that is inked; one number, or one per layer: 0.2,0.3.",
    ),
    option(
        "--penalty",
        heading="Heat and ink",
        type=NumbersType(float),
        help="Penalty exponent: 1 for ink wash, 3 for distinct strokes.",
    ),
    option(
        "--iterations",
        heading="Heat and ink",
        type=click.IntRange(1, 10_000),
        help="Strokes become more distinct with each.  [default: the style's]",
    ),
    option(
        "--move",
        heading="Heat and ink",
        type=FiniteRange(0, 1, min_open=True),
        help="Largest change of a density in an iteration.",
    ),
    option(
        "--sources",
        heading="Heat and ink",
        type=PlacesType(),
        help="Number of heat sources, one per layer, or an .svg or picture of points and lines.",
    ),
    option(
        "--sinks",
        heading="Heat and ink",
        type=PlacesType(),
        help="Number of heat sinks, one per layer, or an .svg or picture of points and lines.",
    ),
    option(
        "--distance",
        heading="Heat and ink",
        type=FiniteRange(0, 1, min_open=True),
        help="From sinks to sources, as a share of the cell.",
    ),
    option(
        "--ambient",
        heading="Heat and ink",
        type=FiniteRange(0, 1),
        help="Share of the heat that comes from everywhere; it makes strokes branch.",
    ),
    option(
        "--filter",
        "filter_radius",
        heading="Heat and ink",
        type=FiniteRange(0, 10),
        help="Radius of the filter, in hundredths of the cell.  [default: the style's]",
    ),
    option(
        "--avoid",
        heading="Heat and ink",
        type=FiniteRange(0, 1),
        help="How far each ink keeps out of those before it, 0 to 1.  [default: the style's]",
    ),
    option(
        "--outline",
        heading="Composition",
        help="A shape: a picture or .svg, dark or opaque inside; or disc, band (a hem) or frame.",
    ),
    option(
        "--place",
        heading="Composition",
        type=PlaceType(),
        help="Where inks lie: inside, outside, or everywhere; one, or one per layer.  [default: inside]",
    ),
    option(
        "--scale",
        heading="Composition",
        type=NumbersType(int),
        help="Copies of an ink's strokes along each side of the motif; 3,1: a fine ground and a figure.",
    ),
    option(
        "--guide", heading="Composition", type=FILE, help="Lines that strokes follow: an .svg or a picture."
    ),
    option(
        "--knock-out",
        heading="Composition",
        is_flag=True,
        help="Leave inks out where a later one has strokes.",
    ),
    option(
        "--trap",
        heading="Composition",
        type=ShareType(),
        help="With --knock-out: how far inks reach below a later one, 0.5% or 0.3mm; below 0 a gap.",
    ),
    option(
        "--one-piece",
        heading="Composition",
        is_flag=True,
        help="Connect the strokes of each ink to one piece, to be cut out.",
    ),
    option(
        "--stencil",
        heading="Composition",
        is_flag=True,
        help="Connect what each ink leaves of the sheet to one piece.",
    ),
    option(
        "--bridge",
        heading="Composition",
        type=ShareType(),
        help="Least width of that piece: 2% of the motif, or 1.5mm.  [default: 2%]",
    ),
)
_BEGINNING: tuple[Callable[[Any], Any], ...] = (
    option(
        "--config",
        heading="An earlier motif",
        type=FILE,
        help="TOML file with these options, or a whole recipe; see --show-recipe.",
    ),
    option(
        "--like",
        heading="An earlier motif",
        type=FILE,
        help="Make the motif in this file again; with --seed or --vary, a relative of it.",
    ),
    option(
        "--from",
        "source",
        heading="An earlier motif",
        type=FILE,
        help="Go on from a motif on a page of --explore; also from what --like or --config take.",
    ),
    option(
        "--number",
        heading="An earlier motif",
        type=click.IntRange(1),
        help="With --from: which motif of the page.",
    ),
    option(
        "--vary",
        "amount",
        heading="An earlier motif",
        type=FiniteRange(0, 1),
        help="With --from, --like or --config: how far a relative may be, 0 to 1.",
    ),
)

#: Decorators that add the options for a motif's properties (``wanted``) and its beginning (``beginning``).
recipe_options = grouped("wanted", Wanted, _RECIPE)
beginning_options = grouped("beginning", Beginning, _BEGINNING)
