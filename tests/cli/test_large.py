"""Composites made window by window."""

from types import SimpleNamespace

import numpy as np

from toposeam_cli.stitching.windowed_output import _marks


def test_a_seam_is_drawn_three_pixels_wide_on_small_pictures():
    line = SimpleNamespace(outline=np.column_stack([np.full(41, 10.0), np.arange(41)]))
    marks = _marks([SimpleNamespace(paths=[line])], (40, 30))
    np.testing.assert_array_equal(marks[20, 6:15], [0, 0, 1, 2, 2, 2, 1, 0, 0])
    # From 1000 px on it grows with the picture.
    marks = _marks([SimpleNamespace(paths=[line])], (1200, 1000))
    np.testing.assert_array_equal(marks[20, 4:17], [0, 0, 1, 1, 2, 2, 2, 2, 2, 1, 1, 0, 0])
