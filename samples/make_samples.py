"""Cut the sample pictures out of the images that come with scikit-image: ``python samples/make_samples.py`` (no network).

What each is and under which licence: README.md beside this file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import skimage.data
from PIL import Image

HERE = Path(__file__).resolve().parent
SOURCE = Path(skimage.data.__file__).parent


def main() -> None:
    """Write every sample picture."""
    left, right = read("motorcycle_left.png"), read("motorcycle_right.png")
    write("motorcycle_left.png", left[:, :440])
    write("motorcycle_right.png", right[:, 240:])

    grass = read("grass.png")
    write("grass_a.png", grass[165:325, 181:341])
    write("grass_b.png", grass[3:163, 298:458])

    sky = read("hubble_deep_field.jpg")
    large, small = sky[420:700, 640:920], sky[336:496, 457:617]
    opacity = np.full((*large.shape[:2], 1), 255, np.uint8)
    opacity[160:, 160:] = 0
    write("sky_a.png", np.concatenate([np.where(opacity > 0, large, 0), opacity], axis=2))
    write("sky_b.png", small)
    write("leaf.png", ginkgo())


def ginkgo(size: int = 200) -> np.ndarray:
    """A sign drawn here, a ginkgo leaf in black on white, as a theme for patterns."""
    y, x = np.mgrid[-1 : 1 : 3j * size, -1 : 1 : 3j * size]
    radius, angle = np.hypot(x, 0.36 - y), np.arctan2(x, 0.36 - y)
    edge = 0.95 + 0.035 * np.cos(11 * angle) - 0.42 * np.exp(-((angle / 0.075) ** 2))
    fan = (radius < edge) & (np.abs(angle) < 1.22 * np.clip(radius / 0.95, 0, 1) ** 0.3)
    spread = np.abs((5 * angle + 0.5) % 1 - 0.5)
    veins = (spread * radius < 0.06) & (radius > 0.3) & (np.abs(angle) > 0.1) & (np.abs(angle) < 1.1)
    stem = (np.abs(x + 0.09 * np.maximum(y - 0.3, 0) ** 2) < 0.03) & (y > 0.3) & (y < 0.9)
    leaf = np.where((fan & ~veins) | stem, 20.0, 255.0)
    return leaf.reshape(size, 3, size, 3).mean(axis=(1, 3)).round().astype(np.uint8)


def read(name: str) -> np.ndarray:
    with Image.open(SOURCE / name) as image:
        return np.asarray(image)


def write(name: str, pixels: np.ndarray) -> None:
    Image.fromarray(np.ascontiguousarray(pixels)).save(HERE / name, optimize=True)


if __name__ == "__main__":
    main()
