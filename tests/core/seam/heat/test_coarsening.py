"""Large overlaps, which start on coarse networks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from shapes import SHAPES

import toposeam as ts
from toposeam.seam.heat import coarsening as coarse
from toposeam.seam.heat import method as heat
from toposeam.seam.problem import CutGrid, MatchCost, posing
from toposeam.seam.problem.posing import seam_problem


@pytest.fixture
def small_limits(monkeypatch):
    """Make ordinary overlaps count as large."""
    monkeypatch.setattr(heat, "WHOLE_NODES", 400)
    monkeypatch.setattr(coarse, "COARSEST_NODES", 200)
    monkeypatch.setattr(coarse, "OPENED_NODES", 2)
    monkeypatch.setattr(coarse, "OPENED_NODES_LAST", 2)


@pytest.mark.usefixtures("small_limits")
@pytest.mark.parametrize("shape", [None, *SHAPES])
def test_what_is_left_is_the_same_problem_with_choices_removed(shape, crops):
    mask_a, mask_b = SHAPES[shape]() if shape else (None, None)
    size = mask_a.shape if shape else (120, 30)
    problem, _ = seam_problem(
        *crops(np.random.default_rng(2), *size), mask_a, mask_b, "right", MatchCost(law="gradient")
    )
    smaller, weight, multiplicity, node_of_pixel = coarse.restrict(problem.grid)
    assert smaller.n < 0.9 * problem.grid.free.sum()
    # Any labelling of the small network costs what the labelling of the pixels behind it costs.
    rng = np.random.default_rng(3)
    for _ in range(5):
        hot = np.append(rng.random(smaller.n) < 0.5, [False, True])
        labels = hot[node_of_pixel]
        cut = hot[smaller.tail] != hot[smaller.head]
        assert weight[cut].sum() == pytest.approx(problem.cost(labels), rel=1e-5)
        assert multiplicity[cut].sum() <= len(problem.crossed(labels))


@pytest.mark.usefixtures("small_limits")
@pytest.mark.parametrize("shape", [None, *SHAPES])
def test_seams_stay_single_lines_near_the_optimum(shape, crops):
    mask_a, mask_b = SHAPES[shape]() if shape else (None, None)
    size = mask_a.shape if shape else (160, 40)
    ratios = []
    for seed in range(3):
        seam = ts.find_seam(*crops(np.random.default_rng([4, seed]), *size), mask_a, mask_b, method="heat")
        assert seam.termination == ts.optimize.Termination.SINGLE_LINE
        ratios.append(seam.optimum_ratio())
    # At these limits the coarsest networks have fewer nodes than a seam has pixels; a few percent is what
    # that costs.
    assert np.median(ratios) < 1.05


@pytest.mark.parametrize("shape", [None, *SHAPES])
def test_a_large_overlap_is_as_soft_as_one_that_is_solved_whole(shape, crops, monkeypatch):
    mask_a, mask_b = SHAPES[shape]() if shape else (None, None)
    size = mask_a.shape if shape else (160, 40)
    a, b = crops(np.random.default_rng(5), *size)
    whole = ts.find_seam(a, b, mask_a, mask_b, method="heat")
    monkeypatch.setattr(heat, "WHOLE_NODES", 400)
    contracted = ts.find_seam(a, b, mask_a, mask_b, method="heat")
    assert contracted.history[0].unknowns < whole.history[0].unknowns
    assert contracted.labels.tobytes() == whole.labels.tobytes()
    assert np.abs(whole.soft - contracted.soft).mean() < 0.3 * np.abs(whole.soft - whole.labels).mean()


@pytest.mark.slow
@pytest.mark.parametrize("shape", [None, *SHAPES])
def test_large_overlaps_of_every_topology(shape):
    """Each shape seven times as large, with the limits as they are."""
    from skimage import data

    small = SHAPES[shape]() if shape else (np.ones((100, 25), bool),) * 2
    height, width = small[0].shape
    masks = tuple(np.kron(mask, np.ones((7, 7), bool)) for mask in small) if shape else (None, None)
    grass = np.pad(data.grass(), ((0, 400), (0, 400)), mode="symmetric")
    a, b = grass[: 7 * height, : 7 * width], grass[90 : 90 + 7 * height, 200 : 200 + 7 * width]
    seam = ts.find_seam(a, b, *masks, method="heat")
    assert seam.problem.grid.free.sum() > coarse.WHOLE_NODES
    assert seam.history[0].unknowns < seam.problem.grid.free.sum()
    best = ts.find_seam(a, b, *masks, method="graph-cut")
    assert seam.termination == ts.optimize.Termination.SINGLE_LINE
    assert len(seam.paths) == len(best.paths)
    assert best.cost * (1 - 1e-6) <= seam.cost <= 1.03 * best.cost


def test_the_match_cost_is_the_same_from_blocks_of_rows(crops, monkeypatch):
    mask_a, mask_b = SHAPES["ring"]()
    pair = crops(np.random.default_rng(5), *mask_a.shape)
    whole = seam_problem(*pair, mask_a, mask_b, "right", MatchCost(law="gradient"))[0]
    monkeypatch.setattr(posing, "_BLOCK_PIXELS", 1)
    problem = seam_problem(*pair, mask_a, mask_b, "right", MatchCost(law="gradient"))[0]
    np.testing.assert_array_equal(problem.right, whole.right)
    np.testing.assert_array_equal(problem.down, whole.down)


def test_identical_pictures_of_a_large_overlap():
    # What is merged with a terminal is a node, too, whether free pixels of it are left or not.
    picture = np.random.default_rng(0).integers(0, 4, (300, 200, 3)).astype(np.uint8)
    seam = ts.find_seam(picture, picture, method="heat")
    assert (np.diff(seam.labels.astype(int), axis=1) >= 0).all()
    assert seam.labels[:, -1].all()
    assert not seam.labels[:, 0].any()


def test_a_row_keeps_the_pixels_beside_its_cheapest_interface(monkeypatch):
    """The worked example of `restrict`."""
    monkeypatch.setattr(coarse, "OPENED_NODES_LAST", 5)
    ends = np.zeros((2, 1, 8), np.float32)
    ends[0, 0, 0] = ends[1, 0, -1] = 9
    costs = np.float32([[9, 5, 9, 1, 9, 5, 9]])
    grid = CutGrid(costs, np.zeros((0, 8), np.float32), *ends, np.ones((1, 8), bool))
    network, weight, multiplicity, node_of_pixel = coarse.restrict(grid)
    assert network.n == 4
    assert node_of_pixel.tolist() == [[4, 4, 0, 1, 2, 3, 5, 5]]  # 4 is cold, 5 hot
    elements = zip(network.tail.tolist(), network.head.tolist(), weight.tolist(), strict=True)
    assert sorted(elements) == [(0, 1, 9), (0, 4, 5), (1, 2, 1), (2, 3, 9), (3, 5, 5)]
    assert multiplicity.tolist() == [1] * 5


def test_pixels_that_are_nodes_alone_are_opened_again(monkeypatch):
    problem, _ = seam_problem(*np.zeros((2, 1, 8)), None, None, "right", MatchCost(law="gradient"))
    nodes = np.full(problem.overlap.side.shape, 9)
    nodes[1, 2:8] = [0, 0, 1, 2, 2, 3]  # the free pixels: the outermost two are fixed
    opened = []
    monkeypatch.setattr(heat, "best_nearby", lambda problem, labels, near: opened.append(near))
    heat._refined(problem, np.zeros_like(nodes, bool), nodes)
    assert np.argwhere(opened[0]).tolist() == [[1, 4], [1, 7]]


def test_who_follows_pointers_comes_to_the_components():
    rng = np.random.default_rng(0)
    for n in (1, 2, 7, 60, 500):
        for _ in range(20):
            target = rng.integers(0, n, n).astype(np.int32)  # with circles of any length
            graph = csr_array((np.ones(n), target, np.arange(n + 1)), shape=(n, n))
            count, expected = connected_components(graph, directed=False)
            found, group = coarse._components(target)
            assert found == count == len(set(zip(group.tolist(), expected.tolist(), strict=True)))
            assert group.max() == count - 1
