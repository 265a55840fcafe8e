"""Large textures, in processor time: ``python benchmarks/texture_large.py [--times 3] [--only grown,tiled]``.

grown   how much longer 4096 × 4096 px take than 16 times 1024 × 1024, each the median of some runs in
        processes of their own, and the peak memory of the larger ones; gray and colour, colour with its light
        levelled, and grounds with objects, which are exchanged (``--samples`` to measure some of them)
tiled   ``toposeam tile`` on 2048 × 2048 px against reading and writing that PNG, pictures of many kinds: the
        less there is to a picture, the less its file takes and the dearer is the rest. Both in one process
        that has everything loaded; and, in brackets, both as commands that begin with the start of Python
"""

from __future__ import annotations

import argparse
import contextlib
import io
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import skimage.data
from PIL import Image

from stamp import stamp
from toposeam_cli.app.main import main as command
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

STARS = Path(__file__).resolve().parent.parent / "samples" / "stars.png"
SIDE = 2048
COPIED = """
import sys
from pathlib import Path
from toposeam_cli.media.pictures.picture import read_picture, write_picture
write_picture(Path(sys.argv[2]), read_picture(Path(sys.argv[1])), force=True)
"""
GROWN_SAMPLES = (
    ("gravel", "plain"),
    ("coffee", "plain"),
    ("coffee", "levelled"),
    ("dots", "plain"),
    ("mushrooms", "plain"),
)
GROWN = """
import resource, sys, time, skimage.data, toposeam as ts
name = sys.argv[2]
if hasattr(skimage.data, name):
    sample = getattr(skimage.data, name)()[:192, :192]
else:
    import texture_samples
    sample, _ = texture_samples.MAKERS[name]()
size, level = int(sys.argv[1]), sys.argv[3] == "levelled"
ts.synthesize(sample, 64, patch=40)
started = time.process_time()
made = ts.synthesize(sample, size, patch=40, tileable=True, level=level)
print(time.process_time() - started, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def main() -> None:
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--times", type=int, default=3, help="how often each is measured")
    options.add_argument("--only", default="grown,tiled", help="what to measure, with commas between")
    options.add_argument("--samples", default="", help="which pictures, with commas between; without it all")
    chosen = options.parse_args()
    if "grown" in chosen.only:
        for name, levelled in GROWN_SAMPLES:
            if not chosen.samples or f"{name} {levelled}" in chosen.samples.split(","):
                grown(name, levelled, chosen.times)
    if "tiled" in chosen.only:
        ratios = {
            name: tiled(name, picture, chosen.times)
            for name, picture in pictures()
            if not chosen.samples or name in chosen.samples.split(",")
        }
        worst = max(ratios, key=lambda name: ratios[name])
        print(f"tile on {SIDE}²: {ratios[worst]:.1f} × reading and writing at most ({worst})")


def grown(name: str, levelled: str, times: int) -> None:
    seconds: dict[int, list[float]] = {1024: [], 4096: []}
    peak = 0.0
    for _ in range(times):
        for size in seconds:
            ran = subprocess.run(
                [sys.executable, "-c", GROWN, str(size), name, levelled],
                check=True,
                stdout=subprocess.PIPE,
                text=True,
                cwd=Path(__file__).parent,
            )
            took, peak = map(float, ran.stdout.split())
            seconds[size].append(took)
    small, large = (float(np.median(seconds[size])) for size in (1024, 4096))
    print(
        f"{name}, {levelled}: 4096² takes {large / small / 16:.2f} × 16 times as long as 1024² "
        f"({large:.1f} and {small:.2f} s), and {peak:.0f} MiB with Python and all",
        flush=True,
    )


def pictures() -> Iterator[tuple[str, Picture]]:
    """A name and a picture of 2048 × 2048 px, borders that do not meet."""
    y, x = np.mgrid[:SIDE, :SIDE]
    rng = np.random.default_rng(0)
    astronaut, gravel = repeated(skimage.data.astronaut()), repeated(skimage.data.gravel())
    with Image.open(STARS) as image:
        stars = repeated(np.asarray(image))
    yield "photographs", Picture(pixels=astronaut)
    opacity = np.where(np.hypot(y % 300 - 150, x % 300 - 150) < 60, 0, 255).astype(np.uint8)
    yield "photographs with holes", Picture(pixels=astronaut, alpha=opacity)
    yield "retina", Picture(pixels=repeated(skimage.data.retina()))
    yield "galaxies", Picture(pixels=repeated(skimage.data.hubble_deep_field()))
    yield "stars", Picture(pixels=stars)
    yield "gravel, gray", Picture(pixels=gravel)
    yield "gravel, gray, 16 bit", Picture(pixels=gravel.astype(np.uint16) * 257)
    yield "text", Picture(pixels=repeated(skimage.data.page()))
    yield "noise", Picture(pixels=rng.integers(0, 256, (SIDE, SIDE, 3), np.uint8))
    yield "noise, 16 bit", Picture(pixels=rng.integers(0, 65536, (SIDE, SIDE, 3)).astype(np.uint16))
    yield "checkerboard", Picture(pixels=((y // 50 + x // 50) % 2 * 255).astype(np.uint8))
    yield "slope", Picture(pixels=(x * 256 // SIDE).astype(np.uint8))


def repeated(image: np.ndarray) -> np.ndarray:
    """A picture, over and over."""
    times = tuple(-(-SIDE // length) for length in image.shape[:2]) + (1,) * (image.ndim - 2)
    return np.ascontiguousarray(np.roll(np.tile(image, times)[:SIDE, :SIDE], 100, axis=0))


def tiled(name: str, picture: Picture, times: int) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path, again, made = (Path(folder, file) for file in ("large.png", "again.png", "made.png"))
        write_picture(path, picture)
        words = ["tile", str(path), "-o", str(made), "--force"]
        files, whole, commands = [], [], []
        for _ in range(times + 1):
            started = time.process_time()
            write_picture(again, read_picture(path), force=True)
            files.append(time.process_time() - started)
            started = time.process_time()
            with contextlib.redirect_stdout(io.StringIO()):
                command(words, standalone_mode=False)
            whole.append(time.process_time() - started)
            tile_alone = started_alone("-m", "toposeam", *words)
            commands.append(tile_alone / started_alone("-c", COPIED, str(path), str(again)))
    seconds, ratio = np.median(whole[1:]), float(np.median(whole[1:]) / np.median(files[1:]))
    print(
        f"tile on {SIDE}², {name}: {seconds:.2f} s, {ratio:.1f} × reading and writing the PNG "
        f"({np.median(commands[1:]):.1f} × as commands)",
        flush=True,
    )
    return ratio


def started_alone(*words: str) -> float:
    """Seconds of processor time that a process of its own takes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    print(stamp())
    main()
