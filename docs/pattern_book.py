"""Draw the sheets of a whole book of patterns: ``python docs/pattern_book.py FOLDER``, a quarter of an hour.
A book that was interrupted goes on.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageOps

from make_pattern_figures import _DARK, _PAPER, THEME, font, save
from toposeam.motif.kinds import Kind
from toposeam_cli.app.main import main as toposeam

#: Patterns of the book, and elements of their sides.
_PATTERNS, _ELEMENTS = 400, 512
#: Patterns in a row of a sheet, and px of each.
_ACROSS, _SIDE, _GAP, _HEAD = 12, 96, 4, 26


def main(folder: Path) -> None:
    """Make the book, or what is missing of it, and draw its sheets."""
    words = ["book", str(THEME), "-n", str(_PATTERNS), "--size", str(_ELEMENTS), "-o", str(folder)]
    toposeam([*words, "--title", "Ginkgo", "-j", "2", "-q"], standalone_mode=False)
    with (folder / "patterns.csv").open(encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    for sheet, kinds in enumerate((("A", "C"), ("B", "D")), 1):
        contact_sheet(folder, [row for row in rows if row["kind"] in kinds], f"book-sheet-{sheet}.jpg")
    products_sheet(folder / "products")


def contact_sheet(folder: Path, rows: list[dict[str, str]], name: str) -> None:
    """All patterns of some kinds."""
    kinds = sorted({row["kind"] for row in rows})
    down = [-(-sum(row["kind"] == kind for row in rows) // _ACROSS) for kind in kinds]
    step = _SIDE + _GAP
    canvas = Image.new("RGB", (_ACROSS * step - _GAP, sum(down) * step + _HEAD * len(kinds)), _PAPER)
    pen = ImageDraw.Draw(canvas)
    y = 0
    for kind, lines in zip(kinds, down, strict=True):
        members = [row for row in rows if row["kind"] == kind]
        words = f"{kind}: {Kind(kind).words}, {len(members)} of {_PATTERNS}"
        pen.text((0, y + 4), words, font=font(13), fill=_DARK)
        for index, row in enumerate(members):
            motif = Image.open(folder / row["file"]).convert("RGB")
            place = index % _ACROSS * step, y + _HEAD + index // _ACROSS * step
            canvas.paste(ImageOps.fit(motif, (_SIDE, _SIDE), Image.Resampling.LANCZOS), place)
        y += _HEAD + lines * step
    save(canvas, name, quality=66)


def products_sheet(folder: Path) -> None:
    """All mock-ups."""
    height, gap = 270, 10
    pictures = []
    for path in sorted(folder.glob("*.png")):
        picture = Image.open(path).convert("RGB")
        pictures.append(picture.resize((round(picture.width * height / picture.height), height)))
    lines = [pictures[start : start + 4] for start in range(0, len(pictures), 4)]
    width = max(sum(picture.width + gap for picture in line) for line in lines) - gap
    canvas = Image.new("RGB", (width, len(lines) * (height + gap) - gap), _PAPER)
    for row, line in enumerate(lines):
        x = 0
        for picture in line:
            canvas.paste(picture, (x, row * (height + gap)))
            x += picture.width + gap
    save(canvas, "book-products.jpg", quality=78)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
