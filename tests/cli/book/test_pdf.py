"""The pages of a pattern book."""

import re

import numpy as np
import pytest
from PIL import ImageFont

from toposeam.motif.book import SEASONS
from toposeam.motif.kinds import Kind
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.motifs.book import pdf

#: px of A4 at 300 dpi.
WIDTH, HEIGHT = 2480, 3508


def row(number, kind=Kind.THICK_CLEAR, season="spring", **others):
    return {
        "number": number,
        "kind": str(kind),
        "season": season,
        "repeat": "p4m",
        "p": 3.0,
        "mass": [0.2, 0.25],
        "sources": [12, 9],
        "sinks": [3, 4],
        "iterations": 40,
        "base_strength": 0.7,
        "stroke": 0.11,
        "likeness": 0.6,
        "layers": 2,
        **others,
    }


@pytest.fixture
def folder(tmp_path):
    """Swatches of one colour each, (number, 100, 200), and a tie."""
    (tmp_path / "swatches").mkdir()
    (tmp_path / "products").mkdir()
    for number in range(1, 31):
        pixels = np.full((40, 40, 3), (number, 100, 200), np.uint8)
        write_picture(tmp_path / "swatches" / f"{number:04d}.png", Picture(pixels=pixels))
    tie = np.full((90, 70, 3), (10, 220, 30), np.uint8)
    write_picture(tmp_path / "products" / "tie-fall.png", Picture(pixels=tie))
    return tmp_path


def pages(folder, rows, products=()):
    return [page.image for page in pdf._pages("Discs", folder, rows, rows, products)]


def at(page, x_mm, y_mm):
    return page.getpixel((round(x_mm / 25.4 * 300), round(y_mm / 25.4 * 300)))


@pytest.mark.medium
def test_a_book_is_a_pdf_of_a4_pages_and_the_same_again(folder):
    rows = [row(number) for number in range(1, 22)]  # one more than fits on a sheet
    made = pdf.to_pdf("Discs", folder, rows, [(row(1, season="fall"), "tie")])
    assert made[:5] == b"%PDF-"
    boxes = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+)", made)
    # Cover, kinds, the products of fall, two sheets.
    assert re.findall(rb"/Count (\d+)", made)[-1] == b"5"
    assert {(round(float(x)), round(float(y))) for x, y in boxes} == {(595, 842)}
    assert b"Date" not in made
    assert pdf.to_pdf("Discs", folder, rows, [(row(1, season="fall"), "tie")]) == made


@pytest.mark.medium
def test_the_cover_shows_motifs_from_the_first_to_the_last(folder):
    cover = pages(folder, [row(number) for number in range(1, 31)])[0]
    assert cover.size == (WIDTH, HEIGHT)
    assert at(cover, 15, 87 + 15) == (1, 100, 200)
    assert at(cover, 210 - 15, 297 - 15) == (30, 100, 200)
    ink = np.asarray(cover.crop((0, 0, WIDTH, round(80 / 25.4 * 300)))).min()
    assert ink < 60  # the title


def test_a_sheet_has_four_columns_and_five_rows_in_order(folder):
    sheets = pages(folder, [row(number) for number in range(1, 22)])[2:]
    assert len(sheets) == 2
    across, down = (210 - 2 * 16 + 4) / 4, 53
    for number in range(1, 21):
        column, line = (number - 1) % 4, (number - 1) // 4
        assert at(sheets[0], 16 + column * across + 5, 26 + line * down + 5) == (number, 100, 200)
    assert at(sheets[1], 16 + 5, 26 + 5) == (21, 100, 200)
    assert at(sheets[1], 16 + across + 5, 26 + 5) == (250, 248, 244)  # paper


def test_kinds_and_seasons_table_shows_motifs_with_most_layers(folder):
    rows = [row(1), row(2, layers=3), row(3, layers=3), row(4, Kind.THIN_HIDDEN, "winter")]
    kinds = pages(folder, rows)[1]
    step = (210 - 2 * 16) / 4
    assert at(kinds, 16 + 5, 43 + 5) == (2, 100, 200)
    column, line = SEASONS.index("winter"), list(Kind).index(Kind.THIN_HIDDEN)
    assert at(kinds, 16 + column * step + 5, 43 + line * (step + 14) + 5) == (4, 100, 200)
    assert at(kinds, 16 + step + 5, 43 + 5) == (250, 248, 244)


def test_products_fill_their_place(folder):
    page = pages(folder, [row(1)], [(row(1, season="fall"), "tie")])[2]
    assert at(page, 17, 36) == at(page, 16 + 80, 34 + 116) == (10, 220, 30)


def test_texts_beyond_ascii_take_a_font_that_has_them(monkeypatch):
    assert pdf._font("Discs", 40).getname()[0] == ImageFont.load_default(40).getname()[0]
    tried = []

    truetype = ImageFont.truetype

    def found(font, size, **options):
        if not isinstance(font, str):
            return truetype(font, size, **options)
        tried.append(font)
        raise OSError

    monkeypatch.setattr(ImageFont, "truetype", found)
    assert pdf._font("Blüten", 40) is not None  # where no other font is, Pillow's
    assert set(tried) >= set(pdf._FONTS)
