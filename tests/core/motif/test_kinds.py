"""The four kinds, on pictures whose strokes and likeness are known."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.kinds import CLEAR, THICK, Kind, measure


def stripes(width_px, size=96, period=48, axis=1):
    at = (np.arange(size) + period // 2 - 9) % period
    line = np.where(at < width_px, 0.2, 1.0)
    picture = np.ones((size, size)) * line
    return picture if axis else picture.T


@pytest.mark.parametrize("width", [4, 8, 14, 20])
@pytest.mark.parametrize("axis", [0, 1])
def test_width_of_stripes(width, axis):
    assert measure(stripes(width, axis=axis)).stroke * 96 == pytest.approx(width, abs=0.6)


def test_strokes_are_closed_across_the_border():
    shifted = np.roll(stripes(12), 20, axis=1)
    assert measure(shifted).stroke == pytest.approx(measure(stripes(12)).stroke)


def test_likeness_is_the_overlap_of_silhouettes():
    """A disc of radius 20 against one that is moved by its radius: two lenses of 2π/3 - √3/2 of it."""
    y, x = np.mgrid[:96, :96]
    disc, moved = (np.where(np.hypot(y - 48, x - at) < 20, 0.1, 0.9) for at in (38, 58))
    lens = (2 * np.pi / 3 - np.sqrt(3) / 2) / np.pi
    assert measure(disc, disc).likeness > 0.9
    assert measure(disc, 1 - disc).likeness > 0.9  # light on dark is the same shape
    assert measure(disc, moved).likeness == pytest.approx(lens / (2 - lens), abs=0.04)
    noise = np.random.default_rng(0).random(disc.shape)
    assert measure(noise, disc).likeness < 0.3
    assert measure(disc).likeness == 0
    assert measure(disc, np.ones(disc.shape)).likeness == 0


def test_a_hatched_shape_is_recognised_by_its_silhouette():
    y, x = np.mgrid[:96, :96]
    disc = np.where(np.hypot(y - 48, x - 48) < 26, 0.1, 0.9)
    hatched = np.where((x % 4 < 2) & (disc < 0.5), 0.1, 0.9)
    assert measure(hatched, disc).likeness > 0.8 > CLEAR


def test_the_four_kinds_divide_the_plane():
    noise = np.random.default_rng(1).random((96, 96)) ** 3
    wide, thin = stripes(14), stripes(3, period=24)
    assert 14 / 96 > THICK > 3 / 96
    assert 0 < CLEAR < 1
    kinds = [measure(picture, base).kind for picture in (wide, thin) for base in (picture, noise)]
    assert kinds == [Kind.THICK_CLEAR, Kind.THICK_HIDDEN, Kind.THIN_CLEAR, Kind.THIN_HIDDEN]
    assert len({kind.words for kind in Kind}) == 4


def test_an_empty_picture_has_no_strokes():
    assert measure(np.ones((20, 20, 3))).stroke == 0


def test_sizes_must_agree():
    with pytest.raises(ts.ImageError, match="resize"):
        measure(np.ones((20, 20)), np.ones((20, 21)))
