"""Method thesis: the worked example, Algorithm 2 on real crops, every topology, and what happens when it does
not get there.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from shapes import SHAPES

from toposeam.errors import OptionError, SolverError
from toposeam.optimize.history import Termination
from toposeam.seam.exact import exact_labels
from toposeam.seam.problem import M_MAX, A, B, MatchCost, SeamProblem, between_masks, side_by_side
from toposeam.seam.problem.match_cost import match_cost
from toposeam.seam.thesis import ThesisOptions, thesis_path
from toposeam.seam.thesis import method as thesis
from toposeam.seam.thesis.ground_structure import CornerNetwork

SIZES = ((60, 15), (80, 20), (120, 30), (160, 40), (240, 60), (320, 80))


def problem_of(a, b, overlap):
    a, b = (overlap.window(np.atleast_3d(image)).astype(np.float32) / np.float32(255) for image in (a, b))
    on_a, on_b = overlap.shared | (overlap.side == A), overlap.shared | (overlap.side == B)
    return SeamProblem(overlap, *match_cost(a, b, overlap, on_a, on_b, MatchCost(law="gradient")))


def strip_problem(crops, seed, height, width, side="right"):
    a, b = crops(np.random.default_rng(seed), height, width)
    return problem_of(a, b, side_by_side((height, width), side))


def shape_problem(name, seed=0):
    overlap = between_masks(*SHAPES[name]())
    a, b = np.random.default_rng(seed).integers(0, 256, (2, *overlap.canvas), np.uint8)
    return problem_of(a, b, overlap)


def ratio(problem, solution):
    return problem.cost(solution.labels) / problem.cost(exact_labels(problem))


def toy():
    """Figure 3.6: 3 × 3 pixels, P1 to P9 column by column; cheap elements join nodes 2-6-7-11-15, all others
    cost ten times as much.
    """
    overlap = side_by_side((3, 3), "right")
    right, down = np.zeros((5, 4), np.float32), np.zeros((4, 5), np.float32)
    right[1:4, 1:3], down[1:3, 1:4] = 1, 1
    right[1, 1] = 0.1  # nodes 2-6 (element 16), between P1 and P4
    down[1, 2] = 0.1  # nodes 6-7 (element 5), between P4 and P5
    right[2, 2] = right[3, 2] = 0.1  # nodes 7-11 and 11-15, between P5|P8 and P6|P9
    return SeamProblem(overlap, right, down)


@pytest.mark.parametrize("options", [{}, {"first_penalty": 3.0}, {"asymptotes": "moving"}])
def test_the_toy_problem_s_seam_visits_nodes_2_6_7_11_15(options):
    solution = thesis_path(toy(), ThesisOptions(**options), record_frames=True)
    assert solution.termination == Termination.SINGLE_LINE
    assert solution.labels[1:4, 1:4].tolist() == [
        [False, True, True],
        [False, False, True],
        [False, False, True],
    ]
    assert len(solution.history) <= 40  # the thesis needs 26
    # Figure 3.7: element 5 starts at 0.5 and ends at 1, like the whole seam, and everything else at 0.
    assert solution.frames[0].down[1, 2] == 0.5
    last = solution.frames[-1]
    on_seam = [last.right[1, 1], last.down[1, 2], last.right[2, 2], last.right[3, 2]]
    assert on_seam == pytest.approx(np.ones(4), abs=0.02)
    assert last.right.sum() + last.down.sum() == pytest.approx(sum(on_seam), abs=1e-6)
    # (3.18): for a single line of full conductors the compliance is the number of its elements.
    assert solution.history[-1].compliance == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_real_strips_become_a_single_line_close_to_the_optimum(crops, seed):
    problem = strip_problem(
        crops, seed, *((80, 20) if seed % 2 else (20, 80)), "right" if seed % 2 else "bottom"
    )
    solution = thesis_path(problem, ThesisOptions())
    assert solution.termination == Termination.SINGLE_LINE
    assert solution.history[-1].stage <= 4
    assert len(solution.history) <= 100
    assert ratio(problem, solution) <= 1.1


def test_stages_follow_algorithm_2(crops):
    solution = thesis_path(strip_problem(crops, 11, 80, 20), ThesisOptions())
    history = solution.history
    stages = [record.stage for record in history]
    assert stages == sorted(stages)
    assert set(stages) == set(range(1, stages[-1] + 1))
    assert history[0].bound == 80 + 20  # N_q at the start
    assert history[0].unknowns == 79 * 21
    for before, after in pairwise(history):
        if after.stage > before.stage:
            assert after.bound == before.n_flux  # (3.20)
        assert after.unknowns <= before.unknowns
    # At the end the densities of the path are 1, its compliance C* = N_q.
    assert history[-1].compliance == pytest.approx(history[-1].n_flux, rel=1e-3)
    assert history[-1].n_flux == history[-1].bound


def test_frames_and_soft_mask(crops):
    problem = strip_problem(crops, 5, 60, 15)
    reports = []
    solution = thesis_path(problem, ThesisOptions(), record_frames=True, progress=reports.append)
    assert len(solution.frames) == len(solution.history)
    for frame, record in zip(solution.frames, solution.history, strict=True):
        assert frame.stage == record.stage
        assert frame.right.shape == problem.right.shape
        assert frame.down.shape == problem.down.shape
        assert 0 <= frame.right.min() <= frame.right.max() <= 1
    assert solution.soft.dtype == np.float32
    assert 0 <= solution.soft.min() <= solution.soft.max() <= 1
    assert ((solution.soft > 0.05) & (solution.soft < 0.95)).any()
    assert reports == sorted(reports)
    assert reports[-1] == 1.0


def test_the_same_problem_gives_the_same_bytes(crops):
    problem = strip_problem(crops, 6, 60, 15)
    first, second = (thesis_path(problem, ThesisOptions()) for _ in range(2))
    assert first.history == second.history
    assert first.labels.tobytes() == second.labels.tobytes()
    assert first.soft.tobytes() == second.soft.tobytes()


@pytest.mark.parametrize("formulation", [1, 2])
@pytest.mark.parametrize("name", SHAPES)
def test_every_topology_gets_a_valid_seam(name, formulation):
    problem = shape_problem(name)
    solution = thesis_path(problem, ThesisOptions(formulation=formulation))
    if formulation == 1:
        assert solution.termination == Termination.SINGLE_LINE
    assert solution.labels.dtype == bool
    assert (solution.labels == problem.complete(solution.labels)).all()
    assert ratio(problem, solution) <= 1.1


def test_out_of_iterations_is_said_and_still_a_seam(crops):
    problem = strip_problem(crops, 7, 80, 20)
    for limit in (1, 2, 5, 12):
        solution = thesis_path(problem, ThesisOptions(max_iterations=limit))
        assert solution.termination == Termination.ITERATIONS
        assert len(solution.history) <= limit
        assert (solution.labels == problem.complete(solution.labels)).all()
        assert problem.cost(solution.labels) < M_MAX
        # Every row is divided: a at its left end, b at its right end.
        rows = solution.labels[1:-1, 1:-1]
        assert not rows[:, 0].any()
        assert rows[:, -1].all()


def test_one_stage_alone_is_not_called_a_single_line(crops):
    solution = thesis_path(strip_problem(crops, 8, 80, 20), ThesisOptions(stages=1))
    assert solution.termination == Termination.ITERATIONS
    assert {record.stage for record in solution.history} == {1}


def test_flux_below_the_threshold_is_not_a_single_line(crops):
    problem = strip_problem(crops, 9, 12, 250)  # 251 columns of corners carry about 0.004 each
    first = thesis_path(problem, ThesisOptions(stages=1, first_iterations=1))
    assert first.history[-1].n_flux == 0
    assert first.termination == Termination.ITERATIONS
    solution = thesis_path(problem, ThesisOptions())
    assert solution.termination == Termination.SINGLE_LINE
    assert ratio(problem, solution) <= 1.1


def test_n_q_counts_path_elements_or_sums_thinly_spread_flux(crops):
    problem = strip_problem(crops, 3, 60, 15)
    run = thesis._Run(problem, thesis.ground_structure(problem), ThesisOptions(), False, None)
    run.flux = np.zeros(1000)
    run.flux[:40] = 1.0
    run.flux[40:60] = 0.0099  # below the threshold
    assert run._n_flux() == 40
    run.flux[40:60] = 0.0101
    assert run._n_flux() == 60
    # A thousand fluxes of 0.009 have Σq² = 0.081, more than the 0 that are counted: C* = 2 Σq².
    run.flux = np.full(1000, 0.009)
    assert run._n_flux() == pytest.approx(2 * 0.081)
    # And counted ones that miss 1 % of Σq² are too few: 1 + 0.02 against 1.
    run.flux = np.concatenate([[1.0], np.full(250, 0.009)])
    assert run._n_flux() == pytest.approx(2 * (1 + 250 * 0.009**2))


@pytest.mark.medium
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"asymptotes": "moving", "overshoot": 1.5},
        {"first_penalty": 3.0, "length_term": 0.0},
        {"move": 0.2},
    ],
)
def test_compliance_never_runs_away(crops, options):
    for seed in range(20, 23):
        solution = thesis_path(strip_problem(crops, seed, 80, 20), ThesisOptions(**options))
        chosen = ThesisOptions(**options)
        for before, after in pairwise(solution.history):
            if before.stage == after.stage and before.unknowns == after.unknowns:
                assert after.compliance <= max(chosen.overshoot * after.bound, before.compliance) * (1 + 1e-9)


def test_a_step_that_breaks_the_network_is_taken_back(crops, monkeypatch):
    """Two of the solutions fail as if the network had come apart."""
    problem = strip_problem(crops, 10, 60, 15)
    undisturbed = thesis_path(problem, ThesisOptions())
    calls = []
    flow = CornerNetwork.flow

    def failing(self, conductance):
        calls.append(conductance)
        if len(calls) in (5, 9):
            raise SolverError("the heat network cannot be solved")
        return flow(self, conductance)

    monkeypatch.setattr(CornerNetwork, "flow", failing)
    solution = thesis_path(problem, ThesisOptions())
    assert all(np.isfinite(record.compliance) for record in solution.history)
    assert solution.termination == Termination.SINGLE_LINE
    assert [record.objective for record in solution.history] != [
        record.objective for record in undisturbed.history
    ]
    assert ratio(problem, solution) <= 1.1
    # The step after a failure is a shorter one from the same point.
    step, shorter = (np.abs(calls[index] - calls[3]).max() for index in (4, 5))
    assert 0 < shorter < step


def test_skipping_solutions_of_equal_ratios_keeps_the_path(crops, monkeypatch):
    problem = strip_problem(crops, 11, 120, 30)
    flows = []
    flow = CornerNetwork.flow
    monkeypatch.setattr(
        CornerNetwork,
        "flow",
        lambda self, conductance: flows.append(len(conductance)) or flow(self, conductance),
    )
    quick = thesis_path(problem, ThesisOptions())
    spared = len(quick.history) - len(flows)
    assert spared >= 2
    monkeypatch.setattr(thesis, "_COMMON_FACTOR", -1.0)
    flows.clear()
    full = thesis_path(problem, ThesisOptions())
    assert len(flows) >= len(full.history)
    assert len(quick.history) == len(full.history)
    for mine, theirs in zip(quick.history, full.history, strict=True):
        assert mine.objective == pytest.approx(theirs.objective, rel=1e-5)
        assert mine.compliance == pytest.approx(theirs.compliance, rel=1e-5)
    assert (quick.labels == full.labels).all()


@pytest.mark.medium
def test_leaving_out_dead_elements_keeps_the_path_and_the_seam(crops, monkeypatch):
    """The first stage decides on the outline: its objective stays within a few percent, and nearly every seam
    is the same.
    """
    deviations, same = [], 0
    for seed in range(12):
        problem = strip_problem(crops, [12, seed], *((80, 20), (120, 30))[seed % 2])
        with monkeypatch.context() as patch:
            quick = thesis_path(problem, ThesisOptions())
            patch.setattr(thesis, "_SOLUTIONS_BEFORE_DROPPING", 10**6)
            full = thesis_path(problem, ThesisOptions())
        mine, theirs = (
            [record for record in solution.history if record.stage == 1] for solution in (quick, full)
        )
        assert theirs[-1].unknowns == theirs[0].unknowns
        assert mine[-1].unknowns < 0.5 * mine[0].unknowns
        deviations += [
            abs(one.objective / other.objective - 1) for one, other in zip(mine, theirs, strict=False)
        ]
        same += quick.labels.tobytes() == full.labels.tobytes()
    assert np.median(deviations) < 0.005
    assert max(deviations) < 0.05
    assert same >= 11


def test_a_step_that_changes_nothing_is_not_taken_back(crops, monkeypatch):
    """However far the compliance is above its bound."""
    monkeypatch.setattr("toposeam.optimize.mma.MMA.step", lambda self, x, *_: x)
    monkeypatch.setattr("toposeam.optimize.mma.MMA.retreat", None)
    options = ThesisOptions(stages=1, reachable=False, overshoot=1.0, start=0.05)
    history = thesis_path(strip_problem(crops, 2, 20, 8), options).history
    assert history[0].compliance > history[0].bound == 28
    assert [record.compliance for record in history] == [history[0].compliance] * 3
    assert [record.change for record in history] == [0, 0, 0]


def test_two_pixels_between_the_patches_leave_nothing_to_decide():
    problem = problem_of(*np.zeros((2, 8, 2), np.uint8), side_by_side((8, 2), "right"))
    solution = thesis_path(problem, ThesisOptions())
    assert solution.termination == Termination.SINGLE_LINE
    assert solution.history == ()
    assert solution.labels[1:-1, 1:-1].tolist() == [[False, True]] * 8


@pytest.mark.parametrize("shape", [(1, 9), (2, 3), (3, 3), (1, 3), (40, 3)])
def test_tiny_strips(shape):
    a, b = np.random.default_rng(0).integers(0, 256, (2, *shape), np.uint8)
    problem = problem_of(a, b, side_by_side(shape, "right"))
    solution = thesis_path(problem, ThesisOptions())
    assert solution.termination == Termination.SINGLE_LINE
    assert ratio(problem, solution) <= 1.2


def test_where_every_seam_costs_the_same_one_line_is_chosen():
    a = np.random.default_rng(1).integers(0, 256, (30, 12), np.uint8)
    problem = problem_of(a, a, side_by_side(a.shape, "right"))
    solution = thesis_path(problem, ThesisOptions())
    assert solution.termination == Termination.SINGLE_LINE
    assert ratio(problem, solution) <= 1.05  # a straight line


def test_forbidden_interfaces_from_end_to_end_show_in_the_cost(crops):
    problem = strip_problem(crops, 3, 30, 12)
    right, down = problem.right.copy(), problem.down.copy()
    right[15][right[15] > 0] = M_MAX
    down[14:16][down[14:16] > 0] = M_MAX
    blocked = SeamProblem(problem.overlap, right, down, M_MAX)
    solution = thesis_path(blocked, ThesisOptions())
    assert blocked.cost(solution.labels) >= M_MAX
    with pytest.raises(ValueError, match="no seam avoids"):
        blocked.check(solution.labels)


def test_formulation_2_minimises_compliance_and_reports_its_end(crops):
    problem = strip_problem(crops, 2, 80, 20)
    solution = thesis_path(problem, ThesisOptions(formulation=2))
    compliances = [record.compliance for record in solution.history]
    assert compliances[-1] < compliances[0]
    assert all(np.isnan(record.bound) for record in solution.history)
    last = solution.history[-1]
    assert solution.termination in (Termination.SINGLE_LINE, Termination.ITERATIONS)
    assert (solution.termination == Termination.SINGLE_LINE) <= (last.n_flux < 200)
    assert ratio(problem, solution) <= 1.2


@pytest.mark.parametrize(
    "options",
    [
        {"formulation": 3},
        {"penalty": 0.5},
        {"first_penalty": float("nan")},
        {"exponent": 0},
        {"start": 0},
        {"start": 1.5},
        {"least_density": 0.6},
        {"least_density": 1e-6},
        {"stages": 0},
        {"max_iterations": 0},
        {"q_threshold": 0.5},
        {"move": 0},
        {"asymptotes": "fixed"},
        {"overshoot": 0.5},
        {"mass": -1.0},
        {"mass": float("inf")},
        {"length_term": -1},
    ],
)
def test_options_out_of_range_are_refused_by_name(options):
    with pytest.raises(OptionError, match=next(iter(options))):
        ThesisOptions(**options)


@pytest.mark.slow
def test_the_thesis_is_within_five_percent_on_sixty_strips(crops):
    ratios, stages = [], []
    for index in range(60):
        rng = np.random.default_rng([3, index])
        height, width = SIZES[rng.choice(len(SIZES), p=[0.3, 0.25, 0.2, 0.15, 0.07, 0.03])]
        if index % 2:
            height, width = width, height
        a, b = crops(rng, height, width)
        problem = problem_of(a, b, side_by_side((height, width), "bottom" if index % 2 else "right"))
        solution = thesis_path(problem, ThesisOptions())
        assert len(solution.history) <= 100
        ratios.append(ratio(problem, solution))
        stages.append(solution.history[-1].stage if solution.termination == Termination.SINGLE_LINE else 99)
    assert np.mean(np.array(stages) < 99) >= 0.95
    assert np.mean(np.array(stages) <= 4) >= 0.9
    assert np.median(ratios) <= 1.01
    assert max(ratios) <= 1.15


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"first_penalty": 3.0}, {"asymptotes": "moving"}])
def test_to_the_letter_it_still_gives_single_lines(crops, options):
    ratios, single = [], []
    for index in range(20):
        problem = strip_problem(crops, [4, index], *SIZES[index % 3])
        solution = thesis_path(problem, ThesisOptions(**options))
        ratios.append(ratio(problem, solution))
        single.append(solution.termination == Termination.SINGLE_LINE)
    assert np.mean(single) >= 0.9
    assert np.median(ratios) <= 1.1
