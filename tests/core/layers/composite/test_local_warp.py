"""Layers that are bent along their seams."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import similarity
from toposeam.layers.composite.local_warp import bend

WHOLE = data.astronaut()[:300, 100:420].copy()


def two(move, dtype=np.uint8):
    """Two layers of one picture, of which the upper one is displaced by `move` px where they overlap."""
    y, x = np.mgrid[:300, :320].astype(float)
    off = move(x, y)
    other = np.stack(
        [ndimage.map_coordinates(plane.astype(float), [y, x + off], order=3, mode="nearest") for plane in
         np.moveaxis(WHOLE, -1, 0)], axis=-1
    ).clip(0, 255)  # fmt: skip
    a, b = WHOLE[:, :200].copy(), np.rint(other).astype(np.uint8)[:, 120:]
    if dtype == np.float32:
        a, b = a.astype(np.float32) / 255, b.astype(np.float32) / 255
    return [ts.Layer(a, name="a"), ts.Layer(b, at=(120, 0), name="b")]


def wave(x, y):
    return 4 * np.sin(y / 60)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_what_crosses_a_seam_goes_on(dtype):
    layers = two(wave, dtype)
    plain, given = ts.stitch(layers), ts.stitch(layers, give=6)
    assert plain.bent == 0
    assert 2.5 < given.bent < 6.5
    assert given.cost < 0.5 * plain.cost
    assert given.verdict.mean > plain.verdict.mean
    assert given.image.dtype == dtype
    # Far from the seam nothing changes.
    right = np.argmax(given.label_map == 1, axis=1).max() + 3 * 48 + 20
    if right < 310:
        np.testing.assert_array_equal(given.image[:, right:], plain.image[:, right:])


def on_their_side(layers):
    return [ts.Layer(one.image.swapaxes(0, 1), at=one.at[::-1], name=one.name) for one in layers]


@pytest.mark.parametrize("across", [False, True], ids=["downwards", "across"])
def test_layers_move_by_what_they_are_off(across):
    layers, line = two(wave), np.array([[160.0, 0.0], [160.0, 300.0]])
    if across:
        bent, farthest = bend(on_their_side(layers), [((0, 1), [line[:, ::-1]])], 6)
        bent = on_their_side(bent)
    else:
        bent, farthest = bend(layers, [((0, 1), [line])], 6)
    np.testing.assert_array_equal(bent[0].image, layers[0].image)
    assert 3.5 < farthest < 5
    seen, true = (layer[20:-20].astype(float) for layer in (bent[1].image[:, 36:44], WHOLE[:, 156:164]))
    before = layers[1].image[20:-20, 36:44].astype(float)
    assert np.abs(seen - true).mean() < 0.35 * np.abs(before - true).mean()


@pytest.mark.parametrize(
    "move", [lambda x, y: 0 * x, lambda x, y: 20 + 0 * x], ids=["nothing is off", "too far off"]
)
def test_what_gains_nothing_is_left_alone(move):
    layers = two(move)
    plain, given = ts.stitch(layers), ts.stitch(layers, give=4)
    if given.bent == 0:
        np.testing.assert_array_equal(given.image, plain.image)
    assert given.cost <= plain.cost


def test_bars_are_not_made_worse():
    """Every eighth px is alike: the nearest fit is taken, and none that tears."""
    bars = np.where(np.arange(240) % 8 < 4, 220, 40).astype(np.uint8)
    a = np.tile(bars, (160, 1))[:, :150]
    b = np.tile(np.roll(bars, 2), (160, 1))[:, 90:]
    plain = ts.stitch([ts.Layer(a), ts.Layer(b, at=(90, 0))])
    given = ts.stitch([ts.Layer(a), ts.Layer(b, at=(90, 0))], give=6)
    assert given.cost <= plain.cost
    assert given.bent < 3


def test_three_layers_of_which_one_is_off():
    parts = two(wave)
    third = ts.Layer(WHOLE[160:, :220].copy(), at=(0, 160), name="c")
    plain, given = (ts.stitch([*parts, third], give=give) for give in (0, 6))
    assert given.cost < 0.6 * plain.cost
    assert given.bent > 2


def test_transparency_is_bent_too():
    layers = two(wave)
    alpha = np.full((300, 200), 255, np.uint8)
    alpha[:, :10] = 0
    layers[1] = ts.Layer(layers[1].image, alpha=alpha, at=(120, 0), name="b")
    given = ts.stitch(layers, give=6)
    assert given.bent > 2
    assert given.alpha is None  # the other layer covers what is not shown


@pytest.mark.parametrize("give", [-1, 33, 2.5, True, "3"])
def test_displacements_are_checked(give):
    with pytest.raises(ts.OptionError, match="give is"):
        ts.stitch(two(wave), give=give)


def test_given_seams_exclude_it():
    with pytest.raises(ts.OptionError, match="leave one of them out"):
        ts.layers.StitchOptions(give=3, use_path={(0, 1): "path"})
    with pytest.raises(ts.OptionError, match="use_path"):
        ts.layers.StitchOptions(give=3, use_path=np.ones((8, 8)))
    ts.layers.StitchOptions(give=0, use_path={(0, 1): "path"})
    ts.layers.StitchOptions(give=3, use_path={})


PERIOD = 480


def ring(start, dtype=np.uint8):
    """Four layers of a picture that goes round, cut at a column; every other one is displaced."""
    whole = np.concatenate([WHOLE[:200, :240], WHOLE[:200, 239::-1]], axis=1)
    bent = np.stack([np.roll(row, -round(wave(0, y)), axis=0) for y, row in enumerate(whole)])
    layers = []
    for index in range(4):
        x = index * 120
        view = np.roll((whole, bent)[index % 2], -x, axis=1)[:, :190]
        columns = np.arange(x, x + 190) - start
        if columns[0] // PERIOD == columns[-1] // PERIOD:
            layers.append(ts.Layer(view.copy(), at=(int(columns[0]) % PERIOD, 0), name=str(index)))
            continue
        image, alpha = np.zeros_like(whole), np.zeros(whole.shape[:2], np.uint8)
        image[:, columns % PERIOD], alpha[:, columns % PERIOD] = view, 255
        layers.append(ts.Layer(image, alpha=alpha, name=str(index)))
    return layers


@pytest.mark.parametrize("start", [60, 150, 260])
def test_what_crosses_a_seam_goes_on_all_the_way_round(start):
    """Wherever the canvas is cut: through an overlap, a layer, or where a seam runs."""
    plain, given = (ts.stitch(ring(start), wrap=PERIOD, give=give) for give in (0, 6))
    assert 2.5 < given.bent < 6.5
    assert given.cost < 0.6 * plain.cost
    # Where it was cut, no step shows.
    steps = np.abs(np.roll(given.image.astype(int), 4, axis=1) - np.roll(given.image.astype(int), 3, axis=1))
    rows = slice(10, -10)
    assert steps[rows, 4].mean() < 2 * np.median(steps[rows].mean(axis=(0, 2)))


def test_pictures_whose_places_were_found_go_round_bent_or_not(monkeypatch):
    layers = ring(150)
    places = tuple(similarity(layer.at) for layer in layers)
    found = SimpleNamespace(layers=layers, wrap=PERIOD, left_out={}, transforms=places)
    target = "toposeam.layers.registration.find_places.found_places"
    monkeypatch.setattr(target, lambda pictures, *rest: found)
    composed = ts.stitch([layer.image for layer in found.layers], give=6)
    assert composed.bent > 2
    assert composed.period == PERIOD


def test_progress_grows_over_both_searches():
    shares = []
    ts.stitch(two(wave), give=6, method="heat", progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert {share > 0.5 for share in shares} == {False, True}
