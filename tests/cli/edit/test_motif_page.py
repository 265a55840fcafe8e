"""The page of motifs in a real headless Chromium: it grows, is drawn on, and saved."""

import subprocess
import sys

import numpy as np
import pytest
from edit_pages import chromium, program, until
from PIL import Image

pytest.importorskip("starlette")
pytestmark = pytest.mark.slow
SETTLED = "window.toposeam.share === 1 && !window.toposeam.fresh"
#: A number that changes with what is printed on the cell.
DIGEST = """(() => {
  const m = window.toposeam, c = Object.assign(document.createElement('canvas'), { width: 64, height: 64 });
  m.pattern.thumb(m.cell, m.colours, c, 1);
  let sum = 7;
  for (const v of c.getContext('2d').getImageData(0, 0, 64, 64).data) sum = (sum * 31 + v) % 1e9;
  return sum;
})()"""
#: Two copies across and down, or two tiles of a hexagonal rule, 256 px wide, as the screen shows them.
SHOT = """(() => {
  const m = window.toposeam, c = document.createElement('canvas');
  c.width = 256;
  c.height = Math.round(256 * (m.lattice.hexagonal ? Math.sqrt(3) : 1));
  m.pattern.thumb(m.cell, m.colours, c, 2);
  return [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data];
})()"""
#: A source or a sink in the middle of the screen, and where it is there.
SPOT = """(() => {
  const m = window.toposeam;
  for (const spot of m.copies()) {
    const at = m.camera.toScreen(spot.x, spot.y);
    if (at.x > 200 && at.x < 700 && at.y > 200 && at.y < 600) return { ...spot, at };
  }
})()"""
#: How far the nearest copy of a source or sink is from a place on the screen, px.
NEAREST = """([role, index, x, y]) => {
  const m = window.toposeam, own = [...m.copies()].filter(spot => spot.role === role && spot.index === index);
  const places = own.map(spot => m.camera.toScreen(spot.x, spot.y));
  return Math.min(...places.map(at => Math.hypot(at.x - x, at.y - y)));
}"""
SMALL = """[...document.querySelectorAll('#tools button, #steps button')]
  .filter(e => e.offsetHeight && Math.min(e.offsetHeight, e.offsetWidth) < 44).map(e => e.id)"""
NAMELESS = """[...document.querySelectorAll('button, select, input, canvas[role], nav, [role=toolbar]')]
  .filter(e => !(e.ariaLabel || e.labels?.length || e.textContent.trim())).map(e => e.outerHTML)"""


@pytest.fixture
def works(tmp_path):
    return tmp_path / "works"


@pytest.fixture(scope="module")
def small_recipe():
    words = ["--style", "vein", "--repeat", "p4", "--size", "64x64", "--layers", "2", "--palette", "sea"]
    command = [sys.executable, "-m", "toposeam", "motif", *words, "--seed", "7", "--show-recipe"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def recipe(tmp_path, small_recipe):
    """A small motif to begin with."""
    path = tmp_path / "begin.toml"
    path.write_text(small_recipe)
    return path


def opened(context, address):
    page = context.new_page()
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.goto(address)
    until(page, "!!window.toposeam?.cell")
    until(page, SETTLED)
    return page


def drag(page, *places):
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place, steps=5)
    page.mouse.up()


