"""Maps of a canvas that are known without looking at their pixels."""

import numpy as np
import pytest

from toposeam.layers.layer import Box
from toposeam.layers.maps import uniform


@pytest.mark.parametrize("shape", [(1, 1), (4, 5)])
def test_a_value_that_is_everywhere_is_known(shape):
    box = Box(0, 0, *shape)
    assert uniform(np.broadcast_to(np.float32(0.5), shape), box) == 0.5
    assert uniform(np.full((4, 5), 0.5), box) is None
