"""``toposeam synth``: a large texture from small samples."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam.sentence import counted
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import (
    FILE,
    OUTPUT,
    AutoSize,
    FiniteRange,
    TextureSizeType,
    grouped,
    refuse_besides,
)
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.media.pictures.picture import Picture, check_size, read_picture, write_picture
from toposeam_cli.textures.maps import Maps, white_of
from toposeam_cli.textures.material_folder import kind_of
from toposeam_cli.textures.options import (
    Destinations,
    LatticeType,
    Patches,
    Results,
    Search,
    WeightsType,
    alphas,
    patch_options,
    read_sources,
    result_options,
    search_options,
    summary,
    unfolded,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Guided:
    """Options that guide a texture's appearance."""

    guide: Path | None
    guide_source: tuple[Path, ...]
    guide_weight: float

    def __post_init__(self) -> None:
        if (self.guide is None) != (not self.guide_source):
            raise ts.OptionError(
                "--guide and --guide-source belong together: what is wanted, and what the source stands for; "
                "give both"
            )

    def read(self, max_pixels: int) -> dict[str, Any]:
        """Read the guides, as keywords of ``synthesize``."""
        if self.guide is None:
            return {}
        return {
            "guide": read_picture(self.guide, max_pixels=max_pixels).pixels,
            "guide_source": [read_picture(path, max_pixels=max_pixels).pixels for path in self.guide_source],
            "guide_weight": self.guide_weight,
        }


_GUIDE = (
    option(
        "--guide",
        heading="Texture",
        type=FILE,
        help="What the texture should look like, a picture of its size; needs --guide-source.",
    ),
    option(
        "--guide-source",
        heading="Texture",
        type=FILE,
        multiple=True,
        help="What the source looks like in the guide's terms; once per source.",
    ),
    option(
        "--guide-weight",
        heading="Texture",
        type=FiniteRange(0, 1),
        default=0.8,
        show_default=True,
        help="How much the guide counts.",
    ),
)


