"""``toposeam book``: every pattern once, sorted, again where it was interrupted, and the same whatever the
number of processes.
"""

import csv
import dataclasses
import json
import re
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

from toposeam.colours import parse_colour
from toposeam.errors import OptionError
from toposeam.motif.book import SEASONS, book_recipe
from toposeam.motif.kinds import CLEAR, Kind, measure
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.motifs import products
from toposeam_cli.motifs.products import PRODUCTS, draw_product, product
from toposeam_cli.motifs.recipe_files import read_recipe

SMALL = ("-n", "4", "--size", "32", "-q")


@pytest.fixture
def theme(tmp_path, monkeypatch):
    """A dark disc on white."""
    monkeypatch.chdir(tmp_path)
    y, x = np.mgrid[:48, :48]
    disc = np.where(np.hypot(y - 24, x - 24) < 12, 20, 250).astype(np.uint8)
    write_picture("theme.png", Picture(pixels=disc))
    return tmp_path


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*.*"))
        if path.suffix != ".jsonl"
    }


class Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.files, self.text = [], ""

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.files += [
            values[name] for name in ("href", "src") if name in values and not values[name].startswith("#")
        ]
        self.files += re.findall(r"url\((.*?)\)", values.get("style") or "")
        assert tag != "script"

    def handle_data(self, data):
        self.text += data


@pytest.mark.slow
def test_a_book(theme, started):
    ran = started("book", "theme.png", *SMALL, "-o", "one", "--title", "Discs & <b>rings</b>")
    assert (ran.code, ran.err) == (0, "")
    folder = theme / "one"
    rows = list(csv.DictReader((folder / "patterns.csv").read_text().splitlines()))
    assert [row["file"] for row in rows] == [f"motifs/{number:04d}.png" for number in range(1, 5)]
    assert [row["season"] for row in rows] == ["summer", "fall", "winter", "spring"]
    assert {row["kind"] for row in rows} <= {str(kind) for kind in Kind}
    for number, row in enumerate(rows, 1):
        recipe = read_recipe(folder / row["file"])
        assert recipe == book_recipe(read_picture("theme.png").pixels, 0, number, 32)
        assert json.loads(row["sources"]) == [len(layer.sources) for layer in recipe.layers]
    page = Page()
    page.feed((folder / "book.html").read_text())
    assert "Discs & <b>rings</b>" in page.text
    assert all((folder / name).is_file() for name in page.files)
    assert len([name for name in page.files if name.startswith("swatches")]) == 4
    assert len(list((folder / "products").iterdir())) == 4  # one pattern a season, so one product each
    assert (folder / "book.pdf").read_bytes()[:5] == b"%PDF-"
    # The same again makes nothing anew; two processes and a fresh start make the same.
    times = {path: path.stat().st_mtime_ns for path in (folder / "motifs").iterdir()}
    assert started("book", "theme.png", *SMALL, "-o", "one", "--title", "Discs & <b>rings</b>").code == 0
    assert {path: path.stat().st_mtime_ns for path in (folder / "motifs").iterdir()} == times
    assert (
        started("book", "theme.png", *SMALL, "-o", "two", "-j", "2", "--title", "Discs & <b>rings</b>").code
        == 0
    )
    assert contents(theme / "two") == contents(folder)


