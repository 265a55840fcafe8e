"""Options that ``motif``, ``repeat`` and ``join`` share: printing of inks, and writing."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import toposeam as ts
from toposeam.motif.ink.mixing import mix
from toposeam.motif.ink.pdf import draw_pdf
from toposeam.motif.ink.printing import Inked
from toposeam.motif.symmetry.kaleidoscope import GROUPS
from toposeam.motif.symmetry.tiling import shift_of
from toposeam_cli.app.command import option
from toposeam_cli.app.options import FiniteRange, PaperLengthType
from toposeam_cli.files.writing import all_or_nothing, atomic_write, check_output
from toposeam_cli.media.pictures.picture import write_picture
from toposeam_cli.motifs.printing import DRAWINGS, Print, plate_path, printable, separation
from toposeam_cli.motifs.recipe_files import read_recipe, to_xmp

if TYPE_CHECKING:
    from toposeam.motif import Recipe


class RepeatType(click.Choice[str]):
    """A rule of repetition; ``drop`` and ``brick`` may be followed by a share."""

    name = "RULE"

    def __init__(self) -> None:
        super().__init__(ts.motif.REPEATS)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Parse the text."""
        text = " ".join(str(value).split())
        return text if shift_of(text) is not None else super().convert(value, param, ctx)


def check_laid(path: Path, rule: str, instead: str) -> None:
    """Refuse to lay a picture by a wallpaper group for which it was not made: its copies would be equal to
    those of any other group.

    Parameters
    ----------
    path : Path
    rule : str
    instead : str
        The remedy, for the error's text.

    Raises
    ------
    OptionError
    """
    if rule not in GROUPS or rule == "p1":
        return
    try:
        made = read_recipe(path).repeat
    except ts.TopoSeamError:
        made = None
    if made != rule:
        raise ts.OptionError(
            f"{path.name} was not made for {rule}, so its copies side by side would not show that; {instead}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintOptions:
    """Requested options of printing; None where one was not given."""

    width_mm: float | None = None
    dpi: float | None = None
    levels: int | None = None
    transparent: bool | None = None
    separations: bool = False

    def over(self, before: Mapping[str, Any], **others: Any) -> Print:
        """Return print settings: those of a file with the requested ones in their place."""
        asked = {option.name: getattr(self, option.name) for option in fields(self)} | others
        del asked["separations"]
        return Print(**(dict(before) | {name: value for name, value in asked.items() if value is not None}))


def print_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of `PrintOptions`, which come as one value, ``ink``."""

    @functools.wraps(command)
    def grouped(*arguments: Any, **given: Any) -> Any:
        ink = {option.name: given.pop(option.name) for option in fields(PrintOptions)}
        ink["transparent"] = ink["transparent"] or None
        return command(*arguments, ink=PrintOptions(**ink), **given)

    for each in reversed(
        (
            option(
                "--motif-width",
                "width_mm",
                heading="Print",
                type=PaperLengthType(),
                help="Width of one motif on paper: 80mm, 8cm or 3in.",
            ),
            option(
                "--dpi",
                heading="Print",
                type=FiniteRange(1, 10_000),
                help="Resolution, pixels per inch.  [default: 300 with --motif-width]",
            ),
            option(
                "--levels",
                heading="Print",
                type=click.IntRange(1, 64),
                help="For .svg: steps from paper to full ink.  [default: 12]",
            ),
            option("--transparent", heading="Print", is_flag=True, help="Leave the paper out."),
            option(
                "--separations",
                heading="Print",
                is_flag=True,
                help="Also write a gray picture of each ink, black where it is full: NAME.1-INK.tif.",
            ),
        )
    ):
        grouped = each(grouped)
    return grouped


def check_print(output: Path, names: tuple[str, ...], ink: PrintOptions, force: bool) -> None:
    """Refuse outputs that cannot be written, before any work."""
    if ink.separations:
        if output.suffix.lower() in DRAWINGS:
            raise ts.OptionError(
                f"a {output.suffix.lower()} has each ink as a layer of its own already; leave --separations "
                "out, or write a .tif"
            )
        for number, name in enumerate(names, 1):
            check_output(plate_path(output, number, name), force)


def write_print(
    output: Path,
    made: Inked,
    coverage: Callable[[], np.ndarray],
    paper: Print,
    ink: PrintOptions,
    force: bool,
    note: Mapping[str, Any] | None = None,
) -> str:
    """Write a drawing, or a picture and its separations; return a line about its size.

    Parameters
    ----------
    output : Path
        .svg, or a picture.
    made : Inked
    coverage : callable
        The (n_L, H, W) share of ink of the picture.
    paper : Print
    ink : PrintOptions
    force : bool
    note : mapping, optional
        Entries of the file's settings besides its recipe.
    """
    settings = {**paper.note(), **(note or {}), **made.record}
    if output.suffix.lower() in DRAWINGS:
        options = ts.motif.SvgOptions(
            levels=paper.levels, width_mm=paper.width_mm, transparent=paper.transparent
        )
        if output.suffix.lower() == ".pdf":
            page = draw_pdf(made, paper.counts, options=options, metadata=to_xmp(settings))
            atomic_write(output, page, force)
            return f"{len(page) / 1e6:.1f} MB"
        document = ts.motif.draw_svg(
            made, paper.counts, options=options, note={**paper.note(), **(note or {})}
        )
        atomic_write(output, document, force)
        return f"{len(document) / 1e6:.1f} MB"
    layers = coverage()
    alpha = 1.0 - np.prod(1.0 - layers, axis=0, dtype=np.float32) if paper.transparent else None
    image = mix(layers, made.inks, np.ones(3) if paper.transparent else made.paper, made.inking)
    with all_or_nothing():
        write_picture(output, printable(image, paper.resolution, settings, alpha), force)
        if ink.separations:
            for number, (layer, name) in enumerate(zip(layers, made.names, strict=True), 1):
                plate = separation(layer, paper.resolution, {**settings, "separation": name})
                write_picture(plate_path(output, number, name), plate, force)
    return f"{image.shape[1]} × {image.shape[0]} px"


def renamed(recipe: Recipe, names: str | None, edges: str | None) -> Recipe:
    """Return a recipe whose inks have other names and edges: one for all, or one per ink, separated by
    commas.
    """
    layers = recipe.layers
    if names is not None:
        words = _words(names, len(layers), "--spot-names")
        layers = tuple(replace(layer, name=word) for layer, word in zip(layers, words, strict=True))
    if edges is not None:
        words = _words(edges if "," in edges else ",".join([edges] * len(layers)), len(layers), "--edge")
        layers = tuple(replace(layer, edge=word) for layer, word in zip(layers, words, strict=True))
    return replace(recipe, layers=layers)


def _words(text: str, count: int, option: str) -> list[str]:
    words = [word.strip() for word in text.split(",")]
    if len(words) != count:
        raise ts.OptionError(f"{option} has {len(words)} words for {count} inks; give one for each, like a,b")
    return words
