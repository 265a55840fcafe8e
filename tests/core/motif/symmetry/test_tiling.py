"""Copies of a cell: as arrays, and as placements that drawings take."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.symmetry import lines_of_copies, tile

CELL = np.arange(24.0).reshape(4, 6)


def laid_by_placements(repeat, counts):
    rows, columns = counts
    result = np.full((rows * 4, columns * 6), -1.0)
    copies, lines = lines_of_copies(repeat, counts)
    for line in lines:
        for copy in copies:
            at = line.after(copy)
            for (y, x), value in np.ndenumerate(CELL):
                column = round((at.flip_x * (x + 0.5) / 6 + at.x) * 6 - 0.5)
                row = round((at.flip_y * (y + 0.5) / 4 + at.y) * 4 - 0.5)
                if 0 <= row < len(result) and 0 <= column < result.shape[1]:
                    assert result[row, column] in (-1.0, value)
                    result[row, column] = value
    return result


@pytest.mark.parametrize("repeat", [*ts.motif.REPEATS, "brick 1/3", "drop 1/4"])
@pytest.mark.parametrize("counts", [(1, 1), (3, 2), (2, 5)])
def test_placements_lay_what_tile_lays(repeat, counts):
    assert np.array_equal(laid_by_placements(repeat, counts), tile(CELL, repeat, counts))
