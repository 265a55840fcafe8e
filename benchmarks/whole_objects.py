"""Mushrooms that stay whole in grown meadows: ``python benchmarks/whole_objects.py [sheet.png]``.

Ten samples like the mushrooms of texture_samples.py, but of other sizes, with other mushrooms at other
places, in five of them also cut by the border, are grown to textures of other sizes. Counted are those off
the border of the texture: whole are those of a sample's size, ± 10 % and 3 px, and, where some touch, copies
of at least nine tenths of a whole one. The sheet shows samples and textures, and a red box round each
mushroom that is not whole.
"""

from __future__ import annotations

import sys

import numpy as np
import skimage.data
from PIL import Image, ImageDraw
from scipy import ndimage

import toposeam as ts
from sheets import framed, sheet_of
from stamp import stamp
from texture_samples import shaded

#: Sides of a sample and of its texture, px, and the size of its mushrooms; the seed is the row.
MEADOWS = (
    (192, 512, 1.5),
    (150, 400, 1.1),
    (220, 480, 1.8),
    (256, 640, 1.5),
    (180, 560, 1.3),
    (200, 450, 1.6),
    (240, 600, 2.0),
    (160, 512, 1.2),
    (256, 500, 1.3),
    (210, 540, 1.7),
)
FINE = 4


def meadow(side: int, scale: float, seed: int, cut: bool) -> tuple[np.ndarray, np.ndarray]:
    """A sample, and the number of the mushroom at each of its pixels."""
    rng = np.random.default_rng(seed)
    off = -4.0 * scale if cut else 16.0 * scale
    places: list[tuple[float, float]] = []
    for _ in range(4000):
        x, y = rng.uniform(off, side - off, 2)
        if all(np.hypot(x - a, y - b) > 36 * scale for a, b in places):
            places.append((float(x), float(y)))
        if len(places) >= 0.25 * (side / (16 * scale)) ** 2:
            break
    top, left = rng.integers(0, 500 - side, 2)
    grass = skimage.data.grass()[top : top + side, left : left + side] / 255
    ground = shaded(grass, (18, 40, 10), (74, 116, 34), (190, 214, 120))
    picture = Image.fromarray(ground).resize((side * FINE, side * FINE), Image.Resampling.BICUBIC)
    where = Image.new("L", (side * FINE, side * FINE))
    for x, y in places:
        drawn(ImageDraw.Draw(picture), x * FINE, y * FINE, scale * FINE, plain=False)
        drawn(ImageDraw.Draw(where), x * FINE, y * FINE, scale * FINE, plain=True)
    image, there = (np.asarray(one.resize((side, side), Image.Resampling.BOX)) for one in (picture, where))
    return image, ndimage.label(there > 100)[0]


def drawn(pen: ImageDraw.ImageDraw, x: float, y: float, unit: float, *, plain: bool) -> None:
    stalk, cap, spot = (255,) * 3 if plain else ((236, 226, 205), (178, 42, 30), (246, 240, 228))
    pen.rounded_rectangle([x - 4 * unit, y - 2 * unit, x + 4 * unit, y + 13 * unit], 3 * unit, fill=stalk)
    pen.chord([x - 13 * unit, y - 14 * unit, x + 13 * unit, y + 10 * unit], 180, 360, fill=cap)
    for dx, dy, r in ((-6, -6, 2), (1, -9, 2.4), (7, -5, 1.8), (-1, -4, 1.6)):
        pen.ellipse(
            [x + (dx - r) * unit, y + (dy - r) * unit, x + (dx + r) * unit, y + (dy + r) * unit], fill=spot
        )


def counted(made: ts.texture.Synthesis, objects: np.ndarray) -> tuple[int, list[tuple[slice, slice]]]:
    """How many mushrooms off the border there are, and where those are that are not whole."""
    given = ndimage.find_objects(objects)
    areas = np.bincount(objects.ravel())
    side, size = len(objects), len(made.image)
    inner = [k + 1 for k, box in enumerate(given) if all(one.start > 0 and one.stop < side for one in box)]
    area = float(np.median(areas[inner]))
    extent = np.median([[one.stop - one.start for one in given[k - 1]] for k in inner], axis=0)
    shown = objects[made.source[..., 0], made.source[..., 1]]
    pieces, _ = ndimage.label(shown > 0)
    total, broken = 0, []
    for number, box in enumerate(ndimage.find_objects(pieces), start=1):
        here = pieces[box] == number
        share = np.count_nonzero(here) / area
        if share < 0.05 or any(one.start == 0 or one.stop == size for one in box):
            continue
        spans = np.array([one.stop - one.start for one in box])
        if abs(share - 1) <= 0.1 and (np.abs(spans - extent) <= 3).all():
            total += 1
            continue
        # Several that touch are whole where each is one copy of a whole one.
        moved = made.source[box] - np.stack(np.mgrid[box], axis=2)
        kinds, counts = np.unique(
            np.column_stack([shown[box][here], moved[here]]), axis=0, return_counts=True
        )
        copies = counts >= 0.05 * area
        whole = np.isin(kinds[:, 0], inner) & (counts >= 0.9 * areas[kinds[:, 0]])
        total += int(np.count_nonzero(copies))
        broken += [box] * int(np.count_nonzero(copies & ~whole))
    return total, broken


def main() -> None:
    print(stamp())
    shown, all_whole, all_total = [], 0, 0
    for seed, (side, size, scale) in enumerate(MEADOWS):
        image, objects = meadow(side, scale, seed, seed % 2 == 1)
        made = ts.synth(image, size, seed=seed, setting="varied")
        total, broken = counted(made, objects)
        all_whole, all_total = all_whole + total - len(broken), all_total + total
        print(
            f"{seed} {side:4} → {size:4} px, {objects.max():3} mushrooms of {32 * scale:.0f} px"
            f"{', cut by the border too' if seed % 2 else '':24} patch {made.patch[0]:3}: "
            f"{total - len(broken)}/{total} whole",
            flush=True,
        )
        shown.append((image, framed(made.image, broken)))
    print(f"{all_whole}/{all_total} whole ({all_whole / all_total:.1%})")
    if len(sys.argv) > 1:
        sheet_of(shown, 2).save(sys.argv[1])


if __name__ == "__main__":
    main()
