"""Memory of joining two large pictures: python benchmarks/memory.py [side] [overlap] [options of toposeam
stitch].

Two RGB layers of side × side px, 8 bits, that overlap by some columns are joined by the command in a process
of its own; its largest resident memory is printed, also in bytes per pixel of the canvas.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from measured import toposeam
from stamp import stamp
from toposeam_cli.media.pictures.picture import Picture, write_picture


def main(side: int, overlap: int, options: list[str]) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paint(folder, side, overlap)
        words = ["stitch", "a.tif", "b.tif", f"--overlap={overlap}", "-o", "out.tif", *options]
        ran = toposeam(words, folder)
    peak = ran.megabytes * 2**20
    per_pixel = peak / (side * (2 * side - overlap))
    print(
        f"{side} × {side} px twice, overlap {overlap} px: {peak / 2**30:.2f} GiB, {per_pixel:.1f} bytes per "
        "pixel of the canvas"
    )
    print(f"{ran.clock:.0f} s, {ran.seconds:.0f} s of CPU")


def paint(folder: Path, side: int, overlap: int) -> None:
    """Write a.tif and b.tif, b a little brighter."""
    scene = texture(side, 2 * side - overlap)
    for file, start, gain in (("a.tif", 0, 1.0), ("b.tif", side - overlap, 1.03)):
        lut = (np.arange(256) * gain).clip(0, 255).astype(np.uint8)
        write_picture(folder / file, Picture(pixels=lut[scene[:, start : start + side]]))


def texture(height: int, width: int) -> np.ndarray:
    """Structure at all scales: noise, enlarged and added up; (H, W, 3) uint8."""
    rng = np.random.default_rng(0)
    scene = np.empty((height, width, 3), np.uint8)
    for channel in range(3):
        scales = [wide(rng, height, width, step) for step in (4, 64, 1024)]
        for top in range(0, height, 512):
            rows = np.arange(top, min(top + 512, height))
            plane = np.zeros((len(rows), width), np.float32)
            for step, coarse in scales:
                share = (rows % step / np.float32(step))[:, np.newaxis]
                plane += coarse[rows // step] * (1 - share) + coarse[rows // step + 1] * share
            scene[rows, :, channel] = (128 + 30 * plane).clip(0, 255)
    return scene


def wide(rng: np.random.Generator, height: int, width: int, step: int) -> tuple[int, np.ndarray]:
    """Coarse noise, enlarged to the whole width."""
    coarse = rng.standard_normal((height // step + 2, width // step + 2), dtype=np.float32)
    columns = np.arange(width)
    share = columns % step / np.float32(step)
    return step, coarse[:, columns // step] * (1 - share) + coarse[:, columns // step + 1] * share


if __name__ == "__main__":
    print(stamp())
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 10_000,
        int(sys.argv[2]) if len(sys.argv) > 2 else 1_000,
        sys.argv[3:],
    )
