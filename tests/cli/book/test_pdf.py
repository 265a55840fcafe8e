"""The pages of a pattern book."""

import re

import numpy as np
import pytest
from PIL import ImageFont

from toposeam.motif.book import SEASONS
from toposeam.motif.kinds import Kind
from toposeam_cli.media import font
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.motifs.book import pdf

#: px of A4 at 300 dpi.
WIDTH, HEIGHT = 2480, 3508
#: Colours of headings and of words below pictures.
INK, SOFT = (0x2B, 0x29, 0x26), (0x7B, 0x75, 0x6C)


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


def px(*lengths_mm):
    return [round(length / 25.4 * 300) for length in lengths_mm]


def at(page, x_mm, y_mm):
    return page.getpixel(tuple(px(x_mm, y_mm)))


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
    assert font.font_for("Discs", 40).getname()[0] == ImageFont.load_default(40).getname()[0]
    tried = []

    truetype = ImageFont.truetype

    def found(font, size, **options):
        if not isinstance(font, str):
            return truetype(font, size, **options)
        tried.append(font)
        raise OSError

    monkeypatch.setattr(ImageFont, "truetype", found)
    assert font.font_for("Blüten", 40) is not None  # where no other font is, Pillow's
    assert set(tried) >= set(font._FONTS)


def box(page, colour):
    """Left, top, right and bottom of all pixels of a colour, as Pillow counts them."""
    rows, columns = np.nonzero((np.asarray(page) == colour).all(axis=2))
    return [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]


def test_every_picture_of_a_sheet_fills_its_place_exactly(folder):
    (sheet,) = pages(folder, [row(number) for number in range(1, 20)])[2:]
    width = (210 - 2 * 16 - 3 * 4) / 4  # four, and three gaps of 4 mm
    for number in range(1, 20):
        x, y = 16 + (number - 1) % 4 * (width + 4), 26 + (number - 1) // 4 * 53
        assert box(sheet, (number, 100, 200)) == px(x, y, x + width, y + 0.84 * width)


def test_the_words_of_a_pattern_stand_right_below_it(folder):
    (sheet,) = pages(folder, [row(1), row(2)])[2:]
    left, _, right, bottom = box(sheet, (2, 100, 200))
    column = sheet.crop((left - 20, bottom, WIDTH, HEIGHT))
    label, words = box(column, INK), box(column, SOFT)
    millimetre = 300 / 25.4
    assert 1 * millimetre <= label[1] <= 2.5 * millimetre
    assert label[3] < words[1] <= 5.5 * millimetre  # one after another
    assert words[3] < (53 - 35) * millimetre  # and all above what comes below
    for begin, _, end, _ in (label, words):
        assert 19 <= begin <= 28
        assert end <= right - left + 40
    # The heading is above all of them.
    heading = box(sheet.crop((0, 0, WIDTH, px(26)[0])), INK)
    assert px(16)[0] - 1 <= heading[0] <= px(17)[0]
    assert px(14)[0] <= heading[1] < heading[3] <= px(22)[0]


def test_the_cover_has_seven_by_seven_motifs_to_its_edges(folder):
    cover = pages(folder, [row(number) for number in range(1, 31)])[0]
    for place in range(49):
        x, y = place % 7 * 30, 87 + place // 7 * 30
        number = 1 + round(place * 29 / 48)
        assert at(cover, x + 0.5, y + 0.5) == at(cover, x + 29.4, y + 29.4) == (number, 100, 200)
    assert at(cover, 105, 86.8) == (250, 248, 244)
    title, words = box(cover, INK), box(cover, SOFT)
    for left, *_ in (title, words):
        assert px(16)[0] - 1 <= left <= px(17.5)[0]
    assert px(34)[0] <= title[1] < title[3] < px(56)[0] <= words[1] < words[3] < px(63)[0]
    assert title[3] - title[1] > 1.5 * (words[3] - words[1])


def test_the_table_of_kinds_has_a_place_for_each(folder):
    rows = [
        row(1 + line * 4 + column, kind, season)
        for line, kind in enumerate(Kind)
        for column, season in enumerate(SEASONS)
    ]
    kinds = pages(folder, rows)[1]
    step = (210 - 2 * 16) / 4
    for number in range(1, len(rows) + 1):
        x, y = 16 + (number - 1) % 4 * step, 43 + (number - 1) // 4 * (step + 14)
        assert box(kinds, (number, 100, 200)) == px(x, y, x + step - 3, y + step - 3)
    # Of equally many inks the first is shown.
    rows = [row(5), row(3), row(4)]
    assert at(pages(folder, rows)[1], 20, 50) == (3, 100, 200)


