"""What the things of the still life are made of: colours, glazes, and pictures of wood, linen and peel."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from scipy import ndimage

mi.set_variant("scalar_rgb")
T = mi.ScalarTransform4f
Dict = dict[str, Any]


def rgb(r: float, g: float, b: float) -> Dict:
    return {"type": "rgb", "value": [r, g, b]}


def rgb_of(rng: np.random.Generator, low: float, high: float) -> list:
    """The colour of a book or jar: mostly muted, sometimes not."""
    import colorsys

    hue = rng.choice([0.0, 0.03, 0.08, 0.12, 0.3, 0.45, 0.58, 0.62, 0.95]) + rng.normal(0, 0.015)
    value = low + (high - low) * rng.uniform() ** 1.2
    return list(colorsys.hsv_to_rgb(hue % 1, rng.uniform(0.25, 0.85), value))


def colour_of(values: Any) -> Dict:
    values = np.asarray(values, float)
    return rgb(*map(float, values)) if values.ndim == 1 else bitmap(values)


def bitmap(values: np.ndarray) -> Dict:
    """A picture in linear light."""
    values = values if values.ndim == 3 else values[..., None]
    pixels = mi.Bitmap(np.clip(values, 0, 1).astype(np.float32))
    return {"type": "bitmap", "bitmap": pixels, "raw": True, "wrap_mode": "mirror"}


def matt(values: Any) -> Dict:
    return {"type": "diffuse", "reflectance": colour_of(values)}


def varnished(values: Any, alpha: float = 0.22) -> Dict:
    return {
        "type": "roughplastic",
        "diffuse_reflectance": colour_of(values),
        "alpha": alpha,
        "nonlinear": True,
    }


def glazed(values: Any, alpha: float = 0.1) -> Dict:
    return {"type": "roughplastic", "diffuse_reflectance": colour_of(values), "alpha": alpha}


def brass() -> Dict:
    return {
        "type": "roughconductor",
        "material": "none",
        "specular_reflectance": rgb(0.80, 0.58, 0.26),
        "alpha": 0.13,
    }


def noise(rng: np.random.Generator, shape: tuple, width: Any) -> np.ndarray:
    """Gaussian noise of a width in px, of deviation 1."""
    values = ndimage.gaussian_filter(rng.normal(size=shape), width, mode="wrap")
    return values / values.std()


def wood(rng: np.random.Generator, shape: tuple, light: Any, dark: Any, rings: float) -> np.ndarray:
    """Grain along the rows; (h, w, 3) linear."""
    h, w = shape
    y = (
        np.linspace(0, 1, h)[:, None]
        + 0.035 * noise(rng, shape, (h / 6, w / 5))
        + 0.01 * noise(rng, shape, (h / 20, w / 12))
    )
    grain = 0.5 + 0.5 * np.sin(2 * np.pi * rings * y + 1.2 * noise(rng, shape, (h / 5, w / 4)))
    fibre = noise(rng, shape, (0.7, 14))
    pores = np.clip(noise(rng, shape, (0.6, 7)) - 1.7, 0, None)
    share = np.clip(0.25 + 0.55 * grain**2 + 0.11 * fibre, 0, 1)[..., None]
    return np.clip(
        share * np.array(light) + (1 - share) * np.array(dark) - 0.10 * pores[..., None] * np.array(dark),
        0.01,
        1,
    )


def spine(rng: np.random.Generator, colour: Any, lying: bool = False) -> np.ndarray:
    """The back of a book: linen, bands, a label, lines of a title."""
    h, w = 420, 64
    values = np.zeros((h, w, 3)) + colour
    values *= (1 + 0.07 * noise(rng, (h, w), 0.8) + 0.06 * noise(rng, (h, w), 12))[..., None]
    ink = np.array([0.72, 0.56, 0.22]) if sum(colour) < 0.9 else np.array([0.06, 0.05, 0.05])
    style = rng.integers(4)
    if style in (0, 1):
        for place in (0.08, 0.1, 0.3, 0.86, 0.93):
            values[int(place * h) : int(place * h) + 4, 3:-3] = ink
    if style in (1, 2):
        label = (
            rng.uniform(0.5, 0.85) * np.array([1, 0.95, 0.82])
            if rng.uniform() < 0.5
            else rgb_of(rng, 0.02, 0.3)
        )
        values[int(0.14 * h) : int(0.27 * h), 4:-4] = label
        ink = np.array([0.05] * 3) if np.mean(label) > 0.35 else np.array([0.75, 0.62, 0.3])
    top, end = (0.15, 0.26) if style in (1, 2) else (0.36, rng.uniform(0.6, 0.8))
    y = int(top * h) + 3
    while y < end * h - 8:
        high = rng.integers(4, 9)
        if rng.uniform() < 0.85:
            row = rng.uniform(size=w) < 0.75
            row[: rng.integers(8, 16)] = row[-rng.integers(8, 16) :] = False
            values[y : y + high, row] = ink
        y += high + rng.integers(4, 9)
    values[:, :3] *= 0.75
    values[:, -3:] *= 0.75
    values = values.swapaxes(0, 1) if lying else values[::-1]
    return np.clip(values, 0.005, 0.95)


def pages() -> np.ndarray:
    rng = np.random.default_rng(2)
    return np.clip(
        np.repeat(rng.uniform(0.55, 0.78, (200, 1)), 64, axis=1)[..., None] * [1, 0.93, 0.78], 0, 1
    )


def porcelain() -> np.ndarray:
    """White with blue bands, tendrils and dots, round the vase."""
    h, w = 900, 1200
    v, u = np.mgrid[0 : 1 : 1j * h, 0 : 1 : 1j * w]
    rng = np.random.default_rng(6)
    blue = np.zeros((h, w))
    for low, high in ((0.08, 0.095), (0.105, 0.11), (0.60, 0.612), (0.622, 0.627), (0.80, 0.83)):
        blue[(v > low) & (v < high)] = 1
    tendril = 0.36 + 0.10 * np.sin(2 * np.pi * 5 * u)
    blue = np.maximum(blue, np.abs(v - tendril) < 0.007)
    for k in range(40):
        cu, cv = (k + 0.5) / 40, 0.36 + 0.10 * np.sin(2 * np.pi * 5 * (k + 0.5) / 40)
        up = 1 if k % 2 else -1
        du = (u - cu + 0.5) % 1 - 0.5
        leafy = (du * 26 - up * (v - cv) * 8) ** 2 + ((v - cv - up * 0.035) * 24) ** 2
        blue = np.maximum(blue, np.clip(1.6 - leafy * 2.2, 0, 1) * 0.85)
    for k in range(10):
        cu, cv = (k + 0.25) / 10 + (0.05 if k % 2 else 0), 0.36 - 0.085 * (1 if k % 2 else -1)
        du = ((u - cu + 0.5) % 1 - 0.5) * 9
        dv = (v - cv) * 9
        radius, angle = np.hypot(du, dv), np.arctan2(dv, du)
        flower = radius < 0.42 * (0.75 + 0.25 * np.cos(6 * angle))
        blue = np.maximum(blue, flower * np.clip(0.45 + 1.5 * np.abs(radius - 0.22), 0, 1) * (radius > 0.07))
    scallop = v < 0.045 + 0.012 * np.cos(2 * np.pi * 30 * u)
    blue = np.maximum(blue, 0.9 * scallop)
    blue = np.maximum(blue, 0.9 * ((v > 0.55) & (v < 0.6) & (np.abs(np.sin(np.pi * 26 * u)) < 0.35)))
    blue = ndimage.gaussian_filter(blue.astype(float), 1.6) * (0.86 + 0.10 * noise(rng, (h, w), 14))
    share = np.clip(blue, 0, 1)[..., None]
    return np.clip((1 - share) * [0.80, 0.81, 0.79] + share * [0.025, 0.06, 0.26], 0, 1)


def stoneware(rng: np.random.Generator, colour: Any = (0.72, 0.68, 0.60)) -> np.ndarray:
    h, w = 300, 400
    specks = np.clip(noise(rng, (h, w), 0.9) - 2.2, 0, 1) * 1.6
    rim = np.clip((np.linspace(0, 1, h)[:, None] - 0.45) / 0.1, 0, 1) * np.clip(
        (0.62 - np.linspace(0, 1, h)[:, None]) / 0.06, 0, 1
    )
    values = np.array(colour) * (1 + 0.05 * noise(rng, (h, w), (4, 60)))[..., None]
    values = values * (1 - 0.5 * rim[..., None] * np.array([0.5, 0.9, 1.2]) * 0.6)
    return np.clip(values * (1 - 0.75 * specks[..., None]), 0.01, 0.95)


def leaf(rng: np.random.Generator, colour: Any) -> np.ndarray:
    h, w = 160, 80
    y, x = np.mgrid[0 : 1 : 1j * h, -1 : 1 : 1j * w]
    veins = (np.abs(x) < 0.05) | (np.abs(((y - 0.35 * np.abs(x)) * 8) % 1 - 0.5) < 0.06)
    values = np.array(colour) * (1 + 0.16 * noise(rng, (h, w), 6) + 0.08 * noise(rng, (h, w), 1))[..., None]
    return np.clip(
        values * (1 + 0.55 * ndimage.gaussian_filter(veins.astype(float), 0.8))[..., None], 0.01, 0.9
    )


def peel_map(rng: np.random.Generator) -> np.ndarray:
    return np.clip(0.5 + 0.16 * noise(rng, (300, 600), 2.2), 0, 1)


def pear_skin(rng: np.random.Generator) -> np.ndarray:
    h, w = 256, 512
    u = np.linspace(0, 1, w)
    blush = np.clip(np.exp(-(((u - 0.62) / 0.14) ** 2)) * (1 + 0.2 * noise(rng, (h, w), 12)), 0, 1)[..., None]
    values = (1 - 0.75 * blush) * np.array([0.58, 0.55, 0.11]) + 0.75 * blush * np.array([0.55, 0.13, 0.05])
    dots = np.clip(noise(rng, (h, w), 1.1) - 2.0, 0, 1)[..., None]
    return np.clip(values * (1 - 0.5 * dots) * (1 + 0.05 * noise(rng, (h, w), 20))[..., None], 0, 1)
