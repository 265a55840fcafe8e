"""Meshes: transforms that bend, the lines that they keep, and two planes that they bring together."""

import dataclasses

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import MeshTransform, PlaneTransform, on_canvas, reach, similarity, unbent
from toposeam.layers.mesh import (
    bent,
    find_lines,
    finer,
    flat_meshes,
    reduced_copies,
    solved,
    toned_copies,
    trial_seam,
)
from toposeam.layers.registration import Match, Residual, cheapest

SIZE = (160, 120)


def mesh(amount, base=None, seed=0):
    """A transform bent at random by up to some px."""
    shape = flat_meshes([similarity((0, 0))], [SIZE])[0].coefficients.shape
    rng = np.random.default_rng(seed)
    shifts = rng.uniform(-amount, amount, shape)
    return MeshTransform(base or similarity((30, 10), 2.0, 1.1), SIZE, 32.0, shifts)


def grid(size=SIZE, count=9):
    x, y = np.linspace(0, size[0] - 1, count), np.linspace(0, size[1] - 1, count)
    return np.stack(np.meshgrid(x, y), axis=-1)


@pytest.mark.parametrize("picture", ["camera", "brick", "text"])
def test_kernels_join_the_same_lines(picture, both_ways):
    gray = getattr(data, picture)()[:300, :400].astype(np.float32) / 255
    one, other = both_ways(lambda: find_lines(gray, 15.0))
    assert len(one) > 5
    assert one == pytest.approx(other, abs=1e-6)


def test_finer_meshes_displace_about_alike():
    size = (1600, 1200)
    coarse = flat_meshes([similarity((0, 0))], [size], coarse=True)[0]
    rows, columns = np.indices(coarse.coefficients.shape[:2])
    slow = np.stack([3 * np.sin(columns / 6), 2 * np.cos(rows / 5)], axis=-1)
    coarse = dataclasses.replace(coarse, coefficients=slow)
    (fine,) = finer([coarse])
    assert fine.cell < 0.6 * coarse.cell
    assert np.abs(fine.shift(grid(size)) - coarse.shift(grid(size))).max() < 0.1


def test_a_mesh_is_inverted():
    one = mesh(6)
    there = one.to_canvas(grid())
    assert np.abs(one.to_picture(there) - grid()).max() < 0.01
    assert np.abs(there - one.base.to_canvas(grid())).max() > 2
    assert unbent(one) is one.base
    assert unbent(one.base) is one.base


def test_displacements_are_those_of_a_spline():
    """Equal coefficients displace all alike, and linear ones linearly."""
    rows, columns = mesh(0).coefficients.shape[:2]
    down, across = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    across, down = across - (columns - 1) / 2, down - (rows - 1) / 2
    one = MeshTransform(similarity((0, 0)), SIZE, 32.0, np.stack([across, 2 * down], axis=-1))
    middle = (np.array(SIZE) - 1) / 2
    assert one.shift(grid()) == pytest.approx((grid() - middle) / 32 * [1, 2])


def test_beyond_a_picture_a_mesh_goes_on():
    one = mesh(5)
    assert one.shift(np.array([[-50.0, 60.0]])) == pytest.approx(one.shift(np.array([[0.0, 60.0]])))


def test_a_bent_picture_is_warped_like_any_other():
    layer = ts.Layer(data.camera()[:120, :160], name="camera")
    one = mesh(3)
    laid = on_canvas(layer, one)
    low, _ = reach(one, SIZE)
    assert laid.at == tuple(np.floor(low).astype(int))
    spot = np.array([[80.0, 60.0]])
    x, y = np.rint(one.to_canvas(spot)[0]).astype(int) - laid.at
    back = one.to_picture(np.array([[x + laid.at[0], y + laid.at[1]]], float))[0]
    assert abs(float(laid.image[y, x]) - float(layer.image[round(back[1]), round(back[0])])) < 25


