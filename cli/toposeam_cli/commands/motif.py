"""``toposeam motif``: invent a motif that repeats."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import toposeam as ts
from toposeam.colours import parse_colour
from toposeam.motif.generate import MAX_MEGAPIXELS
from toposeam.motif.ink.palettes import Palette
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import MEGAPIXELS, OUTPUT, PairType, force_option, quiet_option
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.writing import all_or_nothing, atomic_write, check_output, replacing
from toposeam_cli.motifs.options import Beginning, Wanted, beginning_options, recipe_options
from toposeam_cli.motifs.print_options import (
    PrintOptions,
    check_print,
    print_options,
    renamed,
    write_print,
)
from toposeam_cli.motifs.printing import (
    DRAWINGS,
    SUFFIXES,
    Print,
    describe,
    ink_names,
    sheet_coverage,
    unseen_inks,
)
from toposeam_cli.motifs.recipe_files import (
    read_recipe,
    read_settings,
    read_toml,
    recipe_from_table,
    recipe_on_page,
    to_toml,
)
from toposeam_cli.motifs.themes import read_colours, read_theme

if TYPE_CHECKING:
    from toposeam.motif import Motif, Recipe

#: Options that may change a given recipe: fields of `Recipe`, then fields of each of its layers.
_OF_RECIPE = (
    "size",
    "repeat",
    "iterations",
    "move",
    "filter_radius",
    "coarse",
    "base",
    "base_strength",
    "base_law",
    "inking",
    "paper",
)
_OF_LAYERS = ("mass", "penalty", "ambient", "avoid")
#: Extensions of the pages of ``--explore``.
_PAGES = (".html", ".htm")


@click.command(
    cls=Command,
    everyday=[
        "output",
        "style",
        "repeat",
        "layers",
        "palette",
        "seed",
        "size",
        "base",
        "like",
        "sheet",
        "motif-width",
        "force",
    ],
)
@option("-o", "--output", heading="Output", type=OUTPUT, help="The motif: .png, .tif, .svg or .pdf.")
@recipe_options
@option(
    "--edge",
    heading="Print",
    help="How strokes end in print: crisp, ink (shaded inside) or soft; one, or one per layer.",
)
@beginning_options
@option(
    "--sheet", heading="Print", type=PairType(cells=True), help="Write COLUMNSxROWS motifs instead of one."
)
@option(
    "--pixels",
    heading="Print",
    type=PairType(),
    help="Size of the whole picture in px, WIDTHxHEIGHT; the columns of --sheet fill its width.",
)
@print_options
@option(
    "--spot-names",
    heading="Print",
    help="What the inks are called in separations and layers: 'PANTONE 300 C,Black 6 C'.",
)
@option(
    "--explore",
    heading="Output",
    type=PairType(cells=True),
    help="A page of COLUMNSxROWS relatives to choose from, as .html; with --from, --like or --config of that "
    "one.",
)
@option(
    "--depth",
    heading="Output",
    type=click.IntRange(8, 512),
    help="Let heat flow through a block this many elements high, and write the mesh: .stl or .ply.",
)
@option(
    "--colourways",
    heading="Output",
    help="Also write it in these palettes, from the same densities: spring,sea makes NAME-spring.png …",
)
@option("--palettes", heading="Output", is_flag=True, help="Print the named palettes.")
@option("--styles", heading="Output", is_flag=True, help="Print the styles, and what they look like.")
@option(
    "--show-recipe",
    heading="Output",
    is_flag=True,
    help="Print the recipe as TOML; without -o nothing is made.",
)
@option(
    "--max-megapixels",
    heading="Speed and memory",
    type=MEGAPIXELS,
    default=MAX_MEGAPIXELS,
    show_default=True,
    help="Refuse motifs of more elements, or whose layers together iterate 100 times as many.",
)
@force_option
@quiet_option
def motif(
    output: Path | None,
    wanted: Wanted,
    beginning: Beginning,
    sheet: tuple[int, int] | None,
    pixels: tuple[int, int] | None,
    ink: PrintOptions,
    spot_names: str | None,
    edge: str | None,
    explore: tuple[int, int] | None,
    depth: int | None,
    colourways: str | None,
    palettes: bool,
    styles: bool,
    show_recipe: bool,
    max_megapixels: float,
    force: bool,
    quiet: bool,
) -> None:
    """Invent a motif by leading heat from sources to sinks, one layer of ink at a time.

    \b
    toposeam motif -o motif.png --seed 7
    toposeam motif -o motif.png --style fern --repeat p4m --palette fall
    toposeam motif -o sheet.svg --sheet 4x4 --motif-width 60mm --base logo.png
    toposeam motif -o sister.png --like motif.png --vary 0.3 --seed 2
    toposeam motif -o relatives.html --like motif.png --explore 5x4
    toposeam motif -o seventh.png --from relatives.html --number 7
    toposeam motif -o vase.stl --depth 64 --repeat p4m --motif-width 80mm
    """  # noqa: D301 - click wants the character
    if palettes or styles:
        _list(palettes, styles)
        return
    if output is None and not show_recipe:
        raise click.UsageError("say where the motif goes: -o motif.png, .tif, .svg or .pdf")
    if output is not None:
        check_output(output, force, (".html",) if explore else (".stl", ".ply") if depth else SUFFIXES)
    if depth is not None:
        if explore or sheet or pixels or ink != PrintOptions(width_mm=ink.width_mm):
            raise ts.OptionError(
                "--depth makes a solid, which is not printed on paper; of the options for that it knows "
                "--motif-width only"
            )
        _solid(output, depth, wanted.given(), beginning, ink.width_mm, max_megapixels, force, quiet)
        return
    if explore is not None:
        _explore(output, explore, wanted.given(), beginning, max_megapixels, force, quiet)
        return
    recipe, sheet_was = _recipe(wanted.given(), beginning.amount, _begun(beginning))
    recipe = renamed(recipe, spot_names, edge)
    paper = ink.over(sheet_was, counts=None if sheet is None else sheet[::-1], pixels=pixels)
    if show_recipe:
        say(to_toml(recipe), lines=True, nl=False)
    if output is None:
        return
    drawn = output.suffix.lower() in DRAWINGS
    paper.check(recipe, drawn)
    if pixels is not None and (ink.width_mm is not None or drawn):
        raise ts.OptionError(
            "--pixels sets the size of a .png or .tif; leave it out with --motif-width and for .svg and .pdf"
        )
    others = _colourways(colourways, output, len(recipe.layers))
    for path in (output, *others):
        check_output(path, force, SUFFIXES)
        check_print(path, ink_names(recipe), ink, force)
    with share_bar(f"inventing {output.name}", quiet) as bar, _allowing_more():
        made = ts.motif(recipe, max_megapixels=max_megapixels, progress=bar)
    extent = _write(output, made, paper, ink, others, wanted.paper is not None, force)
    if not quiet:
        unseen = unseen_inks(recipe)
        if unseen is not None:
            say(unseen, err=True)
        say(f"{output}: {extent}, {describe(made, paper.counts)}", err=show_recipe)


@contextmanager
def _allowing_more() -> Iterator[None]:
    """Name the option that allows a larger motif."""
    try:
        yield
    except ts.OptionError as error:
        if error.kind != "too large":
            raise
        raise error.within("{error}, or allow more with --max-megapixels") from None


def _list(palettes: bool, styles: bool) -> None:
    """Print the palettes, and the styles."""
    rows = [(name, " ".join(colours)) for name, colours in ts.motif.PALETTES.items()] if palettes else []
    rows += [(name, style.look) for name, style in ts.motif.STYLES.items()] if styles else []
    for name, words in rows:
        say(f"{name:<11} {words}")


def _write(
    output: Path,
    made: Motif,
    paper: Print,
    ink: PrintOptions,
    others: Mapping[Path, Palette],
    keeps_paper: bool,
    force: bool,
) -> str:
    """Write a motif and its colourways, all or none; return a line about its size."""
    layers: list[np.ndarray] = []

    def coverage() -> np.ndarray:
        if not layers:
            layers.append(sheet_coverage(made, paper))
        return layers[0]

    with all_or_nothing():
        extent = write_print(output, made, coverage, paper, ink, force)
        for path, way in others.items():
            colours = dataclasses.replace(way, paper=made.paper) if keeps_paper else way
            write_print(path, made.recoloured(colours), coverage, paper, ink, force)
    return extent


def _colourways(text: str | None, output: Path, layers: int) -> dict[Path, Palette]:
    """Return the files of a motif's colourways, and the palette of each."""
    found: dict[Path, Palette] = {}
    for word in [] if text is None else text.split(","):
        colours = read_colours(word.strip())
        chosen = colours if isinstance(colours, Palette) else ts.motif.palette(colours, layers)
        if len(chosen.inks) < layers:
            raise ts.OptionError(f"{word} has {len(chosen.inks)} inks for {layers} layers; name more colours")
        name = "-".join(re.findall(r"[\w#]+", Path(word.strip()).stem)).replace("#", "")
        found[output.with_name(f"{output.stem}-{name}{output.suffix}")] = chosen
    return found


