"""The `Seam` as a value: what it says, shows and writes."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from PIL import Image

import toposeam as ts


@pytest.fixture
def seam():
    return ts.find_seam(*np.random.default_rng(30).random((2, 60, 20)), method="heat", gradient=False)


def test_its_repr_is_one_line_of_what_matters(seam):
    text = repr(seam)
    assert "\n" not in text
    assert len(text) < 120
    assert text.startswith("Seam(heat, canvas 20 × 60 px, cost ")


def test_its_summary_is_plain_numbers(seam):
    said = json.loads(json.dumps(seam.summary()))
    assert said["method"] == "heat"
    assert said["cost"] == seam.cost
    assert said["ratio"] == seam.optimum_ratio()
    assert said["optimum"] == pytest.approx(seam.cost / said["ratio"])
    assert said["iterations"] == len(seam.history)
    assert said["stages"] == 2
    assert said["paths"] == 1
    assert said["termination"] == "single line"
    assert said["length_px"] == round(seam.paths[0].length) == round(seam.length)
    direct = ts.find_seam(np.zeros((4, 5)), np.ones((4, 5)), method="dp").summary()
    assert (direct["stages"], direct["iterations"]) == (0, 0)


def test_a_notebook_shows_the_line_over_the_two_sides(seam):
    shown = np.asarray(Image.open(io.BytesIO(seam._repr_png_())).convert("RGB"))
    assert shown.shape == (60, 20, 3)
    assert (shown[:, 0] < 60).all()  # a is dark
    assert (shown[:, -1] > 200).all()  # b is light
    red = (shown[..., 0] > 200) & (shown[..., 1] < 60)
    assert red.any(axis=1).all()  # the line crosses every row


def test_its_settings_reproduce_it(crops):
    a, b = crops(np.random.default_rng(31), 50, 14)
    first = ts.find_seam(a, b, side="left", tolerance=1e-4, cost=ts.seam.MatchCost(length=0.01))
    options = {**first.settings, "method": first.method}
    fields = ("law", "epsilon", "flat", "length", "reach")
    cost = ts.seam.MatchCost(**{name: options.pop(name) for name in fields})
    np.testing.assert_array_equal(ts.find_seam(a, b, cost=cost, **options).labels, first.labels)


@pytest.mark.medium
def test_simplified_lines_stay_within_tolerance_and_apply_alike(seam):
    (exact,), (bent,) = seam.paths, seam.simplified()
    assert len(bent.points) < 0.7 * len(exact.points)
    drawing = ts.vector.SvgSeam((bent,), 20, 60, None, ("seam 1",))
    applied = ts.seam.apply_paths(drawing, *np.random.default_rng(30).random((2, 60, 20)), gradient=False)
    assert (applied.labels != seam.labels).mean() < 0.02
    np.testing.assert_array_equal(bent.points[[0, -1]], exact.points[[0, -1]])
    with pytest.raises(ts.OptionError, match="tolerance"):
        seam.simplified(-1)


def test_paths_given_as_polylines_divide_the_patches():
    a, b = np.zeros((2, 6, 8))
    drawing = ts.vector.SvgSeam((ts.vector.Polyline([[3, 0], [3, 6]]),), 8, 6, None, ("seam 1",))
    seam = ts.seam.apply_paths(drawing, a, b)
    np.testing.assert_array_equal(seam.labels, np.tile(np.arange(8) >= 3, (6, 1)))
    assert (seam.method, seam.termination) == ("path", ts.optimize.Termination.GIVEN)
    with pytest.raises(ts.OptionError, match="read_svg"):
        ts.seam.apply_paths("seam.svg", a, b)
    with pytest.raises(ts.OptionError, match="gradient and cost"):
        ts.seam.apply_paths(drawing, a, b, gradient=True, cost=ts.seam.MatchCost())
    with pytest.raises(ts.PathError, match="canvas"):
        ts.seam.apply_paths(ts.vector.SvgSeam(drawing.polylines, 9, 6, None, ("seam 1",)), a, b)


def test_drawn_seams_are_red_on_white_and_keep_other_pixels(seam):
    picture = np.full((60, 20, 3), 90, np.uint8)
    drawn = ts.seam.draw_seams(picture, [seam])
    assert drawn.dtype == np.uint8
    assert (drawn[:, 0] == 90).all()
    colours = {tuple(pixel) for pixel in drawn.reshape(-1, 3)}
    assert {(230, 30, 40), (255, 255, 255), (90, 90, 90)} <= colours
    assert ts.seam.draw_seams(picture[..., 0], []).shape == (60, 20, 3)
    assert (picture == 90).all()
    for kind in (np.uint16, np.float64):
        scaled = (picture[..., 0] / 255 * (65535 if kind is np.uint16 else 1)).astype(kind)
        assert np.abs(ts.seam.draw_seams(scaled, [])[..., 0].astype(int) - 90).max() <= 1
