import tracemalloc

import numpy as np
import pytest

import toposeam as ts
from toposeam.texture.fill import _grouped
from toposeam.texture.placement import PatchPlacer


@pytest.mark.parametrize("shape", ["small", "large", "at the corner", "two"])
def test_a_hole_is_filled_and_nothing_beyond_the_band_changes(sample, shape):
    image = sample(0, (140, 150), channels=3)
    hole = np.zeros(image.shape[:2], bool)
    place = {
        "small": [(60, 70, 50, 62)],
        "large": [(30, 100, 40, 110)],
        "at the corner": [(0, 20, 130, 150)],
        "two": [(10, 20, 10, 25), (80, 90, 80, 99)],
    }
    for top, bottom, left, right in place[shape]:
        hole[top:bottom, left:right] = True
    holed = image.copy()
    holed[hole] = 255
    made = ts.fill(holed, hole, patch=24, band=5)
    from scipy import ndimage

    beyond = ndimage.distance_transform_edt(~hole) > 5
    np.testing.assert_array_equal(made.image[beyond], image[beyond])
    assert (made.labels[hole] > 0).all()
    source = made.source[hole]
    assert not hole[source[:, 0], source[:, 1]].any()
    # What fills it is like the rest, not like the white that was there.
    assert abs(made.image[hole].mean() - image.mean()) < 0.15 * 255


def test_one_small_hole_is_closed_by_one_closed_seam(sample):
    image = sample(1, (120, 120))
    hole = np.zeros(image.shape, bool)
    hole[50:62, 55:70] = True
    made = ts.fill(image, hole, patch=32)
    assert [line.closed for line in made.paths] == [True]


@pytest.mark.parametrize(("side", "many"), [(50, False), (80, True)])
def test_a_hole_of_up_to_two_patches_is_closed_by_one(sample, side, many):
    image = sample(1, (320, 320))
    hole = np.zeros(image.shape, bool)
    hole[120 : 120 + side, 130 : 130 + side] = True
    made = ts.fill(image, hole, patch=32, band=4, by="patches")
    assert (made.count > 1) == many


@pytest.mark.parametrize("by", ["patches", "shifts"])
def test_a_context_wider_than_the_hole_is_looked_at(sample, by):
    """The margin for it is wider than what is searched for."""
    image = sample(3, (72, 96))
    hole = np.zeros(image.shape, bool)
    hole[12:29, 12:29] = True
    made = ts.fill(np.where(hole, 255, image).astype(np.uint8), hole, by=by, context=40)
    np.testing.assert_array_equal(made.image[40:], image[40:])
    assert (made.labels[hole] > 0).all()


def test_zero_tolerance_takes_the_best_place_for_any_seed(sample):
    image = sample(1, (160, 160))
    hole = np.zeros(image.shape, bool)
    hole[60:100, 60:100] = True
    made = [
        ts.fill(image, hole, patch=32, band=4, by="patches", tolerance=tolerance, seed=seed)
        for tolerance in (0.0, 1.0)
        for seed in range(4)
    ]
    assert all((one.source == made[0].source).all() for one in made[:4])
    assert any((one.source != made[0].source).any() for one in made[4:])


def test_holes_near_each_other_are_filled_together():
    hole = np.zeros((60, 200), bool)
    hole[20:26, 20:26] = hole[20:26, 50:56] = hole[20:26, 150:156] = True
    _, together = _grouped(hole, hole)
    # Small holes reach 16 px: the first two, 24 px apart, meet, the third does not.
    assert together[22, 22] == together[22, 52] != together[22, 152] != 0


def test_a_periodic_pattern_is_restored_exactly():
    unit = np.random.default_rng(2).integers(0, 256, (12, 12), np.uint8)
    image = np.tile(unit, (10, 10))
    hole = np.zeros(image.shape, bool)
    hole[50:70, 48:70] = True
    spoiled = np.where(hole, 0, image).astype(np.uint8)
    np.testing.assert_array_equal(ts.fill(spoiled, hole, patch=20).image, image)


@pytest.mark.parametrize("tileable", [True, "x", "y"])
def test_a_picture_is_made_to_repeat_and_its_inside_stays(sample, tileable):
    from scipy import ndimage

    image = sample(3, (96, 112), channels=3)
    image = np.clip(
        image.astype(int) + ndimage.zoom([[0, 90], [90, 180]], (48, 56), order=1)[..., None] // 2, 0, 255
    ).astype(np.uint8)
    made = ts.make_tileable(image, band=12, tileable=tileable)
    rows = slice(12, -12) if tileable in (True, "y") else slice(None)
    columns = slice(12, -12) if tileable in (True, "x") else slice(None)
    np.testing.assert_array_equal(made.image[rows, columns], image[rows, columns])
    for axis, closes in ((0, tileable in (True, "y")), (1, tileable in (True, "x"))):

        def step(values, axis=axis):
            values = values.astype(float)
            return (
                np.abs(np.take(values, 0, axis) - np.take(values, -1, axis)).mean()
                / np.abs(np.diff(values, axis=axis)).mean()
            )

        if closes:
            assert step(made.image) < 1.2 < step(image)


