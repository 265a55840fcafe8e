"""Every method on planted seams, real crops and every topology."""

from __future__ import annotations

import subprocess
import sys
from itertools import product

import numpy as np
import pytest
from shapes import SHAPES

import toposeam as ts
from toposeam.seam.cut_solver import CutSolver
from toposeam.seam.dynamic_programming import _cheapest_crossings

ROBUST = ("auto", "heat", "shortest-path", "graph-cut")


def planted(height: int = 40, width: int = 24, seed: int = 0):
    """Noise patches that agree only along a path which turns back on itself."""
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, height, width, 3))
    labels = np.zeros((height, width), bool)
    labels[:, 12:] = True
    labels[8:12, 6:12] = True
    labels[20:30, 12:18] = False
    labels[20:24, 15:18] = True  # a pocket that a monotone seam cannot enter
    across, along = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
    near = np.zeros_like(labels)
    near[:, 1:] |= across
    near[:, :-1] |= across
    near[1:] |= along
    near[:-1] |= along
    b[near] = a[near]
    return a, b, labels


@pytest.mark.parametrize("method", ROBUST)
def test_a_planted_seam_that_turns_back_is_recovered(method):
    a, b, labels = planted()
    seam = ts.find_seam(a, b, method=method, gradient=False)
    # Interfaces between two equal pixels cost only the length term, so exactly these are used.
    assert seam.cost < 0.2
    assert seam.optimum_ratio() == pytest.approx(1.0)
    assert (seam.labels != labels).mean() < 0.02


@pytest.mark.parametrize("method", ts.seam.METHODS)
def test_swapping_the_patches_and_sides_mirrors_the_labels(method, crops):
    a, b = crops(np.random.default_rng(6), 40, 16)
    seam = ts.find_seam(a, b, method=method)
    swapped = ts.find_seam(b, a, side="left", method=method)
    assert swapped.cost == pytest.approx(seam.cost, rel=1e-5)
    assert (swapped.labels == ~seam.labels).mean() > 0.98


@pytest.mark.parametrize("method", ts.seam.METHODS)
def test_a_transposed_problem_has_the_transposed_seam(method, crops):
    a, b = crops(np.random.default_rng(7), 40, 16)
    seam = ts.find_seam(a, b, method=method)
    turned = ts.find_seam(a.swapaxes(0, 1), b.swapaxes(0, 1), side="bottom", method=method)
    assert turned.cost == pytest.approx(seam.cost, rel=1e-5)
    assert (seam.labels == turned.labels.T).mean() > 0.98


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("method", ["auto", "heat", "shortest-path"])
def test_every_topology_is_as_good_as_graph_cut(shape, method, crops):
    mask_a, mask_b = SHAPES[shape]()
    a, b = crops(np.random.default_rng(8), *mask_a.shape)
    exact = ts.find_seam(a, b, mask_a, mask_b, method="graph-cut")
    seam = ts.find_seam(a, b, mask_a, mask_b, method=method)
    # 1 % for heat (its stated worst case), and the rounding of capacities for the exact method.
    assert exact.cost * (1 - 1e-6) <= seam.cost <= exact.cost * (1.01 if method == "heat" else 1 + 1e-4)
    assert (seam.labels[mask_b & ~mask_a]).all()
    assert not (seam.labels[mask_a & ~mask_b]).any()


@pytest.mark.parametrize(
    ("shape", "closed"),
    [("ring", [True]), ("two islands", [True, True]), ("four gaps", [False, False]), ("ell", [False])],
)
def test_paths_are_open_or_closed_as_the_topology_asks(shape, closed, crops):
    mask_a, mask_b = SHAPES[shape]()
    a, b = crops(np.random.default_rng(9), *mask_a.shape)
    assert [line.closed for line in ts.find_seam(a, b, mask_a, mask_b).paths] == closed


def test_heat_labels_are_connected_to_their_own_ground(crops):
    from scipy import ndimage

    for seed in range(6):
        a, b = crops(np.random.default_rng(seed), 60, 20)
        seam = ts.find_seam(a, b, method="heat")
        assert seam.termination == ts.optimize.Termination.SINGLE_LINE
        assert len(seam.paths) == 1
        assert ndimage.label(seam.labels)[1] == ndimage.label(~seam.labels)[1] == 1


