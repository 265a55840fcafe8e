"""Clips and stacks to try loops and volumes on, all of them made here: nothing is downloaded.

    python samples/clips.py FOLDER

writes water.webp, flames.webp, flag.webp and clouds.webp (72 frames each), and two overlapping stacks of
cells, cells_a.npy and cells_b.npy.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage

Clip = npt.NDArray[np.uint8]
Field = npt.NDArray[np.float64]


def field(shape: tuple[int, ...], falls: float, rng: np.random.Generator) -> Field:
    """Noise that repeats on every axis, amplitudes falling as frequency to the power `falls`; mean 0,
    deviation 1.
    """
    grid = np.meshgrid(*[np.fft.fftfreq(length) for length in shape], indexing="ij")
    frequency = np.sqrt(sum(axis**2 for axis in grid))
    frequency.flat[0] = 1
    made = np.fft.ifftn(np.fft.fftn(rng.standard_normal(shape)) / frequency**falls).real
    result: Field = (made - made.mean()) / made.std()
    return result


def waves(shape: tuple[int, int], length: float, rng: np.random.Generator) -> Field:
    """Noise of about one wave length, in px, that repeats on both axes; mean 0, deviation 1."""
    rough = rng.standard_normal(shape)
    fine, coarse = (ndimage.gaussian_filter(rough, length * share, mode="wrap") for share in (0.22, 0.33))
    result: Field = (fine - coarse) / (fine - coarse).std()
    return result


def moved(texture: Field, y: Field, x: Field) -> Field:
    """The texture's values at places, which wrap around."""
    result: Field = ndimage.map_coordinates(
        texture, [y % texture.shape[0], x % texture.shape[1]], order=1, mode="grid-wrap"
    )
    return result


def coloured(value: Field, colours: list[tuple[int, int, int]]) -> Clip:
    """Values in [0, 1] through a ramp of colours."""
    at = np.linspace(0, 1, len(colours))
    planes = [np.interp(value, at, [colour[channel] for colour in colours]) for channel in range(3)]
    return np.rint(np.stack(planes, axis=-1)).astype(np.uint8)


def water(frames: int = 72, height: int = 120, width: int = 160, seed: int = 0) -> Clip:
    """Two layers of ripples that drift across each other over a bed of stones, which stands still."""
    rng = np.random.default_rng(seed)
    layers = [waves((256, 256), length, rng) for length in (22.0, 13.0)]
    bed = field((256, 256), 1.8, rng)
    swirl = [field((256, 256), 3.0, rng) for _ in range(2)]
    y, x = np.indices((height, width), float)
    made = []
    for t in range(frames):
        bend_y, bend_x = (3 * moved(part, y + 0.4 * t, x - 0.3 * t) for part in swirl)
        one = moved(layers[0], y + bend_y + 0.9 * t, x + bend_x + 0.7 * t)
        other = moved(layers[1], y + bend_x - 0.6 * t, x + bend_y + 1.1 * t)
        ripple = one + other
        slope = np.gradient(ripple, axis=1)
        below = moved(bed, y + 4 * slope, x + 4 * np.gradient(ripple, axis=0))
        light = 0.42 + 0.11 * below + 0.5 * slope + 1.5 * np.clip(slope - 0.45, 0, None)
        made.append(
            coloured(np.clip(light, 0, 1), [(8, 32, 48), (28, 92, 112), (92, 168, 170), (245, 252, 250)])
        )
    return np.stack(made)


def clouds(frames: int = 72, height: int = 120, width: int = 160, seed: int = 4) -> Clip:
    """Clouds that pass and never come back, in two layers: a hard one to loop."""
    rng = np.random.default_rng(seed)
    layers = [field((256, 512), 2.2, rng) for _ in range(2)]
    y, x = np.indices((height, width), float)
    made = []
    for t in range(frames):
        value = moved(layers[0], y + 0.1 * t, x + 1.1 * t) + 0.7 * moved(layers[1], y, x + 0.5 * t)
        value = np.clip(0.45 + 0.28 * value, 0, 1)
        made.append(coloured(value, [(62, 118, 186), (120, 164, 212), (226, 232, 238), (252, 252, 252)]))
    return np.stack(made)


def flames(frames: int = 72, height: int = 160, width: int = 120, seed: int = 1) -> Clip:
    """A fire: noise that rises ever faster, and lives shorter the higher it is."""
    rng = np.random.default_rng(seed)
    layers = [field((512, 256), falls, rng) for falls in (1.5, 1.3)]
    sway = field((256, 256), 3.0, rng)
    y, x = np.indices((height, width), float)
    up = (height - 1 - y) / height
    made = []
    for t in range(frames):
        bend = 6 * up * moved(sway, y + 1.5 * t, x + 0.4 * t)
        heat = moved(layers[0], 1.2 * y + 4.0 * t, x + bend) + 0.6 * moved(
            layers[1], 2 * y + 6.5 * t, 2 * x + bend
        )
        hearth = 1 - ((x + bend - width / 2) / (0.42 * width)) ** 2
        value = 0.95 * hearth - 1.25 * up + 0.22 * heat
        made.append(
            coloured(
                np.clip(value, 0, 1),
                [(6, 4, 10), (120, 18, 8), (226, 88, 12), (252, 190, 60), (255, 250, 220)],
            )
        )
    return np.stack(made)


