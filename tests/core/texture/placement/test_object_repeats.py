"""How much of a patch would show a second time near by: by counting, pixel by pixel."""

from types import SimpleNamespace

import numpy as np
import pytest

from toposeam.texture.canvas import IndexCanvas, PlaceGrid
from toposeam.texture.placement import NEAR
from toposeam.texture.placement.object_repeats import Repeats

SIDE, SAMPLE = 30, 10
EMPTY = ((0, 4), (0, 3))


def counted(index, weight, top, left, height, width, reach, wrap):
    """For each place of an exemplar, the weight of what would show in a window and shows within reach: once
    for each shift that shows it.
    """
    seen = set()
    for row in range(-SIDE, 2 * SIDE):
        for column in range(-SIDE, 2 * SIDE):
            near = True
            for at, start, length, wraps in ((row, top, height, wrap[0]), (column, left, width, wrap[1])):
                most = min(reach, (SIDE - length) // 2) if wraps else reach
                near &= -most <= at - start < length + most and (wraps or 0 <= at < SIDE)
            within = 0 <= row - top < height and 0 <= column - left < width
            shown = index[row % SIDE, column % SIDE]
            if near and not within and shown >= 0:
                seen.add((*divmod(shown, SAMPLE), row, column))
    sums = np.zeros((SAMPLE - height + 1, SAMPLE - width + 1))
    for (row, column), _ in np.ndenumerate(sums):
        for y, x, at, beside in seen:
            apart = np.hypot(y - row + top - at, x - column + left - beside)
            if 0 <= y - row < height and 0 <= x - column < width and 1 <= apart < reach:
                sums[row, column] += weight[y, x]
    return sums / (height * width)


@pytest.mark.parametrize("wrap", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize(("top", "left"), [(12, 11), (0, 3), (26, 27)])
def test_object_repeats_are_counted_across_wrapping_borders(wrap, top, left):
    rng = np.random.default_rng(3)
    index = np.where(rng.random((SIDE, SIDE)) < 0.4, rng.integers(0, SAMPLE**2, (SIDE, SIDE)), -1)
    weight = rng.random((SAMPLE, SAMPLE)).astype(np.float32)
    atlas = SimpleNamespace(shapes=np.array([[SAMPLE, SAMPLE]]), width=SAMPLE)
    canvas = IndexCanvas((SIDE, SIDE), wrap, SAMPLE**2)
    canvas.index[:] = index
    height, width = 4, 3
    repeats = Repeats(atlas, canvas, weight, variety=0.5)
    expected = counted(index, weight, top, left, height, width, round(NEAR * SAMPLE), wrap)
    assert expected.max() > 0
    every = PlaceGrid((top, left), (height, width), 0, 1, expected.shape, EMPTY)
    np.testing.assert_allclose(repeats.share(every), expected, atol=1e-5)
    np.testing.assert_allclose(repeats.factor(every), 1 + expected, atol=1e-5)
    some = PlaceGrid((top, left), (height, width), 1, 2, (3, 3), EMPTY)
    np.testing.assert_allclose(repeats.share(some), expected[1::2, 1::2][:3, :3], atol=1e-5)
