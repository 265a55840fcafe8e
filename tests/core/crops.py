"""Layers that are crops of one photograph."""

import numpy as np
from skimage import data

import toposeam as ts

RNG = np.random.default_rng(0)
FIRST = RNG.bit_generator.state
PHOTOGRAPH = data.coffee()[100:, 200:]


def crop(x, y, width=40, height=30, dtype=np.uint8, gray=False, **fields):
    """A layer cut from the photograph at its own place, so that layers agree where they overlap but for a
    little noise.
    """
    image = PHOTOGRAPH[y : y + height, x : x + width].astype(int)
    image = np.clip(image + RNG.integers(-9, 10, image.shape), 0, 255)
    image = image[..., 1] if gray else image
    if np.issubdtype(dtype, np.floating):
        image = image / 255
    elif dtype != np.uint8:
        image = image * (np.iinfo(dtype).max // 255)
    return ts.Layer(image=image.astype(dtype), at=(x, y), **fields)
