"""Limits of the pixels read: of one picture, and of several together."""

from collections.abc import Sequence
from pathlib import Path

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.decode import refuse_large, size_of
from toposeam_cli.media.pictures.picture import Picture, read_picture

#: What becomes a motif, a palette or a theme is not taken from larger pictures; no option allows more.
MAX_MOTIF = 64_000_000


def read_within(path: Path, max_pixels: int) -> Picture:
    """:func:`~toposeam_cli.media.pictures.picture.read_picture` for a command whose limit no option raises.

    Raises
    ------
    ImageError
    """
    refuse_large(path, *size_of(path), max_pixels, raisable=False)
    return read_picture(path, max_pixels)


def check_together(paths: Sequence[Path], max_pixels: int) -> None:
    """Refuse pictures that are too large together, before one of them is decoded.

    Raises
    ------
    ImageError
    """
    known = {path: size_of(path) for path in dict.fromkeys(paths)}
    for path, (width, height) in known.items():
        refuse_large(path, width, height, max_pixels)
    if len(paths) > 1:
        refuse_together(len(paths), sum(known[path][0] * known[path][1] for path in paths), max_pixels)


def refuse_together(count: int, total: int, max_pixels: int, where: str = "") -> None:
    """Refuse pictures that have too many pixels together.

    Raises
    ------
    ImageError
    """
    if total > max_pixels:
        raise ImageError(
            f"{where}the {count} pictures have {total / 1e6:.0f} megapixels together, more than the "
            f"{max_pixels / 1e6:g} allowed; raise --max-megapixels if they are trusted"
        )
