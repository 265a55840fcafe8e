"""A contact sheet: the panoramas of a folder, reduced, on one picture, each with the line that reports it."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw

from toposeam.sentence import printable
from toposeam_cli.files.writing import atomic_write
from toposeam_cli.media.font import font_for
from toposeam_cli.media.pictures.libvips import load_vips

#: Width of the sheet and most of it that a panorama takes, px; gap, and size of the text, px.
_WIDTH, _GAP, _TEXT_PX = 1600, 24, 18
#: Height of a panorama at most, px, and its width where it shares a row with another.
_HEIGHT, _HALF = 460, (_WIDTH - 3 * _GAP) // 2
#: Characters in a line of text, of a panorama that is as wide as the sheet and of one half as wide.
_CHARACTERS = {_WIDTH - 2 * _GAP: 150, _HALF: 74}
_PAPER, _INK = (250, 250, 248), (30, 30, 30)


def write_contact_sheet(path: Path, panoramas: Sequence[tuple[Path, str]], force: bool) -> None:
    """Write pictures, reduced, and the text below each.

    Panoramas wider than three times their height have a row of their own, others share one.

    Parameters
    ----------
    path : Path
        The sheet, .jpg or .png.
    panoramas : sequence of (Path, str)
        Files of pictures, and what stands below them.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
    """
    rows: list[list[tuple[Image.Image, list[str]]]] = []
    for file, text in panoramas:
        small = _small(file, _WIDTH - 2 * _GAP)
        wide = small.width > 3 * small.height
        width = _WIDTH - 2 * _GAP if wide else _HALF
        small.thumbnail((width, _HEIGHT), Image.Resampling.LANCZOS)
        item = small, textwrap.wrap(printable(text), _CHARACTERS[width]) or [""]
        half_free = bool(rows) and len(rows[-1]) == 1 and not wide and rows[-1][0][0].width <= _HALF
        rows = [*rows[:-1], [*rows[-1], item]] if half_free else [*rows, [item]]
    line = round(1.4 * _TEXT_PX)
    heights = [
        max(small.height + _GAP // 2 + line * len(lines) for small, lines in row) + _GAP for row in rows
    ]
    sheet = Image.new("RGB", (_WIDTH, sum(heights) + _GAP), _PAPER)
    draw, top = ImageDraw.Draw(sheet), _GAP
    for row, height in zip(rows, heights, strict=True):
        for column, (small, lines) in enumerate(row):
            left = _GAP + column * (_HALF + _GAP)
            sheet.paste(small, (left, top), small.getchannel("A"))
            for number, words in enumerate(lines):
                at = left, top + small.height + _GAP // 2 + number * line
                draw.text(at, words, _INK, font_for(words, _TEXT_PX))
        top += height
    file_in_memory = io.BytesIO()
    sheet.save(file_in_memory, "PNG" if path.suffix.lower() == ".png" else "JPEG", quality=92)
    atomic_write(path, file_in_memory.getvalue(), force)


def _small(file: Path, width: int) -> Image.Image:
    """Return a picture of any size and depth at most so wide, with its opacity."""
    vips = load_vips()
    size = {"height": _HEIGHT * 2, "size": "down"}
    found = vips.Image.new_from_file(str(file))
    if found.interpretation == "b-w" and found.format == "float":  # of which libvips takes 255 for white
        found = (255 * found).cast("uchar").thumbnail_image(width, **size)
    else:
        found = vips.Image.thumbnail(str(file), width, **size)
    found = found.colourspace("srgb")
    return Image.fromarray((found if found.hasalpha() else found.addalpha()).numpy())
