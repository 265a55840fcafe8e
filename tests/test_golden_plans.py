"""Whole stitches are as they were in the last version; see tests/golden_plans.py."""

import json

import numpy as np
import pytest

from golden_plans import JOBS, KEYS, PLANS, picture_of, pixels_of

MARKED = [
    pytest.param(name, marks=pytest.mark.slow if job.slow else pytest.mark.medium)
    for name, job in JOBS.items()
]
TOLD = "say in CHANGELOG what is different and why, then run: python tests/golden_plans.py"


@pytest.mark.parametrize("name", MARKED)
def test_a_stitch_is_as_in_the_last_version(name, tmp_path):
    if JOBS[name].needs:
        pytest.importorskip(JOBS[name].needs)
    before, made = json.loads(PLANS.read_text())[name], JOBS[name].make(tmp_path)
    if before["cost"] is None:
        assert made.cost is None
    else:
        assert made.cost == pytest.approx(before["cost"], rel=1e-6), f"{TOLD} --write {name!r}"
    likeness = psnr(made.picture, pixels_of(picture_of(name)))
    assert likeness > 60, f"{TOLD} --write {name!r}"
    assert made.keys == json.loads(KEYS.read_text())[name], f"{TOLD} --write-keys {name!r}"
    if made.peak_mb is not None and before["peak_mb"] is not None:
        assert made.peak_mb <= 1.15 * before["peak_mb"] + 20, "it takes more memory than it did"


def psnr(picture, other):
    """Full scale to the root mean square of the differences, dB."""
    assert picture.shape == other.shape
    error = np.mean((picture.astype(float) - other) ** 2)
    return np.inf if error == 0 else 10 * np.log10(255**2 / error)
