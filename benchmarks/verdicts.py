"""Which seams verdicts name: 200 rendered ones, and those of pairs of photographs.

    python benchmarks/verdicts.py [--sheet seams.png] [FOLDER]

Rendered: two pictures that differ by a step are cut along a wavy line and not blended; 50 on plain ground, 50
in the dark, 25 of hue, 13 in noise, 12 whose grain ends, 50 in texture. The step is given as CIEDE2000 of the
mean colours. Eyes judge: --sheet draws the rendered ones at 100 %, those that are named with a mark in their
corner.

FOLDER holds ``sets/NAME/*`` and ``pairs/NAME_l.*``, ``pairs/NAME_r.*``, which the command joins. Places where
a fault of a seam was seen at 100 % are marks of this script; the other seams of these works were looked at,
too. A verdict is right if it names a place within 64 px of one of them, or none where none is. Breaks were
first measured on the works lpam and lpc; all thresholds were then set with all works in view, so that new
ones may fare worse.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image
from skimage import data
from skimage.color import deltaE_ciede2000, rgb2lab

import toposeam as ts
from finish import joined, works
from stamp import stamp

HEIGHT, WIDTH = 128, 160
#: Bounds of the steps that are counted together, CIEDE2000.
STEPS = (0, 0.6, 1, 1.5, 2.5, 100)
KINDS = {"plain": 50, "dark": 50, "hue": 25, "noise": 13, "grain": 12, "texture": 50}

#: Works with faults, and where these are seen, px of the picture that is written; px that are near.
SEEN = {
    "lpam1": ((699, 582),),  # a foot is missing
    "lpam15": ((559, 876), (645, 1068)),  # a hem, an edge of wood: steps of 3 px
    "lpam3": (
        (1094, 702),
        (1145, 737),
        (631, 303),
        (644, 384),
    ),  # a balustrade is cut, a ridge and a sill step
    "lpam5": ((677, 684),),  # stripes of another place
    "lpam7": ((761, 858), (656, 614), (637, 56), (665, 684)),  # joints step or end, a log, a crack
    "boat": ((2677, 2456), (4579, 2413)),  # ice ends in mid-water
    "exposure": ((1591, 126),),  # one half of the sky is greener
    "newspaper": ((1127, 931),),  # a thin line steps by a px or two
    "spw0": ((783, 564), (807, 591)),  # a white line steps
    "spw8": ((901, 265),),  # an edge steps
}
NEAR = 64


def seams(seed: int = 0) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield the kind, the two pictures and the label map of each rendered seam."""
    rng = np.random.default_rng(seed)
    textures = [getattr(data, name)() for name in ("brick", "grass", "gravel")]
    for kind, count in KINDS.items():
        for number in range(count):
            rows = np.arange(HEIGHT)[:, np.newaxis]
            wave = WIDTH / 2 + 12 * np.sin(rows / rng.uniform(8, 30) + rng.uniform(0, 6))
            cut = (np.arange(WIDTH) >= wave).astype(int)
            level = rng.uniform(8, 40) if kind == "dark" else rng.uniform(50, 220)
            a = np.full((HEIGHT, WIDTH, 3), level)
            step = np.full(3, rng.choice([-1, 1]) * rng.uniform(0.5, 8))
            if kind == "hue":
                step = np.zeros(3)
                step[rng.integers(3)] = rng.choice([-1, 1]) * rng.uniform(1, 12)
            if kind == "texture":
                picture = textures[number % 3]
                y, x = (
                    rng.integers(side - least) for side, least in zip(picture.shape, a.shape, strict=False)
                )
                a = picture[y : y + HEIGHT, x : x + WIDTH, np.newaxis] + np.zeros(3)
                step = 1.5 * step
            b = a + step
            if kind == "noise":
                spread = rng.uniform(1, 6)
                a, b = (one + rng.normal(0, spread, (HEIGHT, WIDTH, 1)) for one in (a, b))
            if kind == "grain":
                a, b = a + rng.normal(0, rng.uniform(0.3, 6), (HEIGHT, WIDTH, 1)), a
            a, b = (np.clip(np.round(one), 0, 255).astype(np.uint8) for one in (a, b))
            yield kind, a, b, cut


def rendered(sheet: Path | None) -> None:
    """Print the shares of rendered seams that are named, by kind and step."""
    named: dict[tuple[str, int], list[bool]] = {}
    tiles = []
    for kind, a, b, cut in seams():
        shown = np.where(cut[..., np.newaxis] > 0, b, a)
        verdict = ts.verdict(shown, cut, [a, b])
        colours = [rgb2lab(one.mean(axis=(0, 1)) / 255) for one in (a, b)]
        step = int(np.searchsorted(STEPS, float(deltaE_ciede2000(*colours)), side="right")) - 1
        named.setdefault((kind, step), []).append(not verdict.unseen)
        tile = np.pad(shown, ((2, 2), (2, 2), (0, 0)), constant_values=255)
        tile[2:10, 2:10] = (255, 0, 0) if not verdict.unseen else tile[2:10, 2:10]
        tiles.append(tile)
    heads = [f"{low}–{high}" for low, high in pairwise(STEPS)]
    print("named of all, by step (CIEDE2000)")
    print(f"{'':10}" + "".join(f"{head:>12}" for head in heads))
    for kind in KINDS:
        cells = [named.get((kind, k), []) for k in range(len(heads))]
        print(f"{kind:10}" + "".join(f"{f'{sum(one)} of {len(one)}' if one else '':>12}" for one in cells))
    if sheet is not None:
        rows = [np.concatenate(tiles[k : k + 10], axis=1) for k in range(0, len(tiles), 10)]
        Image.fromarray(np.concatenate(rows)).save(sheet)


def photographs(folder: Path, only: set[str]) -> None:
    """Print which works are named, and count rights and wrongs."""
    counts = dict.fromkeys(("clean", "clean named", "faulty", "faulty named", "named", "named rightly"), 0)
    print(f"\n{'work':28}{'worst likeness':>16}{'step':>8}  seen   said")
    with tempfile.TemporaryDirectory() as made:
        for name, files in works(folder, only):
            report, _ = joined(files, Path(made) / f"{name}.png", "fit")
            if report is None:
                print(f"{name:28} refused")
                continue
            place, marks = report["look_at"], SEEN.get(name, ())
            right = place is not None and any(math.dist(place, mark) < NEAR for mark in marks)
            counts["faulty" if marks else "clean"] += 1
            if place is not None:
                counts["faulty named" if marks else "clean named"] += 1
                counts["named"] += 1
                counts["named rightly"] += right
            print(
                f"{name:28}{report['worst_likeness']:16.2f}{report['step']:8.2f}  "
                f"{'fault' if marks else '':6} "
                f"{'no visible seam' if place is None else f'look at {place[0]},{place[1]}'}",
                flush=True,
            )
    print(
        f"\nnothing to be seen, and named: {counts['clean named']} of {counts['clean']}; faults named: "
        f"{counts['faulty named']} of {counts['faulty']}; of what is named, a fault is seen there: "
        f"{counts['named rightly']} of {counts['named']}"
    )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    print(stamp())
    rendered(given.sheet)
    if given.folder is not None:
        photographs(given.folder, set(filter(None, given.only.split(","))))


if __name__ == "__main__":
    main()
