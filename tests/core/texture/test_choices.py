"""What a texture is grown from and how: turned samples, variation, transparent ones, previews."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.exemplar import Atlas
from toposeam.texture.placement import LayOptions, PatchPlacer


def test_patches_are_taken_from_every_position_of_the_sample():
    rng = np.random.default_rng(3)
    sample = ndimage.gaussian_filter(rng.random((64, 50, 3)), (1, 1, 0))
    height = rng.random((64, 50))
    for turns, kinds in (("mirror", 2), ("quarters", 4), ("all", 8)):
        made = ts.synthesize(sample, (150, 160), patch=24, turns=turns, smooth=0, level=False)
        assert set(np.unique(made.exemplar)) <= set(range(kinds))
        assert len(np.unique(made.exemplar)) > kinds / 2
        assert (made.apply(sample) == made.image).all()
        again = ts.texture.apply_coordinates(sample, made.source, made.exemplar, turns=turns, smooth=0)
        assert (again == made.image).all()
        # Every pixel is one of the sample's: the one that its position says.
        number, place = made.exemplar, made.source
        turn = [
            np.rot90(height[:, ::-1] if k >= 4 or (kinds == 2 and k) else height, k % 4 if kinds > 2 else 0)
            for k in range(kinds)
        ]
        cut = made.apply(height)
        y, x = np.mgrid[:150:7, :160:7]
        wanted = [
            turn[k][tuple(at)] for k, at in zip(number[y, x].ravel(), place[y, x].reshape(-1, 2), strict=True)
        ]
        assert (cut[y, x].ravel() == wanted).all()


def test_a_guide_stands_for_turned_samples_too():
    sample = np.random.default_rng(1).random((60, 44))
    made = ts.synthesize(
        sample,
        (80, 90),
        patch=20,
        turns="quarters",
        guide=np.zeros((80, 90)),
        guide_source=sample,
        guide_weight=0.9,
        shares=[1.0],
    )
    assert made.image.mean() < sample.mean()
    assert made.settings["shares"] == [1.0]


def test_variation_evens_out_what_shows():
    sample = ndimage.gaussian_filter(np.random.default_rng(0).random((72, 72)), 1.5)

    def shown(variation):
        uneven = []
        for seed in range(3):
            made = ts.synthesize(sample, (220, 220), patch=24, variation=variation, seed=seed)
            at = made.source[..., 0] * 72 + made.source[..., 1]
            uneven.append(np.bincount(at.ravel(), minlength=72 * 72).std())
        return np.mean(uneven)

    low, usual, high = shown(0), shown(0.5), shown(1)
    assert low > 1.5 * usual
    assert high < 1.05 * usual
    made = ts.synthesize(sample, (100, 100), patch=24, variation=0.5)
    assert (made.image == ts.synthesize(sample, (100, 100), patch=24).image).all()
    with pytest.raises(ts.OptionError, match=r"variation stands for .*leave out variety"):
        ts.synthesize(sample, 100, variation=0.2, variety=1)
    with pytest.raises(ts.OptionError, match="variation"):
        ts.synthesize(sample, 100, variation=1.5)


def _lace():
    """A net with holes everywhere: what is not opaque is black as files often have it."""
    y, x = np.mgrid[:80, :80]
    grain = np.random.default_rng(0).random((80, 80, 3))
    opaque = ((y % 16) < 5) | ((x % 20) < 6)
    colour = np.where(opaque[..., None], 0.8 + 0.2 * grain, 0.0)
    return (255 * colour).astype(np.uint8), np.where(opaque, 255, 0).astype(np.uint8)


def test_transparent_textures_keep_their_holes():
    image, alpha = _lace()
    with pytest.raises(ts.ImageError, match="no place that shows has room"):
        ts.synthesize(image, (150, 160), patch=32, alpha=alpha)
    # In step all copies agree.
    made = ts.synthesize(image, (150, 160), patch=32, alpha=alpha, transparent=True, seed=1, close=False)
    assert (made.source >= 0).all()
    assert abs((made.alpha > 127).mean() - (alpha > 127).mean()) < 0.05
    # Where something shows it is as light as the net: nothing of the black below the holes is mixed in.
    assert made.image[made.alpha > 0].min() >= 0.8 * 255 - 1
    assert (made.alpha[(made.alpha > 0) & (made.alpha < 255)]).size  # seams are mixed, opacity as well
    with pytest.raises(ts.OptionError, match="transparent is for samples with opacity"):
        ts.synthesize(image, 100, patch=32, transparent=True)
    with pytest.raises(ts.OptionError, match="leave out transparent, or level"):
        ts.synthesize(image, 100, patch=32, alpha=alpha, transparent=True, level=True)


def test_colours_that_cannot_be_seen_do_not_decide_what_fits():
    image, alpha = _lace()
    bright = np.where(alpha[..., None] > 0, image, np.random.default_rng(2).integers(0, 256, image.shape))
    one, other = (
        ts.synthesize(given.astype(np.uint8), (100, 100), patch=32, alpha=alpha, transparent=True)
        for given in (image, bright)
    )
    assert (one.source == other.source).all()


def test_a_texture_can_be_looked_at_while_it_grows():
    sample, seen = np.random.default_rng(0).integers(1, 256, (64, 64, 3), np.uint8), []
    made = ts.synthesize(sample, (100, 1100), patch=32, preview=seen.append)
    assert 4 <= len(seen) <= 13
    shown = [int((picture > 0).all(axis=2).sum()) for picture in seen]
    assert shown == sorted(shown)
    assert shown[0] < 0.2 * shown[-1]
    assert seen[-1].shape == (34, 367, 3)  # every third pixel
    assert seen[-1].dtype == made.image.dtype
    assert (made.image == ts.synthesize(sample, (100, 1100), patch=32).image).all()


def test_no_patch_shows_its_own_mirror_image_beside_it():
    # A sample that fits nothing so well as its own mirror image.
    sample = ndimage.gaussian_filter(np.random.default_rng(5).random((96, 96)), 3)
    made = ts.synthesize(sample, (240, 240), patch=32, turns="all", level=False, mend=0)
    # Where copies in two positions meet: how often does a pixel's neighbour show what the pixel itself shows,
    # or nearly so, in another position?
    turn = [
        np.rot90(
            np.arange(96 * 96).reshape(96, 96)[:, ::-1] if k >= 4 else np.arange(96 * 96).reshape(96, 96), k
        )
        for k in range(8)
    ]
    first = np.stack(turn)[made.exemplar, made.source[..., 0], made.source[..., 1]]
    y, x = np.divmod(first, 96)
    meets = np.diff(made.exemplar, axis=1) != 0
    apart = np.hypot(np.diff(y, axis=1), np.diff(x, axis=1))[meets]
    assert len(apart) > 300
    assert (apart <= 10).mean() < 0.02  # 0.11 where nothing forbids it


def test_what_would_join_two_copies_counts_as_both(sample):
    """Either alone leaves room for a patch between them; together they are too large."""
    image = sample(6, (128, 128)) / np.float32(255)
    atlas = Atlas.of([np.ones(image.shape, bool)], 8)
    itself = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[atlas.places[0]]
    features = atlas.spread([image[..., np.newaxis]])
    row, column = (side.start for side in atlas.places[0])
    for parts, allowed in (([0], True), ([56], True), ([0, 56], False)):
        canvas = IndexCanvas((200, 200), (False, False), atlas.usable.size)
        for left in parts:
            canvas.paint(0, left, itself[:24, left : left + 40], np.ones((24, 40), bool))
        options = LayOptions(copy_share=1.0)  # at most three patches of 24 × 24 px
        placer = PatchPlacer(atlas, features, canvas, options, np.random.default_rng(0), 40_000)
        offers = placer.ranking.offers(placer.site(8, 36, (24, 24)))
        found = list(zip(offers.rows.tolist(), offers.columns.tolist(), strict=True))
        assert ((row + 8, column + 36) in found) == allowed


def test_maps_that_are_no_sequence_are_refused():
    sample = np.random.default_rng(0).random((48, 48))
    for call in (
        lambda: ts.synthesize(sample, (60, 60), maps=3.5),
        lambda: ts.synthesize(sample, (60, 60), maps=3.5, flatten=True),
        lambda: ts.fill(sample, sample > 0.99, maps=3.5),
        lambda: ts.make_tileable(sample, maps=3.5),
    ):
        with pytest.raises(ts.OptionError, match=r"maps is 3\.5; pass a sequence of images"):
            call()
