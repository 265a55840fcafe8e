"""The structural similarity along a seam: 1 where nothing is broken, less where a line is cut off."""

import numpy as np
import pytest

import toposeam as ts

ROWS = np.sin(np.arange(40) * 0.9)[:, None] * np.ones((1, 30)) * 0.4 + 0.5


def test_patches_that_agree_leave_nothing_to_see():
    assert ts.seam_likeness(ts.find_seam(ROWS, ROWS), ROWS, ROWS) == pytest.approx(1.0)


def test_lines_that_do_not_meet_are_seen_and_the_more_the_farther_apart():
    seen = [
        ts.seam_likeness(ts.find_seam(ROWS, shifted), ROWS, shifted)
        for shifted in (np.roll(ROWS, 1, axis=0), np.roll(ROWS, 3, axis=0))
    ]
    assert 1 > seen[0] > seen[1]


def test_only_the_surroundings_of_the_seam_are_looked_at():
    other = ROWS.copy()
    other[:, :5] = 0.1  # far from where the seam runs
    seam = ts.find_seam(ROWS, other, avoid=np.arange(30)[None, :] * np.ones((40, 1)) < 18)
    assert ts.seam_likeness(seam, ROWS, other, reach=2) == pytest.approx(1.0)


def test_an_overlap_narrower_than_a_window_has_no_likeness():
    assert np.isnan(ts.seam_likeness(ts.find_seam(ROWS[:, :5], ROWS[:, 5:10]), ROWS[:, :5], ROWS[:, 5:10]))
