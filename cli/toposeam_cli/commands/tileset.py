"""``toposeam tileset``: corner tiles of two materials, for maps of games."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import click

import toposeam as ts
from toposeam.sentence import printable
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import FILE, MEGAPIXELS, OUTPUT, force_option, quiet_option
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.writing import all_or_nothing, atomic_write, check_output, new_folder
from toposeam_cli.media.pictures.picture import check_values, write_picture
from toposeam_cli.textures.game_engines import godot_set, tiled_set
from toposeam_cli.textures.maps import Maps, suffix_of
from toposeam_cli.textures.material_folder import kind_of, maps_of_all, weights_of
from toposeam_cli.textures.options import alphas, read_sources

#: The files of a set, besides those of further maps.
_SHEET, _TILED, _GODOT, _FIELD = "tiles.png", "tiles.tsx", "tiles.tres", "field.png"
#: Rows and columns of tiles in the field that is shown.
_SHOWN = 8, 12


@click.command(cls=Command)
@click.argument("first", type=FILE)
@click.argument("second", type=FILE)
@option(
    "-o",
    "--output",
    heading="Output",
    type=OUTPUT,
    required=True,
    help="The folder of the set: tiles.png, tiles.tsx for Tiled, tiles.tres for Godot 4, and field.png, "
    "tiles laid at random to look at.",
)
@option(
    "--kind",
    heading="Tiles",
    type=click.Choice(["corners"]),
    default="corners",
    show_default=True,
    help="corners: each corner of a tile is one of the materials, so there are 16.",
)
@option(
    "--size",
    heading="Tiles",
    type=int,
    default=64,
    show_default=True,
    help="Side of a tile, px.",
)
@option(
    "--variants",
    heading="Tiles",
    type=int,
    default=4,
    show_default=True,
    help="How many tiles there are of each kind.",
)
@option(
    "--seed",
    heading="Tiles",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="The same seed makes the same tiles.",
)
@option(
    "--max-megapixels",
    heading="Speed and memory",
    type=MEGAPIXELS,
    default=72.0,
    show_default=True,
    help="Refuse larger pictures.",
)
@option("--json", "as_json", heading="Output", is_flag=True, help="Print what was made as JSON.")
@force_option
@quiet_option
def tileset(
    first: Path,
    second: Path,
    output: Path,
    kind: str,
    size: int,
    variants: int,
    seed: int,
    max_megapixels: float,
    as_json: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Make tiles of two materials that fit each other, for maps of games.

    FIRST and SECOND are pictures of the materials, or folders with their maps, as `toposeam tile` takes them.

    \b
    toposeam tileset grass.png dirt.png -o meadow
    toposeam tileset grass.png dirt.png --size 128 --variants 8 -o meadow
    """  # noqa: D301 - click wants the character
    pictures, also, normal = _files(first, second)
    further = [
        (kind_of(path), suffix_of([path, other])) for path, other in zip(also[::2], also[1::2], strict=True)
    ]
    further += [("normal", suffix_of(normal))] if normal else []
    names = [f"tiles_{found}{suffix}".replace(", ", "_") for found, suffix in further]
    _check(output, (_SHEET, *names, _TILED, _GODOT, _FIELD), force)
    samples = read_sources(pictures, max_megapixels)
    for sample in samples:
        check_values(output / _SHEET, sample)
    if alphas(samples) is not None:
        raise ts.ImageError(
            f"{first.name} or {second.name} is transparent in places, and tiles cover all of a map; fill "
            "these first, or crop to what is opaque"
        )
    maps = Maps.read(also, normal, 2, round(max_megapixels * 1e6))
    with share_bar(f"laying {output.name}", quiet) as progress:
        made = ts.texture.tile_set(
            [one.pixels for one in samples],
            size,
            variants=variants,
            seed=seed,
            progress=progress,
            **maps.keywords(samples[0], weights_of(len(names))),
        )
    called = [printable(path.stem) for path in (first, second)]
    with new_folder(output), all_or_nothing():
        write_picture(output / _SHEET, dataclasses.replace(samples[0], pixels=made.image), force)
        for name, one in zip(names, maps.made(made), strict=True):
            write_picture(output / name, one, force)
        field = made.field(*_SHOWN, seed)
        write_picture(output / _FIELD, dataclasses.replace(samples[0], pixels=field), force)
        atomic_write(output / _TILED, tiled_set(made, _SHEET, called), force)
        atomic_write(output / _GODOT, godot_set(made, _SHEET, called), force)
    tiles = len(made.corners)
    if as_json:
        told = {
            "output": str(output),
            "tiles": tiles,
            "size": size,
            "files": [_SHEET, *names, _TILED, _GODOT, _FIELD],
        }
        say(json.dumps(told, indent=2), lines=True)
    elif not quiet:
        say(
            f"{output}: {tiles} tiles of {size} × {size} px; {_TILED} is for Tiled, {_GODOT} for Godot, "
            f"{_FIELD} to look at"
        )


def _files(first: Path, second: Path) -> tuple[list[Path], list[Path], list[Path]]:
    """Find pictures, further maps and normals of the materials."""
    if first.is_dir() != second.is_dir():
        folder, other = (first, second) if first.is_dir() else (second, first)
        raise ts.OptionError(
            f"'{folder}' is a folder of maps, but '{other}' is not; give either both of one kind"
        )
    return maps_of_all([first, second]) if first.is_dir() else ([first, second], [], [])


def _check(folder: Path, names: tuple[str, ...], force: bool) -> None:
    """Refuse a folder that cannot be made, or has other files of these names."""
    if not folder.is_dir():
        check_output(folder, suffixes=None)
        return
    for name in names:
        check_output(folder / name, force, suffixes=None)
