"""Layers in, one picture out: nothing lost, nothing shown twice, every pixel as it was."""

import io

import numpy as np
import PIL.Image
import pytest
from crops import RNG, crop
from skimage import data

import toposeam as ts


def assert_whole(stitched, layers):
    """The masks part the pixels that any layer covers among the layers, and each pixel is the one of the
    layer that shows there.
    """
    left, top = stitched.origin
    count = np.zeros(stitched.image.shape[:2], int)
    covered = np.zeros(stitched.image.shape[:2], bool)
    for layer, mask in zip(layers, stitched.masks, strict=True):
        x, y = layer.at[0] - left, layer.at[1] - top
        height, width = layer.image.shape[:2]
        place = np.s_[y : y + height, x : x + width]
        assert mask.dtype == bool
        assert mask.sum() == mask[place].sum()  # shows nowhere but on its own ground
        assert not (mask[place] & ~layer.covered).any()
        image = layer.image if layer.image.ndim == stitched.image.ndim else layer.image[..., np.newaxis]
        shown = np.broadcast_to(image, stitched.image[place].shape)
        np.testing.assert_array_equal(stitched.image[place][mask[place]], shown[mask[place]])
        if stitched.alpha is not None:
            alpha = np.full((height, width), full(layer.image.dtype)) if layer.alpha is None else layer.alpha
            np.testing.assert_array_equal(stitched.alpha[place][mask[place]], alpha[mask[place]])
        count += mask
        covered[place] |= layer.covered
    np.testing.assert_array_equal(count, covered.astype(int))
    assert not stitched.image[~covered].any()
    if stitched.alpha is not None:
        np.testing.assert_array_equal(stitched.alpha > 0, covered)
    else:
        assert covered.all()


def full(dtype):
    return np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_layer_across_the_joint_of_two_shows_only_with_a_core(place):
    """Of a pile of photographs those may remain unseen that others cover; a patch is asked for."""
    layers = [crop(0, 0), crop(25, 3)]
    patch = ts.Layer(np.ascontiguousarray(layers[0].image[30:5:-1, 34:8:-1]), at=(22, 6), name="patch")
    layers.insert(place, patch)
    assert ts.stitch(layers).hidden == (place,)
    forced = ts.stitch(layers, core=0.5)
    assert forced.hidden == ()
    assert forced.masks[place][18, 35]
    assert_whole(forced, layers)


def test_frames_overlapping_by_60_percent_may_stay_hidden():
    frames = [crop(16 * column, 12 * row) for row in range(4) for column in range(5)]
    free, forced = ts.stitch(frames), ts.stitch(frames, core=0.5)
    assert free.hidden
    assert not forced.hidden
    assert free.cost < 0.65 * forced.cost


@pytest.mark.parametrize("wrap", [None, 120])
@pytest.mark.parametrize("core", [None, 1])
def test_specks_of_a_layer_inside_others_need_not_show(core, wrap):
    rng = np.random.default_rng(2)
    places = {(30, 60): (0, 0), (30, 61): (59, 0), (20, 50): (5, 5)}
    alpha = np.zeros((20, 50))
    alpha[:, :20] = alpha[8:13, 35:40] = 1

    def shown(**options):
        layers = [ts.Layer(rng.random(shape), at=at) for shape, at in places.items()]
        layers[2] = ts.Layer(layers[2].image, at=layers[2].at, alpha=alpha)
        shows = ts.stitch(layers, core=core, wrap=wrap, **options).masks[2]
        return [bool(shows[10:20, 10:20].any()), bool(shows[13:18, 40:45].any())]

    assert shown() == [True, False]
    assert shown(speck=9) == [True, True]  # of 5 × 5 px 3 × 3 may show
    assert shown(speck=10) == [True, False]
    alpha[:, :20] = 0
    assert shown()[1]  # there is nothing else of it


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("core", [0, 1.5, float("nan"), "much"])
def test_a_share_that_is_none_is_refused(count, core):
    with pytest.raises(ts.OptionError, match="core"):
        ts.stitch([crop(25 * index, 0) for index in range(count)], core=core)


