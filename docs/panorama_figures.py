"""The steps of ``toposeam stitch`` on two photographs, its projections and its crops, for docs/panoramas.md;
burnt light and scans that lean, for docs/faults.md.

``python docs/panorama_figures.py`` (needs ``pip install opencv-python-headless``).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import skimage.data
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter, map_coordinates

import toposeam as ts
from compared_figures import sheet

DOCS = Path(__file__).resolve().parent
#: Size of a view of the room, px, its focal length, px, and where the cameras look, degrees.
ROOM_SIZE, ROOM_FOCAL, YAWS = (480, 640), 460.0, (-48, -16, 16, 48)
#: How much brighter one view is, so that its walls are burnt.
BRIGHTER = 1.5
#: Half the room's width, its depth before the camera, and how far floor and ceiling are, m.
HALF, DEPTH, FLOOR, CEILING = 2.4, 3.0, 1.5, 1.3
VIEWS = [DOCS.parent / "samples" / f"portrait_{side}.jpg" for side in ("left", "right")]


def main() -> None:
    steps()
    crops()
    projections()
    burnt()
    scans()


def steps() -> None:
    views = [Image.open(path).convert("RGB") for path in VIEWS]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        hard = ("--crop", "outside", "--blend", "none", "--no-match-shading", "--background", "white")
        stitched(VIEWS, folder / "hard.png", *hard, "--overlay", str(folder / "seam.png"))
        stitched(VIEWS, folder / "joined.png")
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


def crops() -> None:
    """What is kept of a picture with ragged edges."""
    left, right = (Image.open(path).convert("RGB") for path in VIEWS)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = [folder / "a.png", folder / "b.png"]
        left.crop((0, 0, 700, 400)).save(files[0])
        right.rotate(-4, Image.Resampling.BICUBIC, expand=False).crop((60, 40, 760, 420)).save(files[1])
        shown = {}
        for crop in ("outside", "inside", "fit"):
            stitched(files, folder / f"{crop}.png", "--crop", crop, "--background", "white")
            shown[crop] = Image.open(folder / f"{crop}.png").convert("RGB")
    words = {"outside": "everything", "inside": "bends and fills nothing", "fit": "the default"}
    row = [(shown[crop], f"--crop {crop}: {said}") for crop, said in words.items()]
    sheet(DOCS / "figures/panoramas-crop.jpg", [row])


def projections() -> None:
    """Four views of a room in four projections."""
    names = ("flat", "cylinder", "panini", "sphere")
    with tempfile.TemporaryDirectory() as scratch:
        folder, shown = Path(scratch), []
        views = [folder / f"room_{number}.png" for number in range(len(YAWS))]
        for yaw, path in zip(YAWS, views, strict=True):
            Image.fromarray(room(yaw)).save(path)
        for name in names:
            options = ("--model", "rotation", "--projection", name, "--fov", "130")
            stitched(views, folder / f"{name}.png", *options)
            shown.append((Image.open(folder / f"{name}.png").convert("RGB"), f"--projection {name}"))
        row = [(Image.open(path), f"room_{number}.png") for number, path in enumerate(views)]
    sheet(DOCS / "figures/panoramas-projections.jpg", [row, shown[:2], shown[2:]])


def burnt() -> None:
    """Two views of a room, of which one is so bright that its walls are burnt."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, shown = Path(scratch), []
        views = [folder / "left.png", folder / "right.png"]
        bright = np.clip(room(16) * BRIGHTER, 0, 255).astype(np.uint8)
        for path, view in zip(views, (room(-16), bright), strict=True):
            Image.fromarray(view).save(path)
        options = {"--blend multiband": ("--blend", "multiband"), "--blend auto, the default": ()}
        for number, words in enumerate(options.values()):
            stitched(views, folder / f"{number}.png", *words)
            shown.append(Image.open(folder / f"{number}.png").convert("RGB"))
    sheet(DOCS / "figures/panoramas-burnt.jpg", [list(zip(shown, options, strict=True))])


