"""Generate Motif and Repeat Motif in a real GIMP."""

import numpy as np
import pytest
from inside import refused, succeeded
from pictures import photograph, write_png
from running import needs_gimp

import toposeam as ts

needs_gimp()

MOTIF, REPEAT = "plug-in-toposeam-motif", "plug-in-toposeam-repeat"
SMALL = {"style": "vein", "repeat": "translate", "penalty": 3.0, "size": 48, "iterations": 6}


@pytest.fixture
def generate(gimp):
    made = []

    def call(options, loaded=None):
        result = succeeded(
            gimp.run(
                procedure=MOTIF,
                image=loaded and loaded["image"],
                layers=loaded["layers"] if loaded else [],
                options=options,
            )
        )
        number = gimp.python(code="answer = item(number).get_image().get_id()", number=result["layer"])
        made.append(number)
        return number, result["layer"]

    yield call
    for number in made:
        gimp.delete(image=number)


def test_a_motif_looks_as_core_makes_it_without_any_image_open(gimp, generate):
    number, _ = generate({**SMALL, "repeat": "rotate", "palette": "sea", "seed": 11, "layers": 2})
    children = gimp.tree(image=number)["layers"][0]["children"]
    assert [child["name"] for child in children] == ["Ink 2", "Ink 1", "Paper"]
    shown = gimp.projection(number, "R'G'B'A u8")[..., :3]
    expected = ts.generate_motif(
        48, iterations=6, repeat="rotate", palette="sea", seed=11, layers=2, penalty=3.0
    ).image()
    assert np.abs(shown / 255 - expected).max() <= 1.5 / 255


def test_a_layer_shapes_the_strokes(gimp, image, generate, tmp_path):
    base = np.zeros((64, 64, 3), np.uint8)
    base[16:48, 16:48] = 255
    write_png(tmp_path / "logo.png", base)
    number, _ = generate(
        {**SMALL, "iterations": 20, "layers": 1, "use-layer": True, "base-strength": 0.9},
        image([tmp_path / "logo.png"]),
    )
    plain, _ = generate({**SMALL, "iterations": 20, "layers": 1})
    inked = []
    for one in (number, plain):
        mask = gimp.python(
            code="answer = item(number).get_mask().get_id()",
            number=gimp.tree(image=one)["layers"][0]["children"][0]["id"],
        )
        density = gimp.pixels(mask, "Y float")[0][..., 0]
        inked.append(density[12:36, 12:36].mean() / density.mean())
    assert inked[0] > 1.2 * inked[1]  # ink keeps to the bright parts


def test_a_repeated_motif_uses_the_layers_current_colours(gimp, generate):
    number, group = generate({**SMALL, "repeat": "reflect", "layers": 2, "seed": 1})
    code = """
layer = item(number)
Gimp.context_set_foreground(Gegl.Color.new("#204080"))
layer.fill(Gimp.FillType.FOREGROUND)
"""
    gimp.python(code=code, number=gimp.tree(image=number)["layers"][0]["children"][0]["id"])
    cell = gimp.projection(number, "R'G'B'A u8")
    result = succeeded(
        gimp.run(procedure=REPEAT, image=number, layers=[group], options={"rows": 2, "columns": 3})
    )
    pattern = gimp.python(code="answer = item(number).get_image().get_id()", number=result["layer"])
    shown = gimp.projection(pattern, "R'G'B'A u8")
    row = np.concatenate([cell, cell[:, ::-1], cell], axis=1)
    np.testing.assert_array_equal(shown, np.concatenate([row, row[::-1]]))
    gimp.delete(image=pattern)


def test_a_pattern_by_another_rule_in_the_colours_of_a_palette(gimp, generate):
    number, group = generate({**SMALL, "repeat": "translate", "layers": 2, "seed": 1, "palette": "sea"})
    options = {"rows": 1, "columns": 2, "repeat": "reflect", "palette": "plum"}
    result = succeeded(gimp.run(procedure=REPEAT, image=number, layers=[group], options=options))
    pattern = gimp.python(code="answer = item(number).get_image().get_id()", number=result["layer"])
    shown = gimp.projection(pattern, "R'G'B'A u8")[..., :3]
    np.testing.assert_array_equal(shown, shown[:, ::-1])
    motif = ts.generate_motif(
        48, iterations=6, layers=2, seed=1, palette="plum", penalty=3.0, repeat="translate"
    )
    expected = motif.image()
    assert np.abs(shown[:, :48] / 255 - expected).max() <= 2 / 255
    gimp.delete(image=pattern)


def test_strokes_end_as_they_are_told_to(gimp, generate):
    shares = []
    for edge in ("soft", "crisp"):
        number, _ = generate({**SMALL, "layers": 1, "edge": edge, "penalty": 1.5})
        mask = gimp.python(
            code="answer = item(number).get_mask().get_id()",
            number=gimp.tree(image=number)["layers"][0]["children"][0]["id"],
        )
        density = gimp.pixels(mask, "Y float")[0][..., 0]
        shares.append(((density > 0.1) & (density < 0.9)).mean())
    assert shares[1] < 0.7 * shares[0]


def test_a_rule_that_needs_an_even_cell(gimp, image, tmp_path):
    write_png(tmp_path / "any.png", photograph(20, 20))
    refused(gimp, image([tmp_path / "any.png"]), "even", MOTIF, {**SMALL, "size": 49, "repeat": "rotate"})


def test_repeating_what_is_no_motif(gimp, image, tmp_path):
    write_png(tmp_path / "any.png", photograph(20, 20))
    refused(gimp, image([tmp_path / "any.png"]), "make one with Generate Motif", REPEAT)


def test_shaping_after_a_layer_that_is_not_there(gimp):
    result = gimp.run(procedure=MOTIF, image=None, layers=[], options={**SMALL, "use-layer": True})
    assert result["status"] == "execution-error"
    assert "open the picture first" in result["message"]
