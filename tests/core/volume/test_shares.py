"""Voxels as shares of white."""

import numpy as np

from toposeam.volume.problem.posing import _shares


def test_values_outside_of_the_present_voxels_do_not_count():
    volume = np.full((2, 3, 4, 1), 0.5)
    present = np.ones((2, 3, 4), bool)
    present[0, 0, 0] = False
    volume[0, 0, 0] = np.nan
    shares = _shares(volume, present, "a", None)
    assert shares.dtype == np.float32
    assert shares[0, 0, 0] == 0
    assert (shares[present] == 0.5).all()
