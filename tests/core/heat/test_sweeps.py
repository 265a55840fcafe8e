"""Sweeps: the kernel, where it was built, moves heat as NumPy does, to the bit."""

import numpy as np
import pytest

import toposeam as ts


@pytest.mark.parametrize("shape", [(5, 9, 30), (17, 8, 23), (4, 40, 5)])
def test_the_kernel_moves_heat_as_numpy_does(shape, monkeypatch):
    a, b = np.random.default_rng(0).random((2, *shape), dtype=np.float32)

    def found():
        return ts.find_surface(a, b, data_range=1.0, max_iterations=150)

    compiled = found()
    monkeypatch.setattr("toposeam._kernels.library", None)
    plain = found()
    np.testing.assert_array_equal(compiled.labels, plain.labels)
    np.testing.assert_array_equal(compiled.soft, plain.soft)
