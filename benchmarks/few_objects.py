"""Objects few, large, of two sizes, or cut: ``python benchmarks/few_objects.py [sheet.png [rows …]]``.

Twenty samples of 1 to 10 objects of radius 8 to 40 px (daisies, mushrooms, stones, photographed coins) on
grass, gravel and paper, grown with the settings that `synth` chooses. Counted are the objects that lie within
the texture: whole is a copy of at least 95 % of one that is whole in its sample; any other copy of at least
12 px is a shard. The last columns compare, for the larger and the smaller half, how much of the texture and
of the sample objects cover, cut ones too.
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
from whole_objects import FINE, drawn

#: Kind, ground, and radius, px, number of whole and of cut ones of each size; the seed is the row.
MEADOWS = (
    ("mushroom", "grass", ((24, 4, 0),)),
    ("mushroom", "grass", ((40, 1, 0),)),
    ("mushroom", "grass", ((30, 2, 2),)),
    ("daisy", "grass", ((16, 7, 0),)),
    ("daisy", "grass", ((8, 10, 0),)),
    ("daisy", "grass", ((26, 1, 0), (9, 6, 0))),
    ("daisy", "grass", ((34, 0, 2),)),
    ("daisy", "grass", ((28, 0, 2), (10, 6, 0))),
    ("daisy", "grass", ((20, 0, 1),)),
    ("daisy", "paper", ((22, 3, 2),)),
    ("stone", "gravel", ((32, 2, 0), (12, 5, 0))),
    ("stone", "gravel", ((36, 0, 1), (14, 5, 0))),
    ("stone", "grass", ((26, 3, 2),)),
    ("stone", "grass", ((12, 8, 2),)),
    ("stone", "paper", ((40, 1, 1),)),
    ("coin", "grass", ((26, 4, 0),)),
    ("coin", "gravel", ((22, 3, 1), (12, 4, 0))),
    ("coin", "paper", ((30, 2, 1),)),
    ("coin", "paper", ((14, 6, 2),)),
    ("mushroom", "paper", ((20, 3, 0), (10, 5, 1))),
)
#: Sides of sample and texture, px.
SIDE, GROWN = 192, 448
#: Middle and radius, px, of coins in the photograph.
COINS = ((53, 106, 27), (50, 168, 24), (118, 50, 22), (265, 43, 25), (268, 99, 20))


def spread(
    rng: np.random.Generator, sizes: tuple[tuple[int, int, int], ...]
) -> list[tuple[float, float, int]]:
    """Middles and radii of objects that do not touch, the largest first."""
    places: list[tuple[float, float, int]] = []
    for radius, whole, cut in sizes:
        for number in range(whole + cut):
            for _ in range(20000):
                x, y = rng.uniform(radius + 4, SIDE - radius - 4, 2)
                if number >= whole:  # a side, and how far beyond it the middle may lie
                    off = rng.uniform(-0.4, 0.4) * radius
                    x, y = ((off, y), (SIDE - off, y), (x, off), (x, SIDE - off))[rng.integers(4)]
                if all(np.hypot(x - a, y - b) > radius + r + 6 for a, b, r in places):
                    places.append((float(x), float(y), radius))
                    break
    return places


def ground_of(kind: str, rng: np.random.Generator) -> np.ndarray:
    top, left = rng.integers(0, 512 - SIDE, 2)
    window = np.s_[top : top + SIDE, left : left + SIDE]
    if kind == "grass":
        return shaded(skimage.data.grass()[window] / 255, (18, 40, 10), (74, 116, 34), (190, 214, 120))
    if kind == "gravel":
        return shaded(skimage.data.gravel()[window] / 255, (40, 38, 36), (120, 112, 100), (200, 196, 188))
    noise = ndimage.gaussian_filter(rng.normal(0, 1, (SIDE, SIDE)), 1.5)
    return shaded(0.5 + 0.5 * noise, (198, 188, 168), (216, 206, 186), (232, 224, 206))


def meadow(
    kind: str, ground: str, sizes: tuple[tuple[int, int, int], ...], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """A sample, and the number of the object at each of its pixels."""
    rng = np.random.default_rng(seed)
    picture = Image.fromarray(ground_of(ground, rng)).resize((SIDE * FINE,) * 2, Image.Resampling.BICUBIC)
    where = Image.new("L", picture.size)
    for x, y, radius in spread(rng, sizes):
        placed(picture, where, kind, x * FINE, y * FINE, radius * FINE, rng)
    image, there = (np.asarray(one.resize((SIDE, SIDE), Image.Resampling.BOX)) for one in (picture, where))
    return image, ndimage.label(there > 100)[0]


def placed(
    picture: Image.Image,
    where: Image.Image,
    kind: str,
    x: float,
    y: float,
    radius: float,
    rng: np.random.Generator,
) -> None:
    pens = ImageDraw.Draw(picture), ImageDraw.Draw(where)
    if kind == "mushroom":
        for pen, plain in zip(pens, (False, True), strict=True):
            drawn(pen, x, y, radius / 14, plain=plain)
    elif kind == "daisy":
        first, petals = rng.uniform(0, 1), rng.integers(9, 14)
        for k in range(petals):
            angle = 2 * np.pi * (k + first) / petals
            along = np.linspace(0.25, 1, 12) * radius
            wide = 0.2 * radius * np.sin(np.pi * np.linspace(0.1, 0.97, 12))
            back = np.stack([along, wide], 1), np.stack([along, -wide], 1)[::-1]
            turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            corners = [tuple(one) for one in (np.concatenate(back) @ turn + (x, y)).tolist()]
            shade = int(rng.integers(225, 256))
            pens[0].polygon(corners, fill=(shade, shade, shade - 12))
            pens[1].polygon(corners, fill=255)
        for pen, fill in zip(pens, ((232, 178, 30), 255), strict=True):
            r = 0.32 * radius
            pen.ellipse([x - r, y - r, x + r, y + r], fill=fill)
    else:
        side = 2 * round(radius) + 1
        v, u = np.mgrid[-1 : 1 : side * 1j, -1 : 1 : side * 1j]
        if kind == "coin":
            row, column, r = COINS[rng.integers(len(COINS))]
            cut = skimage.data.coins()[row - r : row + r + 1, column - r : column + r + 1]
            gray = np.asarray(Image.fromarray(cut).resize((side, side), Image.Resampling.BICUBIC)) / 255
            face, shape = shaded(gray, (40, 24, 8), (176, 120, 60), (255, 226, 170)), np.hypot(u, v) < 0.97
        else:
            bumps = sum(
                rng.uniform(0, 0.3) / k * np.cos(k * np.arctan2(v, u) + rng.uniform(0, 6)) for k in (2, 3, 5)
            )
            shape = np.hypot(u, v) < 0.8 * (1 + 0.6 * bumps)
            grain = ndimage.gaussian_filter(rng.normal(0, 1, u.shape), FINE) * FINE
            face = shaded(
                np.clip(0.55 - 0.3 * v - 0.2 * u + 0.08 * grain, 0, 1),
                (52, 56, 70),
                (158, 162, 176),
                (232, 236, 246),
            )
        mask = Image.fromarray((255 * shape).astype(np.uint8))
        at = round(x - radius), round(y - radius)
        picture.paste(Image.fromarray(face), at, mask)
        where.paste(255, at, mask)


def counted(made: ts.texture.Synthesis, objects: np.ndarray) -> tuple[list[int], list[tuple[slice, slice]]]:
    """The areas of the whole objects within a texture, and where its shards are."""
    boxes, areas = ndimage.find_objects(objects), np.bincount(objects.ravel())
    size = np.array(made.labels.shape)
    inner = [
        all(side.start > 0 and side.stop < length for side, length in zip(box, objects.shape, strict=True))
        for box in boxes
    ]
    shown = objects[made.source[..., 0], made.source[..., 1]]
    at = np.argwhere(shown > 0)
    number = shown[shown > 0]
    kinds, of, counts = np.unique(
        np.column_stack([number, at - made.source[shown > 0]]),
        axis=0,
        return_inverse=True,
        return_counts=True,
    )
    whole, shards = [], []
    for k, ((one, *shift), count) in enumerate(zip(kinds.tolist(), counts.tolist(), strict=True)):
        box = boxes[one - 1]
        first = np.array([side.start for side in box]) + shift
        last = np.array([side.stop for side in box]) + shift
        if inner[one - 1] and ((first <= 0).any() or (last >= size).any()):
            continue
        pixels = at[of.ravel() == k]
        if inner[one - 1] and count >= 0.95 * areas[one]:
            whole.append(int(areas[one]))
        elif count >= 12 and (inner[one - 1] or not ((pixels == 0) | (pixels == size - 1)).any()):
            low, high = pixels.min(0), pixels.max(0) + 1
            shards.append((slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))))
    return whole, shards


def main() -> None:
    print(stamp())
    sheets, all_whole, all_shards = [], 0, 0
    rows = [int(one) for one in sys.argv[2:]] or range(len(MEADOWS))
    for row in rows:
        kind, ground, sizes = MEADOWS[row]
        image, objects = meadow(kind, ground, sizes, row)
        made = ts.synth(image, GROWN, seed=row)
        whole, shards = counted(made, objects)
        areas = np.bincount(objects.ravel())[1:]
        inner = [
            area
            for area, box in zip(areas.tolist(), ndimage.find_objects(objects), strict=True)
            if all(side.start > 0 and side.stop < SIDE for side in box)
        ]
        shown = objects[made.source[..., 0], made.source[..., 1]]
        middle = (min(inner) + max(inner)) / 2 if inner else 0
        covers = []
        for large in (True, False):
            kinds = [k for k, area in enumerate(areas.tolist(), 1) if (area >= middle) == large]
            there = any((one >= middle) == large for one in inner)
            given = float(np.isin(objects, kinds).mean()) if there else 0
            grown = float(np.isin(shown, kinds).mean())
            covers.append(f"{grown / given:5.2f}" if given else "    –")
        all_whole, all_shards = all_whole + len(whole), all_shards + len(shards)
        words = ", ".join(f"{w} + {c} cut of {r}" for r, w, c in sizes)
        print(
            f"{row:2} {kind:8} on {ground:6} {words:28} {made.settings['setting']!s:12} "
            f"patch {made.patch[0]:3}: "
            f"{len(whole):3} whole {len(shards):3} shards, cover ÷ the sample's {' '.join(covers)}",
            flush=True,
        )
        sheets.append((image, framed(made.image, shards)))
    print(f"{all_whole}/{all_whole + all_shards} whole ({all_whole / max(all_whole + all_shards, 1):.1%})")
    if len(sys.argv) > 1:
        sheet_of(sheets, 5).save(sys.argv[1])


if __name__ == "__main__":
    main()
