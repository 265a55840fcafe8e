"""The canvas: which copies show, and how much of each."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from toposeam.texture.canvas import IndexCanvas, PlaceGrid


def _copy(row, column, shape=(6, 6), width=40):
    return ((row + np.arange(shape[0])[:, None]) * width + column + np.arange(shape[1])).astype(np.int32)


def test_usage_and_areas_are_those_of_what_shows():
    rng = np.random.default_rng(0)
    canvas = IndexCanvas((20, 23), (True, False), 1600)
    for _ in range(40):
        top, left = int(rng.integers(20)), int(rng.integers(17))
        # Every third patch continues what is there.
        seen = canvas.index[top, left]
        row, column = divmod(int(seen), 40) if seen >= 0 and rng.random() < 0.4 else rng.integers(30, size=2)
        source = _copy(int(row), int(column))
        shows = rng.random((6, 6)) < 0.7
        canvas.paint(top, left, source, shows)
        used = np.bincount(canvas.index[canvas.index >= 0], minlength=1600)
        assert (canvas.usage == used).all()
        copies = canvas.copy_labels()
        areas = [canvas.area_of(first) for first in canvas.copies(0, 0, 20, 23).first]
        shown = np.unique(canvas.labels[canvas.labels >= 0])
        wanted = [np.count_nonzero(copies == copies[canvas.labels == label][0]) for label in shown]
        assert areas == wanted


def test_patches_that_continue_one_another_are_one_copy():
    canvas = IndexCanvas((12, 30), (False, False), 1600)
    every = np.ones((6, 6), bool)
    canvas.paint(0, 0, _copy(0, 0), every)
    canvas.paint(0, 12, _copy(0, 12), every)
    canvas.paint(0, 20, _copy(20, 3), every)
    assert len(np.unique(canvas.copy_labels())) == 4
    canvas.paint(0, 5, _copy(0, 5, (6, 8)), np.ones((6, 8), bool))  # joins the first two
    labels = canvas.copy_labels()
    assert labels[0, 0] == labels[0, 8] == labels[0, 17] != labels[0, 25]
    copies = canvas.copies(0, 0, 12, 30)
    assert [canvas.area_of(first) for first in copies.first] == [108, 108, 36, 108]
    assert copies.first == [0, 0, 2, 0]
    assert (copies.shown == canvas.index[copies.y, copies.x]).all()


def test_windows_beyond_the_border_show_nothing_there():
    canvas = IndexCanvas((10, 10), (False, True), 1600)
    canvas.paint(2, 2, _copy(0, 0), np.ones((6, 6), bool))
    inside, beyond = canvas.read(2, 2, 6, 6), canvas.read(-1, -3, 8, 8)
    assert (inside == _copy(0, 0)).all()
    assert (beyond[0] == -1).all()
    assert (beyond[1:, 5:] == canvas.index[:7, 2:5]).all()
    assert ndimage.label(inside >= 0)[1] == 1


def test_places_are_sampled_where_they_lie_and_beside():
    places = PlaceGrid((0, 0), (4, 4), 6, 3, (3, 5), ((0, 4), (0, 4)))
    values = np.arange(100, dtype=np.float32).reshape(10, 10)
    np.testing.assert_array_equal(places.from_blocks(values, 2), values[np.ix_([3, 4, 6], [3, 4, 6, 7, 9])])
    found = places.from_blocks(values, 2, (3, 1))
    np.testing.assert_array_equal(found, values[np.ix_([4, 6, 7], [3, 5, 6, 8, 9])])  # none lies beyond
