"""Pictures of docs/edit.md, in a headless Chromium: ``python docs/edit_figures.py``.

It needs ``pip install '.[cli,edit]' playwright opencv-python-headless`` and the system's Chromium. The pairs
on which tasks are done are rendered from the shelf and the person of ``samples/make_portrait.py``.
"""

from __future__ import annotations

import importlib.util
import io
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw
from playwright.sync_api import sync_playwright

HERE = Path(__file__).resolve().parent
SAMPLES = HERE.parent / "samples"
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: Places on the canvas of the sample, px: beside the seam, beyond it, and the person's face.
PRESS, REACHED, FACE = (640, 150), (800, 150), (545, 235)
#: Tasks: their name, where the person stands on the shelf in the left and the right picture, px, or a post,
#: and what is done: places of the canvas that are tapped and taken, or along which the brush is dragged.
TASKS: tuple[tuple[str, tuple[int | None, int | None], list[list[tuple[int, int]]]], ...] = (
    ("kept", (None, 450), [[(555, 250)]]),
    ("gone", (430, None), [[(535, 240)]]),
    ("post", (None, None), [[(512, 30), (530, 120), (545, 200), (555, 260), (565, 330), (574, 400)]]),
)


def main() -> None:
    """Draw the first page, a push, the lens, a narrow window, and tasks before and after."""
    with tempfile.TemporaryDirectory() as works:
        files = [str(SAMPLES / f"portrait_{side}.jpg") for side in ("left", "right")]
        for pictures in ([], files):
            with program(works, pictures) as address:
                draw(address, bool(pictures))
        rows = []
        for name, places, actions in TASKS:
            with program(works, scene(Path(works), name, places)) as address:
                rows.append(done(address, actions))
        width, height = rows[0][0].size
        sheet = Image.new("RGB", (2 * width + 8, len(rows) * (height + 8) - 8), "white")
        for k, (before, after) in enumerate(rows):
            sheet.paste(before, (0, k * (height + 8)))
            sheet.paste(after, (width + 8, k * (height + 8)))
        sheet.save(HERE / "figures" / "edit-tasks.jpg", quality=86)


@contextmanager
def program(works: str, pictures: list[str]) -> Iterator[str]:
    """Run the page's program, and yield its address."""
    command = [sys.executable, "-m", "toposeam", "edit", "--no-browser", *pictures]
    environment = {**os.environ, "TOPOSEAM_WORKS": works}
    running = subprocess.Popen(  # noqa: S603 - our own command
        command, stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        yield (running.stdout or io.StringIO()).readline().strip()
    finally:
        running.send_signal(signal.SIGINT)
        running.wait()


def scene(folder: Path, name: str, places: tuple[int | None, int | None]) -> list[str]:
    """Write two views of the shelf with the person, or with a post nearer than it."""
    spec = importlib.util.spec_from_file_location("make_portrait", SAMPLES / "make_portrait.py")
    portrait: Any = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
    spec.loader.exec_module(portrait)  # type: ignore[union-attr]
    shelf, person = portrait.bookshelf(), portrait.data.astronaut().astype(np.float32)
    alpha, rng, files = portrait.cut_out(portrait.data.astronaut()), np.random.default_rng(3), []
    views = ((30, 800, 3e-5, 1.0, 0.8, 0), (345, 780, -4e-5, 0.86, -1.1, 14))
    for side, (left, width, turn, gain, tilt, near), place in zip(
        ("left", "right"), views, places, strict=True
    ):
        behind = shelf
        if name == "post":
            drawn = Image.fromarray(shelf.clip(0, 255).astype(np.uint8))
            ImageDraw.Draw(drawn).line((520 + near, 0, 610 + near, shelf.shape[0]), (40, 44, 50), 13)
            behind = np.asarray(drawn, np.float32)
        camera = portrait.camera(left, (width, shelf.shape[0] - 90), turn, tilt)
        seen = portrait.view(behind, person, alpha * (place is not None), camera, width, place or 0)
        noisy = np.clip(seen * gain + rng.normal(0, 1.5, seen.shape), 0, 255).astype(np.uint8)
        files.append(str(folder / f"{name}_{side}.png"))
        Image.fromarray(noisy).save(files[-1])
    return files


def done(address: str, actions: list[list[tuple[int, int]]]) -> tuple[Image.Image, Image.Image]:
    """Tap and take, or drag, on the page; return the joined picture before and after."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800}, color_scheme="light", locale="en")
        page.goto(address)
        wait(page)
        before = canvas(page)
        for first, *rest in actions:
            if rest:
                page.mouse.move(*on_screen(page, first))
                page.mouse.down()
                for at in rest:
                    page.mouse.move(*on_screen(page, at), steps=8)
                page.mouse.up()
            else:
                page.mouse.click(*on_screen(page, first))
                page.click("#chip .accent")
            page.wait_for_timeout(4000)
        page.mouse.move(5, 795)
        after = canvas(page)
        browser.close()
    return before, after


def canvas(page: Any) -> Image.Image:
    """Return the joined picture as the page shows it, without what stands round it."""
    page.wait_for_timeout(1500)
    size = page.evaluate("[window.toposeam.picture.width, window.toposeam.picture.height]")
    (left, top), (right, bottom) = on_screen(page, (0, 0)), on_screen(page, size)
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return shot.crop(tuple(map(round, (left, top, right, bottom)))).resize(
        (600, 250), Image.Resampling.LANCZOS
    )


def draw(address: str, begun: bool) -> None:
    """Open the page, and draw what it shows."""
    with sync_playwright() as playwright:
        chromium = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        size = {"width": 1280, "height": 800}
        page = browser.new_page(viewport=size, color_scheme="dark" if begun else "light", locale="en")
        page.goto(address)
        if not begun:
            page.wait_for_selector("#drop")
            keep(page, "edit-drop", (960, 600))
            browser.close()
            return
        wait(page)
        page.mouse.move(*on_screen(page, PRESS))
        page.mouse.down()
        for k in range(1, 11):
            x = PRESS[0] + (REACHED[0] - PRESS[0]) * k / 10
            page.mouse.move(*on_screen(page, (x, PRESS[1])))
            page.wait_for_timeout(120)
        page.wait_for_timeout(1500)
        keep(page, "edit-push", (1280, 800))
        page.mouse.up()
        page.wait_for_timeout(2500)
        page.mouse.click(*on_screen(page, FACE))
        page.wait_for_timeout(1000)
        keep(page, "edit-lens", (1280, 800))
        page.keyboard.press("Escape")
        page.set_viewport_size({"width": 480, "height": 800})
        page.wait_for_timeout(1500)
        keep(page, "edit-narrow", (480, 800))
        browser.close()


def wait(page: Any) -> None:
    """Wait until the pictures have slid into place, and are blended."""
    until = time.monotonic() + 60
    while not page.evaluate("!!(window.toposeam?.settled && !document.querySelector('#prints'))"):
        if time.monotonic() > until:
            raise TimeoutError("the page shows no seams")
        page.wait_for_timeout(100)


def on_screen(page: Any, at: tuple[float, float]) -> tuple[float, float]:
    """Return where a point of the canvas lies on the screen."""
    found = page.evaluate(f"window.toposeam.camera.toScreen({at[0]}, {at[1]})")
    return found["x"], found["y"]


def keep(page: Any, name: str, size: tuple[int, int]) -> None:
    """Write what the page shows as a picture of the documents."""
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.resize(size, Image.Resampling.LANCZOS).save(HERE / "figures" / f"{name}.jpg", quality=86)


if __name__ == "__main__":
    main()
