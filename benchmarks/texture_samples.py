"""Twenty samples of 192 × 192 px that hurt: ``python benchmarks/texture_samples.py sheet.png`` draws them.

Photographs come from scikit-image and ``samples/``; what neither holds is drawn here, always the same.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import skimage.data
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage

from stamp import stamp

SAMPLES = Path(__file__).resolve().parent.parent / "samples"
SIDE = 192


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """A sample, and what is known of it because it was drawn."""

    name: str
    image: np.ndarray
    #: (SIDE, SIDE) int, the number of the object at each pixel, 0 where there is none.
    objects: np.ndarray = field(default_factory=lambda: np.zeros((SIDE, SIDE), int))


def samples() -> list[Sample]:
    """All of them."""
    found = []
    for name, make in MAKERS.items():
        made = make()
        image, objects = made if isinstance(made, tuple) else (made, np.zeros((SIDE, SIDE), int))
        found.append(Sample(name=name, image=np.ascontiguousarray(image), objects=objects))
    return found


def crop(picture: np.ndarray, top: int, left: int, side: int = SIDE) -> np.ndarray:
    part = picture[top : top + side, left : left + side]
    if side == SIDE:
        return part
    return np.asarray(Image.fromarray(part).resize((SIDE, SIDE), Image.Resampling.LANCZOS))


def file(name: str) -> np.ndarray:
    with Image.open(SAMPLES / f"{name}.png") as image:
        return np.asarray(image.convert("RGB"))


def noise(seed: int, *scales: float, shape: tuple[int, int] = (SIDE, SIDE)) -> np.ndarray:
    """Sums of smoothed noise, each of deviation 1 times its scale's share."""
    rng = np.random.default_rng(seed)
    total = np.zeros(shape)
    for scale in scales:
        layer = ndimage.gaussian_filter(rng.normal(size=shape), scale)
        total += layer / layer.std() * np.sqrt(scale / sum(scales))
    return total


def shaded(values: np.ndarray, *colours: tuple[int, int, int]) -> np.ndarray:
    """Values from 0 to 1 as a run of colours."""
    steps = np.linspace(0, 1, len(colours))
    planes = [np.interp(values, steps, [colour[c] for colour in colours]) for c in range(3)]
    return np.clip(np.rint(np.stack(planes, axis=2)), 0, 255).astype(np.uint8)


def scattered(seed: int, count: int, apart: float, room: float) -> list[tuple[float, float]]:
    rng = np.random.default_rng(seed)
    places: list[tuple[float, float]] = []
    for _ in range(20000):
        x, y = rng.uniform(room, SIDE - room, 2)
        if all(np.hypot(x - a, y - b) > apart for a, b in places):
            places.append((float(x), float(y)))
        if len(places) == count:
            break
    return places


def drawn(ground: np.ndarray, draw: Callable[[ImageDraw.ImageDraw, int], None]) -> np.ndarray:
    """What a function draws over a picture, without jagged edges."""
    fine = 4
    picture = Image.fromarray(ground).resize((SIDE * fine, SIDE * fine), Image.Resampling.BICUBIC)
    draw(ImageDraw.Draw(picture), fine)
    return np.asarray(picture.resize((SIDE, SIDE), Image.Resampling.BOX))


def dots() -> tuple[np.ndarray, np.ndarray]:
    places = scattered(3, 26, 27, 15)
    colours = ((190, 40, 50), (40, 90, 170), (230, 170, 30))

    def draw(pen: ImageDraw.ImageDraw, fine: int) -> None:
        for number, (x, y) in enumerate(places):
            radius = 10 * fine
            pen.ellipse(
                [x * fine - radius, y * fine - radius, x * fine + radius, y * fine + radius],
                fill=colours[number % 3],
            )

    ground = shaded(0.5 + 0.1 * noise(4, 1.0), (225, 215, 195), (250, 244, 230))
    outline = drawn(np.full_like(ground, 255), draw).min(axis=2) < 200
    return drawn(ground, draw), ndimage.label(outline)[0]


