"""Which part of a patch shows near by already: by counting, pixel by pixel."""

from types import SimpleNamespace

import numpy as np
import pytest

from toposeam.texture.canvas import IndexCanvas, PlaceGrid
from toposeam.texture.placement import NEAR
from toposeam.texture.placement.near_copies import NearCopyPenalty

SIDE, SAMPLE = 30, 10
EMPTY = ((0, 4), (0, 3))


def counted(index, top, left, height, width, reach, wrap):
    """For each place of an exemplar, the share of the patch there that shows within reach of the window."""
    seen = np.zeros((SAMPLE, SAMPLE), bool)
    for row in range(SIDE):
        for column in range(SIDE):
            near, within = True, True
            for at, start, length, wraps in ((row, top, height, wrap[0]), (column, left, width, wrap[1])):
                most = min(reach, (SIDE - length) // 2) if wraps else reach
                offset = at - start
                if wraps:
                    offset = (offset + most) % SIDE - most
                near &= -most <= offset < length + most
                within &= 0 <= offset < length
            if near and not within and index[row, column] >= 0:
                seen[divmod(index[row, column], SAMPLE)] = True
    return np.array(
        [
            [seen[row : row + height, column : column + width].mean() for column in range(SAMPLE - width + 1)]
            for row in range(SAMPLE - height + 1)
        ]
    )


@pytest.mark.parametrize("wrap", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize(("top", "left"), [(12, 11), (0, 3), (26, 27)])
def test_near_copies_are_counted_across_wrapping_borders(wrap, top, left):
    rng = np.random.default_rng(3)
    index = np.where(rng.random((SIDE, SIDE)) < 0.1, rng.integers(0, SAMPLE**2, (SIDE, SIDE)), -1)
    atlas = SimpleNamespace(
        shapes=np.array([[SAMPLE, SAMPLE]]), width=SAMPLE, usable=np.ones((SAMPLE, SAMPLE), bool)
    )
    canvas = IndexCanvas((SIDE, SIDE), wrap, SAMPLE**2)
    canvas.index[:] = index
    height, width = 4, 3
    nearby, reach = NearCopyPenalty(atlas, canvas, variety=0.5), round(NEAR * SAMPLE)
    expected = counted(index, top, left, height, width, reach, wrap)
    every = PlaceGrid((top, left), (height, width), 0, 1, expected.shape, EMPTY)
    np.testing.assert_allclose(nearby.share(every), expected, atol=1e-6)
    np.testing.assert_allclose(nearby.factor(every), 1 + 0.5 * expected, atol=1e-6)
    some = PlaceGrid((top, left), (height, width), 1, 2, (3, 3), EMPTY)
    np.testing.assert_allclose(nearby.share(some), expected[1::2, 1::2][:3, :3], atol=1e-6)
