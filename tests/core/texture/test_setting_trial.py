"""Which setting patches are laid with: tried, judged, chosen, or named."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts

pytestmark = pytest.mark.medium


def windows(side=144):
    """Three by three windows of unlike sizes in a wall: few elements, in no strict order."""
    rng, pixels = np.random.default_rng(5), np.full((side, side, 3), 120.0)
    for top in range(8, side, side // 3):
        for left in range(8, side, side // 3):
            height, width = rng.integers(26, 34, 2)
            pixels[top : top + height, left : left + width] = (30, 40, 60)
            pixels[top + 3 : top + height - 3, left + 3 : left + width - 3] = (200, 210, 220)
    return np.clip(pixels + rng.normal(0, 3, pixels.shape), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def grown():
    return ts.synthesize(windows(), 300, level=False)


def test_the_best_setting_that_was_tried_is_taken(grown):
    assert set(grown.tried) == set(ts.texture.SETTINGS)
    assert next(iter(grown.tried)) == grown.settings["setting"]
    varied = ts.synthesize(windows(), 300, level=False, setting="varied")
    assert grown.verdict.noticed < 0.5 * varied.verdict.noticed
    assert grown.settings["setting"] != "varied"


def test_bad_ones_are_given_up(grown):
    assert None in grown.tried.values()
    assert grown.tried["varied"] is not None  # what objects it cut may be made whole in the end
    assert grown.tried[grown.settings["setting"]].shown > 0.3


def test_a_setting_that_is_named_is_not_tried(grown):
    given = {name: grown.settings[name] for name in ("setting", "lattice", "close")}
    named = ts.synthesize(windows(), 300, level=False, **given)
    assert named.tried == {}
    assert (named.image == grown.image).all()
    again = ts.synthesize(windows(), 300, level=False)
    assert (again.image == grown.image).all()
    assert again.settings == grown.settings


@pytest.mark.parametrize(
    "given", [{"patch": 24}, {"variation": 0.5}, {"most": 2.5}, {"options": ts.texture.LayOptions()}]
)
def test_who_says_how_patches_are_is_asked_nothing(given):
    made = ts.synthesize(windows(96), 60, **given)
    assert made.tried == {}
    assert made.settings["setting"] is None
    with pytest.raises(ts.OptionError, match=f"leave out {next(iter(given))}, or setting") as caught:
        ts.synthesize(windows(96), 60, setting="coarse", **given)
    assert caught.value.kind == "conflict"


def test_options_beside_a_setting_count():
    assert ts.synthesize(windows(96), 60, setting="fine", mend=0, overlap=0.5).settings["mend"] == 0
    with pytest.raises(ts.OptionError, match="setting"):
        ts.synthesize(windows(96), 60, setting="large")


def test_coarse_patches_are_half_of_the_sample():
    coarse, fine = (ts.synthesize(windows(), 160, setting=name).patch for name in ("coarse", "fine"))
    assert coarse == (79, 79)
    assert fine[0] <= 36


def test_objects_on_a_ground_stay_whole():
    rng, pixels = np.random.default_rng(1), np.full((160, 160, 3), (70.0, 110.0, 50.0))
    y, x = np.mgrid[:160, :160]
    for row, column in ((30, 36), (36, 110), (84, 70), (120, 30), (118, 126)):
        pixels[np.hypot(y - row, x - column) < 17] = (190, 40, 35)
    made = ts.synthesize(np.clip(pixels + rng.normal(0, 8, pixels.shape), 0, 255).astype(np.uint8), 300)
    assert made.settings["variety"] > 0  # those that fit best would join two objects
    red = made.image[..., 0].astype(int) - made.image[..., 1] > 60
    pieces, count = ndimage.label(ndimage.binary_opening(red, np.ones((3, 3))))
    inside = [box for box in ndimage.find_objects(pieces) if all(s.start > 0 and s.stop < 300 for s in box)]
    assert count > len(inside) >= 6
    sides = [side.stop - side.start for box in inside for side in box]
    assert all(31 <= side <= 35 for side in sides)


def test_large_samples_are_tried_at_reduced_size():
    rng = np.random.default_rng(2)
    sample = np.kron(windows(96)[..., 0], np.ones((4, 4))) + rng.normal(0, 2, (384, 384))
    made = ts.synthesize(sample.clip(0, 255).astype(np.uint8), 420, level=False, context=4)
    assert len(made.tried) == 5
    assert made.settings["context"] == 4
    assert made.patch[0] in {96, 211}


def test_samples_with_holes_have_room_or_none():
    mask = np.zeros((144, 144), bool)
    mask[20:70, 30:90] = True
    made = ts.synthesize(windows(), 100, source_mask=mask)
    assert made.patch[0] <= 50
    assert mask[made.source[..., 0], made.source[..., 1]].all()
    mask[:, ::3] = False
    with pytest.raises(ts.ImageError, match="no place in the mask"):
        ts.synthesize(windows(), 100, source_mask=mask)


def test_several_samples_and_turns_are_tried_together():
    made = ts.synthesize([windows(96), windows(72)], 80, turns="mirror")
    assert made.tried
    assert set(np.unique(made.exemplar).tolist()) <= {0, 1, 2, 3}


def test_progress_goes_on_through_the_trial():
    shares = []
    ts.synthesize(windows(96), 120, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1


def test_guided_and_transparent_textures_are_varied(sample):
    picture = sample(3, (64, 64))
    guided = ts.synthesize(picture, 60, guide=np.zeros((60, 60)), guide_source=picture)
    holed = ts.synthesize(picture, 60, alpha=sample(4, (64, 64)), transparent=True)
    for made in (guided, holed):
        assert made.tried == {}
        assert made.settings["variety"] == 0.5
