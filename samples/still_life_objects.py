"""What stands in the still life of make_still_life.py."""

from __future__ import annotations

from typing import Any

import numpy as np
from still_life_materials import (
    T,
    bitmap,
    brass,
    glazed,
    leaf,
    matt,
    noise,
    pages,
    pear_skin,
    peel_map,
    porcelain,
    rgb,
    rgb_of,
    spine,
    stoneware,
    varnished,
    wood,
)
from still_life_shapes import blade, blossom, book, box, ring, smooth, surface, tube, turned

#: How far behind the middle the vase stands, m.
VASE_Y = 0.12

Dict = dict[str, Any]


def bookcase(rng: np.random.Generator) -> Dict:
    """Boards, and what stands on them."""
    parts: Dict = {}
    front, back, thick = 0.98, 1.32, 0.022
    oak = wood(np.random.default_rng(3), (400, 1600), [0.43, 0.26, 0.14], [0.25, 0.135, 0.066], 9)
    levels = (-0.24, 0.13, 0.47, 0.86, 1.24)
    for index, z in enumerate(levels):
        parts[f"board{index}"] = box((-1.5, front, z - thick), (1.5, back, z), varnished(oak))
    for index, x in enumerate((-0.735, 0.015, 0.765)):
        parts[f"upright{index}"] = box(
            (x - 0.013, front + 0.004, -0.7), (x + 0.013, back, 1.6), varnished(oak.swapaxes(0, 1))
        )
    parts["panel"] = box((-1.5, back, -0.7), (1.5, back + 0.01, 1.6), matt(oak * 0.55))
    for shelf, z in enumerate(levels[:-1]):
        for bay, (x0, x1) in enumerate(((-1.45, -0.75), (-0.72, 0.0), (0.03, 0.75), (0.78, 1.45))):
            x, number = x0 + 0.004, 0
            stop = x1 - (0.17 if (shelf + bay) % 2 else 0.03) * rng.uniform(0.7, 1.3)
            while x < stop - 0.05:
                thickness = rng.uniform(0.016, 0.052)
                height = min(rng.uniform(0.19, 0.285), levels[shelf + 1] - z - 0.05)
                deep = rng.uniform(0.14, 0.19)
                for piece, shape in book(
                    rng, (x, front + 0.03 + rng.uniform(0, 0.03), z), (thickness, deep, height)
                ).items():
                    parts[f"b{shelf}{bay}{number}{piece}"] = shape
                x += thickness + 0.0015
                number += 1
            if stop < x1 - 0.1:
                kind = (shelf * 3 + bay) % 3
                at = ((x + x1) / 2 + 0.008, front + 0.11, z)
                if kind == 0:
                    parts[f"jar{shelf}{bay}"] = turned(
                        at,
                        [
                            (0, 0),
                            (0.04, 0),
                            (0.052, 0.03),
                            (0.055, 0.10),
                            (0.035, 0.14),
                            (0.037, 0.155),
                            (0, 0.155),
                        ],
                        glazed(rgb_of(rng, 0.25, 0.75)),
                    )
                elif kind == 1:
                    parts[f"ball{shelf}{bay}"] = {
                        "type": "sphere",
                        "center": [at[0], at[1], z + 0.05],
                        "radius": 0.05,
                        "bsdf": brass(),
                    }
                else:
                    parts[f"box{shelf}{bay}"] = box(
                        (at[0] - 0.045, at[1] - 0.06, z),
                        (at[0] + 0.045, at[1] + 0.06, z + 0.09),
                        matt(np.clip(wood(rng, (128, 128), [0.6, 0.42, 0.24], [0.5, 0.33, 0.18], 4), 0, 1)),
                    )
    return parts