def _solid(
    output: Path | None,
    depth: int,
    given: dict[str, Any],
    beginning: Beginning,
    width_mm: float | None,
    max_megapixels: float,
    force: bool,
    quiet: bool,
) -> None:
    """Write a mesh of the solid that heat builds in a block."""
    if output is None:
        raise ts.OptionError("--depth makes a mesh; say where it goes with -o vase.stl, or .ply")
    begun = _begun(beginning)
    alone = begun[0] is None and not begun[2]
    given = (
        {"size": (depth, depth)} | ({"repeat": "none", "layers": 1, "style": "vein"} if alone else {}) | given
    )
    recipe, _ = _recipe(given, beginning.amount, begun)
    recipe = dataclasses.replace(recipe, layers=recipe.layers[:1])
    with share_bar(f"inventing {output.name}", quiet) as bar, _allowing_more():
        solid = ts.solid.generate_solid(recipe, depth, max_megapixels=max_megapixels, progress=bar)
    element = 1.0 if width_mm is None else width_mm / recipe.size[1]
    mesh = solid.mesh(element)
    with replacing(output, force) as temporary:
        (mesh.to_ply if output.suffix.lower() == ".ply" else mesh.to_stl)(temporary)
    if not quiet:
        rows, columns = recipe.size
        extent = " × ".join(f"{side * element:.0f}" for side in (columns, rows, depth))
        say(
            f"{output}: a block of {extent} mm, {len(mesh.faces)} triangles, {mesh.volume / 1000:.1f} ml"
            + (f" in {solid.pieces} pieces" if solid.pieces > 1 else "")
        )


