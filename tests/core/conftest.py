"""Real image crops for the core's tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from crops import FIRST, RNG
from skimage import data

PHOTOGRAPHS = ("brick", "grass", "gravel", "coffee", "chelsea", "astronaut", "rocket")

Crops = Callable[[np.random.Generator, int, int], tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]]


@cache
def photograph(name: str) -> npt.NDArray[np.uint8]:
    image: npt.NDArray[np.uint8] = getattr(data, name)()
    return image


@pytest.fixture(autouse=True)
def _same_noise() -> None:
    """Let crops of a test have the same noise whatever ran before."""
    RNG.bit_generator.state = FIRST


@pytest.fixture
def crops() -> Crops:
    """Two crops of one photograph, chosen by the generator: ``crops(rng, height, width)``."""

    def choose(
        rng: np.random.Generator, height: int, width: int
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
        image = photograph(PHOTOGRAPHS[rng.integers(len(PHOTOGRAPHS))])

        def crop() -> npt.NDArray[np.uint8]:
            y, x = rng.integers(image.shape[0] - height + 1), rng.integers(image.shape[1] - width + 1)
            return image[y : y + height, x : x + width]

        return crop(), crop()

    return choose
