"""Objects few on a ground, laid last: whole, on their shares, and none that the border cuts."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.texture.exemplar import Atlas
from toposeam.texture.objects import atlas_without, find_scattered

SIDE = 160


def meadow(*discs):
    """Grainy ground with discs (row, column, radius), and the number of the disc at each pixel."""
    rng = np.random.default_rng(0)
    ground = 0.4 + 0.06 * ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE, 3)), (1, 1, 0))
    objects = np.zeros((SIDE, SIDE), int)
    y, x = np.mgrid[:SIDE, :SIDE]
    for number, (row, column, radius) in enumerate(discs, start=1):
        objects[np.hypot(y - row, x - column) < radius] = number
    ground[objects > 0] = 0.85, 0.8, 0.75
    return ground.astype(np.float32), objects


def copies(made, objects):
    """Number of the disc, and of the pixels, of each copy of a disc in a texture."""
    shown = objects[made.source[..., 0], made.source[..., 1]]
    at = np.argwhere(shown > 0)
    kinds, counts = np.unique(
        np.column_stack([shown[shown > 0], (at - made.source[shown > 0]) % made.labels.shape]),
        axis=0,
        return_counts=True,
    )
    return kinds[:, 0], counts


def of(image):
    atlas = Atlas.of([np.ones(image.shape[:2], bool)], 8)
    return atlas, find_scattered(atlas.spread([image]), atlas)


@pytest.mark.parametrize("tileable", ["both", "x"])
def test_large_and_small_objects_are_whole_and_on_share(tileable):
    image, objects = meadow((60, 100, 26), (30, 30, 9), (120, 30, 9), (130, 130, 9))
    made = ts.synth(image, (400, 400), tileable=tileable, seed=3)
    numbers, counts = copies(made, objects)
    areas = np.bincount(objects.ravel())
    if tileable == "both":
        assert (counts >= 0.98 * areas[numbers]).all()
    for kinds in ([1], [2, 3, 4]):
        pixels = counts[np.isin(numbers, kinds)].sum() / made.labels.size
        assert pixels == pytest.approx(areas[kinds].sum() / objects.size, rel=0.3)


def test_what_the_border_cuts_is_never_shown():
    image, objects = meadow((3, 70, 22), (90, 60, 12), (110, 120, 12))
    made = ts.synth(image, (320, 320), tileable="both")
    numbers, counts = copies(made, objects)
    assert set(numbers.tolist()) == {2, 3}
    assert (counts >= 0.98 * np.bincount(objects.ravel())[numbers]).all()


def test_a_sample_of_cut_objects_alone_gives_bare_ground():
    image, objects = meadow((2, 60, 30), (100, 158, 24))
    made = ts.synth(image, (256, 256))
    assert not copies(made, objects)[0].size


def test_objects_that_nearly_touch_are_several():
    image, _ = meadow((80, 60, 14), (80, 95, 14))
    _, found = of(image)
    assert len(found.objects) == 2


def test_textures_without_objects_have_none():
    rng = np.random.default_rng(1)
    image = ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE, 3)), (3, 3, 0)).astype(np.float32)
    assert of(image)[1] is None


def test_patches_find_room_in_the_ground():
    image, _ = meadow((80, 80, 30))
    atlas, found = of(image)
    side = found.side_for(88)
    assert 28 <= side < 88
    assert (atlas_without(found, atlas).copied & found.shown).sum() == 0


def test_the_texture_is_the_same_for_two_processes():
    image, _ = meadow((60, 100, 20), (110, 40, 12))
    one, two = (ts.synth(image, (200, 220), processes=n, setting="varied") for n in (1, 2))
    np.testing.assert_array_equal(one.image, two.image)
