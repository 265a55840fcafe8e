"""Pairs of pictures for the gallery, cut from the images that come with scikit-image and from the samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import skimage.data
from skimage.io import imread

from thesis_cases import Case

Pixels = npt.NDArray[np.uint8]
_FOLDER = Path(skimage.data.__file__).parent
_SAMPLES = Path(__file__).resolve().parents[1] / "samples"


def photograph(name: str) -> npt.NDArray[np.float64]:
    """One of scikit-image's images, (H, W) or (H, W, 3) in [0, 1]."""
    return np.asarray(imread(_FOLDER / name), float) / 255


def still_life() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The two cameras' pictures, (500, 440, 3) and (500, 501, 3); the right one begins
    270 px further right.
    """
    left, right = (
        np.asarray(imread(_SAMPLES / f"still_life_{side}.png"), float) / 255 for side in ("left", "right")
    )
    return left, right


def beside(left: npt.NDArray[np.float64], right: npt.NDArray[np.float64], overlap: int) -> Case:
    """Two patches of one height, side by side."""
    height, width = left.shape[:2]
    total = width + right.shape[1] - overlap
    columns = np.broadcast_to(np.arange(total), (height, total))
    a, b = (np.zeros((height, total, *left.shape[2:])) for _ in range(2))
    a[:, :width], b[:, -right.shape[1] :] = left, right
    return Case(a=a, b=b, mask_a=columns < width, mask_b=columns >= width - overlap)


def pairs() -> list[tuple[str, Case]]:
    """The four pairs of Figure 3.15, patches of 160, 60, 60 and 80 px, each with the name of its source."""
    left, right = still_life()
    # Two crops with the vase's right half in the overlap.
    found = [("still life, two cameras", beside(left[90:250, 270:430], right[90:250, 120:280], 40))]
    for title, name, size, a, b in (
        ("chelsea", "chelsea.png", 60, (92, 158), (112, 208)),
        ("ihc", "ihc.png", 60, (143, 286), (170, 348)),
        ("gravel", "gravel.png", 80, (203, 223), (236, 351)),
    ):
        image = photograph(name)
        crops = (image[y : y + size, x : x + size] for y, x in (a, b))
        found.append((title, beside(*crops, size // 4)))
    return found


def corner(size: int = 280, patch: int = 160, overlap: int = 40) -> Case:
    """Figure 3.22: a patch that fills the missing corner of a larger one, both from the Hubble deep field."""
    sky = photograph("hubble_deep_field.jpg")
    mask_a, mask_b = np.ones((size, size), bool), np.zeros((size, size), bool)
    mask_a[size - patch + overlap :, size - patch + overlap :] = False
    mask_b[size - patch :, size - patch :] = True
    a, b = np.zeros((size, size, 3)), np.zeros((size, size, 3))
    a[mask_a] = sky[420 : 420 + size, 640 : 640 + size][mask_a]
    b[size - patch :, size - patch :] = sky[336 : 336 + patch, 457 : 457 + patch]
    return Case(a=a, b=b, mask_a=mask_a, mask_b=mask_b)
