"""Pictures adjusted at once to the points that pairs of them share, all of which are made up here."""

import dataclasses
import itertools
import math
from functools import partial

import numpy as np
import pytest
from rendered import around, before_a_wall, corner_error

from toposeam.layers.canvas import NOWHERE, PlaneTransform
from toposeam.layers.registration import Match, adjust_cameras, adjust_plane, applied, left_over
from toposeam.layers.registration.bundle_adjustment import _Points, _Problem, spanning_tree
from toposeam.layers.registration.perspective import ModelFit, _explains, _fit_agreeing

SIZE = (360, 240)
FOCAL = 400.0
TO_RAYS = np.array([[1, 0, -(SIZE[0] - 1) / 2], [0, 1, -(SIZE[1] - 1) / 2], [0, 0, FOCAL]])
#: Yaw, pitch and roll of the cameras, degrees.
ROW = [(0, 1, 0.5), (25, -1, 0), (48, 0, -1), (72, 1.5, 0.7), (97, 0, 0)]
RING = [(30 * k, (-1) ** k, 0.6 * (k % 3 - 1)) for k in range(12)]
ROWS = [(26 * column + row, 20 * row, 1 - row) for row in range(2) for column in range(3)]
#: x, y, distance, yaw, pitch and roll of cameras before a wall.
WALL = [
    *((0, 0, 1.0, 0, 0, 0), (190, 10, 1.05, 8, -5, 1), (370, -10, 0.95, -7, 6, -2)),
    *((20, 140, 1.0, 4, 9, 2), (200, 150, 1.1, -9, 3, 0), (380, 130, 1.0, 3, -8, 1)),
]


def sizes_of(views):
    return np.tile(np.array(SIZE, float), (len(views), 1))


def match(views, i, j, rng, noise=0.3, count=60, elsewhere=(0, 0)):
    """Points that two pictures share, or that the second one shows so far off; None where these are few."""
    first = rng.uniform(0, 1, (4000, 2)) * (np.array(SIZE) - 1)
    there = views[i].to_canvas(first)
    second = views[j].to_picture(there)
    shown = np.flatnonzero(((second > 0) & (second < np.array(SIZE) - 1)).all(axis=1))
    if len(shown) < 300:
        return None
    first, second = first[shown[:count]], second[shown[:count]] + np.array(elsewhere)
    if isinstance(views[i], PlaneTransform):
        matrix = np.linalg.inv(views[i].matrix) @ views[j].matrix
    else:
        one, other = (np.diag([1, 1, view.focal / FOCAL]) @ TO_RAYS for view in (views[i], views[j]))
        matrix = np.linalg.inv(one) @ views[i].rotation.T @ views[j].rotation @ other
    back = np.eye(3)
    back[:2, 2] = -np.array(elsewhere)
    matrix = matrix @ back
    off = [points + rng.normal(0, noise, points.shape) for points in (first, second)]
    return Match(*off, np.nan, matrix=matrix / matrix[2, 2], features=count, share=0.7, uncertainty=0.5)


def matches_of(views, seed=0, noise=0.3):
    rng = np.random.default_rng(seed)
    count = len(views)
    found = {(i, j): match(views, i, j, rng, noise) for i in range(count) for j in range(i + 1, count)}
    return {pair: one for pair, one in found.items() if one is not None}


def turned_off(bundle, views):
    """Largest angle, degrees, between turns that were found and true ones."""
    own, true = bundle.rotations, np.array([view.rotation for view in views])
    between = np.einsum("ij,kjl,klm->kim", true[0] @ own[0].T, own, np.swapaxes(true, 1, 2))
    return np.degrees(np.arccos(np.clip((np.trace(between, axis1=1, axis2=2) - 1) / 2, -1, 1))).max()


def shared_plane(bundle):
    """Transforms of pictures to the plane of a bundle."""
    centre = np.array([[1, 0, -(SIZE[0] - 1) / 2], [0, 1, -(SIZE[1] - 1) / 2], [0, 0, 1]])
    return [PlaneTransform(matrix @ centre) for matrix in bundle.matrices]


@pytest.mark.medium
@pytest.mark.parametrize(
    ("turns", "off", "seed"),
    [(ROW, 0.01, 0), (RING, 0.001, 0), (ROWS, 0.01, 1)],
    ids=["row", "ring", "rows"],
)
def test_cameras_and_their_focal_length_are_found(turns, off, seed):
    views = around(FOCAL, turns, SIZE)
    matches = matches_of(views, seed)
    assert len(matches) == {5: 4, 12: 12, 6: 11}[len(views)]
    bundle = adjust_cameras(sizes_of(views), matches)
    assert bundle.family == "rotation"
    assert bundle.focal == pytest.approx(FOCAL, rel=off)
    assert abs(bundle.distortion) < 0.004
    # A row is as much too long as its focal length.
    assert turned_off(bundle, views) < (0.15 if turns is RING else 0.5)
    assert left_over(bundle, matches) < 0.7  # 0.3 px in both pictures, x and y


