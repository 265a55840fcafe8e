"""The contract of motifs: recipes, bytes, colours, repeats."""

from __future__ import annotations

import json

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.optimise.spot_layout import _random_places
from toposeam.motif.symmetry import HEXAGONAL

QUICK = {"size": 48, "layers": 2, "iterations": 6}


def _quick(**options):
    values = {**QUICK, **options}
    return ts.generate_motif(values.pop("size"), **values)


def test_a_recipe_makes_the_same_bytes_again():
    motif = _quick(repeat="translate", seed=3)
    again = ts.generate_motif(ts.motif.Recipe.from_dict(json.loads(json.dumps(motif.recipe.to_dict()))))
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
    plain, heavier = ts.motif.random_recipe(64, seed=5), ts.motif.random_recipe(64, seed=5, mass=0.5)
    assert [layer.sources for layer in plain.layers] == [layer.sources for layer in heavier.layers]
    assert [layer.sinks for layer in plain.layers] == [layer.sinks for layer in heavier.layers]
    assert plain.paper == heavier.paper


@pytest.mark.parametrize("repeat", [r for r in ts.motif.REPEATS if r != "none"])
def test_patterns_of_every_rule_have_its_size(repeat):
    motif = _quick(size=24, layers=1, repeat=repeat, iterations=3)
    rows = 42 if repeat in HEXAGONAL else 24
    assert ts.motif.repeat_densities(motif, (2, 3)).shape == (1, 2 * rows, 72)
    assert ts.repeat(motif, (2, 3), size=(30, 30)).shape == (60, 90, 3)


