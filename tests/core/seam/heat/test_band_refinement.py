"""Seams opened again where they run."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import SHAPES

import toposeam as ts
from toposeam.seam.heat import band_refinement as corridor
from toposeam.seam.problem import FREE, grid


def apart_from_the_best(problem, best, rng):
    """Another valid labelling near the best one: blocks of it moved to one side."""
    labels = problem.complete(best).astype(bool)
    free = problem.overlap.side == FREE
    for _ in range(3):
        rows, columns = np.nonzero(free)
        pick = rng.integers(len(rows))
        block = np.s_[rows[pick] : rows[pick] + 9, columns[pick] : columns[pick] + 9]
        labels[block] = np.where(free[block], bool(rng.integers(2)), labels[block])
    return labels


@pytest.mark.parametrize("shape", [None, *SHAPES])
def test_the_best_seam_is_found_again_from_one_nearby(shape, crops):
    masks = SHAPES[shape]() if shape else (None, None)
    size = masks[0].shape if shape else (80, 30)
    rng = np.random.default_rng(1)
    a, b = crops(rng, *size)
    best = ts.find_seam(a, b, *masks, method="graph-cut")
    problem, labels = best.problem, best.problem.overlap.window(best.labels)
    for _ in range(3):
        start = apart_from_the_best(problem, labels, rng)
        found = corridor.best_nearby(problem, start, np.zeros_like(start))
        assert best.cost * (1 - 1e-6) <= problem.cost(found) <= problem.cost(start)
        if shape not in ("four gaps", "separate overlaps"):  # whose seams may not all be apart
            assert problem.cost(found) == pytest.approx(best.cost, rel=0.02)


def test_additional_open_pixels_let_the_seam_leave_the_corridor():
    # Two valleys, 120 px apart; the given seam runs in the dearer one.
    rng = np.random.default_rng(2)
    a = np.zeros((60, 200))
    b = 0.5 + 0.1 * rng.random((60, 200))
    b[:, 30:34], b[:, 160:164] = 0.02, 0.01
    problem = ts.find_seam(a, b, gradient=False, method="dp").problem
    start = np.zeros(problem.overlap.side.shape, bool)
    start[:, 33:] = True
    nothing = np.zeros_like(start)
    stays = corridor.best_nearby(problem, start, nothing)
    assert (problem.complete(stays)[30].argmax()) < 40
    flows = nothing.copy()
    flows[:, 150:170] = True
    # They must be joined: a seam cannot jump. At the upper and lower border it never was anywhere else.
    goes = corridor.best_nearby(problem, start, flows)
    assert (problem.complete(goes)[30].argmax()) > 150
    assert problem.cost(goes) < 0.6 * problem.cost(stays)


def test_squares_about_places_reach_as_far_as_they_say():
    places = np.zeros((100, 70), bool)
    places[50, 33] = True
    wide = grid.grown(places, 2)
    rows, columns = np.nonzero(wide)
    assert 50 - rows.min() >= 2 * grid.CELL
    assert rows.max() - 50 >= 2 * grid.CELL
    assert columns.max() - columns.min() + 1 == 5 * grid.CELL
    assert wide.shape == places.shape


def test_what_costs_no_less_is_left_as_it_is(crops):
    best = ts.find_seam(*crops(np.random.default_rng(3), 60, 30), method="shortest-path")
    labels = best.problem.overlap.window(best.labels)
    found = corridor.best_nearby(best.problem, labels, np.zeros_like(labels))
    np.testing.assert_array_equal(best.problem.complete(found), best.problem.complete(labels))