def test_the_field_of_view_is_between_the_farthest_corners():
    views = around(FOCAL, ROW, SIZE)
    bundle = adjust_cameras(sizes_of(views), matches_of(views, noise=0.0), focal=FOCAL, fixed=True)
    corners = np.array([[x, y, FOCAL] for x in (-180, 180) for y in (-120, 120)]) / math.sqrt(
        180**2 + 120**2 + FOCAL**2
    )
    rays = [corner @ view.rotation.T for view in (views[0], views[-1]) for corner in corners]
    largest = max(math.acos(float(a @ b)) for a in rays for b in rays if a @ b < 0.9)
    assert bundle.field_of_view == pytest.approx(math.degrees(largest), abs=0.3)


def test_without_noise_cameras_are_exact():
    views = around(FOCAL, ROWS, SIZE)
    bundle = adjust_cameras(sizes_of(views), matches_of(views, noise=0.0))
    assert bundle.focal == pytest.approx(FOCAL, rel=1e-3)  # the usual one draws at it a little
    assert turned_off(bundle, views) < 0.02


def test_zoomed_pictures_get_focal_lengths_of_their_own():
    zooms = [1.0, 1.6, 1.0, 1.0, 1.0, 0.8]
    views = around(FOCAL, ROWS, SIZE)
    views = [dataclasses.replace(view, focal=FOCAL * zoom) for view, zoom in zip(views, zooms, strict=True)]
    bundle = adjust_cameras(sizes_of(views), matches_of(views))
    np.testing.assert_allclose(bundle.focals, FOCAL * np.array(zooms), rtol=0.01)
    assert turned_off(bundle, views) < 0.3
    again = adjust_cameras(sizes_of(views), matches_of(views), start=bundle)
    np.testing.assert_allclose(again.focals, bundle.focals, rtol=1e-3)
    # Where all are alike, they stay alike to the last bit.
    plain = around(FOCAL, ROWS, SIZE)
    assert len(set(adjust_cameras(sizes_of(plain), matches_of(plain)).focals)) == 1


@pytest.mark.medium
@pytest.mark.parametrize("lens", [-0.03, 0.02])
def test_distortion_is_found(lens):
    views = around(FOCAL, ROWS, SIZE, lens)
    matches = matches_of(views)
    bundle = adjust_cameras(sizes_of(views), matches)
    assert bundle.distortion == pytest.approx(lens, abs=0.004)
    assert bundle.focal == pytest.approx(FOCAL, rel=0.01)
    assert turned_off(bundle, views) < 0.4
    straight = adjust_cameras(sizes_of(views), matches, distortion=0.0)
    assert straight.distortion == 0
    assert left_over(straight, matches) > 1.5 * left_over(bundle, matches)


def test_what_is_said_of_the_camera_is_taken():
    views = around(FOCAL, ROWS[:3], SIZE, -0.02)
    matches = matches_of(views)
    bundle = adjust_cameras(sizes_of(views), matches, focal=430.0, fixed=True, distortion=-0.02)
    assert bundle.focal == pytest.approx(430, abs=1e-9)
    assert bundle.distortion == -0.02
    about = adjust_cameras(sizes_of(views), matches, focal=430.0, distortion=-0.02)
    assert 390 < about.focal < 425


def test_a_fixed_focal_length_is_that_of_zoomed_pictures_too():
    views = around(FOCAL, ROWS[:3], SIZE)
    views[1] = dataclasses.replace(views[1], focal=1.5 * FOCAL)
    matches = matches_of(views)
    fixed = adjust_cameras(sizes_of(views), matches, focal=FOCAL, fixed=True, distortion=0.0)
    np.testing.assert_allclose(fixed.focals, FOCAL, rtol=1e-9)
    about = adjust_cameras(sizes_of(views), matches, focal=FOCAL, distortion=0.0)
    np.testing.assert_allclose(about.focals / about.focals[0], [1, 1.5, 1], rtol=0.03)


@pytest.mark.medium
def test_a_bundle_is_a_start_for_the_next_one():
    views = around(FOCAL, ROWS, SIZE, -0.03)
    matches = matches_of(views)
    first = adjust_cameras(sizes_of(views), matches)
    again = adjust_cameras(sizes_of(views), matches, start=first)
    assert again.middle == first.middle
    assert again.focal == pytest.approx(first.focal, rel=1e-3)
    assert again.distortion == pytest.approx(first.distortion, abs=1e-3)
    assert again.matrices == pytest.approx(first.matrices, abs=2e-3)


