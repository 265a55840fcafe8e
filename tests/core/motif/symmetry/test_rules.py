"""Every rule of repetition, tested on the repeated picture."""

from __future__ import annotations

import numpy as np
import pytest

import toposeam as ts
from toposeam.heat.plate_joints import Joint
from toposeam.motif.symmetry import GENERATORS, HEXAGONAL, joint, move_onto_axes, operations, symmetry
from toposeam.motif.symmetry.rules import permutation

#: How many operations each group has modulo the translations of its cell (centred cells have twice their
#: point group's).
ORDERS = {
    "p1": 1,
    "p2": 2,
    "pm": 2,
    "pg": 2,
    "cm": 4,
    "pmm": 4,
    "pmg": 4,
    "pgg": 4,
    "cmm": 8,
    "p4": 4,
    "p4m": 8,
    "p4g": 8,
    "p3": 3,
    "p3m1": 6,
    "p31m": 6,
    "p6": 6,
    "p6m": 12,
}
ONE_STEP = 1 / 255


def _motif(repeat, size=48, seed=3, **options):
    return ts.generate_motif(size, repeat=repeat, seed=seed, layers=2, iterations=12, **options)


@pytest.mark.parametrize(("repeat", "order"), ORDERS.items())
def test_groups_have_their_order(repeat, order):
    assert len(operations(repeat)) == order


@pytest.mark.medium
@pytest.mark.parametrize("repeat", GENERATORS)
def test_generators_leave_the_repeated_picture_as_it_is(repeat):
    h = 48
    w = 48 if repeat.startswith("p4") else 56
    picture = ts.repeat(_motif(repeat, (h, w)), (2, 2))
    y, x = np.mgrid[: 2 * h, : 2 * w]
    for (a, b), (c, d), (t, u) in GENERATORS[repeat]:
        # Pixel centres lie at x + 1/2, y + 1/2.
        to_x = np.floor(a * (x + 0.5) + b * (y + 0.5) + t * w / 2).astype(int) % (2 * w)
        to_y = np.floor(c * (x + 0.5) + d * (y + 0.5) + u * h / 2).astype(int) % (2 * h)
        assert np.abs(picture[to_y, to_x] - picture).max() <= ONE_STEP


@pytest.mark.medium
@pytest.mark.parametrize("repeat", HEXAGONAL)
def test_hexagonal_generators_keep_the_repeated_picture(repeat):
    """On 2n × 2n pixels a tile has lattice node (u, v) in row v and column 2u - v, and turns by 60° take
    nodes to nodes.
    """
    n = 32
    picture = ts.repeat(_motif(repeat, n, edge="soft"), (2, 2), size=(2 * n, 2 * n))
    v, u = np.mgrid[: 4 * n, : 2 * n]
    for (a, b), (c, d), _ in HEXAGONAL[repeat]:
        to_u, to_v = a * u + b * v, c * u + d * v
        turned = picture[to_v % (4 * n), (2 * to_u - to_v) % (4 * n)]
        assert np.abs(turned - picture[v, (2 * u - v) % (4 * n)]).max() <= ONE_STEP


@pytest.mark.medium
@pytest.mark.parametrize("repeat", HEXAGONAL)
def test_hexagonal_tiles_have_true_geometry(repeat):
    """A turn of the printed picture itself, square pixels, interpolated: p6 by 60°, p3 by 120°."""
    from scipy.ndimage import affine_transform

    motif = _motif(repeat, 32)
    size = (
        832,
        480,
    )  # 832 / 480 is √3 within 0.1 %; many pixels per element, so that interpolation costs nothing
    pattern = np.tile(motif.resampled(size)[0], (2, 3)).astype(float)
    # A lattice point, which lies a quarter element from the tile's corner, one tile to the right.
    centre = np.array([size[0] / (4 * 32) - 0.5 + size[0] / 2, size[1] / (4 * 32) - 0.5 + 1.5 * size[1]])
    angle = np.deg2rad(60 if repeat in ("p6", "p6m") else 120)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    window = (
        slice(int(centre[0]) - 250, int(centre[0]) + 250),
        slice(int(centre[1]) - 250, int(centre[1]) + 250),
    )
    turned = affine_transform(pattern, turn, centre - turn @ centre, order=1)
    # 0.1 % of 250 pixels is a quarter of a pixel, at edges a pixel wide per 15.
    assert np.abs(turned - pattern)[window].max() < 0.04
    assert pattern[window].std() > 0.1


