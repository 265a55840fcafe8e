"""What a seed made in the last version it makes in this one; see tests/golden.py."""

import json

import numpy as np
import pytest

from golden import CASES, STORED

TOLD = "say in CHANGELOG what looks different and why, then run: python tests/golden.py --write"


@pytest.mark.parametrize("name", CASES)
def test_the_same_comes_out_as_in_the_last_version(name):
    before, now = json.loads(STORED.read_text())[name], CASES[name]()
    if isinstance(now, list):
        assert np.abs(np.subtract(now, before)).max() <= 1, TOLD
    else:
        assert now == before, TOLD
