"""Watching the heat gather: as many frames as iterations, and one with the two sides."""

import io

import numpy as np
import pytest
from PIL import Image

import toposeam as ts
from toposeam_cli.figures.animation import animate
from toposeam_cli.figures.search import ANIMATED as SUFFIXES

RNG = np.random.default_rng(2)


@pytest.mark.medium
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_animation_has_iterations_as_frames_and_ends_divided(suffix):
    seam = ts.find_seam(RNG.random((40, 12)), RNG.random((40, 12)), method="thesis", record_frames=True)
    content = animate(seam, suffix)
    picture = Image.open(io.BytesIO(content))
    # An animation leaves out frames that equal the one before.
    assert 3 < picture.n_frames <= len(seam.frames) + 1
    picture.seek(picture.n_frames - 1)
    last = np.asarray(picture.convert("RGB")).astype(int)
    left, right = last[last.shape[0] // 2, 2], last[last.shape[0] // 2, -3]
    assert left[2] > left[0] + 10  # a is blue
    assert right[0] > right[2] + 10  # b is amber
    assert content == animate(seam, suffix)
    # Nothing is lost: a film has few colours.
    assert len(np.unique(last.reshape(-1, 3), axis=0)) < 256


def test_a_seam_without_frames_is_refused():
    with pytest.raises(ts.OptionError, match="record_frames=True"):
        animate(ts.find_seam(np.zeros((8, 6)), np.ones((8, 6))), ".gif")
