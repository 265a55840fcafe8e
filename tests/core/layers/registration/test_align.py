"""Positions: known shifts are found again, and what does not fit is refused."""

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.registration import align

PHOTOGRAPH = data.astronaut()
PLACES = [(0, 0), (150, 10), (90, 140), (230, 170)]


def crops(places=PLACES, off=6, seed=0, size=(220, 240), noise=6):
    """Crops of a photograph, noisy and differently exposed, each put up to `off` px beside its place; and how
    far each is off.
    """
    rng = np.random.default_rng(seed)
    layers, errors = [], []
    for index, (x, y) in enumerate(places):
        image = PHOTOGRAPH[y : y + size[0], x : x + size[1]] * rng.uniform(0.85, 1.15)
        image = np.clip(image + rng.normal(0, noise, image.shape), 0, 255).astype(np.uint8)
        error = rng.integers(-off, off + 1, 2) if index else np.zeros(2, int)
        layers.append(
            ts.Layer(image=image, at=(x + int(error[0]), y + int(error[1])), name=f"picture {index}")
        )
        errors.append(error)
    return layers, np.array(errors)


@pytest.mark.medium
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("off", [3, 14])
def test_known_shifts_are_found_again(seed, off):
    layers, errors = crops(off=off, seed=seed)
    aligned = ts.layers.align(layers)
    np.testing.assert_array_equal(aligned.shifts, -errors)
    assert [layer.at for layer in aligned.layers] == PLACES
    assert min(aligned.correlations.values()) > 0.5


def test_large_overlaps_are_compared_on_a_coarser_scale_first(monkeypatch):
    from toposeam.layers.registration import align

    monkeypatch.setattr(align, "_COMPARED_PIXELS", 4000)
    layers, errors = crops(off=14)
    np.testing.assert_array_equal(ts.layers.align(layers).shifts, -errors)


def test_narrow_strips_and_transparency():
    layers, errors = crops([(0, 0), (200, 4)], off=9, size=(220, 240))
    alpha = np.full((220, 240), 255, np.uint8)
    alpha[60:160, 10:25] = 0
    layers[1] = ts.Layer(
        image=np.where(alpha[..., None] > 0, layers[1].image, 77), alpha=alpha, at=layers[1].at
    )
    np.testing.assert_array_equal(ts.layers.align(layers).shifts, -errors)


@pytest.mark.parametrize("shift", [(0, 9), (-9, 0)])
def test_a_pair_that_fits_beyond_the_radius_only_tells_nothing(monkeypatch, shift):
    scene = np.random.default_rng(0).random((60, 110))
    pair = ts.Layer(scene[:, :70]), ts.Layer(scene[:, 40:], at=(40, 0))
    monkeypatch.setattr(align, "_refine", lambda *_: (np.array(shift), 0.9, 5000))
    assert align._match((*pair, 8)) is None
    assert align._match((*pair, 9))[0].tolist() == [shift[1], shift[0]]


def meeting(height, width, at=(0, 0)):
    """Two pictures that share the last pixels of the first one, the second one put beside its place."""
    scene = np.random.default_rng(1).random((90, 110))
    first, second = scene[:40, :50], scene[40 - height : 90, 50 - width :]
    return ts.Layer(first), ts.Layer(second, at=(50 - width + at[0], 40 - height + at[1]))


def test_parts_that_are_too_small_tell_nothing():
    """Two pixels from the border of what is shared are left for the search."""
    assert ts.layers.align(meeting(12, 12), radius=4).layers[1].at == (38, 28)
    assert ts.layers.align(meeting(20, 26, (2, -3)), radius=4).layers[1].at == (24, 20)
    with pytest.raises(ts.OverlapError, match="cannot be aligned"):
        ts.layers.align(meeting(11, 13), radius=4)
    assert ts.layers.correlations(meeting(8, 8)) == {(0, 1): pytest.approx(1)}
    assert ts.layers.correlations(meeting(7, 9)) == {}


