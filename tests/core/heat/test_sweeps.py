"""Sweeps: the kernel moves heat as NumPy does, to the bit."""

import numpy as np
import pytest

from toposeam import _kernels
from toposeam.heat.grid_flow import GridFlow


@pytest.mark.skipif(_kernels.library is None, reason="there is no kernel")
@pytest.mark.parametrize("shape", [(5, 9, 30), (17, 8, 23), (2, 40, 3)])
def test_the_kernel_moves_heat_as_numpy_does(shape, monkeypatch):
    rng = np.random.default_rng(0)
    costs = [
        rng.random([n - (place == axis) for place, n in enumerate(shape)], dtype=np.float32) ** 4
        for axis in range(3)
    ]
    fixed = np.zeros(shape, bool)
    fixed[0] = fixed[-1] = True
    hot = fixed.copy()
    hot[0] = False

    def swept():
        flow = GridFlow(costs, fixed, hot)
        flow.sweep(130)
        return flow.potential, *flow.filled

    compiled = swept()
    monkeypatch.setattr(_kernels, "library", None)
    for one, other in zip(compiled, swept(), strict=True):
        np.testing.assert_array_equal(one, other)
