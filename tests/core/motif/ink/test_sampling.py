"""Densities at other sizes: what a new element covers is averaged, and nothing moves."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.ink import resample
from toposeam.motif.ink.sampling import _box


@pytest.mark.parametrize(("size", "axis"), [((66, 22), 1), ((22, 66), 0)])
def test_reducing_averages_what_an_element_covers(size, axis):
    stripes = np.moveaxis(np.tile(np.float32([0, 0, 1]), (66, 22)), 1, axis)
    # Picked out instead, every new element would be the middle one of its three, which is 0.
    assert resample(stripes, "translate", size) == pytest.approx(1 / 3, abs=1e-5)


def test_a_mean_over_any_width_blends_the_nearest_odd_ones():
    point = np.zeros((1, 11))
    point[0, 5] = 1
    assert _box(point, 3.0, 1)[0, 3:8] == pytest.approx([0, 1 / 3, 1 / 3, 1 / 3, 0])
    between = (1 / 3 + 1 / 5) / 2
    assert _box(point, 4.0, 1)[0, 3:8] == pytest.approx([0.1, between, between, between, 0.1])
    assert _box(point, 4.5, 1)[0, 3:8].sum() == pytest.approx(1)
    assert _box(point, 4.5, 1)[0, 3] == pytest.approx(0.75 / 5)


@pytest.mark.parametrize("size", [(96, 120), (20, 30), (100, 25)])
def test_nothing_moves(size):
    y, x = np.mgrid[:40, :60]
    disc = np.exp(-((y - 12.0) ** 2 + (x - 33.0) ** 2) / 12).astype(np.float32)
    centre = ndimage.center_of_mass(resample(disc, "translate", size))
    scale = 40 / size[0], 60 / size[1]
    found = [(at + 0.5) * step - 0.5 for at, step in zip(centre, scale, strict=True)]
    assert found == pytest.approx([12.0, 33.0], abs=0.02)


def test_densities_of_their_own_size_are_not_sampled_again():
    motif = ts.generate_motif(24, seed=1, layers=1, iterations=2)
    assert motif.resampled((24, 24)) is motif.densities
    assert motif.resampled() is motif.densities
    assert motif.resampled((12, 24)).shape == (1, 12, 24)
