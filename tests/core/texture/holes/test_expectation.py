"""What is expected in a hole, and how much memory that takes."""

import tracemalloc

import numpy as np
import pytest
from scipy import ndimage

from toposeam.texture.holes.distances import distance_from
from toposeam.texture.holes.expectation import expectation


@pytest.mark.parametrize("shape", [(1, 5), (70, 33), (300, 200)])
def test_distances_are_those_of_the_transform(shape):
    mask = np.random.default_rng(0).random(shape) < 0.02
    mask[0, 0] = True
    np.testing.assert_array_equal(distance_from(mask), ndimage.distance_transform_edt(~mask))


def test_what_is_expected_takes_little_memory():
    """Bytes a pixel beside the picture, of which 40 are the result."""
    features = np.random.default_rng(0).random((400, 400, 3)).astype(np.float32)
    hole = np.zeros((400, 400), bool)
    hole[150:250, 150:250] = True
    tracemalloc.start()
    try:
        expectation(features, hole, np.ones_like(hole))
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most / hole.size < 100  # 90; whole transforms of distances made it 126
