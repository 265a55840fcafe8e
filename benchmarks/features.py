"""SIFT features: ours, all of a level described together, beside scikit-image's, one after the other.

    python benchmarks/features.py
    python benchmarks/features.py --turn 30 --scale 0.8

Each of scikit-image's photographs is matched to itself turned, scaled, darkened and noisy. *Right* are the
matches within 2 px of the truth. Seconds are processor time. At the end ours sample gradients with SciPy's
``map_coordinates`` instead of their own bilinear interpolation.
"""

from __future__ import annotations

import argparse
import time
from typing import Any
from unittest import mock

import numpy as np
from scipy import ndimage
from skimage import data, feature, transform

from stamp import stamp
from toposeam.layers.registration.features import FeatureSet, find_features, shared_features

PHOTOGRAPHS = ("astronaut", "camera", "chelsea", "coffee", "brick", "grass", "gravel", "hubble_deep_field")
CONTRAST = 0.004
NEAR = 2.0
SIDE = 450
NOISE = 1.5 / 255

Found = tuple[np.ndarray, np.ndarray]


def theirs(gray: np.ndarray) -> Found:
    """scikit-image's features; its points lie a quarter of a pixel too far right and down."""
    found: Any = feature.SIFT(c_dog=CONTRAST)
    found.detect_and_extract(gray)
    return found.positions[:, ::-1] - 0.25, found.descriptors


def ours(gray: np.ndarray) -> Found:
    return find_features(gray, CONTRAST)


def sampled_by_scipy(gradient: Any, at: Any, scale: Any, grid: Any) -> Any:
    where = at[:, np.newaxis] + np.multiply.outer(scale, grid)
    return ndimage.map_coordinates(gradient, [where.real, where.imag], order=1, mode="constant")


def with_scipy(gray: np.ndarray) -> Found:
    with mock.patch("toposeam.layers.registration.features._sample_gradient", sampled_by_scipy):
        return find_features(gray, CONTRAST)


def pair(
    name: str, turn: float, scale: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, Any]:
    """A gray photograph, what another camera made of it, and where its points lie there."""
    gray = np.asarray(getattr(data, name)()).astype(np.float32) / 255
    gray = gray.mean(axis=2) if gray.ndim == 3 else gray
    gray = gray[:SIDE, :SIDE]
    middle = (np.array(gray.shape[::-1]) - 1) / 2
    there = transform.SimilarityTransform(translation=-middle)
    there += transform.SimilarityTransform(rotation=np.radians(turn), scale=scale)
    there += transform.SimilarityTransform(translation=middle)
    other = 0.8 * transform.warp(gray, there.inverse, order=3, mode="reflect", preserve_range=True)
    other += rng.normal(0, NOISE, other.shape)
    return gray, other.astype(np.float32), there


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--turn", type=float, default=10.0, help="degrees")
    parser.add_argument("--scale", type=float, default=0.9)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(stamp())
    rng = np.random.default_rng(options.seed)
    spent, right = np.zeros(3), np.zeros(2, int)
    print(f"{'':20}{'features':>16}{'matches':>16}{'right':>16}{'seconds':>16}")
    for name in PHOTOGRAPHS:
        *pictures, there = pair(name, options.turn, options.scale, rng)
        row = []
        for number, find in enumerate((ours, theirs)):
            begun = time.process_time()
            a, b = (find(gray) for gray in pictures)
            seconds = time.process_time() - begun
            first, second = (
                FeatureSet(gray, gray > -1, 1, *found) for gray, found in zip(pictures, (a, b), strict=True)
            )
            matches = shared_features(first, second)
            apart = np.linalg.norm(there(a[0][matches[:, 0]]) - b[0][matches[:, 1]], axis=1)
            near = int((apart < NEAR).sum())
            spent[number] += seconds
            right[number] += near
            row.append((len(a[0]), len(matches), near, seconds))
        cells = [
            f"{one:{kind}} {other:{kind}}"
            for one, other, kind in zip(*row, ("d", "d", "d", ".2f"), strict=True)
        ]
        print(f"{name:20}" + "".join(f"{cell:>16}" for cell in cells))
        begun = time.process_time()
        for gray in pictures:
            with_scipy(gray)
        spent[2] += time.process_time() - begun
    print(f"ours ÷ scikit-image's: time {spent[0] / spent[1]:.2f}, right matches {right[0] / right[1]:.2f}")
    print(f"ours ÷ ours with map_coordinates: time {spent[0] / spent[2]:.2f}")


if __name__ == "__main__":
    main()
