"""The table by eye of docs/texture.md, and its numbers: ``python benchmarks/texture_table.py table.jpg``.

The twenty samples of texture_samples.py, 192 × 192 px, are grown to 512 × 512 px by TopoSeam with its
defaults and so that they repeat, by G'MIC's ``syntexturize_matchpatch`` (Debian: gmic), and by image quilting
(Efros and Freeman 2001, patches of 40 px, here). All on one thread. The first of three seeds is shown; step
is the median of the three, copy the largest; whole and near are told of all objects of the three textures.

time     processor seconds, and TopoSeam's (open, patch 40) over G'MIC's, program start included
swd8     sliced Wasserstein distance of 8 × 8 patches to the sample's (texture.py); TopoSeam's is the mean of
         the three seeds, and what of it is chance texture_spread.py tells
smooth   whether periods below 8 px hold at most a tenth of the sample's variance
step     99th percentile of the steps between copies over that of the steps inside of them
wrap     mean step across the border of the repeating texture over the 98th percentile of that of inner rows
         or columns, the worse of both (texture.py)
copy     largest connected verbatim copy, in shares of the sample
whole    of the objects off the border, those as large as in the sample, ± 10 % and 3 px (dots, mushrooms)
near     pairs of copies of one object nearer than half the sample's width, and how few there could be were
         objects of one look (dots of one colour, mushrooms) exchanged for each other
broken   pieces of the texture, and of the repeating one, more than a quarter of a period out of step with the
         lattice, where the sample has an order (texture_order.py); of the first those of all three seeds
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
from texture import gmic, gray, swd8, wrap
from texture_order import broken
from texture_samples import SIDE, Sample, samples
from toposeam.texture.periodicity.period import find_order

SIZE, PATCH, OVERLAP, SEEDS = 512, 40, 10, (1, 2, 3)
#: Of a smooth sample the periods below so many px hold at most this share of the variance.
FINE, SHARE = 8, 0.1
#: Objects look alike whose mean colours differ by less in each channel.
ALIKE = 20


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


def step(made: ts.texture.Synthesis) -> float:
    image, inner, across = gray(made.image), [], []
    for axis in (0, 1):
        steps, seam = np.abs(np.diff(image, axis=axis)), np.diff(made.labels, axis=axis) != 0
        inner.append(steps[~seam])
        across.append(steps[seam])
    return float(np.percentile(np.concatenate(across), 99) / np.percentile(np.concatenate(inner), 99))


def largest_copy(made: ts.texture.Synthesis, pixels: int) -> float:
    index = made.source[..., 0].astype(np.int64) * 100_000 + made.source[..., 1]
    number = np.arange(index.size).reshape(index.shape)
    beside, below = np.diff(index, axis=1) == 1, np.diff(index, axis=0) == 100_000
    first = np.concatenate([number[:, :-1][beside], number[:-1][below]])
    second = np.concatenate([number[:, 1:][beside], number[1:][below]])
    graph = sparse.coo_matrix((np.ones(len(first), bool), (first, second)), (index.size, index.size))
    return float(np.bincount(connected_components(graph, directed=False)[1]).max() / pixels)


def whole_objects(made: ts.texture.Synthesis, sample: Sample) -> tuple[int, int]:
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


def near_pairs(made: ts.texture.Synthesis, sample: Sample) -> tuple[int, int]:
    """Pairs of copies of one object near each other, and how few there could be."""
    shown = sample.objects[made.source[..., 0], made.source[..., 1]]
    objects, middles = [], []
    for number in range(1, int(sample.objects.max()) + 1):
        pieces, found = ndimage.label(shown == number)
        numbers = np.arange(1, found + 1)
        area = np.bincount(pieces.ravel(), minlength=found + 1)[1:]
        kept = numbers[area > 0.5 * np.count_nonzero(sample.objects == number)]
        middles += ndimage.center_of_mass(pieces > 0, pieces, kept)
        objects += [number] * len(kept)
    at, chosen = np.array(middles).reshape(-1, 2), np.array(objects)
    near = np.hypot(*(at[:, np.newaxis] - at[np.newaxis]).transpose(2, 0, 1)) < SIDE / 2
    np.fill_diagonal(near, val=False)
    looks = np.array(
        [sample.image[sample.objects == k + 1].mean(axis=0) for k in range(sample.objects.max())]
    )
    alike = [np.flatnonzero(np.abs(looks - look).max(axis=1) < ALIKE) + 1 for look in looks]
    return conflicts(near, chosen), exchanged(near, chosen, alike)


def conflicts(near: np.ndarray, chosen: np.ndarray) -> int:
    return int((near & (chosen[:, np.newaxis] == chosen)).sum()) // 2


def exchanged(near: np.ndarray, chosen: np.ndarray, alike: list[np.ndarray]) -> int:
    """The fewest conflicts that are found when each object may be any that looks alike: again and again one
    in conflict becomes what is in conflict with fewest (min-conflicts).
    """
    rng, chosen = np.random.default_rng(0), chosen.copy()
    fewest = conflicts(near, chosen)
    for _ in range(5000):
        bad = np.flatnonzero((near & (chosen[:, np.newaxis] == chosen)).any(axis=1))
        if not len(bad):
            return 0
        one = int(rng.choice(bad))
        kinds = alike[chosen[one] - 1]
        count = np.array([np.count_nonzero(near[one] & (chosen == kind)) for kind in kinds])
        chosen[one] = rng.choice(kinds[count == count.min()])
        fewest = min(fewest, conflicts(near, chosen))
    return fewest


def is_smooth(image: np.ndarray) -> bool:
    values = gray(image)
    window = np.outer(*[np.hanning(length) for length in values.shape])
    power = np.square(np.abs(np.fft.fft2((values - values.mean()) * window)))
    power[0, 0] = 0
    fine = np.hypot(*np.meshgrid(*map(np.fft.fftfreq, values.shape), indexing="ij")) > 1 / FINE
    return bool(power[fine].sum() <= SHARE * power.sum())


def timed(image: np.ndarray, **options: object) -> tuple[ts.texture.Synthesis, float]:
    started = time.process_time()
    made = ts.synthesize(image, SIZE, **options)
    return made, time.process_time() - started


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", type=Path)
    parser.add_argument("--only", default="", help="names of samples, with commas between")
    parser.add_argument(
        "--parts", type=Path, help="folder of the pictures; those of samples left out are taken from it"
    )
    options = parser.parse_args()
    heads = zip(
        (
            "time",
            "÷ gmic",
            "swd8",
            "gmic",
            "quilt",
            "smooth",
            "step",
            "wrap",
            "copy",
            "whole",
            "near",
            "broken",
        ),
        (6, 8, 7, 7, 7, 8, 6, 6, 6, 9, 8, 8),
        strict=True,
    )
    print(f"{'':14}" + "".join(f"{head:>{width}}" for head, width in heads))
    rows, ratios = [], []
    for sample in samples():
        if options.only and sample.name not in options.only.split(","):
            if options.parts and (images := _kept(options.parts, sample.name)):
                rows.append((sample, images))
            continue
        made, seconds = timed(sample.image, seed=1)
        grown = [made, *(ts.synthesize(sample.image, SIZE, seed=seed) for seed in SEEDS[1:])]
        _, open_40 = timed(sample.image, seed=1, patch=40)
        repeats, _ = timed(sample.image, seed=1, tileable="both")
        peer = gmic(sample.image, 1)
        quilt = quilted(sample.image, 1)
        exemplar = gray(sample.image)
        cells = [
            float(np.mean([swd8(exemplar, gray(one.image)) for one in grown])),
            swd8(exemplar, gray(quilt)),
        ]
        theirs = swd8(exemplar, gray(peer.image)) if peer else float("nan")
        ratio = open_40 / peer.seconds if peer else float("nan")
        ratios.append(ratio)
        objects = ("–", "–")
        if sample.objects.any():
            whole, total = np.sum([whole_objects(one, sample) for one in grown], axis=0)
            objects = (
                f"{whole}/{total}",
                "{}/{}".format(*np.sum([near_pairs(one, sample) for one in grown], axis=0)),
            )
        height, width = sample.image.shape[:2]
        values = (sample.image / np.float32(255)).reshape(height, width, -1)
        order = find_order(values, np.ones((height, width), bool))
        lines = "–"
        if order is not None:
            open_ones = sum(broken(one.image, sample.image, order, repeats=False) for one in grown)
            lines = f"{open_ones}/{broken(repeats.image, sample.image, order)}"
        middle = float(np.median([step(one) for one in grown]))
        print(
            f"{sample.name:14}{seconds:6.2f}{ratio:8.2f}{cells[0]:7.2f}{theirs:7.2f}{cells[1]:7.2f}"
            f"{'yes' if is_smooth(sample.image) else '–':>8}{middle:6.2f}{wrap(gray(repeats.image)):6.2f}"
            f"{max(largest_copy(one, exemplar.size) for one in grown):6.2f}{objects[0]:>9}{objects[1]:>8}"
            f"{lines:>8}",
            flush=True,
        )
        shifted = np.roll(repeats.image, (SIZE // 2, SIZE // 2), (0, 1))
        rows.append((sample, [made.image, shifted, *([peer.image] if peer else []), quilt]))
        if options.parts:
            options.parts.mkdir(parents=True, exist_ok=True)
            for number, image in enumerate(rows[-1][1]):
                part = Image.fromarray(np.ascontiguousarray(image))
                part.save(options.parts / f"{sample.name} {number}.png")
    print(f"median time ÷ gmic: {np.median(ratios):.2f}")
    table(rows).save(options.table, quality=82, optimize=True)


def _kept(folder: Path, name: str) -> list[np.ndarray]:
    return [np.asarray(Image.open(path)) for path in sorted(folder.glob(f"{name} [0-9].png"))]


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