def table(rng: np.random.Generator) -> Dict:
    """The table and the still life on it."""
    planks = np.concatenate(
        [
            wood(
                rng,
                (170, 1800),
                np.array([0.50, 0.30, 0.155]) * tone,
                np.array([0.30, 0.155, 0.07]) * tone,
                7,
            )
            * np.clip(np.minimum(np.arange(170), np.arange(170)[::-1]) / 2.0, 0.22, 1)[
                :, np.newaxis, np.newaxis
            ]
            for tone in rng.uniform(0.8, 1.12, 7)
        ]
    )
    parts: Dict = {"table": box((-1.25, -0.62, -0.035), (1.25, 0.52, 0), varnished(planks, 0.16))}
    parts |= cloth()
    parts |= vase(rng)
    parts |= fruit(rng)
    # Books lying under a mug, at the left.
    z = 0.0
    for number, (turn, size) in enumerate(
        ((9, (0.23, 0.165, 0.034)), (-5, (0.205, 0.15, 0.026)), (14, (0.185, 0.13, 0.03)))
    ):
        colour = ([0.33, 0.07, 0.06], [0.09, 0.17, 0.13], [0.50, 0.38, 0.17])[number]
        at = T().translate([-0.375, 0.03, z]) @ T().rotate([0, 0, 1], turn)
        w, d, h = size
        for k, (low, high) in enumerate(((0, 0.0035), (h - 0.0035, h))):
            parts[f"lying{number}{k}"] = box(
                (-w / 2, -d / 2, low), (w / 2, d / 2, high), glazed(colour, 0.35), at
            )
        parts[f"lying{number}s"] = box(
            (-w / 2, -d / 2, 0), (w / 2, -d / 2 + 0.004, h), glazed(spine(rng, colour, True), 0.35), at
        )
        parts[f"lying{number}p"] = box(
            (-w / 2 + 0.002, -d / 2 + 0.004, 0.003),
            (w / 2 - 0.006, d / 2 - 0.006, h - 0.003),
            matt(pages()),
            at,
        )
        z += h
    white = glazed(stoneware(np.random.default_rng(5)), 0.12)
    parts["mug"] = turned(
        (-0.385, 0.03, z),
        [(0, 0), (0.034, 0), (0.041, 0.012), (0.043, 0.095), (0.0405, 0.095), (0.038, 0.012), (0, 0.01)],
        white,
    )
    parts["handle"] = ring((-0.385 - 0.052, 0.018, z + 0.05), 0.026, 0.006, white)
    # A brass candlestick and its candle, at the right.
    parts["stick"] = turned(
        (0.44, 0.23, 0),
        [
            (0, 0),
            (0.062, 0),
            (0.062, 0.008),
            (0.03, 0.022),
            (0.014, 0.045),
            (0.022, 0.07),
            (0.012, 0.095),
            (0.011, 0.16),
            (0.02, 0.18),
            (0.012, 0.195),
            (0.036, 0.215),
            (0.036, 0.22),
            (0, 0.22),
        ],
        brass(),
    )
    parts["candle"] = turned(
        (0.44, 0.23, 0.215),
        [(0, 0), (0.0125, 0), (0.0122, 0.165), (0.009, 0.17), (0, 0.167)],
        glazed([0.86, 0.80, 0.66], 0.3),
    )
    parts["wick"] = turned(
        (0.44, 0.23, 0.38), [(0, 0), (0.0016, 0), (0.0012, 0.014), (0, 0.014)], matt([0.05, 0.04, 0.04])
    )
    return parts


