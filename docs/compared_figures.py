"""The first picture of README: two views of a still life, and what two programs make of them.

``python docs/compared_figures.py``, with OpenCV (``pip install opencv-python-headless``). Each program gets
nothing but the two files. Results are shown equally wide, and the same spot of both at twice its size.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

DOCS = Path(__file__).resolve().parent
VIEWS = [DOCS.parent / "samples" / f"still_life_{side}.png" for side in ("left", "right")]
WIDTH, GAP, CAPTION = 1200, 12, 30
#: Middle of the spot in the left view, half of the patch that finds it again, and half of what is shown, px.
SPOT, PATCH, SHOWN = (270, 66), (45, 30), (147, 62)


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        ours = by_toposeam(Path(scratch))
    theirs = by_opencv()
    left, right = (Image.open(path).convert("RGB") for path in VIEWS)
    sheet(
        DOCS / "figures/compared.jpg",
        [
            [(ours, "toposeam stitch"), (theirs, f"OpenCV's Stitcher {cv2.__version__.rsplit('.', 1)[0]}")],
            [
                (spot(ours, left), "the same spot at 200 %: the board goes on, a little bowed"),
                (spot(theirs, left), "the board is broken, and a book is cut"),
            ],
            [(beside(left, right), "the two files")],
        ],
    )


def by_toposeam(folder: Path) -> Image.Image:
    target = folder / "ours.png"
    command = [sys.executable, "-m", "toposeam_cli", "stitch", *map(str, VIEWS), "-o", str(target)]
    subprocess.run(command, check=True)  # noqa: S603 - our own
    return Image.open(target).convert("RGB")


def by_opencv() -> Image.Image:
    cv2.setRNGSeed(0)
    stitcher = cv2.Stitcher_create(cv2.Stitcher_PANORAMA)
    status, joined = stitcher.stitch([cv2.imread(str(path)) for path in VIEWS])
    if status != cv2.Stitcher_OK:
        raise RuntimeError(f"OpenCV refused them with status {status}")
    return Image.fromarray(joined[:, :, ::-1])


def spot(joined: Image.Image, view: Image.Image) -> Image.Image:
    """The part of a result that shows the spot, found by a patch of the view, at twice its size."""
    (x, y), (half_width, half_height) = SPOT, PATCH
    patch = view.crop((x - half_width, y - half_height, x + half_width, y + half_height))
    likeness = cv2.matchTemplate(np.asarray(joined), np.asarray(patch), cv2.TM_CCOEFF_NORMED)
    _, _, _, (left, top) = cv2.minMaxLoc(likeness)
    x, y = left + half_width, max(top + half_height, SHOWN[1])
    box = (x - SHOWN[0], y - SHOWN[1], x + SHOWN[0], y + SHOWN[1])
    return joined.crop(box).resize((4 * SHOWN[0], 4 * SHOWN[1]), Image.Resampling.BICUBIC)


def beside(left: Image.Image, right: Image.Image) -> Image.Image:
    """The views side by side, small, and what they are."""
    pair = Image.new("RGB", (3 * WIDTH // 2, max(left.height, right.height)), "white")
    pair.paste(left, (0, 0))
    pair.paste(right, (left.width + GAP, 0))
    words = (
        "Both programs got these two files,\nwith no option set.\n\nThe scene is rendered, from two places\n"
        "7 cm apart: near and far things shift\ndifferently, so that the files cannot\nagree everywhere."
    )
    corner, font = (left.width + right.width + 4 * GAP, 10), ImageFont.load_default(size=30)
    ImageDraw.Draw(pair).multiline_text(corner, words, fill=(90, 90, 90), font=font, spacing=10)
    return pair


def sheet(file: Path, rows: list[list[tuple[Image.Image, str]]]) -> None:
    """Rows of pictures with their captions, each row as wide as the sheet, its pictures equally wide."""
    font, drawn, top = ImageFont.load_default(size=20), [], 0
    for row in rows:
        width = (WIDTH - GAP * (len(row) - 1)) // len(row)
        shown = [
            picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
            for picture, _ in row
        ]
        for number, (picture, (_, caption)) in enumerate(zip(shown, row, strict=True)):
            drawn.append((picture, caption, number * (width + GAP), top))
        top += max(picture.height for picture in shown) + CAPTION + GAP
    canvas = Image.new("RGB", (WIDTH, top - GAP), "white")
    pen = ImageDraw.Draw(canvas)
    for picture, caption, left, upper in drawn:
        canvas.paste(picture, (left, upper))
        pen.text((left, upper + picture.height + 4), caption, fill=(90, 90, 90), font=font)
    canvas.save(file, quality=88)
    print(file, canvas.size, file.stat().st_size // 1024, "KiB")


if __name__ == "__main__":
    main()
