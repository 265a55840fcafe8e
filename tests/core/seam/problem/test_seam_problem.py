"""What a labelling costs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from toposeam.seam.exact import exact_labels, graph_cut_labels
from toposeam.seam.heat import HeatOptions, heat_path
from toposeam.seam.problem import FREE, NONE, A, B, MatchCost, Overlap, SeamProblem
from toposeam.seam.problem.posing import seam_problem


@pytest.fixture
def tied():
    """A strip of 2 × 4 px, every interface at 1, whose four free pixels also lie beside other layers."""
    problem, _ = seam_problem(
        np.zeros((2, 4)), np.full((2, 4), 0.5), None, None, "right", MatchCost(law="colour", length=1e-9)
    )
    further = np.zeros((2, *problem.overlap.side.shape), np.float32)
    further[0, 1:3, 2:4] = [[1, 2], [4, 8]]
    further[1, 1:3, 2:4] = [[16, 32], [64, 128]]
    return dataclasses.replace(problem, showing_a=further[0], showing_b=further[1])


def labels_of(problem, *rows):
    labels = np.zeros(problem.overlap.side.shape, bool)
    labels[1:3, 1:5] = rows
    return labels


def test_a_pixel_pays_for_its_patch_beside_other_layers(tied):
    # Free are the two middle columns. The seam right of both leaves all four to a, left of both to b.
    all_a, all_b = labels_of(tied, *[[0, 0, 0, 1]] * 2), labels_of(tied, *[[0, 1, 1, 1]] * 2)
    assert tied.cost(all_a) == tied.cost(all_b) == pytest.approx(2)
    assert tied.total(all_a) == pytest.approx(2 + 1 + 2 + 4 + 8)
    assert tied.total(all_b) == pytest.approx(2 + 16 + 32 + 64 + 128)
    bent = labels_of(tied, [0, 1, 1, 1], [0, 0, 1, 1])
    assert tied.cost(bent) == pytest.approx(3)  # two interfaces across, one along
    assert tied.total(bent) == pytest.approx(3 + 16 + 32 + 4 + 128)


def test_without_other_layers_the_total_is_the_cost(tied):
    alone = dataclasses.replace(tied, showing_a=None, showing_b=None)
    bent = labels_of(tied, [0, 1, 1, 1], [0, 0, 1, 1])
    assert alone.total(bent) == alone.cost(bent) == tied.cost(bent)


def test_all_methods_give_pixels_to_the_patch_of_lower_cost(tied):
    expected = labels_of(tied, *[[0, 0, 0, 1]] * 2)
    for labels in (
        exact_labels(tied),
        graph_cut_labels(tied),
        heat_path(tied, HeatOptions()).labels,
    ):
        np.testing.assert_array_equal(labels[1:3, 2:4], expected[1:3, 2:4])
    swapped = dataclasses.replace(tied, showing_a=tied.showing_b, showing_b=tied.showing_a)
    expected = labels_of(tied, *[[0, 1, 1, 1]] * 2)
    for labels in (
        exact_labels(swapped),
        graph_cut_labels(swapped),
        heat_path(swapped, HeatOptions()).labels,
    ):
        np.testing.assert_array_equal(labels[1:3, 2:4], expected[1:3, 2:4])


def test_costs_beside_other_layers_add_to_those_of_a_cut(tied):
    # To show a costs as much as to be divided from what shows b, and the other way round.
    alone = dataclasses.replace(tied, showing_a=None, showing_b=None)
    np.testing.assert_array_equal(tied.grid.hot - alone.grid.hot, tied.showing_a)
    np.testing.assert_array_equal(tied.grid.cold - alone.grid.cold, tied.showing_b)


def test_only_pixels_that_pay_beside_other_layers_are_tied(tied):
    paying = np.zeros_like(tied.showing_a)
    paying[1, 2] = 3
    problem = dataclasses.replace(tied, showing_a=paying, showing_b=np.zeros_like(paying))
    assert len(problem.element_cost) == len(tied.pattern.place) + 1
    assert problem.element_cost[-1] == 3
    assert len(tied.element_cost) == len(tied.pattern.place) + 8


def test_free_pixels_without_data_have_an_exact_labelling():
    side = np.full((3, 6), NONE, np.uint8)
    side[1, 1:5] = A, FREE, FREE, B
    right, down, nothing = (np.zeros(shape, np.float32) for shape in ((3, 5), (2, 6), (3, 6)))
    overlap = Overlap(side, side != NONE, (-1, -1), (1, 4))
    problem = SeamProblem(overlap, right, down, showing_a=nothing, showing_b=nothing)
    assert problem.total(exact_labels(problem)) == 0.0
