"""Palettes: by name, written out, and from a picture."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.palette import PALETTES, SEASONS


@pytest.mark.parametrize("name", PALETTES)
def test_named_palettes_have_light_paper_and_six_inks_that_differ(name):
    found = ts.palette(name, 6)
    assert found.paper.min() > 0.85
    distance = np.abs(found.inks[:, None] - found.inks).max(axis=2) + np.eye(6)
    assert distance.min() > 0.08
    assert found.inks.min() >= 0
    assert found.inks.max() <= 1


def test_the_four_seasons_are_there():
    assert set(SEASONS) == {"spring", "summer", "fall", "winter"} <= set(PALETTES)


def test_written_colours():
    found = ts.palette("#ffffff, #ff0000 #0000ff", 2)
    np.testing.assert_array_equal(found.inks, [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(found.paper, [1, 1, 1])


def test_a_picture_of_three_colours_gives_them_back():
    picture = np.full((40, 40, 3), (250, 240, 220), np.uint8)
    picture[:10] = (200, 30, 40)
    picture[10:13] = (20, 60, 150)
    found = ts.palette(picture, 2)
    np.testing.assert_allclose(found.paper * 255, (250, 240, 220), atol=0.6)
    printed = found.paper * found.inks * 255
    np.testing.assert_allclose(printed[np.argsort(-printed[:, 0])], [(200, 30, 40), (20, 60, 150)], atol=0.6)


def test_a_picture_gives_the_same_palette_again():
    noise = np.random.default_rng(0).random((200, 150, 3))
    np.testing.assert_array_equal(ts.palette(noise, 5).inks, ts.palette(noise, 5).inks)


@pytest.mark.parametrize(
    ("source", "n", "phrase"),
    [
        ("autumn", 3, "there is no palette 'autumn'; use one of spring"),
        ("fall", 7, "has 6 inks, but 7 layers need 7"),
        ("#ffffff #00", 1, "'#00' is not a colour"),
        ("fall", 0, "ask for 1 or more"),
        (np.zeros((5, 5, 3)), 2, "has 1 colours"),
    ],
)
def test_bad_palettes(source, n, phrase):
    with pytest.raises(ts.OptionError, match=phrase):
        ts.palette(source, n)