@pytest.mark.slow
def test_a_book_round_two_themes_at_print_size(theme, started):
    """Each theme in every season, at 300 dpi, and two patterns on shirts, of another product's motif."""
    bar = np.full((48, 48), 250, np.uint8)
    bar[:, 18:30] = 20
    write_picture("bar.png", Picture(pixels=bar))
    words = ("book", "theme.png", "bar.png", "-n", "16", "--size", "32", "-q", "-o", "b", "--no-pdf")
    assert started(*words, "--motif-width", "8mm").code == 0
    rows = list(csv.DictReader((theme / "b" / "patterns.csv").read_text().splitlines()))
    assert [row["theme"] for row in rows] == [name for name in ("theme", "bar") * 2 for _ in range(4)]
    assert {(row["theme"], row["season"]) for row in rows} == {
        (name, season) for name in ("theme", "bar") for season in SEASONS
    }
    made = read_picture(theme / "b" / "motifs" / "0002.png")
    assert made.pixels.shape[1] == round(8 / 25.4 * 300)
    assert made.resolution == pytest.approx((300 / 25.4,) * 2, rel=1e-3)
    text = (theme / "b" / "book.html").read_text()
    assert "theme, " in text
    assert "bar, " in text
    beside = re.search(r"shirt, fall, .*?no. (\d+)</a> and (\d+)<", text)
    tie = re.search(r"tie, fall, .*?no. (\d+)</a>", text)
    assert beside[2] == tie[1] != beside[1]


@pytest.mark.medium
@pytest.mark.parametrize("name", ["shirt", "tie"])
def test_without_a_second_pattern_cloth_is_all_of_the_first(name):
    pattern = np.random.default_rng(1).integers(0, 256, (64, 64, 3), np.uint8)
    colours = np.ones(3), np.zeros(3)
    alone = draw_product(name, pattern, 64, *colours)
    np.testing.assert_array_equal(alone, draw_product(name, pattern, 64, *colours, second=(pattern, 64)))


@pytest.fixture
def made_quickly(monkeypatch):
    """Every pattern is a file, and what is measured on it is made up."""
    import toposeam_cli.commands.book as command
    from toposeam_cli.files.writing import all_or_nothing, atomic_write
    from toposeam_cli.jobs.runner import Outcome

    made = {}

    def run(jobs, journal, **options):
        for job in jobs:
            with all_or_nothing(made, digests=True) as outputs:
                for path in job.outputs:
                    atomic_write(path, job.name, job.manner["force"])
            made.update(outputs.made)
            number = job.arguments.get("number", 1)
            result = {name: kind() for name, kind in command.ROW.items()}
            result |= {"number": number, "season": SEASONS[0], "kind": str(next(iter(Kind)))}
            yield Outcome(job, "done", 0.0, result=result if "number" in job.arguments else None)

    monkeypatch.setattr(command, "run", run)


@pytest.mark.parametrize("name", ["book.html", "patterns.csv", "book.pdf"])
@pytest.mark.parametrize("how", ["new", "link"])
def test_pages_that_no_book_made_are_kept(theme, toposeam, made_quickly, name, how):
    (theme / "b").mkdir()
    (theme / "theirs").write_text("precious")
    (theme / "b" / name).hardlink_to(theme / "theirs") if how == "new" else (theme / "b" / name).symlink_to(
        theme / "theirs"
    )
    toposeam("book", "theme.png", *SMALL, "-o", "b").fails("--force")
    assert (theme / "theirs").read_text() == "precious"
    assert [path.name for path in (theme / "b").iterdir()] == [name]  # refused before any work


def test_a_book_replaces_its_own_pages_unless_they_were_edited(theme, toposeam, made_quickly):
    words = ("book", "theme.png", *SMALL, "-o", "b", "--no-pdf")
    assert toposeam(*words).code == 0
    assert toposeam(*words, "--title", "Another").code == 0
    assert "Another" in (theme / "b" / "book.html").read_text()
    motifs = [path.name for path in (theme / "b" / "motifs").iterdir()]
    assert sorted(motifs) == ["0001.png", "0002.png", "0003.png", "0004.png"]
    (theme / "b" / "book.html").write_text("edited")
    toposeam(*words).fails("--force")
    assert (theme / "b" / "book.html").read_text() == "edited"
    assert toposeam(*words, "--force").code == 0
    assert "theme" in (theme / "b" / "book.html").read_text()


