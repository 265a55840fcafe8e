"""A pattern on cloth, against plain geometry."""

import numpy as np
import pytest

from toposeam_cli.motifs import cloth
from toposeam_cli.motifs.cloth import Piece, lay

#: Whole picture, (rows, columns), of a product 100 mm wide at 1 px per mm.
WHOLE = (60, 100)


def mask(rows, columns, value=1.0):
    made = np.zeros(WHOLE)
    made[rows, columns] = value
    return made


def laid(piece, pattern, per_mm=1.0, folds=None, ground=0.25, px_per_mm=1.0):
    picture = np.full((*WHOLE, 3), ground)
    folds = np.zeros(WHOLE) if folds is None else folds
    lay(picture, piece, folds, (pattern.astype(np.float32), per_mm), px_per_mm, WHOLE[1] / px_per_mm)
    return picture


def sampled(pattern, v, u):
    """The pattern, repeated, between the middles of its pixels: plain bilinear interpolation."""
    v, u = v - 0.5, u - 0.5
    rows, columns = np.floor(v).astype(int), np.floor(u).astype(int)
    down, across = (v - rows)[..., None], (u - columns)[..., None]
    corner = [
        [pattern[(rows + i) % pattern.shape[0], (columns + j) % pattern.shape[1]] for j in (0, 1)]
        for i in (0, 1)
    ]
    upper, lower = ((1 - across) * left + across * right for left, right in corner)
    return (1 - down) * upper + down * lower


@pytest.fixture
def pattern():
    return np.random.default_rng(2).random((5, 7, 3)) * 0.9


@pytest.mark.parametrize("px_per_mm", [1.0, 2.0])
@pytest.mark.parametrize("per_mm", [1.0, 0.7])
@pytest.mark.parametrize("angle", [0, 90, 30])
def test_flat_cloth_shows_the_pattern_from_its_middle(pattern, px_per_mm, per_mm, angle):
    """From the middle of the product, turned clockwise, whichever part of it the piece is."""
    part = np.s_[11:43, 27:64]
    made = laid(
        Piece(mask=mask(*part), angle=angle, shadow=0), pattern, per_mm, ground=0.25, px_per_mm=px_per_mm
    )
    y, x = np.indices(WHOLE) / px_per_mm
    y, x = y - WHOLE[0] / px_per_mm / 2, x - WHOLE[1] / px_per_mm / 2
    cos, sin = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    expected = np.full((*WHOLE, 3), 0.25)
    expected[part] = sampled(pattern, (cos * y - sin * x) * per_mm, (cos * x + sin * y) * per_mm)[part]
    np.testing.assert_allclose(made, expected, atol=1e-4)


def test_a_piece_with_a_matrix_lies_flat_as_that_says(pattern):
    """Folds, puff and angle are of no account to it."""
    matrix = (1.5, 0.25, -0.5, 2.0, 13.0, 8.0)
    folds = np.linspace(-1, 1, WHOLE[1]) * np.ones(WHOLE)
    piece = Piece(mask=mask(np.s_[2:50], np.s_[3:90]), matrix=matrix, puff=3, angle=45, shadow=0)
    made = laid(piece, pattern, 1.3, folds)
    a, b, c, d, e, f = matrix
    y, x = np.indices(WHOLE)
    u, v = np.moveaxis(np.linalg.solve([[a, c], [b, d]], np.stack([x - e, y - f]).reshape(2, -1)), 0, 0)
    expected = sampled(pattern, v.reshape(WHOLE) * 1.3, u.reshape(WHOLE) * 1.3)
    np.testing.assert_allclose(made[2:50, 3:90], expected[2:50, 3:90], atol=1e-4)


def test_the_mask_says_how_much_of_the_ground_is_covered(pattern):
    piece = Piece(mask=mask(np.s_[10:30], np.s_[20:50]), shadow=0, shade=0.5)
    full = laid(piece, pattern)
    for share in (0.25, 0.75):
        part = laid(Piece(mask=piece.mask * share, shadow=0, shade=0.5), pattern)
        np.testing.assert_allclose(part, (1 - share) * 0.25 + share * full, atol=1e-6)
    assert full[10:30, 20:50].mean() == pytest.approx(pattern.mean() / 2, rel=0.05)


