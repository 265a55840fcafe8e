"""What of swd8 (texture.py) is chance: ``python benchmarks/texture_spread.py [--against CORE]``.

Of the twenty samples of texture_samples.py, grown open with the defaults and repeating from patches of 40 px,
mean and standard error over eight seeds, of four numbers:

swd8       of 6000 windows drawn from sample and result, always the same: two such draws from one sample are
           up to 1.4 apart (dots), so that whatever is like the draw, and not like the sample, is nearer
all        the same of all windows, those across the border of a tile too
even       all windows, and slow light taken out of both: each is divided by itself blurred (24 px)
relit      all windows, the slow light replaced by a smooth field that is as bright, by rank, as the sample:
           what the distance is when light that was levelled is put back

``--against CORE`` has another version of the package (``git worktree add /tmp/filed 858cbf9``;
``/tmp/filed/core``) grow the same, measures both alike, and names the numbers by which textures are farther
from their sample than that version's, by more than two standard errors of the difference.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import ndimage

import toposeam as ts
from stamp import stamp
from texture import SIZE, gray, swd8
from texture_samples import samples

#: Deviation of the noise that becomes a smooth field of light, px.
FIELD = 60


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--against", type=Path, metavar="CORE", help="another version of the package")
    parser.add_argument("--only", default="", help="names of samples, with commas between")
    chosen = parser.parse_args()
    spread(chosen.seeds, chosen.only.split(",") if chosen.only else [], chosen.against)


def spread(seeds: int, wanted: list[str], against: Path | None) -> None:
    """Means over seeds of four distances and their standard errors, of the twenty samples."""
    ways: dict[str, dict[str, object]] = {"open": {}, "repeating": {"patch": 40, "tileable": True}}
    versions = [None] if against is None else [against, None]
    names = "swd8", "all", "even", "relit"
    heads = [f"{way} {name}" for way in ways for name in names]
    print(f"{'':14}" + "".join(f"{head:>{16 * len(versions)}}" for head in heads))
    for sample in samples():
        if wanted and sample.name not in wanted:
            continue
        exemplar, cells, farther = gray(sample.image), [], []
        for way, given in ways.items():
            repeats, means, errors = bool(given), [], []
            for version in versions:
                found = []
                for image in map(gray, _grown(sample.image, seeds, given, version)):
                    even = swd8_all(evened(exemplar), evened(image, repeats), repeats)
                    lit = swd8_all(exemplar, relit(image, exemplar, repeats), repeats)
                    found.append((swd8(exemplar, image), swd8_all(exemplar, image, repeats), even, lit))
                means.append(np.mean(found, axis=0))
                errors.append(
                    np.std(found, axis=0, ddof=1) / np.sqrt(seeds) if seeds > 1 else np.full(4, np.nan)
                )
            for k, name in enumerate(names):
                cells += [f"{m[k]:.2f} ± {e[k]:.2f}" for m, e in zip(means, errors, strict=True)]
                if against is not None and means[1][k] - means[0][k] > 2 * np.hypot(*errors)[k]:
                    farther.append(f"{way} {name}")
        row = f"{sample.name:14}" + "".join(f"{cell:>16}" for cell in cells)
        print(f"{row}  {', '.join(farther)}".rstrip(), flush=True)


def _grown(sample: np.ndarray, seeds: int, given: dict[str, object], core: Path | None) -> list[np.ndarray]:
    """Textures of the seeds from 1 on, by this version of the package or by that in a folder."""
    if core is None:
        return [ts.synthesize(sample, SIZE, seed=seed, **given).image for seed in range(1, seeds + 1)]
    grow = (
        "import sys, numpy as np, toposeam as ts; sample = np.load(sys.argv[1]); np.save(sys.argv[2], "
        f"[ts.synthesize(sample, {SIZE}, seed=seed, **{given!r}).image for seed in range(1, {seeds} + 1)])"
    )
    with tempfile.TemporaryDirectory() as folder:
        places = str(Path(folder, "sample.npy")), str(Path(folder, "grown.npy"))
        np.save(places[0], sample)
        subprocess.run(
            [sys.executable, "-c", grow, *places], check=True, env={**os.environ, "PYTHONPATH": str(core)}
        )
        return list(np.load(places[1]))


def swd8_all(exemplar: np.ndarray, image: np.ndarray, repeats: bool = False, side: int = 8) -> float:
    """The distance of all windows; values fall into steps of one level."""
    directions = np.random.default_rng(2).normal(size=(side**2, 128))
    directions /= np.linalg.norm(directions, axis=0)
    levels = 2 * side * 256  # no projection is beyond half of it

    def shares(picture: np.ndarray) -> np.ndarray:
        count = np.zeros(128 * levels)
        windows = sliding_window_view(picture, (side, side))
        for top in range(0, len(windows), 32):
            along = windows[top : top + 32].reshape(-1, side**2) @ directions
            steps = (along + levels / 2).astype(np.int32) + levels * np.arange(128, dtype=np.int32)
            count += np.bincount(steps.ravel(), minlength=count.size)
        total = np.cumsum(count.reshape(128, levels), axis=1)
        return total / total[:, -1:]

    room = (0, side - 1 if repeats else 0)
    return float(np.abs(shares(exemplar) - shares(np.pad(image, room, "wrap"))).sum(axis=1).mean())


def evened(image: np.ndarray, repeats: bool = False, deviation: float = 24.0) -> np.ndarray:
    """Gray values over what they are on average round each pixel, of the same mean."""
    beyond = {"sigma": deviation, "mode": "wrap" if repeats else "constant"}
    light = ndimage.gaussian_filter(image, **beyond) / ndimage.gaussian_filter(np.ones_like(image), **beyond)
    return image * image.mean() / np.maximum(light, 1.0)


def relit(image: np.ndarray, exemplar: np.ndarray, repeats: bool, deviation: float = 24.0) -> np.ndarray:
    """Gray values under a smooth field of light that is as bright, by rank, as the exemplar blurred, instead
    of under their own.
    """
    mode = "wrap" if repeats else "reflect"
    wanted = np.sort(ndimage.gaussian_filter(exemplar, deviation, mode="reflect"), axis=None)
    field = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=image.shape), FIELD, mode=mode)
    rank = np.empty(field.size, int)
    rank[np.argsort(field, axis=None)] = np.arange(field.size)
    light = wanted[rank * wanted.size // field.size].reshape(field.shape)
    own = ndimage.gaussian_filter(image, deviation, mode=mode)
    return np.clip(image * light / np.maximum(own, 1.0), 0, 255)


if __name__ == "__main__":
    print(stamp())
    main()
