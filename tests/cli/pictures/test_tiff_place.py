"""Where TIFF files say that their pictures lie, however they write it."""

import struct

import numpy as np
import pytest
import tifffile

from toposeam_cli.media.layouts.tiff_place import tiff_canvas, tiff_place


def written(path, *, big=False, order="<", kind=5, values=((300, 150), (-450, 150)), resolution=(150, 150)):
    """A picture of 4 × 3 px with places of a kind of number, and the whole panorama's size."""
    tifffile.imwrite(
        path,
        np.zeros((3, 4), np.uint8),
        bigtiff=big,
        byteorder=order,
        resolution=resolution,
        resolutionunit="INCH",
        extratags=[(286 + axis, kind, 1, values[axis], True) for axis in (0, 1)]
        + [(33300, 4, 1, 8000, True), (33301, 3, 1, 4000, True)],
        metadata=None,
    )
    return path


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("kind", "values", "at"),
    [
        (10, ((300, 150), (-450, 150)), (300, -450)),
        (5, ((300, 150), (1, 3)), (300, 50)),
        (3, (2, 3), (300, 450)),
        (9, (2, -3), (300, -450)),
        (11, (2.0, 0.5), (300, 75)),
        (12, (-2.0, 1 / 3), (-300, 50)),
    ],
    ids=["signed", "rational", "short", "long", "float", "double"],
)
def test_places_are_read_in_every_kind_of_number_and_byte_order(tmp_path, big, order, kind, values, at):
    path = written(tmp_path / "view.tif", big=big, order=order, kind=kind, values=values)
    assert tiff_place(path) == at
    assert tiff_canvas(path) == (8000, 4000)


def test_a_place_without_a_resolution_counts_pixels(tmp_path):
    path = tmp_path / "view.tif"
    entries = [(286, 5, 1, 64), (287, 5, 1, 72)]
    directory = struct.pack("<H", 2) + b"".join(struct.pack("<HHLL", *entry) for entry in entries)
    start = struct.pack("<2sHL", b"II", 42, 8) + directory + bytes(4)
    path.write_bytes(start.ljust(64, b"\0") + struct.pack("<4L", 70, 2, 9, 1))
    assert tiff_place(path) == (35, 9)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"II",
        b"II*\0\x08\0\0\0",
        b"II*\0\xff\xff\xff\xff",
        struct.pack("<2sHHHQQ", b"II", 43, 8, 0, 16, 2**63),
        b"MM\0\x2c" + bytes(60),
        b"\x89PNG\r\n\x1a\n",
    ],
    ids=["empty", "two bytes", "no directory", "far", "endless", "no version", "png"],
)
def test_what_is_no_tiff_file_says_no_place(tmp_path, content):
    path = tmp_path / "view.tif"
    path.write_bytes(content)
    assert tiff_place(path) is None


def test_a_place_divided_by_zero_is_none(tmp_path):
    assert tiff_place(written(tmp_path / "view.tif", values=((1, 0), (1, 1)))) is None
    assert tiff_place(tmp_path / "nothing.tif") is None
