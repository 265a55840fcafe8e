"""Alignments of pairs that the seam chose, and meshes: cost, bent lines, uprights, leaning, processor time.

    python benchmarks/alignments.py PAIRS                    # a table, a line for each pair that changes
    python benchmarks/alignments.py PAIRS --only NAME …      # some of them
    python benchmarks/alignments.py PAIRS --pictures FOLDER  # both pictures of each pair, for eyes

PAIRS is a folder of NAME_l.EXT and NAME_r.EXT. *Before* is the alignment that residuals prefer, *after* what
``toposeam.find_places`` gives; both are joined as photographs are (``match_shading``, ``multiband``).

- cost: of the seam after ÷ before. Where nothing changes, the pair is only counted.
- bend: lines of 100 px and more, as OpenCV's LSD finds them in the pictures, which is another detector than
  the one that the mesh holds lines by: the largest distance, px, of a point from the straight line between
  the ends on the canvas, more than without the mesh; the 95th percentile and the largest.
- upright: the largest turn, degrees, of such a line that stood upright (width below a quarter of height).
- lean: the turn of the axes, degrees, farther than 40 px outside the other picture, at the 95th percentile.
- area: the least area ÷ that without the mesh; 0 or less is a fold.
- time: processor time of placing and joining, after ÷ before. Other work on the machine makes it worthless.

Needs opencv-python-headless.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

import toposeam as ts
from stamp import stamp
from toposeam.layers.canvas.transforms import MeshTransform
from toposeam.layers.mesh.bending import folding
from toposeam.layers.registration import find_places as door

HEAD = ("cost", "bend 95 %", "most", "upright", "lean", "area", "time")


def joined(pictures: list[ts.Layer], chooses: bool) -> tuple[ts.layers.Placement, object, float]:
    """Place and join a pair, with or without the choice by the seam; also the processor time, s."""
    kept, start = door._by_the_seam, time.process_time()
    try:
        if not chooses:
            door._by_the_seam = lambda matcher, options, placement: placement
        placement = ts.find_places(pictures)
    finally:
        door._by_the_seam = kept
    composed = ts.stitch(placement.layers, match_shading=True, blend="multiband", wrap=placement.wrap)
    image = composed.image
    return placement, (composed.cost, image), time.process_time() - start


def long_lines(picture: ts.Layer, least: float = 100.0) -> np.ndarray:
    """(K, 4) ends of the lines that LSD finds."""
    gray = cv2.cvtColor(np.asarray(picture.image), cv2.COLOR_RGB2GRAY)
    found = cv2.createLineSegmentDetector().detect(gray)[0]
    found = np.zeros((0, 4)) if found is None else found.reshape(-1, 4).astype(float)
    return found[np.hypot(found[:, 2] - found[:, 0], found[:, 3] - found[:, 1]) >= least]


def off_chord(points: np.ndarray) -> float:
    """The largest distance of (N, 2) points from the straight line between the first and the last."""
    step = points[-1] - points[0]
    across = np.array([-step[1], step[0]]) / max(float(np.hypot(*step)), 1e-9)
    return float(np.abs((points - points[0]) @ across).max())


def turned(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Degrees between (N, 2) directions."""
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(np.degrees(np.arctan2(cross, (before * after).sum(axis=1))))


def figures_of(pictures: list[ts.Layer], placement: ts.layers.Placement) -> tuple[float, ...]:
    """Bend at 95 % and most, upright, lean and area of the meshes of a placement."""
    meshes = [one for one in placement.transforms if isinstance(one, MeshTransform)]
    if not meshes:
        return 0.0, 0.0, 0.0, 0.0, 1.0
    bends, stands, leans = [0.0], [0.0], [np.zeros(1)]
    for number, (picture, mesh) in enumerate(zip(pictures, meshes, strict=True)):
        for line in long_lines(picture):
            points = line[:2] + np.linspace(0, 1, 40)[:, None] * (line[2:] - line[:2])
            plain, bent = mesh.base.to_canvas(points), mesh.to_canvas(points)
            bends.append(max(0.0, off_chord(bent) - off_chord(plain)))
            across, down = np.abs(plain[-1] - plain[0])
            if across < 0.25 * down:
                stands.append(float(turned((plain[-1] - plain[0])[None], (bent[-1] - bent[0])[None])[0]))
        width, height = mesh.size
        x, y = np.meshgrid(np.arange(0, width - 1, 8.0), np.arange(0, height - 1, 8.0))
        grid = np.stack([x.ravel(), y.ravel()], axis=1)
        other = meshes[1 - number]
        there = other.base.to_picture(mesh.base.to_canvas(grid))
        beyond = np.maximum(0, np.maximum(-there, there - (np.array(other.size) - 1.0)))
        outside = grid[np.hypot(*beyond.T) > 40]
        for step in ((1, 0), (0, 1)):
            sides = [one.to_canvas(outside + step) - one.to_canvas(outside) for one in (mesh.base, mesh)]
            leans.append(turned(*sides))
    lean = float(np.percentile(np.concatenate(leans), 95))
    return float(np.percentile(bends, 95)), max(bends), max(stands), lean, folding(meshes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--only", nargs="+", default=())
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args()
    print(stamp())
    print(f"{'pair':<28}{'model':>20}" + "".join(f"{name:>10}" for name in HEAD))
    costs, times, same = [], [], 0
    for left in sorted(given.pairs.glob("*_l.*")):
        name = left.stem[:-2]
        right = next(given.pairs.glob(f"{name}_r.*"), None)
        if right is None or (given.only and name not in given.only):
            continue
        pictures = [
            ts.Layer(np.asarray(Image.open(one).convert("RGB")), name=one.name) for one in (left, right)
        ]
        before, (plain, old), first = joined(pictures, chooses=False)
        after, (cost, new), second = joined(pictures, chooses=True)
        times.append(second / first)
        if plain == cost:
            same += 1
            continue
        costs.append(cost / plain)
        kind = before.model if before.model == after.model else f"{before.model} > {after.model}"
        own = figures_of(pictures, after)
        figures = (cost / plain, *own, second / first)
        print(f"{name:<28}{kind:>20}" + "".join(f"{figure:>10.2f}" for figure in figures), flush=True)
        if given.pictures is not None:
            given.pictures.mkdir(exist_ok=True, parents=True)
            for kind, image in (("before", old), ("after", new)):
                Image.fromarray(np.asarray(image)).save(given.pictures / f"{name}_{kind}.png")
    print(
        f"{len(costs)} pairs changed, cost x {np.median(costs or [1]):.2f} in the median, "
        f"{max(costs, default=1):.2f} at most; {same} stay as they are; time x {np.median(times):.2f}"
    )


if __name__ == "__main__":
    main()
