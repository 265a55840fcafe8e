"""``toposeam motif --explore``: the page, in a real browser where there is one."""

import base64
import io
import re
import shutil
import subprocess
from html import unescape

import numpy as np
import PIL.Image
import pytest

import toposeam as ts
from toposeam_cli.motifs.book.exploring import explore_page
from toposeam_cli.motifs.recipe_files import read_toml, recipe_from_table, to_toml

SMALL = ("--style", "vein", "--size", "24", "--layers", "1", "--iterations", "3")
BROWSER = next((found for name in ("chromium", "google-chrome") if (found := shutil.which(name))), None)


@pytest.fixture
def page(folder, toposeam):
    ran = toposeam("motif", *SMALL, "--seed", "5", "--repeat", "drop", "--explore", "3x2", "-o", "sheet.html")
    assert (ran.code, ran.err) == (0, "")
    return folder / "sheet.html"


def seen(path, folder, hash_=""):
    """The page's elements after its scripts have run."""
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        f"--user-data-dir={folder / 'profile'}",
    ]
    line = [*command, "--virtual-time-budget=3000", "--dump-dom", f"file://{path}{hash_}"]
    ran = subprocess.run(line, capture_output=True, text=True, timeout=600, check=True)
    return ran.stdout


def test_the_page_shows_one_motif_per_seed(page):
    text = page.read_text()
    assert text.count('class="card"') == 6
    assert [int(seed) for seed in re.findall(r"drop, seed (\d+)", text)] == [5, 6, 7, 8, 9, 10]
    assert "{{" not in text


@pytest.mark.medium
@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_a_click_keeps_a_motif_and_shows_its_recipe(page, tmp_path):
    clicking = tmp_path / "clicking.html"
    script = "<script>cards[2].click(); cards[4].click(); cards[4].click();</script></body>"
    clicking.write_text(page.read_text().replace("</body>", script))
    elements = seen(clicking, tmp_path)
    assert re.findall(r'aria-pressed="true" data-number="(\d+)"', elements) == ["3"]
    (recipe,) = re.findall(r"<textarea[^>]*>(.*?)</textarea>", elements, re.DOTALL)
    expected = ts.motif.random_recipe(24, layers=1, iterations=3, seed=7, repeat="drop")
    assert unescape(recipe).strip() == to_toml(expected).strip()
    assert 'download="motif-3.toml"' in elements
    assert 'toposeam motif --from "clicking.html" --number 3 -o motif-3.svg' in elements


@pytest.mark.medium
@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_the_address_remembers_what_was_kept(page, tmp_path):
    elements = seen(page, tmp_path, "#keep=1,6")
    assert re.findall(r'aria-pressed="true" data-number="(\d+)"', elements) == ["1", "6"]


def test_going_on_from_a_motif_of_the_page(page, folder, toposeam):
    recipe = ts.motif.random_recipe(24, layers=1, iterations=3, seed=7, repeat="drop")
    ran = toposeam("motif", "--from", "sheet.html", "--number", "3", "--show-recipe")
    assert ran.out == to_toml(recipe)
    ran = toposeam("motif", "--from", "sheet.html", "--number", "3", "--explore", "2x2", "-o", "next.html")
    assert (ran.code, ran.err) == (0, "")
    # The first is that motif; the others are relatives of it, by seeds of their own.
    seeds = re.findall(r"drop, seed (\d+)", (folder / "next.html").read_text())
    assert seeds == ["7", "1", "2", "3"]
    ran = toposeam("motif", "--from", "next.html", "--number", "1", "--show-recipe")
    assert ran.out == to_toml(recipe)
    second = toposeam("motif", "--from", "next.html", "--number", "2", "--show-recipe").out
    assert second == to_toml(ts.motif.vary(recipe, amount=0.4, seed=1))


