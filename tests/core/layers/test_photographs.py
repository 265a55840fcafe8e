"""Photographs joined from nothing but their pixels: views that are rendered, of which it is known where they
belong.
"""

import dataclasses
import math
import pickle
import re
from functools import cache

import numpy as np
import pytest
from rendered import around, before_a_wall, corner_error, panorama_scene, ring_scene, views
from scipy.ndimage import map_coordinates
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import similarity
from toposeam.layers.registration import features
from toposeam.layers.registration import find_places as placing
from toposeam.layers.registration.pair_matching import PairMatcher

SIZE = (260, 200)
FOCAL = 300.0
#: Yaw, pitch and roll of cameras, degrees; and x, y, distance and these before a wall.
TURNS = ((-24, 1, 1), (0, -2, 0), (25, 1, -1))
STANDS = ((-70, 0, 1.0, 9, -4, 1), (70, 20, 1.05, -8, 5, -2))


@cache
def from_a_point():
    """Three photographs, and their cameras."""
    cameras = around(FOCAL, TURNS, SIZE)
    return views(panorama_scene(), cameras, SIZE), cameras


@cache
def before_the_wall():
    walls = before_a_wall(FOCAL, STANDS, SIZE)
    return views(data.astronaut(), walls, SIZE, names=("left", "right")), walls


@cache
def crops(turns=(0, 0, 0), scales=(1, 1, 1)):
    """Crops of a photograph, turned and scaled."""
    corners = ((-210, -110), (-50, -90), (-120, -20))
    given = [similarity(at, *how) for at, *how in zip(corners, turns, scales, strict=True)]
    return views(data.astronaut(), given, (200, 150)), given


@cache
def found(kind):
    """Places of a set, by default."""
    return ts.find_places({"point": from_a_point, "wall": before_the_wall}[kind]()[0])


@pytest.fixture
def seen_once(monkeypatch):
    """Pictures are looked at once for all tests."""
    monkeypatch.setattr(placing, "PairMatcher", lambda pictures, *_: sightings(tuple(pictures)))


@cache
def sightings(pictures):
    return PairMatcher(pictures, lambda _: None)


@pytest.mark.medium
def test_views_from_a_point_are_those_of_a_camera_that_turns():
    placement = found("point")
    assert placement.model == "rotation"
    assert corner_error(placement.transforms, from_a_point()[1], [SIZE] * 3) < 0.5
    assert placement.focal == pytest.approx(FOCAL, rel=0.01)
    assert placement.distortion == pytest.approx(0, abs=0.01)
    assert placement.projection == "cylinder"
    assert placement.wrap is None
    assert placement.numbers == (0, 1, 2)
    assert placement.left_out == {}
    assert placement.other_groups == ()
    assert placement.outvoted == ()
    assert placement.sizes == (SIZE,) * 3
    assert re.fullmatch(r"Placement\(3 pictures by rotation, 2 pairs, misfit 0\.[0-9]+ px\)", repr(placement))
    for place, turn, transform in zip(placement.places, placement.turns, placement.transforms, strict=True):
        assert place == pytest.approx(transform.to_canvas(np.zeros(2)))
        right = transform.to_canvas(np.array([[129.5, 99.5], [130.5, 99.5]]))
        assert turn == pytest.approx(np.degrees(np.arctan2(*np.diff(right, axis=0)[0][::-1])), abs=0.1)


@pytest.mark.medium
def test_a_wide_view_over_water_that_moves_is_that_of_a_camera():
    """A plane, with more unknowns, leaves less of it: 0.8 px."""
    cameras = around(FOCAL, [(yaw, 0, 0) for yaw in (-36, -12, 12, 36)], SIZE)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
    layers = []
    for sign, layer in zip((1, -1, 1, -1), views(ring_scene(1884, 420), cameras, SIZE), strict=True):
        at = np.array([y, x + sign * 6 * np.maximum(y - 90, 0) / 110])
        moved = [
            map_coordinates(plane, at, order=1, mode="nearest") for plane in np.moveaxis(layer.image, 2, 0)
        ]
        layers.append(dataclasses.replace(layer, image=np.stack(moved, axis=2)))
    placement = ts.find_places(layers)
    assert placement.model == "rotation"
    assert placement.misfit > 1
    assert placement.focal == pytest.approx(FOCAL, rel=0.03)


@pytest.mark.medium
def test_what_is_left_of_each_pair_is_told():
    placement = found("point")
    assert list(placement.residuals) == [(0, 1), (1, 2)]
    assert placement.correlations.keys() == placement.residuals.keys()
    assert min(placement.correlations.values()) > 0.9
    for (i, j), residual in placement.residuals.items():
        assert 0 < residual.median <= residual.farthest < 0.5
        assert residual.points >= 12
        assert residual.features > 20
        assert residual.apart == ()
        assert i < j
    assert placement.misfit == max(residual.median for residual in placement.residuals.values())


