"""Seams of photographs with parallax against OpenCV's finders and enblend: figures, and a blind comparison.

    python benchmarks/parallax.py PAIRS                      # figures and time, ÷ OpenCV COLOR
    python benchmarks/parallax.py PAIRS --give 8             # the same before and after bending by up to 8 px
    python benchmarks/parallax.py PAIRS --blind SHEETS       # composites under shuffled names, for eyes
    python benchmarks/parallax.py PAIRS --count KEY VOTES …  # what the eyes said

PAIRS is a folder of NAME_l.jpg and NAME_r.jpg. Each pair is brought onto one canvas by one homography (SIFT,
RANSAC, scikit-image), with one gain a channel, half of it on either picture; all finders get the same arrays.
Needs opencv-python-headless (at least 4.8); enblend 4.2 is run where it is installed.

Figures, along the seam in windows of 15 px, 0 where pictures agree: 1 - SSIM, (1 - ZNCC) / 2, and the worst
tenth of the first. They are high in foliage, where nobody sees anything, and low where
smooth ground has a step: eyes decide. VOTES are CSV files of lines ``pair,ranking,notes`` with rankings like
``Q=S>P>R``.
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from skimage import color, feature, measure, transform

import toposeam as ts
from seam_pairs import beside, unlikeness
from stamp import stamp
from toposeam.layers.composite.local_warp import give_way

Pair = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def pairs(folder: Path) -> Iterator[tuple[str, Pair]]:
    """Each pair of a folder on one canvas: name, and a, b, mask_a, mask_b."""
    for left in sorted(folder.glob("*_l.jpg")):
        placed = on_one_canvas(left, left.with_name(left.name.replace("_l.", "_r.")))
        if placed is None:
            print(f"{left.stem[:-2]}: no homography")
        else:
            yield left.stem[:-2], placed


def on_one_canvas(left: Path, right: Path) -> Pair | None:
    """Two photographs brought together by one homography, the left one only moved."""
    pictures = [np.asarray(Image.open(path).convert("RGB")) for path in (left, right)]
    points, descriptors = zip(*map(_features, pictures), strict=True)
    matches = feature.match_descriptors(*descriptors, max_ratio=0.8, cross_check=True)
    on_left, on_right = points[0][matches[:, 0]], points[1][matches[:, 1]]
    model, inliers = measure.ransac(
        (on_right, on_left),
        transform.ProjectiveTransform,
        min_samples=4,
        residual_threshold=4,
        max_trials=4000,
        rng=0,
    )
    if inliers is None or inliers.sum() < 12:
        return None
    height, width = pictures[1].shape[:2]
    corners = model(np.array([[0, 0], [width, 0], [0, height], [width, height]], float))
    low = np.floor(np.minimum(corners.min(axis=0), 0)).astype(int)
    high = np.ceil(np.maximum(corners.max(axis=0), pictures[0].shape[1::-1])).astype(int)
    shape = (high[1] - low[1], high[0] - low[0])
    shift = transform.ProjectiveTransform(np.array([[1, 0, low[0]], [0, 1, low[1]], [0, 0, 1.0]]))
    warps = [shift, transform.ProjectiveTransform(np.linalg.inv(model.params) @ shift.params)]
    warped = [
        transform.warp(one, how, output_shape=shape, order=3)
        for one, how in zip(pictures, warps, strict=True)
    ]
    masks = [
        transform.warp(np.ones(one.shape[:2]), how, output_shape=shape, order=1) > 0.999
        for one, how in zip(pictures, warps, strict=True)
    ]
    telling = masks[0] & masks[1] & (warped[0].max(axis=2) < 0.98) & (warped[1].max(axis=2) < 0.98)
    gain = np.sqrt(warped[1][telling].mean(axis=0) / warped[0][telling].mean(axis=0))
    toned = [warped[0] * gain, warped[1] / gain]
    a, b = (np.where(mask[..., None], one, 0).clip(0, 1) for one, mask in zip(toned, masks, strict=True))
    return *((255 * one).round().astype(np.uint8) for one in (a, b)), *masks


def _features(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    gray = color.rgb2gray(picture)
    scale = min(1.0, np.sqrt(5e5 / gray.size))
    small = transform.rescale(gray, scale, anti_aliasing=True) if scale < 1 else gray
    sift = feature.SIFT(upsampling=2 if small.size < 3e5 else 1)
    sift.detect_and_extract(small)
    return sift.keypoints[:, ::-1] / scale, sift.descriptors


def ours(a: np.ndarray, b: np.ndarray, mask_a: np.ndarray, mask_b: np.ndarray) -> np.ndarray:
    return ts.find_seam(a, b, mask_a, mask_b).labels


def by_gradient(a: np.ndarray, b: np.ndarray, mask_a: np.ndarray, mask_b: np.ndarray) -> np.ndarray:
    return ts.find_seam(a, b, mask_a, mask_b, gradient=True).labels


def opencv(kind: str) -> Callable[..., np.ndarray]:
    import cv2

    def find(a: np.ndarray, b: np.ndarray, mask_a: np.ndarray, mask_b: np.ndarray) -> np.ndarray:
        finder = cv2.detail_DpSeamFinder("COLOR") if kind == "DP" else cv2.detail.GraphCutSeamFinder(kind)
        masks = [cv2.UMat(np.where(mask, 255, 0).astype(np.uint8)) for mask in (mask_a, mask_b)]
        images = [cv2.UMat(np.ascontiguousarray(one[..., ::-1], np.float32)) for one in (a, b)]
        found = finder.find(images, [(0, 0), (0, 0)], masks) or masks
        shown_a, shown_b = (one.get() > 0 for one in found)
        return (shown_b & ~shown_a) | (mask_b & ~mask_a)

    return find


def enblend(a: np.ndarray, b: np.ndarray, mask_a: np.ndarray, mask_b: np.ndarray) -> np.ndarray:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for stem, one, mask in (("a", a, mask_a), ("b", b, mask_b)):
            Image.fromarray(np.dstack([one, np.where(mask, 255, 0).astype(np.uint8)])).save(
                folder / f"{stem}.tif"
            )
        command = ["enblend", f"--save-masks={folder}/mask-%n.tif", "-l", "1", "-o", f"{folder}/out.tif"]
        subprocess.run([*command, f"{folder}/a.tif", f"{folder}/b.tif"], check=True, capture_output=True)
        mask = np.asarray(Image.open(next(folder.glob("mask-*"))))
    shown = np.zeros(mask_a.shape, bool)
    rows, columns = (np.flatnonzero((mask_a | mask_b).any(axis=axis))[0] for axis in (1, 0))
    shown[rows : rows + mask.shape[0], columns : columns + mask.shape[1]] = (
        mask > 0
    )  # it is cropped to what shows
    if shown[mask_a & ~mask_b].mean() > 0.5:
        shown = ~shown
    return (shown & mask_b) | (mask_b & ~mask_a)


def finders() -> dict[str, Callable[..., np.ndarray]]:
    found = {
        "natural": ours,
        "gradient": by_gradient,
        "OpenCV COLOR": opencv("COST_COLOR"),
        "OpenCV COLOR_GRAD": opencv("COST_COLOR_GRAD"),
        "OpenCV DP": opencv("DP"),
    }
    if shutil.which("enblend"):
        found["enblend"] = enblend
    return found


def figures(folder: Path, names: list[str]) -> None:
    table: dict[str, list[tuple[float, float, float]]] = {name: [] for name in names}
    seconds = dict.fromkeys(names, 0.0)
    for pair, (a, b, mask_a, mask_b) in pairs(folder):
        both = mask_a & mask_b
        ssim, zncc = unlikeness(a, b, both)
        for name, find in finders().items():
            if name not in names:
                continue
            started = time.process_time()
            labels = find(a, b, mask_a, mask_b)
            seconds[name] += time.process_time() - started
            along = beside(labels, both)
            values = np.sort(ssim[along])
            worst = values[-max(1, len(values) // 10) :].mean()
            table[name].append((float(values.mean()), float(zncc[along].mean()), float(worst)))
        print(pair, {name: [round(value, 3) for value in table[name][-1]] for name in names}, flush=True)
    base = np.array(table["OpenCV COLOR"])
    print(f"\n{'':<20}{'1 - SSIM':>10}{'ZNCC':>10}{'worst':>10}{'better in':>11}{'time':>8}   ÷ OpenCV COLOR")
    for name in names:
        ratio = np.exp(np.log(np.array(table[name]) / base).mean(axis=0))
        better = (np.array(table[name])[:, 0] < base[:, 0]).mean()
        time_ratio = seconds[name] / seconds["OpenCV COLOR"] if name != "enblend" else float("nan")
        print(
            f"{name:<20}"
            + "".join(f"{value:>10.3f}" for value in ratio)
            + f"{better:>10.0%}{time_ratio:>9.2f}"
        )


def giving(folder: Path, most: int) -> None:
    """The figures before and after pictures are bent along the seam."""
    table, seconds = [], np.zeros(2)
    for pair, (a, b, mask_a, mask_b) in pairs(folder):
        images, masks = (a, b), (mask_a, mask_b)
        layers = [
            ts.Layer(image, alpha=255 * mask.astype(np.uint8), name=name)
            for image, mask, name in zip(images, masks, "ab", strict=True)
        ]
        started = time.process_time()
        before = ts.stitch(layers)
        between = time.process_time()
        after = give_way(before, most, ts.stitch)
        seconds += between - started, time.process_time() - between
        rows = []
        for composed in (before, after):
            a, b = (np.asarray(layer.image[:, :]) for layer in composed.layers)
            both = np.all([np.asarray(layer.alpha[:, :]) == 255 for layer in composed.layers], axis=0)
            ssim, zncc = unlikeness(a, b, both)
            along = beside(composed.labels(slice(None), slice(None)), both)
            values = np.sort(ssim[along])
            rows.append((values.mean(), zncc[along].mean(), values[-max(1, len(values) // 10) :].mean()))
        print(pair, f"bent by {after.bent:.1f} px", np.round(rows, 3).tolist(), flush=True)
        if after.bent:
            table.append(rows)
    found = np.array(table)
    ratios = np.exp(np.log(found[:, 1] / found[:, 0]).mean(axis=0))
    lower = (found[:, 1, 0] < found[:, 0, 0]).mean()
    print(f"\nbent: {len(found)} pairs; after ÷ before, 1 - SSIM: {ratios[0]:.3f}, lower in {lower:.0%};")
    print(f"ZNCC: {ratios[1]:.3f}; the worst tenth: {ratios[2]:.3f}")
    print(f"time of all, ÷ that of the search alone: {seconds.sum() / seconds[0]:.2f}")


def blind(folder: Path, sheets: Path) -> None:
    """Write composites of four finders, cropped to where they differ, under shuffled letters; and the key."""
    sheets.mkdir(parents=True)
    shuffled, key = random.Random(11), {}
    compared = [name for name in ("natural", "gradient", "OpenCV COLOR", "enblend") if name in finders()]
    for pair, (a, b, mask_a, mask_b) in pairs(folder):
        shuffled.shuffle(compared)
        shown = [finders()[name](a, b, mask_a, mask_b) for name in compared]
        seams = np.any([beside(labels, mask_a & mask_b) for labels in shown], axis=0)
        rows, columns = np.flatnonzero(seams.any(axis=1)), np.flatnonzero(seams.any(axis=0))
        box = np.s_[max(rows[0] - 20, 0) : rows[-1] + 20, max(columns[0] - 60, 0) : columns[-1] + 60]
        for letter, labels in zip("PQRS", shown, strict=False):
            picture = np.where(labels[..., None], b, a)
            picture[~(mask_a | mask_b)] = 255
            Image.fromarray(picture[box]).save(sheets / f"{pair}_{letter}.png")
        key[pair] = list(compared)
    sheets.with_suffix(".key.json").write_text(json.dumps(key, indent=1))


def count(key_file: Path, votes: list[Path]) -> None:
    key = json.loads(key_file.read_text())
    best, judged, against = 0, 0, {}
    for line in (line for file in votes for line in csv.reader(file.read_text().splitlines())):
        if line[0] not in key:
            continue
        places = {
            key[line[0]]["PQRS".index(letter.strip())]: place
            for place, letters in enumerate(line[1].split(">"))
            for letter in letters.split("=")
        }
        judged += 1
        best += places["natural"] == 0
        if places["natural"]:
            print(f"{line[0]}: {places} {line[2]}")
        for name, place in places.items():
            if name != "natural":
                ahead, level, behind = against.get(name, (0, 0, 0))
                against[name] = (
                    ahead + (places["natural"] < place),
                    level + (places["natural"] == place),
                    behind + (places["natural"] > place),
                )
    print(f"natural is best or as good as the best in {best} of {judged}")
    for name, (ahead, level, behind) in against.items():
        print(f"against {name}: ahead in {ahead}, level in {level}, behind in {behind}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--give", type=int, metavar="PX")
    parser.add_argument("--blind", type=Path, metavar="SHEETS")
    parser.add_argument("--count", type=Path, nargs="+", metavar="KEY VOTES")
    parser.add_argument(
        "--finder", action="append", help="only this one; may be repeated; OpenCV COLOR is the base"
    )
    given = parser.parse_args()
    print(stamp())
    if given.give:
        giving(given.pairs, given.give)
    elif given.blind:
        blind(given.pairs, given.blind)
    elif given.count:
        count(given.count[0], given.count[1:])
    else:
        figures(given.pairs, given.finder or list(finders()))


if __name__ == "__main__":
    main()
