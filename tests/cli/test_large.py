"""Composites made window by window."""

from types import SimpleNamespace

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import BLOCK, Box
from toposeam_cli.files.scratch import scratch
from toposeam_cli.media.pictures.raw import Stored
from toposeam_cli.stitching import windowed_output
from toposeam_cli.stitching.resample import toned_layers
from toposeam_cli.stitching.windowed_output import _drawn, _is_full, _marks, _windows


def test_a_seam_is_drawn_three_pixels_wide_on_small_pictures():
    line = SimpleNamespace(outline=np.column_stack([np.full(41, 10.0), np.arange(41)]))
    marks = _marks([SimpleNamespace(paths=[line])], (40, 30))
    np.testing.assert_array_equal(marks[20, 6:15], [0, 0, 1, 2, 2, 2, 1, 0, 0])
    # From 1000 px on it grows with the picture.
    marks = _marks([SimpleNamespace(paths=[line])], (1200, 1000))
    np.testing.assert_array_equal(marks[20, 4:17], [0, 0, 1, 1, 2, 2, 2, 2, 2, 1, 1, 0, 0])


@pytest.mark.parametrize(
    "shape", [(1, 1), (BLOCK, 4 * BLOCK), (BLOCK + 1, 4 * BLOCK + 1), (2 * BLOCK + 5, 7)]
)
def test_windows_cover_every_pixel_once_from_the_top(shape):
    windows = list(_windows(*shape))
    assert sum((box.bottom - box.top) * (box.right - box.left) for box in windows) == shape[0] * shape[1]
    assert windows == sorted(windows)
    assert (windows[0][:2], windows[-1][2:]) == ((0, 0), shape)
    for box in windows:
        assert 0 < box.bottom - box.top <= BLOCK
        assert 0 < box.right - box.left <= 4 * BLOCK
        # Windows of a column write to one file, which is as wide as they are.
        assert box.right == min(box.left + 4 * BLOCK, shape[1])
        assert box.left % (4 * BLOCK) == 0


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 65535), (np.float32, 1)])
@pytest.mark.parametrize("channels", [1, 3])
def test_seams_are_red_on_white_over_the_picture(dtype, white, channels):
    values = np.random.default_rng(0).random((4, 6, channels))
    planes = (values * white).astype(dtype)
    marks = np.zeros((4, 6), np.uint8)
    marks[1], marks[2, 3:] = 1, 2
    drawn = _drawn(planes, marks)
    assert (drawn.shape, drawn.dtype) == ((4, 6, 3), np.uint8)
    assert (drawn[1] == 255).all()
    assert (drawn[2, 3:] == (230, 30, 40)).all()
    expected = np.broadcast_to(planes.astype(float) / white * 255, (4, 6, 3))
    np.testing.assert_allclose(drawn[marks == 0], expected[marks == 0], atol=1)
    if dtype == np.float32:  # lights beyond white, and what is less than black
        assert _drawn(planes + 2, 0 * marks).min() == 255
        assert _drawn(planes - 2, 0 * marks).max() == 0


def test_a_part_is_full_where_nothing_in_it_is_open(monkeypatch):
    monkeypatch.setattr(windowed_output, "BLOCK", 4)
    box = Box(2, 3, 13, 9)
    for place in ((1, 5), (13, 5), (6, 2), (6, 9)):  # right outside
        mask = np.ones((15, 12), bool)
        mask[place] = False
        assert _is_full(mask, box)
    for place in ((2, 3), (12, 8), (6, 5), (10, 3)):
        mask = np.ones((15, 12), bool)
        mask[place] = False
        assert not _is_full(mask, box)


@pytest.mark.parametrize("shading", [False, True])
@pytest.mark.parametrize(("dtype", "shape"), [(np.uint8, (300, 90, 3)), (np.uint16, (40, 90))])
def test_matched_tones_wait_in_files(tmp_path, dtype, shape, shading):
    most = np.iinfo(dtype).max
    dark = (np.random.default_rng(0).uniform(0.2, 0.6, shape) * most).astype(dtype)
    layers = [ts.Layer(dark), ts.Layer((dark[:, 30:] * 1.2).astype(dtype), at=(30, 0))]
    expected = ts.layers.match_tones(layers, shading=shading)
    shares = []
    with scratch(tmp_path) as store:
        found = toned_layers(layers, shading, store, None, shares.append)
        for layer, one in zip(found, expected, strict=True):
            assert isinstance(layer.image, Stored)
            assert layer.at == one.at
            np.testing.assert_array_equal(layer.image, one.image)
    assert shares == [0.5, 1.0]
    assert not list(tmp_path.iterdir())
