"""Which seams verdicts name: 200 rendered ones, and those of pairs of photographs.

    python benchmarks/verdicts.py [--sheet seams.png] [FOLDER]

Rendered: two pictures that differ by a step are cut along a wavy line and not blended; 50 on plain ground, 50
in the dark, 25 of hue, 13 in noise, 12 whose grain ends, 50 in texture. The step is given as CIEDE2000 of the
mean colours. FOLDER has pairs NAME_l.*, NAME_r.*, which are stitched as the command line does; a line says
whether likeness or the step names each. Eyes judge: --sheet draws the rendered ones at 100 %, those that are
named with a mark in their corner.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image
from skimage import data
from skimage.color import deltaE_ciede2000, rgb2lab

import toposeam as ts
from stamp import stamp

HEIGHT, WIDTH = 128, 160
#: Bounds of the steps that are counted together, CIEDE2000.
STEPS = (0, 0.6, 1, 1.5, 2.5, 100)
KINDS = {"plain": 50, "dark": 50, "hue": 25, "noise": 13, "grain": 12, "texture": 50}


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


def photographs(folder: Path) -> None:
    """Print what names the seam of each pair of photographs, and what steps cost."""
    print(f"\n{'pair':28}{'worst likeness':>16}{'step':>8}  named by        s   of which steps")
    for left in sorted(folder.glob("*_l.*")):
        right = left.with_name(left.name.replace("_l.", "_r."))
        pictures = [np.asarray(Image.open(path).convert("RGB")) for path in (left, right)]
        began = time.process_time()
        try:
            made = ts.stitch(pictures)
        except ts.TopoSeamError as error:
            print(f"{left.stem[:-2]:28}{str(error)[:80]}")
            continue
        made.figures()
        joined = time.process_time()
        verdict = made.verdict
        done = time.process_time()
        if verdict is None:
            continue
        by = [word for word, seen in (("likeness", verdict.worst < 0.5), ("step", verdict.step > 1)) if seen]
        print(
            f"{left.stem[:-2]:28}{verdict.worst:16.2f}{verdict.step:8.2f}  {' '.join(by):14}"
            f"{joined - began:6.1f}{done - joined:8.2f}   {verdict}",
            flush=True,
        )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--sheet", type=Path)
    given = parser.parse_args()
    print(stamp())
    rendered(given.sheet)
    if given.folder is not None:
        photographs(given.folder)


if __name__ == "__main__":
    main()
