"""``toposeam motif``: invent a motif that repeats."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.motif.hexagonal import tile_size
from toposeam.motif.motif import MAX_PATTERN
from toposeam.motif.palettes import Palette, parse_colour
from toposeam.motif.svg import SvgOptions, check_counts, draw_svg
from toposeam.motif.symmetry import HEXAGONAL
from toposeam.motif.vary import vary
from toposeam_cli.colour import to_depth
from toposeam_cli.libvips import load_vips
from toposeam_cli.output import atomic_write, check_output
from toposeam_cli.parameters import FILE, OUTPUT, FiniteRange, NumbersType, PairType, PaperLengthType
from toposeam_cli.picture import Picture, read_picture, write_picture
from toposeam_cli.progress import share_bar
from toposeam_cli.recipe_file import read_recipe, read_settings, read_toml, recipe_from_table, to_toml, to_xmp

SUFFIXES = (".png", ".tif", ".tiff", ".svg")
#: Resolution of a motif whose width on paper is given, without --dpi.
_DPI = 300.0
#: A theme or a palette is not taken from larger pictures.
_MAX_PIXELS = 500_000_000

#: What may be changed in a recipe that is given: options of a random one that are fields of `Recipe`, or of each of its layers.
_OF_RECIPE = ("size", "repeat", "iterations", "move", "filter_radius", "coarse", "base", "base_strength")
_OF_LAYERS = ("mass", "penalty", "ambient")


@click.command()
@click.option("-o", "--output", type=OUTPUT, help="The motif: .png, .tif or .svg.")
@click.option("--size", type=PairType(), help="Elements of one motif: N, or WIDTHxHEIGHT.  [default: 256]")
@click.option("--layers", type=click.IntRange(1, 16), help="Number of inks.  [default: 3]")
@click.option("--repeat", type=click.Choice(ts.REPEATS), help="The rule it repeats by.  [default: translate]")
@click.option("--seed", type=click.IntRange(0), help="Everything that is not given follows from it.  [default: 0]")
@click.option("--palette", help="A name, a picture, or colours: '#paper #ink #ink'.  [default: from the seed]")
@click.option("--base", type=FILE, help="A logo, symbol or photograph that shapes the strokes.")
@click.option("--base-strength", type=FiniteRange(-1, 1), help="How strongly it shows; below 0 strokes keep to its dark parts.")
@click.option("--mass", type=NumbersType(float), help="Share of the area that is inked; one number, or one per layer: 0.2,0.3.")
@click.option("--p", "penalty", type=NumbersType(float), help="Penalty exponent: 1 for ink wash, 3 for distinct strokes.")
@click.option("--iterations", type=click.IntRange(1, 10_000), help="Strokes become more distinct with each.  [default: 40]")
@click.option("--move", type=FiniteRange(0, 1, min_open=True), help="Largest change of a density in an iteration.")
@click.option("--sources", type=NumbersType(int), help="Number of heat sources, or one number per layer.")
@click.option("--sinks", type=NumbersType(int), help="Number of heat sinks, or one number per layer.")
@click.option("--distance", type=FiniteRange(0, 1, min_open=True), help="From sinks to sources, as a share of the cell: near is wide.")
@click.option("--ambient", type=FiniteRange(0, 1), help="Share of the heat that comes from everywhere; it makes strokes branch.")
@click.option("--filter", "filter_radius", type=FiniteRange(0, 10), help="Radius of the filter, in hundredths of the cell.")
@click.option("--config", type=FILE, help="TOML file with these options, or a whole recipe; see --show-recipe.")
@click.option("--like", type=FILE, help="Make the motif in this file again; with --seed or --vary, a relative of it.")
@click.option("--vary", "amount", type=FiniteRange(0, 1), help="With --like or --config: how far a relative may be, 0 to 1.")
@click.option("--sheet", type=PairType(first="rows"), help="Write ROWSxCOLUMNS motifs instead of one.")
@click.option("--pixels", type=PairType(), help="Size of the whole picture in px, WIDTHxHEIGHT; the columns of --sheet fill its width.")
@click.option("--motif-width", type=PaperLengthType(), help="Width of one motif on paper: 80mm, 8cm or 3in.")
@click.option("--dpi", type=FiniteRange(1, 10_000), help="Resolution, pixels per inch.  [default: 300 with --motif-width]")
@click.option("--levels", type=click.IntRange(1, 64), help="Steps from paper to full ink in an SVG.  [default: 12]")
@click.option("--show-recipe", is_flag=True, help="Print the recipe as TOML; without -o nothing is made.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def motif(
    output: Path | None, config: Path | None, like: Path | None, amount: float | None, sheet: tuple[int, int] | None,
    pixels: tuple[int, int] | None, motif_width: float | None, dpi: float | None, levels: int | None, show_recipe: bool, force: bool,
    quiet: bool, **given: Any,
) -> None:  # fmt: skip
    """Invent a motif by leading heat from sources to sinks, one layer of ink at a time.

    \b
    toposeam motif -o motif.png --repeat p4m --palette fall --seed 7
    toposeam motif -o sheet.svg --sheet 4x4 --motif-width 60mm --base logo.png
    toposeam motif -o sister.png --like motif.png --vary 0.3 --seed 2
    """  # noqa: D301 - click wants the character
    if output is None and not show_recipe:
        raise click.UsageError("say where the motif goes: -o motif.png, .tif or .svg")
    if output is not None:
        check_output(output, force, SUFFIXES)
    recipe, sheet_was = _recipe({name: value for name, value in given.items() if value is not None}, config, like, amount)
    chosen = {"counts": sheet, "pixels": pixels, "width_mm": motif_width, "dpi": dpi, "levels": levels}
    paper = Print(**(sheet_was | {name: value for name, value in chosen.items() if value is not None}))
    if show_recipe:
        click.echo(to_toml(recipe), nl=False)
    if output is None:
        return
    drawn = output.suffix.lower() == ".svg"
    paper.check(recipe, drawn)
    if pixels is not None and (motif_width is not None or drawn):
        raise ts.OptionError("--pixels sets the size of a .png or .tif; leave it out with --motif-width and for .svg")
    with share_bar(f"inventing {output.name}", quiet) as bar:
        made = ts.generate_motif(recipe, progress=None if bar is None else lambda done, total: bar(done / total))
    if drawn:
        options = SvgOptions(levels=paper.levels, width_mm=paper.width_mm)
        document = draw_svg(made, paper.counts, options=options, note=paper.note())
        atomic_write(output, document, force)
        extent = f"{len(document) / 1e6:.1f} MB"
    else:
        image = ts.repeat(made, *paper.laid(recipe))
        if paper.pixels is not None:
            image = image[: paper.pixels[1], : paper.pixels[0]]
        write_picture(output, printable(image, paper.resolution, {**paper.note(), "recipe": recipe.to_dict()}), force)
        extent = f"{image.shape[1]} × {image.shape[0]} px"
    if not quiet:
        click.echo(f"{output}: {extent}, {describe(made, paper.counts)}", err=show_recipe)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Print:
    """How a motif goes to paper; kept beside the recipe."""

    #: Rows and columns of motifs.
    counts: tuple[int, int] = (1, 1)
    #: Width and height of the whole picture, px.
    pixels: tuple[int, int] | None = None
    #: Width of one motif, mm.
    width_mm: float | None = None
    dpi: float | None = None
    #: Steps from paper to full ink in a drawing.
    levels: int = 12

    @property
    def resolution(self) -> float | None:
        """Pixels per inch, None if nothing asks for any."""
        return _DPI if self.dpi is None and self.width_mm is not None and self.pixels is None else self.dpi

    def laid(self, recipe: ts.Recipe) -> tuple[tuple[int, int], tuple[int, int]]:
        """Rows and columns of motifs that are laid, and rows and columns of px of one, which keeps its shape.

        Where the size of the whole picture is given, as many columns as `counts` says fill its width, and what is too much below is cut.
        """
        height, width = tile_size(recipe.size[0]) if recipe.repeat in HEXAGONAL else recipe.size
        if self.pixels is not None:
            across = math.ceil(self.pixels[0] / self.counts[1])
        elif self.width_mm is not None and self.resolution is not None:
            across = max(1, round(self.width_mm / 25.4 * self.resolution))
        else:
            across = width
        size = max(1, round(across * height / width)), across
        rows = self.counts[0] if self.pixels is None else math.ceil(self.pixels[1] / size[0])
        return (rows, self.counts[1]), size

    def check(self, recipe: ts.Recipe, drawn: bool) -> None:
        """Refuse sheets that are too large, before any work."""
        if drawn:
            check_counts(self.counts)
            return
        (rows, columns), (height, width) = self.laid(recipe)
        if rows * columns * height * width > MAX_PATTERN:
            raise ts.OptionError(
                f"the picture would have {columns * width:,} × {rows * height:,} px, and at most {MAX_PATTERN:,} in all can be made;"
                " ask for fewer or smaller motifs, or a .svg"
            )

    def note(self) -> dict[str, Any]:
        """What is written into the file."""
        return {"print": dataclasses.asdict(self)}

    @staticmethod
    def read(settings: Mapping[str, Any]) -> dict[str, Any]:
        """The values in a file's settings, those that are damaged left out."""
        found = settings.get("print")
        if not isinstance(found, dict):
            return {}
        kept: dict[str, Any] = {}
        for name in ("counts", "pixels"):
            pair = found.get(name)
            if isinstance(pair, list) and len(pair) == 2 and all(isinstance(side, int) and 0 < side < 10**6 for side in pair):
                kept[name] = tuple(pair)
        for name in ("width_mm", "dpi", "levels"):
            value = found.get(name)
            if isinstance(value, int | float) and 0 < value < 10**5:
                kept[name] = value
        return kept


