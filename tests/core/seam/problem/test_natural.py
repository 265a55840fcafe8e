"""The law "natural": things stay whole, busy ground hides a seam, steps on smooth ground do not."""

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.seam.problem import CELL, LAWS, MatchCost
from toposeam.seam.problem.match_cost import match_cost
from toposeam.seam.problem.natural import LOOK, perceived
from toposeam.seam.problem.posing import seam_problem


def crossed(seam, thing):
    """Whether a seam divides the pixels of a thing."""
    return 0 < np.count_nonzero(seam.labels & thing) < np.count_nonzero(thing)


@pytest.mark.parametrize("width", [3, 6, 12, 24])
def test_a_post_of_any_width_stays_whole(width):
    rng = np.random.default_rng(width)
    sky = np.full((160, 200, 3), 0.7) + rng.normal(0, 0.01, (160, 200, 3))
    a, b = sky.copy(), sky + rng.normal(0, 0.01, sky.shape)
    post = np.zeros((160, 200), bool)
    post[40:130, 95 : 95 + width] = True
    b[post] = 0.2
    # A light step, like exposure, that tempts the seam to the shortest way.
    b += np.linspace(0, 0.02, 160)[:, None, None]
    seam = ts.find_seam(a, b, side="bottom")
    assert not crossed(seam, post)


def test_a_head_before_trees_stays_on_its_shoulders():
    rng = np.random.default_rng(3)
    trees = np.clip(np.kron(rng.random((40, 50, 3)), np.ones((4, 4, 1))) * 0.5, 0, 1)
    a, b = trees.copy(), np.roll(trees, 2, axis=1)
    y, x = np.indices((160, 200))
    person = ((y - 60) ** 2 + (x - 100) ** 2 < 18**2) | ((y > 75) & (abs(x - 100) < 26))
    b[person] = (0.25, 0.2, 0.18)
    b[(y > 75) & person] = (0.2, 0.2, 0.3)
    seam = ts.find_seam(a, b)
    assert not crossed(seam, person & (x > 0) & (x < 199))


def test_seams_prefer_busy_ground_to_steps_on_smooth_ground():
    rng = np.random.default_rng(4)
    a = np.full((120, 120, 1), 0.5)
    leaves = np.s_[:, 60:110]
    a[leaves] = rng.random((120, 50, 1)) * 0.5 + 0.25
    b = a + 0.04
    b[leaves] = np.roll(a[leaves], 1, axis=0)
    labels = ts.find_seam(a, b).labels
    at = labels.argmax(axis=1)
    assert ((at > 60) & (at < 112)).all()


def test_edges_that_lie_a_pixel_apart_are_no_things():
    a = np.full((1, 60, 60), 0.3, np.float32)
    a[:, :, 30:] = 0.8
    _, moved = perceived(a, np.roll(a, 1, axis=2), None, (0, 0))
    b = a.copy()
    b[:, 10:50, 10:14] = 0.8
    _, post = perceived(a, b, None, (0, 0))
    assert moved[30, 20:40].max() < post[30, 10:14].min() / 3


@pytest.mark.parametrize("start", [(0, 0), (1, 0), (0, 1), (-1, 5)])
def test_costs_do_not_depend_on_the_window(start):
    rng = np.random.default_rng(5)
    a, b = rng.random((2, 90, 80, 3)).astype(np.float32)
    known = np.ones((90, 80), bool)
    known[:20, :30] = False
    top, left = max(start[0], 0) + 8, start[1] + 6
    part = np.s_[top:70, left:60]
    whole = match_cost(a, b, None, known, known, MatchCost(), start=(0, 0))
    inside = match_cost(a[part], b[part], None, known[part], known[part], MatchCost(), start=(top, left))
    for one, other in zip(whole, inside, strict=True):
        inner = np.s_[LOOK:-LOOK, LOOK:-LOOK]
        np.testing.assert_allclose(
            one[part][: other.shape[0], : other.shape[1]][inner], other[inner], rtol=1e-4
        )


