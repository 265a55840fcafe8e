"""Swatches in files of palettes."""

import struct

import numpy as np

from toposeam_cli.motifs.swatches import read_swatches


def ase(*swatches):
    """An .ase file of (model, values)."""
    blocks = []
    for model, values in swatches:
        name = struct.pack(">H", 2) + "a".encode("utf-16-be") + b"\0\0"
        body = name + model + struct.pack(f">{len(values)}f", *values) + b"\0\0"
        blocks.append(struct.pack(">HI", 1, len(body)) + body)
    return b"ASEF" + struct.pack(">HHI", 1, 0, len(blocks)) + b"".join(blocks)


def test_lab_as_photoshop_has_it(tmp_path):
    """By D50: sRGB's red, green, blue, middle gray and white."""
    lab = [(54.29, 80.81, 69.89), (87.82, -79.27, 80.99), (29.57, 68.30, -112.03), (53.58, 0, 0), (100, 0, 0)]
    path = tmp_path / "lab.ase"
    path.write_bytes(ase(*((b"LAB ", (lightness / 100, a, b)) for lightness, a, b in lab)))
    found = np.round(read_swatches(path) * 255)
    rgb = [(255, 255, 255), (255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128)]
    assert np.abs(found - rgb).max() <= 1


def test_no_colour_of_a_mixed_file_is_left_out(tmp_path):
    path = tmp_path / "mixed.ase"
    path.write_bytes(
        ase((b"RGB ", (1, 1, 1)), (b"CMYK", (0, 0, 0, 1)), (b"LAB ", (0.5, 0, 0)), (b"Gray", (0.25,)))
    )
    assert len(read_swatches(path)) == 4