def mushrooms() -> tuple[np.ndarray, np.ndarray]:
    places = scattered(11, 9, 54, 26)

    def draw(pen: ImageDraw.ImageDraw, scale: int) -> None:
        fine = 1.5 * scale
        for x, y in places:
            a, b = x * scale, y * scale
            pen.rounded_rectangle(
                [a - 4 * fine, b - 2 * fine, a + 4 * fine, b + 13 * fine], 3 * fine, fill=(236, 226, 205)
            )
            pen.chord(
                [a - 13 * fine, b - 14 * fine, a + 13 * fine, b + 10 * fine], 180, 360, fill=(178, 42, 30)
            )
            for dx, dy, r in ((-6, -6, 2), (1, -9, 2.4), (7, -5, 1.8), (-1, -4, 1.6)):
                pen.ellipse(
                    [a + (dx - r) * fine, b + (dy - r) * fine, a + (dx + r) * fine, b + (dy + r) * fine],
                    fill=(246, 240, 228),
                )

    grass = skimage.data.grass()[:SIDE, :SIDE] / 255
    ground = shaded(grass, (18, 40, 10), (74, 116, 34), (190, 214, 120))
    outline = drawn(np.zeros_like(ground), draw)[..., 0] > 100
    return drawn(ground, draw), ndimage.label(outline)[0]


def wall() -> np.ndarray:
    rng = np.random.default_rng(5)
    tones = rng.uniform(0.25, 0.8, (9, 8))
    tones[:, -1] = tones[:, 0]

    def draw(pen: ImageDraw.ImageDraw, fine: int) -> None:
        for row in range(9):
            for column in range(-1, 6):
                left, top = (column * 44 + 22 * (row % 2)) * fine, row * 22 * fine
                tone = tones[row, (column + 1) % 8]
                fill = tuple(int(120 + 110 * tone * share) for share in (1.0, 0.45, 0.3))
                pen.rectangle([left + 2 * fine, top + 2 * fine, left + 42 * fine, top + 20 * fine], fill=fill)

    made = drawn(np.full((SIDE, SIDE, 3), (196, 190, 180), np.uint8), draw).astype(float)
    return np.clip(made + 9 * noise(6, 1.2, 3.0)[..., np.newaxis], 0, 255).astype(np.uint8)


def hexagons() -> np.ndarray:
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    pitch = 28.0
    rows = pitch * np.sqrt(3) / 2
    best, second = np.full((2, SIDE, SIDE), np.inf)
    tone = np.zeros((SIDE, SIDE))
    rng = np.random.default_rng(7)
    for row in range(-1, int(SIDE / rows) + 3):
        for column in range(-1, int(SIDE / pitch) + 3):
            distance = np.hypot(x - (column + 0.5 * (row % 2)) * pitch, y - row * rows)
            closer = distance < best
            second = np.where(closer, best, np.minimum(second, distance))
            tone = np.where(closer, rng.uniform(0.4, 0.9), tone)
            best = np.minimum(best, distance)
    line = np.clip((second - best) / 4, 0, 1)
    return shaded(tone * line + 0.03 * noise(8, 1.0), (28, 26, 24), (150, 140, 120), (240, 226, 190))


def weave() -> np.ndarray:
    y, x = np.mgrid[:SIDE, :SIDE]
    cell_x, cell_y = x // 12, y // 12
    over = (cell_x + cell_y) % 2 == 0
    across = np.sin(np.pi * ((y % 12) + 0.5) / 12)
    along = np.sin(np.pi * ((x % 12) + 0.5) / 12)
    value = np.where(
        over, 0.3 + 0.6 * across * (0.7 + 0.3 * along), 0.2 + 0.55 * along * (0.7 + 0.3 * across)
    )
    return shaded(value + 0.04 * noise(9, 0.8), (50, 34, 20), (170, 130, 80), (240, 214, 160))


