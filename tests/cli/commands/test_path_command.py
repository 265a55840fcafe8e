"""``toposeam path``: ways over pictures of costs."""

import numpy as np
import pytest

import toposeam as ts
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


@pytest.fixture
def ground(folder):
    """A map with a wall that leaves a gap at the bottom, and a transparent corner."""
    pixels = np.full((40, 60), 255, np.uint8)
    pixels[:30, 28:32] = 0
    alpha = np.full((40, 60), 255, np.uint8)
    alpha[:3, :3] = 0
    write_picture("hills.png", Picture(pixels=pixels, alpha=alpha))
    return folder


@pytest.mark.medium
def test_the_way_of_the_library_is_written_as_svg(ground, toposeam):
    ran = toposeam("path", "hills.png", "--from", "5,10", "--to", "54,12", "-o", "way.svg")
    assert (ran.code, ran.err) == (0, "")
    cost = np.ones((40, 60))
    cost[:30, 28:32] = cost[:3, :3] = np.inf
    found = ts.plan_path(cost, (5, 10), (54, 12))
    assert ran.out.startswith("5,10 to 54,12: ")
    assert f"{found.length:.1f} px" in ran.out
    drawn = ts.vector.read_svg((ground / "way.svg").read_text())
    np.testing.assert_allclose(drawn.polylines[0].points, found.paths[0].points)


def test_the_way_is_drawn_on_the_map(ground, toposeam):
    toposeam("path", "hills.png", "--from", "5,35", "--via", "20,35", "--to", "54,35", "-o", "seen.png", "-q")
    drawn = read_picture("seen.png").pixels
    assert drawn.shape == (40, 60, 3)
    assert (drawn[35, 6:53] == (0xD0, 0x02, 0x1B)).all()
    assert (drawn[:20, 28:32] == 0).all()


def test_dark_ground_costs_as_much_as_is_said(ground, toposeam):
    pixels = np.full((20, 40), 255, np.uint8)
    pixels[:, 10:30] = 128
    write_picture("gray.png", Picture(pixels=pixels))
    dark = 1 - 128 / 255
    ran = toposeam("path", "gray.png", "--from", "2,10", "--to", "37,10", "--steepest", "5")
    assert f"cost {35 + 20 * 4 * dark:.1f}" in ran.out


@pytest.mark.parametrize(
    ("line", "phrase", "code"),
    [
        ("path hills.png --from 5,10 --to 30,10", "on an obstacle", 1),
        ("path hills.png --from 1,1 --to 50,10", "on an obstacle", 1),
        ("path hills.png --from 5,10 --to 90,10", "outside", 1),
        ("path hills.png --from 5,10", "--to", 2),
        ("path hills.png --from 5 --to 9,9", "--from", 2),
        ("path nowhere.png --from 5,10 --to 9,9", "there is no file", 1),
        ("path hills.png --from 5,10 --to 9,9 -o a.pdf", "is not supported", 1),
    ],
)
def test_bad_input(ground, toposeam, line, phrase, code):
    toposeam(*line.split()).fails(phrase, code)
