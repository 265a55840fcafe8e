"""Simpler and sharper motifs for products."""

import numpy as np
import pytest

import toposeam as ts


def test_the_heaviest_inks_are_kept_as_they_are():
    recipe = ts.motif.random_recipe(
        24, layers=3, mass=[0.1, 0.3, 0.2], penalty=[3, 1, 3], seed=1, iterations=4
    )
    simple = ts.motif.simplify(recipe, inks=2)
    assert simple.layers == recipe.layers[1:]
    whole, kept = ts.generate_motif(recipe), ts.generate_motif(simple)
    np.testing.assert_array_equal(kept.densities, whole.densities[1:])
    assert ts.motif.simplify(recipe, inks=9) == recipe


@pytest.mark.medium
def test_ink_wash_is_sharpened_to_strokes():
    recipe = ts.motif.random_recipe(24, layers=1, penalty=1, seed=1, iterations=8)
    soft = ts.generate_motif(recipe).coverage((96, 96))
    sharp = ts.generate_motif(ts.motif.simplify(recipe, edge="crisp")).coverage((96, 96))
    gray = [np.mean((cover > 0.1) & (cover < 0.9)) for cover in (soft, sharp)]
    assert gray[1] < 0.3 * gray[0]


def test_what_cannot_be_simplified_is_said():
    recipe = ts.motif.random_recipe(24, layers=1, seed=1)
    with pytest.raises(ts.OptionError, match="inks"):
        ts.motif.simplify(recipe, inks=0)
    with pytest.raises(ts.OptionError, match="edge"):
        ts.motif.simplify(recipe, edge="blurred")
