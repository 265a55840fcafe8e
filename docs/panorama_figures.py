"""The steps of ``toposeam stitch`` on two photographs, for docs/panoramas.md.

``python docs/panorama_figures.py`` (needs ``pip install opencv-python-headless``).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import toposeam as ts
from compared_figures import sheet

DOCS = Path(__file__).resolve().parent
VIEWS = [DOCS.parent / "samples" / f"portrait_{side}.jpg" for side in ("left", "right")]


def main() -> None:
    views = [Image.open(path).convert("RGB") for path in VIEWS]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        hard = ("--crop", "outside", "--blend", "none", "--no-match-shading", "--background", "white")
        stitched(folder / "hard.png", *hard, "--overlay", str(folder / "seam.png"))
        stitched(folder / "joined.png")
        seam, joined = (Image.open(folder / f"{name}.png").convert("RGB") for name in ("seam", "joined"))
    sheet(
        DOCS / "figures/panoramas-steps.jpg",
        [
            [(views[0], "two files"), (views[1], "between them the person moved")],
            [
                (laid(views), "1. placed and warped, laid on each other"),
                (seam, "2. the seam, which keeps the person whole"),
            ],
            [(joined, "3. shading matched, blended, fitted to a rectangle")],
        ],
    )


def stitched(target: Path, *options: str) -> None:
    words = ["stitch", *map(str, VIEWS), "-o", str(target), *options]
    subprocess.run([sys.executable, "-m", "toposeam_cli", *words], check=True)  # noqa: S603 - our own


def laid(views: list[Image.Image]) -> Image.Image:
    """The pictures at their places, each half transparent."""
    layers = ts.find_places([ts.Layer(np.asarray(view), name=str(n)) for n, view in enumerate(views)]).layers
    left, top = (min(layer.at[axis] for layer in layers) for axis in (0, 1))
    right = max(layer.at[0] + layer.image.shape[1] for layer in layers)
    bottom = max(layer.at[1] + layer.image.shape[0] for layer in layers)
    total, weight = np.zeros((bottom - top, right - left, 3)), np.zeros((bottom - top, right - left, 1))
    for layer in layers:
        height, width = layer.image.shape[:2]
        rows = slice(layer.at[1] - top, layer.at[1] - top + height)
        columns = slice(layer.at[0] - left, layer.at[0] - left + width)
        shown = layer.covered[..., np.newaxis]
        total[rows, columns] += np.where(shown, np.asarray(layer.image), 0)
        weight[rows, columns] += shown
    return Image.fromarray(np.where(weight > 0, total / np.maximum(weight, 1), 255).astype(np.uint8))


if __name__ == "__main__":
    main()