@pytest.mark.skipif(sys.platform == "darwin", reason="its file names are UTF-8")
def test_non_utf8_names_are_written_with_replacement_characters(theme, toposeam, made_quickly):
    (theme / "theme.png").rename(theme / "a\udcff.png")
    assert toposeam("book", "a\udcff.png", *SMALL, "-o", "b", "--no-pdf").code == 0
    assert "<title>a\ufffd" in (theme / "b" / "book.html").read_text(encoding="utf-8")
    assert toposeam("book", "a\udcff.png", *SMALL, "-o", "c", "--no-pdf", "--title", "\udcfe").code == 0


@pytest.mark.parametrize("folder", ["motifs", "swatches", "products"])
def test_a_theme_among_the_books_own_pictures_is_refused(theme, toposeam, folder):
    (theme / "b" / folder).mkdir(parents=True)
    (theme / "theme.png").rename(theme / "b" / folder / "0001.png")
    before = (theme / "b" / folder / "0001.png").read_bytes()
    toposeam("book", f"b/{folder}/0001.png", *SMALL, "-o", "b", "--force").fails("copy it elsewhere")
    assert (theme / "b" / folder / "0001.png").read_bytes() == before


def test_half_of_the_patterns_are_meant_to_show_the_theme():
    y, x = np.mgrid[:48, :48]
    disc = np.where(np.hypot(y - 24, x - 24) < 12, 0.1, 1.0)
    recipes = [book_recipe(disc, 5, number, 32) for number in range(60)]
    strong = sum(abs(recipe.base_strength) >= 0.6 for recipe in recipes)
    assert 20 <= strong <= 40
    assert all(recipe.base_strength < 0 for recipe in recipes)  # dark on light: ink where it is dark
    assert all(
        recipe.base_strength > 0 for recipe in (book_recipe(1 - disc, 5, number, 32) for number in range(5))
    )
    assert len({recipe.repeat for recipe in recipes}) > 8
    assert {recipe.paper for recipe in recipes[:4]} == {recipe.paper for recipe in recipes}
    assert len(SEASONS) == 4


@pytest.mark.medium
@pytest.mark.parametrize("name", PRODUCTS)
def test_products_show_the_pattern_at_its_size(name):
    """Stripes across, in mm, where the cloth lies as flat as it does anywhere."""
    shown = product(name)
    stripes = np.full((60, 60, 3), 255, np.uint8)
    stripes[:, :30] = (200, 30, 30)
    wide = shown.motif_mm / (4 if name in ("canvas", "cushion", "wrapping") else 1)
    drawn = draw_product(name, stripes, 60, np.ones(3), np.zeros(3), wide)
    scale = shown.px_per_mm
    assert drawn.shape == (round(shown.height * scale), round(shown.width * scale), 3)
    red = (drawn[..., 0].astype(int) - drawn[..., 1]) > 60
    x, y = {
        "tie": (slice(None), 420),
        "scarf": (slice(120, 830), 480),
        "shirt": (slice(300, 600), 600),
        "canvas": (slice(260, 840), 400),
        "cushion": (slice(150, 410), 280),
        "wallpaper": (slice(0, 2600), 500),
        "wrapping": (slice(95, 445), 290),
        "phone": (slice(36, 96), 120),
    }[name]
    span = slice(None) if x.start is None else slice(round(x.start * scale), round(x.stop * scale))
    line = red[round(y * scale), span]
    edges = np.flatnonzero(np.diff(line.astype(int)) == 1)
    expected = wide / np.cos(np.radians(45 if name == "tie" else 0))
    assert len(edges) >= 2
    assert np.diff(edges).mean() / scale == pytest.approx(
        expected, rel=0.1 if shown.folds.count("path") else 0.02
    )


