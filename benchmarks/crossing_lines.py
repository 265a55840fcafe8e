"""Lines that cross a hole: ``python benchmarks/crossing_lines.py [sheet.png [rows …]]``.

Twenty holes in photographs and drawn grounds, each crossed by 1 to 4 lines that are drawn there: kerbs (two
tones that meet), painted lines, wires, paths, horizons. What `fill` puts there is compared with what was
drawn across the hole: an edge is joined if it lies within 1.5 px of where it should be on nine tenths of its
length, and the line through these places within 3° of it. Set PYTHONPATH to measure another version.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import skimage.data
from PIL import Image
from scipy import ndimage

import toposeam as ts
from sheets import sheet_of
from stamp import stamp
from texture_samples import shaded

SIDE, FINE = 320, 4
#: Ground, and of each line: kind, angle in degrees, distance from the middle, px, and width, px.
PICTURES = (
    ("grass", (("kerb", 12, 4, 9),)),
    ("grass", (("path", 28, 0, 34),)),
    ("gravel", (("kerb", -20, 6, 8),)),
    ("court", (("paint", 25, 0, 6), ("paint", -40, 10, 6))),
    ("court", (("paint", 8, -14, 5), ("paint", 8, 14, 5), ("paint", 98, 0, 5))),
    ("sky", (("wire", 14, 5, 2),)),
    ("sky", (("wire", -9, -16, 2), ("wire", -7, 0, 3), ("wire", -5, 18, 2))),
    ("sky", (("horizon", 3, 0, 0),)),
    ("grass", (("horizon", -6, 8, 0),)),
    ("gravel", (("paint", 35, 0, 8),)),
    ("brick", (("wire", 30, 0, 3),)),
    ("court", (("kerb", 60, 0, 10),)),
    ("grass", (("path", -15, 0, 24), ("wire", 50, 0, 3))),
    ("sky", (("kerb", 75, 0, 12),)),
    ("gravel", (("path", 90, 0, 28),)),
    ("court", (("paint", 20, -20, 6), ("paint", 20, 20, 6))),
    ("grass", (("paint", 45, 0, 7), ("paint", -45, 0, 7))),
    ("sky", (("horizon", 0, 12, 0), ("wire", 33, 0, 2))),
    ("court", (("path", 50, 0, 30),)),
    ("gravel", (("kerb", 8, -12, 10), ("kerb", 8, 22, 10))),
)


def ground_of(kind: str, rng: np.random.Generator) -> np.ndarray:
    top, left = rng.integers(0, 512 - SIDE, 2)
    window = np.s_[top : top + SIDE, left : left + SIDE]
    if kind == "grass":
        return shaded(skimage.data.grass()[window] / 255, (28, 50, 18), (74, 112, 40), (150, 176, 96))
    if kind == "gravel":
        return shaded(skimage.data.gravel()[window] / 255, (50, 48, 46), (110, 104, 96), (176, 170, 160))
    if kind == "brick":
        return shaded(skimage.data.brick()[window] / 255, (70, 34, 26), (150, 84, 64), (206, 180, 160))
    slope = np.linspace(-1, 1, SIDE)[:, np.newaxis]
    noise = ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), 1)
    if kind == "court":
        return shaded(
            np.clip(0.5 + 0.1 * slope + 0.12 * noise, 0, 1), (120, 50, 34), (160, 76, 52), (190, 110, 84)
        )
    return shaded(
        np.clip(0.5 + 0.4 * slope + 0.03 * noise, 0, 1), (84, 132, 196), (140, 178, 222), (214, 228, 240)
    )


def across(angle: float, away: float) -> np.ndarray:
    """Distance of each fine pixel from a line, px of the picture, to the right of its direction."""
    y, x = (np.mgrid[: SIDE * FINE, : SIDE * FINE] + 0.5) / FINE - SIDE / 2
    turn = np.radians(angle)
    return y * np.cos(turn) - x * np.sin(turn) - away


def drawn(row: int) -> tuple[np.ndarray, np.ndarray, list[tuple[float, float]]]:
    """A picture, its hole, and angle and distance from the middle of each edge."""
    ground, lines = PICTURES[row]
    rng = np.random.default_rng(row)
    picture = np.asarray(
        Image.fromarray(ground_of(ground, rng)).resize((SIDE * FINE,) * 2, Image.Resampling.BICUBIC)
    ).astype(float)
    other = np.asarray(
        Image.fromarray(ground_of("gravel" if ground == "grass" else "grass", rng)).resize(
            (SIDE * FINE,) * 2, Image.Resampling.BICUBIC
        )
    ).astype(float)
    edges = []
    for kind, angle, away, width in lines:
        far = across(angle, away)
        if kind == "horizon":
            picture[far > 0] = other[far > 0]
            edges.append((angle, away))
        elif kind == "path":
            grain = 180 + 0.25 * (other - other.mean())
            inside = np.abs(far) < width / 2
            picture[inside] = grain[inside] * (1.0, 0.92, 0.78)
        elif kind == "kerb":
            top = np.abs(far) < width / 2
            picture[far > 0] = 0.5 * picture[far > 0] + 0.5 * other[far > 0]
            picture[top] = np.where(far[top] < 0, 196, 150)[:, np.newaxis]
        else:
            picture[np.abs(far) < width / 2] = (238, 238, 232) if kind == "paint" else (30, 32, 36)
        if kind in ("path", "kerb", "paint"):
            edges += [(angle, away - width / 2), (angle, away + width / 2)]
        elif kind == "wire":
            edges.append((angle, away))
    image = np.asarray(
        Image.fromarray(np.clip(picture, 0, 255).astype(np.uint8)).resize((SIDE, SIDE), Image.Resampling.BOX)
    )
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
    long, short = rng.uniform(44, 62), rng.uniform(30, 46)
    turn = rng.uniform(0, np.pi)
    u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    return image, np.hypot(u / long, v / short) < 1, edges


def joined(filled: np.ndarray, truth: np.ndarray, hole: np.ndarray, edges: list[tuple[float, float]]) -> int:
    """How many edges go on where they should: at every px along one the profile across it is looked for."""
    count = 0
    for angle, away in edges:
        turn = np.radians(angle)
        along, normal = np.array([np.sin(turn), np.cos(turn)]), np.array([np.cos(turn), -np.sin(turn)])
        t = np.arange(-90, 91)
        n = np.arange(-14, 15)
        middle = np.array([SIDE / 2 - 0.5] * 2) + away * normal
        at = middle + t[:, np.newaxis, np.newaxis] * along + n[:, np.newaxis] * normal
        at = np.moveaxis(at, 2, 0)
        inside = ndimage.map_coordinates(hole.astype(float), at, order=0) > 0.5
        use = inside[:, 14]
        if not use.any():
            count += 1
            continue
        profiles = []
        for picture in (truth, filled):
            planes = [ndimage.map_coordinates(picture[..., c].astype(float), at, order=1) for c in range(3)]
            profiles.append(ndimage.uniform_filter1d(np.stack(planes, 2), 7, axis=0))
        wanted = np.median(profiles[0][~use], axis=0)[10:19]
        errors = np.stack(
            [np.abs(profiles[1][:, 10 + d : 19 + d] - wanted).sum(axis=(1, 2)) for d in range(-8, 9)], axis=1
        )
        shift = errors.argmin(axis=1) - 8.0
        good = np.abs(shift[use]) <= 1.5
        slope = np.polyfit(t[use][good], shift[use][good], 1)[0] if good.sum() > 5 else 1.0
        count += bool(good.mean() >= 0.9 and abs(np.degrees(np.arctan(slope))) <= 3)
    return count


def main() -> None:
    print(stamp())
    sheets, all_joined = [], 0
    rows = [int(one) for one in sys.argv[2:]] or range(len(PICTURES))
    for row in rows:
        image, hole, edges = drawn(row)
        began = time.process_time()
        made = ts.fill(image, hole)
        took = time.process_time() - began
        count = joined(made.image.astype(float), image.astype(float), hole, edges)
        all_joined += count == len(edges)
        print(
            f"{row:2} {PICTURES[row][0]:7} {', '.join(one[0] for one in PICTURES[row][1]):24} "
            f"{made.settings['by']:7} {count} of {len(edges)} edges joined, {took:.1f} s",
            flush=True,
        )
        holed = image.copy()
        holed[hole] = 255, 0, 255
        sheets.append((holed[60:260], made.image[60:260]))
    print(f"all joined in {all_joined} of {len(rows)}")
    if len(sys.argv) > 1:
        sheet_of(sheets, 4).save(sys.argv[1])


if __name__ == "__main__":
    main()