@pytest.mark.medium
def test_placed_pictures_show_the_same_where_they_overlap():
    left, middle = found("point").layers[:2]
    extent = np.array([*left.at, *middle.at]).reshape(2, 2)
    low = extent.max(axis=0)
    high = np.min([layer.at + np.array(layer.image.shape[1::-1]) for layer in (left, middle)], axis=0)
    parts = [
        layer.image[low[1] - y : high[1] - y, low[0] - x : high[0] - x].astype(float)
        for layer, (x, y) in zip((left, middle), extent, strict=True)
    ]
    both = np.all(
        [
            layer.covered[low[1] - y : high[1] - y, low[0] - x : high[0] - x]
            for layer, (x, y) in zip((left, middle), extent, strict=True)
        ],
        axis=0,
    )
    assert both.sum() > 5000
    assert np.abs(parts[0] - parts[1])[both].mean() < 3


@pytest.mark.medium
def test_views_of_a_wall_are_those_of_a_plane():
    placement = found("wall")
    assert placement.model == "plane"
    assert corner_error(placement.transforms, before_the_wall()[1], [SIZE] * 2) < 0.5
    assert placement.focal is None
    assert placement.projection is None
    assert placement.misfit < 0.2
    assert all(0.8 < scale < 1.25 for scale in placement.scales)
    assert abs(placement.turns.mean()) < 1


@pytest.mark.medium
def test_crops_are_moved_only():
    layers, given = crops()
    placement = ts.find_places(layers)
    assert placement.model == "shift"
    assert corner_error(placement.transforms, given, [(200, 150)] * 3) < 0.5
    assert all(placed.image is layer.image for placed, layer in zip(placement.layers, layers, strict=True))


@pytest.mark.medium
def test_turned_and_scaled_crops_are_turned_and_scaled():
    layers, given = crops((0, 1.5, -1), (1, 1.012, 0.99))
    placement = ts.find_places(layers)
    assert placement.model == "similarity"
    assert corner_error(placement.transforms, given, [(200, 150)] * 3) < 0.5
    assert placement.turns - placement.turns[0] == pytest.approx([0, 1.5, -1], abs=0.1)
    assert placement.scales / placement.scales[0] == pytest.approx([1, 1.012, 0.99], abs=2e-3)


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
@pytest.mark.parametrize(("model", "off"), [("plane", 2.0), ("rotation", 0.5)])
def test_a_model_that_is_asked_for_is_taken(model, off):
    layers, cameras = from_a_point()
    placement = ts.find_places(layers, model=model)
    assert placement.model == model
    assert corner_error(placement.transforms, cameras, [SIZE] * 3) < off


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
def test_poorer_models_leave_more():
    layers, _ = from_a_point()
    for model in ("similarity", "shift"):
        placement = ts.find_places(layers, model=model)
        assert placement.model in ("similarity", "shift")
        assert placement.misfit > 10 * found("point").misfit
    turned = crops((0, 1.5, -1), (1, 1.012, 0.99))[0]
    moved = ts.find_places(turned, model="shift")
    assert moved.model == "shift"
    assert moved.misfit > 0.5


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
def test_what_is_to_be_exact_is_refused_where_it_is_not():
    with pytest.raises(ts.OverlapError):
        ts.find_places(from_a_point()[0], exact=True)


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere", "panini"])
def test_the_projection_reaches_the_transforms(projection):
    placement = ts.find_places(
        from_a_point()[0], model="rotation", focal=FOCAL, lens=0.0, projection=projection, centre=1
    )
    assert placement.projection == projection
    assert {transform.projection for transform in placement.transforms} == {projection}
    assert corner_error(placement.transforms, from_a_point()[1], [SIZE] * 3) < 0.5
    middle = placement.transforms[1].to_canvas((np.array(SIZE) - 1) / 2)
    assert middle[0] == pytest.approx(0, abs=1e-6)


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
def test_pictures_beyond_the_field_of_view_are_left_out():
    layers, _ = from_a_point()
    placement = ts.find_places(layers, fov=20, centre=0)
    assert placement.model == "rotation"
    assert placement.numbers == (0, 1)
    assert placement.left_out == {2: f"{layers[2].name} lies beyond the field of view"}
    assert set(placement.residuals) == set(placement.correlations) == {(0, 1)}
    edge = placement.focal * math.tan(math.radians(10))
    for layer in placement.layers:
        assert layer.at[0] >= -edge - 1
        assert layer.at[0] + layer.image.shape[1] <= edge + 2
    with pytest.raises(ts.OverlapError, match=r"^0\.001 degrees across show 1 of 3 pictures; choose"):
        ts.find_places(layers, fov=0.001, centre=0)


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
def test_what_is_said_of_the_camera_reaches_the_transforms():
    layers, _ = from_a_point()
    placement = ts.find_places(layers, model="rotation", focal=310.0, lens=-0.01, level=False, centre=2)
    assert placement.focal == pytest.approx(310)
    assert placement.distortion == -0.01
    for transform in placement.transforms:
        assert transform.focal == pytest.approx(310)
        assert transform.lens == (0, -0.01, 0)
    found_middle = placement.transforms[2].to_canvas((np.array(SIZE) - 1) / 2)
    assert found_middle[0] == pytest.approx(0, abs=1e-6)
    # The picture in the middle lies upright where the horizon is not asked for.
    assert placement.turns[2] == pytest.approx(0, abs=0.1)