def test_the_soft_potential_is_between_the_two_sides(crops):
    a, b = crops(np.random.default_rng(10), 50, 20)
    seam = ts.find_seam(a, b, method="heat")
    assert seam.soft.dtype == np.float32
    assert (seam.soft[:, 0] == 0).all()
    assert (seam.soft[:, -1] == 1).all()
    assert ((seam.soft > 0.05) & (seam.soft < 0.95)).mean() > 0.02


def test_the_same_input_gives_the_same_seam(crops):
    a, b = crops(np.random.default_rng(11), 60, 24)
    first, second = ts.find_seam(a, b), ts.find_seam(a, b)
    np.testing.assert_array_equal(first.labels, second.labels)
    assert first.history == second.history or first.cost == second.cost


def test_integer_images_count_as_their_share_of_full_scale(crops):
    a, b = crops(np.random.default_rng(12), 40, 16)
    eight = ts.find_seam(a, b, method="shortest-path")
    sixteen = ts.find_seam(a.astype(np.uint16) * 257, b.astype(np.uint16) * 257, method="shortest-path")
    assert sixteen.cost == pytest.approx(eight.cost, rel=1e-5)


def test_the_history_records_each_iteration(crops):
    a, b = crops(np.random.default_rng(13), 60, 20)
    seam = ts.find_seam(a, b, record_frames=True)
    assert len(seam.frames) == len(seam.history) <= 100
    assert [record.stage for record in seam.history] == sorted(record.stage for record in seam.history)
    assert seam.history[-1].objective == pytest.approx(seam.cost, rel=0.05)
    assert seam.history[-1].unknowns < seam.history[0].unknowns
    assert (
        0
        <= min(frame.right.min() for frame in seam.frames)
        <= max(frame.right.max() for frame in seam.frames)
        <= 1
    )


def test_progress_rises_to_one(crops):
    a, b = crops(np.random.default_rng(14), 40, 16)
    seen: list[float] = []
    seam = ts.find_seam(a, b, method="heat", progress=seen.append)
    assert seen[-1] == 1.0
    assert seen == sorted(seen)
    steps = len(seam.history) - 2  # the last is where it ends, and one more the seam itself
    assert seen[:-1] == [min(0.95, (step + 1) / 10) for step in range(steps)]


def test_dynamic_programming_is_exact_if_the_seam_never_turns(crops):
    a, b = crops(np.random.default_rng(15), 30, 3)
    dp, exact = (ts.find_seam(a, b, method=method) for method in ("dp", "shortest-path"))
    assert dp.cost == pytest.approx(exact.cost)  # one free column: there is nothing to turn back to


def test_dynamic_programming_pays_for_its_steps():
    # Interfaces across cost [1, 9] and [9, 1], the one between the rows in the middle column 5: staying
    # costs 1 + 9, stepping 1 + 5 + 1.
    crossing, stepping = np.array([[1.0, 9], [9, 1]]), np.array([[100.0, 5, 100]])
    assert _cheapest_crossings(crossing, stepping).tolist() == [0, 1]
    stepping[0, 1] = 8.5
    assert _cheapest_crossings(crossing, stepping).tolist() in ([0, 0], [1, 1])
    assert _cheapest_crossings(crossing[:, ::-1], np.array([[100.0, 5, 100]])).tolist() == [1, 0]


@pytest.mark.parametrize("seed", range(5))
def test_dynamic_programming_is_the_best_of_all_monotone_seams(seed):
    rng = np.random.default_rng(seed)
    crossing, stepping = rng.random((4, 4)), rng.random((3, 5))

    def total(cut):
        steps = sum(
            stepping[row, max(cut[row], cut[row + 1])] for row in range(3) if cut[row] != cut[row + 1]
        )
        return crossing[range(4), cut].sum() + steps

    monotone = [cut for cut in product(range(4), repeat=4) if np.abs(np.diff(cut)).max() <= 1]
    assert tuple(_cheapest_crossings(crossing, stepping)) == min(monotone, key=total)


