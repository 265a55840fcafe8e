"""Seams of many small overlaps: as good as the exact ones."""

from __future__ import annotations

import numpy as np
import pytest

import toposeam as ts
from toposeam.seam.exact import exact_labels
from toposeam.seam.kept_paths import cut_by_paths
from toposeam.seam.labels import decided_by, seam_labels
from toposeam.seam.match_cost import MatchCost
from toposeam.seam.posing import seam_problem


def _masks(kind):
    """Where two patches lie on 24 × 26 px: what is laid, and one beside, in a corner, between, inside."""
    a, b = np.zeros((24, 26), bool), np.zeros((24, 26), bool)
    b[1:-1, 1:-1] = True
    if kind == "strip":
        a[:, :9] = True
        b[:] = True
        b[:, :2] = False
    elif kind == "corner":
        a[:8], a[:, :9] = True, True
    elif kind == "between":
        a[:, :9], a[:, -8:], a[:7] = True, True, True
    elif kind == "two pieces":
        a[:7], a[-8:] = True, True
    elif kind == "ring":
        a[:] = True
        a[9:15, 10:17] = False
    return a, b


def _problem(kind, seed):
    a, b = np.random.default_rng(seed).random((2, 24, 26, 3)).astype(np.float32)
    mask_a, mask_b = _masks(kind)
    return seam_problem(a, b, mask_a, mask_b, "right", MatchCost(law="gradient"))[0]


@pytest.mark.parametrize("kind", ["strip", "corner", "between", "two pieces"])
def test_paths_cut_as_well_as_the_exact_method(kind):
    for seed in range(4):
        problem = _problem(kind, seed)
        labels = cut_by_paths(problem)
        assert labels is not None
        assert problem.total(labels) == pytest.approx(problem.total(exact_labels(problem)), rel=1e-6)
        assert (labels[problem.overlap.side == 1]).all()
        assert not labels[problem.overlap.side == 0].any()


def test_what_no_path_divides_is_left_to_others():
    problem = _problem("ring", 0)
    assert cut_by_paths(problem) is None
    for method in ("heat", "shortest-path"):
        labels = decided_by(problem, method, None)
        assert problem.total(labels) == pytest.approx(problem.total(exact_labels(problem)), rel=1e-6)


def test_a_shape_that_came_before_has_costs_of_its_own():
    first, second = _problem("corner", 0), _problem("corner", 1)
    before = cut_by_paths(first)
    assert (cut_by_paths(second) != before).any()
    assert (cut_by_paths(first) == before).all()


@pytest.mark.parametrize("kind", ["strip", "corner", "between", "ring"])
def test_labels_are_those_of_the_best_seam(kind):
    a, b = np.random.default_rng(5).random((2, 24, 26, 3)).astype(np.float32)
    mask_a, mask_b = _masks(kind)
    found = seam_labels(a, b, mask_a, mask_b, closed=kind == "ring")
    best = ts.find_seam(a, b, mask_a, mask_b, method="shortest-path", data_range=1.0, gradient=True)
    cost = ts.find_seam(a, b, mask_a, mask_b, method="heat", data_range=1.0, gradient=True).optimum_ratio()
    assert cost < 1.002  # heat is what these labels stand for
    problem = seam_problem(a, b, mask_a, mask_b, "right", MatchCost(law="gradient"))[0]
    window = problem.overlap.window
    assert problem.total(window(found)) == pytest.approx(problem.total(window(best.labels)), rel=1e-6)
    assert found[mask_b & ~mask_a].all()
    assert not found[~mask_b].any()