def _explore(
    output: Path | None,
    counts: tuple[int, int],
    wanted: dict[str, Any],
    beginning: Beginning,
    max_megapixels: float,
    force: bool,
    quiet: bool,
) -> None:
    """Write a page of related motifs: variations of a given one, or other seeds."""
    if output is None:
        raise ts.OptionError("--explore makes a page; say where it goes with -o sheet.html")
    if counts[0] * counts[1] > 200:
        raise ts.OptionError(
            f"{counts[0]} × {counts[1]} motifs are too many to choose from; ask for 200 at most"
        )
    from toposeam_cli.motifs.book.exploring import explore_page

    first = int(wanted.pop("seed", 0))
    begun = _begun(beginning)
    relative = begun[0] is not None
    recipes = []
    for number in range(counts[0] * counts[1]):
        given = dict(wanted) | ({} if relative and number == 0 else {"seed": first + number})
        amount = None
        if relative and number:
            amount = 0.4 if beginning.amount is None else beginning.amount
        recipes.append(_recipe(given, amount, begun)[0])
    with share_bar(f"inventing {len(recipes)} motifs", quiet) as bar, _allowing_more():
        page = explore_page(recipes, counts[0], max_megapixels, bar)
    atomic_write(output, page, force)
    if not quiet:
        say(f"{output}: {len(recipes)} motifs; open it, and click those to keep")


def _begun(beginning: Beginning) -> tuple[Recipe | None, dict[str, Any], dict[str, Any]]:
    """Return the recipe to begin with, the print settings of its motif, and the options of a file of
    parameters.
    """
    config, like, source = beginning.config, beginning.like, beginning.source
    if sum(path is not None for path in (config, like, source)) > 1:
        raise ts.OptionError("--from, --config and --like each say what the motif is; leave one of them out")
    kind = "" if source is None else source.suffix.lower()
    if beginning.number is not None and kind not in _PAGES:
        raise ts.OptionError("--number is that of a motif on a page; name the page with --from sheet.html")
    if source is not None and kind in _PAGES:
        return recipe_on_page(source, beginning.number), {}, {}
    config, like = (source, None) if kind == ".toml" else (config, like or source)
    if config is not None:
        table = read_toml(config)
        whole = recipe_from_table(table, config)
        return whole, {}, {} if whole is not None else _checked(table, config)
    if like is not None:
        return read_recipe(like), Print.read(read_settings(like)), {}
    return None, {}, {}


def _recipe(
    given: dict[str, Any],
    amount: float | None,
    begun: tuple[Recipe | None, dict[str, Any], dict[str, Any]],
) -> tuple[Recipe, dict[str, Any]]:
    """Return the varied recipe of the options and its base, and the print settings of that base."""
    whole, printed, options = begun
    given = {**options, **given}
    if isinstance(given.get("palette"), str):
        given["palette"] = read_colours(given["palette"])
    if isinstance(given.get("base"), Path):
        given["base"] = read_theme(given["base"])
    if whole is not None:
        return _changed(whole, given, amount), printed
    if amount is not None:
        raise ts.OptionError(
            "--vary needs a motif to begin with; name one with --from or --like, or a recipe with --config"
        )
    given = {"repeat": None, "style": None, **given}
    width, height = given.pop("size", (256, 256))
    return ts.motif.random_recipe((height, width), **given), printed


