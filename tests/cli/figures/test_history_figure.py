"""The picture of how the heat converged."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

import toposeam as ts
from toposeam_cli.figures.frames import film_frame
from toposeam_cli.figures.history import _curves, history_figure


def found(shape: tuple[int, int], side: ts.typing.Side = "right", **options) -> ts.seam.Seam:
    a, b = np.random.default_rng(1).random((2, *shape))
    return ts.find_seam(a, b, side=side, record_frames=True, **options)


@pytest.mark.parametrize(
    ("shape", "side"),
    [((60, 12), "right"), ((12, 60), "bottom"), ((30, 30), "left"), ((3, 3), "top"), ((2, 2), "right")],
)
def test_overlaps_of_every_proportion_make_a_picture(shape, side):
    picture = Image.open(io.BytesIO(history_figure(found(shape, side))))
    assert picture.format == "PNG"
    assert min(picture.size) > 300
    assert (
        len(
            set(
                picture.convert("L").getdata()
                if not hasattr(picture, "get_flattened_data")
                else picture.convert("L").get_flattened_data()
            )
        )
        > 10
    )


@pytest.mark.medium
@pytest.mark.parametrize("method", ["heat", "thesis"])
@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_every_format_is_written_the_same_each_time(method, suffix, start):
    seam = found((40, 12), method=method)
    document = history_figure(seam, suffix)
    assert document.startswith(start)
    assert document == history_figure(seam, suffix)


def test_a_frame_shows_the_dense_interfaces_and_no_others():
    frame = ts.optimize.Frame(
        iteration=1, stage=1, right=np.zeros((4, 4), np.float32), down=np.zeros((3, 5), np.float32)
    )
    empty = film_frame(frame)
    frame.right[:, 1] = 1.0
    assert (film_frame(frame) != empty).any()
    frame.right[:, 1] = 0.05
    np.testing.assert_array_equal(film_frame(frame), empty)


@pytest.mark.parametrize("shape", [(60, 12), (12, 60)])
def test_the_film_strip_stands_in_the_middle(shape):
    picture = Image.open(io.BytesIO(history_figure(found(shape), frames=3, curves=False)))
    inked = np.flatnonzero((np.asarray(picture.convert("RGB")).min(axis=2) < 250).any(axis=0))
    assert abs(int(inked[0]) - (picture.width - 1 - int(inked[-1]))) <= 2


def test_a_shared_pixel_is_on_paper_with_the_corners_round_it():
    frame = ts.optimize.Frame(
        iteration=1, stage=1, right=np.zeros((4, 4), np.float32), down=np.zeros((3, 5), np.float32)
    )
    shared = np.zeros((4, 5), bool)
    shared[1, 2] = True
    tinted = (film_frame(frame, shared) != 255).any(axis=2)
    expected = np.zeros((9, 11), bool)
    expected[2:5, 4:7] = True
    np.testing.assert_array_equal(tinted, expected)


def test_stages_are_parted_between_their_iterations():
    from matplotlib.figure import Figure

    seam = found((60, 30), method="thesis")
    stages = [record.stage for record in seam.history]
    axis = Figure().add_subplot()
    _curves(axis, seam)
    parted = [line.get_xdata()[0] for line in axis.lines if line.get_color() == "0.8"]
    # After the n-th iteration, counted from 1, at n + 1/2.
    assert parted == [n + 0.5 for n in range(1, len(stages)) if stages[n] != stages[n - 1]] != []