def describe(made: ts.Motif, counts: tuple[int, int]) -> str:
    """One line about a motif for people."""
    many = "" if counts == (1, 1) else f"{counts[0]} × {counts[1]} motifs, "
    inks = f"{len(made.inks)} ink{'s' if len(made.inks) > 1 else ''}"
    return f"{many}{inks}, repeats by {made.repeat}, seed {made.recipe.seed}"


def printable(image: np.ndarray, dpi: float | None, settings: Mapping[str, Any]) -> Picture:
    """A picture in sRGB with its resolution and recipe."""
    return Picture(
        pixels=to_depth(np.ascontiguousarray(image), np.dtype(np.uint8)),
        icc=bytes(load_vips().Image.profile_load("srgb")),
        resolution=None if dpi is None else (dpi / 25.4, dpi / 25.4),
        xmp=to_xmp(settings),
    )


def read_colours(text: str, folder: Path = Path()) -> str | Palette | np.ndarray:
    """What ``--palette`` names: a palette, colours, or a picture."""
    if "#" in text:
        colours = np.array([parse_colour(word) for word in text.replace(",", " ").split()])
        if len(colours) < 2:
            raise ts.OptionError(f"the palette {text!r} has no ink; write the paper's colour and one per layer")
        return Palette(paper=colours[0], inks=colours[1:])
    if Path(text).suffix:
        picture = read_picture(folder / text, _MAX_PIXELS)
        if picture.alpha is None:
            return picture.pixels
        if not picture.covered().any():
            raise ts.ImageError(f"the palette's picture '{text}' is transparent everywhere; give one with colours")
        return np.expand_dims(picture.pixels[picture.covered()], 0)  # a row of what can be seen
    return text


