from types import SimpleNamespace

import numpy as np
import pytest
import skimage.data
from scipy import ndimage

import toposeam as ts
from toposeam.texture.repair import seam_mending


def costs_by_definition(placer):
    """What the interfaces to the right and below each pixel of a canvas cost, by their definition."""
    index, width = placer.canvas.index, placer.atlas.width
    values, usable = placer.features.reshape(placer.atlas.usable.size, -1), placer.atlas.usable.ravel()
    cost = np.zeros(index.shape)
    for axis, step in (0, width), (1, 1):
        beside = np.roll(index, -1, axis)
        joint = beside - index != step
        if not placer.canvas.wrap[axis]:
            joint[(slice(None),) * axis + (-1,)] = False
        s, t = index[joint], beside[joint]
        for one, other, known in (s + step, t, s + step), (s, t - step, t - step):
            cost[joint] += np.linalg.norm(values[one] - values[other], axis=1) * usable[known]
    return cost


@pytest.mark.medium
def test_mending_makes_the_seams_better():
    image = skimage.data.brick()[:128, :128]

    def total(share):
        made = ts.synthesize(image, 150, patch=32, seed=1, mend=share)
        laid = SimpleNamespace(
            canvas=SimpleNamespace(
                index=made.atlas.index_of(made.exemplar, made.source), wrap=(False, False)
            ),
            atlas=made.atlas,
            features=made.atlas.spread([image[..., np.newaxis] / np.float32(255)]),
        )
        return costs_by_definition(laid).sum(), made.count

    (before, patches), (after, more) = total(0), total(1.0)
    assert after < 0.95 * before
    assert more > patches


@pytest.mark.parametrize("tileable", ["none", "both"])
def test_the_worst_is_looked_for_in_what_seams_cost_now(monkeypatch, tileable):
    at, changed, worst = [], [], seam_mending._worst

    def watched(placer, local, shape, count):
        costs = costs_by_definition(placer).reshape(20, 8, 20, 8).sum(axis=(1, 3))
        mode = "wrap" if tileable == "both" else "constant"
        near = ndimage.uniform_filter(costs, [max(1, side // 16) for side in shape], mode=mode)
        there = local > 1e-3 * local.max()
        np.testing.assert_allclose(local[there], near[there], rtol=1e-3)
        at.append(there.sum())
        changed.append(near.sum())
        return worst(placer, local, shape, count)

    monkeypatch.setattr(seam_mending, "_worst", watched)
    ts.synthesize(skimage.data.brick()[:96, :96], 160, patch=24, seed=1, mend=1.0, tileable=tileable)
    assert at[0] > 50
    assert changed[-1] < 0.98 * changed[0]
