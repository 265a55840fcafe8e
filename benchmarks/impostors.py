"""Pictures that do not belong together, and such that lie turned: what does ``toposeam.find_places`` join?

    python benchmarks/impostors.py FOLDER                 the whole table
    python benchmarks/impostors.py FOLDER --only same,halves
    python benchmarks/impostors.py FOLDER --keep OUT      with pictures of what is joined

Real photographs lie in FOLDER as ``sets/NAME/*`` and ``pairs/NAME_l.jpg``, ``pairs/NAME_r.jpg``; they are
reduced to 800 px. Nothing is said about them. Made of them are:

* *same*: 40 pairs of photographs of different scenes in which something is the same at the same place: a
  textured frame, a menu with a tool bar, bars in windows of different sizes, a bar and a panel, a logo in a
  corner, a date stamp, a caption below a page, the mount of a slide;
* *halves*: the left and the right 47 % of 45 photographs, which share no pixel;
* *strangers*: 70 pairs of photographs of different scenes;
* *true*: the sets and pairs themselves;
* *turned*: each set and pair with one picture, any one, turned by 90, 180 and 270° in its pixels. Joined, it
  is compared with what is joined without the turn, by SSIM, in each of four orientations.

Of *same*, *halves* and *strangers* none should be joined, of *true* all with every picture. Of *turned* is
counted what looks the same (SSIM above 0.99) as it lies, and in some orientation: of two pictures one of
which lies turned, the camera's way and the light say which, and the light may come from below.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageOps
from skimage.metrics import structural_similarity

import toposeam as ts
from stamp import stamp

PICTURES = {".jpg", ".jpeg", ".png", ".tif", ".tiff"}
#: px of the longer side.
SIDE = 800
SAME, HALVES, STRANGERS = 40, 45, 70
#: Share of a picture's width that each half keeps.
HALF = 0.47
ALIKE = 0.99
TURNS = (90, 180, 270)

Pixels = np.ndarray
Sets = dict[str, list[Pixels]]


def read(path: Path) -> Pixels:
    with Image.open(path) as opened:
        picture = ImageOps.exif_transpose(opened).convert("RGB")
    picture.thumbnail((SIDE, SIDE), Image.Resampling.LANCZOS)
    return np.asarray(picture)


def sets_of(folder: Path) -> Sets:
    """All sets and pairs, by name."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.glob("sets/*/*")):
        if path.suffix.lower() in PICTURES:
            found.setdefault(path.parent.name, []).append(path)
    for path in sorted(folder.glob("pairs/*")):
        if path.suffix.lower() in PICTURES:
            found.setdefault(path.stem.rpartition("_")[0], []).append(path)
    return {name: [read(path) for path in paths] for name, paths in found.items() if len(paths) > 1}


# What is the same in both.


def drawn_bar(rng: np.random.Generator, width: int, height: int) -> Image.Image:
    """A menu with words above a row of icons."""
    bar = Image.new("RGB", (width, height), (236, 236, 238))
    draw = ImageDraw.Draw(bar)
    words = ("File", "Edit", "View", "Insert", "Format", "Tools", "Window", "Help", "Layers", "Filter")
    for number, word in enumerate(rng.permutation(words)):
        draw.text((8 + 52 * number, 3), word, fill=(30, 30, 30))
    for left in range(8, width - 30, 34):
        box = (left, 22, left + 24, height - 5)
        draw.rectangle(box, outline=(90, 90, 90), fill=tuple(rng.integers(120, 250, 3).tolist()))
        for _ in range(4):
            points = rng.integers([left + 2, 24], [left + 22, height - 7], (2, 2))
            draw.line([tuple(one) for one in points.tolist()], fill=tuple(rng.integers(0, 200, 3).tolist()))
    return bar


def framed(picture: Image.Image, texture: Image.Image, border: int, stretched: bool) -> Image.Image:
    """A textured frame; stretched with the picture, or as wide everywhere."""
    size = (picture.width + 2 * border, picture.height + 2 * border)
    frame = texture.resize(size) if stretched else texture.resize((1100, 1100)).crop((0, 0, *size))
    frame.paste(picture, (border, border))
    return frame


def with_the_same(kind: str, rng: np.random.Generator, a: Pixels, b: Pixels, other: Pixels) -> list[Pixels]:
    """Two photographs with the same addition, which is made of a third one or drawn."""
    seed = int(rng.integers(1 << 31))
    texture, made = Image.fromarray(other), []
    for number, pixels in enumerate((a, b)):
        rng = np.random.default_rng(seed)
        picture = Image.fromarray(pixels)
        if kind == "windows":  # of different sizes
            picture = picture.resize((720, 560) if number else (800, 600))
        elif kind != "frame stretched":
            picture = picture.resize((800, 600))
        width, height = picture.size
        if kind in ("frame", "frame stretched"):
            picture = framed(picture, texture, 60, kind == "frame stretched")
        elif kind in ("bars", "windows", "panel"):
            whole = Image.new("RGB", (width, height), (255, 255, 255))
            whole.paste(picture, (0, 56))
            whole.paste(drawn_bar(rng, 900, 56).crop((0, 0, width, 56)), (0, 0))
            if kind == "panel":
                panel = drawn_bar(rng, 600, 120).rotate(90, expand=True)
                whole.paste(panel.crop((0, 0, 120, height - 56)), (width - 120, 56))
            picture = whole
        elif kind == "logo":
            picture.paste(texture.resize((150, 110)), (width - 160, height - 120))
        elif kind == "date":
            ImageDraw.Draw(picture).text(
                (width - 210, height - 50), "2024:05:17 14:32", (255, 140, 20), font_size=24
            )
        elif kind == "caption":
            whole = Image.new("RGB", (width, height + 90), (250, 248, 240))
            whole.paste(picture, (0, 0))
            text = "Plate of the survey, printed in the year 1911\nReproduced with kind permission, No. 7"
            ImageDraw.Draw(whole).text((20, height + 12), text, (40, 30, 30), font_size=26)
            picture = whole
        made.append(np.asarray(picture))
    return made


KINDS = ("frame", "frame stretched", "bars", "windows", "panel", "logo", "date", "caption")


def same(sets: Sets, rng: np.random.Generator) -> Iterator[tuple[str, list[Pixels]]]:
    for number in range(SAME):
        names = rng.choice(list(sets), 3, replace=False)
        kind = KINDS[number % len(KINDS)]
        yield f"{kind}: {names[0]}, {names[1]}", with_the_same(kind, rng, *(sets[name][0] for name in names))


def halves(sets: Sets, rng: np.random.Generator) -> Iterator[tuple[str, list[Pixels]]]:
    pictures = [(name, one) for name, several in sets.items() for one in several[:2]]
    for number in rng.permutation(len(pictures))[:HALVES]:
        name, pixels = pictures[number]
        width = round(HALF * pixels.shape[1])
        yield name, [pixels[:, :width], pixels[:, -width:]]


def strangers(sets: Sets, rng: np.random.Generator) -> Iterator[tuple[str, list[Pixels]]]:
    for _ in range(STRANGERS):
        names = rng.choice(list(sets), 2, replace=False)
        yield ", ".join(names), [sets[name][int(rng.integers(len(sets[name])))] for name in names]


# What is found.


def placement_of(pictures: list[Pixels]) -> Any:
    """The placement, or the error that says why there is none."""
    layers = [ts.Layer(pixels, name=f"picture {number}") for number, pixels in enumerate(pictures)]
    try:
        return ts.find_places(layers)
    except ts.TopoSeamError as error:
        return error


def joined(found: Any) -> Pixels:
    """The pictures as one, 8 bit with opacity."""
    stitched = ts.stitch(found.layers, wrap=found.wrap)
    image, alpha = np.asarray(stitched.image), stitched.alpha
    opaque = np.full(image.shape[:2], 255, np.uint8) if alpha is None else np.asarray(alpha)
    return np.dstack([image, opaque])


def similarity(a: Pixels, b: Pixels) -> float:
    """SSIM of what two results show, laid upon each other by their upper left corners."""
    height, width = (min(one.shape[axis] for one in (a, b)) for axis in (0, 1))
    if max(abs(a.shape[axis] - b.shape[axis]) for axis in (0, 1)) > 0.02 * max(height, width):
        return 0.0
    first, second = (np.where(one[..., 3:] > 0, one[..., :3], 0)[:height, :width] for one in (a, b))
    return float(structural_similarity(first, second, channel_axis=2))


def impostors(kind: str, cases: Iterator[tuple[str, list[Pixels]]], keep: Path | None) -> None:
    count, wrong, told, seconds = 0, 0, 0, 0.0
    for name, pictures in cases:
        started = time.process_time()
        found = placement_of(pictures)
        seconds += time.process_time() - started
        count += 1
        if isinstance(found, ts.TopoSeamError):
            continue
        wrong += 1
        told += bool(found.doubts)
        print(f"    joined: {name} ({found.model}; {'; '.join(map(str, found.doubts))})", flush=True)
        if keep is not None:
            Image.fromarray(joined(found)).save(keep / f"{kind}-{count}.png")
    print(
        f"{kind:<12}{count:>4} cases, {wrong} joined, {told} of them with doubts, {seconds:.0f} s", flush=True
    )


def true(sets: Sets) -> None:
    lost, seconds = [], 0.0
    for name, pictures in sets.items():
        started = time.process_time()
        found = placement_of(pictures)
        seconds += time.process_time() - started
        if isinstance(found, ts.TopoSeamError):
            lost.append(f"{name}: {found}")
        elif len(found.numbers) < len(pictures):
            lost.append(f"{name}: {'; '.join(found.left_out.values())}")
        elif found.doubts:
            print(f"    {name}: {'; '.join(map(str, found.doubts))}")
    for line in lost:
        print(f"    lost: {line}")
    print(f"{'true':<12}{len(sets):>4} sets, {len(lost)} lost, {seconds:.0f} s", flush=True)


def turned(sets: Sets, rng: np.random.Generator, keep: Path | None) -> None:
    count, alike, anyhow = 0, 0, 0
    for name, pictures in sets.items():
        plain = placement_of(pictures)
        if isinstance(plain, ts.TopoSeamError):
            continue
        wanted = joined(plain)
        if keep is not None:
            Image.fromarray(wanted).save(keep / f"turned-{name}-0.png")
        which = int(rng.integers(len(pictures)))
        for turn in TURNS:
            other = [*pictures]
            other[which] = np.rot90(pictures[which], turn // 90)
            found = placement_of(other)
            count += 1
            if isinstance(found, ts.TopoSeamError):
                print(f"    {name} {turn}: {found}", flush=True)
                continue
            result = joined(found)
            values = [similarity(np.rot90(result, quarter), wanted) for quarter in range(4)]
            alike += values[0] > ALIKE
            anyhow += max(values) > ALIKE
            if values[0] <= ALIKE:
                told = ", ".join(f"{value:.3f}" for value in values)
                print(f"    {name}, picture {which} by {turn}: SSIM {told}", flush=True)
                if keep is not None:
                    Image.fromarray(result).save(keep / f"turned-{name}-{turn}.png")
    told = f"{alike} as unturned, {anyhow} in some orientation"
    print(f"{'turned':<12}{count:>4} cases, {told}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="true,same,halves,strangers,turned")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="where to write pictures")
    given = parser.parse_args()
    if given.keep is not None:
        given.keep.mkdir(parents=True, exist_ok=True)
    print(stamp())
    sets = sets_of(given.folder)
    makers = {"same": same, "halves": halves, "strangers": strangers}
    for kind in given.only.split(","):
        if kind in makers:
            impostors(kind, makers[kind](sets, np.random.default_rng(given.seed)), given.keep)
        elif kind == "true":
            true(sets)
        else:
            turned(sets, np.random.default_rng(given.seed), given.keep)


if __name__ == "__main__":
    main()
