"""Styles: what they draw, and what is left of the plain problem in the thesis's."""

from collections import Counter

import numpy as np
import pytest

import toposeam as ts
from toposeam.heat.plate import Plate
from toposeam.motif.recipe import STYLES, Recipe
from toposeam.motif.symmetry import operations

SEEDS = range(1, 41)


@pytest.fixture(scope="module")
def drawn():
    return [ts.motif.random_recipe(256, style=None, repeat=None, seed=seed) for seed in SEEDS]


def test_styles_and_rules_of_seeds_differ(drawn):
    styles = Counter(recipe.layers[0].style for recipe in drawn)
    assert max(styles.values()) <= 8
    assert len(styles) >= 8
    assert len({recipe.repeat for recipe in drawn}) >= 7
    assert "thesis" not in styles


@pytest.mark.parametrize("style", sorted(STYLES))
def test_a_recipe_keeps_to_its_style(style):
    like = STYLES[style]
    for seed in range(6):
        recipe = ts.motif.random_recipe(64, style=style, repeat=None, seed=seed)
        assert recipe.repeat in like.rules
        assert len(recipe.layers) == like.layers
        assert (recipe.iterations, recipe.filter_radius) == (like.iterations, like.filter_radius)
        for layer in recipe.layers:
            assert like.mass[0] <= layer.mass <= like.mass[1]
            assert like.ambient[0] <= layer.ambient <= like.ambient[1]
            assert layer.penalty == like.penalty or (like.wash and 1 <= layer.penalty <= 1.3)
            assert layer.avoid == like.avoid
        assert Recipe.from_dict(recipe.to_dict()) == recipe


@pytest.mark.parametrize("style", ["chain", "folk", "bone", "daisy"])
def test_few_large_strokes_draw_rules_of_many_copies(style):
    drawn = [ts.motif.random_recipe(64, style=style, repeat=None, seed=seed).repeat for seed in SEEDS]
    assert min(len(operations(rule)) for rule in drawn) >= 3
    assert ts.motif.random_recipe(64, style=style, repeat="p1", seed=1).repeat == "p1"


@pytest.mark.parametrize("style", ["seed", "pebble", "daisy"])
def test_many_small_strokes_are_larger_than_crumbs(style):
    """Strokes of more sources would be as small as what the print leaves out."""
    for seed in range(6):
        layer = ts.motif.random_recipe(64, style=style, repeat="p6m", seed=seed).layers[0]
        assert 12 * len(layer.sources) <= 200
        alone = ts.motif.random_recipe(64, style=style, repeat="p1", seed=seed).layers[0]
        assert len(alone.sources) >= len(layer.sources)
    given = ts.motif.random_recipe(64, style=style, repeat="p6m", seed=1, sources=30).layers[0]
    assert len(given.sources) == 30


def test_a_rule_fits_the_cell():
    rules = {ts.motif.random_recipe((33, 41), repeat=None, seed=seed).repeat for seed in range(40)}
    assert len(rules) > 4
    assert not rules & {"rotate", "pmg", "p4", "p6m", "drop", "brick"}


def test_what_is_given_takes_the_place_of_the_style():
    recipe = ts.motif.random_recipe(64, style="fern", seed=1, layers=1, mass=0.2, iterations=7)
    assert (recipe.layers[0].mass, recipe.iterations, recipe.layers[0].sources) == (0.2, 7, ())
    places = [[0.2, 0.3], [0.7, 0.8]]
    recipe = ts.motif.random_recipe(64, style="fern", seed=1, sources=places, sinks=places)
    assert len(recipe.layers[0].sources) == len(recipe.layers[0].sinks) == 2


def test_each_layer_may_have_a_style_of_its_own():
    recipe = ts.motif.random_recipe(64, style=["cutout", "seed"], repeat="p4", seed=3)
    assert [layer.style for layer in recipe.layers] == ["cutout", "seed"]
    assert [recipe.of_layer(index).filter_radius for index in (0, 1)] == [8.0, 0.5]
    motif = ts.generate_motif(recipe)
    alone = ts.generate_motif(recipe.of_layer(1))
    assert motif.history[1] == alone.history[0]


@pytest.mark.parametrize("repeat", ["p2", "p6"])
def test_a_layer_keeps_out_of_those_before_it(repeat):
    def common(avoid):
        given = {"style": "leaf", "repeat": repeat, "layers": 2, "seed": 4, "avoid": avoid}
        first, second = ts.generate_motif(96, **given).coverage() > 0.5
        return (first & second).mean() / second.mean()

    assert common(1.0) < 0.7 * common(0.0)


def test_wide_strokes_have_no_straight_edges_at_mirrors():
    """Where mirrors of p4m cross, the rows of a stroke end one after the other, not many at once."""
    motif = ts.generate_motif(192, style="folk", layers=1, repeat="p4m", seed=2)
    inside = motif.coverage()[0] > 0.5
    longest = 0
    for mask in (inside, inside.T):
        for edge in np.diff(mask.astype(int), axis=0):
            runs = "".join("x" if step else " " for step in edge).split()
            longest = max(longest, *map(len, runs), 0)
    # A circle of the filter's width has a flat top of 2 sqrt(2 r) px.
    assert longest <= 16


def test_style_of_the_thesis_is_its_problem_alone():
    """A step of the optimality criteria from (4.1) to (4.4), written out, is the first step of the motif."""
    recipe = ts.motif.random_recipe(24, style="thesis", seed=5, layers=1, repeat="translate", iterations=1)
    layer = recipe.layers[0]
    assert (layer.ambient, layer.edge, recipe.base_law) == (0.0, "soft", "brightness")
    from toposeam.motif.optimise import problem_at

    problem = problem_at(layer, recipe, recipe.size)
    density = np.full(recipe.size, layer.mass)
    np.testing.assert_allclose(problem.conductivity(density, 3.0), layer.mass**3)
    plate = Plate(problem.plate.heat, problem.plate.convection, "translate")
    energy = plate.solve(density**3, tolerance=1e-10).energy
    benefit = 3.0 * density**2 * energy
    low, high = 0.0, 1e12
    for _ in range(200):
        multiplier = (low + high) / 2
        wanted = np.clip(density * np.sqrt(benefit / multiplier), density - 0.2, density + 0.2)
        wanted = np.clip(wanted, 1e-3, 1.0)
        low, high = (multiplier, high) if wanted.mean() > layer.mass else (low, multiplier)
    made = ts.generate_motif(recipe)
    np.testing.assert_allclose(made.densities[0], wanted, atol=2e-3)
    np.testing.assert_array_equal(made.coverage()[0], made.densities[0])


@pytest.mark.parametrize(
    ("style", "layers", "text"),
    [
        ("velvet", None, "vein"),
        (["vein", "velvet"], None, "vein"),
        (["vein", "seed"], 3, "2 layers, the motif has 3"),
        ([], None, "0 layers"),
    ],
)
def test_bad_styles_are_refused_in_one_sentence(style, layers, text):
    with pytest.raises(ts.OptionError, match=text):
        ts.motif.random_recipe(32, style=style, layers=layers)


def test_restyled_recipes_keep_their_inks():
    recipe = ts.motif.random_recipe(48, seed=1, palette="sea", repeat="p4m", layers=2)
    other = ts.motif.restyle(recipe, ["daisy", "batik"])
    assert [layer.style for layer in other.layers] == ["daisy", "batik"]
    assert [layer.ink for layer in other.layers] == [layer.ink for layer in recipe.layers]
    assert (other.size, other.repeat, other.seed) == (recipe.size, recipe.repeat, recipe.seed)
