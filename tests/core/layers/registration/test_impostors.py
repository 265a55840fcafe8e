"""What is the same in both frames is no match, pictures that lie turned are turned back, and cameras that
cannot be are told.
"""

import dataclasses

import numpy as np
import pytest
from rendered import around, corner_error, grid, panorama_scene, views
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers.registration import (
    Lens,
    describe_picture,
    fit_models,
    large_canvas,
    matches_of,
    moved_camera,
    weakly_held,
)

SIZE, FOCAL = (260, 200), 320.0


def framed(pixels, frame, border=40):
    whole = frame[: pixels.shape[0] + 2 * border, : pixels.shape[1] + 2 * border].copy()
    whole[border:-border, border:-border] = pixels
    return whole


@pytest.fixture(scope="module")
def frame():
    """(512, 512, 3) uint8 with detail everywhere."""
    rough = ndimage.gaussian_filter(np.random.default_rng(7).random((512, 512, 3)), (1.5, 1.5, 0))
    return (255 * (rough - rough.min()) / np.ptp(rough)).astype(np.uint8)


@pytest.mark.medium
@pytest.mark.parametrize("size", [(240, 300), (200, 250)], ids=["of one size", "of two sizes"])
def test_pictures_that_share_a_frame_are_strangers(frame, size):
    one, other = data.astronaut()[:240, :300], data.coffee()[100 : 100 + size[0], 100 : 100 + size[1]]
    layers = [ts.Layer(framed(one, frame), name="a"), ts.Layer(framed(other, frame), name="b")]
    with pytest.raises(ts.OverlapError, match="only what lies at the same place in both, as a frame"):
        ts.find_places(layers)


@pytest.mark.medium
def test_a_frame_with_most_of_the_detail_is_no_match(frame):
    """In more than half of the cells that show anything the frame agrees, but not in the middle."""
    one, other = data.astronaut()[:240, :300].copy(), data.coffee()[100:340, 100:400].copy()
    one[:190], other[:190] = 200, 180
    one[:60, 100:160], other[:60, 100:160] = data.camera()[:60, :60, None], data.coffee()[200:260, :60]
    layers = [ts.Layer(framed(pixels, frame, 60), name=name) for pixels, name in ((one, "a"), (other, "b"))]
    with pytest.raises(ts.OverlapError, match="only what lies at the same place in both, as a frame"):
        ts.find_places(layers)


@pytest.mark.medium
def test_below_the_same_tool_bar_the_scrolled_page_matches(frame):
    page, bar = data.coffee(), frame[:60, :300]
    layers = [
        ts.Layer(np.concatenate([bar, page[top : top + 200, 150:450]]), name=f"{top}") for top in (0, 90)
    ]
    assert [layer.at for layer in ts.find_places(layers).layers] == [(0, 0), (0, 90)]


@pytest.mark.medium
def test_what_a_tripod_took_twice_is_one_scene():
    """Darker, noisy, and with somebody who has come."""
    one = data.coffee()[:300, :400]
    other = (0.6 * one + np.random.default_rng(0).normal(0, 2, one.shape)).clip(0, 255).astype(np.uint8)
    other[100:220, 150:230] = data.astronaut()[100:220, 150:230]
    found = ts.find_places([ts.Layer(one, name="a"), ts.Layer(other, name="b")])
    assert [layer.at for layer in found.layers] == [(0, 0), (0, 0)]


@pytest.mark.medium
@pytest.mark.parametrize("order", [1, -1], ids=["strip last", "strip first"])
@pytest.mark.parametrize(
    ("strip", "at"),
    [
        (np.s_[:, :100], (0, 0)),
        (np.s_[:, -100:], (300, 0)),
        (np.s_[:75], (0, 0)),
        (np.s_[-75:], (0, 225)),
    ],
    ids=["left", "right", "top", "bottom"],
)
def test_a_strip_of_a_side_belongs_to_its_picture(strip, at, order):
    """It has no part in the middle of the whole picture, as a frame has none."""
    whole = data.coffee()[60:360, 100:500]
    layers = [ts.Layer(whole, name="whole"), ts.Layer(whole[strip], name="strip")][::order]
    places = {layer.name: layer.at for layer in ts.find_places(layers).layers}
    assert np.subtract(places["strip"], places["whole"]).tolist() == list(at)


def plain_with_sides(frame, grain):
    """(120, 400) uint8: what `frame` shows at both ends, and between them a plain ground with such grain."""
    whole = 150 + np.random.default_rng(grain).normal(0, 2, (120, 400, 1))
    whole = np.repeat(whole, 3, axis=2).astype(np.uint8)
    whole[:, :80], whole[:, -80:] = frame[:120, :80], frame[:120, 80:160]
    return whole


