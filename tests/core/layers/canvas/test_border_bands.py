"""Masks of which only the rims are looked at."""

import numpy as np
import pytest

from toposeam.layers.canvas import Box, Layer, TileMap, common_canvas, dense, full_within, rim, rimmed
from toposeam.layers.canvas import tile_map as maps
from toposeam.layers.labelling import posing
from toposeam.layers.search import cost_coarsening as reduction

SHAPE = (300, 420)


def both_kinds(mask):
    tiled = TileMap(mask.shape, False, bool)
    tiled[:, :] = mask
    return mask, tiled


@pytest.mark.parametrize(
    ("taken", "full"),
    [
        ((), Box(0, 0, 300, 420)),
        ((np.s_[:3], np.s_[:, 418:]), Box(3, 0, 300, 418)),
        ((np.s_[0, 7],), Box(1, 0, 300, 420)),
        ((np.s_[299, 0],), Box(1, 1, 299, 419)),  # in a corner, which no line ends
        ((np.s_[150, 200],), None),
        ((np.s_[:9],), None),  # deeper than anybody looks
        ((np.s_[:],), None),
    ],
)
def test_a_full_box_is_found_close_to_the_borders(taken, full):
    mask = np.ones(SHAPE, bool)
    for part in taken:
        mask[part] = False
    for values in both_kinds(mask):
        assert full_within(values) == full


def test_a_rim_and_its_inner_box_cover_each_pixel_once():
    box, full = Box(2, 3, 40, 60), Box(4, 3, 39, 55)
    seen = np.zeros((50, 70), int)
    seen[full.slices] += 1
    for part in rim(box, full):
        seen[part.slices] += 1
    expected = np.zeros_like(seen)
    expected[box.slices] = 1
    np.testing.assert_array_equal(seen, expected)


def test_nothing_is_looked_at_inside_of_the_rim():
    boxes = []

    def values(box):
        boxes.append(box)
        return False

    found = rimmed((900, 700), Box(1, 0, 898, 700), values)
    assert found[1:898].all()
    assert not found[[0, 898, 899]].any()
    assert sum(box.shape[0] * box.shape[1] for box in boxes) == 3 * 700


def pictures(rng):
    """Two rows of pictures at odd places that overlap; one has a hole, another lacks a corner."""
    layers = []
    for k in range(6):
        alpha = np.full((211 + k, 307), 255, np.uint8)
        if k == 1:
            alpha[100:104, 60:200] = 0
        if k == 4:
            alpha[:30, :50] = 0
        at = (k % 3 * 210 + int(rng.integers(9)), k // 3 * 150 + int(rng.integers(9)))
        layers.append(Layer(np.zeros((*alpha.shape, 3), np.uint8), alpha=alpha, at=at))
    return layers


@pytest.mark.parametrize("tiles", [False, True])
def test_allowed_pixels_by_rims_equal_those_of_a_full_scan(monkeypatch, tiles):
    if tiles:
        monkeypatch.setattr(maps, "DENSE_PIXELS", 0)
        monkeypatch.setattr(maps, "TILE", 32)

    def allowed():
        layers = pictures(np.random.default_rng(2))
        labelling = posing.pose_labelling(common_canvas(layers, max_megapixels=10))
        found = [dense(mask) for mask in labelling.allowed]
        for _ in range(3):
            labelling = reduction.halved(labelling, 0.6)
            found += [dense(mask) for mask in labelling.allowed]
        return found

    by_rims = allowed()
    for module in (posing, reduction):
        monkeypatch.setattr(module, "full_within", lambda mask: None)
    for one, other in zip(by_rims, allowed(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert not all(mask.all() for mask in by_rims)