def test_dynamic_programming_refuses_other_shapes_than_strips():
    mask_a, mask_b = SHAPES["ell"]()
    with pytest.raises(ts.OverlapError, match="rectangular"):
        ts.find_seam(np.zeros(mask_a.shape), np.zeros(mask_a.shape), mask_a, mask_b, method="dp")
    holed = np.ones((2, 12, 12), bool)
    holed[0, :, -2:] = holed[1, :, :2] = False
    holed[0, 5:7, 5:7] = False  # here only b shows
    with pytest.raises(ts.OverlapError, match="rectangular"):
        ts.find_seam(np.zeros((12, 12)), np.zeros((12, 12)), *holed, method="dp")


@pytest.mark.parametrize(
    ("a", "b", "error", "text"),
    [
        (np.zeros((4, 5)), np.zeros((4, 6)), ts.ImageError, "one canvas"),
        (np.zeros((0, 5)), np.zeros((0, 5)), ts.ImageError, "non-empty"),
        (np.zeros((4, 5, 3)), np.zeros((4, 5, 4)), ts.ImageError, "channels"),
        (np.full((4, 5), np.nan), np.zeros((4, 5)), ts.ImageError, "NaN"),
        (np.zeros((4, 5)), np.full((4, 5), np.inf), ts.ImageError, "infinite"),
        (np.zeros((4, 5), complex), np.zeros((4, 5), complex), ts.ImageError, "dtype"),
        (np.zeros(5), np.zeros(5), ts.ImageError, "shape"),
        (np.array([["x"] * 3]), np.array([["y"] * 3]), ts.ImageError, "dtype"),
    ],
)
def test_unusable_images_are_refused_in_one_sentence(a, b, error, text):
    with pytest.raises(error, match=text) as caught:
        ts.find_seam(a, b)
    assert "\n" not in str(caught.value)


def test_gray_with_colour_is_widened():
    rng = np.random.default_rng(16)
    gray, colour = rng.random((20, 10)), rng.random((20, 10, 3))
    wide = np.repeat(gray[..., None], 3, axis=2)
    assert ts.find_seam(gray, colour).cost == ts.find_seam(wide, colour).cost


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"method": "magic"}, "choose one of"),
        ({"side": "up"}, "choose one of"),
        ({"max_iterations": 0}, "at least 1"),
        ({"treshold": 0.1}, "its options are"),
        ({"method": "dp", "tolerance": 0.1}, "takes no options"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"weight": np.zeros((20, 10))}, "positive"),
        *(({"weight": np.where(np.eye(20, 10), one, 1)}, "positive") for one in (0, np.inf, np.nan)),
        ({"avoid": np.zeros((3, 3))}, "per pixel"),
        ({"core": 0.0, "mask_a": np.ones((20, 10))}, "core"),
        ({"max_iterations": 2.5}, "whole number"),
        ({"tolerance": "x"}, "tolerance is 'x'"),
        ({"method": ["heat"]}, "choose one of"),
        ({"method": "dp", "options": ts.seam.HeatOptions()}, "takes no options"),
        ({"options": ts.seam.ThesisOptions()}, "takes HeatOptions"),
        ({"options": ts.seam.HeatOptions(), "tolerance": 0.1}, "beside options"),
        ({"gradient": False, "cost": ts.seam.MatchCost()}, "gradient and cost"),
        ({"gradient": "no"}, "gradient"),
        ({"cost": "dear"}, "MatchCost"),
        ({"side": "right", "mask_b": np.ones((20, 10))}, "leave one or the other out"),
        ({"weight": "heavy"}, "weight"),
        ({"record_frames": 3}, "record_frames"),
    ],
)
def test_unusable_options_are_refused_in_one_sentence(options, text):
    a = np.random.default_rng(17).random((20, 10))
    with pytest.raises(ts.TopoSeamError, match=text):
        ts.find_seam(a, 1 - a, **options)


def test_options_may_be_one_value_or_plain_keywords(crops):
    a, b = crops(np.random.default_rng(19), 40, 12)
    rough = ts.find_seam(a, b, options=ts.seam.HeatOptions(tolerance=0.5))
    assert repr(rough.history) == repr(ts.find_seam(a, b, tolerance=0.5).history)
    assert rough.settings["tolerance"] == 0.5
    assert len(rough.history) < len(ts.find_seam(a, b, method="heat").history)


