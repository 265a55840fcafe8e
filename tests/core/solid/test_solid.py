"""Solids: closed, standing on the floor, of the mass that was asked for, with the symmetry of their rule."""

from collections import Counter

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.solid.generate import REPEATS, _spots
from toposeam.volume.mesh import closed_mesh


def recipe(side=20, **options):
    return ts.motif.random_recipe(
        side, **({"layers": 1, "seed": 3, "mass": 0.15, "iterations": 12} | options)
    )


def edges_of(mesh):
    """How often each edge is run along in each direction, counted one by one."""
    counted = Counter()
    for a, b, c in mesh.faces.tolist():
        counted.update([(a, b), (b, c), (c, a)])
    return counted


@pytest.mark.medium
@pytest.mark.parametrize("repeat", REPEATS)
def test_every_edge_joins_two_faces_in_opposite_directions(repeat):
    mesh = ts.solid.generate_solid(recipe(repeat=repeat), 20).mesh()
    counted = edges_of(mesh)
    assert all(count == 1 and counted[b, a] == 1 for (a, b), count in counted.items())
    assert mesh.closed
    assert mesh.volume > 0
    assert mesh.vertices.min() >= 0
    assert mesh.vertices.max() <= 20


@pytest.mark.medium
def test_a_mesh_with_a_hole_or_a_turned_face_is_not_closed():
    mesh = ts.solid.generate_solid(recipe(), 16).mesh()
    turned = mesh.faces.copy()
    turned[0] = turned[0, ::-1]
    assert not ts.volume.Mesh(mesh.vertices, mesh.faces[1:]).closed
    assert not ts.volume.Mesh(mesh.vertices, turned).closed


def test_a_box_has_its_own_volume_and_area():
    field = np.full((10, 11, 12), -1.0)
    field[:8, 1:9, 2:10] = 1.0
    mesh = closed_mesh(field, 2.0)
    assert mesh.closed
    assert mesh.volume == pytest.approx(8 * 8**3, rel=0.04)  # edges are cut off
    assert mesh.vertices[:, 0].min() == 0  # on the floor exactly
    assert np.isclose(mesh.vertices[:, 0].max(), 16)


@pytest.mark.medium
def test_a_solid_stands_on_the_floor_with_the_given_mass():
    solid = ts.solid.generate_solid(recipe(32, iterations=30), 32)
    pieces, count = ndimage.label(solid.filled, np.ones((3, 3, 3)))
    assert set(np.unique(pieces[0])) >= set(range(1, count + 1))
    assert solid.density.mean() == pytest.approx(0.15, abs=1e-3)
    assert solid.filled.mean() == pytest.approx(0.15, rel=0.1)
    assert solid.mesh().volume / 32**3 == pytest.approx(0.15, rel=0.1)
    first, last = solid.history[0], solid.history[-1]
    assert last < 0.2 * first


def test_crumbs_and_what_hangs_in_the_air_are_left_out():
    """Two pillars, one of them of an eighth of the other, a crumb on the floor, and one above it."""
    density = np.full((16, 24, 24), 1e-3, np.float32)
    density[:14, 2:10, 2:10] = 1
    density[:7, 16:20, 2:6] = 1
    density[:3, 16:19, 16:19] = 1
    density[10:14, 16:20, 16:20] = 1
    solid = ts.solid.Solid(density=density, recipe=recipe(24), history=())
    assert solid.pieces == 2
    assert solid.filled[:, 14:, 14:].sum() == 0
    assert solid.mesh().closed


@pytest.mark.medium
def test_every_floor_has_the_symmetry_of_the_rule():
    density = ts.solid.generate_solid(recipe(repeat="p4m"), 16).density
    for turned in (density[:, ::-1], density[:, :, ::-1], density.swapaxes(1, 2)):
        np.testing.assert_allclose(density, turned, atol=1e-6)


@pytest.mark.medium
def test_the_same_recipe_makes_the_same_solid():
    one, two = (ts.solid.generate_solid(recipe(), 16) for _ in range(2))
    np.testing.assert_array_equal(one.density, two.density)


@pytest.mark.medium
def test_files_hold_the_mesh(tmp_path):
    mesh = ts.solid.generate_solid(recipe(), 16).mesh(2.5)
    mesh.to_stl(tmp_path / "a.stl")
    mesh.to_ply(tmp_path / "a.ply")
    content = (tmp_path / "a.stl").read_bytes()
    assert len(content) == 84 + 50 * len(mesh.faces)
    table = np.frombuffer(content[84:], [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
    # Outwards: seen from the middle of all, normals point away on the whole.
    corner = table["c"].astype(float)
    signed = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6
    assert signed == pytest.approx(mesh.volume, rel=1e-4)
    assert signed > 0
    assert (tmp_path / "a.ply").read_bytes().startswith(b"ply")


def test_what_makes_no_solid_is_said_in_one_sentence():
    for given, depth, text in (
        (recipe(layers=2), 16, "one material"),
        (recipe(repeat="rotate"), 16, "repeat"),
        (recipe(repeat="p6"), 16, "repeat"),
        (recipe(base=np.eye(8)), 16, "base"),
        (recipe(), 4, "depth"),
        (recipe(1024), 64, "cubes"),
    ):
        with pytest.raises(ts.OptionError, match=text):
            ts.solid.generate_solid(given, depth)
    with pytest.raises(ts.OverlapError, match="solid"):
        closed_mesh(np.zeros((4, 4, 4)), 1.0)


@pytest.mark.parametrize(
    ("given", "depth", "kind", "parameter", "value"),
    [
        ({"layers": 2}, 16, "count", "layers", None),
        ({"repeat": "p6"}, 16, "choice", "repeat", "p6"),
        ({"base": np.eye(8)}, 16, "conflict", "base", None),
        ({"side": 64, "scale": 2}, 16, "conflict", "scale", None),
        ({"one_piece": "ink"}, 16, "conflict", "one_piece", None),
        ({}, 10**6, "shape", "depth", 10**6),
    ],
)
def test_what_makes_no_solid_is_told_as_data(given, depth, kind, parameter, value):
    with pytest.raises(ts.OptionError) as raised:
        ts.solid.generate_solid(recipe(**given), depth)
    assert (raised.value.kind, raised.value.parameter, raised.value.value) == (kind, parameter, value)


def test_a_spot_is_a_ball_whose_surface_is_half_within():
    points, shape = ((0.5, 0.5, 1.0),), (21, 21, 21)
    field = _spots(points, np.array([0.5]), shape)
    assert field.sum() == pytest.approx(1)
    # The radius is 0.9, the middle that of a cube: whole, and 0.4 of each of its six neighbours.
    assert field[10, 10, 10] == pytest.approx(1 / (1 + 6 * 0.4))
    assert field[10, 10, 11] == pytest.approx(0.4 / (1 + 6 * 0.4))
    assert np.count_nonzero(field) == 7
    two = _spots(((0.25, 0.5, 1.0), (0.75, 0.5, 3.0)), np.array([0.5, 0.5]), (20, 20, 20))
    assert two[..., 10:].sum() == pytest.approx(0.75)
