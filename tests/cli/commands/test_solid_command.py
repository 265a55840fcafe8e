"""``toposeam motif --depth``: a mesh for a printer."""

import numpy as np
import pytest

import toposeam as ts

BLOCK = ("--depth", "16", "--iterations", "8", "--mass", "0.15")


def corners(path):
    content = path.read_bytes()
    count = int(np.frombuffer(content[80:84], "<u4")[0])
    assert len(content) == 84 + 50 * count
    return np.frombuffer(content[84:], [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])["c"]


@pytest.mark.medium
def test_a_solid_is_the_one_of_the_library_and_in_millimetres(folder, toposeam):
    ran = toposeam(
        "motif", "-o", "vase.stl", *BLOCK, "--repeat", "p4m", "--motif-width", "8cm", "--seed", "3"
    )
    assert ran.code == 0
    assert ran.out.startswith("vase.stl: a block of 80 × 80 × 80 mm, ")
    recipe = ts.motif.random_recipe(16, layers=1, iterations=8, mass=0.15, repeat="p4m", seed=3)
    mesh = ts.solid.generate_solid(recipe, 16).mesh(5.0)
    found = corners(folder / "vase.stl")
    np.testing.assert_array_equal(found, mesh.vertices[:, ::-1][mesh.faces])
    assert found.min() >= 0
    assert found.max() <= 80


@pytest.mark.medium
def test_ply_and_relatives_of_a_motif(folder, toposeam):
    assert toposeam("motif", "-o", "m.png", "--size", "32", "--iterations", "4", "--repeat", "p4").code == 0
    assert toposeam("motif", "-o", "a.ply", "--like", "m.png", "--depth", "16").code == 0
    assert (folder / "a.ply").read_bytes().startswith(b"ply\nformat binary_little_endian")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("-o", "a.png", *BLOCK), ".stl"),
        (("-o", "a.stl", *BLOCK, "--sheet", "2x2"), "paper"),
        (("-o", "a.stl", *BLOCK, "--dpi", "300"), "paper"),
        (("-o", "a.stl", *BLOCK, "--repeat", "p6"), "repeat"),
    ],
)
def test_what_is_no_solid_is_refused_in_one_sentence(folder, toposeam, arguments, text):
    ran = toposeam("motif", *arguments)
    assert ran.code == 1
    assert text in ran.err
    assert not list(folder.glob("a.stl"))