def test_subtractive_mixing_is_a_product_over_paper():
    motif = _quick(layers=2, edge="soft")
    one, two = motif.densities[..., np.newaxis]
    expected = motif.paper * (1 - one * (1 - motif.inks[0])) * (1 - two * (1 - motif.inks[1]))
    assert motif.image() == pytest.approx(expected, abs=1e-5)


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["none", "reflect", "translate", "rotate", "p4g", "p6m"])
def test_any_size_is_the_same_picture(repeat):
    motif = ts.generate_motif(48, layers=1, repeat=repeat, seed=3)
    rows, columns = motif.densities.shape[1:]
    large = motif.resampled((4 * rows, 4 * columns))[0]
    # The mean over what a pixel became is that pixel, but for a cubic's overshoot, clipped to [0, 1].
    means = large.reshape(rows, 4, columns, 4).mean(axis=(1, 3))
    # The rectangle of a hexagonal group is itself a sample of its lattice, not a mean.
    assert np.abs(means - motif.densities[0]).mean() < (0.03 if motif.lattice is None else 0.05)
    assert large.mean() == pytest.approx(motif.densities[0].mean(), abs=0.01)
    # Smooth, not pixelated: neighbours differ by far less than pixels did.
    assert np.abs(np.diff(large, axis=1)).max() < 0.55 * np.abs(np.diff(motif.densities[0], axis=1)).max()
    small = motif.resampled((rows // 2, columns // 2))[0]
    assert small.mean() == pytest.approx(motif.densities[0].mean(), abs=0.02)


def test_progress_counts_every_iteration():
    seen = []
    _quick(progress=seen.append)
    assert seen == [i / 12 for i in range(1, 13)]


def test_seeds_count_from_0():
    recipe = ts.generate_motif(16, layers=1, iterations=2).recipe
    assert recipe == ts.generate_motif(16, layers=1, iterations=2, seed=0).recipe
    assert recipe.seed == ts.motif.random_recipe(16).seed == 0


def test_a_generator_seeds_a_motif_that_can_be_made_again():
    recipe = ts.motif.random_recipe(48, seed=np.random.default_rng(4))
    assert ts.motif.random_recipe(48, seed=recipe.seed) == recipe
    assert ts.motif.random_recipe(48, seed=None) != ts.motif.random_recipe(48, seed=None)


def test_motifs_show_themselves(tmp_path):
    motif = _quick(repeat="pm", seed=3)
    assert repr(motif) == "Motif(2 inks on 48 × 48 elements, repeat='pm', seed=3)"
    assert motif._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    document = motif.to_svg(tmp_path / "m.svg", counts=(2, 3))
    assert (tmp_path / "m.svg").read_text() == document == ts.motif.draw_svg(motif, (2, 3))
    assert 'viewBox="0 0 144 96"' in document


def test_variation_moves_ambient_heat_into_its_range():
    recipe = ts.motif.random_recipe(48, seed=1, ambient=1.0)
    moved = [layer.ambient for layer in ts.motif.vary(recipe, amount=0.5, seed=2).layers]
    assert all(0.5 * 1.0 + 0.5 * 0.47 <= value <= 0.5 * 1.0 + 0.5 * 0.97 for value in moved)
    assert len(set(moved)) == len(moved)
    none = ts.motif.random_recipe(48, seed=1, ambient=0.0)
    assert [layer.ambient for layer in ts.motif.vary(none, amount=0.5, seed=2).layers] == [0.0] * 3


def test_far_relatives_are_of_other_styles_and_rules():
    recipe = ts.motif.random_recipe(48, seed=1, palette="sea")
    near, far = (
        [ts.motif.vary(recipe, amount=amount, seed=seed) for seed in range(12)] for amount in (0.5, 1.0)
    )
    assert {(one.repeat, one.layers[0].style) for one in near} == {("none", "vein")}
    assert min(len({one.repeat for one in far}), len({one.layers[0].style for one in far})) > 4
    assert {one.layers[2].ink for one in far} == {recipe.layers[2].ink}


def test_named_palettes_and_those_of_pictures():
    for name in ts.motif.PALETTES:
        palette = ts.motif.palette(name, 3)
        assert palette.inks.shape == (3, 3)
        assert palette.paper.mean() > 0.85
    picture = np.zeros((20, 40, 3), np.uint8)
    picture[:, :20], picture[:, 20:32], picture[:, 32:] = (250, 250, 250), (200, 30, 30), (20, 60, 160)
    palette = ts.motif.palette(picture, 2)
    assert palette.paper * 255 == pytest.approx(np.full(3, 250.0))
    assert (palette.paper * palette.inks) * 255 == pytest.approx(
        np.array([[200.0, 30, 30], [20, 60, 160]]), abs=1
    )


@pytest.mark.parametrize(
    ("options", "kind", "parameter", "value"),
    [
        ({"palette": "{mauve}"}, "choice", "palette", "{mauve}"),
        ({"layers": 3, "palette": "one ink"}, "count", "palette", "one ink"),
        ({"sources": "{many}"}, "type", "sources", "{many}"),
        ({"sources": [(0.5, 2.0)]}, "number", "sources", (0.5, 2.0, 1.0)),
        ({"sinks": [(0.5, 0.5, 0)]}, "no sink", "sinks", ((0.5, 0.5, 0.0),)),
        ({"{colour}": "red"}, "unknown", "{colour}", None),
    ],
)
def test_what_makes_no_motif_is_told_as_data(options, kind, parameter, value, monkeypatch):
    monkeypatch.setitem(ts.motif.PALETTES, "one ink", ("#ffffff", "#000000"))
    with pytest.raises(ts.OptionError) as raised:
        ts.generate_motif(16, **options)
    assert (raised.value.kind, raised.value.parameter, raised.value.value) == (kind, parameter, value)


@pytest.mark.parametrize("name", ts.motif.PALETTES)
def test_palettes_have_inks_for_as_many_layers_as_there_are(name):
    six, all_of_them = ts.motif.palette(name, 6).inks, ts.motif.palette(name, 16).inks
    np.testing.assert_array_equal(all_of_them[:6], six)  # further ones change nothing of these
    apart = np.linalg.norm(all_of_them[:, np.newaxis] - all_of_them, axis=2) + np.eye(16)
    assert apart.min() > 0.03
    assert len(ts.motif.random_recipe(16, layers=16, seed=5).layers) == 16
    with pytest.raises(ts.OptionError, match="21 inks with their mixtures, 22"):
        ts.motif.palette(name, 22)


SPOT = [(0.5, 0.5)]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"sources": 0, "ambient": 0.0}, "source"),
        ({"sources": [], "ambient": 0.0}, "source"),
        ({"sources": [(0.5, 0.5, 0.0)], "ambient": 0.0}, "no heat source"),
        ({"sinks": 0}, "sinks"),
        ({"sinks": [(0.5, 0.5, 0.0)]}, "no heat sink"),
        ({"sources": SPOT, "sinks": SPOT, "ambient": 0.0}, "one point"),
        ({"sources": [(0.5, 2.0)]}, "0 to 1"),
        ({"sources": [(0.5,)]}, "list"),
        ({"sources": "many"}, "sources"),
        ({"mass": 0}, "mass"),
        ({"mass": 1}, "mass"),
        ({"mass": [0.2, 0.3, 0.4]}, "layers"),
        ({"penalty": 0.5}, "penalty"),
        ({"iterations": 0}, "iterations"),
        ({"move": 0}, "move"),
        ({"filter_radius": -1}, "filter_radius"),
        ({"layers": 0}, "layers"),
        ({"edge": "hard"}, "edge"),
        ({"edge": ["soft"]}, "has 2"),
        ({"layers": 22, "palette": "sumi"}, "inks"),
        ({"palette": "mauve"}, "palette"),
        ({"palette": np.zeros((4, 4, 3))}, "colours"),
        ({"repeat": "p7"}, "repeat"),
        ({"repeat": "p4", "size": (40, 48)}, "square"),
        ({"repeat": "p6", "size": (40, 48)}, "square"),
        ({"repeat": "rotate", "size": 47}, "even"),
        ({"repeat": "pg", "size": (47, 48)}, "even"),
        ({"size": 4}, "size"),
        ({"size": 0}, "size"),
        ({"size": True}, "size"),
        ({"seed": "x"}, "seed"),
        ({"iterations": 2.5}, "iterations"),
        ({"mass": np.nan}, "mass"),
        ({"ambient": np.inf}, "ambient"),
        ({"size": (48, 48, 3)}, "size"),
        ({"size": "large"}, "size"),
        ({"size": 100_000}, "size"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"strengths": (0, 1)}, "strengths"),
        ({"strengths": 3}, "strengths"),
        ({"distance": 0}, "distance"),
        ({"ambient": 2}, "ambient"),
        ({"base": np.full((4, 4), np.nan)}, "base image"),
        ({"base": np.zeros(4)}, "base image"),
        ({"base": np.zeros((4, 4)), "base_strength": 3}, "base_strength"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_bad_options_are_refused_in_one_sentence(options, text):
    with pytest.raises(ts.TopoSeamError, match=text) as caught:
        _quick(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        {"size": None},
        {"layers": []},
        {"layers": [{"ink": "red"}]},
        {"layers": 3},
        {"colour": 1},
        {"base": "3x3:junk"},
        {"base": "\x00"},
        {"paper": [2, 0, 0]},
        {"move": "far"},
        {"iterations": "many"},
        {"iterations": float("inf")},
        {"size": [float("inf"), 48]},
        {"move": float("nan")},
        {"base_strength": float("nan")},
        {"seed": float("nan")},
        {"coarse": "yes"},
    ],
)
def test_damaged_recipes_are_refused_in_one_sentence(change):
    record = ts.motif.random_recipe(48).to_dict()
    record.update(change)
    with pytest.raises(ts.TopoSeamError) as caught:
        ts.motif.Recipe.from_dict(record)
    assert "\n" not in str(caught.value)


