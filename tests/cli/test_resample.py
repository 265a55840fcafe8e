"""Pictures warped by libvips, and by the kernel that rounds as it does."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import PlaneTransform
from toposeam_cli.media.pictures.libvips import load_vips
from toposeam_cli.stitching.resample import placed_layers

#: That which the kernel follows to the bit; others may round differently by a level.
FOLLOWED = (8, 18)


@pytest.mark.parametrize("shape", [(150, 180, 3), (150, 180), (9, 300, 3)])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("opaque", [True, False])
def test_kernels_warp_as_libvips_does(dtype, shape, opaque, both_ways):
    rng = np.random.default_rng(3)
    full = 1 if dtype == "float32" else np.iinfo(dtype).max
    pixels = (rng.random(shape) * full).astype(dtype)
    alpha = None if opaque else (rng.random(shape[:2]) * full).astype(dtype)
    turned = PlaneTransform(np.array([[1.02, 0.05, 3.2], [-0.04, 0.97, -7.7], [6e-5, -4e-5, 1.0]]))
    layer = ts.Layer(pixels, alpha=alpha, mask=pixels.reshape(*shape[:2], -1)[..., 0] > full / 2)
    (one,), (other,) = both_ways(lambda: placed_layers([layer], [turned]))
    assert np.array_equal(one.alpha, other.alpha)
    assert np.array_equal(one.mask, other.mask)
    assert one.image.dtype == other.image.dtype
    apart = np.abs(one.image.astype(float) - other.image)
    exact = tuple(load_vips().version(part) for part in (0, 1)) == FOLLOWED
    assert apart.max() <= (0 if exact else full / 255)
    assert other.image.std() > 0.1 * full