def test_a_piece_that_is_nowhere_changes_nothing(pattern):
    np.testing.assert_array_equal(laid(Piece(mask=np.zeros(WHOLE)), pattern), np.full((*WHOLE, 3), 0.25))


def darkness(shadow, ground=1.0):
    """Share of the light that a half transparent white piece takes from a ground, by its shadow."""
    piece = Piece(mask=mask(np.s_[25:31], np.s_[44:52], 0.5), shadow=shadow)
    made = laid(piece, np.ones((2, 2, 3)), ground=ground)
    return 1 - (made - piece.mask[..., None]) / (1 - piece.mask[..., None]) / ground


def test_the_shadow_falls_to_the_lower_right():
    dark = darkness(1.0)
    assert dark.min() > -1e-6
    assert 0.05 < dark.max() < 0.5
    rows, columns = np.indices(WHOLE)
    total = dark[..., 1].sum()
    down = (dark[..., 1] * rows).sum() / total - 27.5
    right = (dark[..., 1] * columns).sum() / total - 47.5
    assert 1.3 > down > right > 0.2
    assert not dark[:15].any()  # far off
    assert (dark[..., 0] <= dark[..., 1]).all()  # it is warm
    assert (dark[..., 1] <= dark[..., 2]).all()
    np.testing.assert_allclose(darkness(0.5), dark / 2, atol=1e-6)
    np.testing.assert_allclose(darkness(1.0, 0.4), dark, atol=1e-6)
    assert not np.abs(darkness(0.0)).max() > 1e-6


def slope(down, across):
    """Folds of a plane that rises so many mm a mm, level in the middle."""
    y, x = np.indices(WHOLE) - np.reshape(WHOLE, (2, 1, 1)) / 2.0
    return (down * y + across * x) / (cloth._FOLD * WHOLE[1] / 1000)


def shade_on(down, across):
    made = laid(
        Piece(mask=np.ones(WHOLE), shadow=0), np.full((3, 3, 3), 0.5), folds=slope(down, across), ground=0.0
    )
    assert np.ptp(made[5:-5, 5:-5]) < 1e-5
    return float(made[30, 50, 0]) / 0.5


def test_slopes_are_lit_as_lambert_says():
    """By the angle between light and normal, whose share in the brightness is the same for all."""
    light, shares = cloth._LIGHT, []
    for down, across in ((0.1, 0), (-0.1, 0), (0, 0.1), (0, -0.1), (0.07, -0.12), (-0.2, 0.15)):
        normal = np.array([-across, -down, 1]) / np.sqrt(across**2 + down**2 + 1)
        shares.append((shade_on(down, across) - 1) / (normal @ light / light[2] - 1))
    assert 0.5 < shares[0] < 1
    np.testing.assert_allclose(shares, shares[0], rtol=1e-3)
    assert shade_on(0, 0) == pytest.approx(1)


def test_the_upper_left_is_lit_and_no_shade_is_black_or_glaring():
    # What rises to the right or downwards faces the light.
    assert shade_on(0.1, 0) > 1 > shade_on(-0.1, 0)
    assert shade_on(0, 0.1) > 1 > shade_on(0, -0.1)
    assert shade_on(0.1, 0) > shade_on(0, 0.1)  # it comes rather from above
    dark, bright = shade_on(-3, -3), shade_on(0.6, 0.6)
    assert (dark, bright) == (pytest.approx(cloth._DARKEST), pytest.approx(cloth._BRIGHTEST))


@pytest.mark.parametrize(("down", "across"), [(0.3, 0.0), (-0.1, 0.2), (0.0, -0.25)])
def test_a_pattern_slides_down_the_slope(down, across):
    """The farther the higher or deeper it lies."""
    ramp = np.zeros((400, 400, 3))
    ramp[..., 0], ramp[..., 1] = np.indices((400, 400)) / 400  # says where one is
    made = laid(Piece(mask=np.ones(WHOLE), shadow=0), ramp, folds=slope(down, across))
    made = made / shade_on(down, across) * 400
    y, x = np.indices(WHOLE) - np.reshape(WHOLE, (2, 1, 1)) / 2.0
    shift = cloth._SHIFT * WHOLE[1] / 1000 + 0.3 * np.abs(down * y + across * x)
    inside = np.s_[8:-8, 8:-8]
    for channel, (place, rise) in enumerate(((y, down), (x, across))):
        expected = (place - rise * shift - 0.5) % 400
        clear = (expected < 398)[inside]  # not across the ramp's end
        np.testing.assert_allclose(made[..., channel][inside][clear], expected[inside][clear], atol=5e-3)


