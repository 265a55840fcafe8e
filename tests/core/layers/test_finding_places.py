"""Places that pictures say themselves: how far the search is, and how little of it is needed."""

import dataclasses
import itertools

import numpy as np
import pytest
from PIL import Image
from skimage import data, feature
from threadpoolctl import threadpool_info, threadpool_limits

import toposeam as ts
from toposeam.layers.registration import describe_picture
from toposeam.layers.registration import pair_matching as pairing
from toposeam.layers.registration import pose_graph as adjustment
from toposeam.layers.registration.features import FeatureSet, shared_features
from toposeam.layers.registration.refusals import check_joined

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


@pytest.mark.parametrize("name", ["shared_features", "_match_similarity"])
def test_pairs_are_compared_on_one_thread(name, monkeypatch):
    """On several they wait for each other: many times as long on small matrices."""
    own, threads = getattr(pairing, name), []

    def looked(*given):
        threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        return own(*given)

    monkeypatch.setattr(pairing, name, looked)
    with threadpool_limits(2, "blas"):
        ts.find_places(crops(0, 70))
    assert set(threads) == {1}


@pytest.mark.medium
def test_equal_pictures_are_looked_at_once(monkeypatch):
    looks, tried = counted(monkeypatch, "describe_picture"), counted(monkeypatch, "_match_similarity")
    found = ts.find_places(crops(*[0] * 8, *[40] * 8))
    assert len(looks) == 2
    # The first with itself, with the second, and that with itself.
    assert len({(id(one), id(other)) for one, other, *_ in tried}) <= 3
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
def test_pictures_joined_by_enough_pairs_are_matched_no_more(monkeypatch):
    tried = counted(monkeypatch, "_match_similarity")
    assert len(ts.find_places(crops(0, 15, 30, 45)).correlations) == len(tried) == 6
    tried.clear()
    monkeypatch.setattr(pairing, "_FORESTS", 1)
    found = ts.find_places(crops(0, 15, 30, 45))
    assert len(found.correlations) == len(tried) == 3  # a tree of four
    assert [layer.at[0] for layer in found.layers] == pytest.approx([0, 15, 30, 45], abs=1)


def test_shared_features_are_those_of_skimage():
    first, second = (describe_picture(layer) for layer in crops(0, 30))
    expected = feature.match_descriptors(
        first.descriptors, second.descriptors, max_ratio=0.85, cross_check=True
    )
    assert len(expected) > 5
    np.testing.assert_array_equal(shared_features(first, second), expected)
    nothing = FeatureSet(first.detail, first.known, 1, np.zeros((0, 2)), np.zeros((0, 128), np.uint8))
    assert shared_features(first, nothing).shape == (0, 2)
    single = FeatureSet(first.detail, first.known, 1, first.keypoints[:1], first.descriptors[:1])
    expected = feature.match_descriptors(
        first.descriptors, single.descriptors, max_ratio=0.85, cross_check=True
    )
    np.testing.assert_array_equal(shared_features(first, single), expected)


def test_features_that_moved_every_which_way_are_not_tried(monkeypatch):
    a, b = (describe_picture(layer) for layer in crops(0, 30))
    found = shared_features(a, b)
    assert pairing._moved_alike(a, b, found)
    rng = np.random.default_rng(0)
    far = FeatureSet(b.detail, b.known, 1, rng.uniform(-4000, 4000, b.keypoints.shape), b.descriptors)
    assert not pairing._moved_alike(a, far, found)
    assert pairing._match_similarity(a, far, found) is None


def matches_of(truth, rng, noise, count=20):
    """Pairs of neighbours in a row of pictures of 100 × 100 px, as patches with independent errors."""
    found = {}
    for i, (one, other) in enumerate(itertools.pairwise(truth)):
        first = rng.uniform((70, 5), (95, 95), (count, 2))
        seen = (first[:, 0] + 1j * first[:, 1]) * np.exp(1j * one[1]) + one[0] - other[0]
        seen = seen * np.exp(-1j * other[1]) + rng.normal(0, noise, (count, 2)) @ [1, 1j]
        found[i, i + 1] = pairing.Match(
            first=first, second=np.stack([seen.real, seen.imag], axis=1), correlation=1.0
        )
    return found


def test_a_few_poor_patches_are_no_reason_to_turn_pictures():
    rng = np.random.default_rng(5)
    matches = matches_of([(80.0 * i + 3j * i, 0.0) for i in range(5)], rng, 0.05)
    last = matches[3, 4]
    off = 0.4 + 0.01 * (last.first[:, 1] - 50)  # blurred, and seen as if turned
    matches[3, 4] = dataclasses.replace(last, second=last.second + np.stack([off, off], axis=1))
    few = {key: dataclasses.replace(m, first=m.first[:6], second=m.second[:6]) for key, m in matches.items()}
    matches[3, 4] = few[3, 4]
    sizes = np.full((5, 2), 100)
    transforms = adjustment.adjust_transforms(sizes, matches).transforms
    assert (transforms[:, 1] == 0).all()
    turned = matches_of([(80.0 * i, 0.02 * (i % 2)) for i in range(5)], rng, 0.05)
    transforms = adjustment.adjust_transforms(sizes, turned).transforms
    np.testing.assert_allclose(transforms[:, 1], [0, 0.02, 0, 0.02, 0], atol=2e-3)


