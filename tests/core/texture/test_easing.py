"""Steps at seams, eased into the copies."""

import numpy as np
import pytest
import skimage.data

import toposeam as ts
from toposeam.texture import synthesize
from toposeam.texture.atlas import Atlas
from toposeam.texture.easing import eased
from toposeam.texture.rendering import Lift


def two_copies(step, shape=(60, 80)):
    """A plane of two tones, and a canvas whose left half shows the one and whose right half the other."""
    plane = np.full((60, 120, 1), 100, np.float32)
    plane[:, 60:] += step
    atlas = Atlas.of([np.ones((60, 120), bool)], 4)
    flat = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[atlas.places[0]]
    index = np.concatenate([flat[:, :40], flat[:, 70:110]], axis=1)
    lift = Lift(
        gain=np.ones((*shape, 1), np.float32), offset=np.zeros((*shape, 1), np.float32), low=0.0, high=255.0
    )
    return atlas.spread([plane]), atlas, index, lift


@pytest.mark.parametrize("wraps", [(False, False), (True, False)])
def test_a_step_is_shared_by_both_sides_and_dies_away(wraps):
    plane, atlas, index, lift = two_copies(20)
    added = eased(plane, atlas, index, lift, wraps).offset[..., 0]
    picture = plane.reshape(-1)[index] + added
    assert np.abs(np.diff(picture, axis=1)).max() < 1.5  # it was 20
    np.testing.assert_allclose(added[:, 39], -added[:, 40], atol=1e-3)
    assert added[30, 39] == pytest.approx(10, abs=0.8)
    assert np.abs(added[:, [0, -1]]).max() < 1  # three times its reach away
    np.testing.assert_allclose(added, added[:1].repeat(60, axis=0), atol=1e-3)


def test_where_a_texture_repeats_its_border_is_eased_as_well():
    plane, atlas, index, lift = two_copies(20)
    added = eased(plane, atlas, index, lift, (False, True)).offset[..., 0]
    picture = plane.reshape(-1)[index] + added
    assert np.abs(picture[:, 0] - picture[:, -1]).max() < 1.5
    assert np.abs(np.diff(picture, axis=1)).max() < 1.5


def test_an_edge_is_left_and_so_is_what_fits():
    plane, atlas, index, lift = two_copies(150)
    assert np.abs(eased(plane, atlas, index, lift, (False, False)).offset).max() < 15  # 75 would ease it
    plane, atlas, index, lift = two_copies(0)
    assert np.abs(eased(plane, atlas, index, lift, (False, False)).offset).max() < 1e-3


def steps(made):
    """The 99th percentile of the steps between copies over that of those inside of them."""
    across, inside = [], []
    for axis in (0, 1):
        step = np.abs(np.diff(made.image.mean(axis=2), axis=axis))
        seam = np.diff(made.labels, axis=axis) != 0
        across.append(step[seam])
        inside.append(step[~seam])
    return np.percentile(np.concatenate(across), 99) / np.percentile(np.concatenate(inside), 99)


@pytest.mark.medium
@pytest.mark.parametrize("tileable", ["none", "both"])
def test_seams_of_a_smooth_sample_step_no_more_than_its_inside(tileable, monkeypatch):
    retina = skimage.data.retina()[560:944, 360:744].reshape(192, 2, 192, 2, 3).mean(axis=(1, 3))
    sample = np.rint(retina).astype(np.uint8)  # a dark spot is cut by its border
    options = {"seed": 1, "tileable": tileable}
    made = ts.synthesize(sample, 320, **options)
    assert made.settings["level"]
    assert steps(made) <= 1.1
    monkeypatch.setattr(synthesize, "eased", lambda plane, atlas, index, lift, wraps: lift)
    assert steps(ts.synthesize(sample, 320, **options)) > 1.2
