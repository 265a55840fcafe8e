"""Composition: outlines, guides, scales, places from pictures and drawings, knock-out, one piece."""

import dataclasses

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.ink import Raster, one_piece
from toposeam.motif.optimise import HexagonalProblem, LayerProblem, outline_on_cell
from toposeam.motif.recipe import unpack_base
from toposeam.motif.symmetry import symmetry

SIZE = 64
QUICK = {"layers": 1, "style": "vein", "penalty": 3.0, "iterations": 8, "palette": "sumi", "seed": 3}


@pytest.fixture
def disc():
    y, x = np.mgrid[:80, :80] + 0.5
    return np.where(np.hypot(x - 40, y - 40) < 26, 0.0, 1.0)


def made(size=SIZE, **options):
    return ts.generate_motif(size, **{**QUICK, **options})


@pytest.mark.parametrize("repeat", ["none", "translate", "rotate", "p4m", "p6"])
def test_strokes_fill_an_outline_or_avoid_it(disc, repeat):
    for place in ("inside", "outside"):
        motif = made(outline=disc, place=place, repeat=repeat)
        layer = motif.densities[0] if motif.lattice is None else motif.lattice[0]
        domain = outline_on_cell(motif.recipe.outline, place, repeat, motif.recipe.size)
        beyond = ~ndimage.binary_dilation(domain, iterations=2)
        assert layer[beyond].max(initial=0) < 0.1
        assert layer[domain].mean() == pytest.approx(motif.recipe.layers[0].mass, rel=0.2)


def test_an_outline_keeps_the_proportions_of_its_picture(disc):
    wide = ts.motif.random_recipe((64, 128), **QUICK, outline=disc)
    shown = unpack_base(wide.outline) > 0.5
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    assert shown.shape[1] == 2 * shown.shape[0]
    assert abs(len(rows) - len(columns)) <= 2


@pytest.mark.parametrize(
    ("repeat", "scale"), [("translate", 3), ("p4m", 2), ("pgg", 3), ("rotate", 3), ("p3", 2)]
)
def test_copies_of_a_layer_are_alike_and_keep_the_rule(repeat, scale):
    motif = made(72, repeat=repeat, scale=scale)
    layer = motif.densities[0] if motif.lattice is None else motif.lattice[0]
    if repeat not in ("rotate",):
        step = 72 // scale
        moved = np.roll(layer, (step, step), (0, 1))
        assert np.abs(moved - layer).mean() < 0.06
    orbits = symmetry(repeat, (72, 72))
    np.testing.assert_allclose(orbits.mean(layer.astype(float)), layer, atol=1e-6)


def test_recipes_with_a_composition_are_read_back(disc):
    recipe = ts.motif.random_recipe(
        SIZE, **{**QUICK, "layers": 2}, outline=disc, place=["outside", "inside"], scale=[3, 1], guide=disc,
        knock_out=True, trap=0.5, one_piece="ink", bridge=3.0, repeat="translate",
    )  # fmt: skip
    assert ts.motif.Recipe.from_dict(recipe.to_dict()) == recipe
    plain = ts.motif.random_recipe(SIZE, **QUICK).to_dict()
    assert not {"outline", "guide", "knock_out", "one_piece", "trap", "bridge"} & set(plain)
    assert not {"place", "scale"} & set(plain["layers"][0])


def test_variations_stay_inside_of_an_outline(disc):
    recipe = ts.motif.random_recipe(SIZE, **QUICK, outline=disc, repeat="translate")
    for seed in range(3):
        near = ts.motif.vary(recipe, amount=0.5, seed=seed)
        assert near.outline == recipe.outline
        assert near.layers[0].place == "inside"
        for x, y, _ in near.layers[0].sources + near.layers[0].sinks:
            assert np.hypot(x - 0.5, y - 0.5) < 0.36
    ts.motif.restyle(recipe, "fern")


@pytest.mark.parametrize("repeat", ["translate", "p4m", "p6"])
def test_heat_flows_best_along_a_guide_and_its_images(repeat):
    line = np.ones((SIZE, SIZE))
    line[20:22, 8:56] = 0
    recipe = ts.motif.random_recipe(SIZE, **QUICK, guide=line, repeat=repeat)
    kind = LayerProblem if repeat != "p6" else HexagonalProblem
    along = kind.nominal_of(recipe, recipe.size)
    assert along.max() > 0.9
    assert 0.02 < along.min() < 0.1
    np.testing.assert_allclose(symmetry(repeat, recipe.size).mean(along), along)
    for x, y, _ in recipe.layers[0].sinks:
        assert along[int(y * SIZE), int(x * SIZE)] > 0.15


