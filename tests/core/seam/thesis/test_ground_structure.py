"""The ground structure: its numbers, and its two views against each other and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import SHAPES

from toposeam.errors import SolverError
from toposeam.seam.problem import A, B, MatchCost, SeamProblem, between_masks, side_by_side
from toposeam.seam.problem.match_cost import match_cost
from toposeam.seam.thesis import corner_network, pixel_network
from toposeam.seam.thesis.ground_structure import OUTERMOST, ground_structure

TWO_ENDS = ("ell", "ragged")
OTHERS = ("ring", "four gaps", "two islands", "separate overlaps")


def problem_on(overlap, seed=0):
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, *overlap.side.shape, 1)).astype(np.float32)
    on_a, on_b = overlap.shared | (overlap.side == A), overlap.shared | (overlap.side == B)
    return SeamProblem(overlap, *match_cost(a, b, overlap, on_a, on_b, MatchCost(law="gradient")))


def strip(height, width, side="right", seed=0):
    return ground_structure(problem_on(side_by_side((height, width), side), seed))


def shape(name):
    return ground_structure(problem_on(between_masks(*SHAPES[name]())))


def conductances(structure, seed=0, decades=3):
    return 10 ** np.random.default_rng(seed).uniform(-decades, 0, len(structure.cost))


@pytest.mark.parametrize(
    ("height", "width", "side"), [(160, 40, "right"), (40, 160, "bottom"), (40, 160, "top")]
)
def test_an_overlap_of_160_by_40_has_13000_elements(height, width, side):
    structure = strip(height, width, side)
    assert len(structure.cost) == 13_000
    # 161 × 41 corners; those at either end are one terminal each.
    assert corner_network(structure).unknowns == 159 * 41
    assert structure.zigzag() == 200


def test_the_three_by_three_example_of_the_thesis():
    """Figure 3.3: 24 elements and 16 nodes, numbered row by row; elements 1-12 lie across, 13-24 along,
    column by column.
    """
    structure = strip(3, 3)
    assert len(structure.cost) == 24
    assert structure.zigzag() == 6  # N_q at the start, in the text to Figure 3.8
    corners = np.unique(np.r_[structure.start, structure.end])
    assert len(corners) == 16
    # Element 16 joins nodes 2 and 6 and separates P1 and P4, which lie side by side in the first row.
    node = {corner: number for number, corner in enumerate(corners, start=1)}
    joined = {
        (node[start], node[end]): (first, second)
        for start, end, first, second in zip(
            structure.start, structure.end, structure.first, structure.second, strict=True
        )
    }
    p1, p4 = 1 * 5 + 1, 1 * 5 + 2  # the window has a margin of one pixel
    assert joined[2, 6] == (p1, p4)
    # Figure 3.6: the outermost elements, and only they, cost M_max.
    outermost = {pair for pair, cost in zip(joined, structure.cost, strict=True) if cost == OUTERMOST}
    assert outermost == {
        (1, 2),
        (2, 3),
        (3, 4),
        (13, 14),
        (14, 15),
        (15, 16),
        (1, 5),
        (5, 9),
        (9, 13),
        (4, 8),
        (8, 12),
        (12, 16),
    }


@pytest.mark.parametrize(
    ("height", "width", "side"),
    [
        (60, 15, "right"),
        (15, 60, "bottom"),
        (30, 30, "left"),
        (2, 9, "right"),
        (1, 7, "right"),
        (9, 2, "left"),
    ],
)
def test_corners_and_pixels_agree_on_strips(height, width, side):
    structure = strip(height, width, side)
    if not len(structure.cost):  # two pixels wide: nothing to decide
        assert width == 2
        return
    corners, pixels = corner_network(structure), pixel_network(structure)
    k = conductances(structure)
    flux, compliance = corners.flow(k)
    dual_flux, dual_compliance = pixels.flow(k[pixels.elements])
    assert compliance == pytest.approx(dual_compliance, rel=1e-8)
    assert flux[pixels.elements] == pytest.approx(dual_flux, abs=1e-8)
    assert flux[structure.along_gap] == pytest.approx(0)


@pytest.mark.parametrize("name", TWO_ENDS)
def test_corner_and_pixel_networks_agree_on_irregular_overlaps(name):
    structure = shape(name)
    corners, pixels = corner_network(structure), pixel_network(structure)
    k = conductances(structure)
    flux, compliance = corners.flow(k)
    dual_flux, dual_compliance = pixels.flow(k[pixels.elements])
    assert compliance == pytest.approx(dual_compliance, rel=1e-8)
    assert flux[pixels.elements] == pytest.approx(dual_flux, abs=1e-8)


def test_corner_and_pixel_networks_agree_at_high_contrast():
    structure = strip(60, 15)
    corners, pixels = corner_network(structure), pixel_network(structure)
    k = conductances(structure, decades=9)
    flux, compliance = corners.flow(k)
    dual_flux, dual_compliance = pixels.flow(k[pixels.elements])
    # Nine orders of magnitude cost as many digits of sixteen.
    assert compliance == pytest.approx(dual_compliance, rel=1e-6)
    assert flux[pixels.elements] == pytest.approx(dual_flux, abs=1e-6)


def test_a_uniform_strip_conducts_along_every_corner_column():
    structure = strip(12, 5)
    flux, compliance = corner_network(structure).flow(np.full(len(structure.cost), 2.0))
    assert compliance == pytest.approx(12 / (6 * 2.0))
    across = structure.second == structure.first + 1  # such an interface lies along the seam
    assert flux[across] == pytest.approx(1 / 6)
    assert flux[~across] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("name", OTHERS)
def test_overlaps_without_exactly_two_ends_are_seen_from_pixels(name):
    structure = shape(name)
    assert corner_network(structure) is None
    pixels = pixel_network(structure)
    flux, compliance = pixels.flow(conductances(structure)[pixels.elements])
    assert compliance > 0
    assert flux.max() <= 1 + 1e-12


def test_zigzags_count_every_seam():
    assert shape("ring").zigzag() == 2 * (
        shape("ring").side.shape[0] + shape("ring").side.shape[1] - 4
    )  # there and back
    four = shape("four gaps")
    assert four.zigzag() == 2 * (four.side.shape[0] + four.side.shape[1] - 4)  # two seams in one component


@pytest.mark.parametrize("build", [corner_network, pixel_network])
@pytest.mark.parametrize("p", [1.0, 3.0])
def test_compliance_sensitivities_match_finite_differences(build, p):
    structure = strip(7, 5, seed=3)
    network = build(structure)
    rho = np.random.default_rng(4).uniform(0.2, 1, len(network.elements))
    flux, _ = network.flow(rho**p)
    sensitivity = -p * np.square(flux) / rho ** (p + 1)  # (3.13)
    for element in range(len(rho)):
        step = np.zeros(len(rho))
        step[element] = 1e-5
        difference = (network.flow((rho + step) ** p)[1] - network.flow((rho - step) ** p)[1]) / 2e-5
        assert sensitivity[element] == pytest.approx(difference, rel=1e-4, abs=1e-8)


@pytest.mark.parametrize("build", [corner_network, pixel_network])
def test_elements_that_conduct_nothing_can_be_left_out(build):
    structure = strip(20, 9)
    network = build(structure)
    k = conductances(structure)[network.elements]
    rng = np.random.default_rng(5)
    dead = rng.random(len(k)) < 0.3
    k[dead] = 1e-9  # a millionth of the least of the others
    flux, compliance = network.flow(k)
    smaller = network.restricted(~dead)
    kept = np.searchsorted(network.elements, smaller.elements)
    assert not dead[kept].any()
    assert smaller.unknowns < network.unknowns
    small_flux, small_compliance = smaller.flow(k[kept])
    assert small_compliance == pytest.approx(compliance, rel=1e-5)
    assert small_flux == pytest.approx(flux[kept], abs=1e-5)
    left_out = np.setdiff1d(np.arange(len(k)), kept)
    assert flux[left_out] == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("build", [corner_network, pixel_network])
def test_leaving_out_a_whole_row_is_refused(build):
    structure = strip(20, 9)
    network = build(structure)
    row = structure.first[network.elements] // structure.side.shape[1]
    with pytest.raises(SolverError, match=r"do not connect|join the two"):
        network.restricted(row != 8)


def test_the_label_potential_jumps_by_the_flux():
    structure = strip(20, 9)
    pixels = pixel_network(structure)
    k = conductances(structure)[pixels.elements]
    flux, _ = pixels.flow(k)
    potential = np.where(structure.side == B, 1.0, 0.0).ravel()
    potential[pixels.pixels] = pixels.potential(k)
    jump = np.abs(potential[structure.first] - potential[structure.second])[pixels.elements]
    assert jump == pytest.approx(flux)


def test_values_per_element_spread_to_interfaces():
    structure = strip(4, 3)
    right, down = structure.spread(np.arange(1.0, len(structure.cost) + 1))
    assert right.shape == (6, 4)
    assert down.shape == (5, 5)
    assert np.count_nonzero(right) == 4 * 4
    assert np.count_nonzero(down) == 5 * 3
    assert sorted(np.r_[right[right > 0], down[down > 0]]) == list(range(1, 32))


@pytest.mark.parametrize(("name", "count"), [("ell", 160), ("ring", 254)])
def test_elements_beyond_the_border_belong_to_the_structure(name, count):
    assert int((shape(name).cost == OUTERMOST).sum()) == count