def test_long_edges_are_found_across_changes_of_contrast():
    """The edges of a chessboard change sides at each square."""
    board = np.kron(np.indices((6, 8)).sum(axis=0) % 2, np.ones((20, 20))).astype(np.float32)
    lines = find_lines(board, 60)
    assert len(lines) >= 12  # five across, seven down
    steps = np.abs(lines[:, 2:] - lines[:, :2])
    upright = steps[:, 1] > steps[:, 0]
    assert steps[upright, 1].max() > 110
    assert steps[~upright, 0].max() > 150
    assert np.minimum(*steps.T).max() < 1


def test_noise_and_curves_have_no_long_lines():
    rng = np.random.default_rng(0)
    assert not len(find_lines(rng.normal(0.5, 0.05, (120, 160)).astype(np.float32), 30))
    y, x = np.indices((120, 160))
    disc = (np.hypot(y - 60, x - 80) < 40).astype(np.float32)
    assert not len(find_lines(disc, 30))


def two_views():
    """Matches of two views: the lower half of what they show lies nearer, by 12 px."""
    own = grid(SIZE, 17).reshape(-1, 2)
    own = own[own[:, 0] < 100]
    near = own[:, 1] > 60
    return own + np.array([60, 0]) + np.outer(near, [12, 0]), own


def test_both_planes_meet():
    first, second = two_views()
    flat = flat_meshes([similarity((0, 0)), similarity((60, 0))], [SIZE, SIZE])
    zeros = np.zeros(len(first), int)
    nothing = np.zeros((0, 4))
    found = solved(flat, [nothing, nothing], (zeros, zeros + 1, first, second), (1e9, 12, 6, 3))
    off = found[1].to_canvas(second) - found[0].to_canvas(first)
    assert np.median(np.hypot(*off.T)) < 1
    assert np.quantile(np.hypot(*off[np.abs(second[:, 1] - 60) > 20].T), 0.95) < 2


def bend_of(one, line):
    """The largest distance of a line's points from the straight line between its ends."""
    share = np.linspace(0, 1, 30)[:, None]
    points = one.to_canvas(line[:2] + share * (line[2:] - line[:2]))
    step = points[-1] - points[0]
    across = np.array([-step[1], step[0]]) / np.hypot(*step)
    return np.abs((points - points[0]) @ across).max()


def test_lines_stay_straight_where_planes_part():
    first, second = two_views()
    flat = flat_meshes([similarity((0, 0)), similarity((60, 0))], [SIZE, SIZE])
    zeros = np.zeros(len(first), int)
    line = np.array([[20.0, 5.0, 50.0, 115.0]])  # across the border of both planes
    kept = [line + np.array([60, 0, 60, 0]), line]
    bends = []
    for lines in ([np.zeros((0, 4))] * 2, kept):
        found = solved(flat, lines, (zeros, zeros + 1, first, second), (1e9, 12, 6, 3))
        bends.append(max(bend_of(one, own[0]) for one, own in zip(found, kept, strict=True)))
    assert bends[0] > 1.5
    assert bends[1] < 0.5 * bends[0]


@pytest.fixture(scope="module")
def walked():
    """Two views of a picture whose lower part is 14 px nearer, with a smooth way between."""
    whole = data.astronaut()[:240, :420]
    y, x = np.indices((240, 280), dtype=float)
    second = 14 / (1 + np.exp(-(y - 130) / 18))
    from scipy.ndimage import map_coordinates

    moved = np.stack(
        [map_coordinates(whole[..., k].astype(float), [y, x + 120 + second], order=1) for k in range(3)], -1
    )
    return [ts.Layer(whole[:, :280]), ts.Layer(np.clip(moved, 0, 255).astype(np.uint8))], second[:, 0]


def test_copies_get_the_same_tones_once():
    whole = data.astronaut()[:300, :400] * 0.8
    darkening = np.linspace(1.0, 0.7, 260)[np.newaxis, :, np.newaxis]
    views = [
        ts.Layer(whole[:, :260].astype(np.uint8)),
        ts.Layer((whole[:, 140:] * darkening).astype(np.uint8)),
    ]
    copies, scales = reduced_copies(views)
    plain = (similarity((0, 0)), similarity((140, 0)))
    toned = toned_copies(copies, scales, plain, max(scales))
    apart = [
        np.abs(one.image[:, 140:].mean(axis=0) - other.image[:, :120].mean(axis=0)).mean()
        for one, other in (copies, toned)
    ]
    assert apart[1] < 0.4 * apart[0]
    assert float(trial_seam(toned, scales, plain, 1)[0].cost) < float(
        trial_seam(copies, scales, plain, 1)[0].cost
    )
    away = (similarity((0, 0)), similarity((900, 0)))
    assert [
        one.image is other.image
        for one, other in zip(copies, toned_copies(copies, scales, away, 1), strict=True)
    ]
    assert trial_seam(copies, scales, away, 1) is None


