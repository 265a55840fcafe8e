import numpy as np
import pytest
from scipy import ndimage


@pytest.fixture(scope="session")
def sample():
    """A function: smooth random structure of some seed, shape and channels, uint8."""

    def make(seed=0, shape=(64, 72), channels=None, dtype=np.uint8):
        rng = np.random.default_rng(seed)
        planes = [
            ndimage.gaussian_filter(rng.normal(size=shape), 1.5, mode="wrap") for _ in range(channels or 1)
        ]
        values = np.stack(planes, axis=2)
        values = (values - values.min()) / np.ptp(values)
        top = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
        image = (
            np.rint(values * top).astype(dtype) if np.issubdtype(dtype, np.integer) else values.astype(dtype)
        )
        return image if channels else image[..., 0]

    return make
