"""Equations (2.4) and (3.22) on pixels whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

import toposeam as ts
from toposeam.seam.problem import MatchCost
from toposeam.seam.problem.match_cost import match_cost
from toposeam.seam.problem.posing import seam_problem


def costs(a, b, law="gradient", **options):
    """Costs of a strip's interfaces on the image grid, without the window's margin."""
    problem, _ = seam_problem(a, b, None, None, "right", MatchCost(law=law, **options))
    return problem.right[1:-1, 1:-1], problem.down[1:-1, 1:-1]


def test_colour_costs_sum_the_differences_of_both_pixels():
    a = np.zeros((2, 3))
    b = np.array([[0.1, 0.2, 0.4], [0.0, 0.3, 0.5]])
    right, down = costs(a, b, law="colour", length=1e-6)
    np.testing.assert_allclose(right, [[0.3, 0.6], [0.3, 0.8]], atol=2e-6)
    np.testing.assert_allclose(down, [[0.1, 0.5, 0.9]], atol=2e-6)


def test_what_cannot_be_worse_costs_no_more():
    """Beyond some mismatch a seam is seen, whatever the step: so few pixels do not outweigh a long way."""
    flat = np.zeros((12, 12, 3))
    faint, plain, plainest = (costs(flat, flat + step, law="natural")[0][6, 5] for step in (0.1, 0.5, 1.0))
    assert plain == plainest
    assert plain > 2 * faint


def test_gradient_costs_divide_by_four_gradients_along_the_pair():
    a = np.array([[0.0, 0.2, 0.6]])
    b = np.array([[0.1, 0.2, 0.4]])
    right, _ = costs(a, b, epsilon=1e-6, length=1e-9)
    # Central differences, at the ends of a picture that goes on as it ends: |G_A| = .1, .3, .2 and |G_B| =
    # .05, .15, .1.
    np.testing.assert_allclose(
        right, [[0.1 / (0.1 + 0.3 + 0.05 + 0.15), 0.2 / (0.3 + 0.2 + 0.15 + 0.1)]], rtol=1e-4
    )


def slopes(image, there, axis):
    """Changes of each pixel along an axis, by the definition: half of the steps to those beside it that are
    there.
    """
    found, framed = np.zeros(image.shape), np.pad(there, 1)
    step = np.eye(there.ndim, dtype=int)[axis]
    for pixel in np.argwhere(there):
        ends = [place for place in (pixel - step, pixel, pixel + step) if framed[tuple(place + 1)]]
        found[tuple(pixel)] = (image[tuple(ends[-1])] - image[tuple(ends[0])]) / 2
    return np.linalg.norm(found, axis=-1)


@pytest.mark.parametrize("shape", [(7, 9, 3), (1, 8, 2), (40, 60, 4), (3, 5, 6, 2)])
def test_gradients_look_at_pixels_that_are_there(shape):
    rng = np.random.default_rng(2)
    a, b = rng.random((2, *shape)).astype(np.float32)
    everywhere, box = np.ones(shape[:-1], bool), np.zeros(shape[:-1], bool)
    box[tuple(slice(side // 4, side - side // 3) for side in box.shape)] = True
    scattered = rng.random(shape[:-1]) < 0.7
    kinds = (scattered, everywhere, everywhere), (everywhere,) * 3, (box, everywhere, box), (box,) * 3
    for on_a, on_b, told in kinds:  # beyond a box anything may be said
        axes = tuple(range(len(shape) - 1))
        found = match_cost(a, b, None, on_a, on_b, MatchCost(law="gradient"), axes=axes)
        difference = np.linalg.norm(a - b, axis=-1)
        for axis, cost in zip(axes, found, strict=True):
            steep = slopes(a, on_a, axis) + slopes(b, on_b, axis) + MatchCost(law="gradient").epsilon / 2
            s, t = ((slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None)))
            expected = (difference[s] + difference[t]) / (steep[s] + steep[t]) + MatchCost(
                law="gradient"
            ).length
            compared = told[s] & told[t]
            np.testing.assert_allclose(cost[compared], expected[compared], rtol=1e-4)


def test_norms_are_euclidean_over_any_number_of_channels():
    a = np.zeros((3, 4, 5))
    b = np.zeros((3, 4, 5))
    b[..., :2] = [0.3, 0.4]
    right, _ = costs(a, b, law="colour", length=1e-9)
    np.testing.assert_allclose(right, 1.0, rtol=1e-6)


def test_gray_costs_as_much_as_the_same_gray_in_one_channel():
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 6, 5))
    for flat, deep in zip(costs(a, b), costs(a[..., None], b[..., None]), strict=True):
        np.testing.assert_array_equal(flat, deep)


def test_equal_flat_pixels_cost_the_flat_value():
    a = np.full((4, 4), 0.5)
    for flat in (0.0, 3.0):
        right, down = costs(a, a, flat=flat, length=1e-3)
        np.testing.assert_allclose(right, flat + 1e-3, rtol=1e-5)
        np.testing.assert_allclose(down, flat + 1e-3, rtol=1e-5)


def test_weights_multiply_and_excluded_pixels_are_avoided():
    rng = np.random.default_rng(2)
    a, b = rng.random((2, 12, 9))
    avoid = np.zeros((12, 9), bool)
    avoid[:, 1:4] = True
    seam = ts.find_seam(a, b, avoid=avoid)
    cut = seam.labels[:, 1:] != seam.labels[:, :-1]
    assert not cut[:, :4].any()
    weight = np.ones((12, 9))
    weight[:, 4:] = 100.0
    assert not (np.diff(ts.find_seam(a, b, weight=weight).labels, axis=1)[:, 4:]).any()


def test_an_interface_takes_the_mean_weight_of_its_two_pixels():
    rng = np.random.default_rng(3)
    a, b = rng.random((2, 3, 4))
    weight = np.array([[1.0, 2.0, 4.0, 8.0]] * 2 + [[10.0] * 4])
    plain = seam_problem(a, b, None, None, "right", MatchCost(law="gradient"))[0]
    weighed = seam_problem(a, b, None, None, "right", MatchCost(law="gradient"), weight)[0]
    across, along = weighed.right[1:-1, 1:-1], weighed.down[1:-1, 1:-1]
    np.testing.assert_allclose(across[:2], [[1.5, 3, 6]] * plain.right[1:3, 1:-1], rtol=1e-6)
    np.testing.assert_allclose(across[2], 10 * plain.right[3, 1:-1], rtol=1e-6)
    np.testing.assert_allclose(along[0], [1, 2, 4, 8] * plain.down[1, 1:-1], rtol=1e-6)
    np.testing.assert_allclose(along[1], [5.5, 6, 7, 9] * plain.down[2, 1:-1], rtol=1e-6)


def test_values_of_a_one_pixel_overlap_count_twice():
    # a: columns 0-2, b: columns 2-4. Both borders of the one shared column cost what it alone says.
    mask_a, mask_b = (np.tile(columns, (3, 1)) for columns in ([1, 1, 1, 0, 0], [0, 0, 1, 1, 1]))
    a, b = np.zeros((3, 5)), np.zeros((3, 5))
    b[:, 2] = [0.1, 0.2, 0.4]
    problem, _ = seam_problem(a, b, mask_a, mask_b, "right", MatchCost(law="colour", length=1e-6))
    left = 2 - problem.overlap.start[1]  # the shared column on the window
    for border in (left - 1, left):
        np.testing.assert_allclose(problem.right[1:-1, border], [0.2, 0.4, 0.8], atol=2e-6)
    np.testing.assert_allclose(problem.down[1:-1, left], [0.3, 0.6], atol=2e-6)
    # And so does its weight.
    weighed, _ = seam_problem(
        a, b, mask_a, mask_b, "right", MatchCost(law="colour", length=1e-6), np.full((3, 5), 3.0)
    )
    np.testing.assert_allclose(weighed.right, 3 * problem.right, rtol=1e-6)


def test_excluding_a_whole_row_from_side_to_side_says_so():
    a = np.random.default_rng(0).random((9, 9))
    avoid = np.zeros((9, 9), bool)
    avoid[4] = True
    with pytest.raises(ts.OverlapError, match="no seam avoids"):
        ts.find_seam(a, 1 - a, avoid=avoid)


@pytest.mark.parametrize(
    "options", [{"epsilon": 0.0}, {"flat": -1.0}, {"length": 0.0}, {"length": float("nan")}]
)
def test_options_out_of_range_are_refused(options):
    with pytest.raises(ts.OptionError, match=next(iter(options))):
        MatchCost(**options)


def test_a_corner_of_one_interface_counts_its_own_values_twice():
    """One shared pixel with a's ground on its left and b's above: no interface on its other sides."""
    on_a, on_b = np.zeros((2, 3, 3), bool)
    on_a[1, 0] = on_a[1, 1] = on_b[0, 1] = on_b[1, 1] = True
    a, b = np.zeros((2, 3, 3))
    b[1, 1] = 0.4
    b[0, 1] = a[1, 0] = 0.9  # what only one of them covers counts for nothing
    problem, _ = seam_problem(a, b, on_a, on_b, "right", MatchCost(law="colour", length=1e-6))
    assert problem.right[problem.right > 0] == pytest.approx([0.8], abs=1e-5)
    assert problem.down[problem.down > 0] == pytest.approx([0.8], abs=1e-5)
