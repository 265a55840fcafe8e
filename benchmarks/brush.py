"""How fast seams follow a brush, and how good they are: processor time and cost, by number of pictures.

    python benchmarks/brush.py FOLDER_OR_PICTURE... [--megapixels 2] [--strokes 20] [--scipy]

Each folder is one panorama; pictures that are named one by one make one together. They are placed, scaled to
a preview of that size, and joined. Random strokes then start beside a seam and run over it: 60 to 180 px
long, 14 px in radius at 2 megapixels. Columns:

pictures     those that were placed
kept         s to compute the costs that are kept, once
window       ms from a stroke to the new seam in its window (apply_strokes and recut), median and largest
whole        ms of the search of everything from coarse to fine, when the stroke has ended, likewise
÷ fresh      cost after it ÷ that of a search from nothing with the same stroke, median and largest
seconds      of that search from nothing, median, for comparison

``--scipy`` computes flows by SciPy, as where no kernels were built.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

import toposeam as ts
from stamp import stamp
from toposeam import _kernels
from toposeam.layers.search import Problem, minimise, search_options


def read(file: Path, pixels: float = 1.5e6) -> np.ndarray:
    """A picture of at most so many pixels."""
    picture = ImageOps.exif_transpose(Image.open(file)).convert("RGB")
    factor = min(1.0, (pixels / (picture.width * picture.height)) ** 0.5)
    size = round(picture.width * factor), round(picture.height * factor)
    return np.asarray(picture.resize(size, Image.Resampling.LANCZOS))


def preview(files: list[Path], megapixels: float) -> list[ts.Layer]:
    """Layers of a preview of that size, with their tones matched."""
    layers = ts.find_places([ts.Layer(read(file), name=file.name) for file in files]).layers
    height, width = ts.layers.common_canvas(layers).shape
    factor = (megapixels * 1e6 / (height * width)) ** 0.5
    return list(ts.layers.match_tones([scaled(layer, factor) for layer in layers]))


def scaled(layer: ts.Layer, factor: float) -> ts.Layer:
    """A layer of another size, at the same place on its canvas."""
    picture = Image.fromarray(np.asarray(layer.image))
    size = max(8, round(picture.width * factor)), max(8, round(picture.height * factor))
    opaque = np.full(picture.size[::-1], 255, np.uint8) if layer.alpha is None else np.asarray(layer.alpha)
    alpha = np.asarray(Image.fromarray(opaque).resize(size, Image.Resampling.BILINEAR)) > 250
    return ts.Layer(
        np.asarray(picture.resize(size, Image.Resampling.LANCZOS)),
        alpha=np.where(alpha, np.uint8(255), np.uint8(0)),
        at=(round(layer.at[0] * factor), round(layer.at[1] * factor)),
        name=layer.name,
    )


def drawn(joined: ts.layers.Composition, rng: np.random.Generator, scale: float) -> ts.layers.Stroke:
    """A stroke that begins on one side of a seam and runs to the other."""
    found = list(joined.labelling.interfaces(joined.label_map, joined.canvas.box))
    lengths = np.array([len(x) for _, x, *_ in found], float)
    _, x, y, axis, _ = found[rng.choice(len(found), p=lengths / lengths.sum())]
    at = rng.integers(len(x))
    here = np.array([x[at], y[at]], float)
    layer = int(joined.label_map[int(y[at]), int(x[at])])
    angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(60, 180) * scale
    way = np.array([np.cos(angle), np.sin(angle)])
    way *= np.sign(way[1 - axis]) or 1.0
    offset = np.array(joined.canvas.origin) - joined.layers[layer].at
    points = here + offset + np.linspace(-20 * scale, length, 12)[:, np.newaxis] * way
    return ts.layers.Stroke(points=points, radius=14 * scale, layer=layer)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("photographs", type=Path, nargs="+")
    parser.add_argument("--megapixels", type=float, default=2.0)
    parser.add_argument("--strokes", type=int, default=20)
    parser.add_argument("--scipy", action="store_true")
    asked = parser.parse_args()
    if asked.scipy:
        _kernels.library = None
    print(stamp())
    sets = [sorted(path.iterdir()) for path in asked.photographs if path.is_dir()]
    single = [path for path in asked.photographs if path.is_file()]
    print("| pictures | megapixels | kept | window | whole | ÷ fresh | seconds | MiB |")
    print("|---|---|---|---|---|---|---|---|")
    for files in [*sets, *([single] if single else [])]:
        print(row(files, asked.megapixels, asked.strokes), flush=True)


def row(files: list[Path], megapixels: float, count: int) -> str:
    """Measure one panorama."""
    clock, rng, scale = time.process_time, np.random.default_rng(3), (megapixels / 2) ** 0.5
    joined = ts.stitch(preview(files, megapixels), blend="multiband")
    started = clock()
    labelling = ts.layers.keep_costs(joined.labelling)
    for cost in labelling.costs.values():
        cost.on(labelling.canvas)
    kept = clock() - started
    found = ts.layers.recut(labelling, joined.solution, whole=True)
    times, ratios, fresh = [], [], []
    for _ in range(count):
        stroke = drawn(joined, rng, scale)
        marks = [clock()]
        asked, _ = ts.layers.apply_strokes(labelling, [stroke], joined.canvas)
        window = ts.layers.recut(asked, found)
        marks.append(clock())
        whole = ts.layers.recut(asked, window, whole=True)
        marks.append(clock())
        effort = search_options(None, len(joined.layers))
        problem = Problem.of(asked, "auto", {}, effort)
        other = minimise(problem, range(len(joined.layers)), 10)
        marks.append(clock())
        times.append(1000 * np.diff(marks)[:2])
        fresh.append(marks[-1] - marks[-2])
        costs = [asked.total(one.labels[:, :], asked.canvas) for one in (whole, other)]
        ratios.append(costs[0] / costs[1])
    middle, most = np.median(times, axis=0), np.max(times, axis=0)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"| {len(joined.layers)} | {megapixels:g} | {kept:.2f} | {middle[0]:.0f}, {most[0]:.0f} | "
        f"{middle[1]:.0f}, {most[1]:.0f} | {np.median(ratios):.4f}, {max(ratios):.4f} | "
        f"{np.median(fresh):.2f} | {memory:.0f} |"
    )


if __name__ == "__main__":
    main()
