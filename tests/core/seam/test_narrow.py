"""Narrow places, ragged overlaps and noise: every method's seam against maximum flows of SciPy, which know
nothing of how the methods see the problem.
"""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from narrow_cases import KINDS, at_border, least_by_flow, narrow, noisy, ragged

import toposeam as ts

GRAPH = ["graph-cut"] if importlib.util.find_spec("maxflow") else []
EXACT = ["auto", "shortest-path", *GRAPH]


@pytest.mark.parametrize("index", range(4 * 3 * len(KINDS)))
def test_through_narrow_places_every_method_finds_the_best_seam(index):
    *given, options = narrow(index)
    heat = ts.find_seam(*given, **options, method="heat")
    best = least_by_flow(heat.problem)
    assert heat.cost == pytest.approx(best, rel=1e-3)
    assert best * (1 - 1.1e-3) <= heat.bound <= best * (1 + 1e-5)
    assert ts.find_seam(*given, **options, prove=True).bound == pytest.approx(best, rel=1e-5)
    for method in EXACT:
        assert ts.find_seam(*given, **options, method=method).cost == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("method", ["heat", "dp", "thesis", *EXACT])
@pytest.mark.parametrize("length", [10, 60, 200])
def test_every_method_finds_the_minimum_in_a_row_of_pixels(method, length):
    a, b = np.random.default_rng(0).random((2, 1, length, 3))
    seam = ts.find_seam(a, b, method=method)
    assert seam.cost == pytest.approx(float(seam.problem.right[1, 1:-1].min()))


@pytest.mark.parametrize("index", range(30))
def test_what_is_proven_is_a_bound_of_what_a_seam_costs(index):
    """What is cut between fixed pixels belongs to both."""
    given = ragged(index)
    heat = ts.find_seam(*given, method="heat")
    best = least_by_flow(heat.problem)
    assert heat.optimum_ratio() == pytest.approx(heat.cost / best, rel=1e-5)
    assert heat.cost / heat.bound == pytest.approx(heat.optimum_ratio(), rel=1.1e-3)
    assert heat.bound <= best * (1 + 1e-5)
    for method, prove in [("thesis", True), ("heat", True), *((one, False) for one in EXACT)]:
        seam = ts.find_seam(*given, method=method, prove=prove)
        assert seam.cost / seam.bound == pytest.approx(seam.optimum_ratio(), rel=1e-5)


@pytest.mark.parametrize("frames", [False, True])
def test_a_speck_far_from_the_seam_belongs_to_what_is_proven(frames):
    """Where a path is found, and where heat gathers."""
    a, b = np.random.default_rng(0).random((2, 60, 80, 3))
    on_a, on_b = np.zeros((2, 60, 80), bool)
    on_a[:, :60] = on_b[:, 20:] = on_b[5:10, 5:10] = True
    seam = ts.find_seam(a, b, on_a, on_b, speck=0, gradient=True, record_frames=frames)
    plain = ts.find_seam(a, b, on_a, on_b & (np.arange(80) >= 20), speck=0, gradient=True)
    assert seam.bound > 1.05 * plain.bound
    assert seam.bound == pytest.approx(least_by_flow(seam.problem), rel=1.1e-3)


def test_excluded_pixels_beside_fixed_ones_count_in_the_bound():
    """They are as good as fixed, and what lies between them and the other side is cut whatever shows."""
    a, b = np.random.default_rng(0).random((2, 12, 9))
    avoid = np.zeros((12, 9), bool)
    avoid[5, 2:8] = True
    seam = ts.find_seam(a, b, avoid=avoid, method="heat")
    assert seam.cost / seam.bound == pytest.approx(seam.optimum_ratio(), rel=1.1e-3)


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_noise_draws_no_seam_to_the_border(noise):
    crossed = np.sum([at_border(ts.find_seam(*noisy(seed, noise)).labels) for seed in range(4)], axis=0)
    assert crossed[1] / crossed[0] <= 0.06
