"""Connected pieces are SciPy's, numbers and all."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.layers.canvas import pieces_of
from toposeam.layers.labelling import exclusive_covers, pose_labelling
from toposeam.layers.search import Choices
from toposeam.seam.cut_solver import CutSolver


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("shape", [(0, 5), (5, 0), (1, 9), (9, 1), (30, 40)])
def test_pieces_are_those_of_scipy(shape, share):
    mask = np.random.default_rng(round(10 * share)).random(shape) < share
    piece, count = pieces_of(mask)
    expected, expected_count = ndimage.label(mask)
    assert count == expected_count
    assert piece.dtype == np.int32
    np.testing.assert_array_equal(piece, expected)


def test_a_spiral_is_one_piece():
    mask = np.zeros((41, 41), bool)
    y = x = 20
    step = [(0, 1), (1, 0), (0, -1), (-1, 0)]
    for number in range(19):
        for _ in range(2 * (number // 2 + 1)):
            mask[y, x] = True
            y, x = y + step[number % 4][0], x + step[number % 4][1]
    assert pieces_of(mask)[1] == 1
    assert pieces_of(~mask)[1] == ndimage.label(~mask)[1]


def test_moves_within_nothing_change_nothing():
    whole = np.random.default_rng(1).random((20, 30))
    layers = [ts.Layer(whole[:, :20], at=(0, 0)), ts.Layer(1 - whole[:, 10:], at=(10, 0))]
    canvas = ts.layers.common_canvas(layers)
    covers = exclusive_covers(layers, [canvas.place(layer) for layer in layers], canvas)
    labelling = pose_labelling(layers, canvas, covers)
    allowed = [labelling.allowed_in(k, canvas.box) for k in range(2)]
    choices = Choices(labelling, canvas.box, labelling.on_top(), allowed, range(2))
    before = choices.shows.copy()
    decide = CutSolver("heat", None, labelling.forbidden)
    choices.run(decide, 2, within=np.zeros(before.size, bool))
    np.testing.assert_array_equal(choices.shows, before)
    choices.run(decide, 2, within=np.ones(before.size, bool))
    assert (choices.shows != before).any()
