"""Densities at other sizes: what a new element covers is averaged, and nothing moves."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.ink import resample
from toposeam.motif.ink.sampling import _box
from toposeam.motif.symmetry import tile


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


def test_whole_odd_factors_give_the_means_of_blocks():
    field = np.random.default_rng(1).random((15, 35))
    blocks = field.reshape(5, 3, 7, 5).mean(axis=(1, 3))
    for repeat in ("none", "translate", "reflect"):
        np.testing.assert_allclose(resample(field, repeat, (5, 7)), blocks, atol=1e-6)


@pytest.mark.parametrize(("repeat", "shift"), [("translate", 0), ("reflect", 0), ("rotate", 0), ("brick", 5)])
def test_enlarged_borders_go_on_as_the_pattern_does(repeat, shift):
    """By the spline through the whole pattern, which repeats by translation."""
    field = np.random.default_rng(2).random((8, 10)) * 0.6 + 0.2
    pattern = np.tile(field, (2, 2)) if repeat == "translate" else tile(field, repeat, (2, 2))
    assert np.array_equal(pattern[8:, :10], np.roll(field, shift, axis=1)) == (
        repeat in ("translate", "brick")
    )
    v, u = (np.arange(20) + 0.5) * 8 / 20 - 0.5, (np.arange(13) + 0.5) * 10 / 13 - 0.5
    expected = ndimage.map_coordinates(pattern, np.meshgrid(v, u, indexing="ij"), order=3, mode="grid-wrap")
    np.testing.assert_allclose(resample(field, repeat, (20, 13)), np.clip(expected, 0, 1), atol=1e-5)


def test_overshoot_of_splines_is_cut_off():
    steps = np.zeros((12, 12), np.float32)
    steps[3:9, 3:9] = 1
    large = resample(steps, "translate", (48, 48))
    assert (large.min(), large.max()) == (0, 1)


@pytest.mark.parametrize("size", [(20, 30), (2, 1)])
def test_reducing_keeps_the_mean_up_to_the_border(size):
    """Waves of one cell, which lose what a mean over a new element takes of them."""
    y, x = np.ogrid[:30, :40]
    field = 0.5 + 0.3 * np.cos(2 * np.pi * (y + 0.5) / 30) + 0.1 * np.sin(2 * np.pi * (x + 0.5) / 40)
    v, u = ((np.arange(count) + 0.5) / count for count in size)
    down, across = (np.sinc(1 / count) for count in size)
    expected = 0.5 + 0.3 * down * np.cos(2 * np.pi * v[:, None]) + 0.1 * across * np.sin(2 * np.pi * u)
    np.testing.assert_allclose(resample(field, "translate", size), expected, atol=6e-3)
