"""Render the pair with parallax, two cameras before one still life: ``python samples/make_still_life.py``
(needs ``pip install mitsuba``; about ten minutes on two cores).

Everything in the scene is made here, by numbers; Mitsuba follows the light. The cameras stand side by side
and look the same way, as those of a stereo pair do, so that near and far things shift differently.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from PIL import Image
from still_life_materials import (
    T,
    matt,
    noise,
    rgb,
)
from still_life_objects import VASE_Y, bookcase, table

HERE = Path(__file__).resolve().parent
#: The whole frames, px, and the columns that the two samples show.
WIDTH, HEIGHT = 741, 500
LEFT, RIGHT = np.s_[:, :440], np.s_[:, 240:]
#: Between the cameras, m, and what a thing at the vase's distance shifts by, px.
BASE, SHIFT = 0.072, 30
EYE_Y, EYE_Z = -2.05, 0.62

Dict = dict[str, Any]


def main(passes: int = 10) -> None:
    """Both pictures, from so many passes of 16 samples a pixel each."""
    scene = mi.load_dict(still_life())
    for name, side, shown in (("left", -1, LEFT), ("right", 1, RIGHT)):
        linear = exposed(scene, side, passes)
        Image.fromarray(np.ascontiguousarray(developed(linear)[shown])).save(
            HERE / f"still_life_{name}.png", optimize=True
        )


def exposed(scene: Any, side: int, passes: int) -> np.ndarray:
    """What a camera gathers, (H, W, 3) linear: the mean of the passes, without the few paths that found a
    light by chance and shine like stars.
    """
    taken = np.stack(
        [
            np.array(mi.render(scene, sensor=camera(side), spp=16, seed=2 * number + (side > 0)))[..., :3]
            for number in range(passes)
        ]
    )
    return np.minimum(taken, 1.6 * np.median(taken, axis=0) + 0.02).mean(axis=0)


def camera(side: int) -> Any:
    """One of the two cameras: equal, parallel, BASE apart."""
    distance = VASE_Y - EYE_Y
    # A thing at the vase's distance is to shift by SHIFT px: BASE / distance * focal = SHIFT.
    focal = SHIFT * distance / BASE
    x = side * BASE / 2
    return mi.load_dict(
        {
            "type": "thinlens",
            "fov": float(np.degrees(2 * np.arctan(WIDTH / 2 / focal))),
            "aperture_radius": 0.006,
            "focus_distance": distance + 0.12,
            "to_world": T().look_at(origin=[x, EYE_Y, EYE_Z], target=[x, 0, EYE_Z - 0.255], up=[0, 0, 1]),
            "film": {
                "type": "hdrfilm",
                "width": WIDTH,
                "height": HEIGHT,
                "rfilter": {"type": "gaussian", "stddev": 0.42},
            },
            "sampler": {"type": "multijitter"},
        }
    )


def developed(linear: np.ndarray) -> np.ndarray:
    """As a camera would: exposure, a soft shoulder, sRGB; (H, W, 3) uint8."""
    x = 1.12 * np.maximum(linear, 0)
    x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)  # filmic curve
    x = np.clip(x, 0, 1)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return np.rint(255 * x).astype(np.uint8)


def still_life() -> Dict:
    """A table before a bookcase, a window at the left."""
    rng = np.random.default_rng(12)
    scene: Dict = {"type": "scene", "integrator": {"type": "path", "max_depth": 7, "rr_depth": 4}}
    scene |= lights()
    scene |= room()
    scene |= bookcase(rng)
    scene |= table(rng)
    return scene


def lights() -> Dict:
    """A window at the left, a lamp behind the cameras, and what the walls give back."""
    return {
        "window": {
            "type": "rectangle",
            "to_world": T().look_at(origin=[-2.3, -0.9, 1.7], target=[0, 0.3, 0.2], up=[0, 0, 1])
            @ T().scale([0.75, 0.95, 1]),
            "emitter": {"type": "area", "radiance": rgb(11.5, 12.4, 13.8)},
        },
        "lamp": {
            "type": "rectangle",
            "to_world": T().look_at(origin=[1.9, -1.6, 2.1], target=[0.3, 0.5, 0.2], up=[0, 0, 1])
            @ T().scale([0.4, 0.4, 1]),
            "emitter": {"type": "area", "radiance": rgb(9.0, 6.2, 3.6)},
        },
        "air": {"type": "constant", "radiance": rgb(0.20, 0.20, 0.21)},
    }


def room() -> Dict:
    """The wall behind the bookcase."""
    rng = np.random.default_rng(1)
    plaster = 0.62 + 0.03 * noise(rng, (512, 512), 30) + 0.02 * noise(rng, (512, 512), 2)
    return {
        "wall": {
            "type": "rectangle",
            "to_world": T().translate([0, 1.45, 1]) @ T().rotate([1, 0, 0], 90) @ T().scale([3, 3, 1]),
            "bsdf": matt(plaster[..., np.newaxis] * [1.0, 0.95, 0.86]),
        }
    }


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
