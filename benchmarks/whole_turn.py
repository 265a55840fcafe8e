"""A whole turn of large photographs against a flat mosaic of as many: time per megapixel, and memory.

    python benchmarks/whole_turn.py                     24 frames of 24 megapixels; needs 15 GB of disk
    python benchmarks/whole_turn.py --width 1000        the same of 1.5 megapixels each

The frames are rendered: views of one sphere on which the photographs that come with scikit-image lie, at
steps of 15°, 23° wide, held off by half a degree, exposed up to 15 % differently and noisy. ``toposeam
stitch`` gets nothing but their names. The mosaic has strips of what that made, which lie in a row at known
places, and is finished alike: shading, multiband, cropped.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage
from skimage import data

from measured import Measured, measured
from stamp import stamp

FRAMES, STEP, ACROSS = 24, 15.0, 23.0
PHOTOGRAPHS = (
    "astronaut",
    "coffee",
    "chelsea",
    "rocket",
    "retina",
    "hubble_deep_field",
    "immunohistochemistry",
)
#: px of what is seen for each px of a view.
DENSITY = 0.5


def scene(rng: np.random.Generator, width: int, height: int) -> np.ndarray:
    """(height, width, 3) uint8: photographs beside each other, and small ones upon them."""
    photographs = [Image.fromarray(getattr(data, name)()[..., :3]) for name in PHOTOGRAPHS]
    seen = np.zeros((height, width, 3), np.uint8)
    large, small = height // 4, (height // 60, height // 9)
    places = [(y, x, large) for y in range(0, height, large) for x in range(0, width, large)]
    places += [
        (int(rng.integers(height)), int(rng.integers(width)), int(rng.integers(*small))) for _ in range(4000)
    ]
    for y, x, side in places:
        picture = photographs[rng.integers(len(photographs))]
        part = np.asarray(picture.resize((side, side)))
        room = seen[y : y + side, x : x + side]
        room[:] = part[: room.shape[0], : room.shape[1]]
    return seen


def render(folder: Path, width: int) -> list[Path]:
    """Views of a scene, as JPEG files."""
    rng = np.random.default_rng(0)
    height = width * 3 // 2
    focal = width / 2 / np.tan(np.radians(ACROSS / 2))
    radius = DENSITY * focal
    around, down = int(2 * np.pi * radius), int(1.2 * DENSITY * height)
    seen = scene(rng, around, down)
    x, y = np.meshgrid(
        (np.arange(width) - (width - 1) / 2) / focal, (np.arange(height) - (height - 1) / 2) / focal
    )
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    paths = []
    for frame in range(FRAMES):
        yaw, pitch, roll = np.radians(np.array([STEP * frame, 0, 0]) + rng.normal(0, 0.5, 3))
        turn = np.eye(3)
        for axis, angle in ((1, yaw), (0, pitch), (2, roll)):
            own = np.eye(3)
            one, other = [number for number in range(3) if number != axis]
            own[one, one] = own[other, other] = np.cos(angle)
            own[one, other] = np.sin(angle) * (1 if axis == 1 else -1)
            own[other, one] = -own[one, other]
            turn = turn @ own
        there = rays @ turn.T
        columns = np.arctan2(there[..., 0], there[..., 2]) % (2 * np.pi) * radius
        rows = there[..., 1] / np.hypot(there[..., 0], there[..., 2]) * radius + down / 2
        view = [
            ndimage.map_coordinates(seen[..., channel], [rows, columns], np.float32, order=1, mode="mirror")
            for channel in range(3)
        ]
        noisy = np.stack(view, axis=-1) * rng.uniform(0.85, 1.15) + rng.normal(0, 2, (height, width, 1))
        paths.append(folder / f"view-{frame:02d}.jpg")
        Image.fromarray(noisy.clip(0, 255).astype(np.uint8)).save(paths[-1], quality=92)
    return paths


def strips(folder: Path, whole: Path, width: int) -> tuple[list[Path], int]:
    """As many strips of a picture, as wide as the views, in a row; and how far they overlap, px."""
    import pyvips

    picture = pyvips.Image.new_from_file(str(whole))
    step = (picture.width - width) // (FRAMES - 1)
    paths = [folder / f"strip-{number:02d}.jpg" for number in range(FRAMES)]
    for number, path in enumerate(paths):
        picture.crop(number * step, 0, width, picture.height).write_to_file(str(path), Q=92)
    return paths, width - step


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--width", type=int, default=4000, help="of a frame, px; it is half as high again")
    given = parser.parse_args()
    print(stamp())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def stitched(output: str, paths: list[Path], *words: str) -> tuple[Measured, float]:
            command = [sys.executable, "-m", "toposeam_cli", "stitch", *map(str, paths), "-o", output]
            ran = measured([*command, "--max-megapixels", "1000", *words], folder)
            if ran.code:
                raise SystemExit(ran.said)
            megapixels = sum(Image.open(path).size[0] * Image.open(path).size[1] for path in paths) / 1e6
            return ran, megapixels

        runs = {"whole turn": stitched("turn.tif", render(folder, given.width))}
        parts, overlap = strips(folder, folder / "turn.tif", given.width)
        words = ("--row", "--overlap", str(overlap), "--as", "photographs")
        runs["flat mosaic"] = stitched("flat.tif", parts, *words)
        per_megapixel = {kind: ran.seconds / megapixels for kind, (ran, megapixels) in runs.items()}
        for kind, (ran, megapixels) in runs.items():
            print(
                f"{kind}: {megapixels:.0f} megapixels, {ran.seconds:.0f} s of processor time, "
                f"{per_megapixel[kind]:.2f} s a megapixel, {ran.together:.0f} MiB"
            )
        ratio = per_megapixel["whole turn"] / per_megapixel["flat mosaic"]
        print(f"whole turn ÷ flat mosaic, a megapixel: {ratio:.2f}")


if __name__ == "__main__":
    main()
