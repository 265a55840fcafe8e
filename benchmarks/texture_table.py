"""The table by eye of docs/texture.md, and its numbers: ``python benchmarks/texture_table.py table.jpg``.

The twenty samples of texture_samples.py, 192 × 192 px, are grown to 512 × 512 px by TopoSeam with its
defaults and so that they repeat, by G'MIC's ``syntexturize_matchpatch`` (Debian: gmic), and by image quilting
(Efros and Freeman 2001, patches of 40 px, here). All on one thread.

time     processor seconds, and TopoSeam's (open, patch 40) over G'MIC's, program start included
swd8     sliced Wasserstein distance of 8 × 8 patches to the sample's (texture.py)
step     99th percentile of the steps between copies over that of the steps inside of them
copy     largest connected verbatim copy, in shares of the sample
whole    of the objects off the border, those as large as in the sample, ± 10 % and 3 px (dots, mushrooms)
near     pairs of copies of one object nearer than half the sample's width
broken   pieces of the repeating texture more than a quarter of a period out of step with the lattice that
         closes on it, where the sample has an order (text: its lines)
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components

import toposeam as ts
from stamp import stamp
from texture import gmic, gray, swd8
from texture_samples import SIDE, Sample, samples
from toposeam.texture.order import Order, find_order

SIZE, PATCH, OVERLAP = 512, 40, 10


def quilted(image: np.ndarray, seed: int) -> np.ndarray:
    """Image quilting: raster order, places within 10 % of the best, cuts by dynamic programming."""
    rng, step = np.random.default_rng(seed), PATCH - OVERLAP
    source = image.astype(np.float32).reshape(*image.shape[:2], -1)
    count = -(-(SIZE - OVERLAP) // step)
    side = count * step + OVERLAP
    made = np.zeros((side, side, source.shape[2]), np.float32)
    room = source.shape[0] - PATCH, source.shape[1] - PATCH
    for top in range(0, count * step, step):
        for left in range(0, count * step, step):
            known = np.zeros((PATCH, PATCH), np.float32)
            known[:OVERLAP] = top > 0
            known[:, :OVERLAP] = np.maximum(known[:, :OVERLAP], left > 0)
            here = made[top : top + PATCH, left : left + PATCH]
            if not known.any():
                row, column = (int(rng.integers(length + 1)) for length in room)
            else:
                error = sum(
                    cv2.matchTemplate(
                        np.ascontiguousarray(source[..., c]), here[..., c].copy(), cv2.TM_SQDIFF, mask=known
                    )
                    for c in range(source.shape[2])
                )
                error = np.maximum(error, 0)
                rows, columns = np.nonzero(error <= 1.1 * error.min() + 1)
                pick = int(rng.integers(len(rows)))
                row, column = int(rows[pick]), int(columns[pick])
            patch = source[row : row + PATCH, column : column + PATCH]
            takes = np.ones((PATCH, PATCH), bool)
            if left > 0:
                cut = boundary(np.square(here[:, :OVERLAP] - patch[:, :OVERLAP]).sum(axis=2))
                takes[:, :OVERLAP] &= np.arange(OVERLAP) >= cut[:, np.newaxis]
            if top > 0:
                cut = boundary(np.square(here[:OVERLAP] - patch[:OVERLAP]).sum(axis=2).T)
                takes[:OVERLAP] &= (np.arange(OVERLAP) >= cut[:, np.newaxis]).T
            here[takes] = patch[takes]
    return made[:SIZE, :SIZE].reshape(SIZE, SIZE, *image.shape[2:]).astype(image.dtype)


def boundary(cost: np.ndarray) -> np.ndarray:
    """Per row the column of the cheapest path from top to bottom."""
    total = cost.copy()
    for row in range(1, len(total)):
        before = np.pad(total[row - 1], 1, constant_values=np.inf)
        total[row] += np.minimum(np.minimum(before[:-2], before[1:-1]), before[2:])
    path = [int(total[-1].argmin())]
    for row in range(len(total) - 2, -1, -1):
        low = max(path[-1] - 1, 0)
        path.append(low + int(total[row, low : path[-1] + 2].argmin()))
    return np.array(path[::-1])


def step(made: ts.Synthesis) -> float:
    image, inner, across = gray(made.image), [], []
    for axis in (0, 1):
        steps, seam = np.abs(np.diff(image, axis=axis)), np.diff(made.labels, axis=axis) != 0
        inner.append(steps[~seam])
        across.append(steps[seam])
    return float(np.percentile(np.concatenate(across), 99) / np.percentile(np.concatenate(inner), 99))


def largest_copy(made: ts.Synthesis, pixels: int) -> float:
    index = made.source[..., 0].astype(np.int64) * 100_000 + made.source[..., 1]
    number = np.arange(index.size).reshape(index.shape)
    beside, below = np.diff(index, axis=1) == 1, np.diff(index, axis=0) == 100_000
    first = np.concatenate([number[:, :-1][beside], number[:-1][below]])
    second = np.concatenate([number[:, 1:][beside], number[1:][below]])
    graph = sparse.coo_matrix((np.ones(len(first), bool), (first, second)), (index.size, index.size))
    return float(np.bincount(connected_components(graph, directed=False)[1]).max() / pixels)


def whole_objects(made: ts.Synthesis, sample: Sample) -> tuple[int, int]:
    """How many objects off the border are as large as the sample's, and how many there are."""
    given = ndimage.find_objects(sample.objects)
    area = float(np.median([np.count_nonzero(sample.objects == k + 1) for k in range(len(given))]))
    extent = np.median([[side.stop - side.start for side in box] for box in given], axis=0)
    pieces, _ = ndimage.label(sample.objects[made.source[..., 0], made.source[..., 1]] > 0)
    whole = total = 0
    for number, box in enumerate(ndimage.find_objects(pieces), start=1):
        size = np.count_nonzero(pieces[box] == number)
        if size < 0.05 * area or any(side.start == 0 or side.stop == SIZE for side in box):
            continue
        total += 1
        spans = np.array([side.stop - side.start for side in box])
        whole += abs(size / area - 1) <= 0.1 and bool((np.abs(spans - extent) <= 3).all())
    return int(whole), total