TWO = {
    "side by side": [(0, 0), (25, 0)],
    "one above the other": [(0, 0), (0, 18)],
    "diagonal": [(3, 2), (20, 14)],
    "backwards": [(50, 40), (27, 31)],
    "one pixel": [(0, 0), (39, 0)],
}


@pytest.mark.parametrize("places", TWO.values(), ids=TWO)
def test_two_layers(places):
    layers = [crop(x, y) for x, y in places]
    stitched = ts.stitch(layers)
    assert_whole(stitched, layers)
    assert len(stitched.seams) == 1
    np.testing.assert_array_equal(stitched.masks[1], stitched.seams[0].labels)


def test_the_seam_is_the_one_find_seam_finds_on_the_canvas():
    layers = [crop(10, 5), crop(32, 9)]
    a, b = np.zeros((34, 62, 3), np.uint8), np.zeros((34, 62, 3), np.uint8)
    on_a, on_b = np.zeros((34, 62), bool), np.zeros((34, 62), bool)
    a[:30, :40], b[4:, 22:] = layers[0].image, layers[1].image
    on_a[:30, :40] = on_b[4:, 22:] = True
    stitched = ts.stitch(layers)
    seam = ts.find_seam(a, b, on_a, on_b)
    assert stitched.origin == (10, 5)
    assert stitched.seams[0].cost == seam.cost
    np.testing.assert_array_equal(stitched.seams[0].labels, seam.labels)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2), (0, 2, 1)])
def test_three_layers_in_any_order_that_overlaps(order):
    tiles = [crop(0, 0), crop(28, 5), crop(15, 20)]
    layers = [tiles[index] for index in order]
    stitched = ts.stitch(layers)
    assert_whole(stitched, layers)
    assert stitched.pairs == ((0, 1), (0, 2), (1, 2))
    assert stitched.image.shape == (50, 68, 3)
    assert stitched.alpha is not None  # the three do not fill their rectangle


def test_a_mosaic_of_many():
    layers = [crop(x, y) for y in (0, 22) for x in (0, 30, 60)]
    stitched = ts.stitch(layers)
    assert_whole(stitched, layers)
    assert stitched.image.shape == (52, 100, 3)
    assert stitched.alpha is None


def test_a_later_layer_covering_everything_leaves_a_rim():
    layers = [crop(20, 20, 30, 30), crop(0, 0, 70, 70)]
    stitched = ts.stitch(layers)
    assert_whole(stitched, layers)
    assert 0 < stitched.masks[0].sum() < 900
    assert stitched.seams[0].paths[0].closed


@pytest.mark.parametrize("offset", [(-30, -12), (1000, -999), (-(10**8), 10**8)])
def test_only_relative_places_count(offset):
    near = [crop(0, 0), crop(22, 6)]
    far = [ts.Layer(image=layer.image, at=tuple(np.add(layer.at, offset).tolist())) for layer in near]
    here, there = ts.stitch(near), ts.stitch(far)
    assert here.origin == (0, 0)
    assert there.origin == offset
    np.testing.assert_array_equal(here.image, there.image)


def test_numpy_integers_are_whole_numbers():
    first, second = crop(0, 0), crop(22, 6)
    placed = ts.Layer(image=second.image, at=(np.int64(22), np.int16(6)))
    np.testing.assert_array_equal(ts.stitch([first, placed]).image, ts.stitch([first, second]).image)


@pytest.mark.parametrize(
    "dtype", [np.uint8, np.uint16, np.int16, np.uint32, np.float16, np.float32, np.float64]
)
def test_the_dtype_is_kept(dtype):
    white = (
        None if dtype in (np.uint8, np.uint16) else float(full(dtype))
    )  # the others do not say it themselves
    layers = [crop(0, 0, dtype=dtype, data_range=white), crop(25, 3, dtype=dtype, data_range=white)]
    stitched = ts.stitch(layers)
    assert stitched.image.dtype == dtype
    assert stitched.alpha.dtype == dtype
    assert stitched.alpha.max() == full(dtype)
    assert_whole(stitched, layers)


