"""Crops of photographs in an unknown order, placed: how far each lies from where it was cut out.

    python benchmarks/placing.py                 30 sets, some minutes
    python benchmarks/placing.py --sets 5 --seed 7
    python benchmarks/placing.py --repeating     30 sets of a wall of equal tiles

Each set is 4 to 20 crops of one photograph, shuffled. Each crop is cut out at places with fractions, turned
by up to 2°, exposed up to ±10 % differently, and noisy (1.5 8-bit levels). It overlaps at least one of those
before it by 25 to 60 %. ``toposeam.find_places`` is told nothing but to be exact.

With ``--repeating`` the photograph is part of one, repeated every 160 × 190 px, with stains (15 to 30 8-bit
levels) and up to 60 other things upon it, and crops of 130 to 180 px show about one repeat.

*Off* is the largest distance, px, between where a corner of any crop was placed and where it was cut out,
after the one shift and turn that brings all of them nearest together: nobody can know where the first one
lay. A set is *placed* when that is at most half a pixel, *refused* when the command says so, and *wrong*
otherwise.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from scipy import ndimage
from skimage import data

import toposeam as ts
from stamp import stamp

PHOTOGRAPHS = ("coffee", "astronaut", "chelsea", "rocket", "retina")
SETS, EXPOSURE, NOISE, TURN, NEAR = 30, 0.10, 1.5, 2.0, 0.5
#: Largest side of the photographs, px, and shares of it that crops have.
SIDE, SHARES = 1200, (0.26, 0.36)
#: The same of walls that repeat.
SMALL_SIDE = 500

Floats = np.ndarray


def photograph(name: str) -> Floats:
    """(H, W, 3) float32, enlarged to about the same size."""
    whole = getattr(data, name)().astype(np.float32)
    factor = SIDE / max(whole.shape[:2])
    return ndimage.zoom(whole, (factor, factor, 1), order=3) if factor != 1 else whole


def corners(shape: tuple[int, int], at: tuple[float, float], turn: float, scale: float = 1.0) -> Floats:
    """(4, 2) x and y of a crop's corner pixels, turned round the first one, clockwise degrees."""
    height, width = shape
    x = scale * np.array([0, width - 1, 0, width - 1.0])
    y = scale * np.array([0, 0, height - 1, height - 1.0])
    cosine, sine = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return np.stack([cosine * x - sine * y + at[0], sine * x + cosine * y + at[1]], axis=1)


def wall(rng: np.random.Generator) -> Floats:
    """(H, W, 3) float32, which repeats itself, but for stains and things upon it."""
    whole = np.tile(data.coffee()[60:220, 100:290].astype(np.float32), (5, 5, 1))
    stains = ndimage.gaussian_filter(rng.normal(0, 1, whole.shape[:2]), 3)
    whole += (rng.uniform(15, 30) * stains / stains.std())[..., np.newaxis]
    others = [data.astronaut(), data.chelsea(), data.rocket()]
    for _ in range(int(rng.integers(0, 61))):
        other, size = others[int(rng.integers(3))], rng.integers(25, 60, 2)
        (y, x), (top, left) = (
            [int(rng.integers(0, side - part)) for side, part in zip(image.shape, size, strict=False)]
            for image in (other, whole)
        )
        thing = other[y : y + size[0], x : x + size[1]]
        whole[top : top + size[0], left : left + size[1]] = thing
    return np.clip(whole, 0, 255)


def make_set(index: int, seed: int, repeating: bool = False) -> tuple[list[ts.Layer], list[Floats]]:
    """Crops, and the corners of each on the photograph."""
    rng = np.random.default_rng([seed, index])
    whole = wall(rng) if repeating else photograph(PHOTOGRAPHS[index % len(PHOTOGRAPHS)])
    size = whole.shape[:2]
    count = int(rng.integers(4, 21))
    shape = tuple(int(rng.uniform(*SHARES) * (SMALL_SIDE if repeating else SIDE)) for _ in range(2))
    places: list[tuple[float, float, float]] = []
    for _ in range(10**4):
        if len(places) == count:
            break
        turn = float(rng.uniform(-TURN, TURN))
        at = rng.uniform(0, size[1] - shape[1]), rng.uniform(0, size[0] - shape[0])
        ends = corners(shape, at, turn)
        if ends.min() < 2 or (ends.max(axis=0) > np.array(size[::-1]) - 3).any():
            continue
        shared = [
            max(0.0, 1 - abs(at[0] - x) / shape[1]) * max(0.0, 1 - abs(at[1] - y) / shape[0])
            for x, y, _ in places
        ]
        if places and not 0.25 <= max(shared) <= 0.6:
            continue
        places.append((*at, turn))
    layers, truth = [], []
    for number in rng.permutation(len(places)):
        x, y, turn = places[number]
        rows, columns = np.mgrid[: shape[0], : shape[1]]
        cosine, sine = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        there = [sine * columns + cosine * rows + y, cosine * columns - sine * rows + x]
        planes = [ndimage.map_coordinates(whole[..., c], there, order=3) for c in range(3)]
        crop = np.stack(planes, axis=2) * (1 + rng.uniform(-EXPOSURE, EXPOSURE))
        crop += rng.normal(0, NOISE, crop.shape)
        layers.append(ts.Layer(np.clip(np.rint(crop), 0, 255).astype(np.uint8), name=f"crop {number}"))
        truth.append(corners(shape, (x, y), turn))
    return layers, truth


def off(found: Floats, truth: Floats) -> float:
    """Largest distance of points after the shift and turn that fits them best."""
    a, b = found - found.mean(axis=0), truth - truth.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turned = a @ u @ np.diag([1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.hypot(*(turned - b).T).max())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=SETS)
    parser.add_argument("--first", type=int, default=0, help="number of the first set")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--repeating", action="store_true", help="crops of a wall that repeats itself")
    parser.add_argument("--each", action="store_true", help="a line for every set")
    options = parser.parse_args()
    told = {"placed": 0, "refused": 0, "wrong": 0}
    offs, seconds = [], []
    for index in range(options.first, options.first + options.sets):
        layers, truth = make_set(index, options.seed, options.repeating)
        started = time.process_time()
        try:
            placement = ts.find_places(layers, exact=True)
        except ts.TopoSeamError as error:
            kind, detail = "refused", str(error)
        else:
            found = [
                corners(layer.image.shape[:2], tuple(at), turn, scale)
                for layer, at, turn, scale in zip(
                    layers, placement.places, placement.turns, placement.scales, strict=True
                )
            ]
            distance = off(np.concatenate(found), np.concatenate(truth))
            kind, detail = "placed" if distance <= NEAR else "wrong", f"{distance:.3f} px off"
            offs.append(distance)
        seconds.append(time.process_time() - started)
        told[kind] += 1
        if options.each:
            print(f"{index:>3} {len(layers):>3} crops  {kind:<8}{seconds[-1]:>7.1f} s  {detail}", flush=True)
    print(", ".join(f"{count} {kind}" for kind, count in told.items()))
    if offs:
        print(f"off {np.median(offs):.3f} px in the median, {max(offs):.3f} at most", end="; ")
    print(f"{np.median(seconds):.1f} s of processor time a set in the median")


if __name__ == "__main__":
    print(stamp())
    main()