def cloth() -> Dict:
    """A striped runner with small folds, under the bowl."""
    n, m = 160, 240
    v, u = np.mgrid[0 : 1 : 1j * n, 0 : 1 : 1j * m]
    x = 0.02 + 0.56 * u + 0.012 * np.sin(5 * v + 1)
    y = -0.50 + 0.62 * v + 0.01 * np.sin(7 * u)
    z = (
        0.0035
        + 0.004 * np.sin(26 * u + 3 * np.sin(4 * v)) ** 2 * np.exp(-(((u - 0.12) / 0.25) ** 2))
        + 0.002 * np.sin(9 * v + 4 * u) ** 2
    )
    rng = np.random.default_rng(21)
    yy, xx = np.mgrid[:1000, :1000]
    stripes = np.full((1000, 1000, 3), [0.72, 0.68, 0.58])
    for place, wide, colour in (
        (60, 26, [0.09, 0.16, 0.34]),
        (110, 8, [0.5, 0.1, 0.08]),
        (500, 60, [0.09, 0.16, 0.34]),
        (450, 8, [0.5, 0.1, 0.08]),
        (560, 8, [0.5, 0.1, 0.08]),
        (940, 26, [0.09, 0.16, 0.34]),
        (890, 8, [0.5, 0.1, 0.08]),
    ):
        stripes[:, np.abs(np.arange(1000) - place) < wide] = colour
    weave = (
        0.80
        + 0.2 * np.abs(np.sin(np.pi * xx / 5)) * np.abs(np.sin(np.pi * yy / 5))
        + 0.03 * noise(rng, (1000, 1000), 1.5)
    )
    return {"cloth": surface(x, y, z, matt(np.clip(stripes * weave[..., np.newaxis], 0, 1)))}


def vase(rng: np.random.Generator) -> Dict:
    """A blue and white vase with branches in it; most of the overlap is theirs."""
    y0, x0 = VASE_Y, 0.035
    profile = [
        (0, 0),
        (0.052, 0),
        (0.055, 0.006),
        (0.078, 0.05),
        (0.098, 0.11),
        (0.094, 0.165),
        (0.066, 0.215),
        (0.041, 0.245),
        (0.036, 0.27),
        (0.047, 0.295),
        (0.043, 0.296),
        (0.032, 0.27),
        (0.036, 0.245),
    ]
    parts: Dict = {"vase": turned((x0, y0, 0), profile, glazed(porcelain(), 0.06), 96)}
    leaf_maps = [
        leaf(np.random.default_rng(s), c)
        for s, c in ((1, [0.12, 0.24, 0.07]), (2, [0.17, 0.30, 0.08]), (3, [0.09, 0.19, 0.07]))
    ]
    leaf_bsdfs = [
        {
            "type": "twosided",
            "bsdf": {"type": "roughplastic", "diffuse_reflectance": bitmap(m), "alpha": 0.22},
        }
        for m in leaf_maps
    ]
    bark = matt(np.clip(0.5 * wood(rng, (64, 64), [0.32, 0.21, 0.13], [0.2, 0.12, 0.07], 6), 0, 1))
    petal = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(0.86, 0.62, 0.60)}}
    heart = matt([0.80, 0.58, 0.12])
    count = 0
    for branch in range(13):
        turn = 2 * np.pi * (branch + rng.uniform(0, 0.5)) / 13
        lean = rng.uniform(0.16, 0.62)
        long = rng.uniform(0.20, 0.36)
        t = np.linspace(0, 1, 24)
        out = lean * (t + 0.7 * t**2) * long / 1.25
        wobble = 0.012 * np.cumsum(rng.normal(0, 0.25, (2, 24)), axis=1)
        line = np.stack(
            [
                x0 + 0.02 * np.cos(turn) + out * np.cos(turn) + wobble[0],
                y0 + (0.02 + out) * np.sin(turn) * 0.8 + wobble[1],
                0.22 + long * t * (1.15 - 0.35 * lean * t),
            ],
            axis=1,
        )
        parts[f"branch{branch}"] = tube(line, 0.0032 * (1.15 - 0.8 * t), bark)
        along = np.gradient(line, axis=0)
        for k in range(6, 24):
            for _ in range(1 + (k % 3 == 0)):
                direction = along[k] / np.linalg.norm(along[k]) * 0.6 + rng.normal(0, 0.55, 3)
                direction[2] += 0.15
                parts[f"leaf{count}"] = blade(
                    line[k], direction, rng.uniform(0.034, 0.062), rng, leaf_bsdfs[count % 3]
                )
                count += 1
        if branch % 2 == 0 or branch in (3, 7):
            tip = line[-1] + [0, -0.004, 0.004]
            face = along[-1] / np.linalg.norm(along[-1]) + [0, -0.9, 0.15]
            for number, shape in enumerate(
                blossom(tip, face, 0.03 * rng.uniform(0.9, 1.25), petal, heart, rng)
            ):
                parts[f"flower{branch}_{number}"] = shape
    return parts