@pytest.mark.parametrize("gray", ["first", "second", "both", "one channel", "a plane and one channel"])
def test_gray_is_widened_to_the_others_channels(gray):
    first, second = crop(0, 0, gray=gray != "second"), crop(25, 0, gray=gray != "first")
    if "channel" in gray:
        second = ts.Layer(image=second.image[..., np.newaxis], at=second.at)
        if gray == "one channel":
            first = ts.Layer(image=first.image[..., np.newaxis], at=first.at)
    stitched = ts.stitch([first, second])
    assert stitched.image.shape == {"both": (30, 65), "first": (30, 65, 3), "second": (30, 65, 3)}.get(
        gray, (30, 65, 1)
    )
    assert_whole(stitched, [first, second])


def test_alpha_says_where_a_layer_has_pixels():
    alpha = np.full((30, 40), 255, np.uint8)
    alpha[5:12, 30:] = 0
    layers = [crop(0, 0, alpha=alpha), crop(25, 0)]
    stitched = ts.stitch(layers)
    assert stitched.masks[1][5:12, 30:40].all()
    assert stitched.alpha is None
    assert_whole(stitched, layers)


def test_opacity_between_nothing_and_full_is_kept():
    layers = [crop(x, y, alpha=RNG.integers(0, 256, (30, 40), np.uint8)) for x, y in ((0, 0), (25, 3))]
    stitched = ts.stitch(layers)
    assert_whole(stitched, layers)


def test_what_transparent_pixels_hide_does_not_show_nor_count():
    alpha = np.ones((30, 40))
    alpha[10:20, 2:8] = 0
    hidden = crop(0, 0, dtype=np.float64, alpha=alpha)
    hidden.image[10:20, 2:8] = np.nan
    stitched = ts.stitch([hidden, crop(25, 0, dtype=np.float64)])
    assert np.isfinite(stitched.image).all()
    assert (stitched.alpha[10:20, 2:8] == 0).all()


def test_alpha_that_is_not_a_number_is_no_opacity():
    alpha = np.ones((30, 40))
    alpha[3, 3], alpha[4, 4] = np.nan, -1
    stitched = ts.stitch([crop(0, 0, dtype=np.float64, alpha=alpha), crop(25, 0, dtype=np.float64)])
    assert (stitched.alpha[3, 3], stitched.alpha[4, 4]) == (0, 0)
    assert not stitched.masks[0][[3, 4], [3, 4]].any()


@pytest.mark.parametrize("method", ["heat", "shortest-path", "dp", "thesis"])
def test_the_method_and_its_options_are_handed_on(method):
    layers = [crop(0, 0), crop(25, 0), crop(50, 0)]
    stitched = ts.stitch(layers, method=method, gradient=False)
    assert_whole(stitched, layers)
    # The regions of the rounds are no strips, and dp and thesis know nothing else.
    engines = {seam.method for seam in stitched.seams}
    if method in ("heat", "shortest-path"):
        assert engines == {method}
    else:
        assert engines <= {"shortest-path", "graph-cut", "heat"}
    assert stitched.seams[0].settings["law"] == "colour"
    assert ts.stitch(layers[:2], method=method).seams[0].method == method


def test_soft_blending_of_two_layers_and_frames_are_heated():
    layers = [crop(0, 0), crop(25, 0)]
    assert ts.stitch(layers).seams[0].method == "shortest-path"
    for options in ({"blend": "soft"}, {"record_frames": True}, {"tolerance": 0.01}):
        assert ts.stitch(layers, **options).seams[0].method == "heat"


def test_no_seam_touches_what_is_to_be_avoided():
    layers = [crop(0, 0), crop(20, 0)]
    free = ts.stitch(layers).masks[1]
    avoid = np.zeros(free.shape, bool)
    avoid[10:18, np.flatnonzero(free[14])[0] - 2 :][:, :4] = True
    stitched = ts.stitch(layers, avoid=avoid)
    assert_whole(stitched, layers)
    mask = stitched.masks[1]
    assert not ((mask[:, 1:] != mask[:, :-1]) & (avoid[:, 1:] | avoid[:, :-1])).any()
    assert (mask != free).any()


