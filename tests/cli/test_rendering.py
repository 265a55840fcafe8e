"""Compositions rendered window by window, and what is drawn of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.layers.canvas import BLOCK, Box
from toposeam.layers.composite import composed_of_masks
from toposeam_cli.files.scratch import scratch
from toposeam_cli.media.pictures.raw import Stored
from toposeam_cli.stitching import drawn_pictures, file_sink
from toposeam_cli.stitching.drawn_pictures import Overlay, _marks
from toposeam_cli.stitching.file_sink import _is_full
from toposeam_cli.stitching.resample import toned_layers


def with_seam(view, outline=((10, 0), (10, 40))):
    """What shows a box of a canvas on which a seam of 40 px runs down in column 10."""
    line = SimpleNamespace(outline=np.array(outline, float))
    return SimpleNamespace(shape=view.shape, view=view, outlines=[SimpleNamespace(paths=[line])])


def test_a_seam_is_drawn_without_gaps():
    """Also where it goes straight on, of which its line has the ends only."""
    marks = _marks(with_seam(Box(0, 0, 40, 60), [(5, 20), (30, 20), (30, 10), (52, 10)]))
    red = np.zeros((40, 60), bool)
    red[19:22, 4:32] = red[9:22, 29:32] = red[9:12, 29:54] = True
    np.testing.assert_array_equal(marks == 2, red)
    np.testing.assert_array_equal(marks > 0, ndimage.binary_dilation(red, np.ones((3, 3))))


def test_a_seam_is_drawn_three_pixels_wide_on_small_pictures():
    marks = _marks(with_seam(Box(0, 0, 40, 30)))
    np.testing.assert_array_equal(marks[20, 6:15], [0, 0, 1, 2, 2, 2, 1, 0, 0])
    # From 1000 px on it grows with the picture.
    marks = _marks(with_seam(Box(0, 0, 1200, 1000)))
    np.testing.assert_array_equal(marks[20, 4:17], [0, 0, 1, 1, 2, 2, 2, 2, 2, 1, 1, 0, 0])


@pytest.mark.parametrize("view", [Box(5, 3, 40, 30), Box(-6, -4, 33, 12), Box(30, 10, 50, 11)])
def test_a_seam_is_drawn_where_a_crop_shows_it(view):
    whole = _marks(with_seam(Box(-20, -20, 60, 60)))
    np.testing.assert_array_equal(_marks(with_seam(view)), whole[view.moved(20, 20).slices])


class Boxes(ts.layers.Sink):
    """Keeps the windows that it is given."""

    def open(self, shape, dtype):
        self.shape, self.boxes = shape, []

    def write(self, box, pixels, alpha):
        assert pixels.shape == alpha.shape == box.shape
        return box

    def take(self, box, answer):
        assert answer == box
        self.boxes.append(box)


@pytest.mark.parametrize(
    "shape", [(1, 1), (BLOCK, 4 * BLOCK), (BLOCK + 1, 4 * BLOCK + 1), (2 * BLOCK + 5, 7)]
)
def test_windows_cover_every_pixel_once_from_the_top(shape):
    sink = Boxes()
    composed_of_masks([ts.Layer(np.zeros(shape, np.uint8))], None, shape).render(sink)
    windows = sink.boxes
    assert sink.shape == shape
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
def test_seams_are_red_on_white_over_the_picture(dtype, white, channels, monkeypatch):
    values = np.random.default_rng(0).random((4, 6, channels))
    planes = (values * white).astype(dtype)
    marks = np.zeros((4, 6), np.uint8)
    marks[1], marks[2, 3:] = 1, 2
    monkeypatch.setattr(drawn_pictures, "_marks", lambda _: marks)

    def drawn_over(pixels):
        return Overlay(None, pixels[..., 0] if channels == 1 else pixels)[:, :]

    drawn = drawn_over(planes)
    assert (drawn.shape, drawn.dtype) == ((4, 6, 3), np.uint8)
    assert (drawn[1] == 255).all()
    assert (drawn[2, 3:] == (230, 30, 40)).all()
    expected = np.broadcast_to(planes.astype(float) / white * 255, (4, 6, 3))
    np.testing.assert_allclose(drawn[marks == 0], expected[marks == 0], atol=1)
    if dtype == np.float32:  # lights beyond white, and what is less than black
        monkeypatch.setattr(drawn_pictures, "_marks", lambda _: 0 * marks)
        assert drawn_over(planes + 2).min() == 255
        assert drawn_over(planes - 2).max() == 0


def test_a_part_is_full_where_nothing_in_it_is_open(monkeypatch):
    monkeypatch.setattr(file_sink, "BLOCK", 4)
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