def test_going_on_from_a_recipe_that_was_saved_or_a_motif(folder, toposeam):
    recipe = ts.motif.random_recipe(24, layers=1, iterations=3, seed=7, repeat="drop")
    (folder / "kept.toml").write_text(to_toml(recipe))
    assert toposeam("motif", "--from", "kept.toml", "-o", "m.png").code == 0
    for name in ("kept.toml", "m.png"):
        assert toposeam("motif", "--from", name, "--show-recipe").out == to_toml(recipe)


@pytest.mark.parametrize(
    ("text", "number", "said"),
    [
        (None, (), "shows 6 motifs; say which with --number"),
        (None, ("--number", "7"), "has no number 7"),
        ("<p>nothing</p>", ("--number", "1"), "is no page of --explore"),
        ('<script type="application/json" id="recipes">["size = 3"]</script>', (), "is no page of --explore"),
        ('<script type="application/json" id="recipes">{"a": 1}</script>', (), "is no page of --explore"),
        ('<script type="application/json" id="recipes">["a = "]</script>', (), "is no page of --explore"),
    ],
)
def test_pages_that_do_not_say_which_motif(page, toposeam, text, number, said):
    if text is not None:
        page.write_text(text)
    toposeam("motif", "--from", "sheet.html", *number, "-o", "m.png").fails(said)


def test_a_page_of_seeds_with_options_from_a_file(folder, toposeam):
    (folder / "my.toml").write_text('size = 24\nlayers = 1\niterations = 3\nrepeat = "cm"\n')
    for option in ("--config", "--from"):
        ran = toposeam("motif", option, "my.toml", "--explore", "2x1", "-o", "p.html", "--force")
        assert (ran.code, ran.err) == (0, "")
        assert re.findall(r"cm, seed (\d+)", (folder / "p.html").read_text()) == ["0", "1"]


def test_going_on_from_one_begins_with_it(page, folder, toposeam):
    recipe = ts.motif.random_recipe(24, layers=1, iterations=3, seed=7, repeat="drop")
    (folder / "kept.toml").write_text(to_toml(recipe))
    ran = toposeam("motif", "--config", "kept.toml", "--explore", "2x2", "--vary", "0.2", "-o", "next.html")
    assert ran.code == 0
    assert re.findall(r"seed (\d+)", (folder / "next.html").read_text())[:2] == ["7", "1"]
    assert recipe_from_table(read_toml(folder / "kept.toml"), folder) == recipe
    toposeam("motif", "--explore", "2x2", "-o", "next.png").fails("not supported")
    toposeam("motif", "--explore", "99x99", "-o", "m.html").fails("too many")


@pytest.mark.parametrize(
    ("repeat", "counts"), [("none", (2, 2)), ("drop", (2, 2)), ("drop 1/3", (2, 3)), ("rotate", (2, 2))]
)
@pytest.mark.parametrize("size", [(18, 24), (24, 10)])
def test_a_card_shows_whole_motifs_in_their_own_shape(repeat, counts, size):
    """So many that the pattern repeats, two at least, as wide as the card; of long ones the beginning."""
    recipes = [
        ts.motif.random_recipe(size, layers=layers, iterations=2, seed=3, repeat=repeat) for layers in (1, 2)
    ]
    shares = []
    page = explore_page(recipes, 5, 1.0, shares.append)
    assert shares == [0.5, 1]
    assert "repeat(5, 1fr)" in page
    assert re.findall(rf"{repeat}, seed 3, (\d inks?)<", page) == ["1 ink", "2 inks"]
    assert re.findall(r'alt="motif (\d)"', page) == re.findall(r"<span>(\d) ·", page) == ["1", "2"]
    pictures = re.findall(r"data:image/png;base64,([^\"]+)", page)
    for recipe, text in zip(recipes, pictures, strict=True):
        shown = np.asarray(PIL.Image.open(io.BytesIO(base64.b64decode(text))))
        across = 360 // counts[1]
        down = round(across * size[0] / size[1])
        assert shown.shape == (min(counts[0] * down, 360), 360, 3)
        drawn = ts.repeat(ts.generate_motif(recipe), counts, size=(down, across))[:360]
        np.testing.assert_array_equal(shown, np.rint(np.clip(drawn, 0, 1) * 255))
