"""Corner tiles of two materials: which fit which, what they show, and what is refused."""

import itertools

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts

pytestmark = pytest.mark.medium


def ground(seed, colour, side=80):
    """Soft blots round a colour."""
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), 1.5, mode="wrap")
    return np.uint8(np.clip(np.array(colour) + 40 * noise[..., np.newaxis] / noise.std(), 0, 255))


GRASS, DIRT = ground(0, (60, 150, 50)), ground(1, (160, 110, 60))
HEIGHTS = [np.uint16(one[..., 1]) * 200 for one in (GRASS, DIRT)]


@pytest.fixture(scope="module")
def tiles():
    return ts.texture.tile_set([GRASS, DIRT], 48, variants=2, maps=[HEIGHTS])


def shown(tiles, number):
    return tiles.laid([[number]])


def is_dirt(pixels):
    """The material at each pixel: red against green tells them apart."""
    return pixels[..., 0] > pixels[..., 1].astype(int)


def test_all_corners_twice_on_one_sheet(tiles):
    assert repr(tiles) == "TileSet(32 tiles of 48 × 48 px)"
    assert tiles.image.shape == (8 * 48, 4 * 48, 3)
    assert tiles.image.dtype == np.uint8
    assert sorted(map(tuple, tiles.corners.tolist())) == sorted(2 * list(itertools.product((0, 1), repeat=4)))
    for number, corners in enumerate(tiles.corners):
        dirt = is_dirt(shown(tiles, number))
        found = [
            dirt[rows, columns].mean()
            for rows in (np.s_[:6], np.s_[-6:])
            for columns in (np.s_[:6], np.s_[-6:])
        ]
        np.testing.assert_array_equal(np.array(found) > 0.5, corners == 1)


def test_variants_differ_inside_and_not_at_their_borders(tiles):
    for code in range(16):
        one, two = shown(tiles, code), shown(tiles, code + 16)
        assert (one != two).any(axis=2).mean() > 0.2
        for line in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
            np.testing.assert_array_equal(one[line], two[line])


def test_steps_across_borders_are_no_larger_than_within(tiles):
    rng, found, unfit = np.random.default_rng(0), [], []

    def ratio(numbers):
        field = tiles.laid(numbers).astype(float).mean(axis=2)
        steps = [np.abs(np.diff(values, axis=0)).mean(axis=1) for values in (field, field.T)]
        border = [one[tiles.size - 1 :: tiles.size].mean() for one in steps]
        return np.mean(border) / np.mean([one.mean() for one in steps])

    for _ in range(50):
        numbers = tiles.numbers(rng.random((7, 7)) < 0.5, rng)
        found.append(ratio(numbers))
        unfit.append(ratio(rng.permutation(numbers.ravel()).reshape(numbers.shape)))
    assert max(found) <= 1
    assert min(unfit) > 1.2


def test_corners_choose_tiles_that_agree(tiles):
    grid = np.random.default_rng(0).integers(2, size=(6, 8))
    numbers = tiles.numbers(grid, 1)
    assert numbers.shape == (5, 7)
    assert len(set((numbers // 16).ravel().tolist())) == 2
    corners = tiles.corners[numbers]
    np.testing.assert_array_equal(corners[..., 0], grid[:-1, :-1])
    np.testing.assert_array_equal(corners[..., 3], grid[1:, 1:])
    np.testing.assert_array_equal(corners[:, 1:, 0], corners[:, :-1, 1])
    np.testing.assert_array_equal(corners[1:, :, 1], corners[:-1, :, 3])
    assert tiles.field(3, 5).shape == (144, 240, 3)


def test_values_of_maps_are_moved_not_mixed(tiles):
    (heights,) = tiles.maps
    assert heights.dtype == np.uint16
    hard = ts.texture.tile_set([GRASS, DIRT], 48, variants=2, maps=[HEIGHTS], smooth=0)
    np.testing.assert_array_equal(hard.maps[0], heights)
    np.testing.assert_array_equal(hard.image[..., 1], heights // 200)
    assert 0 < (hard.image != tiles.image).any(axis=2).mean() < 0.5


def test_the_same_seed_makes_the_same_tiles():
    one, again, other = (ts.texture.tile_set([GRASS, DIRT], 32, variants=1, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.image, again.image)
    assert (one.image != other.image).any()


@pytest.mark.parametrize(
    ("sources", "size", "given", "words"),
    [
        ([GRASS], 48, {}, "sources has 1 images"),
        ([GRASS, DIRT], 8, {}, "size is 8"),
        ([GRASS, DIRT], 48, {"variants": 0}, "variants is 0"),
        ([GRASS, DIRT[..., 0] / 255], 48, {}, "dtype"),
        ([GRASS, DIRT], 48, {"maps": [[GRASS]]}, "1 images for 2"),
    ],
)
def test_what_makes_no_tiles_is_refused(sources, size, given, words):
    with pytest.raises(ts.TopoSeamError, match=words):
        ts.texture.tile_set(sources, size, **given)


def test_a_grid_is_of_materials_and_a_field_of_tiles(tiles):
    for corners in ([[0, 2], [0, 0]], [0, 1]):
        with pytest.raises(ts.ImageError, match="give 0 or 1 for each corner"):
            tiles.numbers(corners)
    for numbers in ([[0, 32]], [[-1]], [3], np.zeros((0, 2), int)):
        with pytest.raises(ts.ImageError, match="from 0 to 31"):
            tiles.laid(numbers)
