"""Pairs of pictures and shapes of overlaps for the benchmarks of seams."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter
from skimage import data

PHOTOGRAPHS = ("brick", "grass", "gravel", "coffee", "chelsea", "astronaut", "rocket")
Labels = npt.NDArray[np.bool_]
Picture = npt.NDArray[np.uint8]
#: Side of the windows in which two pictures are compared, px.
_WINDOW = 15


def crops(name: str, length: int, width: int, rng: np.random.Generator) -> tuple[Picture, Picture]:
    """Two crops of a photograph, (length, width[, 3])."""
    image = getattr(data, name)()
    if length > image.shape[0] - 40 or width > image.shape[1] - 40:
        first, second = (tiled(image, length, width, rng) for _ in range(2))
        return first, second

    def crop() -> Picture:
        y, x = (rng.integers(image.shape[axis] - size + 1) for axis, size in enumerate((length, width)))
        return np.ascontiguousarray(image[y : y + length, x : x + width])

    return crop(), crop()


def tiled(image: Picture, length: int, width: int, rng: np.random.Generator) -> Picture:
    """A canvas of crops of an image, each mirrored or not."""
    high, wide = (size * 7 // 8 for size in image.shape[:2])

    def tile() -> Picture:
        y, x = rng.integers(image.shape[0] - high + 1), rng.integers(image.shape[1] - wide + 1)
        return image[y : y + high, x : x + wide][:: rng.choice((-1, 1)), :: rng.choice((-1, 1))]

    rows = [
        np.concatenate([tile() for _ in range(-(-width // wide))], axis=1) for _ in range(-(-length // high))
    ]
    return np.ascontiguousarray(np.concatenate(rows)[:length, :width])


def noise(length: int, width: int, rng: np.random.Generator) -> Picture:
    """Gray noise whose amplitudes fall as 1/f."""
    frequency = np.hypot(np.fft.fftfreq(length)[:, None], np.fft.rfftfreq(width)[None])
    frequency[0, 0] = 1.0
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((length, width))) / frequency, s=(length, width))
    return (128 + 50 * (field - field.mean()) / field.std()).clip(0, 255).astype(np.uint8)


def pair(length: int, width: int, index: int, seed: int) -> tuple[Picture, Picture]:
    """The pair of crops with that index."""
    rng = np.random.default_rng([seed, length, width, index])
    sources = (*PHOTOGRAPHS, "noise")
    name = sources[index % len(sources)]
    if name == "noise":
        return noise(length, width, rng), noise(length, width, rng)
    return crops(name, length, width, rng)


def ring(size: int = 1500, width: int = 200) -> tuple[Labels, Labels]:
    """A hole in ``a``, and ``b`` on it and on `width` px all round."""
    a, b = np.ones((size, size), bool), np.zeros((size, size), bool)
    inner = slice(size // 3, -(size // 3))
    outer = slice(size // 3 - width, width - size // 3)
    a[inner, inner], b[outer, outer] = False, True
    return a, b


def ell(size: int = 3000, width: int = 300) -> tuple[Labels, Labels]:
    """What is filled above and to the left, and a patch over all of it."""
    a = np.zeros((size, size), bool)
    a[:width] = a[:, :width] = True
    b = np.ones((size, size), bool)
    b[: width // 10], b[:, : width // 10] = False, False
    return a, b


def islands(size: int = 1000) -> tuple[Labels, Labels]:
    """Two pieces of ``b`` inside ``a``, each on a hole of ``a``."""
    a, b = np.ones((size, 2 * size), bool), np.zeros((size, 2 * size), bool)
    for left in (0, size):
        b[size // 10 : -size // 10, left + size // 10 : left + size - size // 10] = True
        a[2 * size // 5 : 3 * size // 5, left + 2 * size // 5 : left + 3 * size // 5] = False
    return a, b


IRREGULAR = {"ring, 1500 px": ring, "L, 3000 px": ell, "two islands, 2000 × 1000 px": islands}


def beside(labels: np.ndarray, both: np.ndarray) -> np.ndarray:
    """Pixels of the overlap on either side of the seam."""
    seam = np.zeros(labels.shape, bool)
    for axis in (0, 1):
        low, high = ((slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None)))
        step = (labels[low] != labels[high]) & both[low] & both[high]
        seam[low] |= step
        seam[high] |= step
    return seam


def unlikeness(a: np.ndarray, b: np.ndarray, both: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """1 - SSIM and (1 - ZNCC) / 2 of every window, means over the channels of (H, W[, 3])."""
    a, b = (one.reshape(*both.shape, -1) for one in (a, b))
    share = np.maximum(uniform_filter(both.astype(float), _WINDOW), 1e-9)
    c1, c2 = 2.55**2, 7.65**2
    ssim, zncc = [], []
    for channel in range(a.shape[2]):
        x, y = (np.where(both, one[..., channel].astype(float), 0) for one in (a, b))
        mean_x, mean_y, xx, yy, xy = (
            uniform_filter(one, _WINDOW) / share for one in (x, y, x * x, y * y, x * y)
        )
        var_x, var_y = np.maximum(xx - mean_x**2, 0), np.maximum(yy - mean_y**2, 0)
        together = xy - mean_x * mean_y
        luminance = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
        ssim.append(luminance * (2 * together + c2) / (var_x + var_y + c2))
        zncc.append((together + c2 / 2) / np.sqrt((var_x + c2 / 2) * (var_y + c2 / 2)))
    return 1 - np.mean(ssim, axis=0), (1 - np.mean(zncc, axis=0)) / 2
