"""How much of a patch would show a second time near by: by counting, pixel by pixel."""

from types import SimpleNamespace

import numpy as np
import pytest

from toposeam.texture.canvas import IndexCanvas, PlaceGrid
from toposeam.texture.placement import NEAR
from toposeam.texture.placement.near_copies import ObjectRepeatPenalty

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


def repeats_of(index, weight, wrap, shorter):
    """For a canvas that shows an exemplar, and the shorter side that this is said to have."""
    atlas = SimpleNamespace(shapes=np.array([[shorter, shorter]]), width=weight.shape[1])
    canvas = IndexCanvas(index.shape, wrap, weight.size)
    canvas.index[:] = index
    return ObjectRepeatPenalty(atlas, canvas, weight, variety=0.5)


@pytest.mark.parametrize("wrap", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize(("top", "left"), [(12, 11), (0, 3), (26, 27)])
def test_object_repeats_are_counted_across_wrapping_borders(wrap, top, left):
    rng = np.random.default_rng(3)
    index = np.where(rng.random((SIDE, SIDE)) < 0.4, rng.integers(0, SAMPLE**2, (SIDE, SIDE)), -1)
    weight = rng.random((SAMPLE, SAMPLE)).astype(np.float32)
    height, width = 4, 3
    repeats = repeats_of(index, weight, wrap, SAMPLE)
    expected = counted(index, weight, top, left, height, width, round(NEAR * SAMPLE), wrap)
    assert expected.max() > 0
    every = PlaceGrid((top, left), (height, width), 0, 1, expected.shape, EMPTY)
    np.testing.assert_allclose(repeats.share(every), expected, atol=1e-5)
    np.testing.assert_allclose(repeats.factor(every), 1 + expected, atol=1e-5)
    some = PlaceGrid((top, left), (height, width), 1, 2, (3, 3), EMPTY)
    np.testing.assert_allclose(repeats.share(some), expected[1::2, 1::2][:3, :3], atol=1e-5)


def test_twice_as_large_is_looked_at_half_as_closely():
    """Each pixel four times: places between two are seen as the next one."""
    rng = np.random.default_rng(3)
    row, column = rng.integers(0, SAMPLE, (2, SIDE, SIDE))
    weight = rng.random((SAMPLE, SAMPLE)).astype(np.float32)
    small = repeats_of(row * SAMPLE + column, weight, (True, True), 24)
    row, column, wide = (np.kron(values, np.ones((2, 2), int)) for values in (row, column, weight))
    large = repeats_of(4 * SAMPLE * row + 2 * column, wide.astype(np.float32), (True, True), 48)
    size = (SAMPLE - 3, SAMPLE - 3)
    expected = small.share(PlaceGrid((12, 11), (4, 4), 0, 1, size, ((0, 4), (0, 4))))
    doubled = PlaceGrid((24, 22), (8, 8), 0, 1, (2 * size[0] - 1, 2 * size[1] - 1), ((0, 8), (0, 8)))
    found = large.share(doubled)
    nearest = [(np.arange(length) + 1) // 2 for length in found.shape]
    np.testing.assert_allclose(found, expected[np.ix_(*nearest)], atol=1e-5)
