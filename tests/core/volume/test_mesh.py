"""Surfaces as triangles."""

import numpy as np
import pytest

import toposeam as ts


def sphere(spacing=(1, 1, 1), smooth=1.0):
    """A ball of b inside a: the two agree on its shell only."""
    shape = (40, 40, 40)
    distance = np.sqrt(sum((axis - 19.5) ** 2 for axis in np.indices(shape)))
    a, b = np.random.default_rng(0).random((2, *shape))
    shell = abs(distance - 12) < 1.2
    b[shell] = a[shell]
    on_b = distance < 17
    surface = ts.find_surface(a, b, None, on_b, gradient=False, spacing=spacing, core=0.7)
    return surface, surface.mesh(smooth)


def test_a_sphere_is_closed_and_about_as_large_as_it_is():
    _, mesh = sphere(smooth=2.0)  # the steps of the voxels themselves add a tenth
    assert mesh.area == pytest.approx(4 * np.pi * 12**2, rel=0.05)
    edges = np.sort(np.concatenate([mesh.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), 19.5, atol=0.5)
    vertices, faces = mesh
    assert vertices.shape[1] == faces.shape[1] == 3


def test_spacing_scales_the_mesh():
    _, mesh = sphere((2, 1, 1))
    reach = np.ptp(mesh.vertices, axis=0)
    assert reach[0] == pytest.approx(2 * reach[1], rel=0.1)


def test_a_flat_surface_has_the_area_of_its_section():
    a, b = np.random.default_rng(0).random((2, 12, 20, 30))
    b[5:7] = a[5:7]
    surface = ts.find_surface(a, b, gradient=True)
    for smooth in (0, 1):
        mesh = surface.mesh(smooth)
        assert mesh.area == pytest.approx(19 * 29, rel=0.02)
        np.testing.assert_allclose(mesh.vertices[:, 0], 5.5, atol=0.3)


def test_files_hold_the_triangles(tmp_path):
    a, b = np.random.default_rng(0).random((2, 6, 8, 9))
    mesh = ts.find_surface(a, b).mesh()
    mesh.to_ply(tmp_path / "s.ply")
    mesh.to_stl(tmp_path / "s.stl")
    ply = (tmp_path / "s.ply").read_bytes()
    head, _, body = ply.partition(b"end_header\n")
    assert f"element vertex {len(mesh.vertices)}".encode() in head
    points = np.frombuffer(body, "<f4", 3 * len(mesh.vertices)).reshape(-1, 3)
    np.testing.assert_array_equal(points[:, ::-1], mesh.vertices)
    assert len(body) == 12 * len(mesh.vertices) + 13 * len(mesh.faces)
    stl = (tmp_path / "s.stl").read_bytes()
    assert len(stl) == 84 + 50 * len(mesh.faces)
    assert int.from_bytes(stl[80:84], "little") == len(mesh.faces)
    first = np.frombuffer(stl, "<f4", 12, 84).reshape(4, 3)
    np.testing.assert_array_equal(first[1:, ::-1], mesh.vertices[mesh.faces[0]])
    assert np.linalg.norm(first[0]) == pytest.approx(1, abs=1e-5)
    assert not list(tmp_path.glob(".toposeam*"))


def test_without_a_surface_there_is_no_mesh():
    on_a, on_b = np.zeros((2, 8, 8, 8), bool)
    on_a[:5] = on_b[3:] = True
    surface = ts.find_surface(*np.random.default_rng(0).random((2, 8, 8, 8)), on_a, on_b)
    assert len(surface.mesh().faces)
    with pytest.raises(ts.OptionError, match="smooth"):
        surface.mesh(smooth=-1)
