"""Seams drawn over a picture."""

import numpy as np

import toposeam as ts
from toposeam.seam.result import draw_seams
from toposeam.vector.polyline import Polyline


class Drawn:
    """What has lines."""

    def __init__(self, *points):
        self.paths = (Polyline(points),)


def test_a_line_is_drawn_red_with_white_beside_it():
    drawn = draw_seams(np.zeros((9, 12), np.uint8), [Drawn((4, 0), (4, 9))])
    red = (drawn == drawn[4, 4]).all(axis=2)
    assert drawn[4, 4, 0] > drawn[4, 4, 1]
    assert np.flatnonzero(red.all(axis=0)).tolist() == [4]
    assert red.sum() == 9
    assert (drawn[:, [3, 5]] > 200).all()
    assert not drawn[:, :3].any()
    assert not drawn[:, 6:].any()


def test_lines_on_the_far_border_are_drawn_on_the_last_pixels():
    drawn = draw_seams(np.zeros((6, 6), np.uint8), [Drawn((6, 0), (6, 6))])
    assert drawn[:, 5].any(axis=1).all()
    assert ts.seam.draw_seams is draw_seams


def test_lines_are_as_thick_as_the_picture_is_large():
    for side, red, white in ((240, 1, 3), (500, 3, 5), (1000, 5, 9)):
        drawn = draw_seams(np.zeros((side, side + 90), np.uint8), [Drawn((70, 0), (70, side))])
        row = drawn[side // 2]
        assert np.count_nonzero(row.any(axis=1)) == white
        reddish = np.flatnonzero(row[:, 0] > row[:, 1])
        assert (len(reddish), reddish.mean()) == (red, 70)
        assert not (row[:, 0] < row[:, 1]).any()
