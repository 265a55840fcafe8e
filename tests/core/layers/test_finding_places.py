"""Places that pictures say themselves: how far the search is."""

import pytest
from skimage import data

import toposeam as ts


def test_progress_tells_of_each_picture_and_each_pair():
    whole = data.camera()[120:220, 100:360]
    layers = [ts.Layer(whole[:, left : left + 120], name=str(left)) for left in (0, 70, 140)]
    seen = []
    found = ts.find_places(layers, progress=seen.append)
    assert [layer.at[0] for layer in found.layers] == pytest.approx([0, 70, 140], abs=1)
    looked, compared = [0.4 / 3, 0.8 / 3, 0.4], [0.4 + 0.5 / 3, 0.4 + 1 / 3, 0.9]
    assert seen == pytest.approx([*looked, *compared, 1.0])