def test_a_closing_periodic_pattern_is_unchanged():
    unit = np.random.default_rng(4).integers(0, 256, (16, 16), np.uint8)
    image = np.tile(unit, (6, 6))
    np.testing.assert_array_equal(ts.make_tileable(image, band=16).image, image)


def test_a_picture_continuing_across_its_border_is_unchanged():
    slope = np.broadcast_to(np.linspace(0, 255, 200).astype(np.uint8), (160, 200)).copy()
    upright = ts.make_tileable(slope, band=12, tileable="y")
    assert upright.count == 0
    np.testing.assert_array_equal(upright.image, slope)
    made = ts.make_tileable(slope, band=12)
    assert made.count > 0
    np.testing.assert_array_equal(made.image[:, 12:-12], slope[:, 12:-12])
    slope[0, 70:90] = 255  # a step there, and nowhere else
    made = ts.make_tileable(slope, band=12, tileable="y")
    assert made.count > 0
    np.testing.assert_array_equal(made.image[:, :40], slope[:, :40])
    np.testing.assert_array_equal(made.image[:, 120:], slope[:, 120:])


def test_a_step_in_the_corner_is_closed_by_one_patch():
    y, x = np.indices((60, 72))
    image = (x * (71 - x) // 14 + y * (59 - y) // 40).astype(np.uint8)
    image[0, 0] = 200
    made = ts.make_tileable(image, band=8, level=False, smooth=0)
    assert made.count == 1
    assert (made.image != image)[:8, :8].any()
    np.testing.assert_array_equal(made.image[8:-8], image[8:-8])
    np.testing.assert_array_equal(made.image[:, 8:-8], image[:, 8:-8])


@pytest.mark.parametrize("tileable", ["both", "x", "y"])
@pytest.mark.parametrize("smooth", [0, 1, 4])
def test_a_tile_s_border_is_drawn_like_the_whole(smooth, tileable):
    image = np.random.default_rng(1).integers(0, 256, (70, 96, 3), np.uint8)
    made = ts.make_tileable(image, band=16, tileable=tileable, smooth=smooth)
    assert (made.image != image).any()
    np.testing.assert_array_equal(made.apply(image), made.image)


def test_floats_with_nothing_in_the_hole_are_filled(sample):
    image = sample(5, (90, 90), dtype=np.float32)
    hole = np.zeros(image.shape, bool)
    hole[40:50, 40:50] = True
    image[hole] = np.nan
    assert np.isfinite(ts.fill(image, hole, patch=24).image).all()


def test_copies_come_only_from_where_they_may(sample):
    image = sample(6, (100, 120))
    hole = np.zeros(image.shape, bool)
    hole[40:60, 30:50] = True
    allow = np.zeros(image.shape, bool)
    allow[:, 70:] = True
    made = ts.fill(image, hole, patch=24, source=allow)
    assert (made.source[made.labels > 0][:, 1] >= 70).all()


def test_room_between_the_places_of_the_reduced_search_is_found(sample):
    image = sample(8, (400, 400))
    hole, allow = np.zeros((2, 400, 400), bool)
    hole[200:210, 300:310] = True
    allow[101:129, 51:79] = True
    made = ts.fill(image, hole, patch=24, band=4, source=allow)
    copied = made.labels > 0
    assert copied[hole].all()
    assert allow[made.source[copied][:, 0], made.source[copied][:, 1]].all()


def test_transparent_ground_is_neither_copied_nor_filled(sample):
    image, alpha = sample(7, (100, 100)), np.full((100, 100), 255, np.uint8)
    alpha[:30] = 0
    image[:30] = 255
    hole = np.zeros(image.shape, bool)
    hole[25:45, 40:60] = True
    made = ts.fill(image, hole, patch=24, alpha=alpha)
    np.testing.assert_array_equal(made.alpha, alpha)
    filled = made.labels > 0
    assert (filled[30:45, 40:60]).all()
    assert not filled[:30].any()
    assert (made.source[filled][:, 0] >= 30).all()


def test_what_may_be_copied_less_what_may_not(sample):
    image = sample(9, (100, 120))
    hole, source, avoid = np.zeros((3, 100, 120), bool)
    hole[40:60, 30:50] = True
    source[:, 60:] = True
    avoid[:50] = True
    made = ts.fill(image, hole, patch=24, source=source, avoid=avoid)
    place = made.source[made.labels > 0]
    assert (place[:, 1] >= 60).all()
    assert (place[:, 0] >= 50).all()


def test_a_large_hole_is_filled_from_where_most_is_known():
    image = np.random.default_rng(10).integers(0, 256, (160, 160), np.uint8)
    hole = np.zeros(image.shape, bool)
    hole[40:120, 40:120] = True
    laid = []

    class Watching(PatchPlacer):
        def lay(self, top, left, shape, may_show=None):
            known = (self.canvas.read(top, left, *shape) >= 0).mean()
            laid.append(known)
            return super().lay(top, left, shape, may_show)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("toposeam.texture.holes.hole_window.PatchPlacer", Watching)
        ts.fill(image, hole, patch=24, band=4)
    # At a corner of what is left, a window centred on its first pixel is three quarters known; in the middle
    # of an edge, where a hole filled row by row would go on, it is half known.
    assert min(laid) == pytest.approx(0.75, abs=0.03)


IMAGE = np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda: ts.fill(IMAGE, np.zeros((64, 64))), ts.ImageError, "mask is empty"),
        (lambda: ts.fill(IMAGE, np.ones((64, 64))), ts.ImageError, "nothing is left"),
        (lambda: ts.fill(IMAGE, np.ones((3, 3))), ts.ImageError, "shape"),
        (
            lambda: ts.fill(IMAGE, (np.indices((64, 64)) % 9 == 0).any(axis=0), patch=24),
            ts.ImageError,
            "no place",
        ),
        (lambda: ts.fill(IMAGE, np.eye(64), band=-1), ts.OptionError, "band"),
        (lambda: ts.fill(IMAGE, np.eye(64), band=2.5), ts.OptionError, "band is 2.5"),
        (lambda: ts.fill(IMAGE, np.eye(64), patch="auto"), ts.OptionError, "patch is 'auto'"),
        (lambda: ts.fill(IMAGE, np.eye(64), avoid=np.ones((64, 64))), ts.ImageError, "nothing is left"),
        (lambda: ts.fill(IMAGE, np.eye(64), avoid=np.ones((3, 3))), ts.ImageError, "avoid has shape"),
        (lambda: ts.fill(IMAGE, np.eye(64), smooth="x"), ts.OptionError, "smooth"),
        (lambda: ts.make_tileable(IMAGE, band="x"), ts.OptionError, "band is 'x'"),
        (lambda: ts.make_tileable(IMAGE, seed=-3), ts.OptionError, "seed"),
        (lambda: ts.make_tileable(IMAGE, band=40), ts.OptionError, "band"),
        (
            lambda: ts.make_tileable(IMAGE, alpha=np.pad(np.ones((60, 60), np.uint8), 2)),
            ts.ImageError,
            "repeats as it is",
        ),
        (lambda: ts.make_tileable(IMAGE[:20, :20]), ts.ImageError, "needs at least"),
        (lambda: ts.make_tileable(IMAGE, tileable=False), ts.OptionError, "tileable"),
        (lambda: ts.make_tileable(np.ones((64, 64))), ts.ImageError, "one value everywhere"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, error, text):
    with pytest.raises(error, match=text) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("by", ["auto", "patches", "shifts"])