@pytest.mark.medium
@pytest.mark.usefixtures("seen_once")
def test_a_focal_length_that_is_said_about_is_found():
    options = placing.PlaceOptions(model="rotation", focal=320.0, about=True, lens=0.0)
    placement = placing.found_places(from_a_point()[0], options, None, None, placing._place_in_memory)
    assert placement.focal == pytest.approx(FOCAL, rel=0.02)


@pytest.mark.medium
def test_large_pictures_are_compared_reduced(monkeypatch):
    """Of a row and a column that fill no reduced pixel nothing is compared; they are there all the same."""
    monkeypatch.setattr(features, "_DETAIL_PIXELS", 30_000)
    layers, cameras = from_a_point()
    odd = [ts.Layer(layer.image[:199, :259], name=layer.name) for layer in layers]
    assert features.describe_picture(odd[0]).detail_scale == 2
    placement = ts.find_places(odd, model="rotation")
    assert {transform.size for transform in placement.transforms} == {(259, 199)}
    assert placement.sizes == ((259, 199),) * 3
    assert corner_error(placement.transforms, cameras, [(259, 199)] * 3) < 1
    assert placement.focal == pytest.approx(FOCAL, rel=0.02)


@pytest.mark.medium
def test_a_lens_is_found():
    cameras = around(FOCAL, ((-20, 7, 0), (3, 8, 0), (-21, -7, 1), (2, -6, -1)), SIZE, lens=-0.04)
    placement = ts.find_places(views(panorama_scene(), cameras, SIZE), model="rotation")
    assert placement.distortion == pytest.approx(-0.04, abs=0.006)
    assert corner_error(placement.transforms, cameras, [SIZE] * 4) < 0.7


@pytest.mark.medium
def test_a_stranger_is_left_out_and_named():
    stranger = ts.Layer(data.chelsea()[50:250, 100:360], name="cat")
    layers = before_the_wall()[0]
    placement = ts.find_places([layers[0], stranger, layers[1]])
    assert placement.numbers == (0, 2)
    assert placement.other_groups == ()
    assert list(placement.left_out) == [1]
    assert re.search(
        "^cat shares (nothing with the other pictures|[0-9]+ features with (left|right), but no)",
        placement.left_out[1],
    )
    assert list(placement.residuals) == [(0, 1)]
    assert corner_error(placement.transforms, before_the_wall()[1], [SIZE] * 2) < 0.5


@pytest.mark.medium
def test_of_two_groups_the_larger_is_joined():
    walls = before_the_wall()[0]
    turned = from_a_point()[0]
    placement = ts.find_places([walls[0], *turned, walls[1]])
    assert placement.numbers == (1, 2, 3)
    assert placement.model == "rotation"
    assert placement.other_groups == ((0, 4),)
    assert placement.left_out == {
        0: "left shows something else, together with right",
        4: "right shows something else, together with left",
    }
    assert [layer.name for layer in placement.layers] == ["a", "b", "c"]


@pytest.mark.medium
def test_equal_pictures_come_to_lie_at_the_same_place():
    layers, cameras = from_a_point()
    again = ts.Layer(layers[1].image.copy(), name="again")
    placement = ts.find_places([*layers, again], model="rotation", focal=FOCAL, lens=0.0)
    assert placement.numbers == (0, 1, 2, 3)
    assert corner_error(placement.transforms, [*cameras, cameras[1]], [SIZE] * 4) < 0.5


