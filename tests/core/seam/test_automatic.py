"""Method auto: which engine it takes, and that its seam is the best one."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import SHAPES

import toposeam as ts
from toposeam.seam import automatic

PATHS = (None, "ell")
FLOWS = ("ring", "four gaps", "two islands")


def posed(shape, crops):
    masks = SHAPES[shape]() if shape else (None, None)
    size = masks[0].shape if shape else (60, 20)
    return *crops(np.random.default_rng(40), *size), *masks


@pytest.mark.parametrize("shape", [*PATHS, *FLOWS])
def test_the_seam_names_its_engine_and_is_optimal(shape, crops):
    given = posed(shape, crops)
    seam, best = ts.find_seam(*given), ts.find_seam(*given, method="graph-cut")
    assert seam.method == ("shortest-path" if shape in PATHS else "graph-cut")
    assert seam.cost == pytest.approx(best.cost, rel=1e-5)
    assert seam.bound == pytest.approx(seam.problem.total(seam.problem.overlap.window(seam.labels)), rel=1e-6)
    assert seam.summary()["method"] == seam.method
    assert not seam.history


@pytest.mark.parametrize(("shape", "engine"), [("ring", "heat"), (None, "shortest-path")])
def test_heat_replaces_a_flow_above_its_pixel_limit(shape, engine, crops, monkeypatch):
    monkeypatch.setattr(automatic, "FLOW_PIXELS", 100)
    seam = ts.find_seam(*posed(shape, crops))
    assert seam.method == engine
    assert bool(seam.history) == (engine == "heat")


def test_a_path_among_many_corners_is_nearly_the_best(crops, monkeypatch):
    given = crops(np.random.default_rng(41), 240, 120)
    best = ts.find_seam(*given)
    monkeypatch.setattr(automatic, "PATH_CORNERS", 2000)
    seam = ts.find_seam(*given)
    assert seam.method == "shortest-path"
    assert best.cost <= seam.cost <= 1.02 * best.cost
    assert seam.bound == 0 < best.bound


@pytest.mark.parametrize(
    "options", [{"tolerance": 0.01}, {"options": ts.seam.HeatOptions()}, {"record_frames": True}]
)
def test_what_only_heat_gives_chooses_heat(options, crops):
    seam = ts.find_seam(*posed(None, crops), **options)
    assert seam.method == "heat"
    assert seam.history
    assert "tolerance" in seam.settings


def test_options_of_the_thesis_do_not_choose_it(crops):
    with pytest.raises(ts.OptionError, match="takes HeatOptions"):
        ts.find_seam(*posed(None, crops), options=ts.seam.ThesisOptions())


@pytest.mark.parametrize("shape", [None, "ring"])
def test_soft_labels_are_heated_when_they_are_read(shape, crops):
    given = posed(shape, crops)
    seam, heat = ts.find_seam(*given), ts.find_seam(*given, method="heat")
    np.testing.assert_allclose(seam.soft, heat.soft, atol=1e-6)
    assert ((seam.soft > 0.05) & (seam.soft < 0.95)).any()


def test_heat_heats_whatever_the_shape(crops):
    for shape in (*PATHS, *FLOWS):
        seam = ts.find_seam(*posed(shape, crops), method="heat")
        assert seam.method == "heat"
        assert seam.history[0].unknowns > 0
        assert len(seam.history) > 2


def test_its_law_is_that_of_the_other_methods(crops):
    given = posed(None, crops)
    laws = {method: ts.find_seam(*given, method=method).settings["law"] for method in ts.seam.METHODS}
    assert laws.pop("thesis") == "gradient"
    assert set(laws.values()) == {"natural"}