def as_written(a, b, shared, start):
    """m and W cell by cell, as the module's text has them."""
    offset = [place % 2 for place in start]
    rows, columns = (-(-(side + first) // 2) for side, first in zip(shared.shape, offset, strict=True))
    cells = [(row, column) for row in range(rows) for column in range(columns)]

    def mean_colour(planes, row, column):
        inside = [max(2 * at - first, 0) for at, first in zip((row, column), offset, strict=True)]
        beyond = [2 * at - first + 2 for at, first in zip((row, column), offset, strict=True)]
        box = np.s_[inside[0] : beyond[0], inside[1] : beyond[1]]
        return planes[:, *box][:, shared[box]].mean(axis=1) if shared[box].any() else None

    colour_a, colour_b = ({cell: mean_colour(planes, *cell) for cell in cells} for planes in (a, b))

    def near(row, column, size, known=True):
        half = size // 2
        return [
            cell
            for cell in cells
            if abs(cell[0] - row) <= half
            and abs(cell[1] - column) <= half
            and not (known and colour_a[cell] is None)
        ]

    def deviation(colours, cell):
        window = [colours[other] for other in near(*cell, 3)]
        return np.sqrt(np.var(window, axis=0).sum()) if window else 0.0

    def outside(colours, others, cell):
        window = [others[other] for other in near(*cell, 5)]
        below, above = np.min(window, axis=0) - colours[cell], colours[cell] - np.max(window, axis=0)
        return np.linalg.norm(np.maximum(np.maximum(below, above), 0))

    busy = {cell: min(deviation(colour_a, cell), deviation(colour_b, cell), 0.2) for cell in cells}
    mismatch, foreign = dict.fromkeys(cells, 0.0), dict.fromkeys(cells, 0.0)
    for cell in cells:
        if colour_a[cell] is not None:
            apart = np.linalg.norm(colour_a[cell] - colour_b[cell])
            mismatch[cell] = min(apart / (0.03 + 0.7 * busy[cell]), 12)
            out = max(outside(colour_a, colour_b, cell), outside(colour_b, colour_a, cell))
            foreign[cell] = min(out / 0.03, 12)

    def thing(values):
        above = {cell: max(values[cell] - 1, 0) for cell in cells}
        wide = {cell: max(above[other] for other in near(*cell, 5, known=False)) for cell in cells}
        found = np.zeros((rows, columns))
        for cell in cells:
            window = np.array([values[other] for other in near(*cell, 7)] or [0.0])
            thin = np.mean(window**4) ** 0.25 / max(np.mean(window), 1e-6)
            found[cell] = thin * min(wide[other] for other in near(*cell, 5, known=False))
        return found

    masking = np.array([0.02 + 0.7 * busy[cell] for cell in cells]).reshape(rows, columns)
    box = tuple(slice(first, first + side) for first, side in zip(offset, shared.shape, strict=True))
    return tuple(
        np.kron(values, np.ones((2, 2)))[box] for values in (masking, thing(mismatch) + thing(foreign))
    )


def both_ways(*given):
    """m and W as computed, each beside what it says in words."""
    return zip(perceived(*given), as_written(*given), strict=True)


@pytest.mark.parametrize("start", [(0, 0), (3, 6), (-1, 1)])
def test_what_eyes_notice_is_computed_as_written(start):
    rng = np.random.default_rng(9)
    a = np.kron(rng.random((2, 5, 9)), np.ones((1, 4, 3)))[:, :17, :25].astype(np.float32)
    b = a + rng.normal(0, 0.03, a.shape).astype(np.float32)
    b[:, 5:9, 8:19] += 0.5
    shared = np.ones((17, 25), bool)
    shared[:5, 19:], shared[12:, :3], shared[9, 11] = False, False, False
    for found, wanted in both_ways(a, b, shared, start):
        np.testing.assert_allclose(found, wanted, rtol=2e-3, atol=1e-3)


def test_rows_computed_in_blocks_are_those_of_the_whole(monkeypatch):
    a, b = data.coffee()[:200, :150], data.coffee()[3:203, 2:152]
    whole = seam_problem(a, b, None, None, "right", MatchCost())[0]
    monkeypatch.setattr("toposeam.seam.problem.posing._BLOCK_PIXELS", 1)
    blocks = seam_problem(a, b, None, None, "right", MatchCost())[0]
    np.testing.assert_allclose(blocks.right, whole.right, rtol=1e-4)
    np.testing.assert_allclose(blocks.down, whole.down, rtol=1e-4)


def test_unknown_pixels_do_not_matter():
    rng = np.random.default_rng(6)
    a, b = rng.random((2, 60, 70, 3)).astype(np.float32)
    ma, mb = np.zeros((2, 60, 70), bool)
    ma[:, :50], mb[5:, 20:] = True, True
    first = ts.find_seam(a, b, ma, mb)
    a[~ma], b[~mb] = 7.0, np.nan
    again = ts.find_seam(np.where(ma[..., None], a, 0.3), np.where(mb[..., None], b, 0.9), ma, mb)
    assert again.cost == first.cost
    np.testing.assert_array_equal(again.labels, first.labels)


def test_in_volumes_a_surface_goes_round_what_both_stacks_show():
    y, x = np.indices((40, 60))[0], np.indices((40, 60))[1]
    cell = (y - 20) ** 2 + (x - 30) ** 2 < 12**2
    volume = np.broadcast_to(np.where(cell, 0.6, 0.1), (16, 40, 60))
    rng = np.random.default_rng(7)
    a, b = (volume + rng.normal(0, 0.01, volume.shape) for _ in range(2))
    labels = ts.find_surface(a, b, axis=2).labels
    inside = np.broadcast_to((y - 20) ** 2 + (x - 30) ** 2 < 10**2, labels.shape)
    assert labels[inside].mean() in (0, 1)


def test_methods_have_a_law_of_their_own_and_take_any_other():
    a, b = np.random.default_rng(8).random((2, 20, 12))
    assert ts.find_seam(a, b).settings["law"] == "natural"
    assert ts.find_seam(a, b, method="thesis").settings["law"] == "gradient"
    assert ts.find_seam(a, b, gradient=False).settings["law"] == "colour"
    for law in LAWS:
        assert ts.find_seam(a, b, cost=MatchCost(law=law)).settings["law"] == law
    with pytest.raises(ts.OptionError, match="law"):
        MatchCost(law="color")
    assert CELL == 2