def test_arrangements_of_nothing_are_refused():
    motif = _quick()
    for counts in ((0, 1), (10_000, 10_000)):
        with pytest.raises(ts.OptionError):
            ts.repeat(motif, counts)
    with pytest.raises(ts.OptionError):
        motif.image((0, 5))
    with pytest.raises(ts.OptionError, match="recipe"):
        ts.generate_motif(motif.recipe, layers=2)


@pytest.mark.parametrize("axis", [0, 1])
def test_places_keep_out_of_what_a_base_image_blocks(axis):
    shown = np.ones((6, 10))
    (shown if axis else shown.T)[:2] = 0  # the upper third, or the left fifth
    places = _random_places(12, np.random.default_rng(0), 1.0, shown)
    assert (places[:, axis] >= (2 / 6 if axis else 2 / 10)).all()


def test_random_layers_are_strokes_or_washes():
    drawn = [layer.penalty for seed in range(40) for layer in ts.motif.random_recipe(16, seed=seed).layers]
    washes = [value for value in drawn if value != 3.0]
    assert all(1.0 <= value <= 1.3 for value in washes)
    assert 5 <= len(washes) <= 40  # 15 % of 120


def test_opaque_inks_cover_what_lies_below():
    motif = _quick(layers=2, edge="soft", paper="#101820", inking="opaque")
    one, two = motif.densities[..., np.newaxis]
    expected = motif.paper * (1 - one) + one * motif.inks[0]
    expected = expected * (1 - two) + two * motif.inks[1]
    assert motif.image() == pytest.approx(expected, abs=1e-5)
    assert motif.paper == pytest.approx(np.array([0x10, 0x18, 0x20]) / 255)
    assert ts.motif.Recipe.from_dict(motif.recipe.to_dict()) == motif.recipe
    assert "mix-blend-mode:normal" in motif.to_svg()


def test_a_colourway_is_the_motif_of_another_palette():
    motif = _quick(layers=2, palette="sea")
    other = motif.recoloured(ts.motif.palette("plum", 2))
    np.testing.assert_array_equal(other.image(), _quick(layers=2, palette="plum").image())
    assert other.recipe == _quick(layers=2, palette="plum").recipe
    with pytest.raises(ts.OptionError, match="1 inks for 2 layers"):
        motif.recoloured(ts.motif.palette("plum", 1))
