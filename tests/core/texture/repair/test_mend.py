from types import SimpleNamespace

import numpy as np
import pytest
import skimage.data

import toposeam as ts
from toposeam.texture.repair.mend import _seam_costs


@pytest.mark.medium
def test_mending_makes_the_seams_better():
    image = skimage.data.brick()[:128, :128]

    def total(share):
        made = ts.synthesize(image, 150, patch=32, seed=1, mend=share)
        laid = SimpleNamespace(
            guard=None,
            atlas=made.atlas,
            features=made.atlas.spread([image[..., np.newaxis] / np.float32(255)]),
        )
        return _seam_costs(laid, made.atlas.index_of(made.exemplar, made.source)).sum(), made.count

    (before, patches), (after, more) = total(0), total(1.0)
    assert after < 0.95 * before
    assert more > patches
