"""Deep Zoom: a picture as a pyramid of tiles, of which browsers load those in view."""

from __future__ import annotations

import os
import re
from pathlib import Path

from toposeam.errors import OptionError
from toposeam_cli.files.writing import OutputError, all_or_nothing, check_output, replacing
from toposeam_cli.media.pictures.libvips import evaluate, load_vips, reason
from toposeam_cli.media.pictures.picture import Keep, Picture, in_eight_bits, vips_image

#: JPEG quality of the tiles of opaque pictures.
_QUALITY = 90
#: Path of a tile: level, column, row.
_TILE = re.compile(r"\d+/\d+_\d+\.(?:jpe?g|png|webp)")


def tiles_of(path: Path) -> Path:
    """Return the folder of tiles that belongs to a .dzi file."""
    return path.with_name(f"{path.stem}_files")


def check_deep_zoom(path: Path, force: bool) -> None:
    """Refuse a .dzi file, or its folder of tiles, that cannot be written.

    Raises
    ------
    OptionError
    """
    check_output(path, force, (".dzi",))
    folder = tiles_of(path)
    if os.path.lexists(folder) and not (force and folder.is_dir() and not folder.is_symlink()):
        raise OptionError(f"'{folder}' exists already; pass --force to replace it, or choose another name")
    foreign = _foreign(folder)
    if foreign is not None:
        raise OptionError(
            f"'{folder}' holds {foreign}, which is no tile, and is left alone; choose another name"
        )


def _foreign(folder: Path) -> str | None:
    """Return the path of something in a folder of tiles that is no tile, else None."""
    for place, folders, files in os.walk(folder):
        for name in files:
            inside = Path(place, name).relative_to(folder).as_posix()
            if _TILE.fullmatch(inside) is None:
                return inside
        for name in folders:
            if not name.isdigit() or Path(place, name).is_symlink():
                return Path(place, name).relative_to(folder).as_posix()
    return None


def write_deep_zoom(
    path: Path, picture: Picture, force: bool, quality: int | None = None, keep: Keep | None = None
) -> None:
    """Write a .dzi file and its folder of tiles beside it, completely or not at all: JPEG where the picture
    is opaque, else PNG; `keep` as for :func:`~toposeam_cli.media.pictures.picture.write_picture`.

    Raises
    ------
    OptionError, OutputError
    """
    check_deep_zoom(path, force)
    vips = load_vips()
    image = vips_image(in_eight_bits(picture, keep))
    suffix = ".png" if picture.alpha is not None else f".jpg[Q={quality or _QUALITY}]"
    with (
        all_or_nothing(),
        replacing(tiles_of(path), force, folder=True) as tiles,
        replacing(path, force) as file,
    ):
        try:
            base = tiles / "picture"
            evaluate(image, lambda: image.dzsave(os.fsdecode(base), suffix=suffix))
        except vips.Error as error:
            raise OutputError(
                f"cannot write '{path}' ({reason(error)}); free some space or choose another folder"
            ) from error
        made = tiles / "picture_files"
        (made / "vips-properties.xml").unlink(missing_ok=True)
        file.write_bytes(base.with_suffix(".dzi").read_bytes())
        base.with_suffix(".dzi").unlink()
        for level in made.iterdir():
            level.rename(tiles / level.name)
        made.rmdir()
