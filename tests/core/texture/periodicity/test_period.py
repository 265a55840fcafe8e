import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.texture.periodicity import Order, Phase, find_order, given_order, likely_order
from toposeam.texture.periodicity.lattice_fit import _points


def bricks(height=160, width=192, brick=(16, 40), seed=0):
    """Rows of bricks of many tones, every other row half a brick further."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    row = y // brick[0]
    along = x + row % 2 * (brick[1] // 2)
    tones = rng.uniform(70, 200, (height // brick[0] + 1, width // brick[1] + 2))
    mortar = (y % brick[0] < 3) | (along % brick[1] < 3)
    made = np.where(mortar, 235, tones[row, along // brick[1]]) + rng.normal(size=y.shape) * 4
    return np.clip(made, 0, 255).astype(np.uint8)


def lines(height=160, width=160, pitch=12.5, seed=0):
    """Lines of something like text: regular downwards, without any order along them."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    row = np.floor(y / pitch).astype(int)
    marks = rng.random((row.max() + 1, width // 3 + 1)) < 0.6
    ink = (y / pitch % 1 < 0.5) & marks[row, x // 3]
    return np.where(ink, 30, 240).astype(np.uint8)


def plaid(turn, periods, seen, size=192, noise=6, seed=0):
    """Threads of two directions at an angle in degrees, some more to be seen than others."""
    y, x = np.mgrid[:size, :size]
    along, across = np.deg2rad([turn, turn + 90])
    made = 120 + np.random.default_rng(seed).normal(size=y.shape) * noise
    for angle, period, contrast in zip((along, across), periods, seen, strict=True):
        made += contrast * ((x * np.cos(angle) + y * np.sin(angle)) % period < 0.3 * period)
    return np.clip(made, 0, 255).astype(np.uint8)


def order_of(image):
    return find_order((image / np.float32(255))[..., np.newaxis], np.ones(image.shape, bool))


def spans(periods, *expected):
    """Whether each shift is a whole combination of the periods, and none is shorter than needed."""
    whole = np.array(expected) @ np.linalg.inv(periods)
    return np.abs(whole - np.rint(whole)).max() < 0.05 and abs(abs(np.linalg.det(np.rint(whole))) - 1) < 0.01


def out_of_step(image, order, closes=True):
    """The share of a tile that is more than a quarter of a period away from the lattice that closes on it, or
    of a texture with borders from the sample's.
    """
    values, size, found = image.astype(float), np.array(image.shape), np.zeros(image.shape, bool)
    y, x = np.mgrid[: size[0], : size[1]]
    for cycles in order.reciprocal:
        period = 1 / np.linalg.norm(cycles)
        closed = np.rint(cycles * size) / size if closes else cycles
        wave = values - ndimage.gaussian_filter(values, period, mode="wrap")
        wave = wave * np.exp(-2j * np.pi * (closed[0] * y + closed[1] * x))
        local = ndimage.gaussian_filter(wave, period, mode="wrap")
        found |= (local * np.exp(-1j * np.angle(local.sum()))).real <= 0
    return found.mean()


def few(side=150, period=(60, 52), seed=4):
    """Tiles of other tones with a cross in the middle: between two and three periods on either axis."""
    rng, (y, x) = np.random.default_rng(seed), np.mgrid[:side, :side]
    tones = rng.uniform(90, 200, (4, 4))[y // period[0], x // period[1]]
    y, x = y % period[0], x % period[1]
    dark = (np.abs(y - period[0] // 2) < 3) | (np.abs(x - period[1] // 2) < 3)
    made = np.where((y < 4) | (x < 4), 240, np.where(dark, 30, tones)) + rng.normal(0, 3, y.shape)
    return np.clip(made, 0, 255).astype(np.uint8)


@pytest.mark.medium
def test_patches_keep_step_with_a_lattice_that_is_given():
    image, period = few(), np.array([60, 52])
    kept, free = (ts.synthesize(image, 320, setting="varied", lattice=one) for one in ((60, 52), None))
    np.testing.assert_allclose(kept.settings["lattice"], [[60, 0], [0, 52]], atol=1e-9)

    def out_of_step(made):
        shift = (np.indices((320, 320)).transpose(1, 2, 0) - made.source) / period
        apart = shift - shift[0, 0]
        return np.abs((apart - np.rint(apart)) * period).max()

    assert out_of_step(kept) <= 2  # a px at most for each of two patches
    assert out_of_step(free) > 10
    assert ts.texture.closing_size(image, (200, 200), lattice=(60, 52)) == (180, 208)


def test_an_order_of_few_periods_is_guessed(sample):
    image = (few(seed=0) / np.float32(255))[..., np.newaxis]
    everywhere = np.ones((150, 150), bool)
    assert find_order(image, everywhere) is None
    assert spans(likely_order(image, everywhere).periods, (60, 0), (0, 52))
    alone = np.ones((150, 80), bool)  # 3.8 cells
    assert likely_order(image[:, :80], alone) is None
    noise = sample(0, (128, 128))[..., np.newaxis] / np.float32(255)
    assert likely_order(noise, np.ones((128, 128), bool)) is None
    assert likely_order(np.full((64, 64, 1), 0.5, np.float32), np.ones((64, 64), bool)) is None


@pytest.mark.medium
def test_a_guessed_order_is_kept_where_it_does_as_well():
    assert order_of(few()).periods[0, 0] < 20  # more of them than there are: the guess is tried besides
    made = ts.synthesize(few(), 320)
    assert spans(np.array(made.settings["lattice"]), (60, 0), (0, 52))
    assert made.settings["close"]
    named = {name: made.settings[name] for name in ("setting", "lattice")}
    assert (ts.synthesize(few(), 320, **named).image == made.image).all()


def test_a_lattice_may_be_sheared_or_lines():
    for given, periods in (((16, 40, 20), [[16, 20], [0, 40]]), ((12.5, 0), [[12.5, 0]]), ((0, 9), [[0, 9]])):
        np.testing.assert_allclose(given_order(given).periods, periods, atol=1e-9)


@pytest.mark.parametrize(
    "lattice", [(0, 0), (3, 40), (40,), (-16, 40), (1, 2, 3, 4), "8x8", (np.nan, 20), [[1, 0], [0, 9]]]
)
def test_no_lattices_are_refused(lattice):
    with pytest.raises(ts.OptionError, match="lattice"):
        ts.synthesize(few(), 60, lattice=lattice)


@pytest.mark.parametrize("given", [{"turns": "mirror"}, {"guide": np.zeros((60, 60)), "guide_source": few()}])
def test_a_lattice_is_that_of_one_sample_as_it_lies(given):
    with pytest.raises(ts.OptionError, match="leave it out with several ones, turns or guide"):
        ts.synthesize(few(), 60, lattice=(60, 52), **given)


@pytest.mark.parametrize(("contrast", "seen"), [(0.1, True), (0.01, False)])
def test_an_order_that_nobody_sees_is_none(contrast, seen):
    faint = 0.5 + (bricks() / np.float32(255) - 0.5) * np.float32(contrast)
    found = find_order(faint[..., np.newaxis], np.ones(faint.shape, bool))
    assert (found is not None) == seen


def test_the_lattice_of_bricks_is_found():
    order = order_of(bricks())
    assert order.reciprocal.shape == (2, 2)
    assert spans(order.periods, (16, 20), (0, 40))


def test_periods_that_are_no_whole_numbers_are_found_exactly():
    order = order_of(lines(pitch=12.5))
    assert order.reciprocal.shape == (1, 2)
    assert np.abs(order.periods) == pytest.approx(np.array([[12.5, 0]]), abs=0.1)
    sideways = order_of(lines(pitch=12.5).T)
    assert np.abs(sideways.periods) == pytest.approx(np.array([[0, 12.5]]), abs=0.1)


@pytest.mark.parametrize("turn", [0, 12, 31])
@pytest.mark.parametrize(("periods", "seen"), [((30, 22), (80, 40)), ((17, 40), (60, 60))])
def test_a_plaid_with_pale_threads_is_still_a_lattice(turn, periods, seen):
    along = np.deg2rad(turn)
    expected = [
        (periods[0] * np.sin(along), periods[0] * np.cos(along)),
        (periods[1] * np.cos(along), -periods[1] * np.sin(along)),
    ]
    found = order_of(plaid(turn, periods, seen)).periods
    assert found.shape == (2, 2)
    # Whichever vectors span it: what is meant is a whole combination of them, to a tenth of a pixel.
    whole = np.rint(np.array(expected) @ np.linalg.inv(found))
    assert abs(np.linalg.det(whole)) == 1
    assert whole @ found == pytest.approx(np.array(expected), abs=0.1)


@pytest.mark.parametrize("period", [14, 30])
def test_stripes_alone_have_no_order_along_them(period):
    found = order_of(plaid(20, (period, 22), (80, 0)))
    assert len(found.reciprocal) == 1
    assert np.linalg.norm(found.periods) == pytest.approx(period, abs=0.15)


def test_there_is_no_order_in_noise_nor_in_one_colour(sample):
    assert order_of(sample(0, (128, 128))) is None
    assert order_of(np.full((64, 64), 7, np.uint8)) is None
    assert order_of(np.arange(8, dtype=np.uint8)[np.newaxis]) is None


def test_the_middle_of_a_large_picture_tells_its_order():
    order = order_of(bricks(700, 800))
    assert spans(order.periods, (16, 20), (0, 40))


def test_an_order_closes_where_its_cycles_are_whole():
    order = Order(np.array([[1 / 16, 1 / 40], [0, 1 / 20]]), 1.0)
    closed, stretch = order.fitted((160, 120), (True, True))
    assert stretch == 0
    np.testing.assert_array_equal(closed, order.reciprocal)
    assert order.fitted((168, 120), (True, True))[1] == pytest.approx(0.5 / 168 / np.hypot(1 / 16, 1 / 40))
    assert order.fitted((168, 120), (False, True))[1] == 0
    assert order.closing_size((165, 127), (True, True)) == (160, 120)
    assert order.closing_size((165, 127), (False, True)) == (165, 120)
    assert order.closing_size((171, 135), (True, True), within=True) == (160, 120)
    assert order.better_size((165, 127), (True, True)) == (160, 120)
    assert order.better_size((160, 120), (True, True)) is None


def test_a_size_that_was_chosen_is_not_bettered_by_little():
    order = Order(np.linalg.inv(np.array([[18.84, -11.33], [15.46, 25.70]])).T, 1.0)
    chosen = order.closing_size((480, 480), (True, True))
    assert order.closing_size(chosen, (True, True)) != chosen
    assert order.better_size((480, 480), (True, True)) == chosen
    assert order.better_size(chosen, (True, True)) is None


@pytest.mark.parametrize(("factor", "off"), [(1, 1), (2, 1.5), (3, 2.25)])
def test_places_in_step_are_those_a_period_apart(factor, off):
    order = Order(np.array([[1 / 10.4, 0], [0, 1 / 6.4]]), 1.0)
    phase = Phase(order, order.reciprocal, factor)
    rows, columns = np.arange(21), np.arange(13)
    assert phase.allows((0, 0), (8, 8), rows, columns).all()
    phase.begin((0, 0), (3, 2), (8, 8))
    phase.begin((5, 5), (0, 0), (8, 8))  # the first patch has decided
    allowed = phase.allows((10, 7), (8, 8), rows, columns)
    y, x = (
        (places - first + period / 2) % period - period / 2
        for places, first, period in ((rows, 3 + 10, 10.4), (columns, 2 + 7, 6.4))
    )
    np.testing.assert_array_equal(allowed, np.hypot(y[:, np.newaxis], x) <= off)


@pytest.mark.medium
@pytest.mark.parametrize("size", [(192, 200), (197, 213)])
def test_bricks_that_repeat_keep_step_across_the_border(size):
    image = bricks()
    order = order_of(image)
    kept = ts.synthesize(image, size, patch=40, seed=0, tileable=True)
    loose = ts.synthesize(image, size, patch=40, seed=0, tileable=True, close=False)
    assert out_of_step(kept.image, order) == 0
    assert size == (192, 200) or out_of_step(loose.image, order) > 0.02


@pytest.mark.medium
def test_stripes_are_bent_by_a_twentieth_rather_than_broken():
    image = plaid(20, (30, 22), (80, 0))
    order = order_of(image)
    assert 0.05 < order.fitted((300, 300), (True, True))[1] < 0.07
    made = ts.synthesize(image, 300, seed=1, tileable=True)
    assert out_of_step(made.image, order) == 0


def test_holes_tell_the_size_of_transparent_textures():
    y, x = np.mgrid[:120, :120]
    opaque = np.where((y % 16 < 5) | (x % 20 < 6), 255, 0).astype(np.uint8)
    grain = np.random.default_rng(0).integers(180, 200, y.shape).astype(np.uint8)
    assert ts.texture.closing_size(grain, (150, 150), alpha=opaque, transparent=True) == (144, 160)


@pytest.mark.medium
def test_bricks_keep_step_in_textures_with_borders():
    image = bricks()
    order = order_of(image)
    kept, loose = (
        ts.synthesize(image, (350, 360), patch=32, seed=0, close=close).image for close in (True, False)
    )
    assert out_of_step(kept, order, closes=False) == 0
    assert out_of_step(loose, order, closes=False) > 0.05


@pytest.mark.medium
def test_a_synthesis_says_which_size_would_fit():
    image = bricks()
    assert ts.synthesize(image, (192, 200), patch=40, tileable=True).fits is None
    assert ts.synthesize(image, (197, 213), patch=40, tileable=True).fits == (192, 200)
    assert ts.synthesize(image, (197, 213), patch=40).fits is None
    assert ts.texture.closing_size(image, (197, 213)) == (192, 200)
    assert ts.texture.closing_size(image, (197, 213), tileable="y") == (192, 213)
    assert ts.texture.closing_size(image, (190, 213), within=True) == (160, 200)


@pytest.mark.parametrize("period", [3, 4, 10])
def test_all_points_of_a_lattice_in_one_half_of_a_box(period):
    whole, shifts = _points(period * np.eye(2), (40.0, 40.0))
    side = 2 * (40 // period) + 1
    assert len(whole) == (side**2 - 1) // 2
    np.testing.assert_array_equal(shifts, period * whole)
    assert len(np.unique(np.vstack([shifts, -shifts]), axis=0)) == side**2 - 1