@pytest.mark.parametrize("tolerance", [0.5, 0.1, 1e-2, 1e-3, 1e-6])
def test_heat_stops_once_the_bound_is_within_the_tolerance(tolerance, crops):
    a, b = crops(np.random.default_rng(20), 60, 16)
    seam = ts.find_seam(a, b, tolerance=tolerance)
    exact = ts.find_seam(a, b, method="graph-cut").cost
    assert seam.termination == ts.optimize.Termination.SINGLE_LINE
    flows = np.array([record.compliance for record in seam.history[:-1]])  # no seam costs less than any
    assert seam.cost <= (1 + tolerance) * flows.max() * (1 + 1e-6)
    assert flows.max() <= exact * (1 + 1e-6)
    # With one step less, nothing so good was known.
    if len(flows) > 1:
        shorter = ts.find_seam(a, b, tolerance=tolerance, max_iterations=len(flows) - 1)
        assert shorter.termination == ts.optimize.Termination.ITERATIONS
        assert shorter.cost > (1 + tolerance) * flows[:-1].max() * (1 - 1e-6)


def test_settings_say_how_the_patches_lay(crops):
    a, b = crops(np.random.default_rng(21), 30, 12)
    assert ts.find_seam(a, b).settings["side"] == "right"
    assert "core" not in ts.find_seam(a, b, side="left").settings
    masked = ts.find_seam(a, b, np.arange(12) < np.full((30, 1), 9), np.arange(12) > np.full((30, 1), 2))
    assert masked.settings["core"] == 0.5
    assert masked.settings["speck"] is None
    assert "side" not in masked.settings


def test_masked_arrays_pil_pictures_and_axes_are_distinguished(crops):
    from PIL import Image

    a, b = crops(np.random.default_rng(22), 30, 12)
    plain = ts.find_seam(a, b)
    assert ts.find_seam(Image.fromarray(a), Image.fromarray(b)).cost == plain.cost
    with pytest.raises(ts.ImageError, match="masked array"):
        ts.find_seam(np.ma.masked_array(a), b)
    with pytest.raises(ts.ImageError, match=r"\(C, H, W\)"):
        ts.find_seam(np.zeros((3, 30, 40)), np.zeros((3, 30, 40)))
    with pytest.raises(ts.ImageError, match="data_range"):
        ts.find_seam(a.astype(float), b.astype(float))


@pytest.mark.medium  # a process of its own
def test_an_engine_is_loaded_when_its_method_is_named():
    code = (
        "import sys, numpy as np, toposeam as ts\n"
        "a, b = np.random.default_rng(0).random((2, 12, 6))\n"
        "def loaded(): return [name for name in sys.modules if name.startswith('toposeam.seam.')]\n"
        "ts.find_seam(a, b)\n"
        "others = ('thesis', 'heat', 'keywords', 'dynamic', 'graph_cut', 'maximum', 'drawing', 'apply')\n"
        "print([name for name in loaded() if any(word in name for word in others)])\n"
        "print('toposeam.vector.svg' in sys.modules, 'toposeam.optimize.mma' in sys.modules)\n"
        "ts.find_seam(a, b, method='thesis')\n"
        "print('toposeam.seam.thesis.method' in loaded(), 'toposeam.seam.heat.method' in loaded())"
    )
    ended = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert ended.stdout.split("\n") == ["[]", "False False", "True False", ""]


def test_identical_patches_take_the_shortest_way():
    a = np.random.default_rng(18).random((30, 12))
    seam = ts.find_seam(a, a)
    assert seam.paths[0].length == 30
    assert seam.optimum_ratio() == pytest.approx(1.0)


def test_network_cuts_take_options_of_methods_that_cut_them():
    given = {"tolerance": 0.25, "max_iterations": 7}
    for method in ("heat", "auto"):
        options = CutSolver.of(method, given).options
        assert (options.tolerance, options.max_iterations) == (0.25, 7)
    # Others leave networks to `auto`, whose heat knows none of their options.
    other = CutSolver.of("thesis", {"q_threshold": 0.5})
    assert (other.method, other.options) == ("auto", ts.seam.HeatOptions())
    assert CutSolver.of("graph-cut", {}).options is None