@pytest.mark.medium
def test_a_strip_with_a_plain_middle_belongs_to_its_picture(frame):
    """No feature lies in its middle, but the grain is the same."""
    top, below = plain_with_sides(frame, 0), data.coffee()[:200, :400]
    layers = [ts.Layer(np.concatenate([top, below]), name="whole"), ts.Layer(top, name="strip")]
    assert [layer.at for layer in ts.find_places(layers).layers] == [(0, 0), (0, 0)]


@pytest.mark.medium
def test_plain_grounds_between_the_same_sides_are_strangers(frame):
    layers = [ts.Layer(plain_with_sides(frame, grain), name=f"{grain}") for grain in (0, 1)]
    with pytest.raises(ts.OverlapError, match="only what lies at the same place in both, as a frame"):
        ts.find_places(layers)


@pytest.mark.medium
@pytest.mark.parametrize("quarters", [1, 2, 3])
@pytest.mark.parametrize("which", [0, 1])
def test_crops_that_lie_turned_are_turned_back_without_loss(quarters, which):
    photograph = data.coffee()
    crops = [photograph[:200, :260], photograph[40:240, 120:380], photograph[150:, 60:320]]
    layers = [ts.Layer(crop, name=name) for crop, name in zip(crops, "abc", strict=True)]
    plain = ts.find_places(layers)
    layers[which] = dataclasses.replace(layers[which], image=np.rot90(crops[which], quarters))
    found = ts.find_places(layers)
    assert found.model == plain.model == "shift"
    assert f"{'abc'[which]} was turned by {'180' if quarters == 2 else '90'}°" in found.doubts[0]
    for one, other in zip(found.layers, plain.layers, strict=True):
        assert np.subtract(one.at, found.layers[2].at).tolist() == (
            np.subtract(other.at, plain.layers[2].at).tolist()
        )
        np.testing.assert_array_equal(one.image, other.image)


@pytest.mark.medium
def test_a_view_that_lies_turned_gets_the_camera_that_took_it():
    cameras = around(400.0, [(-14, 0, 0), (0, 2, 0), (13, 0, 1)], (240, 200))
    layers = views(panorama_scene(), cameras, (240, 200))
    layers[1] = dataclasses.replace(layers[1], image=np.rot90(layers[1].image))
    found = ts.find_places(layers, model="rotation")
    roll = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    cameras[1] = dataclasses.replace(
        cameras[1], size=(200, 240), rotation=cameras[1].rotation @ np.linalg.inv(roll)
    )
    assert found.sizes == ((240, 200), (200, 240), (240, 200))
    assert corner_error(found.transforms, cameras, found.sizes) < 0.5
    assert abs(found.turns[1]) == pytest.approx(90, abs=3)
    assert np.abs(found.turns[[0, 2]]).max() < 3


@pytest.mark.medium
def test_of_two_the_one_that_is_light_above_lies_upright():
    light = np.linspace(200, 0, 240)[:, np.newaxis, np.newaxis]
    whole = (0.3 * data.coffee()[:240] + 0.6 * light).astype(np.uint8)
    left, right = whole[:, :360], whole[:, 200:]
    for pictures in ((np.rot90(left, 2), right), (left, np.rot90(right))):
        layers = [ts.Layer(pixels, name=name) for pixels, name in zip(pictures, "ab", strict=True)]
        found = ts.find_places(layers)
        image = np.asarray(found.layers[0].image)
        assert image.shape[0] < image.shape[1]
        assert image[:40].mean() > image[-40:].mean()
        assert "is a guess" in found.doubts[0]


@pytest.mark.medium
@pytest.mark.parametrize("quarters", [1, 3])
def test_of_two_those_that_were_panned_sideways_lie_upright(quarters):
    """Even where the light comes from one side."""
    light = np.linspace(0, 200, 500)[:, np.newaxis]
    light = light if quarters == 1 else light[::-1]
    whole = (0.3 * data.coffee()[:240, :500] + 0.6 * light).astype(np.uint8)
    layers = [ts.Layer(np.rot90(whole[:, :310], quarters), name="a"), ts.Layer(whole[:, 190:], name="b")]
    found = ts.find_places(layers)
    assert "a was turned by 90°" in found.doubts[0]
    assert [layer.image.shape[:2] for layer in found.layers] == [(240, 310), (240, 310)]


# Points that somebody marked.


def plain(count):
    return [
        ts.Layer(np.full(SIZE[::-1], 40 + 5 * number, np.uint8), name=f"p{number}") for number in range(count)
    ]


def marked(truth, i, j, rng, noise=0.3):
    own = grid(SIZE, 7).reshape(-1, 2)
    there = truth[i].to_picture(truth[j].to_canvas(own)) + rng.normal(0, noise, own.shape)
    seen = ((there >= 0) & (there <= np.array(SIZE) - 1)).all(axis=1)
    return np.hstack([there, own])[seen]


