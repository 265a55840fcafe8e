"""What is proven of surfaces between ragged volumes, against maximum flows of SciPy."""

from __future__ import annotations

import importlib.util

import pytest
from narrow_cases import least_by_flow, ragged

import toposeam as ts


@pytest.mark.parametrize("index", range(10))
def test_what_is_proven_is_a_bound_of_what_a_surface_costs(index):
    """What is cut between fixed voxels belongs to both."""
    given = ragged(index, axes=3)
    heat = ts.find_surface(*given)
    best = least_by_flow(heat.problem)
    assert heat.cost == pytest.approx(best, rel=1e-3)
    assert best * (1 - 1.1e-3) <= heat.bound <= best * (1 + 1e-5)
    if importlib.util.find_spec("maxflow"):
        cut = ts.find_surface(*given, method="graph-cut")
        assert cut.cost / cut.bound == pytest.approx(cut.optimum_ratio(), rel=1e-6)
        assert cut.bound == pytest.approx(best, rel=1e-5)