def test_pictures_are_turned_for_a_small_gain_in_misfit():
    """Shifts alone leave a quarter of a pixel between the patches, and a pixel and more at the corners."""
    matches = matches_of([(80.0 * i, 0.01 * (i % 2)) for i in range(5)], np.random.default_rng(5), 0.05)
    shifted = adjustment.least_squares(5, matches, "shift")
    found = adjustment.adjust_transforms(np.full((5, 2), 100), matches)
    assert shifted.misfit < 0.35
    np.testing.assert_allclose(found.transforms[:, 1], [0, 0.01, 0, 0.01, 0], atol=2e-3)


def test_turns_below_a_third_of_a_pixel_are_not_made():
    matches = matches_of([(80.0 * i, 0.002 * (i % 2)) for i in range(5)], np.random.default_rng(5), 0.01)
    assert (adjustment.adjust_transforms(np.full((5, 2), 100), matches).transforms[:, 1] == 0).all()
    matches = matches_of([(80.0 * i, 0.008 * (i % 2)) for i in range(5)], np.random.default_rng(5), 0.01)
    assert (adjustment.adjust_transforms(np.full((5, 2), 20), matches).transforms[:, 1] == 0).all()
    assert (adjustment.adjust_transforms(np.full((5, 2), 300), matches).transforms[:, 1] != 0).any()


def test_matching_errors_along_a_narrow_overlap_do_not_scale():
    """As phase correlation finds them on an overlap of 60 px: they would move corners by half a pixel."""
    rng = np.random.default_rng(5)
    match = matches_of([(0.0, 0.0), (120.0, 0.0)], rng, 0.0)[0, 1]
    first = rng.uniform((120, 8), (180, 160), (40, 2))
    off = 0.002 * (first - first.mean(axis=0)) + rng.normal(0, 0.02, (40, 2))
    second = first - (120, 8) + off
    matches = {(0, 1): dataclasses.replace(match, first=first, second=second)}
    found = adjustment.adjust_transforms(np.array([[160, 180], [152, 180]]), matches).transforms
    np.testing.assert_allclose(found[1], [1, 0, 120, 8], atol=0.05)


def test_how_far_corners_are_open_is_how_far_they_scatter():
    truth = [(80.0 * i, 0.01 * i) for i in range(4)]
    sizes, ends = np.full((4, 2), 100), np.array([0, 100, 100 + 100j, 100j])
    said, scatter = [], []
    for seed in range(60):
        matches = matches_of(truth, np.random.default_rng(seed), 0.1)
        found = adjustment.least_squares(len(sizes), matches, "turn")
        transforms = found.transforms
        open_ = adjustment.open_corners(sizes, found)
        places = (transforms[:, 2:] @ [1, 1j])[:, np.newaxis] + ends * (transforms[:, :2] @ [1, 1j])[
            :, np.newaxis
        ]
        scatter.append(places.ravel())
        said.append(open_)
    mean = np.mean(scatter, axis=0)
    left = []
    for one in scatter:  # without what all of them may be shifted and turned by
        basis = np.stack([one, np.ones_like(one)], axis=1)
        left.append(basis @ np.linalg.lstsq(basis, mean, rcond=None)[0] - mean)
    seen = np.sqrt(np.mean(np.abs(left) ** 2, axis=0)).reshape(4, 4).max(axis=1)
    # One in 16 is counted here, where errors are independent.
    np.testing.assert_allclose(np.mean(said, axis=0) / 4, seen, rtol=0.35)


def test_a_large_unrelated_group_is_named_in_part():
    pictures = [ts.Layer(WHOLE[:, :20], name=f"p{index}") for index in range(30)]
    matches = {(index, index + 1): None for index in range(29) if index != 14}
    few = "p15 and p16, p17, p18, p19, p20, p21, p22, 7 more show something else"
    with pytest.raises(ts.OverlapError, match=few):
        check_joined(pictures, matches, np.ones(30), 0.5)
    with pytest.raises(ts.OverlapError, match="p15 and p16, p17, p18, p19 show something else"):
        check_joined(pictures[:20], {pair: None for pair in matches if pair[1] < 20}, np.ones(20), 0.5)


def test_arrays_are_pictures_named_by_number():
    whole = data.camera()[100:260, :300]
    found = ts.find_places([whole[:, :180], Image.fromarray(whole[:, 120:])])
    assert [(layer.at, layer.name) for layer in found.layers] == [
        ((0, 0), "picture 1"),
        ((120, 0), "picture 2"),
    ]
