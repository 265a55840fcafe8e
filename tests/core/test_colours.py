"""Colours as text and as brightness."""

import numpy as np
import pytest

from toposeam.colours import LUMA, parse_colour, to_hex
from toposeam.errors import OptionError


def test_every_8_bit_colour_survives_the_way_through_text():
    for value in range(256):
        text = f"#{value:02x}{255 - value:02x}00"
        assert to_hex(parse_colour(text)) == text


def test_what_cannot_be_shown_is_clipped_and_halves_are_rounded():
    assert to_hex((1.2, -0.1, 0.5)) == "#ff0080"
    assert to_hex(np.float32([0.1, 0.2, 0.3])) == "#1a334d"


def test_short_colours_double_their_digits():
    assert parse_colour("#1f0") == (17 / 255, 1.0, 0.0)
    assert parse_colour("1f0") == parse_colour("#11ff00")


@pytest.mark.parametrize("text", ["", "#", "#12", "#12345", "#1234567", "#+1+2+3", "#gggggg", "red"])
def test_what_is_no_colour_says_how_to_write_one(text):
    with pytest.raises(OptionError, match="#rrggbb"):
        parse_colour(text)


def test_white_has_brightness_one_and_green_counts_most():
    assert LUMA.sum() == pytest.approx(1, abs=1e-12)
    assert LUMA.tolist() == [0.2126, 0.7152, 0.0722]
    with pytest.raises(ValueError, match="read-only"):
        LUMA[0] = 1