def read_theme(path: Path) -> np.ndarray:
    """A base image, with its alpha where it has one."""
    picture = read_picture(path, _MAX_PIXELS)
    if picture.alpha is None:
        return picture.pixels
    return np.concatenate([np.atleast_3d(picture.pixels), picture.alpha[..., None]], axis=2)


def _recipe(
    given: dict[str, Any], config: Path | None, like: Path | None, amount: float | None
) -> tuple[ts.Recipe, dict[str, Any]]:  # fmt: skip
    """The recipe of an option list, a file of parameters or another motif; and how that one was printed."""
    whole: ts.Recipe | None = None
    printed: dict[str, Any] = {}
    if config is not None:
        if like is not None:
            raise ts.OptionError("--config and --like both say what the motif is; leave one of them out")
        table = read_toml(config)
        whole = recipe_from_table(table, config)
        if whole is None:
            given = {**_checked(table, config), **given}
    elif like is not None:
        whole, printed = read_recipe(like), Print.read(read_settings(like))
    if isinstance(given.get("palette"), str):
        given["palette"] = read_colours(given["palette"])
    if isinstance(given.get("base"), Path):
        given["base"] = read_theme(given["base"])
    if whole is not None:
        return _changed(whole, given, amount), printed
    if amount is not None:
        raise ts.OptionError("--vary needs a motif to begin with; name one with --like, or a recipe with --config")
    options: dict[str, Any] = {"repeat": "translate", **given}
    width, height = options.pop("size", (256, 256))
    return ts.random_recipe((height, width), **options), printed