def fruit(rng: np.random.Generator) -> Dict:
    """A bowl of oranges and lemons, one orange beside it, a pear."""
    bowl = [
        (0, 0.004),
        (0.045, 0.004),
        (0.05, 0),
        (0.055, 0.0),
        (0.06, 0.012),
        (0.118, 0.05),
        (0.142, 0.085),
        (0.145, 0.089),
        (0.138, 0.088),
        (0.112, 0.056),
        (0.05, 0.02),
        (0, 0.018),
    ]
    cx, cy = 0.285, -0.10
    parts: Dict = {
        "bowl": turned(
            (cx, cy, 0.006), bowl, glazed(stoneware(np.random.default_rng(8), [0.19, 0.33, 0.33]), 0.1), 96
        )
    }
    peel = peel_map(np.random.default_rng(9))
    orange = {
        "type": "bumpmap",
        "arbitrary": bitmap(peel),
        "scale": 0.004,
        "bsdf": {"type": "roughplastic", "diffuse_reflectance": rgb(0.82, 0.30, 0.025), "alpha": 0.22},
    }
    lemon = {
        "type": "bumpmap",
        "arbitrary": bitmap(peel),
        "scale": 0.003,
        "bsdf": {"type": "roughplastic", "diffuse_reflectance": rgb(0.85, 0.62, 0.05), "alpha": 0.2},
    }
    ball = [(0.0375 * np.sin(a), 0.0365 * (1 - np.cos(a))) for a in np.linspace(0, np.pi, 40)]
    oval = [
        (0.029 * np.sin(a) ** 0.9 + (0.004 if 2.75 < a < 3.0 else 0), 0.042 * (1 - np.cos(a)))
        for a in np.linspace(0, np.pi, 40)
    ]
    for number, (dx, dy, dz) in enumerate(
        (
            (-0.052, -0.03, 0.05),
            (0.036, -0.046, 0.05),
            (0.058, 0.034, 0.052),
            (-0.02, 0.052, 0.052),
            (0.004, 0.0, 0.10),
            (-0.40, -0.20, 0.0),
        )
    ):
        parts[f"orange{number}"] = turned(
            (cx + dx, cy + dy, dz + 0.004),
            ball,
            orange,
            48,
            tilt=(rng.uniform(0, 360), rng.uniform(-40, 40)),
            about=0.0365,
        )
    for number, (dx, dy, dz, tilt) in enumerate(((-0.062, 0.026, 0.082, 70), (0.062, -0.005, 0.098, 80))):
        parts[f"lemon{number}"] = turned(
            (cx + dx, cy + dy, dz), oval, lemon, 48, tilt=(rng.uniform(0, 360), tilt), about=0.042
        )
    pear = [
        (0, 0.004),
        (0.018, 0),
        (0.034, 0.016),
        (0.040, 0.038),
        (0.034, 0.062),
        (0.022, 0.082),
        (0.0165, 0.10),
        (0.012, 0.112),
        (0.004, 0.116),
        (0, 0.113),
    ]
    parts["pear"] = turned(
        (-0.18, -0.22, 0.0), smooth(pear), glazed(pear_skin(np.random.default_rng(4)), 0.25), 64, tilt=(20, 4)
    )
    stalk = np.array([[-0.18, -0.22, 0.11], [-0.178, -0.22, 0.125], [-0.172, -0.22, 0.14]])
    parts["stalk"] = tube(stalk, np.array([0.002, 0.0018, 0.0024]), matt([0.12, 0.07, 0.03]))
    return parts
