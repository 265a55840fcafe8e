"""Guided textures: the share of pixels that show something else than was painted.

    python benchmarks/guides.py                    weights 0.5, 0.8 (the default), 0.9 and 1
    python benchmarks/guides.py --sheet guides.png

*Peel to potato* and *rice to face* are guided by tones; a pixel is wrong where the tone there, a mean over a
grain or two, is more than a quarter of the sample's range off. *Heart of smoke*, *road* and *disc* are drawn
regions, each with a sample of its own; a pixel is wrong where it comes from the other sample.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import skimage.data
from PIL import Image
from scipy import ndimage

import toposeam as ts
from stamp import stamp
from texture_samples import MAKERS, SIDE, noise, shaded
from written import write_table

FAR = 0.25


@dataclass(frozen=True, kw_only=True, eq=False)
class Guided:
    """A texture to be laid: samples, what they stand for, and what is wanted (H, W)."""

    samples: Sequence[np.ndarray]
    stand_for: Sequence[np.ndarray]
    wanted: np.ndarray

    def laid(self, weight: float, seed: int) -> tuple[np.ndarray, float]:
        """The texture, and the share of it that is wrong."""
        made = ts.synthesize(
            list(self.samples),
            self.wanted.shape,
            guide=self.wanted,
            guide_source=list(self.stand_for),
            guide_weight=weight,
            seed=seed,
        )
        rows, columns = made.source[..., 0], made.source[..., 1]
        shown = np.choose(
            made.exemplar, [one[rows % SIDE, columns % SIDE] for one in map(np.asarray, self.stand_for)]
        )
        return made.image, float((np.abs(shown - self.wanted) > FAR).mean())


def toned(sample: np.ndarray, grain: float, wanted: np.ndarray) -> Guided:
    """One sample, guided by its tones; what is wanted is brought into their range."""
    soft = ndimage.gaussian_filter(np.atleast_3d(sample).mean(axis=2), grain)
    low, high = np.percentile(soft, (1, 99))
    wanted = ndimage.gaussian_filter(wanted.astype(float), grain)
    darkest, lightest = np.percentile(wanted, (1, 99))
    return Guided(
        samples=[sample],
        stand_for=[((soft - low) / (high - low)).clip(0, 1)],
        wanted=((wanted - darkest) / (lightest - darkest)).clip(0, 1),
    )


def drawn(ground: np.ndarray, other: np.ndarray, where: np.ndarray) -> Guided:
    """Two samples and a drawing of regions."""
    none = np.zeros(ground.shape[:2])
    return Guided(samples=[ground, other], stand_for=[none, none + 1], wanted=where.astype(float))


def grains() -> np.ndarray:
    """Rice, thick in places and thin in others, on a dark ground."""
    rng = np.random.default_rng(3)
    density = noise(5, 14.0)
    picture, fine = np.full((2 * SIDE, 2 * SIDE), 40.0), np.mgrid[: 2 * SIDE, : 2 * SIDE]
    for _ in range(2600):
        y, x = rng.uniform(0, 2 * SIDE, 2)
        if density[int(y) // 2, int(x) // 2] < rng.normal(0, 0.6):
            continue
        turn, light = rng.uniform(0, np.pi), rng.uniform(175, 235)
        dy, dx = fine[0] - y, fine[1] - x
        along, across = dx * np.cos(turn) + dy * np.sin(turn), dy * np.cos(turn) - dx * np.sin(turn)
        shape = (along / 11) ** 2 + (across / 3.6) ** 2
        picture = np.where(shape < 1, light * (1 - 0.35 * shape), picture)
    small = ndimage.zoom(ndimage.gaussian_filter(picture, 0.8), 0.5, order=1)
    return shaded((small / 255).clip(0, 1), (0, 0, 0), (150, 140, 120), (255, 252, 244))


def peel() -> np.ndarray:
    """An orange's, lit from one side: a grain of pores on slow light."""
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE - 0.5
    light = 0.55 + 0.7 * x - 0.3 * y + 0.06 * noise(8, 2.0)
    return shaded(light.clip(0, 1), (110, 40, 0), (235, 120, 10), (255, 205, 110))


