"""``toposeam book``: every pattern once, sorted, again where it was interrupted, and the same whatever the number of processes."""

import csv
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from toposeam.motif.kinds import CLEAR, Kind, measure
from toposeam_cli.book_jobs import SEASONS, book_recipe
from toposeam_cli.mockups import PRODUCTS, draw_product
from toposeam_cli.picture import Picture, read_picture, write_picture
from toposeam_cli.recipe_file import read_recipe

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
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.*")) if path.suffix != ".jsonl"}


class Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.files, self.text = [], ""

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.files += [values[name] for name in ("href", "src") if name in values and not values[name].startswith("#")]
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
    assert started("book", "theme.png", *SMALL, "-o", "two", "-j", "2", "--title", "Discs & <b>rings</b>").code == 0
    assert contents(theme / "two") == contents(folder)


def test_half_of_the_patterns_are_meant_to_show_the_theme():
    y, x = np.mgrid[:48, :48]
    disc = np.where(np.hypot(y - 24, x - 24) < 12, 0.1, 1.0)
    recipes = [book_recipe(disc, 5, number, 32) for number in range(60)]
    strong = sum(abs(recipe.base_strength) >= 0.6 for recipe in recipes)
    assert 20 <= strong <= 40
    assert all(recipe.base_strength < 0 for recipe in recipes)  # dark on light: ink where it is dark
    assert all(recipe.base_strength > 0 for recipe in (book_recipe(1 - disc, 5, number, 32) for number in range(5)))
    assert len({recipe.repeat for recipe in recipes}) > 8
    assert {recipe.paper for recipe in recipes[:4]} == {recipe.paper for recipe in recipes}
    assert len(SEASONS) == 4


@pytest.mark.parametrize("name", PRODUCTS)
def test_products_show_the_pattern_at_its_size(name):
    product = PRODUCTS[name]
    stripes = np.full((60, 60, 3), 255, np.uint8)
    stripes[:, :30] = (200, 30, 30)
    drawn = draw_product(product, stripes, 60, np.ones(3), np.zeros(3))
    assert drawn.shape == (round(product.height * 1.5), round(product.width * 1.5), 3)
    red = (drawn[..., 0].astype(int) - drawn[..., 1]) > 60
    # Across the middle, where the cloth lies flat; down the tie, which is narrow and on which the pattern lies aslant.
    middle = red[300:720, 260] if name == "tie" else red[int({"scarf": 0.5, "shirt": 0.6, "canvas": 0.4}[name] * len(red))]
    edges = np.flatnonzero(np.diff(middle.astype(int)) == 1)
    apart = np.diff(edges)[1:-1] if len(edges) > 4 else np.diff(edges)
    assert np.median(apart) / 1.5 == pytest.approx(product.motif_mm / np.cos(np.radians(product.angle)), rel=0.03)


def test_a_theme_that_shows_is_measured_as_such():
    y, x = np.mgrid[:96, :96]
    disc = np.where(np.hypot(y - 48, x - 48) < 24, 0.1, 1.0)
    import toposeam as ts

    found = {strength: [] for strength in (0.0, -0.95)}
    for seed in range(3):
        for strength, values in found.items():
            made = ts.generate_motif(
                64, seed=seed, layers=1, repeat="translate", base=disc, base_strength=strength, ambient=1.0, palette="winter"
            )
            values.append(measure(made.image((96, 96)), disc).likeness)
    assert max(found[-0.95]) > CLEAR
    assert min(found[-0.95]) > 0.4 > 2 * max(map(abs, found[0.0]))


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