@pytest.mark.parametrize("seed", range(2))
def test_homographies_are_found_up_to_a_common_one(seed):
    views = before_a_wall(FOCAL, WALL, SIZE)
    matches = matches_of(views, seed)
    bundle = adjust_plane(sizes_of(views), matches)
    assert bundle.family == "plane"
    assert corner_error(shared_plane(bundle), views, [SIZE] * len(views)) < 1
    assert left_over(bundle, matches) < 0.7
    exact = adjust_plane(sizes_of(views), matches_of(views, noise=0.0))
    assert corner_error(shared_plane(exact), views, [SIZE] * len(views)) < 1e-3


def test_strays_among_the_points_move_nothing():
    views = before_a_wall(FOCAL, WALL, SIZE)
    rng = np.random.default_rng(0)
    matches = {}
    for pair, one in matches_of(views).items():
        second = one.second.copy()
        second[:6] = rng.uniform(0, 200, (6, 2))
        matches[pair] = dataclasses.replace(one, second=second)
    bundle = adjust_plane(sizes_of(views), matches)
    assert corner_error(shared_plane(bundle), views, [SIZE] * len(views)) < 1.5


@pytest.mark.parametrize("family", ["plane", "rotation"])
def test_derivatives_are_those_of_finite_differences(family):
    views = around(FOCAL, ROW[:3], SIZE, -0.02)
    matches = matches_of(views)
    rotation = family == "rotation"
    problem = _Problem(
        sizes_of(views), _Points.of(matches), family, 1, 380.0, 0.3, free_focal=rotation,
        free_distortion=rotation,
    )  # fmt: skip
    adjusted = adjust_cameras if rotation else adjust_plane
    bundle = adjusted(sizes_of(views), matches)
    unknowns = problem.unknowns(bundle.matrices, bundle.focals)
    unknowns[1] = -0.01 if rotation else 0.0
    free = np.flatnonzero(problem.free)
    unknowns[free] += np.random.default_rng(1).normal(0, 1e-3, len(free))
    residuals = problem.residuals(unknowns)
    values, columns = problem.jacobian(unknowns)
    whole = np.zeros((len(residuals), len(unknowns)))
    points = whole[:-1].reshape(-1, 2, len(unknowns))
    for pair, (start, end) in enumerate(itertools.pairwise(problem.points.starts)):
        points[start:end, :, columns[pair]] = values[start:end]
    whole[-1, 0] = 1 / problem.deviation
    weights = np.random.default_rng(2).uniform(0, 1, len(residuals))
    normal, slope = problem.equations(unknowns, weights, residuals)
    assert normal == pytest.approx(whole.T @ (weights[:, np.newaxis] * whole))
    assert slope == pytest.approx(whole.T @ residuals)
    assert problem.equations(unknowns, weights, residuals, dense=0)[0].toarray() == pytest.approx(normal)
    jacobian = whole[:-1, free]
    assert len(free) == (2 + 2 * 3 if rotation else 2 * 8)
    for column, number in enumerate(free):
        step = np.zeros(len(unknowns))
        step[number] = 1e-5
        slope = (problem.residuals(unknowns + step) - problem.residuals(unknowns - step))[:-1] / 2e-5
        largest = np.abs(slope).max()
        assert largest > 0, number
        assert np.abs(jacobian[:, column] - slope).max() < 1e-4 * largest + 1e-6, number


def test_points_of_a_pair_are_apart_by_what_was_added():
    views = before_a_wall(FOCAL, WALL[:2], SIZE)
    matches = matches_of(views, noise=0.0)
    bundle = adjust_plane(sizes_of(views), matches)
    one = matches[0, 1]
    moved = dataclasses.replace(one, second=one.second + np.array([3.0, -4.0]))
    assert bundle.distances((0, 1), moved) == pytest.approx(np.full(60, 5.0), abs=1e-3)
    far = dataclasses.replace(one, second=one.second + 500.0)
    assert left_over(bundle, {(0, 1): far}) == pytest.approx(20)


@pytest.mark.parametrize(("wrong", "left"), [(6, 0), (7, 20 / math.sqrt(54))])
def test_a_tenth_of_the_points_of_a_pair_may_be_wrong(wrong, left):
    views = before_a_wall(FOCAL, WALL[:2], SIZE)
    matches = matches_of(views, noise=0.0)
    bundle = adjust_plane(sizes_of(views), matches)
    one = matches[0, 1]
    second = one.second + np.where(np.arange(60) < wrong, 500.0, 0.0)[:, np.newaxis]
    found = left_over(bundle, {(0, 1): dataclasses.replace(one, second=second)})
    assert found == pytest.approx(left, abs=1e-3)


