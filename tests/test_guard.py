"""The guard of quality: it notices what is worse, and its own figures are those of the results."""

import math
from pathlib import Path

import numpy as np
import pytest

import toposeam as ts

HERE = Path(__file__).parents[1]


@pytest.fixture
def guard(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE / "benchmarks"))
    return pytest.importorskip("guard")


@pytest.fixture
def cases(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE / "benchmarks"))
    return pytest.importorskip("guard_cases")


def told(*costs, time=1.0):
    return {"seams": {f"case {number}": {"cost": cost, "time": time} for number, cost in enumerate(costs)}}


def row(guard, measured, known):
    (found,) = guard.compared(measured, known)
    return found


def test_equal_costs_pass(guard):
    found = row(guard, told(3.0, 0.0), told(3.0, 0.0))
    assert found.passes
    assert found.cells[:6] == ["seams", "cost", "2", "2", "1.0000", "1.0000"]


@pytest.mark.parametrize(
    ("measured", "passes"),
    [
        (told(*[100.4] * 40), True),
        (told(*[100.6] * 40), False),  # in the mean
        (told(104, *[100] * 39), True),
        (told(106, *[100] * 39), False),  # at worst
        (told(*[90] * 40), True),
        (told(*[100] * 40, time=1.09), True),
        (told(*[100] * 40, time=1.11), False),
        (told(math.inf, *[100] * 39), False),
    ],
)
def test_what_is_worse_or_slower_fails(guard, measured, passes):
    assert row(guard, measured, told(*[100] * 40)).passes == passes


def test_what_is_not_known_or_breaks_fails_and_is_listed(guard):
    unknown = row(guard, told(1.0, 2.0), told(1.0))
    assert not unknown.passes
    assert "1 of 2 cases have no cost" in guard.report([unknown], told(1.0, 2.0), "best known")
    broken = told(1.0)
    broken["seams"]["case 1"] = {"error": "SolverError: singular"}
    found = row(guard, broken, told(1.0, 2.0))
    assert not found.passes
    assert "- seams, case 1: SolverError: singular" in guard.report([found], broken, "best known")


def test_suspiciously_cheap_results_are_listed(guard):
    measured = told(80.0, 100.0)
    text = guard.report([row(guard, measured, told(100.0, 100.0))], measured, "main")
    assert "case 0: cost ÷ main is 0.8000; does it solve the same problem?" in text


def test_only_better_figures_are_kept_unless_they_are_reset(guard):
    best = guard.kept(told(90.0, 110.0, time=2.0), told(100.0, 100.0), reset=False)
    assert best == told(90.0, 100.0, time=2.0)
    assert guard.kept(told(90.0, 110.0, time=2.0), best, reset=True) == told(90.0, 110.0, time=2.0)


def test_every_case_has_a_name_of_its_own_and_a_record(guard, cases):
    counts = {"seams": 200, "volumes": 40, "motifs": 20}
    for room, count in counts.items():
        names = [case.name for case in cases.ROOMS[room]()]
        assert len(names) == len(set(names)) == count
        assert set(names) <= set(guard.read()[room])


@pytest.mark.parametrize("index", [0, 1, 120, 141, 161, 181])
def test_the_guards_own_cost_is_the_seams(cases, index):
    run, judge = list(cases.seams())[index].prepare()
    seam = run()
    assert judge(seam)["cost"] == pytest.approx(seam.cost, rel=1e-5)


def test_the_guards_own_cost_is_the_piles_and_the_surfaces(cases):
    scene = np.random.default_rng(0).integers(0, 256, (60, 80, 3), np.uint8)
    layers = [
        ts.Layer(np.clip(scene[y : y + 40, x : x + 50] * gain, 0, 255).astype(np.uint8), at=(x, y))
        for x, y, gain in ((0, 0, 1.0), (20, 8, 0.8), (10, 20, 0.9))
    ]
    stitched = ts.stitch(layers, cost=cases.match_cost("gradient"))
    assert cases.pile_cost(layers, stitched) == pytest.approx(stitched.cost, rel=1e-5)
    a, b = np.random.default_rng(1).random((2, 8, 12, 14))
    for law in ("gradient", "colour"):
        surface = ts.find_surface(a, b, axis=0, cost=cases.match_cost(law))
        assert cases.seam_cost(a, b, surface.labels, law=law) == pytest.approx(surface.cost, rel=1e-5)


def test_labels_showing_missing_pixels_cost_infinity(cases):
    a, b = np.random.default_rng(0).random((2, 6, 8))
    on_b = np.ones((6, 8), bool)
    on_b[0, 0] = False
    labels = np.ones((6, 8), bool)
    assert cases.seam_cost(a, b, labels, None, on_b, law="gradient") == math.inf
    assert cases.seam_cost(a, b, on_b, None, on_b, law="gradient") < math.inf


def test_excess_counts_steps_between_copies_only(cases):
    sample = np.random.default_rng(0).integers(0, 256, (10, 12), np.uint8)
    source = np.stack(np.indices((10, 12)), axis=-1)
    usable = np.ones((10, 12), bool)
    assert cases.excess(sample, sample, usable, source) == 0
    moved = np.concatenate([source[:, :6], source[:, :6]], axis=1)
    assert cases.excess(sample[moved[..., 0], moved[..., 1]], sample, usable, moved) > 1


@pytest.mark.slow
def test_a_checkout_is_as_good_as_itself(guard, monkeypatch, capsys):
    monkeypatch.setattr(guard, "QUICK", 67)
    monkeypatch.setattr(guard, "TIME", math.inf)
    assert guard.main(["--quick", "--only", "seams", "--against", str(HERE)]) == 0
    assert "| seams | cost | 3 | 3 | 1.0000 | 1.0000 |" in capsys.readouterr().out


def test_a_folder_that_is_no_checkout_is_refused(guard, tmp_path, capsys):
    with pytest.raises(SystemExit):
        guard.main(["--against", str(tmp_path)])
    assert "give the folder of a checkout" in capsys.readouterr().err
