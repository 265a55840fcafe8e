"""Overlaps of every topology, as pairs of masks on one canvas."""

from __future__ import annotations

import numpy as np


def ring(height: int = 60, width: int = 70) -> tuple[np.ndarray, np.ndarray]:
    """``a`` has a hole, ``b`` covers the hole and a rim of ``a``: the seam is closed."""
    a, b = np.ones((height, width), bool), np.zeros((height, width), bool)
    a[height // 2 - 8 : height // 2 + 8, width // 2 - 9 : width // 2 + 9] = False
    b[10:-10, 8:-9] = True
    return a, b


def four_gaps(size: int = 50) -> tuple[np.ndarray, np.ndarray]:
    """A cross: ``a`` runs from left to right, ``b`` from top to bottom; where they cross, four gaps meet two
    seams.
    """
    a, b = np.zeros((size, size), bool), np.zeros((size, size), bool)
    a[size // 4 : -size // 4] = True
    b[:, size // 5 : -size // 5] = True
    return a, b


def two_islands(height: int = 60, width: int = 90) -> tuple[np.ndarray, np.ndarray]:
    """Two separate pieces of ``b`` inside ``a``, each on a hole of ``a``."""
    a, b = np.ones((height, width), bool), np.zeros((height, width), bool)
    for x in (10, 52):
        b[12:44, x : x + 28] = True
        a[24:31, x + 10 : x + 17] = False
    return a, b


def ell(size: int = 80, arm: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """``b`` lies on the lower right corner of ``a``: an L-shaped overlap."""
    a, b = np.zeros((size, size), bool), np.zeros((size, size), bool)
    a[:-arm, :] = True
    a[:, :-arm] = True
    b[-2 * arm :, -2 * arm :] = True
    return a, b


def separate_overlaps(height: int = 50, width: int = 90) -> tuple[np.ndarray, np.ndarray]:
    """``b`` is a frame piece that meets ``a`` in two places."""
    a, b = np.zeros((height, width), bool), np.zeros((height, width), bool)
    a[:, :25] = True
    a[:, -25:] = True
    b[10:-10, 12:-12] = True
    return a, b


def ragged(height: int = 60, width: int = 60, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Left and right patches with ragged ends."""
    rng = np.random.default_rng(seed)
    columns = np.arange(width)
    end_a = width - 15 + np.cumsum(rng.integers(-1, 2, height))
    start_b = 15 + np.cumsum(rng.integers(-1, 2, height))
    return columns < end_a[:, None], columns > start_b[:, None]


SHAPES = {
    "ring": ring,
    "four gaps": four_gaps,
    "two islands": two_islands,
    "ell": ell,
    "separate overlaps": separate_overlaps,
    "ragged": ragged,
}