@pytest.mark.medium
def test_a_second_pattern_goes_where_it_belongs():
    red, blue = (np.full((9, 9, 3), colour, np.uint8) for colour in ((200, 30, 30), (30, 30, 200)))
    drawn = draw_product("shirt", red, 9, np.ones(3), np.zeros(3), second=(blue, 9)).astype(int)
    scale = product("shirt").px_per_mm
    collar, chest = (drawn[round(y * scale), round(x * scale)] for x, y in ((380, 180), (380, 600)))
    assert collar[2] > 2 * collar[0]
    assert chest[0] > 2 * chest[2]


def test_folds_are_blurred_by_their_share_of_the_longer_side(monkeypatch):
    """A point of light in the drawing becomes a Gaussian of that deviation."""
    shown = dataclasses.replace(product("tie"), folds='<path d="M0 0"/>')
    point = np.full((301, 301, 4), parse_colour("#808080")[0])
    point[150, 150] += 0.5
    monkeypatch.setattr(products, "_rendered", lambda *arguments: point)
    for folds, share in (('<path d="M0 0"/>', 0.014), ('<path filter="url(#fine)"/>', 0.006)):
        blurred = products._folds(dataclasses.replace(shown, folds=folds), (301, 301))
        spread = (blurred[150] * (np.arange(301) - 150.0) ** 2).sum() / blurred[150].sum()
        assert np.sqrt(spread) == pytest.approx(share * 1200, rel=0.02)


@pytest.mark.medium
def test_folds_shift_and_shade_the_pattern():
    plain = np.full((9, 9, 3), 200, np.uint8)
    scarf = draw_product("scarf", plain, 9, np.ones(3), np.zeros(3))[300:900, 200:900, 0].astype(float)
    canvas = draw_product("canvas", plain, 9, np.ones(3), np.zeros(3))[300:700, 350:850, 0].astype(float)
    assert np.std(scarf) > 2 * np.std(canvas)
    stripes = plain.copy()
    stripes[:, :4] = (200, 0, 0)
    drawn = draw_product("scarf", stripes, 9, np.ones(3), np.zeros(3), motif_mm=60)[..., 1] < 90
    first = [np.flatnonzero(np.diff(drawn[y, 300:900].astype(int)) == 1)[:5] for y in (350, 600, 850)]
    assert np.ptp(np.stack(first), axis=0).max() > 2  # px: straight stripes bend


@pytest.mark.medium
def test_a_theme_that_shows_is_measured_as_such():
    y, x = np.mgrid[:96, :96]
    disc = np.where(np.hypot(y - 48, x - 48) < 24, 0.1, 1.0)
    import toposeam as ts

    found = {strength: [] for strength in (0.0, -1.0)}
    for seed in range(3):
        for strength, values in found.items():
            made = ts.generate_motif(
                64,
                seed=seed,
                layers=1,
                repeat="translate",
                base=disc,
                base_strength=strength,
                base_law="brightness",
                ambient=1.0,
                palette="winter",
            )
            values.append(measure(made.image((96, 96)), disc).likeness)
    assert min(found[-1.0]) > CLEAR > max(found[0.0]) + 0.1


@pytest.mark.parametrize(
    ("line", "phrase", "code"),
    [
        ("book nowhere.png -o b", "there is no file", 1),
        ("book broken.png -o b", "export it again", 1),
        ("book theme.png -o b --size 33", "use 34", 1),
        ("book theme.png -o theme.png/b", "cannot be made", 1),
        ("book theme.png -o b -n 0", "-n", 2),
    ],
)
def test_bad_input(theme, toposeam, line, phrase, code):
    whole = (theme / "theme.png").read_bytes()
    (theme / "broken.png").write_bytes(whole[: len(whole) // 2])
    toposeam(*line.split()).fails(phrase, code)
    assert not (theme / "b").exists()


def test_the_longer_side_decides_what_is_hardly_a_picture():
    assert product("tie", 3.0).longer_px == pytest.approx(640 * 3 / 25.4)  # the shorter one has 41 px
    with pytest.raises(OptionError, match="ask for 3 to"):
        product("tie", 2.5)
