"""Clips as files."""

import numpy as np
import pytest
from PIL import Image

from toposeam_cli.media.clips.writing import _palette


@pytest.mark.parametrize("count", [1, 40])
def test_a_clip_has_one_palette_unless_it_is_transparent(count):
    rng = np.random.default_rng(1)
    frames = rng.integers(0, 256, (count, 20, 30, 3), np.uint8)
    palette = _palette([Image.fromarray(frame) for frame in frames])
    assert palette.mode == "P"
    assert 200 < len(palette.getcolors()) <= 256
    clear = np.dstack([frames[0], np.full((20, 30), 9, np.uint8)])
    assert _palette([Image.fromarray(clear)] * count) is None
