"""Crumbs that layers leave where three meet are looked at with all that lies round them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from toposeam.layers import meeting
from toposeam.layers.labelling import Labelling
from toposeam.layers.layer import Box
from toposeam.layers.meeting import settle_all
from toposeam.layers.rounds import Rounds
from toposeam.layers.table_costs import TableCost


def crumb():
    """A layer in the middle of the border of two others, and nothing gains by taking its part alone."""
    canvas = Box(0, 0, 24, 60)
    allowed = np.zeros((3, 24, 60), bool)
    allowed[0, :, :30] = allowed[1, :, 30:] = allowed[2, 4:20, 12:48] = True
    tables = {}
    for pair, cost in {(0, 1): 1.0, (0, 2): 5.0, (1, 2): 5.0}.items():
        right, down = np.zeros((26, 61), np.float32), np.zeros((25, 62), np.float32)
        right[1:-1, 1:-1] = cost
        right[1:-1, [12, 48]] = 4.6
        tables[pair] = TableCost(canvas.grown(1), right, down)
    return Labelling(canvas, [canvas] * 3, list(allowed), tables)


def settled(labelling, near, executor=None):
    rounds = Rounds(labelling, labelling.on_top(), "graph-cut", {}, near)
    rounds.refine(10, executor=executor)
    before = labelling.total(rounds.label_map, labelling.canvas)
    settle_all(rounds, executor)
    return before, rounds.label_map


@pytest.mark.parametrize("whole", [1 << 15, 0])
def test_crumbs_that_no_expansion_takes_recede(monkeypatch, whole):
    monkeypatch.setattr(meeting, "_WHOLE_WINDOW", whole)
    labelling = crumb()
    before, label_map = settled(labelling, None)
    assert before == pytest.approx(8 * 1 + 16 * (4.6 + 4.6), rel=1e-5)
    assert labelling.total(label_map, labelling.canvas) == pytest.approx(24 * 1, rel=1e-5)
    assert np.unique(label_map).tolist() == [0, 1]


def test_pixels_that_were_not_open_change_too_and_processes_find_the_same():
    labelling = crumb()
    near = np.zeros(labelling.canvas.shape, bool)
    near[:, 28:32] = True
    _, label_map = settled(labelling, near)
    assert np.unique(label_map).tolist() == [0, 1]
    with ThreadPoolExecutor(2) as executor:
        _, other = settled(labelling, near, executor)
    np.testing.assert_array_equal(label_map, other)