@click.command(
    cls=Command,
    everyday=[
        "output",
        "size",
        "tileable",
        "seed",
        "setting",
        "normal",
        "patch",
        "variation",
        "seams",
        "force",
    ],
)
@click.argument("sources", metavar="SOURCE...", type=FILE, nargs=-1, required=True)
@option(
    "--size",
    heading="Texture",
    type=TextureSizeType(),
    help="Width and height of the texture, px; one number for a square; auto, or auto: and a size: the "
    "nearest one on which bricks, threads or lines close without being stretched.",
)
@option(
    "-o",
    "--output",
    heading="Output",
    type=OUTPUT,
    required=True,
    help="The texture: .png, .tif, .jpg or .webp; a folder where SOURCE is a folder of maps.",
)
@patch_options
@option(
    "--tileable",
    heading="Texture",
    type=click.Choice(ts.texture.TILEABLE),
    default="none",
    show_default=True,
    help="The axes along which the texture repeats.",
)
@option(
    "--turns",
    heading="Texture",
    type=click.Choice(ts.typing.TURNS),
    default="none",
    show_default=True,
    help="Also take patches mirrored left to right, turned by quarters, or both.",
)
@option(
    "--setting",
    heading="Texture",
    type=click.Choice(ts.typing.SETTING_NAMES),
    default="auto",
    show_default=True,
    help="Patches of a few elements (fine) or half as large as SOURCE (coarse); those that fit best, mixed "
    "or varied. auto: the best of small trials. Instead of --patch and --variation.",
)
@option(
    "--lattice",
    heading="Texture",
    type=LatticeType(),
    help="The periods at which SOURCE repeats itself, across and down, px, 0 for none, and how far each row "
    "is shifted, like 64x48 or 80x24,40; by default the order that is seen, if any.",
)
@option(
    "--variation",
    heading="Texture",
    type=FiniteRange(0, 1),
    help="From 0, patches that fit best and repeat, to 1, all of SOURCE equally often; 0.5 is usual. Instead "
    "of --tolerance, --candidates, --most and --variety.",
)
@option(
    "--from",
    "source",
    heading="Texture",
    type=FILE,
    multiple=True,
    help="Copy only from where this picture is white; once per SOURCE.",
)
@option(
    "--shares",
    heading="Texture",
    type=WeightsType(),
    help="On how much of the texture each SOURCE shows, like 3,1; by default wherever it fits best.",
)
@option(
    "--transparent",
    heading="Texture",
    is_flag=True,
    help="Opacity is part of the texture, as of lace or scattered leaves: holes are grown along.",
)
@option(
    "--preview",
    heading="Output",
    type=OUTPUT,
    help="Also write the texture while it grows, at most 512 px a side, to look at.",
)
@option("--flatten", heading="Light", is_flag=True, help="Take slow light out of SOURCE first.")
@option(
    "--level/--no-level",
    heading="Light",
    default=None,
    help="Level light between patches; by default where SOURCE has slow light or is fibres, and where it is "
    "smooth steps at seams are eased. Not for normals or heights.",
)
@option(
    "-j",
    "--jobs",
    "processes",
    heading="Speed and memory",
    type=click.IntRange(1, 1024),
    default=1,
    show_default=True,
    help="How many processes work on it; it looks the same for any number. Windows and macOS have one.",
)
@grouped("guided", Guided, _GUIDE)
@option(
    "--use-coordinates",
    heading="Texture",
    type=FILE,
    help="Cut SOURCE as another texture was cut: what its --coordinates wrote.",
)
@search_options
@result_options
def synth(
    sources: tuple[Path, ...],
    size: tuple[int, int] | AutoSize | None,
    output: Path,
    patches: Patches,
    tileable: ts.texture.Tileable,
    turns: ts.typing.Turns,
    setting: ts.typing.Setting,
    lattice: tuple[float, ...] | None,
    variation: float | None,
    source: tuple[Path, ...],
    shares: tuple[float, ...] | None,
    transparent: bool,
    preview: Path | None,
    flatten: bool,
    level: bool | None,
    processes: int,
    guided: Guided,
    use_coordinates: Path | None,
    search: Search,
    results: Results,
) -> None:
    """Grow a large texture from a small SOURCE, or from several.

    A SOURCE may be a folder with the maps of a material, whose names end in _albedo, _normal, _height and so
    on.

    \b
    toposeam synth moss.png --size 2048x1024 --tileable both -o moss_large.png
    toposeam synth wall.png --normal wall_normal.png --size 1024 -o large.png
    toposeam synth wall/ --size 1024 -o wall_large    # all maps of a material
    """  # noqa: D301 - click wants the character
    if (size is None) == (use_coordinates is None):
        raise ts.OptionError(
            "say how large the texture is with --size, or give the coordinates of another one with "
            "--use-coordinates"
        )
    if size is None or use_coordinates is not None:
        refuse_besides("--use-coordinates", _CUT_ALIKE, "the coordinates say where each pixel comes from")
        _cut_alike(sources, output, use_coordinates, tileable, turns, search.smooth, results)
        return
    if isinstance(size, AutoSize) and tileable == "none":
        raise ts.OptionError(
            "--size auto is for textures that repeat; add --tileable both, x or y, or give a size in px"
        )
    count = len(sources)
    if not isinstance(size, AutoSize):
        check_size(output, *size)
    files, search, material = unfolded(sources, search)
    if turns != "none" and any(kind_of(path) == "normal, DirectX" for path in search.also):
        raise ts.OptionError(
            "of two normal maps of a material only one is turned; move that of DirectX elsewhere, or leave "
            "out --turns"
        )
    goes = results.destinations(output, search, preview, count, material)
    if source and len(source) != count:
        raise ts.OptionError(
            f"--from was given {len(source)} times for {count} sources; give one for each, in their order"
        )
    pictures = read_sources(files, results.max_megapixels)
    maps = Maps.read(search.also, search.normal, count, results.max_pixels)
    goes.check(pictures, maps)
    shapes = [picture.pixels.shape[:2] for picture in pictures]
    copied = [
        read_white(path, shape, name.name, results.max_pixels)
        for path, shape, name in zip(source, shapes, sources, strict=False)
    ]
    wanted = size
    if isinstance(size, AutoSize):
        size = _closing_size(size, pictures, copied, tileable, transparent, lattice)
        check_size(output, *size)
    with (
        share_bar(f"growing {output.name}", results.quiet) as progress,
        _shown_in(preview, pictures[0]) as show,
    ):
        made = ts.synth(
            [picture.pixels for picture in pictures],
            size[::-1],
            tileable=tileable,
            turns=turns,
            setting=setting,
            lattice=lattice,
            variation=variation,
            alpha=alphas(pictures),
            source_mask=copied or None,
            shares=shares,
            transparent=transparent,
            preview=show,
            flatten=flatten,
            level=level,
            max_megapixels=results.max_megapixels,
            processes=processes,
            progress=progress,
            **maps.keywords(pictures[0], search.weights),
            **guided.read(results.max_pixels),
            **patches.keywords(),
            **search.keywords(_instead(setting, variation)),
        )
    dataclasses.replace(goes, preview=None).write(made, pictures[0], maps)
    if results.as_json:
        say(json.dumps(summary(output, made), indent=2), lines=True)
    elif not results.quiet:
        named = made.settings["setting"]
        say(
            f"{output}: {size[0]} × {size[1]} px, {counted(made.count, 'patch')} of {made.patch[1]} × "
            f"{made.patch[0]} px{f', setting {named}' if named else ''}, {made.verdict}"
        )
        if made.fits is not None and not isinstance(wanted, AutoSize):
            height, width = made.fits
            say(
                f"its order was stretched to close; a size that suits it is {width} × {height} px (--size "
                f"auto:{size[0]}x{size[1]})"
            )