def test_a_motif_grows_by_itself_and_by_dice(works):
    with program("--motif", works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        frames, seed = page.evaluate("[window.toposeam.frames, window.toposeam.state.seed]")
        page.click("#lock-rule")
        rule = page.evaluate("window.toposeam.state.repeat")
        page.click("#dice")
        until(page, f"window.toposeam.state.seed !== {seed}")
        until(page, f"window.toposeam.frames > {frames + 4} && {SETTLED}")  # a stream
        assert page.evaluate("window.toposeam.state.repeat") == rule
        until(page, "window.toposeam.final")
        assert "As Save writes it" in page.inner_text("#status")
        assert page.errors == []


def test_the_screen_repeats_as_the_pattern_does(works, recipe, tmp_path):
    saved, differences = tmp_path / "sheet.png", {}
    with program("--motif", recipe, "-o", saved, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        page.click("#more-shown")
        for name, value in (("columns", 2), ("rows", 2), ("px", 128)):
            page.fill(f"#{name}", str(value))
        page.keyboard.press("Tab")
        for rule in ("none", "reflect", "rotate", "drop", "brick", "pmg", "p31m"):
            page.select_option("#rule", rule)
            until(page, f"window.toposeam.state.repeat === '{rule}' && {SETTLED}")
            until(page, f"window.toposeam.final && {SETTLED}")
            page.evaluate("document.querySelector('#say').className = ''")
            page.keyboard.press("Control+s")
            until(page, "document.querySelector('#say').className === 'good'")
            shot = np.array(page.evaluate(SHOT), np.uint8).reshape(-1, 256, 4)[..., :3]
            with Image.open(saved) as image:
                made = np.asarray(image.convert("RGB"))
            if rule == "none":  # the page shows one
                shot, made = shot[:128, :128], made[:128, :128]
            rows = min(len(shot), len(made))
            differences[rule] = np.abs(shot[:rows].astype(float) - made[:rows]).mean()
        assert page.errors == []
    # other edges of strokes; another place of a copy makes 30 and more
    assert max(differences.values()) < 6, differences


def test_colours_change_at_once_without_solving(works, recipe):
    with program("--motif", recipe, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        until(page, f"window.toposeam.final && {SETTLED}")
        before, frames = page.evaluate(DIGEST), page.evaluate("window.toposeam.frames")
        page.click("#strip button >> nth=11")
        assert page.evaluate(DIGEST) != before
        page.click("#opaque")
        page.evaluate(
            "(() => { const i = document.querySelector('#paper'); i.value = '#102030';"
            "i.dispatchEvent(new Event('input')); i.dispatchEvent(new Event('change')); })()"
        )
        until(page, "window.toposeam.state.paper[2] > 0.18 && window.toposeam.state.paper[2] < 0.2")
        assert page.evaluate("window.toposeam.state.inking") == "opaque"
        assert page.evaluate("window.toposeam.frames") == frames
        for _ in range(3):
            page.keyboard.press("Control+z")
        until(page, f"document.querySelector('#undo').disabled && ({DIGEST}) === {before}")
        assert page.errors == []


def test_sources_walls_and_eraser_on_the_cell(works, recipe):
    with program("--motif", recipe, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        page.click("#ink-1")
        count = page.evaluate("window.toposeam.state.layers[0].sources.length")
        page.click("#source")
        drag(page, (300, 300), (420, 380))
        until(page, f"window.toposeam.state.layers[0].sources.length > {count + 3}")
        page.click("#wall")
        drag(page, (250, 480), (500, 520))
        until(page, f"window.toposeam.state.walls.length === 1 && {SETTLED}")
        before = page.evaluate(DIGEST)
        page.click("#erase")
        page.keyboard.press("]")
        drag(page, (240, 480), (510, 520))
        until(page, "window.toposeam.state.walls.length === 0")
        until(page, f"{SETTLED} && ({DIGEST}) !== {before}")
        page.click("#hand")
        spot = page.evaluate(SPOT)
        role, index = spot["role"], spot["index"]
        place = f"window.toposeam.state.layers[0].{role}[{index}].join()"
        was = page.evaluate(place)
        undo = page.evaluate("window.toposeam.state.undo")
        x, y = spot["at"]["x"], spot["at"]["y"]
        drag(page, (x, y), (x + 60, y + 25))
        until(page, f"{place} !== '{was}' && window.toposeam.state.undo === {undo + 1}")
        moved = page.evaluate(NEAREST, [role, index, x + 60, y + 25])
        assert moved < 3
        assert page.errors == []


def test_a_slider_streams_while_it_is_dragged(works, recipe):
    with program("--motif", recipe, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        before, frames = page.evaluate(DIGEST), page.evaluate("window.toposeam.frames")
        box = page.query_selector("#mass").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 20, y, steps=8)
        until(page, f"window.toposeam.frames > {frames} && ({DIGEST}) !== {before}")
        assert page.evaluate("window.toposeam.state.undo") == 0
        page.mouse.up()
        until(page, f"window.toposeam.state.undo === 1 && {SETTLED}")
        assert page.evaluate("window.toposeam.state.layers[1].mass") > 0.4
        assert page.errors == []


def test_relatives_are_shown_and_one_is_taken(works, recipe):
    with program("--motif", recipe, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        page.keyboard.press("m")
        until(page, "document.querySelectorAll('.relative:not(:disabled)').length === 8")
        before = page.evaluate(DIGEST)
        page.click(".relative >> nth=4")
        until(page, f"window.toposeam.state.undo === 1 && {SETTLED} && ({DIGEST}) !== {before}")
        page.click("#colours-shown")
        assert page.query_selector(".relative") is None
        assert page.errors == []


def test_what_is_saved_is_what_the_command_makes(works, recipe, tmp_path):
    with program("--motif", recipe, works=works) as (_, address), chromium(accept_downloads=True) as context:
        page = opened(context, address)
        page.click("#wall")
        drag(page, (250, 480), (500, 520))
        until(page, f"window.toposeam.state.walls.length === 1 && {SETTLED}")
        found = {}
        page.click("#more-shown")
        for suffix in ("toml", "png", "svg"):
            page.select_option("#set-format", suffix)
            with page.expect_download(timeout=120_000) as download:
                page.keyboard.press("Control+s")
            found[suffix] = tmp_path / f"saved.{suffix}"
            download.value.save_as(found[suffix])
        page.fill("#px", "48")
        page.select_option("#set-format", "webp")
        with page.expect_download(timeout=120_000) as download:
            page.keyboard.press("Control+s")
        with Image.open(download.value.path()) as growing:
            assert (growing.format, growing.size, growing.n_frames > 10) == ("WEBP", (48, 48), True)
        assert page.errors == []
    for suffix, more in (("png", ["--pixels", "1024x1024"]), ("svg", [])):
        again = tmp_path / f"again.{suffix}"
        words = ["--from", str(found["toml"]), "--sheet", "1x1", *more, "-o", str(again), "--quiet"]
        subprocess.run([sys.executable, "-m", "toposeam", "motif", *words], check=True)
        assert again.read_bytes() == found[suffix].read_bytes()


def test_a_reload_and_a_second_tab(works, recipe):
    with program("--motif", recipe, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        page.select_option("#rule", "pm")
        until(page, f"window.toposeam.state.repeat === 'pm' && {SETTLED}")
        page.reload()
        until(page, "window.toposeam?.state?.repeat === 'pm' && !document.querySelector('#undo').disabled")
        second = opened(context, address)
        assert second.is_visible("#banner button")
        second.click("#banner button")
        until(page, "!!document.querySelector('#banner button')")
        second.keyboard.press("Control+z")
        until(page, "window.toposeam.state.repeat === 'p4'")
        assert page.errors == second.errors == []
    with program("--motif", recipe, works=works) as (_, address), chromium() as context:
        page = opened(context, address)  # what was undone waits to be done again
        assert page.is_enabled("#redo")


def test_every_screen_every_theme_and_keys_only(works, recipe):
    with program("--motif", recipe, works=works) as (_, address):
        for width, height, scheme in ((480, 800, "dark"), (3840, 2160, "light")):
            view = {"width": width, "height": height}
            with chromium(viewport=view, color_scheme=scheme, has_touch=width < 700) as context:
                page = opened(context, address)
                boxes = page.evaluate(
                    "[...document.querySelectorAll('.bar')].filter(e => e.offsetHeight)"
                    ".map(e => e.getBoundingClientRect()).map(b => [b.left, b.top, b.right, b.bottom])"
                )
                assert len(boxes) >= 3
                for left, top, right, bottom in boxes:
                    assert min(left, top) >= 0
                    assert right <= width
                    assert bottom <= height
                assert page.evaluate(SMALL) == []
                assert page.evaluate(NAMELESS) == []
                if width < 700:
                    page.click("#list-shown")
                    assert page.is_visible("#style")
                    page.touchscreen.tap(240, 200)
                    until(page, "!document.querySelector('#design').classList.contains('open')")
                    continue
                page.keyboard.press("w")
                page.focus("#canvas")
                page.keyboard.press("Enter")
                for _ in range(4):
                    page.keyboard.press("ArrowRight")
                page.keyboard.press("Enter")
                until(page, "window.toposeam.state.walls.length === 1")
                page.keyboard.press("Control+z")
                until(page, "window.toposeam.state.walls.length === 0")
                assert page.errors == []
