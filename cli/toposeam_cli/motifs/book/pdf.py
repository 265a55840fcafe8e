"""A pattern book as PDF, A4: cover, the kinds and seasons, products, contact sheets."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.motif.book import SEASONS
from toposeam.motif.kinds import Kind
from toposeam_cli.media.font import font_for
from toposeam_cli.media.pictures.libvips import load_vips, to_vips
from toposeam_cli.media.pictures.picture import read_picture
from toposeam_cli.motifs.book.html import beside, caption

Row = dict[str, Any]

_WIDTH_MM, _HEIGHT_MM, _MARGIN_MM = 210.0, 297.0, 16.0
_COLUMNS, _ROWS = 4, 5
_INK, _SOFT = "#2b2926", "#7b756c"
_PAPER = "#faf8f4"
#: Resolution of a page, px per inch, and quality of its JPEG, with which text of 5 pt is sharp in print.
_DPI, _QUALITY = 300, 90
#: Longer side of a mock-up on the page, px.
_PRODUCT_PX = 700


def to_pdf(title: str, folder: Path, rows: Sequence[Row], products: Sequence[tuple[Row, str]]) -> bytes:
    """Return the book as PDF, the same bytes for the same book.

    Parameters
    ----------
    title : str
    folder : Path
        The folder of ``motifs``, ``swatches`` and ``products``.
    rows : sequence of mappings
        As :func:`toposeam_cli.motifs.book.patterns.draw_pattern` returns them.
    products : sequence of (row, product)
    """
    ordered = [
        row
        for kind in Kind
        for season in SEASONS
        for row in rows
        if (row["kind"], row["season"]) == (str(kind), season)
    ]
    buffer = io.BytesIO()
    for count, page in enumerate(_pages(title, folder, rows, ordered, products)):
        # Page by page: a book of thousands of patterns has hundreds. No dates.
        page.image.save(
            buffer,
            "PDF",
            append=count > 0,
            resolution=_DPI,
            quality=_QUALITY,
            title=f"{title}: pattern book",
            creationDate=None,
            modDate=None,
        )
    return buffer.getvalue()


def _pages(
    title: str,
    folder: Path,
    rows: Sequence[Row],
    ordered: Sequence[Row],
    products: Sequence[tuple[Row, str]],
) -> Iterator[_Page]:
    yield _cover(title, folder, rows)
    yield _kinds(folder, rows)
    yield from _products(folder, products)
    for kind in Kind:
        members = [row for row in ordered if row["kind"] == str(kind)]
        for start in range(0, len(members), _COLUMNS * _ROWS):
            yield _sheet(folder, f"{kind}: {kind.words}", members[start : start + _COLUMNS * _ROWS])


class _Page:
    """An A4 page measured in mm from its upper left corner."""

    def __init__(self) -> None:
        from PIL import Image, ImageDraw

        self.image = Image.new("RGB", (_px(_WIDTH_MM), _px(_HEIGHT_MM)), _PAPER)
        self._draw = ImageDraw.Draw(self.image)

    def words(self, text: str, x: float, y: float, size: float, colour: str = _INK) -> None:
        """Draw lines of text, `size` in points."""
        side = size / 72 * _DPI
        text = text.replace("–", "-")
        self._draw.multiline_text((_px(x), _px(y)), text, colour, font_for(text, side), spacing=0.35 * side)

    def picture(self, pixels: np.ndarray, x: float, y: float, width: float, height: float) -> None:
        """Draw a picture that fills a rectangle."""
        from PIL import Image

        left, top = _px(x), _px(y)
        size = _px(x + width) - left, _px(y + height) - top
        shown = Image.fromarray(pixels).convert("RGB").resize(size, Image.Resampling.LANCZOS)
        self.image.paste(shown, (left, top))


def _px(length_mm: float) -> int:
    return round(length_mm / 25.4 * _DPI)


def _swatch(folder: Path, row: Row, shape: tuple[float, float]) -> np.ndarray:
    """Draw at most two whole motifs of a pattern down and across."""
    pixels = read_picture(folder / "swatches" / f"{row['number']:04d}.png").pixels
    side = min(pixels.shape[:2])
    return pixels[: round(side * shape[0] / 2), : round(side * shape[1] / 2)]


def _cover(title: str, folder: Path, rows: Sequence[Row]) -> _Page:
    page = _Page()
    step = 30.0
    shown = [rows[index] for index in np.linspace(0, len(rows) - 1, 49).round().astype(int)]
    for index, row in enumerate(shown):
        page.picture(_swatch(folder, row, (1, 1)), (index % 7) * step, 87 + (index // 7) * step, step, step)
    page.words(title, _MARGIN_MM, 34, 34)
    page.words(f"a book of {len(rows)} patterns", _MARGIN_MM, 56, 14, _SOFT)
    return page


def _kinds(folder: Path, rows: Sequence[Row]) -> _Page:
    """Return one pattern of each kind and season: Figure 4.10 of the thesis."""
    page = _Page()
    page.words("Kinds and seasons", _MARGIN_MM, 18, 18)
    step = (_WIDTH_MM - 2 * _MARGIN_MM) / 4
    for column, season in enumerate(SEASONS):
        page.words(season, _MARGIN_MM + column * step, 36, 10, _SOFT)
    for line, kind in enumerate(Kind):
        y = 43 + line * (step + 14)
        for column, season in enumerate(SEASONS):
            found = [row for row in rows if (row["kind"], row["season"]) == (str(kind), season)]
            if found:
                best = max(found, key=lambda row: (row["layers"], -row["number"]))
                page.picture(_swatch(folder, best, (2, 2)), _MARGIN_MM + column * step, y, step - 3, step - 3)
        page.words(f"{kind}: {kind.words}", _MARGIN_MM, y + step - 1, 9, _SOFT)
    return page


def _products(folder: Path, products: Sequence[tuple[Row, str]]) -> list[_Page]:
    pages = []
    for season in SEASONS:
        shown = [(row, product) for row, product in products if row["season"] == season]
        if not shown:
            continue
        page = _Page()
        page.words(season.capitalize(), _MARGIN_MM, 18, 18)
        width, height = (_WIDTH_MM - 2 * _MARGIN_MM - 6) / 2, 118.0
        for index, (row, product) in enumerate(shown):
            x, y = _MARGIN_MM + (index % 2) * (width + 6), 34 + (index // 2) * (height + 12)
            picture = read_picture(folder / "products" / f"{product}-{season}.png").pixels
            picture = _filling(picture, width / height)
            page.picture(picture, x, y, width, height)
            page.words(f"{product}, pattern {row['number']}{beside(row)}", x, y + height + 2, 9, _SOFT)
        pages.append(page)
    return pages


def _filling(picture: np.ndarray, ratio: float) -> np.ndarray:
    """Return the picture reduced, and padded by its edge pixels to a ratio of width to height."""
    small = (
        load_vips().Image.thumbnail_image(to_vips(picture), _PRODUCT_PX, height=_PRODUCT_PX).numpy()[..., :3]
    )
    height, width = small.shape[:2]
    down = max(0, round(width / ratio) - height)
    across = max(0, round(height * ratio) - width)
    wider: np.ndarray = np.pad(
        small, [(down // 2, down - down // 2), (across // 2, across - across // 2), (0, 0)], mode="edge"
    )
    return wider


def _sheet(folder: Path, heading: str, rows: Sequence[Row]) -> _Page:
    page = _Page()
    page.words(heading, _MARGIN_MM, 14, 13)
    step_x, step_y = (_WIDTH_MM - 2 * _MARGIN_MM + 4) / _COLUMNS, 53.0
    for index, row in enumerate(rows):
        x, y = _MARGIN_MM + (index % _COLUMNS) * step_x, 26 + (index // _COLUMNS) * step_y
        side = step_x - 4
        page.picture(_swatch(folder, row, (1.26, 1.5)), x, y, side, side * 0.84)
        page.words(f"{row['number']}  {row['season']}", x, y + side * 0.84 + 1, 6.5)
        page.words(_wrapped(caption(row), 44), x, y + side * 0.84 + 4, 5.0, _SOFT)
    return page


def _wrapped(text: str, width: int) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(text, width)[:5])
