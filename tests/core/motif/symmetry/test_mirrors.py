"""Mirrors hold as much as the rows beside them, and what a border still shows is taken off."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.border_smoothing import conspicuous
from toposeam.motif.symmetry import symmetry
from toposeam.motif.symmetry.mirrors import mirrors, places_of


@pytest.mark.parametrize(
    ("repeat", "down", "across"),
    [
        ("translate", [], []),
        ("pm", [], [0.0, 0.5]),
        ("pmm", [0.0, 0.5], [0.0, 0.5]),
        ("cm", [], [0.0, 0.5]),
        ("pmg", [0.25, 0.75], []),
        ("pgg", [], []),
        ("p4g", [0.0], [0.0]),
        ("reflect", [0.0, 1.0], [0.0, 1.0]),
    ],
)
def test_mirrors_lie_where_the_group_has_them(repeat, down, across):
    found = [sorted(places) for places in places_of(repeat)]
    if repeat == "pmg":  # one of the two, by the setting
        assert sorted(found) == sorted([down, across])
    else:
        assert found == [down, across]


@pytest.mark.parametrize("repeat", ["reflect", "pmm", "cmm", "p4m", "p31m"])
def test_rows_at_a_mirror_hold_as_much_as_those_beyond(repeat):
    """A pale line along the border of a random design: afterwards the row holds as much as others, the design
    has the same mass, its bounds are kept and it is as symmetric as before.
    """
    shape = (48, 48)
    orbits = symmetry(repeat, shape)
    field = orbits.mean(np.random.default_rng(1).uniform(0.2, 0.5, shape))
    field[:2] *= 0.5
    field[-2:] *= 0.5
    field = orbits.mean(field)
    found = mirrors(repeat, shape).held(field, 0.3, np.full(shape, 0.01), np.ones(shape))
    rows = found.mean(axis=1)
    assert field.mean(axis=1)[0] < 0.85 * field.mean(axis=1)[6:12].mean()
    assert rows[0] == pytest.approx(rows[4:8].mean(), rel=0.06)
    assert found.mean() == pytest.approx(0.3, abs=2e-3)
    assert found.min() >= 0.01
    assert found.max() <= 1
    np.testing.assert_allclose(orbits.mean(found), found, rtol=1e-12)


@pytest.mark.parametrize("repeat", ["cmm", "pmm", "pm", "p31m"])
def test_wash_has_no_hairline_where_a_mirrors_band_ends(repeat):
    """Smooth wash: what it is multiplied by changes gently from each row to the next."""
    shape = (192, 192)
    orbits = symmetry(repeat, shape)
    noise = ndimage.gaussian_filter(np.random.default_rng(2).normal(size=shape), 8, mode="wrap")
    field = orbits.mean(0.3 + 0.1 * noise / noise.std())

    def sharpest(wash):
        bounds = np.full(shape, 0.01), np.ones(shape)
        found = mirrors(repeat, shape).held(field, float(field.mean()), *bounds, wash=wash)
        assert found.mean() == pytest.approx(field.mean(), rel=1e-3)
        factor = np.log(found / field)
        return max(np.abs(np.diff(factor, 2, axis=axis)).max() for axis in (0, 1))

    assert sharpest(wash=True) < 0.25 * sharpest(wash=False)


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["reflect", "pm", "pmm", "p6", "p6m", "drop", "pgg"])
def test_no_border_shows(repeat):
    """Rules whose borders showed in one of these seeds while nothing was done about it."""
    for seed in (0, 1, 2):
        motif = ts.generate_motif(64, repeat=repeat, seed=seed, layers=2)
        assert conspicuous(motif).max() <= 1.0
        for layer, density in zip(motif.recipe.layers, motif.densities, strict=True):
            assert density.mean() == pytest.approx(layer.mass, abs=0.01)
