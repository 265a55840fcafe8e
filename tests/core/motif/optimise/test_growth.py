"""A motif that grows: every rule and style, from nothing and from what is shown already."""

import dataclasses

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.optimise import optimise_layer
from toposeam.motif.symmetry import symmetry


def grown(recipe, **given):
    return list(ts.motif.grow(recipe, **given))


def likeness(first, second):
    return np.corrcoef(first.ravel(), second.ravel())[0, 1]


@pytest.mark.parametrize("repeat", ["none", "rotate", "brick 1/3", "p4g", "p31m"])
def test_every_step_keeps_mass_and_rule(repeat):
    recipe = ts.motif.random_recipe(96, style="vein", layers=2, repeat=repeat, seed=3)
    steps = grown(recipe)
    assert [step.share for step in steps] == sorted(step.share for step in steps)
    assert steps[-1].share == 1
    assert steps[0].densities[0].shape == (48, 48)
    assert steps[-1].densities[0].shape == (96, 96)
    for step in (steps[0], steps[-1]):
        for density, layer in zip(step.densities, recipe.layers, strict=True):
            assert density.mean() == pytest.approx(layer.mass, rel=0.01)
            assert np.allclose(symmetry(repeat, density.shape).mean(density), density)


def test_what_has_settled_ends_early():
    recipe = ts.motif.random_recipe(64, style="thesis", repeat="translate", seed=7)
    steps = grown(recipe)
    assert recipe.iterations == 40
    assert 10 < len(steps) < 30
    assert steps[-1].share == 1
    for density, index in zip(steps[-1].densities, range(len(recipe.layers)), strict=True):
        whole, _ = optimise_layer(recipe.of_layer(index))
        assert likeness(density, whole) > 0.98


def test_it_looks_like_what_the_recipe_makes():
    recipe = ts.motif.random_recipe(128, style="cutout", repeat="p4m", seed=7)
    made = ts.generate_motif(recipe)
    last = grown(recipe)[-1].densities
    other = grown(ts.motif.random_recipe(128, style="cutout", repeat="p4m", seed=8))[-1].densities
    for own, stranger, density in zip(last, other, made.densities, strict=True):
        assert likeness(own, density) > max(0.8, likeness(stranger, density) + 0.25)


def test_few_iterations_make_the_same_densities():
    recipe = ts.motif.random_recipe(64, style="key", repeat="p2", seed=5)
    (*_, last) = grown(recipe, start=[np.full((64, 64), 0.2)] * 2)
    for index, density in enumerate(last.densities):
        alone, _ = optimise_layer(recipe.of_layer(index))
        assert np.array_equal(density.astype(np.float32), alone)


def test_a_start_is_kept_and_takes_fewer_steps():
    recipe = ts.motif.random_recipe(128, style="vein", layers=1, repeat="translate", seed=1)
    cold = grown(recipe)
    shown = cold[-1].densities
    moved = ts.motif.vary(recipe, amount=0.1, seed=2)
    warm, anew = grown(moved, start=shown), grown(moved)
    assert len(warm) < len(anew)
    assert likeness(warm[-1].densities[0], shown[0]) > likeness(anew[-1].densities[0], shown[0]) + 0.1
    none = grown(moved, start=shown, kept=0)
    assert likeness(none[-1].densities[0], shown[0]) < likeness(warm[-1].densities[0], shown[0])


def test_a_start_may_have_any_size_and_rule():
    square = ts.motif.random_recipe(96, style="vein", layers=2, repeat="p4", seed=1)
    shown = grown(square)[-1].densities
    for repeat, size in (("p6m", 64), ("pm", (48, 96)), ("rotate", 50)):
        recipe = ts.motif.random_recipe(size, style="vein", layers=3, repeat=repeat, seed=1)
        last = grown(recipe, start=shown)[-1].densities
        assert [density.shape for density in last] == [recipe.size] * 3


def test_layers_keep_out_of_each_other():
    recipe = ts.motif.random_recipe(64, style="leaf", repeat="cm", seed=4)
    last = grown(recipe)[-1].densities
    assert np.sum(last, axis=0).max() < 1.2
    free = dataclasses.replace(
        recipe, layers=tuple(dataclasses.replace(layer, avoid=0) for layer in recipe.layers)
    )
    assert np.sum(grown(free)[-1].densities, axis=0).max() > 1.5


def test_the_finest_plate_may_be_small():
    recipe = ts.motif.random_recipe(512, style="vein", layers=1, repeat="p1", seed=1)
    steps = grown(recipe, most=128)
    assert {step.densities[0].shape for step in steps} == {(64, 64), (128, 128)}


def test_what_cannot_grow_is_said():
    recipe = ts.motif.random_recipe(16, seed=1)
    with pytest.raises(ts.OptionError, match="a Recipe"):
        ts.motif.grow(7)
    with pytest.raises(ts.OptionError, match="kept"):
        ts.motif.grow(recipe, kept=2)
    with pytest.raises(ts.OptionError, match="most"):
        ts.motif.grow(recipe, most=0)


@pytest.mark.parametrize(
    "start", [np.inf, [np.zeros(4)], [np.full((4, 4), 1.5)], ["ink"], [np.zeros((0, 4))]]
)
def test_a_start_that_is_no_density_is_refused(start):
    with pytest.raises(ts.OptionError, match="start"):
        ts.motif.grow(ts.motif.random_recipe(16, seed=1), start=start)
