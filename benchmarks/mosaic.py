"""Mosaics of photographs against enblend and Multiblend, in one run: processor seconds, peak memory, and what
is seen at the seams.

    python benchmarks/mosaic.py                       four frames of 3000 × 2000 px (about three minutes)
    python benchmarks/mosaic.py --work large          5 × 4 frames of 24 megapixels (283 in all)
    python benchmarks/mosaic.py --work gigapixel      10 × 6 frames of 31 megapixels: 20 GB of disk
    python benchmarks/mosaic.py --only toposeam       without the peers
    python benchmarks/mosaic.py -j 2                  ours by two processes

The peers: ``apt-get install enblend`` (Debian, Ubuntu). Multiblend has no package; built from
https://horman.net/multiblend/ (or a copy of version 2.0 on GitHub) it is run too when it is on the PATH as
``multiblend``. Where it ends with "Operation not permitted" its threads start before what they wait for is
set: in ``threadpool.cpp`` move ``pthread_create`` to the end of the loop.

The frames overlap by 30 %. Each is exposed up to ±10 % differently, darkens towards its corners by up to
12 %, and shows some objects that no other frame shows at that place. Every program is a process of its own,
reads the same TIFF files (RGBA, uncompressed, with places in XPosition and YPosition as Hugin's nona writes
them) and writes an uncompressed TIFF. Processor time is user and system time of the process and those that it
starts, *peak* the largest resident set of one, files it looks at included, *share* the most that all have
together, looked at every second, pages that they share counted once. On four frames ours runs once before it
is measured, so that Python's modules are compiled, as they are where it is installed.

*Step* is, at the pixel pairs across which the shown frame changes, by how much the result's own step differs
from the scene's, in 8-bit levels; it is known for ours alone, which says where its seams are. *Error* is the
mean absolute difference to the scene, moved objects left out, after one gain and offset per channel; the
vignetting that is left dominates it.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvips
import tifffile
from scipy import ndimage
from skimage import data, transform

from measured import Measured, measured
from stamp import stamp

OVERLAP, EXPOSURE, VIGNETTING, NOISE = 0.30, 0.10, 0.12, 1.5
OBJECTS = 12  # a frame
LARGE_SCENE = 4096
SMALL_WORK = 4  # frames of which error and step are measured


def scene(height: int, width: int, rng: np.random.Generator) -> np.ndarray:
    """A landscape of photographs, (height, width, 3) uint8, with detail at every scale."""
    photographs = [data.coffee(), data.chelsea(), data.astronaut(), data.rocket()]
    result = np.zeros((height, width, 3), np.float32)
    tile = min(height, width) // 2 + 1
    for top in range(0, height, tile):
        for left in range(0, width, tile):
            photograph = photographs[int(rng.integers(len(photographs)))]
            part = transform.resize(photograph, (tile, tile), order=1).astype(np.float32)
            part = part[: height - top, : width - left]
            result[top : top + tile, left : left + tile] = part
    result = ndimage.gaussian_filter(result, (3, 3, 0))
    for period in (2, 4, 8, 16, 32):
        size = (height // period + 2, width // period + 2)
        coarse = rng.standard_normal(size, np.float32)
        detail = ndimage.zoom(coarse, period, order=1)[:height, :width] * (0.004 * period**0.6)
        result += detail[..., None]
    return np.clip(result * 235 + 10, 0, 255).astype(np.uint8)


def make_frames(
    folder: Path, columns: int, rows: int, width: int, height: int, seed: int
) -> tuple[np.ndarray, np.ndarray, list[tuple[int, int]]]:
    """Frames as TIFF files; returns the scene, where no frame has a moved object, and the places."""
    rng = np.random.default_rng(seed)
    steps = round(width * (1 - OVERLAP)), round(height * (1 - OVERLAP))
    total = steps[1] * (rows - 1) + height, steps[0] * (columns - 1) + width
    truth = scene(*total, rng)
    still = np.ones(total, bool)
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j].astype(np.float32)
    lens = 1 - VIGNETTING * (x * x + y * y) / 2
    places = []
    for row in range(rows):
        for column in range(columns):
            left, top = column * steps[0], row * steps[1]
            part = np.s_[top : top + height, left : left + width]
            frame = truth[part].astype(np.float32)
            for _ in range(OBJECTS):
                radius = int(rng.uniform(0.01, 0.03) * width)
                cy, cx = int(rng.integers(radius, height - radius)), int(rng.integers(radius, width - radius))
                box = np.s_[cy - radius : cy + radius, cx - radius : cx + radius]
                dy, dx = np.mgrid[-radius:radius, -radius:radius]
                inside = dy * dy + dx * dx < radius * radius
                frame[box][inside] = rng.uniform(20, 235, 3)
                still[part][box] &= ~inside
            gain = 1 + rng.uniform(-EXPOSURE, EXPOSURE)
            frame *= (lens * gain)[..., None]
            frame += rng.standard_normal(frame.shape, np.float32) * NOISE
            pixels = np.clip(np.rint(frame), 0, 255).astype(np.uint8)
            rgba = np.dstack([pixels, np.full((height, width), 255, np.uint8)])
            write_tiff(folder / f"frame{len(places):02d}.tif", rgba, (left, top))
            places.append((left, top))
    return truth, still, places


def make_large(
    folder: Path, columns: int, rows: int, width: int, height: int, seed: int
) -> tuple[tuple[int, int], list[tuple[int, int]]]:
    """Frames of a scene larger than memory: one of 4096 × 4096 px and its mirror images, side by side.
    Returns the height and width of all, and the places.
    """
    rng = np.random.default_rng(seed)
    steps = round(width * (1 - OVERLAP)), round(height * (1 - OVERLAP))
    total = steps[1] * (rows - 1) + height, steps[0] * (columns - 1) + width
    part = scene(LARGE_SCENE, LARGE_SCENE, rng)
    noise = rng.normal(0, NOISE, (257, width + 300, 3)).astype(np.float32)
    across = np.linspace(-1, 1, width, dtype=np.float32) ** 2
    places = []
    for index in range(columns * rows):
        row, column = divmod(index, columns)
        left, top = column * steps[0], row * steps[1]
        at = np.arange(left, left + width) % (2 * LARGE_SCENE)
        at = np.minimum(at, 2 * LARGE_SCENE - 1 - at)
        gain = rng.uniform(1 - EXPOSURE, 1 + EXPOSURE)
        shift = int(rng.integers(300))
        spots = [
            (int(rng.integers(height)), int(rng.integers(width)), int(rng.uniform(0.01, 0.03) * width))
            for _ in range(OBJECTS)
        ]
        colours = rng.uniform(20, 235, (OBJECTS, 3)).astype(np.float32)
        frame = np.full((height, width, 4), 255, np.uint8)
        for start in range(0, height, 256):
            stop = min(start + 256, height)
            down = np.arange(top + start, top + stop) % (2 * LARGE_SCENE)
            down = np.minimum(down, 2 * LARGE_SCENE - 1 - down)
            values = part[down][:, at].astype(np.float32)
            y = np.arange(start, stop)
            for (cy, cx, radius), colour in zip(spots, colours, strict=True):
                reach = np.sqrt(np.maximum(radius**2 - (y - cy) ** 2, 0)).astype(int)
                for line, wide in enumerate(reach.tolist()):
                    values[line, max(cx - wide, 0) : cx + wide] = colour
            lens = gain * (1 - VIGNETTING * (across + ((2 * y[:, np.newaxis] / height - 1) ** 2)) / 2)
            values *= lens.astype(np.float32)[..., np.newaxis]
            values += noise[: stop - start, shift : shift + width]
            frame[start:stop, :, :3] = np.clip(np.rint(values), 0, 255)
        write_tiff(folder / f"frame{index:02d}.tif", frame, (left, top))
        places.append((left, top))
    return total, places


def write_tiff(path: Path, rgba: np.ndarray, at: tuple[int, int]) -> None:
    """RGBA with a place, as nona writes it: position × resolution = px."""
    tifffile.imwrite(
        path,
        rgba,
        photometric="rgb",
        extrasamples=["unassalpha"],
        rowsperstrip=64,
        resolution=(150, 150),
        resolutionunit="INCH",
        extratags=[(286 + axis, 5, 1, (at[axis], 150), True) for axis in (0, 1)],
        metadata=None,
    )


def error_of(result: np.ndarray, truth: np.ndarray, still: np.ndarray) -> float:
    """Mean absolute difference where nothing moved, after a straight line per channel; 8-bit levels."""
    height, width = min(len(result), len(truth)), min(result.shape[1], truth.shape[1])
    part, mask = np.s_[:height:3, :width:3], still[:height:3, :width:3]
    errors = []
    for channel in range(3):
        a, b = (image[part][..., channel][mask].astype(np.float64) for image in (result, truth))
        slope, base = np.polyfit(a, b, 1)
        errors.append(np.abs(slope * a + base - b).mean())
    return float(np.mean(errors))


def step_of(result: np.ndarray, labels: np.ndarray, truth: np.ndarray) -> float:
    """Mean excess step across the seams, 8-bit levels."""
    steps = []
    for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        divided = labels[s] != labels[t]
        own = result[..., :3][t][divided].astype(int) - result[..., :3][s][divided]
        steps.append(np.abs(own - (truth[t][divided].astype(int) - truth[s][divided])).ravel())
    return float(np.concatenate(steps).mean())


def programs(files: list[str], processes: int) -> dict[str, list[str]]:
    ours = [sys.executable, "-m", "toposeam", "stitch", *files, "--force", "--quiet", "-j", str(processes)]
    ours += ["--max-megapixels", "4000"]
    both = ["--match-tones", "--blend", "multiband"]
    shading = ["--match-shading", "--blend", "multiband"]
    plain = ["--compression", "none", "-o", "out.tif"]
    found = {
        "toposeam, hard cut": [*ours, *plain],
        "toposeam, tones + multiband": [*ours, *both, *plain],
        "toposeam, shading + multiband": [*ours, *shading, *plain],
    }
    if shutil.which("enblend"):
        found["enblend"] = ["enblend", "--compression=NONE", "-o", "out.tif", *files]
    if shutil.which("multiblend"):
        found["multiblend"] = ["multiblend", "--compression=none", "-o", "out.tif", *files]
    return found


def mosaic(
    columns: int, rows: int, width: int, height: int, only: str, keep: Path | None, processes: int = 1
) -> None:
    with tempfile.TemporaryDirectory(prefix="mosaic-") as name:
        folder = keep or Path(name)
        folder.mkdir(exist_ok=True)
        truth, still = None, None
        if columns * rows > SMALL_WORK:
            total, places = make_large(folder, columns, rows, width, height, 7)
        else:
            truth, still, places = make_frames(folder, columns, rows, width, height, 7)
            total = truth.shape[:2]
        files = [f"frame{index:02d}.tif" for index in range(len(places))]
        print(f"{len(files)} frames of {width} × {height} px, {total[1]} × {total[0]} px in all")
        print(f"{'':<30}{'s':>8}{'clock, s':>10}{'peak MB':>10}{'share MB':>10}", end="")
        print(f"{'s / MP':>8}{'error':>8}{'step':>8}")
        megapixels = total[0] * total[1] / 1e6
        found: dict[str, Measured] = {}
        for program, command in programs(files, processes).items():
            if not program.startswith(only):
                continue
            if not found and columns * rows <= SMALL_WORK and program.startswith("toposeam"):
                measured(command, folder)  # not counted: modules that were never imported are compiled
            ran = found[program] = measured(command, folder)
            if ran.code:
                print(f"{program:<30} failed: {ran.said.strip()[-300:]}")
                continue
            line = f"{program:<30}{ran.seconds:>8.2f}{ran.clock:>10.1f}{ran.megabytes:>10.0f}"
            line += f"{ran.together:>10.0f}{ran.seconds / megapixels:>8.3f}"
            if truth is None or still is None:
                print(line, flush=True)
                continue
            pyvips.cache_set_max(0)  # or it would be the first program's file again
            result = pyvips.Image.new_from_file(str(folder / "out.tif")).numpy()
            error = error_of(result, truth, still)
            line += f"{error:>8.2f}"
            if program.startswith("toposeam"):
                from PIL import Image

                Image.MAX_IMAGE_PIXELS = None
                measured([*command, "--labels", "labels.png"], folder)  # again, not measured
                labels = np.asarray(Image.open(folder / "labels.png"))
                line += f"{step_of(result, labels, truth):>8.2f}"
            print(line, flush=True)
            if keep is not None:
                shutil.copy(folder / "out.tif", folder / f"{program.replace(' ', '_').replace(',', '')}.tif")
        for ours in ("toposeam, hard cut", "toposeam, tones + multiband"):
            for peer in ("enblend", "multiblend"):
                if ours in found and peer in found:
                    time = found[ours].seconds / found[peer].seconds
                    peak = found[ours].megabytes / found[peer].megabytes
                    print(f"{ours} ÷ {peer}: time {time:.2f}, peak {peak:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", choices=["four", "large", "gigapixel"], default="four")
    parser.add_argument("--only", default="", help="programs whose names begin so")
    parser.add_argument("--keep", type=Path, help="leave frames and results in this folder")
    parser.add_argument("-j", "--jobs", type=int, default=1, help="processes of ours")
    options = parser.parse_args()
    shape = {
        "four": (2, 2, 3000, 2000),
        "large": (5, 4, 6000, 4000),
        "gigapixel": (10, 6, 6800, 4500),
    }[options.work]
    mosaic(*shape, options.only, options.keep, options.jobs)


if __name__ == "__main__":
    print(stamp())
    main()