def test_correlations_are_those_of_what_both_show():
    """Without slow changes, whatever the exposure is; a negative says -1, and noise lies between."""
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((2, 60, 90))
    first, second = 0.5 + 0.02 * noise[0], 0.4 + 0.03 * (0.6 * noise[0] + 0.8 * noise[1])
    alpha = np.ones((60, 90))
    alpha[:, :50], second[:, :50] = 0, rng.random((60, 50))  # where it shows nothing
    layers = ts.Layer(first), ts.Layer(second, alpha=alpha), ts.Layer(1 - first, at=(0, 900))
    assert ts.layers.correlations(layers) == {(0, 1): pytest.approx(0.6, abs=0.03)}
    negative = ts.Layer(1 - 0.3 * first)
    assert ts.layers.correlations([layers[0], negative]) == {(0, 1): pytest.approx(-1)}
    coarse = ts.layers.correlations(layers, block=3)
    assert coarse == {(0, 1): pytest.approx(0.6, abs=0.1)}
    assert coarse != ts.layers.correlations(layers)
    assert ts.layers.correlations(layers, block=100) == {}
    plain = [ts.Layer(np.full((60, 90), value)) for value in (0.2, 0.9)]
    assert ts.layers.correlations([layers[0], *plain]) == {(0, 1): 0, (0, 2): 0}


def test_what_agrees_with_nothing_is_refused():
    layers, _ = crops()
    stranger = ts.Layer(image=data.coffee()[:220, :240].copy(), at=(200, 150), name="stranger")
    with pytest.raises(
        ts.OverlapError, match=r"stranger cannot be aligned: within 32 px .* \(the best correlation is"
    ):
        ts.layers.align([*layers, stranger])
    far = ts.Layer(image=layers[0].image, at=(5000, 0), name="far")
    with pytest.raises(ts.OverlapError, match=r"far cannot be aligned.*it overlaps none of them"):
        ts.layers.align([*layers, far])
    flat = ts.Layer(image=np.full((220, 240, 3), 9, np.uint8), at=(100, 0), name="flat")
    with pytest.raises(ts.OverlapError, match="flat cannot be aligned"):
        ts.layers.align([layers[0], flat])
    with pytest.raises(ts.OverlapError, match="picture 1 cannot be aligned: within 4 px"):
        ts.layers.align(
            [layers[0], ts.Layer(image=layers[1].image, at=(170, 10), name="picture 1")], radius=4
        )
    with pytest.raises(ts.OptionError, match="at least 1"):
        ts.layers.align(layers, radius=0)
    with pytest.raises(ts.OptionError, match="at least two"):
        ts.layers.align(layers[:1])


def shifts_of(places, wrong, evidence=10.0):
    """What each two of a grid of 3 × 3 say, where their places are off by these, and some pairs say more."""
    found = {}
    for i in range(9):
        for j in range(i + 1, 9):
            if abs(i % 3 - j % 3) <= 1 and abs(i // 3 - j // 3) <= 1:
                shift = places[j] - places[i] + np.array(wrong.get((i, j), (0, 0)))
                found[i, j] = shift.astype(float), 0.9, evidence
    return found


def test_pairs_that_agree_elsewhere_are_outvoted_or_refused():
    places = np.random.default_rng(0).integers(-9, 9, (9, 2))
    places[0] = 0
    names = [f"p{index}" for index in range(9)]
    positions, used = align._vote_on_shifts(names, shifts_of(places, {}))
    np.testing.assert_allclose(positions, places, atol=1e-4)
    assert len(used) == 20
    positions, used = align._vote_on_shifts(names, shifts_of(places, {(4, 5): (24, 0)}))
    np.testing.assert_allclose(positions, places, atol=1e-4)
    assert len(used) == 19
    assert (4, 5) not in used
    with pytest.raises(ts.OverlapError, match=r"p0 and p1 agree where the other layers .* up to 24 px"):
        align._vote_on_shifts(names, shifts_of(places, {(0, 1): (24, 0)}))  # two others hold the corner
