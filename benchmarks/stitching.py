"""Composites of several crops of one photograph, against the photograph: ours, and OpenCV's pipeline at the
same positions.

    python benchmarks/stitching.py                       50 sets, about seven minutes
    python benchmarks/stitching.py --sets 8 --sheet sets.png

Each set is 3 to 6 overlapping crops of a photograph, each exposed a little differently (up to ±10 %, in
light, then encoded as sRGB again) and with a little noise. OpenCV finds seams with ``GraphCutSeamFinder``
(COLOR) and blends with ``MultiBandBlender``, the defaults of its stitcher; once as it is, once after its
``BlocksGainCompensator``, which its stitcher also has by default. Both sides are told the positions, and
neither the exposures.

Measured over what is covered: the mean absolute error to the photograph, after one common gain per channel
that fits it best (nobody can know the true exposure), in 8-bit levels; and at the pixel pairs that the seams
divide, by how much the step between the two pixels differs from the photograph's. Seconds are of processor
time and include everything after reading.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from skimage import data

import toposeam as ts
from stamp import stamp

PHOTOGRAPHS = ("coffee", "chelsea", "astronaut", "rocket", "retina", "hubble_deep_field")
EXPOSURE, NOISE = 0.10, 1.5
HEIGHT, WIDTH = 280, 340

OURS = {
    "toposeam, hard cut": {},
    "toposeam, --match-tones": {"match_tones": True},
    "toposeam, --match-tones --blend feather": {"match_tones": True, "blend": "feather"},
    "toposeam, --match-tones --blend multiband": {"match_tones": True, "blend": "multiband"},
}
THEIRS = {"OpenCV, graph cut + multiband": False, "OpenCV, gains + graph cut + multiband": True}


def linear(encoded: np.ndarray) -> np.ndarray:
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encoded(light: np.ndarray) -> np.ndarray:
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def make_set(index: int, seed: int) -> tuple[np.ndarray, list[ts.Layer]]:
    """A piece of a photograph and crops of it, each overlapping at least one before it."""
    rng = np.random.default_rng([seed, index])
    photograph = getattr(data, PHOTOGRAPHS[index % len(PHOTOGRAPHS)])()
    height, width = min(HEIGHT, photograph.shape[0]), min(WIDTH, photograph.shape[1])
    top, left = rng.integers(photograph.shape[0] - height + 1), rng.integers(photograph.shape[1] - width + 1)
    piece = photograph[top : top + height, left : left + width]
    count = int(rng.integers(3, 7))
    boxes: list[tuple[int, int, int, int]] = []
    for attempt in range(10**4):
        if len(boxes) == count:
            break
        if attempt % 100 == 99:
            boxes.clear()  # no further crop fits
        h, w = int(rng.uniform(0.4, 0.65) * height), int(rng.uniform(0.4, 0.65) * width)
        y, x = int(rng.integers(height - h + 1)), int(rng.integers(width - w + 1))
        shares = [
            max(0, min(y + h, b + d) - max(y, b)) * max(0, min(x + w, a + c) - max(x, a)) / min(h * w, c * d)
            for a, b, c, d in boxes
        ]
        if boxes and not 0.12 < max(shares) < 0.6:
            continue
        boxes.append((x, y, w, h))
    layers = []
    for number, (x, y, w, h) in enumerate(boxes):
        gain = 1 + rng.uniform(-EXPOSURE, EXPOSURE) + rng.uniform(-0.02, 0.02, 3)
        crop = 255 * encoded(linear(piece[y : y + h, x : x + w] / 255) * gain) + rng.normal(
            0, NOISE, (h, w, 3)
        )
        layers.append(
            ts.Layer(image=np.clip(np.rint(crop), 0, 255).astype(np.uint8), at=(x, y), name=str(number))
        )
    left, top = (min(layer.at[axis] for layer in layers) for axis in (0, 1))
    return piece[top:, left:], layers


def ours(layers: list[ts.Layer], options: dict) -> tuple[np.ndarray, np.ndarray]:
    """The composite and which layer shows, -1 for none."""
    stitched = ts.stitch(layers, **options)
    label_map = np.full(stitched.masks[0].shape, -1)
    for index, mask in enumerate(stitched.masks):
        label_map[mask] = index
    return stitched.image, label_map


def theirs(layers: list[ts.Layer], gains: bool) -> tuple[np.ndarray, np.ndarray]:
    corners = [layer.at for layer in layers]
    images = [np.ascontiguousarray(layer.image[..., ::-1]) for layer in layers]
    masks = [np.full(image.shape[:2], 255, np.uint8) for image in images]
    if gains:
        compensator = cv2.detail.ExposureCompensator.createDefault(cv2.detail.ExposureCompensator_GAIN_BLOCKS)
        compensator.feed(corners, [cv2.UMat(image) for image in images], [cv2.UMat(mask) for mask in masks])
        images = [compensator.apply(k, corners[k], image.copy(), masks[k]) for k, image in enumerate(images)]
    finder = cv2.detail_GraphCutSeamFinder("COST_COLOR")
    cut = finder.find(
        [cv2.UMat(image.astype(np.float32)) for image in images], corners, [cv2.UMat(mask) for mask in masks]
    )
    cut = [mask.get() if isinstance(mask, cv2.UMat) else mask for mask in cut]
    x, y = min(c[0] for c in corners), min(c[1] for c in corners)
    right = max(c[0] + image.shape[1] for c, image in zip(corners, images, strict=True))
    bottom = max(c[1] + image.shape[0] for c, image in zip(corners, images, strict=True))
    roi = (x, y, right - x, bottom - y)
    blender = cv2.detail_MultiBandBlender()
    width = np.sqrt(roi[2] * roi[3]) * 5 / 100  # the stitcher's default strength
    blender.setNumBands(int(np.log2(width) - 1))
    blender.prepare(roi)
    for image, mask, corner in zip(images, cut, corners, strict=True):
        blender.feed(image.astype(np.int16), mask, corner)
    result, _ = blender.blend(None, None)
    label_map = np.full((roi[3], roi[2]), -1)
    for index, (mask, corner) in enumerate(zip(cut, corners, strict=True)):
        place = label_map[
            corner[1] - y : corner[1] - y + mask.shape[0], corner[0] - x : corner[0] - x + mask.shape[1]
        ]
        place[mask > 0] = index
    return np.clip(result, 0, 255).astype(np.uint8)[..., ::-1], label_map


def errors(
    image: np.ndarray, label_map: np.ndarray, truth: np.ndarray, covered: np.ndarray
) -> tuple[float, float]:
    """Mean absolute error after a gain per channel, and mean excess step across the seams; 8-bit levels."""
    truth = truth[: image.shape[0], : image.shape[1]].astype(float)
    fitted = image.astype(float)
    for channel in range(3):
        a, b = fitted[..., channel][covered], truth[..., channel][covered]
        fitted[..., channel] *= np.median(b[a > 8] / a[a > 8]) if (a > 8).any() else 1.0
    steps = []
    for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        divided = (label_map[s] != label_map[t]) & (label_map[s] >= 0) & (label_map[t] >= 0)
        steps.append(np.abs((fitted[t] - fitted[s]) - (truth[t] - truth[s]))[divided])
    jump = np.concatenate(steps)
    return float(np.abs(fitted - truth)[covered].mean()), float(jump.mean()) if jump.size else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=50)
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--sheet", type=Path, help="write the composites of up to eight sets side by side")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in (*OURS, *THEIRS)}
    rows = []
    for index in range(options.sets):
        truth, layers = make_set(index, options.seed)
        canvas = ts.layers.common_canvas(layers)
        covered = np.zeros(canvas.shape, bool)
        for layer in layers:
            covered[canvas.place(layer).slices] = True
        row = []
        for name in found:
            started = time.process_time()
            image, label_map = ours(layers, OURS[name]) if name in OURS else theirs(layers, THEIRS[name])
            seconds = time.process_time() - started
            found[name].append((*errors(image, label_map, truth, covered), seconds))
            row.append(image)
        rows.append((truth[: canvas.shape[0], : canvas.shape[1]], covered, row))
        if sys.stderr.isatty():
            print(f"\r{index + 1}", end="", file=sys.stderr, flush=True)
    print(f"{options.sets} sets, medians\n\n{'':<44}{'error':>8}{'step at seams':>16}{'s':>8}")
    for name, values in found.items():
        error, jump, seconds = np.median(values, axis=0)
        print(f"{name:<44}{error:>8.3f}{jump:>16.3f}{seconds:>8.2f}")
    best = {name: np.array(values) for name, values in found.items()}
    print()
    for name in OURS:
        for other in THEIRS:
            wins = (best[name][:, :2] <= best[other][:, :2]).mean(axis=0)
            ratio = np.median(best[name] / np.maximum(best[other], 1e-9), axis=0)
            print(
                f"{name} ÷ {other}: error {ratio[0]:.2f}, step {ratio[1]:.2f}, s {ratio[2]:.1f}; no worse in "
                f"{wins[0]:.0%}, {wins[1]:.0%}"
            )
    if options.sheet is not None:
        sheet(rows[:8], options.sheet)


def sheet(rows: list, path: Path) -> None:
    """The photograph, then each method's composite, one set a row."""
    tiles = []
    for truth, covered, images in rows:
        shown = [np.where(covered[..., None], truth, 0), *images]
        tiles.append(
            [
                np.pad(image, ((0, HEIGHT - image.shape[0]), (0, WIDTH - image.shape[1]), (0, 0)))
                for image in shown
            ]
        )
    Image.fromarray(np.concatenate([np.concatenate(row, axis=1) for row in tiles]).astype(np.uint8)).save(
        path
    )


if __name__ == "__main__":
    print(stamp())
    main()
