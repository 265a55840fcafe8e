"""Mirrors hold as much as the rows beside them, and what a border still shows is taken off."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.border_smoothing import border_visibilities
from toposeam.motif.symmetry import Mirrors, symmetry
from toposeam.motif.symmetry.mirrors import mirror_places, mirrors


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
    found = [sorted(places) for places in mirror_places(repeat)]
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
    found = mirrors(repeat, shape).balance(field, 0.3, np.full(shape, 0.01), np.ones(shape))
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
        found = mirrors(repeat, shape).balance(field, float(field.mean()), *bounds, wash=wash)
        assert found.mean() == pytest.approx(field.mean(), rel=1e-3)
        factor = np.log(found / field)
        return max(np.abs(np.diff(factor, 2, axis=axis)).max() for axis in (0, 1))

    assert sharpest(wash=True) < 0.25 * sharpest(wash=False)


def pale_lines(shape, places):
    """Rows that differ, and are pale near some."""
    noise = ndimage.gaussian_filter(np.random.default_rng(4).normal(size=shape), 2, mode="wrap")
    field = 0.3 + 0.02 * noise / noise.std()
    for at in places:
        field[(at + np.arange(-3, 3)) % shape[0]] *= 0.6
    return field


@pytest.mark.parametrize("wash", [False, True])
def test_what_a_mirror_lacks_its_band_gets(wash):
    """At the border of a cell beside others and nowhere else: strokes row by row, wash as one band that fades
    out; half as much counts of each side as far as it is nearer.
    """
    shape = (60, 84)
    field = pale_lines(shape, [0])
    found = Mirrors("translate", shape, border=True).balance(
        field, 0.3, *map(np.full, [shape] * 2, [0.0, 1.0]), wash=wash
    )
    factor = np.log(found / field)
    # Half the band is seven hundredths of a side: 4 rows and 6 columns.
    inside = factor[4:-4, 6:-6]
    assert np.ptp(inside) < 1e-9
    across, down = factor[:, 42] - inside[0, 0], factor[30] - inside[0, 0]
    np.testing.assert_allclose(factor - inside[0, 0], across[:, np.newaxis] + down, atol=1e-9)
    assert np.abs(across[4:-4]).max() < 1e-9
    assert np.abs(down[6:-6]).max() < 1e-9
    assert found.mean() == pytest.approx(0.3, abs=1e-6)
    for mean, band, gained in ((found.mean(axis=1), 4, across), (found.mean(axis=0), 6, down)):
        near = np.arange(-band, band)
        beyond = mean[-2 * band : -band].mean(), mean[band : 2 * band].mean()
        share = (near + band + 0.5) / (2 * band)
        wanted = (1 - share) * beyond[0] + share * beyond[1]
        if wash:
            fully = np.cos(np.pi / 2 * (near + 0.5) / band) ** 2
            assert (fully * mean[near]).sum() == pytest.approx((fully * wanted).sum(), rel=2e-3)
            np.testing.assert_allclose(gained[near], fully * gained[near].sum() / fully.sum(), atol=1e-9)
        else:
            np.testing.assert_allclose(mean[near], wanted, rtol=2e-3)


@pytest.mark.parametrize("wash", [False, True])
def test_rows_at_the_edge_of_reflect_hold_what_those_beyond_do(wash):
    shape = (70, 60)
    field = pale_lines(shape, [0])
    lowest, highest = np.full(shape, 0.01), np.ones(shape)
    found = Mirrors("reflect", shape).balance(field, 0.3, lowest, highest, wash=wash)
    rows, columns, before = found.mean(axis=1), found.mean(axis=0), field.mean(axis=1)
    assert found.mean() == pytest.approx(0.3, abs=1e-6)
    if wash:
        # Factors of rows that fade: none where the band ends, and the first row has nearly all it lacks.
        gained = np.log(rows / before) - np.log(rows / before)[30]
        assert rows[0] == pytest.approx(rows[5:10].mean(), rel=0.08)
        assert (np.diff(gained[1:6]) < 0).all()
        assert gained[4] < 0.02 < 0.4 < gained[0]
        assert np.abs(gained[5:-5]).max() < 1e-3
    else:
        for mean, band in ((rows, 5), (columns, 4)):
            for side in (mean, mean[::-1]):
                np.testing.assert_allclose(side[:band], side[band : 2 * band].mean(), rtol=2e-3)


def test_designs_without_mirrors_are_left_as_they_are():
    field = np.random.default_rng(0).random((12, 12))
    free = Mirrors("translate", (12, 12))
    assert not free.any
    assert free.balance(field, 0.9, np.zeros((12, 12)), np.ones((12, 12))) is field
    assert Mirrors("pm", (12, 12)).any
    assert Mirrors("translate", (12, 12), border=True).any


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["reflect", "pm", "pmm", "p6", "p6m", "drop", "pgg"])
def test_no_border_shows(repeat):
    """Rules whose borders showed in one of these seeds while nothing was done about it."""
    for seed in (0, 1, 2):
        motif = ts.generate_motif(64, repeat=repeat, seed=seed, layers=2)
        assert border_visibilities(motif).max() <= 1.0
        for layer, density in zip(motif.recipe.layers, motif.densities, strict=True):
            assert density.mean() == pytest.approx(layer.mass, abs=0.01)


def test_a_border_where_nothing_lies_becomes_even():
    """No factor makes ink of nothing, so what lies beside the border has to become less."""
    motif = ts.motif(96, style="folk", repeat="drop", seed=1)
    assert border_visibilities(motif).max() <= 1