def test_a_path_replaces_the_search(tmp_path):
    layers = [crop(0, 0), crop(25, 4)]
    found = ts.stitch(layers)
    found.seams[0].to_svg(tmp_path / "seam.svg")
    again = ts.stitch(layers, use_path=ts.vector.read_svg(tmp_path / "seam.svg"))
    np.testing.assert_array_equal(again.image, found.image)
    assert again.seams[0].cost == found.seams[0].cost
    assert again.seams[0].termination == ts.optimize.Termination.GIVEN


def test_progress_grows_to_one():
    for method in ("heat", "shortest-path", "thesis"):
        shares = []
        ts.stitch([crop(0, 0), crop(25, 0), crop(50, 0)], method=method, progress=shares.append)
        assert shares == sorted(shares)
        assert shares[-1] == 1
        assert len(set(shares)) > 4


def test_the_inputs_are_not_changed():
    layers = [crop(0, 0), crop(25, 0, alpha=np.full((30, 40), 7, np.uint8))]
    before = [layer.image.copy() for layer in layers]
    ts.stitch(layers)
    for layer, image in zip(layers, before, strict=True):
        layer.image.setflags(write=False)
        np.testing.assert_array_equal(layer.image, image)
    ts.stitch(layers)


def test_the_same_layers_give_the_same_picture():
    layers = [crop(0, 0), crop(25, 4), crop(10, 15)]
    np.testing.assert_array_equal(ts.stitch(layers).image, ts.stitch(layers).image)


def test_no_seam_round_a_picture_inside_beats_the_optimum():
    photograph = data.coffee()
    outer = ts.Layer(image=photograph[:80, :80])
    inner = ts.Layer(image=photograph[5:65, 5:65][:, ::-1].copy(), at=(10, 10))
    avoid = np.zeros((80, 80), bool)
    avoid[12:14, 20:40] = True
    optimum = ts.stitch([outer, inner], method="shortest-path", avoid=avoid).seams[0]
    assert ts.stitch([outer, inner], avoid=avoid).seams[0].cost >= optimum.cost * (1 - 1e-6)


@pytest.mark.parametrize(("height", "scale"), [(7000, 1.0), (40, 65535.0)])
def test_a_costly_seam_is_not_a_forbidden_one(height, scale):
    black, white = np.zeros((height, 12, 3), np.float32), np.full((height, 12, 3), scale, np.float32)
    stitched = ts.stitch(
        [ts.Layer(image=black, data_range=1), ts.Layer(image=white, at=(6, 0), data_range=1)]
    )
    assert stitched.image.shape == (height, 18, 3)


@pytest.mark.parametrize("gradient", [True, False])
def test_floats_of_any_size_are_stitched_or_refused(gradient):
    layers = [ts.Layer(image=(RNG.random((20, 20)) * 1e30).astype(np.float32), at=(x, 0)) for x in (0, 12)]
    try:
        assert_whole(ts.stitch(layers, gradient=gradient), layers)
    except ts.ImageError as error:
        assert "range" in str(error)  # noqa: PT017


def test_a_picture_of_pillow_brings_its_opacity():
    pixels = np.zeros((6, 9, 4), np.uint8)
    pixels[:, :4] = 7, 8, 9, 255
    layer = ts.Layer(PIL.Image.fromarray(pixels), at=(-3, 2))
    np.testing.assert_array_equal(layer.image, pixels[..., :3])
    np.testing.assert_array_equal(layer.covered, pixels[..., 3] > 0)
    assert ts.Layer(PIL.Image.fromarray(pixels).convert("LA")).image.shape == (6, 9)
    assert ts.Layer(PIL.Image.fromarray(pixels[..., :3])).alpha is None


def test_options_may_come_as_one_value():
    layers = [crop(0, 0), crop(25, 0), crop(50, 0)]
    plain = ts.stitch(layers, tolerance=0.5)
    given = ts.stitch(layers, options=ts.seam.HeatOptions(tolerance=0.5))
    assert [seam.settings["tolerance"] for seam in given.seams] == [0.5, 0.5]
    np.testing.assert_array_equal(given.image, plain.image)


