"""Two label maps made one: of every patch in which they differ the cheaper one."""

import itertools

import numpy as np
import pytest
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers import levels
from toposeam.layers.choices import Choices
from toposeam.layers.fusion import fused
from toposeam.layers.posing import exclusive_covers, pose_labelling


def five(side=60, seed=0):
    """Five noisy crops of a photograph that all meet."""
    rng = np.random.default_rng(seed)
    photograph = data.coffee()[100:, 150:]
    layers = []
    for x, y in ((0, 0), (side // 2, 4), (6, side // 2), (side // 2, side // 2), (side // 4, side // 4)):
        crop = photograph[y : y + side, x : x + side].astype(int) + rng.integers(-40, 41, (side, side, 3))
        layers.append(ts.Layer(np.clip(crop, 0, 255).astype(np.uint8), at=(x, y), name=f"{x},{y}"))
    canvas = ts.common_canvas(layers)
    covers = exclusive_covers(layers, [canvas.place(layer) for layer in layers], canvas)
    return layers, pose_labelling(layers, canvas, covers)


def with_spots(labelling, seed, count=7):
    """A label map that shows another layer in some squares."""
    rng = np.random.default_rng(seed)
    result = labelling.on_top()
    height, width = result.shape
    for _ in range(count):
        y, x, k = rng.integers(height), rng.integers(width), rng.integers(5)
        part = np.s_[max(y - 6, 0) : y + 6, max(x - 6, 0) : x + 6]
        allowed = labelling.allowed_in(k, labelling.canvas)[part]
        result[part][allowed] = k
    return result


@pytest.mark.parametrize("seed", range(4))
def test_a_fusion_is_the_best_mixture_of_whole_patches(seed):
    _, labelling = five()
    one, other = with_spots(labelling, seed), with_spots(labelling, seed + 100)
    patch, count = ndimage.label(one != other)
    assert 2 <= count <= 14
    costs = []
    for chosen in itertools.product((False, True), repeat=count):
        mixed = np.where(np.array([False, *chosen])[patch], other, one)
        costs.append(labelling.total(mixed, labelling.canvas))
    result = fused(labelling, one, other)
    assert labelling.total(result, labelling.canvas) == pytest.approx(min(costs), rel=1e-6)
    if seed % 2 == 0:  # each has something the other lacks
        assert min(costs) < min(costs[0], costs[-1])


def test_lists_of_pixels_are_fused_as_label_maps_are():
    _, labelling = five()
    one, other = with_spots(labelling, 1), with_spots(labelling, 2)
    canvas = labelling.canvas
    allowed = [labelling.allowed_in(k, canvas) for k in range(5)]
    choices = Choices(labelling, canvas, one, allowed, range(5))
    choices.fuse(other.ravel())
    np.testing.assert_array_equal(choices.label_map(), fused(labelling, one, other))


def test_what_another_reduction_finds_is_taken_where_it_is_cheaper(monkeypatch):
    layers, labelling = five(side=200)
    monkeypatch.setattr(levels, "_ONCE", 0)
    monkeypatch.setattr(levels, "_AFIELD", 10_000)  # reduced as larger problems are
    assert levels.WHOLE_PIXELS < labelling.contested(10**9) < levels._TRIED
    both = ts.stitch(layers, blend="soft", gradient=True)
    monkeypatch.setattr(levels, "OTHERS", ())
    once = ts.stitch(layers, blend="soft", gradient=True)
    assert both.cost < once.cost * 0.9999
    away = both.label_map != once.label_map  # beside these seams are other ones; the rest stays as it is
    assert 0 < away.sum() < away.size // 20
    far = ndimage.distance_transform_edt(~away) > 24
    np.testing.assert_array_equal(both.image[far], once.image[far])


def test_what_costs_are_reduced_to_in_several_ways_is_no_dearer_than_one_way(monkeypatch):
    layers, _ = five(side=200)
    monkeypatch.setattr(levels, "_TRIED", 10**9)
    once = ts.stitch(layers, core=0.5).cost
    monkeypatch.setattr(levels, "_TRIED", 20_000)
    assert ts.stitch(layers, core=0.5).cost < once
