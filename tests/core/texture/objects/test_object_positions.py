"""Objects found by where they lie."""

import numpy as np
import pytest

from toposeam.texture.objects.object_positions import ObjectPositions


@pytest.mark.parametrize("wrap", [(True, True), (True, False), (False, True), (False, False)])
@pytest.mark.parametrize(("shape", "reach"), [((300, 170), 24.0), ((60, 50), 100.0), ((95, 400), 31.5)])
def test_what_is_near_is_what_comparing_all_finds(shape, reach, wrap):
    rng = np.random.default_rng(0)
    keys = {(int(n), int(y), int(x)) for n, y, x in rng.integers((0, -9, -9), (7, 400, 410), (300, 3))}
    keys = {
        (n, *(at % limit if wraps else at for at, limit, wraps in zip(place, shape, wrap, strict=True)))
        for n, *place in keys
    }
    positions = ObjectPositions(shape, wrap, reach)
    for key in keys:
        positions.put(key, True)
    gone = set(sorted(keys)[::5])
    for key in gone:
        positions.put(key, False)
    there = np.array(sorted(keys - gone))
    assert positions.all() == list(map(tuple, there.tolist()))
    neighbours = positions.neighbours()
    assert sorted(neighbours) == positions.all()
    for number, *at in there[::4].tolist():
        away = np.abs(there[:, 1:] - at)
        for axis in (0, 1):
            if wrap[axis]:
                away[:, axis] = np.minimum(away[:, axis] % shape[axis], -away[:, axis] % shape[axis])
        expected = there[np.square(away).sum(axis=1) < reach**2]
        assert sorted(positions.near((at[0], at[1]))) == list(map(tuple, expected.tolist())), number
        assert sorted(neighbours[number, at[0], at[1]]) == list(map(tuple, expected.tolist())), number


def test_asking_what_is_near_looks_at_few_of_many():
    class Counted(tuple):
        asked = 0

        def __getitem__(self, item):
            Counted.asked += item == 1
            return super().__getitem__(item)

    positions = ObjectPositions((4096, 4096), (True, True), 100.0)
    for y in range(0, 4096, 40):
        for x in range(0, 4096, 40):
            positions.put(Counted((0, y, x)), True)
    Counted.asked = 0
    assert len(list(positions.near((2000, 2000)))) > 10
    assert Counted.asked < 200