def _instead(setting: ts.typing.Setting, variation: float | None) -> str | None:
    """Return the option that stands for the choice of patches."""
    if setting != "auto":
        return "--setting"
    return None if variation is None else "--variation"


@contextmanager
def _shown_in(path: Path | None, like: Picture) -> Iterator[Callable[[np.ndarray], None] | None]:
    """Yield a function that writes an unfinished texture to a file, as often as it is called. If the texture
    is never finished the file is removed.
    """
    shown = False

    def show(pixels: np.ndarray) -> None:
        nonlocal shown
        if path is not None:
            write_picture(path, dataclasses.replace(like, pixels=pixels, alpha=None), force=True)
            shown = True

    try:
        yield None if path is None else show
    except BaseException:
        if path is not None and shown:
            path.unlink(missing_ok=True)
        raise


def _closing_size(
    size: AutoSize,
    pictures: list[Picture],
    copied: list[np.ndarray],
    tileable: ts.texture.Tileable,
    transparent: bool,
    lattice: tuple[float, ...] | None,
) -> tuple[int, int]:
    """Return the width and height at which the first source's regular pattern closes, near the wished size or
    else near twice the source's.
    """
    height, width = pictures[0].pixels.shape[:2]
    wish = (2 * height, 2 * width) if size.wish is None else size.wish[::-1]
    found = ts.texture.closing_size(
        pictures[0].pixels,
        wish,
        tileable=tileable,
        alpha=pictures[0].alpha,
        source_mask=copied[0] if copied else None,
        transparent=transparent,
        data_range=white_of(pictures[0]),
        lattice=lattice,
    )
    return found[1], found[0]


#: Parameters that have an effect beside the coordinates of another texture.
_CUT_ALIKE = ("sources", "output", "tileable", "turns", "smooth", "max_megapixels", "force", "quiet")


def _cut_alike(
    sources: tuple[Path, ...],
    output: Path,
    coordinates: Path | None,
    tileable: ts.texture.Tileable,
    turns: ts.typing.Turns,
    smooth: int,
    results: Results,
) -> None:
    """Write a texture of other pictures, cut by the coordinates of an earlier texture."""
    goes = Destinations(output=output, force=results.force)
    pictures = read_sources(sources, results.max_megapixels)
    given = read_picture(coordinates or Path(), max_pixels=results.max_pixels).pixels
    if given.ndim != 3 or given.dtype != np.uint16:
        raise ts.ImageError(
            f"{coordinates} holds no coordinates; give the 16-bit RGB picture that --coordinates wrote"
        )
    column, row, exemplar = np.moveaxis(given.astype(np.int32), 2, 0)
    place = np.stack([row, column], axis=2)
    options: dict[str, Any] = {"tileable": tileable, "turns": turns, "smooth": smooth}
    made = ts.texture.apply_coordinates([picture.pixels for picture in pictures], place, exemplar, **options)
    opacity = None
    if alphas(pictures) is not None:
        full = [
            np.full(one.pixels.shape[:2], full_scale(one.pixels.dtype)) if one.alpha is None else one.alpha
            for one in pictures
        ]
        opacity = ts.texture.apply_coordinates(full, place, exemplar, **options)
    write_picture(goes.output, dataclasses.replace(pictures[0], pixels=made, alpha=opacity), results.force)
