"""Works and pages for the tests of ``toposeam edit``."""

from __future__ import annotations

import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

CHROMIUM = next((found for name in ("chromium", "google-chrome") if (found := shutil.which(name))), None)
SAMPLES = Path(__file__).parents[2] / "samples"
PORTRAIT = SAMPLES / "portrait_left.jpg", SAMPLES / "portrait_right.jpg"
#: The server of tests without a browser.
TOKEN, PORT = "right-token", 8123
OWN = f"http://127.0.0.1:{PORT}"
#: A software renderer, as there is no graphics card where tests run.
_FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)


def walker_pictures(folder: Path) -> Path:
    """Write two pictures that overlap by 120 px, with a walker in the right one only, and their layout."""
    rng = np.random.default_rng(7)
    small = Image.fromarray(rng.integers(60, 200, (20, 32, 3), np.uint8))
    ground = np.asarray(small.resize((320, 200), Image.Resampling.BICUBIC)).copy()
    ground = np.clip(ground.astype(int) + rng.integers(-6, 7, ground.shape), 0, 255).astype(np.uint8)
    Image.fromarray(ground[:, :220]).save(folder / "left.png")
    walked = ground.copy()
    walked[80:130, 150:175] = (230, 30, 40)
    Image.fromarray(walked[:, 100:]).save(folder / "right.png")
    layout = folder / "two.toml"
    layout.write_text(
        '[[layer]]\nfile = "left.png"\nat = [0, 0]\n\n[[layer]]\nfile = "right.png"\nat = [100, 0]\n'
    )
    return layout


@contextmanager
def program(*words: Any, works: Path, **more: Any) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run ``toposeam edit --no-browser``; yield it and its address, and end it by Ctrl-C."""
    command = [sys.executable, "-m", "toposeam", "edit", "--no-browser", *map(str, words)]
    environment = {**os.environ, "TOPOSEAM_WORKS": str(works)}
    running = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, **more
    )
    try:
        yield running, running.stdout.readline().strip()
    finally:
        if running.poll() is None:
            running.send_signal(signal.SIGINT)
        try:
            running.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            running.kill()
            running.communicate()
            raise


@contextmanager
def chromium(**options: Any) -> Iterator[Any]:
    """Open a context of a headless Chromium, without which the test is skipped."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=_FLAGS)
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}} | options)
        yield context
        browser.close()


def until(page: Any, expression: str, limit_s: float = 90) -> Any:
    """Wait until JavaScript is true on a page; its own policy allows no waiting by strings there."""
    started = time.monotonic()
    while time.monotonic() - started < limit_s:
        value = page.evaluate(expression)
        if value:
            return value
        page.wait_for_timeout(50)
    raise AssertionError(f"never true: {expression}; the page shows {page.inner_text('body')[:300]!r}")


def opened(context: Any, address: str) -> Any:
    """Open the page, wait for its seams, and refuse errors on it."""
    page = context.new_page()
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.goto(address)
    until(page, "!!(window.toposeam?.paths.length && !document.querySelector('#prints'))")
    return page


#: A point of a seam near the middle of the canvas.
SEAM = """() => {
  const { labels, width, height } = window.toposeam.picture; let best = null;
  for (let y = 8; y < height - 8; y++) for (let x = 8; x < width - 9; x++) {
    const i = y * width + x;
    if (labels[i] && labels[i + 1] && labels[i] !== labels[i + 1]) {
      const far = Math.abs(y - height / 2);
      if (!best || far < best[2]) best = [x, y, far];
    }
  }
  return best;
}"""
#: A number that changes with the labels.
DIGEST = "window.toposeam.picture.labels.reduce((sum, value, k) => (sum * 31 + value * (k % 997)) % 1e9, 7)"


def on_screen(page: Any, x: float, y: float) -> tuple[float, float]:
    """Return where a point of the canvas lies on the screen."""
    at = page.evaluate(f"window.toposeam.camera.toScreen({x}, {y})")
    return at["x"], at["y"]


def push_seam(page: Any, across: float = 50) -> tuple[int, int]:
    """Press left of a seam and drag across it; return the point beyond it that was reached."""
    x, y, _ = page.evaluate(SEAM)
    start, end = on_screen(page, x - 12, y), on_screen(page, x + across, y)
    page.mouse.move(*start)
    page.mouse.down()
    for k in range(1, 9):
        page.mouse.move(start[0] + (end[0] - start[0]) * k / 8, start[1] + (end[1] - start[1]) * k / 8)
        page.wait_for_timeout(40)
    page.mouse.up()
    until(page, "!document.querySelector('#seams').classList.contains('busy')")
    return x + round(across) - 3, y


def unpacked(data):
    (length,) = struct.unpack_from("<I", data)
    head, at, blocks = json.loads(data[4 : 4 + length]), 4 + length, []
    for size in head["sizes"]:
        blocks.append(data[at : at + size])
        at += size
    assert at == len(data)
    return head, blocks


def hear(ws, kind, most=300):
    for _ in range(most):
        head, blocks = unpacked(ws.receive_bytes())
        if head["kind"] == kind:
            return head, blocks
    raise AssertionError(f"{kind} never came")


def live(client, token=TOKEN, **headers):
    # TestClient takes a socket's host from its address; Host and Origin are as a browser sends them.
    return client.websocket_connect(
        f"ws://127.0.0.1:{PORT}/{token}/live", headers={"host": f"127.0.0.1:{PORT}", "origin": OWN, **headers}
    )
