"""Piles of pictures for the benchmarks of stitching."""

from __future__ import annotations

import numpy as np

import toposeam as ts
from placing import EXPOSURE, NOISE, PHOTOGRAPHS, photograph

KINDS = ("alike", "objects", "unlike")


def large_pile(index: int, seed: int) -> tuple[str, list[ts.Layer]]:
    """Crops of 1200 px wide photographs, and of which kind."""
    rng = np.random.default_rng([seed, index])
    kind = KINDS[index % len(KINDS)]
    count = int(rng.integers(4, 8))
    scenes = [photograph(PHOTOGRAPHS[(index + k) % len(PHOTOGRAPHS)]) for k in range(count)]
    if kind != "unlike":
        scenes = scenes[:1] * count
    height, width = (min(scene.shape[axis] for scene in scenes) for axis in (0, 1))
    layers = []
    for number, scene in enumerate(scenes):
        h, w = int(rng.uniform(0.5, 0.7) * height), int(rng.uniform(0.5, 0.7) * width)
        y, x = int(rng.integers(height - h + 1)), int(rng.integers(width - w + 1))
        crop = scene[y : y + h, x : x + w].copy()
        for _ in range(8 if kind == "objects" else 0):
            cy, cx, radius = rng.integers(h), rng.integers(w), rng.uniform(0.02, 0.08) * w
            down, right = np.mgrid[:h, :w]
            crop[(down - cy) ** 2 + (right - cx) ** 2 < radius**2] = rng.uniform(20, 235, 3)
        crop = crop * (1 + rng.uniform(-EXPOSURE, EXPOSURE)) + rng.normal(0, NOISE, crop.shape)
        image = np.clip(np.rint(crop), 0, 255).astype(np.uint8)
        layers.append(ts.Layer(image, at=(x, y), name=str(number)))
    return kind, layers


def frames(seed: int) -> list[ts.Layer]:
    """Crops of 400 × 300 px that cover a photograph row by row and overlap by 60 %, as from a plane."""
    rng = np.random.default_rng(seed)
    scene, (height, width) = photograph("coffee"), (300, 400)
    layers = []
    for top in range(0, scene.shape[0] - height + 1, int(0.4 * height)):
        for left in range(0, scene.shape[1] - width + 1, int(0.4 * width)):
            wanted = np.array((top, left)) + rng.integers(-8, 9, 2)
            y, x = np.clip(wanted, 0, np.array(scene.shape[:2]) - (height, width)).tolist()
            crop = scene[y : y + height, x : x + width]
            crop = crop * (1 + rng.uniform(-EXPOSURE, EXPOSURE)) + rng.normal(0, NOISE, crop.shape)
            layers.append(ts.Layer(np.clip(np.rint(crop), 0, 255).astype(np.uint8), at=(x, y)))
    return layers