@pytest.mark.medium
def test_pictures_that_have_nothing_in_common_are_refused():
    strangers = [
        ts.Layer(data.chelsea()[50:200, 100:300], name="cat"),
        ts.Layer(data.astronaut()[:150, 100:300], name="astronaut"),
        ts.Layer(data.coffee()[100:250, 200:400], name="cup"),
    ]
    with pytest.raises(ts.OverlapError, match=r"of the other pictures|something else"):
        ts.find_places(strangers)


class Elsewhere:
    """An executor that does all on copies, as another process would, the last first."""

    def __init__(self):
        self.functions = set()

    def map(self, function, items):
        calls = [pickle.dumps((function, item)) for item in items]
        self.functions.add(function.__name__)
        done = []
        for call in reversed(calls):
            own, item = pickle.loads(call)  # noqa: S301 - what this test has written
            done.append(pickle.dumps(own(item)))
        return (pickle.loads(one) for one in reversed(done))  # noqa: S301


@pytest.mark.medium
@pytest.mark.parametrize("kind", ["point", "wall"])
def test_an_executor_changes_nothing(kind):
    elsewhere, here = Elsewhere(), found(kind)
    placement = ts.find_places(
        {"point": from_a_point, "wall": before_the_wall}[kind]()[0], executor=elsewhere
    )
    assert {"describe_picture", "_match_pair", "_align_patches"} <= elsewhere.functions
    assert placement.model == here.model
    assert placement.residuals == here.residuals
    assert placement.focal == here.focal
    for one, other in zip(placement.layers, here.layers, strict=True):
        assert one.at == other.at
        assert (one.image == other.image).all()


@pytest.mark.medium
def test_a_whole_turn_comes_round():
    width, size = 960, (220, 170)
    focal = width / (2 * math.pi)
    cameras = around(focal, [(45 * k, (-1) ** k, k % 3 - 1) for k in range(8)], size)
    scene = ring_scene(width, 300)
    wide = np.concatenate([scene[:, -250:], scene, scene[:, :250]], axis=1)  # (0, 0) is still its middle
    layers = views(wide, cameras, size)
    placement = ts.find_places(layers)
    assert placement.numbers == tuple(range(8))
    assert placement.model == "rotation"
    assert placement.focal == pytest.approx(focal, rel=0.01)
    assert placement.wrap == round(2 * math.pi * placement.focal)
    assert placement.wrap == pytest.approx(width, rel=0.01)
    assert corner_error(placement.transforms, cameras, [size] * 8) < 0.3


@pytest.mark.medium
@pytest.mark.parametrize("model", ["plane", "rotation"])
def test_points_that_contradict_each_other_are_a_sentence(model):
    rng = np.random.default_rng(0)
    points = rng.uniform(0, [98, 52, 95, 52], (8, 4))
    pictures = list(rng.integers(0, 255, (2, 54, 100), np.uint8))
    with pytest.raises(ts.OverlapError, match="too little else shows which is right"):
        ts.find_places(pictures, points={(0, 1): points}, model=model)


BAD = {
    "a model that is none": {"model": "homography"},
    "no model": {"model": None},
    "a projection that is none": {"projection": "fisheye"},
    "no focal length": {"focal": 0},
    "a focal length shorter than a pixel": {"focal": 1e-300},
    "a text for a focal length": {"focal": "24 mm"},
    "no number for a focal length": {"focal": math.nan},
    "no lens at all": {"lens": 0.7},
    "a text for a lens": {"lens": "b"},
    "a picture that is not there": {"centre": 3},
    "a picture before the first": {"centre": -1},
    "half a picture": {"centre": 1.5},
    "a name for a picture": {"centre": "b"},
    "a horizon of no picture": {"horizon": (3, [[0, 0], [9, 1]])},
    "a horizon without a picture": {"horizon": [[0, 0], [9, 1]]},
    "a horizon of one point": {"horizon": (0, [[0, 0]])},
    "a horizon that ends nowhere": {"horizon": (0, [[0, 0], [math.nan, 1]])},
    "no field of view": {"fov": 0},
    "more than all round": {"fov": 361},
    "a text for a field of view": {"fov": "60°"},
    "no correlation": {"least_correlation": 0},
    "an exact plane": {"model": "plane", "exact": True},
    "an exact camera": {"model": "rotation", "exact": True},
    "no executor": {"executor": 2},
}


@pytest.mark.parametrize("options", BAD.values(), ids=BAD)
def test_options_that_mean_nothing_are_refused_in_a_sentence(options):
    pictures = [ts.Layer(np.zeros((40, 50), np.uint8), name=name) for name in "abc"]
    with pytest.raises(ts.OptionError) as error:
        ts.find_places(pictures, **options)
    text = str(error.value)
    assert next(iter(options)) in text
    assert "\n" not in text
    assert ". " not in text
    assert not text.endswith(".")