def potato(side: int = 320) -> np.ndarray:
    """A lit one before a dark ground."""
    y, x = np.mgrid[:side, :side] / side - 0.5
    inside = (x / 0.42) ** 2 + ((y + 0.1 * x) / 0.3) ** 2
    return np.where(inside < 1, 0.25 + 0.75 * np.sqrt((1 - inside).clip(0, 1)) * (0.75 - 0.5 * x), 0.0)


def face() -> np.ndarray:
    """Eileen Collins, by NASA, in gray."""
    crop = Image.fromarray(skimage.data.astronaut()[0:300, 90:390]).convert("L")
    return np.asarray(crop.resize((320, 320), Image.Resampling.LANCZOS)) / 255


def smoke(seed: int, *colours: tuple[int, int, int]) -> np.ndarray:
    return shaded((0.5 + 0.22 * noise(seed, 3.0, 12.0)).clip(0, 1), *colours)


def heart(side: int = 320) -> np.ndarray:
    y, x = (np.mgrid[:side, :side] / side - 0.5) * 2.6
    y = -y + 0.1
    return (x**2 + y**2 - 1) ** 3 - x**2 * y**3 < 0


def road(side: int = 320) -> np.ndarray:
    y, x = np.mgrid[:side, :side]
    return np.abs(x - side / 2 - 60 * np.sin(y / 50)) < 24


def disc(side: int = 320) -> np.ndarray:
    y, x = np.mgrid[:side, :side]
    return np.hypot(y - 120, x - 200) < side * np.sqrt(0.05 / np.pi)


def meadow() -> np.ndarray:
    return MAKERS["mushrooms"]()[0]


def gravel() -> np.ndarray:
    return shaded(skimage.data.gravel()[:SIDE, :SIDE] / 255, (40, 38, 36), (220, 214, 205))


GUIDED: dict[str, Callable[[], Guided]] = {
    "peel to potato": lambda: toned(peel(), 3, potato()),
    "rice to face": lambda: toned(grains(), 5, face()),
    "heart of smoke": lambda: drawn(
        smoke(1, (20, 24, 60), (60, 80, 160)), smoke(2, (150, 20, 30), (255, 190, 170)), heart()
    ),
    "road through a meadow": lambda: drawn(meadow(), gravel(), road()),
    "disc of 5 %": lambda: drawn(MAKERS["grass"](), MAKERS["gravel"](), disc()),
}


def main() -> None:
    """Print a table, and draw a sheet of the textures of the first seed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--weights", type=float, nargs="+", default=[0.5, 0.8, 0.9, 1.0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--write", action="store_true", help="into docs/texture.md")
    given = parser.parse_args()
    print(stamp())
    table = [["wrong, %", *(f"weight {weight:g}" for weight in given.weights)]]
    rows = []
    for name, make in GUIDED.items():
        task = make()
        line, row = [name], []
        for weight in given.weights:
            made = [task.laid(weight, seed) for seed in range(given.seeds)]
            wrong = 100 * np.array([share for _, share in made])
            line.append(f"{wrong.mean():.1f}, {wrong.max():.1f}")
            row.append(np.broadcast_to(np.atleast_3d(made[0][0]), (*task.wanted.shape, 3)))
        wanted = np.repeat(np.rint(255 * task.wanted).astype(np.uint8)[..., None], 3, axis=2)
        rows.append(np.hstack([wanted, *row]))
        table.append(line)
        print(" | ".join(line), flush=True)
    if given.sheet:
        Image.fromarray(np.vstack(rows)).save(given.sheet)
    if given.write:
        write_table("texture.md", "benchmarks/guides.py", table)


if __name__ == "__main__":
    main()
