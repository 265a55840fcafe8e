"""Pictures bent so that slanted lines go on where they repeat."""

import numpy as np
import pytest

import toposeam as ts

SIDE = 160


def slanted(slope, fan=0.0, period=32):
    """Light lines on dark ground, each row shifted to the right of the one above, more so on the right."""
    y, x = np.mgrid[:SIDE, :SIDE]
    at = x - (slope + fan * (x / SIDE - 0.5)) * y
    return np.where(np.abs((at + period / 2) % period - period / 2) < 3, 0.8, 0.3).astype(np.float32)


def step_across(image):
    """Mean step across the upper border when the picture repeats."""
    return float(np.abs(image[0] - image[-1]).mean())


@pytest.mark.parametrize(("slope", "fan"), [(0.05, 0), (-0.08, 0), (0.06, 0.05)])
def test_slanted_lines_meet_at_the_border(slope, fan):
    image = slanted(slope, fan)
    fit = ts.texture.fit_borders(image, tileable="both")
    bent = fit.apply(image)
    assert fit.most <= np.tan(np.radians(8)) * SIDE / 2 + 1
    assert step_across(bent) < 0.4 * step_across(image)
    assert bent.dtype == image.dtype


def test_the_other_axis_is_cropped_to_where_it_closes():
    image = slanted(0.05)
    bent = ts.texture.fit_borders(image).apply(image)
    assert bent.shape[0] == SIDE
    assert abs(bent.shape[1] % 32 - 16) >= 12  # whole periods, nearly


def test_numbers_keep_their_values():
    image = slanted(0.05)
    fit = ts.texture.fit_borders(image)
    numbers = np.random.default_rng(0).choice([3, 7, 200], (SIDE, SIDE)).astype(np.uint8)
    assert set(np.unique(fit.apply(numbers, mixed=False))) == {3, 7, 200}


def test_what_closes_and_what_has_no_lines_is_not_bent():
    assert ts.texture.fit_borders(slanted(0)) is None
    assert ts.texture.fit_borders(np.random.default_rng(1).random((SIDE, SIDE))) is None