def scans() -> None:
    """A page that lay askew on the scanner, scanned in two parts."""
    page = Image.new("L", (900, 1100), 248)
    pen, rng = ImageDraw.Draw(page), np.random.default_rng(3)
    for top in (top for top in range(90, 1010, 26) if top % 260 < 240):
        left = 90
        while left < 790:
            right = left + int(rng.integers(14, 70))
            pen.rectangle((left, top, min(right, 800), top + 9), fill=int(rng.integers(40, 80)))
            left = right + 9
    page = page.rotate(1.6, Image.Resampling.BICUBIC, fillcolor=235)
    with tempfile.TemporaryDirectory() as scratch:
        folder, shown = Path(scratch), []
        parts = [folder / "top.png", folder / "bottom.png"]
        page.crop((0, 0, 900, 620)).save(parts[0])
        page.crop((0, 480, 900, 1100)).save(parts[1])
        options = {"--as scans": (), "--as scans --straighten": ("--straighten",)}
        for number, words in enumerate(options.values()):
            stitched(parts, folder / f"{number}.png", "--as", "scans", "--background", "white", *words)
            joined = Image.open(folder / f"{number}.png").convert("RGB")
            shown.append(joined.crop((0, 0, joined.width, joined.height // 2)))
    sheet(DOCS / "figures/panoramas-scan.jpg", [list(zip(shown, options, strict=True))])


def room(yaw: float) -> np.ndarray:
    """A camera's view of a rendered room with pictures on its walls, to the side of straight ahead."""
    height, width = ROOM_SIZE
    y, x = np.mgrid[:height, :width].astype(float)
    rays = np.stack([x - width / 2 + 0.5, y - height / 2 + 0.5, np.full_like(x, ROOM_FOCAL)], axis=-1)
    angle = np.deg2rad(yaw)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    rays = rays @ turn.T
    ends = np.where(rays > 0, np.array([HALF, FLOOR, DEPTH]), np.array([-HALF, -CEILING, -1.0]))
    lengths = ends / np.where(rays == 0, 1e-9, rays)
    wall = lengths.argmin(axis=-1)
    points = rays * lengths.min(axis=-1, keepdims=True)
    image = np.zeros((height, width, 3))
    for axis, positive in ((0, True), (0, False), (1, True), (1, False), (2, True)):
        seen = (wall == axis) & ((rays[..., axis] > 0) == positive)
        image[seen] = surface(axis, positive, *np.delete(points[seen], axis, axis=1).T)
    noise = np.random.default_rng(round(yaw) + 100).normal(0, 1.5, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def surface(axis: int, positive: bool, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Colours of points of a wall, the floor or the ceiling, (N, 3)."""
    grain = gaussian_filter(np.random.default_rng(axis + 2 * positive).normal(0, 1, (600, 600)), 1.5) * 40
    spots = map_coordinates(grain, [first * 100 + 300, second * 100 + 300], order=1, mode="wrap")
    colour = np.array({0: (196, 206, 198), 1: (150, 112, 78), 2: (214, 206, 190)}[axis], float)
    if axis == 1 and not positive:
        colour = np.array((232, 232, 228), float)
    shown = colour + spots[:, np.newaxis]
    if axis == 1:
        if positive:
            shown[(np.abs((first / 0.4) % 1) < 0.03)] *= 0.6
        return shown
    across, down = (first, second) if axis == 2 else (second, first)
    names = ("coffee", "chelsea", "rocket", "astronaut", "immunohistochemistry")
    for number, left in enumerate((-2.1, -0.75, 0.6, 1.6)):
        poster = getattr(skimage.data, names[(number + 2 * axis + positive) % len(names)])()
        if axis == 0 and not positive:
            poster = 255 - poster  # no wall shows what another one does
        tall = 1.0 * min(1, poster.shape[0] / poster.shape[1])
        inside = (across > left) & (across < left + 1) & (down > -0.5) & (down < tall - 0.5)
        rows = (down[inside] + 0.5) / tall * (poster.shape[0] - 1)
        columns = (across[inside] - left) * (poster.shape[1] - 1)
        for channel in range(3):
            shown[inside, channel] = map_coordinates(
                poster[..., channel].astype(float), [rows, columns], order=1
            )
    shown[down > FLOOR - 0.12] = (120, 92, 66)
    return shown


def stitched(files: list[Path], target: Path, *options: str) -> None:
    words = ["stitch", *map(str, files), "-o", str(target), *options]
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
