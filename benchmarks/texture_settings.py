"""Does ``synth`` choose well? Textures of 448 × 448 px from each sample in a folder, three ways: by image
quilting (Efros and Freeman 2001, below), with the setting `varied`, and with the one that ``synth`` chooses.

    python benchmarks/texture_settings.py SAMPLES [PICTURES]

prints visible joints per 1000 px (steps of 12 % of white beyond the sample's own), the share of the sample
that shows, and processor time; and writes the pictures, side by side, into a folder. Numbers say whether
joints are seen, not whether a texture is good: look at the pictures.
"""

from __future__ import annotations

import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.signal import fftconvolve

import toposeam as ts
from sheets import sheet_of
from stamp import stamp

SIDE = 448
#: Side of quilted blocks as a share of the sample's shorter side, and their overlap as a share of the block.
BLOCK, OVERLAP = 1 / 3, 1 / 6
#: Least step, as a share of white, that is seen.
VISIBLE = 0.12


def quilt(sample: np.ndarray, side: int, seed: int = 0) -> np.ndarray:
    """Quilt a texture; return row and column of the sample's pixel that shows, (side, side, 2)."""
    values, rng = sample.astype(float) / 255, np.random.default_rng(seed)
    block = round(BLOCK * min(sample.shape[:2]))
    lap = round(OVERLAP * block)
    step = block - lap
    count = -(-(side - lap) // step)
    source = np.full((count * step + lap,) * 2 + (2,), -1)
    squares = np.square(values).sum(2)
    for top in range(0, count * step, step):
        for left in range(0, count * step, step):
            window = source[top : top + block, left : left + block]
            known = window[..., 0] >= 0
            there = values[window[..., 0], window[..., 1]] * known[..., np.newaxis]
            errors = fftconvolve(squares, known[::-1, ::-1].astype(float), "valid")
            errors -= 2 * sum(fftconvolve(values[..., c], there[::-1, ::-1, c], "valid") for c in range(3))
            errors += np.square(there).sum()
            near = np.argwhere(errors <= 1.1 * max(errors.min(), 0) + 1e-6)
            y, x = near[rng.integers(len(near))]
            shows = ~known
            apart = np.square(values[y : y + block, x : x + block] - there).sum(2)
            wins = np.ones((block, block), bool)
            if left:
                wins &= _cut(apart[:, :lap], block)
            if top:
                wins &= _cut(apart[:lap].T, block).T
            window[shows | wins] = (np.mgrid[y : y + block, x : x + block].transpose(1, 2, 0))[shows | wins]
    return source[:side, :side]


def _cut(apart: np.ndarray, block: int) -> np.ndarray:
    """Find what lies beyond the cheapest path down an overlap: (rows, block) bool."""
    cost = apart.copy()
    for row in range(1, len(cost)):
        last = np.pad(cost[row - 1], 1, constant_values=np.inf)
        cost[row] += np.minimum(np.minimum(last[:-2], last[1:-1]), last[2:])
    beyond, at = np.ones((len(cost), block), bool), int(cost[-1].argmin())
    for row in range(len(cost) - 1, -1, -1):
        low = max(at - 1, 0) if row < len(cost) - 1 else 0
        high = at + 2 if row < len(cost) - 1 else cost.shape[1]
        at = low + int(cost[row, low:high].argmin())
        beyond[row, :at] = False
    return beyond


def joints(sample: np.ndarray, source: np.ndarray) -> float:
    """Count visible joints per 1000 px."""
    gray, steps = sample.mean(2) / 255, 0
    limits = np.array(gray.shape) - 1

    def at(places: np.ndarray) -> np.ndarray:
        return gray[tuple(np.clip(places, 0, limits).T)]

    for axis in (0, 1):
        onward, length = np.eye(2, dtype=int)[axis], source.shape[axis]
        one, two = source.take(range(length - 1), axis), source.take(range(1, length), axis)
        cut = (two - one != onward).any(-1)
        one, two = one[cut], two[cut]
        own = np.maximum(abs(at(one) - at(one + onward)), abs(at(two) - at(two - onward)))
        steps += int((abs(at(one) - at(two)) - own > VISIBLE).sum())
    return 1000 * steps / source[..., 0].size


def shown(sample: np.ndarray, source: np.ndarray) -> float:
    """Compute the share of the sample that shows."""
    seen = np.zeros(sample.shape[:2], bool)
    seen[source[..., 0], source[..., 1]] = True
    return float(seen.mean())


def main(samples: Path, pictures: Path | None) -> None:
    """Print a table, and write the pictures."""
    print(stamp())
    print(f"{'':20}{'quilting':>24}{'varied':>24}{'chosen':>24}")
    print(f"{'':20}" + f"{'joints':>10}{'shown':>7}{'s':>7}" * 3)
    rows = []
    for path in sorted(one for one in samples.iterdir() if one.suffix in (".png", ".jpg", ".jpeg")):
        sample = np.asarray(Image.open(path).convert("RGB"))
        row, made, name = [], [sample], ""
        for way in (_quilted, partial(_grown, setting="varied"), _grown):
            start = time.process_time()
            image, source, name = way(sample)
            row += [joints(sample, source), 100 * shown(sample, source), time.process_time() - start]
            made.append(image)
        rows.append(row)
        print(f"{path.stem:20}{_figures(row)} {name}", flush=True)
        if pictures is not None:
            pictures.mkdir(parents=True, exist_ok=True)
            sheet_of([made]).save(pictures / f"{path.stem}.png")
    found = np.array(rows)
    print(f"{'median':20}{_figures(np.median(found, axis=0).tolist())}")
    for name, column in (("varied", 3), ("chosen", 6)):
        few = np.count_nonzero(found[:, column] <= found[:, 0])
        print(f"{name}: joints no more than quilting's in {few} of {len(found)}")


def _figures(row: list[float]) -> str:
    return "".join(f"{row[k]:10.2f}{row[k + 1]:6.0f}%{row[k + 2]:7.2f}" for k in (0, 3, 6))


def _quilted(sample: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    source = quilt(sample, SIDE)
    return sample[source[..., 0], source[..., 1]], source, ""


def _grown(sample: np.ndarray, setting: str = "auto") -> tuple[np.ndarray, np.ndarray, str]:
    grown = ts.synthesize(sample, SIDE, setting=setting)
    return grown.image, grown.source, str(grown.settings["setting"])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