def _checked(table: Mapping[str, Any], config: Path) -> dict[str, Any]:
    """Options from a file of parameters, named as on the command line."""
    names = {parameter.name: parameter for parameter in motif.params}
    places = {"p": "penalty", "filter": "filter_radius"}
    options: dict[str, Any] = {}
    for key, value in table.items():
        name = places.get(key, key.replace("-", "_"))
        parameter = names.get(name)
        if parameter is None or name in _NOT_IN_FILES:
            known = sorted(str(known) for known in set(names) - set(_NOT_IN_FILES))
            raise ts.OptionError(f"'{config}' has {key!r}, which is no parameter; use {', '.join(known)}")
        if name in ("sources", "sinks") and isinstance(value, list) and any(isinstance(place, list) for place in value):
            options[name] = _with_strengths(value)  # places, which only files can hold
            continue
        text = value if isinstance(value, list) else str(value)
        try:
            options[name] = parameter.type.convert(text, None, None)
        except (click.BadParameter, TypeError) as error:
            raise ts.OptionError(f"'{config}' has {key} = {value!r}: {getattr(error, 'message', error)}") from error
    if "base" in options:
        options["base"] = config.parent / options["base"]
    if "palette" in options:
        options["palette"] = read_colours(str(options["palette"]), config.parent)
    return options


_NOT_IN_FILES = (
    "output", "config", "like", "amount", "sheet", "pixels", "motif_width", "dpi", "levels", "show_recipe", "force", "quiet",
)  # fmt: skip


def _with_strengths(places: list[Any]) -> list[Any]:
    """Places, or those of each layer, every one with a strength: 1 where none is given."""
    if places and all(isinstance(number, int | float) for number in places):
        return [*places, 1.0] if len(places) == 2 else places
    return [_with_strengths(place) if isinstance(place, list) else place for place in places]


def _changed(recipe: ts.Recipe, given: dict[str, Any], amount: float | None) -> ts.Recipe:
    """A whole recipe with what was given changed, then varied."""
    seed = given.pop("seed", None)
    palette = given.pop("palette", None)
    wrong = [name for name in given if name not in (*_OF_RECIPE, *_OF_LAYERS)]
    if wrong:
        raise ts.OptionError(
            f"--{wrong[0]} cannot change a motif that is there; leave it out, or write a recipe with --show-recipe and edit that"
        )
    if seed is not None or amount is not None:
        recipe = vary(recipe, 1.0 if amount is None else amount, recipe.seed + 1 if seed is None else seed)
    layers = [dataclasses.asdict(layer) for layer in recipe.layers]
    for name in set(given) & set(_OF_LAYERS):
        value = given.pop(name)
        values = list(value) if isinstance(value, tuple | list) else [value] * len(layers)
        if len(values) != len(layers):
            raise ts.OptionError(f"--{name} has {len(values)} numbers for {len(layers)} layers; give one, or one for each")
        for layer, number in zip(layers, values, strict=True):
            layer[name] = number
    if palette is not None:
        colours = palette if isinstance(palette, Palette) else ts.palette(palette, len(layers))
        if len(colours.inks) < len(layers):
            raise ts.OptionError(f"the palette has {len(colours.inks)} inks for {len(layers)} layers; name more colours")
        for layer, ink in zip(layers, colours.inks, strict=False):
            layer["ink"] = tuple(ink)
        given["paper"] = tuple(colours.paper)
    if "size" in given:
        given["size"] = given["size"][::-1]
    if "base" in given:
        from toposeam.motif.recipe import pack_base

        given = {"base_strength": recipe.base_strength or 0.7, **given, "base": pack_base(given["base"])}
    return dataclasses.replace(recipe, layers=tuple(ts.LayerRecipe(**layer) for layer in layers), **given)