def test_options_are_named_and_do_not_change():
    one, other = (ts.layers.StitchOptions(weight=np.full((2, 3), value)) for value in (1.0, 2.0))
    assert {one, other, one} == {one, other}
    assert one != ts.layers.StitchOptions(weight=one.weight)
    with pytest.raises(AttributeError):
        one.blend = "feather"
    with pytest.raises(TypeError):
        ts.layers.StitchOptions("heat")


def test_a_misspelt_option_is_refused_with_those_there_are():
    layers = [crop(0, 0), crop(25, 0)]
    with pytest.raises(ts.OptionError, match="does not know tolerence; its options are tolerance"):
        ts.stitch(layers, tolerence=3)
    with pytest.raises(ts.OptionError, match="method dp takes no options, but tolerence was given"):
        ts.stitch(layers, method="dp", tolerence=3)


@pytest.mark.parametrize(
    ("options", "phrase"),
    [
        ({"method": "x"}, "method is 'x'"),
        ({"method": "dp", "options": ts.seam.HeatOptions()}, "takes no options"),
        ({"gradient": True, "cost": ts.seam.MatchCost()}, "both given"),
        ({"core": 2}, "core is 2"),
        ({"speck": -1}, "speck is -1"),
        ({"blend": "soft", "blend_width": 3}, "has no width"),
        ({"match_tones": 3}, "match_tones is 3"),
        ({"give": 99}, "give is 99"),
        ({"give": 1, "use_path": {(0, 1): "path"}}, "give bends layers"),
        ({"max_rounds": 1.5}, "max_rounds is 1.5"),
        ({"effort": "x"}, "effort is 'x'"),
        ({"max_megapixels": 0}, "max_megapixels is 0"),
        ({"record_frames": 3}, "record_frames is 3"),
        ({"executor": 3}, "executor is of type int"),
        ({"progress": 3}, "progress is 3"),
    ],
)
def test_options_are_refused_before_there_are_layers(options, phrase):
    with pytest.raises(ts.OptionError, match=phrase):
        ts.layers.StitchOptions(**options)


def test_results_are_one_line_and_show_themselves(tmp_path):
    stitched = ts.stitch([crop(0, 0), crop(25, 0)])
    assert repr(stitched).startswith("Composition(2 layers, ")
    assert "\n" not in repr(stitched)
    shown = np.asarray(PIL.Image.open(io.BytesIO(stitched._repr_png_())))
    assert shown.shape[:2] == stitched.image.shape[:2]
    assert (shown != np.asarray(ts.to_pil(stitched))).any()  # the seam is drawn
    assert stitched.to_svg(tmp_path / "seams.svg") == (tmp_path / "seams.svg").read_text()


@pytest.mark.parametrize("name", ["match_tones", "match_shading"])
def test_tones_are_matched_or_not(name):
    layers = ts.layers.overlapping(*RNG.random((2, 20, 30)), overlap=8)
    with pytest.raises(ts.OptionError, match=rf"{name} is .*; choose one of True, False"):
        ts.stitch(layers, **{name: np.ones((2, 2))})
    with pytest.raises(ts.OptionError, match=r"shading is .*; choose one of True, False"):
        ts.layers.match_tones(layers, shading=np.ones((2, 2)))


def test_a_written_seam_is_applied_as_it_was_found():
    """A piece of b lies in a, and more of b beyond what both share: what counts as a speck is so in both."""
    rng = np.random.default_rng(0)
    a, b = rng.random((12, 28)).astype(np.float32), rng.random((40, 8)).astype(np.float32)
    alpha = np.zeros_like(b)
    alpha[2:8, 1:7] = alpha[15:] = 1
    layers = [ts.Layer(a, name="a"), ts.Layer(b, alpha=alpha, name="b")]
    for method in ("thesis", "heat"):
        found = ts.stitch(layers, method=method)
        assert found.seams[0].paths
        again = ts.stitch(layers, use_path=ts.vector.read_svg(found.seams[0].to_svg()))
        np.testing.assert_array_equal(again.label_map, found.label_map)
        np.testing.assert_array_equal(again.image, found.image)
