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


def test_likeness_is_a_correlation():
    rng = np.random.default_rng(0)
    picture = stripes(12)
    assert measure(picture, picture).likeness == pytest.approx(1)
    assert measure(picture, 1 - picture).likeness == pytest.approx(-1)
    assert abs(measure(picture, rng.random(picture.shape)).likeness) < 0.3
    assert measure(picture).likeness == 0


def test_the_four_kinds_divide_the_plane():
    noise = np.random.default_rng(1).random((96, 96))
    wide, thin = stripes(14), stripes(3, period=12)
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
