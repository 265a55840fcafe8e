"""Pairs of volumes and shapes of overlaps for the benchmarks of surfaces."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).parents[1] / "samples"))
import clips

Floats = npt.NDArray[np.float32]
Masks = tuple[npt.NDArray[np.bool_] | None, npt.NDArray[np.bool_] | None]


def carried(
    count: int, height: int, width: int, rng: np.random.Generator, apart: int
) -> tuple[Floats, Floats]:
    """Two stretches of a clip of noise, `apart` frames from each other."""
    textures = [clips.field((2 * height, 2 * width), 1.3, rng) for _ in range(2)]
    flows = [0.8 + 0.4 * clips.field((2 * height, 2 * width), 2.5, rng)[:height, :width] for _ in range(4)]
    y, x = np.indices((height, width), float)

    def frame(t: int) -> Floats:
        one = clips.moved(textures[0], y + flows[0] * t, x + flows[1] * t)
        other = clips.moved(textures[1], y - flows[2] * t, x + flows[3] * t)
        return np.clip(0.5 + 0.12 * (one + other), 0, 1).astype(np.float32)

    a, b = (np.stack([frame(t + start) for t in range(count)]) for start in (0, apart))
    return a, b


def strip(shape: tuple[int, ...]) -> Masks:
    return None, None


def ell(shape: tuple[int, ...]) -> Masks:
    on_a = np.zeros(shape, bool)
    on_a[: 2 * shape[0] // 3] = on_a[:, : shape[1] // 2] = True
    return on_a, np.ones(shape, bool)


def ring(shape: tuple[int, ...]) -> Masks:
    _, h, w = shape
    on_a, on_b = np.ones(shape, bool), np.zeros(shape, bool)
    on_a[:, 2 * h // 5 : 3 * h // 5, 2 * w // 5 : 3 * w // 5] = False
    on_b[:, h // 10 : -h // 10, w // 10 : -w // 10] = True
    return on_a, on_b


def islands(shape: tuple[int, ...]) -> Masks:
    d, h, w = shape
    on_b = np.zeros(shape, bool)
    for left in (w // 12, w // 2 + w // 24):
        on_b[d // 8 : -d // 8, h // 8 : -h // 8, left : left + 3 * w // 8] = True
    return None, on_b


TOPOLOGIES = {"strip": strip, "L": ell, "ring": ring, "islands": islands}


def drawn(count: int) -> Iterator[tuple[str, list[tuple[tuple[int, int, int], Masks, bool, int]]]]:
    """Per shape of overlap its name and its volumes, of 11,000 to 320,000 voxels: their shape, masks, whether
    gradients count, and a seed.
    """
    rng = np.random.default_rng(0)
    for name, make in TOPOLOGIES.items():
        found = []
        for index in range(-(-count // len(TOPOLOGIES))):
            size = 10 ** rng.uniform(4.05, 5.5)
            proportion = np.array([1.0, rng.uniform(1.5, 3.5), rng.uniform(1.5, 3.5)])
            if make is islands:
                proportion[0] = 2.0  # deep enough for a core
            shortest = 28 if make is islands else 8  # or nothing is left to decide round it
            scaled = proportion * (size / proportion.prod()) ** (1 / 3)
            depth, height, width = (int(side) for side in np.maximum(shortest, scaled))
            shape = depth, height, width
            found.append((shape, make(shape), index % 2 == 0, 100 + index))
        yield name, found