def test_later_inks_knock_out_those_before():
    plain = made(layers=3, style="cutout", repeat="p2")
    for trap in (0.0, 3.0):
        cut = made(layers=3, style="cutout", repeat="p2", knock_out=True, trap=trap)
        over = [
            np.minimum(*pair).mean() for pair in zip(*(m.coverage()[:2] for m in (plain, cut)), strict=True)
        ]
        both = [(motif.coverage()[0] > 0.9) & (motif.coverage()[1] > 0.9) for motif in (plain, cut)]
        assert over
        assert both[0].mean() > 0.02
        if not trap:
            assert both[1].mean() < 0.1 * both[0].mean()
        else:
            depth = ndimage.distance_transform_edt(cut.coverage()[1] > 0.5)
            assert depth[both[1]].max() < 0.03 * SIZE + 2


@pytest.mark.parametrize("repeat", ["none", "translate", "reflect", "rotate", "brick", "p4m", "pg", "p31m"])
@pytest.mark.parametrize("kind", ["ink", "paper"])
def test_a_sheet_with_a_frame_is_one_piece(repeat, kind):
    motif = made(96, style="seed", repeat=repeat, one_piece=kind, bridge=3.0)
    size = tuple(2 * side for side in motif.densities.shape[1:])
    inked = ts.motif.repeat_densities(motif, (2, 3), size=size, frame=motif.frame)[0] > 0.5
    piece = inked if kind == "ink" else ~inked
    assert ndimage.label(piece)[1] == 1
    assert 0.05 < inked.mean() < 0.95
    width = 0.03 * size[1]
    opened = ndimage.distance_transform_edt(np.pad(piece, 20, constant_values=True)) > width / 2 - 2
    assert ndimage.label(opened)[1] == 1  # nowhere narrower than a bridge, less two px


def test_strips_become_one_piece_in_the_whole_plane():
    """Stripes are connected on the torus' one way round, and not across."""
    mask = np.zeros((40, 40), bool)
    mask[10:20] = True
    piece = one_piece(mask, Raster("translate", (20, 20)), 2.0) <= 0
    assert ndimage.label(np.tile(piece, (3, 3)))[1] == 1
    assert piece[10:20].all()


def test_dots_and_lines_of_a_drawing_become_places():
    page = '<svg xmlns="http://www.w3.org/2000/svg" width="200" height="100" viewBox="0 0 200 100">{}</svg>'
    drawn = page.format('<circle cx="50" cy="50" r="2"/><path d="M100,20 H180" stroke="black"/>')
    places = ts.motif.places_in_drawing(drawn, (100, 200))
    np.testing.assert_allclose(places[0, :2], [0.25, 0.5])
    assert len(places) > 20
    assert places[1:, 0].min() == 0.5
    np.testing.assert_allclose(places[1:, 1], 0.2)
    square = ts.motif.places_in_drawing(drawn, (100, 100))  # in the middle, at the same proportions
    np.testing.assert_allclose(square[0, :2], [0.25, 0.5])
    with pytest.raises(ts.OptionError, match="beyond the drawing's edge"):
        ts.motif.places_in_drawing(page.format('<circle cx="500" cy="50" r="2"/>'))


def test_dark_areas_of_a_picture_become_places():
    picture = np.ones((100, 100))
    picture[20:22, 30:32] = 0
    picture[60:90, 60:90] = 0
    places = ts.motif.places_in_picture(picture)
    assert np.abs(places[:, :2] - [0.31, 0.21]).sum(axis=1).min() < 0.01
    large = places[np.abs(places[:, :2] - 0.75).max(axis=1) < 0.16]
    assert len(large) == len(places) - 1 > 50
    assert places[:, 2].mean() == pytest.approx(1, abs=1e-3)
    with pytest.raises(ts.ImageError, match="shows none"):
        ts.motif.places_in_picture(np.ones((10, 10)))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"place": "inside"}, "there is none"),
        ({"scale": 2, "repeat": "rotate"}, "use 3"),
        ({"scale": 20}, "too many copies"),
        ({"outline": "star"}, "choose one of disc, band, frame"),
        ({"outline": np.ones((9, 9))}, "covers 0.0% of the cell"),
        ({"guide": np.ones((9, 9))}, "shows no line"),
        ({"outline": "disc", "sources": [[0.02, 0.02]]}, "lie beyond the outline"),
        ({"outline": "band", "place": "outside", "repeat": "p4"}, None),
    ],
)
def test_a_composition_that_cannot_be_is_refused(options, words):
    if words is None:
        made(**options)
        return
    with pytest.raises(ts.TopoSeamError, match=words):
        made(**options)


def test_composed_motifs_do_not_join(disc):
    recipes = [
        ts.motif.random_recipe(SIZE, **{**QUICK, "seed": seed}, outline=disc, repeat="p2") for seed in (1, 2)
    ]
    with pytest.raises(ts.OptionError, match="know no outline"):
        ts.motif.join_motifs(recipes)
    everywhere = [(dataclasses.replace(recipe.layers[0], place="everywhere"),) for recipe in recipes]
    plain = [
        dataclasses.replace(recipe, outline="", layers=layers)
        for recipe, layers in zip(recipes, everywhere, strict=True)
    ]
    assert len(ts.motif.join_motifs(plain).motifs) == 2
