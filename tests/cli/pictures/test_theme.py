"""Palettes as they are written on a command line."""

import pytest

from toposeam.errors import OptionError
from toposeam_cli.pictures.theme import read_colours


def test_a_palette_has_paper_and_one_ink_at_least():
    assert read_colours("#ffffff #102030").inks.shape == (1, 3)
    with pytest.raises(OptionError, match="has no ink"):
        read_colours("#ffffff")