def _steps(picture, axis):
    """The largest channel's step between neighbours along an axis, that axis first."""
    return np.moveaxis(np.abs(np.diff(picture, axis=axis)).max(axis=2), axis, 0)


@pytest.mark.medium
@pytest.mark.parametrize("repeat", [r for r in ts.motif.REPEATS if r != "none"])
def test_no_border_can_be_seen(repeat):
    """The colour step's 99th percentile across a border is at most that across the most conspicuous line of
    the same length inside.
    """
    motif = ts.generate_motif(64, repeat=repeat, seed=3, iterations=24)
    picture = ts.repeat(motif, (3, 3))
    for axis, side in enumerate(motif.densities.shape[1:]):
        steps = np.percentile(_steps(picture, axis), 99, axis=1)
        border = np.arange(len(steps)) % side == side - 1
        assert steps[border].max() <= steps[~border].max()


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["reflect", "translate", "rotate"])
def test_borders_of_the_thesis_rules_are_calmer_than_the_inside(repeat):
    """Across every border the 99th percentile of the colour step is at most that of inner neighbours."""
    border, inner = [], []
    for seed in range(3):
        motif = ts.generate_motif(64, layers=2, repeat=repeat, seed=seed, iterations=20)
        for axis, side in enumerate(motif.densities.shape[1:]):
            steps = _steps(ts.repeat(motif, (3, 3)), axis)
            at_border = np.arange(len(steps)) % side == side - 1
            border.append(steps[at_border].ravel())
            inner.append(steps[~at_border].ravel())
    assert np.percentile(np.concatenate(border), 99) <= np.percentile(np.concatenate(inner), 99)


def test_copies_of_reflect_and_rotate_meet_their_images():
    cell = _motif("reflect").coverage()
    pattern = ts.motif.repeat_densities(_motif("reflect"), (2, 2))
    assert np.array_equal(pattern[:, :48, 48:], cell[..., ::-1])
    assert np.array_equal(pattern[:, 48:, 48:], cell[..., ::-1, ::-1])
    turned = _motif("rotate")
    pattern = ts.motif.repeat_densities(turned, (2, 2))
    assert np.array_equal(pattern[:, :48, 48:], turned.coverage()[..., ::-1, ::-1])
    assert np.array_equal(pattern[:, 48:, 48:], turned.coverage())


@pytest.mark.parametrize("repeat", ORDERS)
def test_permutations_are_permutations_and_orbits_their_cycles(repeat):
    shape = (12, 12)
    for operation in operations(repeat):
        assert np.array_equal(
            np.sort(permutation(operation, shape, repeat in HEXAGONAL).ravel()), np.arange(144)
        )
    orbits = symmetry(repeat, shape)
    field = np.random.default_rng(0).random(shape)
    mean = orbits.mean(field)
    assert mean.mean() == pytest.approx(field.mean())
    for operation in operations(repeat):
        assert np.array_equal(mean.ravel()[permutation(operation, shape, repeat in HEXAGONAL)], mean)


@pytest.mark.parametrize("repeat", ["reflect", "p2", "pmm", "p4", "p4m", "p31m", "p6"])
def test_places_are_moved_onto_mirrors_and_centres(repeat):
    rng, moved = np.random.default_rng(1), 0
    for _ in range(20):
        start = rng.random(2)
        place = move_onto_axes(start, repeat, rng)
        assert (place >= 0).all()
        assert (place <= 1).all()
        if np.array_equal(place, start):
            continue
        moved += 1
        if repeat == "reflect":
            assert 0.0 in place or 1.0 in place
        else:
            images = [
                np.array([[a, b], [c, d]]) @ place + np.array([t, u]) / 2
                for (a, b), (c, d), (t, u) in operations(repeat)[1:]
            ]
            assert any(np.allclose((image - place + 0.5) % 1.0, 0.5, atol=1e-9) for image in images)
    assert moved >= 3


@pytest.mark.parametrize(
    ("repeat", "expected"),
    [
        ("none", Joint.FREE),
        ("reflect", Joint.FREE),
        ("rotate", Joint.ROTATE),
        ("translate", Joint.TRANSLATE),
        ("p4m", Joint.TRANSLATE),
    ],
)
def test_each_rule_joins_the_plate_s_border_in_its_way(repeat, expected):
    assert joint(repeat) is expected
