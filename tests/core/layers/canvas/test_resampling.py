"""Layers turned and scaled into their place."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import placed


@pytest.mark.parametrize("scale", [0, -1.0, float("nan")])
def test_a_layer_cannot_be_scaled_to_nothing(scale):
    with pytest.raises(ts.OptionError, match="scale is"):
        placed(ts.Layer(np.zeros((4, 6))), at=(0, 0), scale=scale)


def test_a_quarter_turn_takes_rows_to_columns():
    image = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
    turned = placed(ts.Layer(image), at=(10, 5), turn=90)
    assert turned.at == (8, 5)  # clockwise round its upper left pixel
    np.testing.assert_array_equal(turned.image, np.rot90(image, -1))
