"""Masks: pictures, boxes and ellipses."""

from pathlib import Path

import numpy as np
import pytest
from picture_samples import fails

from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.media.pictures.picture import Picture, write_picture


def drawn(words):
    return read_white(Path(words), (20, 30), "a.png", 1000)


@pytest.mark.parametrize(
    ("words", "rows", "columns"),
    [
        ("box:3,4,5,6", slice(4, 10), slice(3, 8)),
        ("box:-3,-4,5,6", slice(0, 2), slice(0, 2)),
        ("box:25,15,99999999999,9", slice(15, 20), slice(25, 30)),
        ("folder/box:3,4,5,6", slice(4, 10), slice(3, 8)),
    ],
)
def test_a_box_is_drawn_as_far_as_it_lies_in_the_picture(words, rows, columns):
    expected = np.zeros((20, 30), bool)
    expected[rows, columns] = True
    np.testing.assert_array_equal(drawn(words), expected)


def test_an_ellipse_fills_its_box_to_the_sides():
    white = drawn("ellipse:5,4,15,11")
    rows, columns = np.nonzero(white)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (4, 14, 5, 19)
    assert white.sum() == pytest.approx(np.pi / 4 * 15 * 11, rel=0.03)
    np.testing.assert_array_equal(white[4:15, 5:20], white[4:15, 5:20][::-1, ::-1])


def test_several_areas_are_one_mask():
    np.testing.assert_array_equal(
        drawn("box:0,0,3,3; box:9,9,3,3"), drawn("box:0,0,3,3") | drawn("box:9,9,3,3")
    )


def test_a_file_of_that_name_is_a_file(tmp_path):
    write_picture(tmp_path / "made.png", Picture(pixels=np.full((20, 30), 255, np.uint8)))
    (tmp_path / "made.png").rename(tmp_path / "box:0,0,1,1")
    assert read_white(tmp_path / "box:0,0,1,1", (20, 30), "a.png", 1000).all()


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        ("box:1,2,3", "write box:X,Y,WIDTH,HEIGHT or ellipse:X,Y,WIDTH,HEIGHT, in px"),
        ("box:1,2,3,4;round", "'round' is no area"),
        ("box:1,2,0,4", "holds no pixel of a.png, which is 30 × 20 px"),
        ("ellipse:30,2,3,4", "holds no pixel of a.png"),
        ("box:1,2,3.5,4", "is no area"),
    ],
)
def test_what_is_no_area_is_told(words, remedy):
    assert remedy in fails(drawn, words)