@pytest.mark.parametrize("white", [0, 250])
def test_a_blot_on_one_flat_colour_becomes_that_colour(by, white):
    image = np.full((90, 80, 3), white, np.uint8)
    image[30:50, 20:60] = 200, 10, 90
    hole = np.zeros((90, 80), bool)
    hole[28:52, 18:62] = True
    assert (ts.fill(image, hole, by=by).image == white).all()


def test_of_a_large_picture_only_what_is_near_is_looked_at(monkeypatch):
    monkeypatch.setattr("toposeam.texture.fill._SEARCHED_PIXELS", 80**2)
    unit = np.random.default_rng(2).integers(0, 256, (12, 12), np.uint8)
    image = np.tile(unit, (20, 20))
    hole = np.zeros(image.shape, bool)
    hole[150:166, 170:186] = True
    spoiled = np.where(hole, 0, image).astype(np.uint8)
    made = ts.fill(spoiled, hole, by="shifts")
    np.testing.assert_array_equal(made.image, image)


@pytest.mark.medium
def test_filling_a_large_picture_takes_little_memory():
    image = np.random.default_rng(0).integers(0, 256, (1200, 1200, 3), np.uint8)
    hole = np.zeros((1200, 1200), bool)
    hole[500:700, 500:700] = True
    tracemalloc.start()
    try:
        ts.fill(image, hole, by="shifts")
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most / hole.size < 75  # bytes a pixel: 60; 151 where floats of the whole picture were held


def test_a_hole_in_an_order_is_filled_in_step_with_it():
    tones = np.array([40, 220, 90, 140])[np.searchsorted([14, 18, 34], np.arange(203) % 44, side="right")]
    y, x = np.mgrid[:187, :203]
    image = np.where((x + y) % 4 < 2, tones[x], tones[y]).astype(np.uint8)
    image += np.random.default_rng(0).integers(0, 9, image.shape).astype(np.uint8)
    mask = np.zeros(image.shape, bool)
    mask[60:110, 80:130] = True
    kept, loose = (
        ts.fill(image, mask, by="patches", seed=1, close=close).image.astype(int) for close in (True, False)
    )
    assert (np.abs(kept - image.astype(int))[mask] <= 8).all()
    assert (np.abs(loose - image.astype(int))[mask] > 30).mean() > 0.2