@pytest.mark.medium
def test_a_bent_pair_has_a_cheaper_seam(walked):
    views, second = walked
    rng = np.random.default_rng(1)
    own = rng.uniform((2, 2), (140, 236), (150, 2))
    first = own + np.stack([120 + np.interp(own[:, 1], np.arange(240), second), np.zeros(150)], axis=1)
    plain = (similarity((0, 0)), similarity((127, 0)))
    copies, scales = reduced_copies(views)
    before = float(trial_seam(copies, scales, plain, max(scales))[0].cost)
    sizes = [(280, 240)] * 2
    found, _ = bent(copies, scales, plain, sizes, (first, own), before)
    after = float(trial_seam(copies, scales, found, max(scales))[0].cost)
    assert all(isinstance(one, MeshTransform) for one in found)
    assert after < 0.3 * before


@pytest.mark.medium
@pytest.mark.parametrize(("near", "computed"), [(0.0, 0), (1.0, 1)])
def test_who_needs_little_bending_needs_no_other_plane(walked, near, computed):
    views, second = walked
    own = np.random.default_rng(1).uniform((2, 2), (140, 236), (150, 2))
    first = own + np.stack([120 + np.interp(own[:, 1], np.arange(240), second), np.zeros(150)], axis=1)
    transforms = (similarity((0, 0)), similarity((127, 0)))
    placement = ts.layers.Placement(
        layers=tuple(map(on_canvas, views, transforms)),
        model="plane",
        sizes=((280, 240),) * 2,
        transforms=transforms,
        numbers=(0, 1),
        correlations={},
        residuals={(0, 1): Residual(0.5, 1.0, 150, 150)},
        misfit=0.5,
    )
    asked = []

    def others():
        asked.append(True)
        yield placement

    found = cheapest(views, placement, others(), [Match(first, own, 1.0)], near=near)
    assert all(isinstance(one, MeshTransform) for one in found.transforms)
    assert len(asked) == computed


@pytest.mark.medium
def test_what_gains_nothing_is_not_bent(walked):
    whole = data.astronaut()[:200, :400]
    views = [ts.Layer(whole[:, :260]), ts.Layer(whole[:, 130:])]
    plain = (PlaneTransform(np.eye(3)), similarity((130, 0)))
    copies, scales = reduced_copies(views)
    own = np.random.default_rng(0).uniform((0, 0), (125, 199), (60, 2))
    cost = float(trial_seam(copies, scales, plain, 1)[0].cost)
    assert (
        bent(copies, scales, plain, [(260, 200), (270, 200)], (own + np.array([130, 0]), own), cost)[0]
        == plain
    )


@pytest.mark.medium
def test_placing_bends_unless_a_model_is_asked_for(walked):
    views, _ = walked
    found = ts.find_places(views)
    assert 3 < found.bent < 40
    assert found.misfit < 2
    assert [unbent(one) is one for one in found.transforms] == [False, False]
    asked = ts.find_places(views, model="plane")
    assert asked.bent == 0
    costs = [ts.stitch(one.layers, match_shading=True, blend="multiband").cost for one in (found, asked)]
    assert costs[0] < 0.6 * costs[1]


@pytest.mark.medium
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_picture_that_lies_turned_is_bent_as_it_is_upright(walked, quarters):
    views, _ = walked
    plain = ts.find_places(views)
    turned = dataclasses.replace(views[1], image=np.rot90(views[1].image, quarters))
    found = ts.find_places([views[0], turned])
    assert found.bent == plain.bent > 3
    for one, other in zip(found.layers, plain.layers, strict=True):
        assert one.at == other.at
        np.testing.assert_array_equal(one.image, other.image)
