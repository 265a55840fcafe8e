"""Which layer shows where the one that did may not."""

import numpy as np

from toposeam.layers.canvas import Box
from toposeam.layers.labelling import Labelling


def test_a_pixel_goes_to_the_layer_beside_it_before_the_first():
    """Three layers lie on one row; the last one may show nowhere, the first one but for two pixels
    everywhere.
    """
    canvas = Box(0, 0, 1, 7)
    allowed = [np.array([row], bool) for row in ([1, 1, 1, 1, 0, 0, 1], [1, 1, 1, 1, 1, 1, 1], [0] * 7)]
    labels = np.array([[0, 2, 2, 1, 1, 2, 2]], np.int16)
    Labelling(canvas, [canvas] * 3, allowed, {}).make_allowed(labels)
    assert labels.tolist() == [[0, 0, 1, 1, 1, 1, 0]]