def text() -> np.ndarray:
    words = (
        "heat flows along the line of least cost and where it flows the metal stays what carries nothing is "
        "taken away until one path is left over which all warmth must go "
    ) * 6
    size = 13
    font = ImageFont.load_default(size)
    picture = Image.new("L", (SIDE, SIDE), 246)
    pen = ImageDraw.Draw(picture)
    for row in range(-1, SIDE // 16 + 1):
        pen.text((-30 - 17 * (row % 5), row * 16 + 1), words[row * 41 + 41 :][:90], font=font, fill=20)
    return np.asarray(picture)


def wood() -> np.ndarray:
    y, x = np.mgrid[:SIDE, :SIDE]
    bend = ndimage.gaussian_filter(np.random.default_rng(10).normal(size=(SIDE, SIDE)), (60, 12))
    bend /= bend.std()
    rings = 0.5 + 0.5 * np.sin((x + 7 * bend) * 0.42 + 1.5 * np.sin(x / 31))
    fibre = ndimage.gaussian_filter(np.random.default_rng(12).normal(size=(SIDE, SIDE)), (14, 0.7))
    light = 0.16 * (y / SIDE - 0.5) + 0.12 * (x / SIDE - 0.5)
    return shaded(0.35 + 0.3 * rings + 1.1 * fibre + light, (70, 38, 16), (160, 100, 52), (226, 176, 116))


def marble() -> np.ndarray:
    y, x = np.mgrid[:SIDE, :SIDE]
    veins = np.abs(np.sin((x + 0.6 * y) / 26 + 1.3 * noise(13, 6, 14, 30)))
    return shaded(np.sqrt(veins) + 0.03 * noise(14, 0.8), (70, 72, 80), (190, 190, 196), (246, 244, 240))


def leaves() -> np.ndarray:
    with Image.open(SAMPLES / "leaf.png") as image:
        leaf = image.convert("RGBA")
    outline = Image.fromarray(255 - np.asarray(leaf.convert("L")))
    rng = np.random.default_rng(15)
    sheet = Image.new("RGB", (SIDE + 80, SIDE + 80), (30, 34, 18))
    for _ in range(260):
        side = int(rng.integers(34, 50))
        angle = float(rng.uniform(0, 360))
        shape = outline.resize((side, side), Image.Resampling.LANCZOS).rotate(angle, expand=True)
        alpha = shape.point(lambda value: 255 if value > 60 else 0)
        tone = shaded(np.array([[rng.uniform()]]), (86, 92, 30), (196, 120, 30), (150, 40, 20))[0, 0]
        plain = Image.new("RGB", shape.size, tuple(int(v) for v in tone))
        shadow = Image.new("RGB", shape.size, (14, 16, 8))
        at = tuple(int(v) for v in rng.integers(-20, SIDE + 60, 2))
        sheet.paste(shadow, (at[0] + 2, at[1] + 3), alpha)
        sheet.paste(plain, at, alpha)
    return np.asarray(sheet)[40 : 40 + SIDE, 40 : 40 + SIDE]


def lit(picture: np.ndarray) -> np.ndarray:
    """Under a lamp at the upper left."""
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    lamp = 1.25 - 0.75 * np.hypot(x - 0.15, y - 0.1)
    return np.clip(picture * lamp[..., np.newaxis], 0, 255).astype(np.uint8)


MAKERS: dict[str, Callable[[], np.ndarray | tuple[np.ndarray, np.ndarray]]] = {
    "brick": lambda: crop(skimage.data.brick(), 0, 0),
    "wall": wall,
    "hexagons": hexagons,
    "weave": weave,
    "text": text,
    "wood": wood,
    "marble": marble,
    "dots": dots,
    "leaves": leaves,
    "gravel": lambda: crop(skimage.data.gravel(), 0, 0),
    "grass": lambda: crop(skimage.data.grass(), 0, 0),
    "cobbles": lambda: file("cobbles"),
    "lit cobbles": lambda: lit(file("cobbles")),
    "retina": lambda: crop(skimage.data.retina(), 560, 360, 384),
    "coffee table": lambda: crop(skimage.data.coffee(), 0, 465, 130),
    "fur": lambda: crop(skimage.data.chelsea(), 15, 70, 80),
    "hubble": lambda: crop(skimage.data.hubble_deep_field(), 300, 300, 288),
    "stars": lambda: file("stars"),
    "cloth": lambda: file("cloth"),
    "mushrooms": mushrooms,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sheet", type=Path)
    side, columns = SIDE + 8, 5
    found = samples()
    sheet = Image.new("RGB", (columns * side, -(-len(found) // columns) * side), "white")
    for number, sample in enumerate(found):
        place = (number % columns * side, number // columns * side)
        sheet.paste(Image.fromarray(sample.image).convert("RGB"), place)
    sheet.save(parser.parse_args().sheet)


if __name__ == "__main__":
    print(stamp())
    main()
