"""Different motifs that join: compounds (4.10), stages (Figure 4.8), arrangements (Figure 4.9)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.optimise.compound import _interpolate

SIZE = 48


def _recipes(seeds=(1, 2), size=SIZE):
    return [
        ts.motif.random_recipe(
            size, layers=1, seed=seed, repeat="translate", palette="botanic", iterations=24
        )
        for seed in seeds
    ]


def _joined(weight, stages=1, shared=0, seeds=(1, 2), size=SIZE):
    return ts.motif.join_motifs(_recipes(seeds, size), weight=weight, stages=stages, shared=shared)


def test_without_weight_each_motif_is_what_it_is_alone():
    joined = _joined(0.0)
    for motif, recipe in zip(joined.motifs, _recipes(), strict=True):
        assert np.array_equal(motif.densities, ts.generate_motif(recipe).densities)


@pytest.mark.medium
def test_motifs_join_better_the_more_the_compound_weighs():
    apart, together = _joined(0.0), _joined(0.5)
    assert together.mismatch() < 0.7 * apart.mismatch()
    own = [
        np.mean([ts.motif.border_mismatch(m, m) for m in joined.motifs])
        for joined in (apart, together, _joined(1.0))
    ]
    assert own[0] < own[1] < own[2]  # and each itself the worse (Figure 4.7)


def test_border_mismatch_is_the_ratio_of_outer_to_inner_steps():
    """By hand: columns rise and fall by steps of their own, rows are even."""
    columns = {"a": [0.0, 0.1, 0.2, 0.25], "b": [0.5, 0.8, 0.9, 0.7]}
    motifs = {}
    for name, values in columns.items():
        recipe = ts.motif.random_recipe(8, layers=1, repeat="translate", seed=1, iterations=1)
        density = np.tile(np.array(values, np.float32), (4, 1))[None]
        motifs[name] = dataclasses.replace(ts.generate_motif(recipe), densities=density)
    a, b = motifs["a"], motifs["b"]
    # a|b: 0.25 to 0.5, b|a: 0.7 to 0.0; over one another: the mean step between the rows of a and of b
    between = np.mean([abs(x - y) for x, y in zip(columns["a"], columns["b"], strict=True)])
    across = (0.25 + between + 0.7 + between) / 4
    # beside a|b: 0.25 - 0.2 in a, 0.8 - 0.5 in b; beside b|a: 0.7 - 0.9 in b, 0.1 in a; rows do not change
    within = (0.05 + 0.3 + 0 + 0 + 0.2 + 0.1 + 0 + 0) / 8
    assert ts.motif.border_mismatch(a, b) == pytest.approx(across / within, rel=1e-5)


@pytest.mark.slow
def test_the_mismatch_falls_with_the_stages():
    """In the mean over some pairs, from the first and the second to the third; not of every pair."""
    mismatches = []
    for seeds in ((1, 2), (5, 6), (7, 9), (11, 12), (13, 14), (15, 16)):
        joined = _joined(0.5, stages=3, seeds=seeds, size=96)
        assert joined.stages == (1, 3, 2, 3, 1)
        mismatches.append([joined.mismatch(stage) for stage in (1, 2, 3)])
    first, second, third = np.mean(mismatches, axis=0)
    assert third < 0.95 * min(first, second)


@pytest.mark.medium
def test_a_stage_leaves_the_motifs_before_it_alone():
    one, two = _joined(0.5), _joined(0.5, stages=2)
    assert np.array_equal(one.motifs[0].densities, two.motifs[0].densities)
    assert np.array_equal(one.motifs[1].densities, two.motifs[2].densities)


def test_a_shared_border_joins_any_motif_to_any():
    motifs = _joined(0.5, shared=2, seeds=(1, 2, 3)).motifs
    assert len(motifs) == 3
    for other in motifs[1:]:
        for side in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1]):
            assert np.array_equal(motifs[0].densities[side], other.densities[side])
        assert ts.motif.border_mismatch(motifs[0], other) < 1.5


@pytest.mark.slow
def test_borders_of_wash_beside_strokes_do_not_show():
    given = {"layers": 2, "repeat": "translate", "palette": "sea", "iterations": 25}
    recipes = [ts.motif.random_recipe(96, seed=seed, **given) for seed in (1, 5)]
    joined = ts.motif.join_motifs(recipes)
    assert len({tuple(motif.edges) for motif in joined.motifs}) == 2
    for seed in (300, 301, 302):  # one factor for both leaves 1.17
        laid = ts.motif.arrange(joined.motifs, (4, 4), seed=seed)
        for plane in (*laid.coverage(), laid.image()):
            assert ts.motif.border_visibility(plane, (96, 96)) <= 1


@pytest.mark.medium
@pytest.mark.parametrize("shared", [0, 3])
def test_every_motif_keeps_its_mass(shared):
    for motif in _joined(0.5, stages=2, shared=shared).motifs:
        assert motif.densities.mean() == pytest.approx(motif.recipe.layers[0].mass, abs=1e-3)


def test_borders_share_three_hundredths_of_the_shorter_side():
    recipes = [dataclasses.replace(recipe, iterations=2) for recipe in _recipes(size=(64, 70))]
    given, by_itself = (ts.motif.join_motifs(recipes, **more).motifs for more in ({"shared": 2}, {}))
    for one, other in zip(given, by_itself, strict=True):
        np.testing.assert_array_equal(one.densities, other.densities)
    other = ts.motif.join_motifs(recipes, shared=1).motifs
    assert any((one.densities != two.densities).any() for one, two in zip(given, other, strict=True))


def test_an_arrangement_puts_motifs_where_the_grid_says():
    recipes = [
        dataclasses.replace(
            recipe, layers=tuple(dataclasses.replace(part, edge="soft") for part in recipe.layers)
        )
        for recipe in _recipes()
    ]
    motifs = ts.motif.join_motifs(recipes, weight=0.0, shared=0).motifs
    image = ts.motif.arrange(motifs, [[0, 1, 1], [1, 0, 0]]).image()
    assert np.array_equal(image[:SIZE, SIZE : 2 * SIZE], motifs[1].image())
    assert np.array_equal(image[SIZE:, :SIZE], motifs[1].image())
    assert np.array_equal(image[SIZE:, 2 * SIZE :], motifs[0].image())
    laid = ts.motif.arrange(motifs, (2, 3), seed=4)
    assert repr(laid) == "Arrangement(3 × 2 places of 2 motifs)"
    assert laid.image((40, 90)).shape == (40, 90, 3)
    assert laid.record["arrangement"]["grid"] == laid.grid.tolist()
    assert laid.to_svg().count('inkscape:label="ink') == 1


@pytest.mark.parametrize("edge", ["crisp", "ink"])
def test_a_motif_is_printed_alike_at_any_place_and_count(edge):
    """Strokes end at one density of all motifs together; of a light and a heavy one, neither's own, and not
    that of the pattern.
    """
    recipes = [
        dataclasses.replace(
            recipe, layers=tuple(dataclasses.replace(part, edge=edge, mass=mass) for part in recipe.layers)
        )
        for recipe, mass in zip(_recipes(), (0.12, 0.4), strict=True)
    ]
    motifs = ts.motif.join_motifs(recipes, weight=0.0, shared=0).motifs
    inside = np.s_[:, 4 : SIZE - 4, 4 : SIZE - 4]
    few, many = (ts.motif.arrange(motifs, [row]) for row in ([0, 1, 1, 1, 1], [0, 0, 0, 0, 1]))
    np.testing.assert_allclose(few.coverage()[inside], many.coverage()[inside], atol=1e-4)
    assert [few.ends(0)] == [many.ends(0)]
    assert few.ends(0)[0] != motifs[0].ends(0)[0]
    drawings = [[line for line in laid.to_svg().splitlines() if "<g fill" in line] for laid in (few, many)]
    assert len(drawings[0]) == len(drawings[1]) > 0


@pytest.mark.parametrize("shared", [None, 0])
def test_wash_beside_strokes_is_wash_and_strokes_are_strokes(shared):
    """By the level at which strokes end wash would be crumbs, and by its haze strokes would be a blur."""
    recipes = [
        ts.motif.random_recipe(
            64, seed=seed, layers=1, repeat="translate", palette="sumi", iterations=15, penalty=penalty
        )
        for seed, penalty in ((5, 3.0), (8, 1.0))
    ]
    motifs = ts.motif.join_motifs(recipes, shared=shared).motifs
    assert [motif.edges for motif in motifs] == [("crisp",), ("soft",)]
    laid = ts.motif.arrange(motifs, [[0, 1], [1, 0]])
    assert laid.edges == ("soft",)
    size, cell = (512, 512), 256
    (print_,) = laid.coverage(size)
    away = slice(50, cell - 50)  # from borders, where the one goes over into the other
    strokes, wash = print_[:cell, :cell][away, away], print_[:cell, cell:][away, away]
    gray = [float(((part > 0.1) & (part < 0.9)).mean()) for part in (strokes, wash)]
    assert gray[0] < 0.1
    assert gray[1] > 0.3
    for part, motif in ((strokes, motifs[0]), (wash, motifs[1])):
        alone = motif.coverage((cell, cell))[0][away, away]
        assert np.abs(part - alone).mean() < 0.01
    # Whichever comes first.
    other = ts.motif.arrange(motifs[::-1], [[1, 0], [0, 1]])
    assert np.abs(other.coverage(size)[0] - print_).max() < 1e-5
    if shared is None:  # nothing steps between them
        across = np.abs(np.diff(print_, axis=1)).mean(axis=0)
        assert across[cell - 1] < 1.5 * np.median(across[:cell])
    assert "<path" in laid.to_svg()


def test_random_neighbours_keep_within_reach():
    grid = ts.motif.random_arrangement((20, 30), 7, seed=1, reach=1)
    assert np.abs(np.diff(grid, axis=0)).max() == 1
    assert np.abs(np.diff(grid, axis=1)).max() == 1
    assert np.unique(grid).size > 3
    assert np.array_equal(grid, ts.motif.random_arrangement((20, 30), 7, seed=1, reach=1))


def test_one_motif_alone_lies_everywhere():
    assert ts.motif.random_arrangement((1, 1), 1).tolist() == [[0]]
    for reach in (None, 1):
        assert ts.motif.random_arrangement((2, 3), 1, reach=reach).tolist() == [[0, 0, 0], [0, 0, 0]]


def test_without_a_reach_every_motif_lies_beside_every_other():
    grid = ts.motif.random_arrangement((30, 31), 3, seed=2)
    beside = {*zip(grid[:, :-1].flat, grid[:, 1:].flat, strict=True)}
    below = {*zip(grid[:-1].flat, grid[1:].flat, strict=True)}
    assert beside == below == {(one, other) for one in range(3) for other in range(3)}
    assert np.bincount(grid.flat) == pytest.approx(np.full(3, 310), abs=60)
    assert not np.array_equal(grid, ts.motif.random_arrangement((30, 31), 3, seed=3))


@pytest.mark.parametrize(
    ("counts", "motifs", "options", "text"),
    [
        ((2, 3), 0, {}, "motifs"),
        ((2, 3), 2**62 + 1, {}, "motifs"),
        ((0, 3), 2, {}, "counts"),
        ((2, 3), 2, {"reach": 0}, "reach"),
        ((1001, 1000), 2, {}, "1000000"),
    ],
)
def test_arrangements_nobody_can_draw_are_refused(counts, motifs, options, text):
    with pytest.raises(ts.OptionError, match=text):
        ts.motif.random_arrangement(counts, motifs, **options)


def test_only_motifs_that_were_joined_are_arranged():
    one = ts.generate_motif(16, seed=1, repeat="translate", palette="sea", iterations=1, layers=1)
    large = ts.generate_motif(18, seed=1, repeat="translate", palette="sea", iterations=1, layers=1)
    red = dataclasses.replace(one, inks=one.inks[:, ::-1])
    for motifs, grid, kind in (
        ([], [[0]], "count"),
        ([one, large], [[0]], "unlike"),
        ([one, red], [[0]], "unlike"),
        ([one], [[0, -1]], "choice"),
        ([one], [[0, 1]], "choice"),
        ([one], [0, 0, 0], "shape"),
        ([one], np.zeros((1, 0), int), "shape"),
        ([one], (2**15, 2**15), "too large"),
        ([one], np.zeros((2000, 2000), int), "too large"),
    ):
        with pytest.raises(ts.OptionError) as raised:
            ts.motif.arrange(motifs, grid)
        assert raised.value.kind == kind
    laid = ts.motif.arrange([one], [[0, 0, 0]])
    assert laid.densities.shape == (1, 16, 48)
    assert (laid.repeat, laid.names, laid.edges) == ("translate", one.names, one.edges)
    np.testing.assert_array_equal(laid.densities, np.tile(one.densities, (1, 1, 3)))


def test_what_cannot_be_joined_is_refused_in_one_sentence():
    one, two = _recipes()
    other = ts.motif.random_recipe(SIZE, layers=1, seed=2, repeat="translate", palette="plum", iterations=24)
    for recipes, options, text in [
        ([one], {}, "two motifs"),
        ([one, other], {}, "paper"),
        (
            [
                one,
                ts.motif.random_recipe(
                    SIZE + 2, layers=1, repeat="translate", palette="botanic", iterations=24
                ),
            ],
            {},
            "size",
        ),
        ([ts.motif.random_recipe(SIZE, layers=1), one], {}, "repeat"),
        ([one, two], {"weight": 1.5}, "weight"),
        ([one, two], {"stages": 0}, "stages"),
        ([one, two], {"shared": -1}, "shared"),
    ]:
        with pytest.raises(ts.OptionError, match=text):
            ts.motif.join_motifs(recipes, **options)
    motifs = _joined(0.0).motifs
    for arrangement in ([[0, 2]], [[0.5]], (0, 3), []):
        with pytest.raises(ts.OptionError):
            ts.motif.arrange(motifs, arrangement)


@pytest.mark.parametrize(
    ("given", "stages", "between", "parameter", "text"),
    [
        (2, 4, 8, "stages", "make 730 of 2, more than 100; ask for fewer stages"),
        (2, 10, 1, "stages", "make 513 of 2, more than 100; ask for fewer stages"),
        (101, 1, 1, "recipes", "101 recipes were given, more than 100; join fewer"),
    ],
)
def test_rows_of_too_many_motifs_are_refused(given, stages, between, parameter, text):
    with pytest.raises(ts.OptionError, match=text) as raised:
        ts.motif.join_motifs(_recipes(range(given), 16), stages=stages, between=between)
    assert (raised.value.kind, raised.value.parameter, raised.value.allowed) == ("too large", parameter, 100)


def test_recipes_of_days_of_work_are_not_joined():
    recipes = [dataclasses.replace(recipe, iterations=10000) for recipe in _recipes(size=256)]
    with pytest.raises(ts.OptionError, match="takes 10000 iterations of 256 × 256 elements"):
        ts.motif.join_motifs(recipes)


def test_members_begin_as_blends_of_the_fixed_ones_beside_them():
    left, right = np.zeros((4, 4)), np.full((4, 4), 0.4)
    left[0], right[-1] = 0.6, 0.1
    designs = [left.copy(), None, None, right.copy()]
    _interpolate(designs, [1, 2], [0.2, 0.2, 0.2, 0.2])
    for index, share in ((1, 1 / 3), (2, 2 / 3)):
        blend = (1 - share) * left + share * right
        np.testing.assert_allclose(designs[index], 0.2 * blend / blend.mean())


@pytest.mark.parametrize("repeat", ["p2", "pmm", "p4m"])
def test_joined_motifs_keep_the_group_they_share(repeat):
    given = {"layers": 1, "iterations": 5, "palette": "sea"}
    recipes = [ts.motif.random_recipe(32, repeat=repeat, seed=seed, **given) for seed in (1, 2)]
    for motif in ts.motif.join_motifs(recipes, stages=2).motifs:
        density = motif.densities[0]
        np.testing.assert_array_equal(density, density[::-1, ::-1])
        if repeat != "p2":
            np.testing.assert_array_equal(density, density[:, ::-1])
        if repeat == "p4m":
            np.testing.assert_array_equal(density, density.T)
