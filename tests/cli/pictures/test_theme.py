"""Palettes as they are written on a command line, and pictures that shape a motif."""

import numpy as np
import pytest

from toposeam.errors import ImageError, OptionError
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.motifs.themes import read_colours, read_theme


def test_a_palette_has_paper_and_one_ink_at_least():
    assert read_colours("#ffffff #102030").inks.shape == (1, 3)
    with pytest.raises(OptionError, match="has no ink"):
        read_colours("#ffffff")


def test_a_palettes_picture_may_be_transparent_in_part(tmp_path):
    pixels = np.arange(16, dtype=np.uint8).reshape(4, 4)
    alpha = np.where(pixels < 4, 255, 0).astype(np.uint8)
    write_picture(tmp_path / "part.png", Picture(pixels=pixels, alpha=alpha))
    np.testing.assert_array_equal(read_colours("part.png", tmp_path), [[0, 1, 2, 3]])
    write_picture(tmp_path / "clear.png", Picture(pixels=pixels, alpha=np.zeros_like(alpha)))
    with pytest.raises(ImageError, match="transparent everywhere; give one with colours"):
        read_colours("clear.png", tmp_path)


def test_a_theme_shows_something(tmp_path):
    alpha = np.zeros((9, 9), np.uint8)
    write_picture(tmp_path / "clear.png", Picture(pixels=np.full_like(alpha, 7), alpha=alpha))
    with pytest.raises(ImageError, match=r"clear.png' is transparent everywhere; give one that shows"):
        read_theme(tmp_path / "clear.png")
    alpha[4, 4] = 255
    write_picture(tmp_path / "dot.png", Picture(pixels=np.full_like(alpha, 7), alpha=alpha))
    np.testing.assert_array_equal(read_theme(tmp_path / "dot.png")[4, 4], [7, 255])
