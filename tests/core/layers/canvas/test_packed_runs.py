"""Values that are packed by how often each comes in a row."""

import numpy as np
import pytest

from toposeam.layers.canvas.packed_runs import packed, unpacked


@pytest.mark.parametrize("dtype", [bool, np.int16, np.uint8])
@pytest.mark.parametrize("lengths", [[1], [5], [1, 1, 3], [2] * 64, [2] * 65, [3] * 500])
def test_what_is_packed_is_the_same_again(dtype, lengths):
    values = np.repeat(np.arange(len(lengths)) % 2, lengths).astype(dtype)
    runs = packed(values)
    assert runs[2] == (len(lengths) <= 64)  # others are compressed
    np.testing.assert_array_equal(unpacked(runs, dtype), values)


def test_a_million_alike_take_no_more_than_one():
    of_many, of_one = (packed(np.full(count, 7, np.int16)) for count in (1_000_000, 1))
    assert list(map(len, of_many[:2])) == list(map(len, of_one[:2]))
