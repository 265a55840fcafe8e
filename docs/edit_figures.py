"""Pictures of docs/edit.md, in a headless Chromium: ``python docs/edit_figures.py``.

It needs ``pip install '.[cli,edit]' playwright`` and the system's Chromium.
"""

from __future__ import annotations

import io
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

HERE = Path(__file__).resolve().parent
SAMPLES = HERE.parent / "samples"
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: Places on the canvas of the sample, px: beside the seam, beyond it, and the person's face.
PRESS, REACHED, FACE = (640, 150), (800, 150), (545, 235)


def main() -> None:
    """Draw the first page, a push, the lens, and a narrow window."""
    with tempfile.TemporaryDirectory() as works:
        environment = {**os.environ, "TOPOSEAM_WORKS": works}
        files = [str(SAMPLES / f"portrait_{side}.jpg") for side in ("left", "right")]
        for pictures in ([], files):
            command = [sys.executable, "-m", "toposeam", "edit", "--no-browser", *pictures]
            running = subprocess.Popen(  # noqa: S603 - our own command
                command, stdout=subprocess.PIPE, text=True, env=environment
            )
            try:
                draw((running.stdout or io.StringIO()).readline().strip(), bool(pictures))
            finally:
                running.send_signal(signal.SIGINT)
                running.wait()


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
