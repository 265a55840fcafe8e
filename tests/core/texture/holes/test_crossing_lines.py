"""Straight lines that cross a hole are found, and go on in it."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.texture.holes import crossing_bands, kept_by, strips_of

SIDE = 200


def across(angle, away):
    """Distance of each pixel from a line."""
    y, x = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
    turn = np.radians(angle)
    return y * np.cos(turn) - x * np.sin(turn) - away


def painted(*lines, width=6, seed=0):
    """Grainy ground with painted lines (angle, distance from the middle), and a round hole."""
    rng = np.random.default_rng(seed)
    image = 0.35 + 0.05 * ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), 1.5)
    for line in lines:
        cover = np.clip(width / 2 + 0.5 - np.abs(across(*line)), 0, 1)
        image += cover * (0.9 - image)
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
    return image.astype(np.float32), np.hypot(y, x) < 36


@pytest.mark.parametrize("angle", [0, 17, 45, 93, 151])
def test_a_line_is_found_to_half_a_degree(angle):
    image, hole = painted((angle, 7))
    (band,) = crossing_bands(np.where(hole, 0, image), hole, ~hole)
    found = np.degrees(np.arctan2(*band.along)) % 180
    assert abs((found - angle + 90) % 180 - 90) <= 0.5
    strip = strips_of([band], hole) > 0
    assert (strip[hole & (np.abs(across(angle, 7)) < 3)]).mean() > 0.95
    assert not strip[np.abs(across(angle, 7)) > 10].any()


def test_shifts_along_a_line_lay_it_on_itself():
    image, hole = painted((17, 0))
    (band,) = crossing_bands(image, hole, ~hole)
    shifts = band.shifts(70.0)
    assert kept_by([band], shifts)[:, 1].all()
    assert np.hypot(*shifts.T).max() > 72
    assert not band.keeps(np.array([[30, 0], [0, 0]])).any()


def test_what_ends_in_the_hole_is_no_crossing_line():
    image, hole = painted((20, 0))
    x = np.mgrid[:SIDE, :SIDE][1]
    image[x > SIDE / 2] = painted()[0][x > SIDE / 2]
    assert crossing_bands(image, hole, ~hole) == []


def test_noise_has_no_lines():
    rng = np.random.default_rng(3)
    image = ndimage.gaussian_filter(rng.normal(0.5, 0.3, (SIDE, SIDE)), 1).astype(np.float32)
    assert crossing_bands(image, painted()[1], ~painted()[1]) == []


@pytest.mark.parametrize("lines", [[(25, 0)], [(25, -12), (-50, 4)], [(8, -16), (8, 16)]])
def test_painted_lines_go_on_across_a_filled_hole(lines):
    image, hole = painted(*lines)
    made = ts.fill(np.where(hole, 0, image), hole, by="shifts").image
    on = np.min([np.abs(across(*line)) for line in lines], axis=0)
    assert made[hole & (on < 1.5)].mean() > 0.85
    assert (made[hole & (on < 1.5)] > 0.6).mean() > 0.95
    assert (made[hole & (on > 5)] < 0.6).mean() > 0.98