def _checked(table: Mapping[str, Any], config: Path) -> dict[str, Any]:
    """Return options from a file of parameters, named as on the command line."""
    names = {parameter.name: parameter for parameter in motif.params}
    places = {"filter": "filter_radius"}
    options: dict[str, Any] = {}
    for key, value in table.items():
        name = places.get(key, key.replace("-", "_"))
        parameter = names.get(name)
        if parameter is None or name in _NOT_IN_FILES:
            known = sorted(str(known) for known in set(names) - _NOT_IN_FILES)
            raise ts.OptionError(f"'{config}' has {key!r}, which is no parameter; use {', '.join(known)}")
        if (
            name in ("sources", "sinks")
            and isinstance(value, list)
            and any(isinstance(place, list) for place in value)
        ):
            options[name] = _with_strengths(value)  # only files can hold places
            continue
        if name == "edge":
            options[name] = value
            continue
        text = value if isinstance(value, list) else str(value)
        try:
            options[name] = parameter.type.convert(text, None, None)
        except (click.BadParameter, TypeError) as error:
            raise ts.OptionError(
                f"'{config}' has {key} = {value!r}: {getattr(error, 'message', error)}"
            ) from error
    if "base" in options:
        options["base"] = config.parent / options["base"]
    if "palette" in options:
        options["palette"] = read_colours(str(options["palette"]), config.parent)
    return options


_NOT_IN_FILES = {
    *(
        "output",
        "config",
        "like",
        "amount",
        "sheet",
        "pixels",
        "palettes",
        "styles",
        "show_recipe",
        "force",
        "quiet",
    ),
    *("explore", "depth", "source", "number", "colourways"),
    *("width_mm", "dpi", "levels", "transparent", "separations", "spot_names"),
}


def _with_strengths(places: list[Any]) -> list[Any]:
    """Return places, or those of each layer, each with a strength: 1 where none is given."""
    if places and all(isinstance(number, int | float) for number in places):
        return [*places, 1.0] if len(places) == 2 else places
    return [_with_strengths(place) if isinstance(place, list) else place for place in places]


def _changed(recipe: Recipe, given: dict[str, Any], amount: float | None) -> Recipe:
    """Return a whole recipe with the given options changed, then varied."""
    seed = given.pop("seed", None)
    palette, style = given.pop("palette", None), given.pop("style", None)
    wrong = [name for name in given if name not in (*_OF_RECIPE, *_OF_LAYERS)]
    if wrong:
        raise ts.OptionError(
            f"--{wrong[0]} cannot change a motif that is there; leave it out, or write a recipe with "
            "--show-recipe and edit that"
        )
    if seed is not None or amount is not None:
        recipe = ts.motif.vary(
            recipe,
            amount=1.0 if amount is None else amount,
            seed=recipe.seed + 1 if seed is None else seed,
        )
    if style is not None:
        recipe = ts.motif.restyle(recipe, style)
    layers = [dataclasses.asdict(layer) for layer in recipe.layers]
    for name in {"iterations", "filter_radius"} & set(given):  # of all layers
        layers = [{**layer, name: None} for layer in layers]
    for name in set(given) & set(_OF_LAYERS):
        value = given.pop(name)
        values = list(value) if isinstance(value, tuple | list) else [value] * len(layers)
        if len(values) != len(layers):
            raise ts.OptionError(
                f"--{name} has {len(values)} numbers for {len(layers)} layers; give one, or one for each"
            )
        for layer, number in zip(layers, values, strict=True):
            layer[name] = number
    if palette is not None:
        colours = palette if isinstance(palette, Palette) else ts.motif.palette(palette, len(layers))
        if len(colours.inks) < len(layers):
            raise ts.OptionError(
                f"the palette has {len(colours.inks)} inks for {len(layers)} layers; name more colours"
            )
        for layer, ink in zip(layers, colours.inks, strict=False):
            layer["ink"] = tuple(ink)
        given["paper"] = tuple(colours.paper)
    if isinstance(given.get("paper"), str):
        given["paper"] = parse_colour(given["paper"])
    if "size" in given:
        given["size"] = given["size"][::-1]
    if "base" in given:
        from toposeam.motif.recipe.recipe import pack_base

        given = {"base_strength": recipe.base_strength or 0.7, **given, "base": pack_base(given["base"])}
    return dataclasses.replace(
        recipe, layers=tuple(ts.motif.LayerRecipe(**layer) for layer in layers), **given
    )
