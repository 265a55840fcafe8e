"""Places that pictures say themselves: how far the search is, and how little of it is needed."""

import numpy as np
import pytest
from skimage import data, feature

import toposeam as ts
from toposeam.layers import pairing
from toposeam.layers.features import Look, look_at, shared_features

WHOLE = data.camera()[120:220, 100:360]


def crops(*lefts):
    return [ts.Layer(WHOLE[:, left : left + 120].copy(), name=str(left)) for left in lefts]


def counted(monkeypatch, name):
    """How often a function of the module is called."""
    calls, own = [], getattr(pairing, name)
    monkeypatch.setattr(pairing, name, lambda *given: (calls.append(given), own(*given))[1])
    return calls


def test_progress_tells_of_each_picture_and_each_pair():
    seen = []
    found = ts.find_places(crops(0, 70, 140), progress=seen.append)
    assert [layer.at[0] for layer in found.layers] == pytest.approx([0, 70, 140], abs=1)
    looked, shared = [0.1, 0.2, 0.3], [0.3 + 0.2 / 3, 0.3 + 0.4 / 3, 0.5]
    compared = [0.5 + 0.4 / 3, 0.5 + 0.8 / 3, 0.9]
    assert seen == pytest.approx([*looked, *shared, *compared, 1.0])


@pytest.mark.medium
def test_equal_pictures_are_looked_at_once(monkeypatch):
    looks, tried = counted(monkeypatch, "look_at"), counted(monkeypatch, "_match")
    found = ts.find_places(crops(*[0] * 8, *[40] * 8))
    assert len(looks) == 2
    assert len(tried) <= 3  # the first with itself, with the second, and that with itself
    assert [layer.at[0] for layer in found.layers] == pytest.approx([0] * 8 + [40] * 8, abs=1)


def test_what_makes_pictures_equal_is_all_that_is_compared():
    one, hole = WHOLE[:, :120], np.ones((100, 120), bool)
    hole[3, 5] = False
    unlike = [
        ts.Layer(one),
        ts.Layer(one, mask=hole),
        ts.Layer(one.astype(np.uint16)),
        ts.Layer(one.astype(np.uint16), data_range=255),
        ts.Layer(np.ascontiguousarray(one.T)),
        ts.Layer(one[..., np.newaxis].repeat(3, 2)),
    ]
    assert len({pairing._digest(layer) for layer in unlike}) == len(unlike)
    assert pairing._digest(ts.Layer(one, at=(5, 5), name="x")) == pairing._digest(ts.Layer(one.copy()))


@pytest.mark.slow
def test_pictures_that_enough_pairs_join_are_not_tried_with_each_other(monkeypatch):
    tried = counted(monkeypatch, "_match")
    assert len(ts.find_places(crops(0, 15, 30, 45)).correlations) == len(tried) == 6
    tried.clear()
    monkeypatch.setattr(pairing, "_FORESTS", 1)
    found = ts.find_places(crops(0, 15, 30, 45))
    assert len(found.correlations) == len(tried) == 3  # a tree of four
    assert [layer.at[0] for layer in found.layers] == pytest.approx([0, 15, 30, 45], abs=1)


def test_shared_features_are_those_of_skimage():
    first, second = (look_at(layer) for layer in crops(0, 30))
    expected = feature.match_descriptors(
        first.descriptors, second.descriptors, max_ratio=0.85, cross_check=True
    )
    assert len(expected) > 5
    np.testing.assert_array_equal(shared_features(first, second), expected)
    nothing = Look(first.detail, first.known, 1, np.zeros((0, 2)), None)
    assert shared_features(first, nothing).shape == (0, 2)
    single = Look(first.detail, first.known, 1, first.keypoints[:1], first.descriptors[:1])
    expected = feature.match_descriptors(
        first.descriptors, single.descriptors, max_ratio=0.85, cross_check=True
    )
    np.testing.assert_array_equal(shared_features(first, single), expected)


def test_features_that_moved_every_which_way_are_not_tried(monkeypatch):
    a, b = (look_at(layer) for layer in crops(0, 30))
    found = shared_features(a, b)
    assert pairing._agree(a, b, found)
    rng = np.random.default_rng(0)
    far = Look(b.detail, b.known, 1, rng.uniform(-4000, 4000, b.keypoints.shape), b.descriptors)
    assert not pairing._agree(a, far, found)
    assert pairing._match(a, far, found) is None
