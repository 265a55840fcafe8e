"""The page in a real headless Chromium: from pictures that are dropped to a file that is saved."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from edit_pages import (
    DIGEST,
    PORTRAIT,
    SEAM,
    chromium,
    on_screen,
    opened,
    program,
    push_seam,
    until,
    walker_pictures,
)
from PIL import Image

pytest.importorskip("starlette")
pytestmark = pytest.mark.slow


@pytest.fixture
def works(tmp_path):
    return tmp_path / "works"


@pytest.fixture
def layout(tmp_path):
    return walker_pictures(tmp_path)


def label_at(page, x, y):
    return page.evaluate(f"window.toposeam.picture.at({x}, {y})")


def test_drop_place_push_undo_and_save(works, tmp_path):
    with program(works=works) as (_, address), chromium(accept_downloads=True) as context:
        page = context.new_page()
        page.goto(address)
        page.wait_for_selector("#drop")
        page.set_input_files("#files", [str(path) for path in PORTRAIT])
        page.wait_for_selector("#prints img")
        until(page, "!!(window.toposeam?.paths.length && !document.querySelector('#prints'))")
        first = page.evaluate(DIGEST)
        x, y, _ = page.evaluate(SEAM)
        layer = label_at(page, x - 12, y)
        before = label_at(page, x + 40, y)
        push_seam(page)
        assert before != layer
        assert label_at(page, x + 40, y) == layer
        page.click("#undo")
        until(page, f"({DIGEST}) === {first}")
        with page.expect_download(timeout=120_000) as download:
            page.keyboard.press("Control+s")
        saved = tmp_path / "saved.jpg"
        download.value.save_as(saved)
        assert saved.read_bytes()[:2] == b"\xff\xd8"
        assert "joined.jpg" in page.inner_text("#say")
        page.close()


def test_the_seam_follows_while_the_brush_is_down(works):
    with program(*PORTRAIT, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        x, y, _ = page.evaluate(SEAM)
        first = page.evaluate(DIGEST)
        page.mouse.move(*on_screen(page, x - 12, y))
        page.mouse.down()
        for far in (10, 30, 60):
            page.mouse.move(*on_screen(page, x + far, y))
            page.wait_for_timeout(60)
        until(page, f"({DIGEST}) !== {first}")
        assert page.evaluate("!!window.toposeam.stroke")
        page.keyboard.press("Escape")  # nothing is kept
        until(page, f"({DIGEST}) === {first}")
        page.mouse.up()
        assert page.is_disabled("#undo")
        assert page.errors == []


def test_lens_and_one_tap_for_the_whole_thing(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        shows = label_at(page, 162, 105)
        page.mouse.click(*on_screen(page, 162, 105))
        page.wait_for_selector("#chip .accent")
        assert page.evaluate("window.toposeam.lens.layer") == 1 - shows
        page.click("#chip .accent")
        until(page, f"window.toposeam.picture.at(162, 105) === {1 - shows}")
        for x, y in ((152, 82), (173, 82), (152, 128), (173, 128)):
            assert label_at(page, x, y) == 1 - shows
        page.mouse.move(*on_screen(page, 200, 60))
        page.keyboard.down(" ")
        until(page, "!!window.toposeam.lens")
        page.keyboard.up(" ")
        until(page, "!window.toposeam.lens")
        assert page.errors == []


def test_a_reload_in_the_middle_loses_nothing(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        push_seam(page, 30)
        shown = page.evaluate(DIGEST)
        page.reload()
        until(page, "!!(window.toposeam?.paths.length && !document.querySelector('#prints'))")
        assert page.evaluate(DIGEST) == shown
        assert page.is_enabled("#undo")


def test_kill_and_resume(works, layout):
    with program(layout, works=works) as (running, address), chromium() as context:
        page = opened(context, address)
        push_seam(page, 30)
        shown = page.evaluate(DIGEST)
        running.send_signal(signal.SIGKILL)
        running.wait()
        until(page, "document.querySelector('#banner')?.textContent.includes('What you did is kept')")
    with program(layout, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        assert page.evaluate(DIGEST) == shown
        page.click("#undo")
        until(page, f"({DIGEST}) !== {shown}")


def test_a_work_is_found_again_on_the_first_page(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        push_seam(opened(context, address), 30)
    with program(works=works) as (_, address), chromium() as context:
        page = context.new_page()
        page.goto(address)
        page.click(".recent .card")
        until(page, "!!window.toposeam?.paths.length")
        until(page, "!document.querySelector('#undo').disabled")


def test_two_tabs(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        first, second = opened(context, address), opened(context, address)
        assert second.is_visible("#banner button")
        assert not first.query_selector("#banner")
        shown = second.evaluate(DIGEST)
        first.bring_to_front()
        push_seam(first, 30)
        until(second, f"({DIGEST}) !== {shown}")
        assert second.evaluate(DIGEST) == first.evaluate(DIGEST)
        second.bring_to_front()
        second.click("#banner button")
        until(first, "!!document.querySelector('#banner button')")
        second.click("#undo")
        until(first, f"({DIGEST}) === {shown}")


def test_narrow_and_large_screens(works, layout):
    with program(layout, works=works) as (_, address):
        for width, height in ((480, 800), (3840, 2160)):
            with chromium(viewport={"width": width, "height": height}) as context:
                page = opened(context, address)
                boxes = page.evaluate(
                    "[...document.querySelectorAll('.bar')].filter(e => e.offsetHeight)"
                    ".map(e => e.getBoundingClientRect()).map(b => [b.left, b.top, b.right, b.bottom])"
                )
                assert boxes
                for left, top, right, bottom in boxes:
                    assert left >= 0
                    assert top >= 0
                    assert right <= width
                    assert bottom <= height
                small = page.evaluate(
                    "[...document.querySelectorAll('#tools button, #steps button')]"
                    ".filter(e => e.offsetHeight && Math.min(e.offsetHeight, e.offsetWidth) < 44)"
                    ".map(e => e.id)"
                )
                assert small == []
                push_seam(page, 20)
                page.keyboard.press("Control+z")
                assert page.errors == []


def test_keyboard_only(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        page.keyboard.press("Tab")
        until(page, "document.activeElement.id === 'canvas'")
        x, y, _ = page.evaluate(SEAM)
        page.evaluate(f"window.toposeam.pointer = {{ x: {x - 10}, y: {y} }}")
        shown = page.evaluate(DIGEST)
        page.keyboard.press("Enter")
        for _ in range(6):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        until(page, f"({DIGEST}) !== {shown} && !document.querySelector('#undo').disabled")
        page.keyboard.press("Control+z")
        until(page, f"({DIGEST}) === {shown}")
        page.keyboard.press("n")
        assert page.get_attribute("#hide", "aria-pressed") == "true"
        names = page.evaluate(
            "[...document.querySelectorAll('button, select, input, canvas[role], nav, [role=toolbar]')]"
            ".filter(e => !(e.ariaLabel || e.labels?.length || e.textContent.trim())).map(e => e.outerHTML)"
        )
        assert names == []
        assert page.errors == []


def test_touch_paints_with_one_finger_and_moves_with_two(works, layout):
    with program(layout, works=works) as (_, address), chromium(has_touch=True) as context:
        page = opened(context, address)
        touch = context.new_cdp_session(page)
        x, y, _ = page.evaluate(SEAM)
        shown = page.evaluate(DIGEST)

        def send(kind, *points):
            spots = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(points)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": spots})
            page.wait_for_timeout(50)

        (ax, ay), (bx, _) = on_screen(page, x - 10, y), on_screen(page, x + 30, y)
        send("touchStart", (ax, ay))
        for share in (0.3, 0.6, 1):
            send("touchMove", (ax + share * (bx - ax), ay))
        send("touchEnd")
        until(page, f"({DIGEST}) !== {shown} && !document.querySelector('#undo').disabled")
        zoom, shown = page.evaluate("window.toposeam.camera.z"), page.evaluate(DIGEST)
        send("touchStart", (500, 400))
        send("touchStart", (500, 400), (600, 400))
        send("touchMove", (450, 400), (700, 400))
        send("touchEnd")
        assert page.evaluate("window.toposeam.camera.z") > 1.5 * zoom
        assert page.evaluate(DIGEST) == shown


def test_settings_join_again_and_keep_strokes(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        x, y = push_seam(page, 30)
        layer = label_at(page, x - 8, y)
        page.click("#more-shown")
        assert page.query_selector("#set-model") is None  # the layout says where they lie
        page.select_option("#set-blend", "feather")
        until(page, "window.toposeam?.scene.settings.blend === 'feather' && window.toposeam.paths.length")
        assert label_at(page, x - 8, y) == layer
    (work,) = works.glob("*/work.json")
    assert json.loads(work.read_text())["settings"] == {"blend": "feather"}


@pytest.mark.parametrize("pictures", ["walker", "portrait"])
def test_what_is_saved_is_what_stitch_makes_of_its_layout(works, layout, tmp_path, pictures):
    output = tmp_path / "all.png"
    given = [layout] if pictures == "walker" else PORTRAIT
    with program(*given, "-o", output, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        push_seam(page, 25)
        page.click("#save")
        until(page, "document.querySelector('#say').className === 'good'")
        assert "all.png" in page.inner_text("#say")
        page.click("#undo")
        page.click("#save")  # what was saved before is replaced
        page.click("#redo")
        until(page, "document.querySelector('#redo').disabled")
        page.click("#save")  # whether or not the last one has ended
        until(page, "!document.querySelector('#save').classList.contains('busy')")
    words = [sys.executable, "-m", "toposeam", "stitch", tmp_path / "all.toml", "-o", tmp_path / "again.png"]
    subprocess.run(words, check=True)
    assert (tmp_path / "again.png").read_bytes() == output.read_bytes()
    assert "[[stroke]]" in (tmp_path / "all.toml").read_text()


def test_twelve_pictures_on_sixty_megapixels(works, tmp_path):
    rng = np.random.default_rng(4)
    small = Image.fromarray(rng.integers(40, 220, (70, 90, 3), np.uint8))
    whole = small.resize((9000, 7000), Image.Resampling.BICUBIC)
    lines = []
    for row in range(3):
        for column in range(4):
            left, top = 2200 * column, 2300 * row
            tile = whole.crop((left, top, left + 2400, top + 2400))
            tile.save(tmp_path / f"{row}{column}.jpg", quality=90)
            lines.append(f'[[layer]]\nfile = "{row}{column}.jpg"\nat = [{left}, {top}]\n')
    grid, output = tmp_path / "grid.toml", tmp_path / "all.jpg"
    grid.write_text("\n".join(lines))
    with program(grid, "-o", output, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        assert page.evaluate("window.toposeam.scene.layers.length") == 12
        width, height = page.evaluate("[window.toposeam.picture.width, window.toposeam.picture.height]")
        assert 1.5e6 < width * height < 2.5e6
        shown = page.evaluate(DIGEST)
        push_seam(page, 30)
        assert page.evaluate(DIGEST) != shown
        page.click("#save")
        until(page, "document.querySelector('#say').className === 'good'", 300)
        assert page.errors == []
    with Image.open(output) as saved:
        assert saved.size == (9000, 7000)


def test_a_horizon_is_drawn(works, layout):
    with program(layout, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        height = page.evaluate("window.toposeam.picture.height")
        push_seam(page, 25)
        page.click("#more-shown")
        page.click("#horizon")
        page.mouse.move(*on_screen(page, 40, 60))
        page.mouse.down()
        page.mouse.move(*on_screen(page, 90, 66))
        page.mouse.move(*on_screen(page, 140, 72))
        page.mouse.up()
        until(page, f"window.toposeam?.picture.height > {height} && window.toposeam.paths.length")
        until(page, "!document.querySelector('#undo').disabled")
        until(page, "!document.querySelector('#seams').classList.contains('hidden')")
        assert page.get_attribute("#push", "aria-pressed") == "true"
        assert page.errors == []


def test_a_crop_is_drawn(works, tmp_path):
    output = tmp_path / "all.png"
    with program(*PORTRAIT, "-o", output, works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        assert page.query_selector(".handle:not([hidden])") is None  # the crop is fitted
        page.click("#more-shown")
        page.select_option("#set-crop", "box")
        until(page, "window.toposeam?.scene.crop && !document.querySelector('#prints')")
        until(page, "!document.querySelector('#seams').classList.contains('hidden')")
        until(page, "document.querySelector('.handle.right.bottom').style.left")
        handle = page.query_selector(".handle.right.bottom").bounding_box()
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x - 40, y - 20)
        page.mouse.move(x - 150, y - 70)
        page.mouse.up()
        page.focus(".handle.left")
        page.keyboard.press("ArrowRight")
        left, _, right, _ = page.evaluate("Object.values(window.toposeam.crop.box)")
        (work,) = works.glob("*/work.json")
        crop = ""
        for _ in range(200):
            crop = json.loads(work.read_text())["settings"]["crop"]
            if crop.startswith(f"{round(left)},"):
                break
            page.wait_for_timeout(50)
        assert crop.startswith(f"{round(left)},")
        page.keyboard.press("Control+z")
        until(page, f"window.toposeam.crop.box.left < {left} - 4")
        assert page.evaluate("window.toposeam.crop.box.right") == pytest.approx(right, abs=0.6)
        page.keyboard.press("Control+y")
        until(page, f"Math.abs(window.toposeam.crop.box.left - {left}) < 1")
        page.reload()
        until(page, "!!(window.toposeam?.crop?.box && window.toposeam.paths.length)")
        page.keyboard.press("Control+s")
        until(page, "document.querySelector('#say').innerText.includes('all.png')")
        assert page.errors == []
    width, height = map(int, crop.split(",")[2:])
    with Image.open(output) as saved:
        assert saved.size == (width, height)
    assert abs(width - (right - left)) < 1


def test_a_save_is_cancelled_and_a_full_disk_is_said(works, layout, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    with program(layout, "-o", folder / "all.png", works=works) as (_, address), chromium() as context:
        page = opened(context, address)
        push_seam(page, 25)
        page.click("#save")
        page.click("#cancel")
        until(page, "!document.querySelector('#save').classList.contains('busy')")
        assert list(folder.iterdir()) == []
        folder.rmdir()  # as if its disk were gone
        page.click("#save")
        until(page, "document.querySelector('#say').className === 'bad'")
        assert "all.png" in page.inner_text("#say")
        assert page.is_enabled("#undo")
        folder.mkdir()
        page.click("#save")
        until(page, "document.querySelector('#say').className === 'good'")
    assert (folder / "all.png").exists()


def test_pictures_that_do_not_fit_are_one_sentence(works, tmp_path):
    with program(PORTRAIT[0], tmp_path / "left.png", works=works) as (_, address), chromium() as context:
        page = context.new_page()
        page.goto(address)
        page.wait_for_selector(".refused button")
        assert "left.png" in page.inner_text(".foot p")
        page.click(".refused button")
        page.wait_for_selector("#drop")