def flag(frames: int = 72, height: int = 120, width: int = 180, seed: int = 2) -> Clip:
    """A striped flag in an uneven wind, before a sky that grows darker all the while."""
    rng = np.random.default_rng(seed)
    gusts = field((256, 256), 2.6, rng)
    weave = field((256, 512), 0.4, rng)
    clouds = field((256, 256), 2.4, rng)
    y, x = np.indices((height, width), float)
    made = []
    for t in range(frames):
        free = np.clip((x - 18) / (width - 30), 0, 1)
        phase = 0.115 * x - 0.42 * t + 0.9 * moved(gusts, 0.3 * y, 0.5 * x - 1.6 * t)
        lift = 9 * free * np.sin(phase) + 2 * free * np.sin(1.9 * phase + 1)
        v, u = y - lift - 14, x + 2.5 * free * np.cos(phase)
        cloth = (u >= 18) & (u < width - 14) & (v >= 0) & (v < height - 40)
        stripe = (np.floor(v / ((height - 40) / 5)) % 2).astype(bool)
        sun = (u - 56) ** 2 + (v - (height - 40) / 2) ** 2 < 17**2
        colour = np.where(stripe[..., None], (236, 232, 220), (176, 30, 44)).astype(float)
        colour[sun] = (250, 196, 48)
        shade = 0.82 + 0.26 * free * np.cos(phase) + 0.03 * moved(weave, 2 * v, 2 * u)
        sky = (np.array([132, 176, 222]) + 16 * moved(clouds, y, x + 0.25 * t)[..., None]) * (
            1.06 - 0.0022 * t
        )
        picture = np.where(cloth[..., None], colour * shade[..., None], sky)
        pole = (x >= 11) & (x < 16)
        picture[pole] = (92, 82, 74)
        made.append(np.rint(np.clip(picture, 0, 255)).astype(np.uint8))
    return np.stack(made)


def cells(
    shape: tuple[int, int, int] = (60, 160, 260), overlap: int = 60, seed: int = 3
) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.uint16]]:
    """Two 16-bit stacks of the same cells, taken one after the other: b continues to the right of a, and the
    cells near the border have moved a little meanwhile.
    """
    rng = np.random.default_rng(seed)
    places = rng.random((900, 3)) * shape
    sizes = rng.uniform(3.5, 7.5, len(places))
    light = rng.uniform(0.35, 1.0, len(places))
    drift = rng.normal(0, 1.6, (len(places), 3))
    left = (shape[2] + overlap) // 2
    stacks = []
    for start, stop, shift in ((0, left, 0.0), (left - overlap, shape[2], 1.0)):
        stack = np.zeros(shape)
        for place, size, bright in zip(places + shift * drift, sizes, light, strict=True):
            low = np.maximum(np.floor(place - size - 2), 0).astype(int)
            high = np.minimum(np.ceil(place + size + 3), shape).astype(int)
            if (high <= low).any():
                continue
            z, y, x = np.meshgrid(*[np.arange(a, b) for a, b in zip(low, high, strict=True)], indexing="ij")
            away = np.sqrt(1.7 * (z - place[0]) ** 2 + (y - place[1]) ** 2 + (x - place[2]) ** 2) / size
            body = bright * np.clip(6 * (1 - away), 0, 1) * (0.55 + 0.45 * (away > 0.82))
            box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
            stack[box] = np.maximum(stack[box], body)
        noisy = 0.03 + 0.8 * stack[:, :, start:stop] + rng.normal(0, 0.012, (*shape[:2], stop - start))
        stacks.append(np.rint(np.clip(noisy, 0, 1) * 40000).astype(np.uint16))
    return stacks[0], stacks[1]


CLIPS = {"water": water, "flames": flames, "flag": flag, "clouds": clouds}


def main(folder: Path) -> None:
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for name, make in CLIPS.items():
        pictures = [Image.fromarray(frame) for frame in make()]
        pictures[0].save(
            folder / f"{name}.webp",
            save_all=True,
            append_images=pictures[1:],
            duration=40,
            loop=0,
            lossless=True,
        )
    for name, stack in zip("ab", cells(), strict=True):
        np.save(folder / f"cells_{name}.npy", stack)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "clips"))
