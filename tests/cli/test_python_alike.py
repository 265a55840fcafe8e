"""Arrays in Python are joined as files on the command line."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import toposeam as ts

SAMPLES = Path(__file__).parents[2] / "samples"
PAIR = [SAMPLES / "still_life_left.png", SAMPLES / "still_life_right.png"]


@pytest.fixture(scope="module")
def arrays():
    return [np.asarray(Image.open(path).convert("RGB")) for path in PAIR]


@pytest.mark.medium
def test_photographs_are_blended_evened_and_cropped_alike(toposeam, arrays, tmp_path):
    assert toposeam("stitch", *map(str, PAIR), "-o", str(tmp_path / "out.png")).code == 0
    joined = ts.stitch(arrays)
    assert joined.cropped is not None
    assert joined.alpha is None
    made = np.asarray(Image.open(tmp_path / "out.png")).astype(float)
    off = np.abs(np.asarray(joined, float) - made)
    assert np.median(off) <= 1  # the command line lets libvips warp
    assert off.mean() < 2
    unlike = ts.stitch(arrays, blend="none", match_tones=False)
    assert np.abs(np.asarray(unlike, float) - made).mean() > 1.5 * off.mean()


@pytest.mark.medium
def test_what_is_given_stays_and_moves_need_no_more(arrays):
    plain = ts.stitch(arrays, blend="none", match_tones=False)
    assert type(plain.blending).__name__ == "Blending"
    whole = np.random.default_rng(1).integers(0, 255, (120, 300, 3), np.uint8)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        moved = ts.stitch([whole[:, :200], whole[:, 100:]])
    assert type(moved.blending).__name__ == "Blending"
    assert moved.cropped is None
    np.testing.assert_array_equal(np.asarray(moved), whole)
    assert np.asarray(moved, float).dtype == float
