"""What moved objects leave behind in wide blends: ours with a seam that knows how far the blend reaches, and
with one that does not; enblend and Multiblend.

    python benchmarks/moved.py                     30 scenes, about five minutes
    python benchmarks/moved.py --sets 6 --sheet moved.png

A scene is a plain wall, lit from one side; two pictures of it overlap by 40 %. In either stand discs and
boxes that the other has somewhere else or not at all, half of them in the overlap. Both are exposed alike,
with a little noise. The peers: ``apt-get install enblend``; Multiblend (https://horman.net/multiblend/) where
it is on the PATH.

At the outline of every object, where both pictures have pixels, a good result has its whole step or none.
*Step* is what lies between: the smaller of the step, over three pixels, and of what is missing of a whole
one. *Bleeding*: within 96 px of objects, away from outlines, how far the result, smoothed over 5 px, is from
the nearer of wall and object. Both are the mean of the worst twentieth, in 8-bit levels. *Cut* is the share
of objects of which between 10 and 90 % show.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

import toposeam as ts
from measured import measured
from mosaic import write_tiff
from stamp import stamp

WIDTH, HEIGHT, OVERLAP, NOISE = 900, 600, 360, 1.5
OBJECTS = 5  # a picture
#: The blend, and whether the match cost knows of it.
OURS = {
    f"toposeam, {blend}{note}": (blend, far)
    for blend in ("multiband", "soft")
    for note, far in (("", True), (", seam as for a hard cut", False))
}


@dataclass(frozen=True)
class Scene:
    """Two pictures of a wall."""

    wall: np.ndarray
    frames: list[np.ndarray]
    places: list[tuple[int, int]]
    #: Where each object stands on the canvas, its colour, and in which picture.
    objects: list[tuple[np.ndarray, np.ndarray, int]]


def make_scene(index: int, seed: int) -> Scene:
    rng = np.random.default_rng([seed, index])
    columns = 2 * WIDTH - OVERLAP
    y, x = np.mgrid[:HEIGHT, :columns].astype(np.float32)
    slope = rng.uniform(-40, 40, 2)
    wall = rng.uniform(70, 190, 3) + (slope[0] * x / columns + slope[1] * y / HEIGHT)[..., None]
    places = [(0, 0), (WIDTH - OVERLAP, 0)]
    frames, objects = [], []
    for number, (left, _) in enumerate(places):
        frame = wall[:, left : left + WIDTH].copy()
        for k in range(OBJECTS):
            size = rng.uniform(12, 60, 2)
            low = WIDTH - OVERLAP if k % 2 == 0 else left
            high = WIDTH if k % 2 == 0 else left + WIDTH
            cx, cy = rng.uniform(low, high), rng.uniform(0, HEIGHT)
            inside = np.abs((x - cx) / size[0]) ** 2 + np.abs((y - cy) / size[1]) ** 2 < 1
            if rng.random() < 0.5:
                inside = (np.abs(x - cx) < size[0]) & (np.abs(y - cy) < size[1])
            inside[:, : left + 2] = inside[:, left + WIDTH - 2 :] = False
            colour = np.where(rng.random() < 0.5, rng.uniform(5, 60, 3), rng.uniform(200, 250, 3))
            if any((ndimage.binary_dilation(inside, iterations=6) & other).any() for other, _, _ in objects):
                continue
            frame[inside[:, left : left + WIDTH]] = colour
            objects.append((inside, colour, number))
        frame += rng.normal(0, NOISE, frame.shape)
        frames.append(np.clip(np.rint(frame), 0, 255).astype(np.uint8))
    return Scene(wall, frames, places, objects)


def ours(scene: Scene, blend: str, far: bool) -> np.ndarray:
    layers = [
        ts.Layer(frame, at=at, name=str(k))
        for k, (frame, at) in enumerate(zip(scene.frames, scene.places, strict=True))
    ]
    return ts.stitch(layers, blend=blend, cost=None if far else ts.seam.MatchCost(reach=0)).image


def theirs(command: list[str], scene: Scene, folder: Path) -> np.ndarray:
    files = []
    for k, (frame, at) in enumerate(zip(scene.frames, scene.places, strict=True)):
        rgba = np.dstack([frame, np.full(frame.shape[:2], 255, np.uint8)])
        write_tiff(folder / f"frame{k}.tif", rgba, at)
        files.append(f"frame{k}.tif")
    (folder / "out.tif").unlink(missing_ok=True)
    ran = measured([*command, *files], folder)
    if ran.code:
        raise SystemExit(f"{command[0]} failed: {ran.said}")
    return np.asarray(Image.open(folder / "out.tif"))[..., :3]


def errors(result: np.ndarray, scene: Scene) -> tuple[float, float, float]:
    """Step, bleeding and the share of objects that are cut."""
    result = result.astype(np.float32)
    both = np.zeros(scene.wall.shape[:2], bool)
    both[:, WIDTH - OVERLAP + 3 : WIDTH - 3] = True
    smooth = ndimage.uniform_filter(result, (5, 5, 1))
    off = np.abs(smooth - scene.wall).mean(axis=2)
    steps, near = [], np.zeros(both.shape, bool)
    edges = np.zeros(both.shape, bool)
    cut = []
    for inside, colour, _ in scene.objects:
        for axis in (0, 1):
            # The step from one pixel before an outline to one pixel after it.
            first, second, before, after = (
                (slice(None),) * axis + (part,)
                for part in (slice(1, -2), slice(2, -1), slice(0, -3), slice(3, None))
            )
            outline = (inside[first] != inside[second]) & both[first] & both[second]
            sign = np.where(inside[second][outline], 1, -1)[:, None]
            own = (result[after][outline] - result[before][outline]) * sign
            whole = (colour - scene.wall)[first][outline]
            share = (own * whole).sum(axis=1) / np.maximum((whole * whole).sum(axis=1), 1)
            steps.append(np.minimum(np.abs(share), np.abs(1 - share)) * np.abs(whole).mean(axis=1))
        edges |= ndimage.binary_dilation(inside, iterations=4) & ~ndimage.binary_erosion(inside, iterations=4)
        if (inside & both).any():
            near |= ndimage.distance_transform_edt(~inside) < 96
        inner = ndimage.binary_erosion(inside, iterations=4)
        off = np.where(inner, np.minimum(off, np.abs(smooth - colour).mean(axis=2)), off)
        core = inner & both
        if core.sum() > 50:
            whole = (colour - scene.wall)[core]
            share = ((result - scene.wall)[core] * whole).sum(axis=1) / (whole * whole).sum(axis=1)
            cut.append(0.1 < (share > 0.5).mean() < 0.9)
    jumps = np.sort(np.concatenate(steps))
    bleeding = np.sort(off[near & both & ~edges])
    worst = [
        float(values[-max(1, len(values) // 20) :].mean()) for values in (jumps, bleeding) if len(values)
    ]
    return worst[0], worst[1], float(np.mean(cut)) if cut else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=30)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--sheet", type=Path, help="write the results of up to six scenes side by side")
    options = parser.parse_args()
    peers = {
        name: command
        for name, command in {
            "enblend": ["enblend", "--compression=NONE", "-o", "out.tif"],
            "multiblend": ["multiblend", "--compression=none", "-o", "out.tif"],
        }.items()
        if shutil.which(name)
    }
    found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in (*OURS, *peers)}
    rows = []
    with tempfile.TemporaryDirectory(prefix="moved-") as folder:
        for index in range(options.sets):
            scene = make_scene(index, options.seed)
            row = []
            for name in found:
                own = name in OURS
                image = ours(scene, *OURS[name]) if own else theirs(peers[name], scene, Path(folder))
                found[name].append(errors(image, scene))
                row.append(image)
            rows.append(row)
            if sys.stderr.isatty():
                print(f"\r{index + 1}", end="", file=sys.stderr, flush=True)
    print(f"{options.sets} scenes: medians, and the worst tenth\n")
    print(f"{'':<44}{'step':>14}{'bleeding':>16}{'cut':>8}")
    for name, values in found.items():
        table = np.array(values)
        mid, high = np.median(table, axis=0), np.quantile(table, 0.9, axis=0)
        print(
            f"{name:<44}{mid[0]:>7.2f}{high[0]:>7.2f}{mid[1]:>9.2f}{high[1]:>7.2f}{table[:, 2].mean():>8.1%}"
        )
    if options.sheet is not None:
        lines = [
            np.concatenate([image[:, WIDTH - OVERLAP : WIDTH] for image in row], axis=1) for row in rows[:6]
        ]
        Image.fromarray(np.concatenate(lines).astype(np.uint8)).save(options.sheet)


if __name__ == "__main__":
    print(stamp())
    main()
