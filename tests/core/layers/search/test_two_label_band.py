import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import Box, TileMap
from toposeam.layers.labelling import Labelling, TableCost, pose_labelling
from toposeam.layers.search import band_of, costs_at, write_pixels
from toposeam.layers.search.two_label_band import divided
from toposeam.seam.cut_solver import CutSolver
from toposeam.seam.heat import HeatOptions


def three() -> Labelling:
    photograph = data.chelsea()[:140, :220]
    corners = (0, 0), (70, 6), (30, 50)
    rng = np.random.default_rng(3)
    layers = []
    for x, y in corners:
        crop = photograph[y : y + 85, x : x + 130] * 0.8 + rng.normal(20, 12, (85, 130, 3))
        layers.append(ts.Layer(np.clip(crop, 0, 255).astype(np.uint8), at=(x, y), name=str(x)))
    return pose_labelling(ts.layers.common_canvas(layers))


@pytest.fixture
def started():
    labelling = three()
    rng = np.random.default_rng(0)
    near = np.zeros(labelling.canvas.shape, bool)
    near[20:, 60:140] = True
    near &= rng.random(near.shape) < 0.97  # holes, and pixels that nothing ties to one side
    label_map = labelling.on_top()
    label_map[near] = rng.integers(0, 3, np.count_nonzero(near))
    labelling.make_allowed(label_map)
    return labelling, label_map, near


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_a_band_costs_what_the_labelling_does(started, pair):
    labelling, label_map, near = started
    band = band_of(labelling, label_map, pair, near)
    assert band is not None
    before = labelling.total(label_map, labelling.canvas)
    rng = np.random.default_rng(1)
    for _ in range(3):
        second = rng.random(len(band.rows)) < 0.5
        changed = label_map.copy()
        write_pixels(changed, band.rows, band.columns, np.where(second, *np.int16(pair[::-1])))
        assert labelling.total(changed, labelling.canvas) - before == pytest.approx(
            band.total(second) - band.total(band.second), rel=1e-5
        )


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_heat_and_flow_reach_the_same_local_optimum_in_a_band(started, pair):
    labelling, label_map, near = started
    options, ends = HeatOptions(tolerance=1e-6), []
    for method in ("heat", "graph-cut"):
        solver = CutSolver(method, options, labelling.forbidden)
        found = divided((labelling, label_map, near, pair, solver))
        after = label_map.copy()
        write_pixels(after, *found[0], found[1])
        assert (after[~near] == label_map[~near]).all()
        ends.append(labelling.total(after, labelling.canvas))
        rows, columns = np.nonzero(near & np.isin(after, pair))
        for y, x in zip(rows[::40], columns[::40], strict=True):
            other = after.copy()
            other[y, x] = pair[int(after[y, x] == pair[0])]
            if labelling.allowed_in(other[y, x], labelling.canvas)[y, x]:
                assert labelling.total(other, labelling.canvas) >= ends[-1] * (1 - 1e-6)
    assert ends[0] < labelling.total(label_map, labelling.canvas)
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)


def test_what_only_one_side_pulls_at_goes_to_it():
    labelling = three()
    label_map = labelling.on_top()
    near = np.zeros(labelling.canvas.shape, bool)
    near[60:63, 100:103] = True  # an island in the middle of one layer
    (other,) = set(np.unique(label_map[59:64, 99:104]).tolist())
    label_map[61, 101] = min(other, 1) if other else 1
    pair = tuple(sorted({other, int(label_map[61, 101])}))
    band = band_of(labelling, label_map, pair, near)
    network, _, chosen = band.cut.network()
    assert network.n == 0
    assert len(band.rows) == 9
    decided = band.cut.hot(chosen, np.zeros(0, bool), band.second)
    assert (decided == (other == pair[1])).all()


def test_where_nothing_is_open_there_is_no_band(started):
    labelling, label_map, near = started
    assert band_of(labelling, label_map, (0, 1), np.zeros_like(near)) is None


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_a_band_is_all_that_is_open_and_may_show_either(started, pair):
    labelling, label_map, near = started
    for opened in (near, None):
        expected = np.isin(label_map, pair) & (True if opened is None else opened)
        for k in pair:
            expected &= labelling.allowed_in(k, labelling.canvas)
        band = band_of(labelling, label_map, pair, opened)
        assert 500 < len(band.rows) < np.isin(label_map, pair).sum()
        np.testing.assert_array_equal(np.stack([band.rows, band.columns]), np.nonzero(expected))
        np.testing.assert_array_equal(band.second, label_map[expected] == pair[1])


def test_costs_are_looked_up_to_the_right_and_below():
    """In an overlap of several tiles that begins within a box, and ends beyond it."""
    rng = np.random.default_rng(4)
    place, box = Box(5, 3, 12, 410), Box(2, 1, 10, 409)
    right, down = rng.random((7, 406), np.float32), rng.random((6, 407), np.float32)
    first, axis = rng.integers(7 * 408, size=900), rng.integers(2, size=900)
    first = first[first % 408 < 407][:800]
    found = costs_at(TableCost(place, right, down), box, first, axis[:800])
    for at, along, value in zip(first, axis, found, strict=False):
        y, x = at // 408 + box.top - place.top, at % 408 + box.left - place.left
        table = (down, right)[along]
        known = y >= 0 and x >= 0 and y < table.shape[0] and x < table.shape[1]
        assert value == (table[y, x] if known else 0)
    assert (found > 0).sum() > 300


def test_pixels_are_written_to_maps_of_tiles_as_to_arrays():
    rng = np.random.default_rng(2)
    rows, columns = rng.integers(0, 300, (2, 500))
    tiled, plain = TileMap((300, 300), -1, np.int16), np.full((300, 300), -1, np.int16)
    tiled[Box(100, 0, 300, 300).slices], plain[100:] = 4, 4
    for label_map in (tiled, plain):
        write_pixels(label_map, rows, columns, np.full(500, 7, np.int16))
    np.testing.assert_array_equal(tiled[:, :], plain)