@pytest.mark.medium
@pytest.mark.parametrize("closed", [True, False])
def test_a_turn_is_closed_by_a_pair_that_leads_round(closed):
    """Twelve views reach all the way round by their fields of view, whatever their ends show."""
    truth, rng = around(FOCAL, [(30 * k, 0, 0) for k in range(12)], SIZE), np.random.default_rng(0)
    points = {(k, k + 1): marked(truth, k, k + 1, rng) for k in range(11)}
    if closed:
        points[0, 11] = marked(truth, 0, 11, rng)
    found = ts.find_places(plain(12), points=points, model="rotation", projection="cylinder")
    assert (found.wrap is not None) is closed
    assert any("the turn is not closed" in doubt for doubt in found.doubts) is not closed
    assert found.focal == pytest.approx(FOCAL, rel=0.01)


@pytest.mark.medium
def test_a_lens_that_nobody_turns_by_hand_saw_a_plane():
    """Views by a lens of more than 500 mm, unless a file states that it was one."""
    long, rng = 12 * FOCAL, np.random.default_rng(0)
    turns = [(0, 0, 0), (1.5, 0, 20), (0.5, 1, -10), (2.2, 0.5, 5), (1.8, 1.2, 0)]
    truth = around(long, turns, SIZE)
    points = {(i, j): marked(truth, i, j, rng, 0.02) for j in range(5) for i in range(j)}
    matches = {
        pair: dataclasses.replace(one, uncertainty=0.02)
        for pair, one in matches_of(points, [SIZE] * 5).items()
    }
    features = [describe_picture(layer) for layer in plain(5)]
    fit = fit_models(features, matches, ("plane", "rotation"), Lens())
    assert fit.bundle.family == "plane"
    assert fit.seeming_mm == pytest.approx(long / np.hypot(*SIZE) * np.hypot(24, 36), rel=0.3)
    fit = fit_models(features, matches, ("plane", "rotation"), Lens(focal=long))
    assert (fit.bundle.family, fit.seeming_mm) == ("rotation", None)


class Sheared:
    """A view of a plane that no turned camera has."""

    def __init__(self, view, share):
        self._view, self._matrix = view, np.array([[1, share], [0, 1]])

    def to_canvas(self, points):
        return self._view.to_canvas(points @ self._matrix.T)

    def to_picture(self, points):
        return self._view.to_picture(points) @ np.linalg.inv(self._matrix).T


@pytest.mark.slow
def test_a_camera_is_taken_where_it_is_asked_for():
    """No pair matches elsewhere, as one plane brings all of them together."""
    rng = np.random.default_rng(0)
    cameras = around(FOCAL, ((-12, 0, 0), (12, 1, 0), (0, -8, 1)), SIZE)
    truth = [cameras[0], Sheared(cameras[1], 0.5), Sheared(cameras[2], -0.4)]
    points = {(i, j): marked(truth, i, j, rng) for j in range(3) for i in range(j)}
    assert ts.find_places(plain(3), points=points).model == "plane"
    found = ts.find_places(plain(3), points=points, model="rotation")
    assert (found.model, found.outvoted) == ("rotation", ())
    assert "a camera that only turned does not explain these pictures, but one plane does" in found.doubts[0]


def test_what_is_doubtful_is_told():
    pairs = {(0, 1): 4.0, (1, 2): 3.0}
    assert len(moved_camera(pairs, dict.fromkeys(pairs, 0.3), 1000.0)) == 1
    assert moved_camera(pairs, dict.fromkeys(pairs, 0.9), 1000.0) == []
    assert moved_camera(dict.fromkeys(pairs, 0.5), dict.fromkeys(pairs, 0.3), 1000.0) == []
    assert moved_camera({(0, 1): 9.0}, {(0, 1): 0.3}, 1000.0) == []
    loop = {(0, 1): 0.64, (1, 2): 0.9, (0, 2): 0.9}
    assert weakly_held("abc", loop) == []
    del loop[0, 2]
    (told,) = weakly_held("abc", loop)
    assert told.startswith("a and b show little in common (correlation 0.64)")


def test_a_canvas_much_larger_than_its_pictures_is_told():
    layers = [ts.Layer(np.zeros((100, 100)), at=at) for at in ((0, 0), (99, 99), (198, 198))]
    assert large_canvas(layers, 30_000) == []
    (told,) = large_canvas([*layers, ts.Layer(np.zeros((100, 100)), at=(297, 297))], 39_000)
    assert told.startswith("the canvas of 397 × 397 px has 4.0 times as many pixels")


def test_small_pictures_of_few_features_are_joined():
    """No cell of their overlap shows enough features to contradict."""
    rng, whole = np.random.default_rng(3), np.zeros((160, 300, 3))
    for cell in (64, 32, 16, 8, 4):
        coarse = rng.random((160 // cell + 3, 300 // cell + 3, 3))
        whole += cell * ndimage.zoom(coarse, (cell, cell, 1), order=1)[:160, :300]
    whole = (255 * (whole - whole.min()) / np.ptp(whole)).astype(np.uint8)
    placement = ts.find_places([whole[:, :180].copy(), whole[8:, 120:].copy()])
    assert len(placement.transforms) == 2
