"""A whole turn of large photographs against a flat mosaic of as many: time per megapixel, and memory.

    python benchmarks/whole_turn.py                     24 frames of 24 megapixels; needs 15 GB of disk
    python benchmarks/whole_turn.py --width 1000        the same of 1.5 megapixels each

The frames are rendered (``rendered_views.py``): views of one sphere at steps of 15°, 23° wide, held off by
half a degree, exposed up to 20 % differently and noisy. ``toposeam stitch`` gets nothing but their names. The
mosaic has strips of what that made, which lie in a row at known places, and is finished alike: shading,
multiband, cropped.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from measured import Measured, measured
from rendered_views import PHOTOGRAPHS, render_view, rotation_of, scene_for
from stamp import stamp
from toposeam.layers.canvas.transforms import CameraTransform

#: Degrees: between frames, across one, and by which a hand is off, one standard deviation.
FRAMES, STEP, ACROSS, HELD = 24, 15.0, 23.0, 0.5
#: px of what is seen for each px of a view, and across a view, at most: the scene has to fit into memory.
DENSITY, LARGE = 1.5, 2000


def render(folder: Path, width: int) -> list[Path]:
    """Views of a scene, as JPEG files."""
    rng, size = np.random.default_rng(0), (width, width * 3 // 2)
    focal, density = width / 2 / math.tan(math.radians(ACROSS / 2)), min(DENSITY, LARGE / width)
    cameras = [
        CameraTransform(
            size=size,
            rotation=rotation_of(*np.radians(np.array([STEP * frame, 0, 0]) + rng.normal(0, HELD, 3))),
            focal=focal,
            projection="sphere",
            radius=round(2 * math.pi * density * focal) / (2 * math.pi),
        )
        for frame in range(FRAMES)
    ]
    seen = scene_for(rng, cameras, size, PHOTOGRAPHS, around=True)
    paths = [folder / f"view-{frame:02d}.jpg" for frame in range(FRAMES)]
    for path, camera in zip(paths, cameras, strict=True):
        Image.fromarray(render_view(rng, seen, camera, size)).save(path, quality=92)
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
