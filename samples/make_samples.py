"""Cut the sample pictures out of the images that come with scikit-image, or draw them: ``python
samples/make_samples.py`` (no network).

What each is and under which licence: README.md beside this file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import skimage.data
from PIL import Image
from scipy import ndimage
from scipy.spatial import cKDTree

HERE = Path(__file__).resolve().parent
SOURCE = Path(skimage.data.__file__).parent


def main() -> None:
    """Write every sample picture."""
    coffee = read("coffee.png")
    for name, (x, y), gain in (("a", (0, 0), 1.07), ("b", (190, 30), 0.92), ("c", (90, 170), 1.0)):
        crop = coffee[40 + y : 260 + y, 130 + x : 410 + x] * gain
        write(
            f"coffee_{name}.jpg", np.clip(np.rint(crop), 0, 255).astype(np.uint8), quality=92, subsampling=0
        )

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
    write("gravel_mask.png", blob(192))
    write("brick.png", read("brick.png")[:192, :192])
    write("gravel.png", read("gravel.png")[:192, :192])
    write("stars.png", sky[80:272, 80:272])
    colour, normals = cobbles(192)
    write("cobbles.png", colour)
    write("cobbles_normal.png", normals)
    write("cloth.png", cloth(160))


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


def blob(size: int) -> np.ndarray:
    """A mask: a disk in white on black, to be filled."""
    y, x = np.mgrid[:size, :size]
    return np.where(np.hypot(x - 110, y - 80) < 34, 255, 0).astype(np.uint8)


def cobbles(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Stones of unlike size and colour in dark joints, lit from the upper left, and their normal map; (size,
    size, 3) uint8 each.
    """
    rng = np.random.default_rng(7)
    step = 26
    places = np.array(
        [
            (
                y + rng.uniform(-0.36, 0.36) * step,
                x + (0.5 * step if row % 2 else 0) + rng.uniform(-0.36, 0.36) * step,
            )
            for row, y in enumerate(np.arange(-step, size + 2 * step, 0.9 * step))
            for x in np.arange(-step, size + 2 * step, step)
        ]
    )
    y, x = np.mgrid[:size, :size] + np.stack(
        [ndimage.gaussian_filter(rng.normal(size=(size, size)), 5) * 22 for _ in range(2)]
    )
    distance, stone = cKDTree(places).query(np.stack([y, x], axis=-1), k=2)
    edge = distance[..., 1] - distance[..., 0]
    fine = ndimage.gaussian_filter(rng.normal(size=(size, size)), 0.8)
    coarse = ndimage.gaussian_filter(rng.normal(size=(size, size)), 3.0)
    height = (
        9 * np.sqrt(np.clip(1 - np.square(np.clip(1 - (edge - 2) / 11, 0, 1)), 0, 1))
        + 1.2 * coarse / coarse.std() * 0.3
        + 0.25 * fine
    )
    down, right = np.gradient(ndimage.gaussian_filter(height, 0.6))
    normal = np.stack([-right, -down, np.ones_like(height)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    tones = np.array(
        [[142, 132, 120], [168, 150, 128], [120, 118, 120], [176, 158, 140], [134, 112, 96], [152, 146, 142]]
    )
    own = tones[rng.integers(0, len(tones), len(places))] * rng.uniform(0.82, 1.12, (len(places), 1))
    joint = np.array([58, 52, 46])
    inside = np.clip((edge - 1.5) / 2.5, 0, 1)[..., np.newaxis]
    body = own[stone[..., 0]] * (1 + 0.05 * fine / fine.std() + 0.06 * coarse / coarse.std())[..., np.newaxis]
    light = np.clip(normal @ (np.array([-0.5, -0.6, 0.75]) / np.linalg.norm([0.5, 0.6, 0.75])), 0, 1)[
        ..., np.newaxis
    ]
    colour = (inside * body + (1 - inside) * joint * (1 + 0.12 * fine / fine.std())[..., np.newaxis]) * (
        0.35 + 0.85 * light
    )
    return to_bytes(colour), to_bytes(127.5 * (normal * [1, -1, 1] + 1))


def cloth(size: int) -> np.ndarray:
    """A plain weave of unevenly dyed blue and ochre threads; (size, size, 3) uint8."""
    rng = np.random.default_rng(11)
    y, x = np.mgrid[:size, :size] + np.stack(
        [ndimage.gaussian_filter(rng.normal(size=(size, size)), 9) * 14 for _ in range(2)]
    )
    pitch = 8.0
    warp, weft = np.floor(x / pitch).astype(int), np.floor(y / pitch).astype(int)
    above = (warp + weft) % 2 == 0
    bulge = np.where(above, np.sin(np.pi * (x % pitch) / pitch), np.sin(np.pi * (y % pitch) / pitch))
    arch = np.where(above, np.sin(np.pi * (y % pitch) / pitch), np.sin(np.pi * (x % pitch) / pitch))
    shade = (0.35 + 0.65 * bulge**0.7) * (0.62 + 0.38 * arch)
    thread = np.where(above, warp, weft + 1000)
    dye = rng.uniform(0.86, 1.1, 3000)[thread % 3000]
    base = np.where(above[..., np.newaxis], [66, 92, 138], [196, 160, 96])
    fibre = 1 + 0.06 * ndimage.gaussian_filter(rng.normal(size=(size, size)), 0.7)
    return to_bytes(base * (shade * dye * fibre)[..., np.newaxis])


def to_bytes(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def read(name: str) -> np.ndarray:
    with Image.open(SOURCE / name) as image:
        return np.asarray(image)


def write(name: str, pixels: np.ndarray, **options: int) -> None:
    Image.fromarray(np.ascontiguousarray(pixels)).save(HERE / name, optimize=True, **options)


if __name__ == "__main__":
    main()