def test_the_tree_takes_the_strongest_pairs():
    strengths = {(0, 1): 5.0, (1, 2): 4.0, (0, 2): 1.0, (2, 3): 3.0, (1, 3): 2.0, (3, 4): 0.5}
    middle, order, before = spanning_tree(5, strengths)
    assert {tuple(sorted((int(k), int(before[k])))) for k in order[1:]} == {(0, 1), (1, 2), (2, 3), (3, 4)}
    assert middle == 2
    assert sorted(order.tolist()) == list(range(5))


ADJUST = {"rotation": adjust_cameras, "plane": adjust_plane}


def voted(views, matches, family):
    sizes = sizes_of(views)
    given = dict(sorted(matches.items()))
    return _fit_agreeing(
        sizes, given, lambda own, start=None: partial(ADJUST[family], sizes, own)(start=start)
    )


@pytest.mark.medium
@pytest.mark.parametrize("family", ADJUST)
@pytest.mark.parametrize("seed", range(2))
def test_pairs_that_match_elsewhere_are_outvoted(family, seed):
    views = around(FOCAL, ROWS, SIZE) if family == "rotation" else before_a_wall(FOCAL, WALL, SIZE)
    matches = matches_of(views, seed)
    rng = np.random.default_rng(seed)
    wrong = {(0, 1): (70, 0), (2, len(views) - 1): (-10, 60)}
    for (i, j), elsewhere in wrong.items():
        matches[i, j] = dataclasses.replace(match(views, i, j, rng, elsewhere=elsewhere), features=25)
    fit = voted(views, matches, family)
    assert set(fit.outvoted) == set(wrong)
    assert fit.clear
    assert set(fit.matches) == set(matches) - set(wrong)
    assert left_over(fit.bundle, fit.matches) < 0.7


@pytest.mark.medium
def test_where_all_pairs_agree_none_is_outvoted():
    views = around(FOCAL, ROWS, SIZE)
    matches = matches_of(views)
    fit = voted(views, matches, "rotation")
    assert fit.outvoted == ()
    assert fit.clear
    assert set(fit.matches) == set(matches)


def test_where_as_much_speaks_for_as_against_nothing_is_clear():
    """Of two pairs that hold a picture one is wrong, and nobody can say which."""
    views = before_a_wall(FOCAL, WALL, SIZE)
    matches = {pair: one for pair, one in matches_of(views).items() if 5 not in pair or pair == (4, 5)}
    matches[2, 5] = match(views, 2, 5, np.random.default_rng(0), elsewhere=(80, 20))
    fit = voted(views, matches, "plane")
    assert fit.outvoted
    assert set(fit.outvoted) <= {(2, 5), (4, 5)}
    assert not fit.clear
    assert set(fit.matches) == set(matches)


def test_without_a_loop_a_wrong_pair_cannot_be_told():
    views = around(FOCAL, ROW[:3], SIZE)
    rng = np.random.default_rng(0)
    matches = {(0, 1): match(views, 0, 1, rng), (1, 2): match(views, 1, 2, rng, elsewhere=(30, 0))}
    fit = voted(views, matches, "plane")
    assert fit.outvoted == ()
    assert fit.clear
    seen = applied(np.linalg.inv(fit.bundle.matrices[2]) @ fit.bundle.matrices[1], np.zeros((1, 2)))
    true = views[2].to_picture(views[1].to_canvas((np.array(SIZE) - 1) / 2)) - (np.array(SIZE) - 1) / 2
    assert true[0] != NOWHERE
    assert seen[0] - true == pytest.approx([30, 0], abs=1)


def test_one_wrong_pair_of_three_is_told_but_not_which():
    """It pulls the others off, too: what is usual then is not taken from these."""
    views = before_a_wall(FOCAL, WALL[:1] + WALL[3:5], SIZE)
    matches = matches_of(views)
    assert len(matches) == 3
    assert voted(views, matches, "plane").outvoted == ()
    matches[0, 2] = match(views, 0, 2, np.random.default_rng(0), elsewhere=(80, 20))
    fit = voted(views, matches, "plane")
    assert fit.outvoted
    assert not fit.clear


def test_a_camera_that_outvotes_more_pairs_explains_nothing():
    """Whatever is left of the pairs, which nobody looks at."""
    matches = {(0, number): None for number in range(1, 8)}

    def fit(outvoted):
        wrong = tuple(matches)[:outvoted]
        kept = {pair: one for pair, one in matches.items() if pair not in wrong}
        return ModelFit(bundle=None, matches=kept, outvoted=wrong, clear=True)

    assert not _explains(fit(2), fit(1), matches)
