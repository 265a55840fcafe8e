"""Pictures of docs/edit-motif.md, in a headless Chromium: ``python docs/grow_figures.py``.

It needs what ``docs/edit_figures.py`` needs.
"""

from __future__ import annotations

import io
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from edit_figures import FLAGS, keep, program

HERE = Path(__file__).resolve().parent
SETTLED = "window.toposeam?.share === 1 && !window.toposeam.fresh"


def main() -> None:
    """Draw the page, a motif that grows, what is drawn on its cell, and a narrow window."""
    with (
        tempfile.TemporaryDirectory() as works,
        program(works, ["--motif"]) as address,
        sync_playwright() as api,
    ):
        browser = api.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800}, color_scheme="light", locale="en")
        page.goto(address)
        wait(page, f"!!window.toposeam?.cell && {SETTLED}")
        thrown(page, 12, "leaf", "p4m", "winter")
        wait(page, "window.toposeam.final")
        page.wait_for_timeout(1000)
        keep(page, "grow-page", (1280, 800))
        steps(page)
        thrown(page, 12, "vein", "translate", "sumi")
        page.click("#ink-1")
        page.click("#wall")
        drag(page, (300, 300), (500, 300), (500, 500))
        page.click("#source")
        drag(page, (350, 400), (450, 450))
        page.wait_for_timeout(600)
        wait(page, SETTLED)
        page.wait_for_timeout(1000)
        keep(page, "grow-draw", (1280, 800))
        page.click("#hand")
        page.click("#spots")
        page.emulate_media(color_scheme="dark")
        thrown(page, 105, "batik", "p31m", "plum")
        page.set_viewport_size({"width": 480, "height": 800})
        page.wait_for_timeout(1500)
        page.click("#relatives")
        wait(page, "document.querySelectorAll('.relative:not(:disabled)').length === 8")
        page.wait_for_timeout(1000)
        keep(page, "grow-narrow", (480, 800))
        browser.close()


def thrown(page: Any, seed: int, style: str, rule: str, palette: str) -> None:
    """Show what a seed draws, in a palette."""
    message = f"{{ kind: 'dice', seed: {seed}, style: '{style}', repeat: '{rule}' }}"
    page.evaluate(f"window.toposeam.send({message})")
    wait(page, f"window.toposeam.state.seed === {seed} && window.toposeam.state.repeat === '{rule}'")
    page.wait_for_timeout(400)
    page.click(f"#strip button[aria-label='{palette.capitalize()}']")
    wait(page, SETTLED)
    page.wait_for_timeout(1200)


def steps(page: Any) -> None:
    """Draw four stages of a motif that grows, and what its recipe makes."""
    page.evaluate("window.toposeam.send({ kind: 'dice', seed: 31, style: 'fern', repeat: 'pmg' })")
    stages = []
    for share in (0.03, 0.2, 0.5, 1):
        wait(page, f"window.toposeam.state.seed === 31 && window.toposeam.share >= {share}", 15)
        page.wait_for_timeout(30)
        stages.append(middle(page))
    wait(page, "window.toposeam.final")
    page.wait_for_timeout(1000)
    stages.append(middle(page))
    sheet = Image.new("RGB", (5 * 300 - 8, 292), "white")
    for number, stage in enumerate(stages):
        sheet.paste(stage, (300 * number, 0))
    sheet.save(HERE / "figures" / "grow-steps.jpg", quality=86)


def middle(page: Any) -> Image.Image:
    """Return a square of what the page shows, beside its panels."""
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return shot.crop((200, 90, 800, 690)).resize((292, 292), Image.Resampling.LANCZOS)


def drag(page: Any, *places: tuple[int, int]) -> None:
    """Drag along places of the screen."""
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place, steps=6)
    page.mouse.up()
    page.wait_for_timeout(400)
    wait(page, SETTLED)


def wait(page: Any, expression: str, pause_ms: int = 80) -> None:
    """Wait until JavaScript is true on the page."""
    until = time.monotonic() + 90
    while not page.evaluate(expression):
        if time.monotonic() > until:
            raise TimeoutError(expression)
        page.wait_for_timeout(pause_ms)


if __name__ == "__main__":
    main()