def test_four_products_of_a_season_share_a_page(folder):
    colours = {name: (200, 10 * place, 90) for place, name in enumerate(("tie", "scarf", "shirt", "phone"))}
    for name, colour in colours.items():
        pixels = np.full((60, 80, 3), colour, np.uint8)
        write_picture(folder / "products" / f"{name}-winter.png", Picture(pixels=pixels))
    given = [(row(1, season="winter"), name) for name in colours] + [(row(1, season="fall"), "tie")]
    autumn, winter = sorted(pages(folder, [row(1)], given)[2:4], key=lambda page: at(page, 20, 40)[0])
    assert at(autumn, 20, 40) == (10, 220, 30)
    assert at(autumn, 16 + 92 + 20, 40) == (250, 248, 244)
    for place, colour in enumerate(colours.values()):
        x, y = 16 + place % 2 * 92, 34 + place // 2 * 130
        assert box(winter, colour) == px(x, y, x + 86, y + 118)
        below = winter.crop((*px(x, y + 118), *px(x + 86, y + 129)))
        words = box(below, SOFT)
        assert px(2)[0] <= words[1] < words[3] <= px(8)[0]


@pytest.mark.parametrize(("across", "down"), [(20, 60), (60, 20)])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 1.7])
def test_a_product_is_continued_to_the_ratio_it_needs(across, down, ratio):
    """With its own edges, equally at both sides; nothing of it is cut off."""
    y, x = np.mgrid[:down, :across]
    picture = np.dstack([x * 3, y * 3, np.full_like(x, 77)]).astype(np.uint8)
    made = pdf._filling(picture, ratio)
    height, width = made.shape[:2]
    assert made.shape[2] == 3
    assert width / height == pytest.approx(ratio, rel=0.005)
    scale = 700 / 60
    for axis, (length, side) in enumerate(((height, down), (width, across))):
        own = round(side * scale)
        assert length >= own
        first = (length - own) // 2
        line = made[:, width // 2, 1] if axis == 0 else made[height // 2, :, 0]
        assert (line[: first + 1] == line[0]).all()
        assert (line[first + own - 1 :] == line[-1]).all()
        assert len(np.unique(line[first : first + own])) > side
        assert line[length // 2] == pytest.approx(side * 3 / 2, abs=3)


@pytest.mark.parametrize(
    ("shape", "size"), [((1, 1), (20, 20)), ((2, 2), (40, 40)), ((1.26, 1.5), (25, 30)), ((2, 3), (40, 60))]
)
def test_of_a_swatch_whole_motifs_are_shown(folder, shape, size):
    """It holds two by two of them and more."""
    y, x = np.mgrid[:40, :65].astype(np.uint8)
    pixels = np.dstack([y, x, x])
    write_picture(folder / "swatches" / "0077.png", Picture(pixels=pixels))
    np.testing.assert_array_equal(pdf._swatch(folder, row(77), shape), pixels[: size[0], : size[1]])


def test_words_are_broken_into_five_lines_at_most():
    text = " ".join(["some words"] * 60)
    lines = pdf._wrapped(text, 44).split("\n")
    assert len(lines) == 5
    assert all(34 < len(line) <= 44 for line in lines)
    assert text.startswith(" ".join(lines))
    assert pdf._wrapped("two words", 44) == "two words"


def test_words_grow_with_their_points_and_have_plain_dashes():
    def drawn(text, size):
        page = pdf._Page()
        page.words(text, 20, 30, size)
        return page.image

    np.testing.assert_array_equal(drawn("3–4", 9), drawn("3-4", 9))
    small, large = (box(drawn("H\nH", size), INK) for size in (18, 36))
    assert [small[0] >= px(20)[0], small[1] >= px(30)[0]] == [True, True]
    assert large[3] - large[1] == pytest.approx(2 * (small[3] - small[1]), abs=3)
    # A capital is less high than its size, two lines are more than twice that.
    assert 0.6 * 75 < box(drawn("H", 18), INK)[3] - px(30)[0] < 75 < small[3] - px(30)[0]