def near_pairs(made: ts.Synthesis, sample: Sample) -> int:
    shown, count = sample.objects[made.source[..., 0], made.source[..., 1]], 0
    for number in range(1, int(sample.objects.max()) + 1):
        pieces, found = ndimage.label(shown == number)
        numbers = np.arange(1, found + 1)
        area = np.bincount(pieces.ravel(), minlength=found + 1)[1:]
        kept = numbers[area > 0.5 * np.count_nonzero(sample.objects == number)]
        middles = np.array(ndimage.center_of_mass(pieces > 0, pieces, kept)).reshape(-1, 2)
        apart = np.hypot(*(middles[:, np.newaxis] - middles[np.newaxis]).transpose(2, 0, 1))
        count += int((np.triu(apart, 1) > 0)[np.triu(apart, 1) < SIDE / 2].sum())
    return count


def broken(image: np.ndarray, order: Order) -> int:
    """Pieces of a tile that are out of step: where the wave of a reciprocal vector, seen through a window of
    a period, is turned by more than a quarter.
    """
    values, size = gray(image), np.array(image.shape[:2])
    found = np.zeros(values.shape, bool)
    y, x = np.mgrid[: size[0], : size[1]]
    for cycles in order.reciprocal:
        period = 1 / np.linalg.norm(cycles)
        closed = np.rint(cycles * size) / size
        wave = values - ndimage.gaussian_filter(values, period, mode="wrap")
        wave = wave * np.exp(-2j * np.pi * (closed[0] * y + closed[1] * x))
        local = ndimage.gaussian_filter(wave, period, mode="wrap")
        found |= (local * np.exp(-1j * np.angle(local.sum()))).real <= 0
    return int(ndimage.label(found)[1])


def timed(image: np.ndarray, **options: object) -> tuple[ts.Synthesis, float]:
    started = time.process_time()
    made = ts.synthesize(image, SIZE, **options)
    return made, time.process_time() - started


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", type=Path)
    parser.add_argument("--only", default="", help="names of samples, with commas between")
    options = parser.parse_args()
    heads = zip(
        ("time", "÷ gmic", "swd8", "gmic", "quilt", "step", "copy", "whole", "near", "broken"),
        (6, 8, 7, 7, 7, 6, 6, 9, 6, 8),
        strict=True,
    )
    print(f"{'':14}" + "".join(f"{head:>{width}}" for head, width in heads))
    rows, ratios = [], []
    for sample in samples():
        if options.only and sample.name not in options.only.split(","):
            continue
        made, seconds = timed(sample.image, seed=1)
        _, open_40 = timed(sample.image, seed=1, patch=40)
        repeats, _ = timed(sample.image, seed=1, tileable="both")
        peer = gmic(sample.image, 1)
        quilt = quilted(sample.image, 1)
        exemplar = gray(sample.image)
        cells = [swd8(exemplar, gray(one)) for one in (made.image, quilt)]
        theirs = swd8(exemplar, gray(peer.image)) if peer else float("nan")
        ratio = open_40 / peer.seconds if peer else float("nan")
        ratios.append(ratio)
        objects = ("–", "–")
        if sample.objects.any():
            whole, total = whole_objects(made, sample)
            objects = f"{whole}/{total}", str(near_pairs(made, sample))
        height, width = sample.image.shape[:2]
        values = (sample.image / np.float32(255)).reshape(height, width, -1)
        order = find_order(values, np.ones((height, width), bool))
        lines = "–" if order is None else str(broken(repeats.image, order))
        print(
            f"{sample.name:14}{seconds:6.2f}{ratio:8.2f}{cells[0]:7.2f}{theirs:7.2f}{cells[1]:7.2f}"
            f"{step(made):6.2f}{largest_copy(made, exemplar.size):6.2f}{objects[0]:>9}{objects[1]:>6}"
            f"{lines:>8}",
            flush=True,
        )
        shifted = np.roll(repeats.image, (SIZE // 2, SIZE // 2), (0, 1))
        rows.append((sample, [made.image, shifted, *([peer.image] if peer else []), quilt]))
    print(f"median time ÷ gmic: {np.median(ratios):.2f}")
    table(rows).save(options.table, quality=82, optimize=True)


def table(rows: list[tuple[Sample, list[np.ndarray]]], side: int = 208, gap: int = 5) -> Image.Image:
    """Two blocks of rows: the sample at the same scale, TopoSeam open and tileable (its border in the
    middle), G'MIC, quilting.
    """
    small = round(side * SIDE / SIZE)
    block = small + gap + (side + gap) * len(rows[0][1]) + 3 * gap
    lines = -(-len(rows) // 2)
    sheet = Image.new("RGB", (2 * block, lines * (side + gap)), "white")
    for number, (sample, images) in enumerate(rows):
        x, y = number // lines * block, number % lines * (side + gap)
        for image, length in ((sample.image, small), *((one, side) for one in images)):
            picture = Image.fromarray(np.ascontiguousarray(image)).convert("RGB")
            sheet.paste(picture.resize((length, length), Image.Resampling.LANCZOS), (x, y))
            x += length + gap
        ImageDraw.Draw(sheet).text((number // lines * block, y + small + 4), sample.name, fill="black")
    return sheet


if __name__ == "__main__":
    print(stamp())
    main()
