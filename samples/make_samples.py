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


def read(name: str) -> np.ndarray:
    with Image.open(SOURCE / name) as image:
        return np.asarray(image)


def write(name: str, pixels: np.ndarray) -> None:
    Image.fromarray(np.ascontiguousarray(pixels)).save(HERE / name, optimize=True)


if __name__ == "__main__":
    main()
