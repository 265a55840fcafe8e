"""The quality that the documentation promises for method heat, on real crops."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import SHAPES

import toposeam as ts

SIZES = ((60, 15), (80, 20), (120, 30), (160, 40), (240, 60), (320, 80))


@pytest.mark.slow
def test_heat_is_within_one_percent_of_optimum_on_200_strips(crops):
    ratios = []
    for index in range(204):
        rng = np.random.default_rng([1, index])
        height, width = SIZES[rng.choice(len(SIZES), p=[0.3, 0.25, 0.2, 0.15, 0.07, 0.03])]
        if index % 2:
            height, width = width, height
        a, b = crops(rng, height, width)
        seam = ts.find_seam(a, b, side="bottom" if index % 2 else "right", method="heat")
        assert seam.termination == ts.optimize.Termination.SINGLE_LINE, index
        assert len(seam.history) <= 100
        assert len(seam.paths) == 1
        ratios.append(seam.optimum_ratio())
    assert np.median(ratios) <= 1.001
    assert max(ratios) <= 1.01


@pytest.mark.slow
def test_heat_is_within_one_percent_on_100_irregular_overlaps(crops):
    ratios = []
    shapes = ("ring", "four gaps", "two islands", "ell")
    lines = {"ring": 1, "four gaps": 2, "two islands": 2, "ell": 1}
    for index in range(100):
        name = shapes[index % 4]
        mask_a, mask_b = SHAPES[name]()
        a, b = crops(np.random.default_rng([2, index]), *mask_a.shape)
        seam = ts.find_seam(a, b, mask_a, mask_b, method="heat")
        exact = ts.find_seam(a, b, mask_a, mask_b, method="graph-cut")
        assert seam.termination == ts.optimize.Termination.SINGLE_LINE, index
        assert len(seam.history) <= 100
        assert len(seam.paths) == lines[name]
        ratios.append(seam.cost / exact.cost)
    assert np.median(ratios) <= 1.001
    assert max(ratios) <= 1.01
