"""The first picture of README: two views of a person before a bookshelf, and what three programs make of
them.

``python docs/people_figures.py``, with OpenCV (``pip install opencv-python-headless``) and Hugin's command
line (``apt install hugin-tools enblend``). Each program gets nothing but the two files.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
from PIL import Image, ImageDraw, ImageFont

DOCS = Path(__file__).resolve().parent
VIEWS = [DOCS.parent / "samples" / f"portrait_{side}.jpg" for side in ("left", "right")]
WIDTH, GAP, CAPTION = 1200, 12, 30


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        ours, opencv, hugin = by_toposeam(folder), by_opencv(folder), by_hugin(folder)
    views = [Image.open(path).convert("RGB") for path in VIEWS]
    sheet(
        DOCS / "figures/people.jpg",
        [
            [(views[0], "two views; between them the person moved"), (views[1], "")],
            [(ours, "toposeam stitch: the shelf is straight, the person is whole")],
            [(opencv, "OpenCV's Stitcher"), (hugin, "Hugin's command line, with enblend")],
        ],
    )


def by_toposeam(folder: Path) -> Image.Image:
    target = folder / "ours.png"
    command = [sys.executable, "-m", "toposeam_cli", "stitch", *map(str, VIEWS), "-o", str(target)]
    subprocess.run(command, check=True)  # noqa: S603 - our own
    return Image.open(target).convert("RGB")


def by_opencv(folder: Path) -> Image.Image:
    status, joined = cv2.Stitcher_create(cv2.Stitcher_PANORAMA).stitch(
        [cv2.imread(str(path)) for path in VIEWS]
    )
    if status != cv2.Stitcher_OK:
        raise RuntimeError(f"OpenCV refused them with status {status}")
    return Image.fromarray(joined[:, :, ::-1])


def by_hugin(folder: Path) -> Image.Image:
    project = str(folder / "set.pto")
    same = ["-o", project, project]
    for command in (
        ["pto_gen", "-o", project, *map(str, VIEWS)],
        ["cpfind", "--multirow", *same],
        ["cpclean", *same],
        ["autooptimiser", "-a", "-m", "-l", "-s", *same],
        ["pano_modify", "--canvas=AUTO", "--crop=AUTO", *same],
        ["hugin_executor", "--stitching", "--prefix=out", project],
    ):
        subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603 - our own
    return Image.open(folder / "out.tif").convert("RGB")


def sheet(file: Path, rows: list[list[tuple[Image.Image, str]]]) -> None:
    """Rows of pictures with their captions, each row as wide as the sheet."""
    font, drawn, top = ImageFont.load_default(size=20), [], 0
    for row in rows:
        room = WIDTH - GAP * (len(row) - 1)
        height = round(room / sum(picture.width / picture.height for picture, _ in row))
        left = 0
        for picture, caption in row:
            shown = picture.resize(
                (round(picture.width * height / picture.height), height), Image.Resampling.LANCZOS
            )
            drawn.append((shown, caption, left, top))
            left += shown.width + GAP
        top += height + CAPTION + GAP
    canvas = Image.new("RGB", (WIDTH, top - GAP), "white")
    pen = ImageDraw.Draw(canvas)
    for picture, caption, left, upper in drawn:
        canvas.paste(picture, (left, upper))
        pen.text((left, upper + picture.height + 4), caption, fill=(90, 90, 90), font=font)
    canvas.save(file, quality=88)
    print(file, canvas.size, file.stat().st_size // 1024, "KiB")


if __name__ == "__main__":
    main()
