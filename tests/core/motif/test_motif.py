"""The contract of motifs: recipes, bytes, colours, repeats."""

from __future__ import annotations

import json

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.symmetry import HEXAGONAL

QUICK = {"size": 48, "layers": 2, "iterations": 6}


def _quick(**options):
    values = {**QUICK, **options}
    return ts.generate_motif(values.pop("size"), **values)


def test_a_recipe_makes_the_same_bytes_again():
    motif = _quick(repeat="translate", seed=3)
    again = ts.generate_motif(ts.Recipe.from_dict(json.loads(json.dumps(motif.recipe.to_dict()))))
    assert motif.densities.tobytes() == again.densities.tobytes()
    assert motif.recipe == again.recipe
    assert np.array_equal(motif.image(), again.image())


def test_densities_and_colours_are_what_the_contract_says():
    motif = _quick(size=(32, 48))
    assert motif.densities.shape == (2, 32, 48)
    assert motif.densities.dtype == np.float32
    assert 0 <= motif.densities.min() <= motif.densities.max() <= 1
    image = motif.image((50, 80))
    assert image.shape == (50, 80, 3)
    assert image.dtype == np.float32
    assert 0 <= image.min() <= image.max() <= 1


def test_giving_one_parameter_leaves_the_random_others():
    plain, heavier = ts.random_recipe(64, seed=5), ts.random_recipe(64, seed=5, mass=0.5)
    assert [layer.sources for layer in plain.layers] == [layer.sources for layer in heavier.layers]
    assert [layer.sinks for layer in plain.layers] == [layer.sinks for layer in heavier.layers]
    assert plain.paper == heavier.paper


@pytest.mark.parametrize("repeat", [r for r in ts.REPEATS if r != "none"])
def test_patterns_of_every_rule_have_its_size(repeat):
    motif = _quick(size=24, layers=1, repeat=repeat, iterations=3)
    rows = 42 if repeat in HEXAGONAL else 24
    assert ts.repeat_densities(motif, (2, 3)).shape == (1, 2 * rows, 72)
    assert ts.repeat(motif, (2, 3), size=(30, 30)).shape == (60, 90, 3)