def test_puffed_edges_are_round():
    """A quarter of an ellipse, as high as is said from as far in as is said."""
    shape, one, two = mask(np.s_[5:55], np.s_[10:90]), {"puff": 1.0}, {"puff": 3.0}
    low, high = (
        cloth._height(Piece(mask=shape, edge=16.0, **given), np.zeros(WHOLE), 1.0, 100.0)
        for given in (one, two)
    )
    profile = (high - low)[30, :50] / 2  # what unrest the cloth has is the same in both
    assert np.abs(profile[:5]).max() < 1e-3
    for depth in (4, 8, 12):
        assert profile[9 + depth] == pytest.approx(np.sqrt(1 - (1 - depth / 16) ** 2), abs=0.03)
    np.testing.assert_allclose(profile[33:], 1, atol=2e-3)
    np.testing.assert_allclose((high - low)[30, 50:], (high - low)[30, 49::-1], atol=1e-5)


def test_only_soft_cloth_has_unrest():
    full = np.ones(WHOLE)
    flat = cloth._height(Piece(mask=full), np.full(WHOLE, 0.5), 1.0, 100.0)
    np.testing.assert_allclose(flat, 0.5 * cloth._FOLD / 10)
    woven = cloth._height(Piece(mask=full, weave=1.0), np.zeros(WHOLE), 1.0, 100.0)
    larger = cloth._height(Piece(mask=full, weave=0.2), np.full(WHOLE, 0.5), 1.0, 100.0)
    np.testing.assert_allclose(larger - woven, flat, atol=1e-5)
    assert 0.5 < woven.std() / (cloth._UNREST / 10) < 2


def test_a_weave_glitters_evenly_and_as_much_as_is_said():
    level, place = np.zeros(WHOLE), (np.full(WHOLE, 0.35), np.full(WHOLE, 0.35))
    one, two = (
        cloth._brightness(Piece(mask=level, weave=weave), level, level, place) - 1 for weave in (0.5, 1.0)
    )
    assert two.max() < cloth._BRIGHTEST - 1
    np.testing.assert_allclose(two, 2 * one, atol=1e-6)
    assert two.std() == pytest.approx(0.035, rel=1e-3)
    assert abs(one.mean()) < 0.003
    # Neighbours are alike, along the thread more than at a diagonal.
    beside = np.corrcoef(one[:, 1:].ravel(), one[:, :-1].ravel())[0, 1]
    across = np.corrcoef(one[1:, 1:].ravel(), one[:-1, :-1].ravel())[0, 1]
    assert beside > across > 0.2


def test_light_falls_off_evenly_to_the_lower_right():
    y, x = np.indices(WHOLE)
    made = laid(Piece(mask=np.ones(WHOLE), shadow=0, light=0.4, shade=0.9), np.full((2, 2, 3), 0.5))
    away = (x / WHOLE[1] + y / WHOLE[0]) / 2
    np.testing.assert_allclose(made[..., 1], 0.45 * (1 + 0.4 * (0.35 - away)), rtol=1e-5)


def test_a_gloss_is_two_bands_that_lean():
    plain, glossy = (
        laid(Piece(mask=np.ones(WHOLE), shadow=0, gloss=gloss), np.full((2, 2, 3), 0.5)) for gloss in (0, 1)
    )
    shine = (glossy - plain)[..., 2]
    assert shine.min() > -1e-6
    for row in (0, 20, 40):
        lean = 0.45 * row / WHOLE[0] * 100
        peaks = [j for j in range(1, 99) if shine[row, j - 1] < shine[row, j] >= shine[row, j + 1] > 0.05]
        assert peaks == pytest.approx([52 - lean, 66 - lean], abs=1)
        first, second = shine[row, peaks]
        assert 0.2 < first < 0.3
        assert 0.08 < second < first / 2
    half = laid(Piece(mask=np.ones(WHOLE), shadow=0, gloss=0.5), np.full((2, 2, 3), 0.5)) - plain
    np.testing.assert_allclose(half[..., 2], shine / 2, atol=1e-6)
