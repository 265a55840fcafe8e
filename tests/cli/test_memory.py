"""Large pictures are joined without many copies of them."""

import os
import subprocess
import sys

import numpy as np
import pytest

from toposeam_cli.media.pictures import libvips, tiff_stream
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.media.pictures.raw import Stored

SIDE, OVERLAP = 3000, 300
#: What a process has before it reads anything: the interpreter, NumPy, SciPy and libvips.
BASE = 250 * 2**20
#: 6 GiB for two layers of 10,000 × 10,000 px that overlap by 1,000 px.
BYTES_PER_PIXEL = 6 * 2**30 / (19_000 * 10_000)


@pytest.mark.slow
def test_two_large_rgb_layers_take_no_more_memory_than_stated(tmp_path):
    rng = np.random.default_rng(0)
    for name in "ab":
        coarse = rng.integers(0, 256, (SIDE // 8, SIDE // 8, 3), np.uint8)
        write_picture(tmp_path / f"{name}.tif", Picture(pixels=coarse.repeat(8, axis=0).repeat(8, axis=1)))
    words = [
        "stitch",
        tmp_path / "a.tif",
        tmp_path / "b.tif",
        "--overlap",
        OVERLAP,
        "-o",
        tmp_path / "out.tif",
    ]
    # A small process starts it: its own largest memory would be passed on.
    code = (
        "import resource, subprocess, sys; done = subprocess.run([sys.executable, '-m', 'toposeam_cli', "
        "*sys.argv[1:]]); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); "
        "sys.exit(done.returncode)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        capture_output=True,
        text=True,
        env=os.environ,
        check=True,
    )
    peak = int(ran.stdout.splitlines()[-1]) * 1024
    assert peak < BASE + BYTES_PER_PIXEL * SIDE * (2 * SIDE - OVERLAP)


@pytest.mark.parametrize("name", ["out.tif", "out.png"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_pixels_in_files_are_read_in_strips(tmp_path, monkeypatch, name, dtype):
    monkeypatch.setattr(tiff_stream, "_ROWS", 9)
    values = np.random.default_rng(0).integers(0, 256, (75, 90, 4)).astype(dtype)
    values.tofile(tmp_path / "raw")
    part = 7, 11, 70, 83
    pixels = Stored([tmp_path / "raw"], values.shape, values.dtype, (0, 3), part)
    alpha = Stored([tmp_path / "raw"], values.shape, values.dtype, (3, 4), part)
    write_picture(tmp_path / name, Picture(pixels=pixels, alpha=alpha))
    again = read_picture(tmp_path / name)
    np.testing.assert_array_equal(again.pixels, values[7:70, 11:83, :3])
    np.testing.assert_array_equal(again.alpha, values[7:70, 11:83, 3])


@pytest.mark.parametrize("part", [None, (7, 11, 70, 83), (0, 40, 75, 61), (3, 5, 9, 17)])
def test_pixels_in_files_side_by_side_are_as_those_in_one(tmp_path, monkeypatch, part):
    monkeypatch.setattr(tiff_stream, "_ROWS", 9)
    values = np.random.default_rng(0).integers(0, 256, (75, 90, 4)).astype(np.uint8)
    paths = [tmp_path / f"raw{number}" for number in range(5)]
    for number, path in enumerate(paths):
        np.ascontiguousarray(values[:, 20 * number : 20 * (number + 1)]).tofile(path)
    pixels = Stored(paths, values.shape, values.dtype, (0, 3), part, 20)
    alpha = Stored(paths, values.shape, values.dtype, (3, 4), part, 20)
    top, left, bottom, right = part or (0, 0, 75, 90)
    whole = values[top:bottom, left:right]
    for rows in (slice(None), slice(1, 4), slice(2, 2)):
        for columns in (
            slice(None),
            slice(3, 12),
            slice(-7, None),
            slice(1, None, 7),
            slice(4, 4),
            slice(9, 2),
        ):
            np.testing.assert_array_equal(pixels[rows, columns], whole[rows, columns, :3])
            np.testing.assert_array_equal(alpha[rows, columns], whole[rows, columns, 3])
    write_picture(tmp_path / "out.png", Picture(pixels=pixels, alpha=alpha))
    again = read_picture(tmp_path / "out.png")
    np.testing.assert_array_equal(again.pixels, whole[..., :3])
    np.testing.assert_array_equal(again.alpha, whole[..., 3])


def test_pixels_far_down_in_a_file_are_found(tmp_path):
    height, width = 26_000, 10_000
    last = np.random.default_rng(0).integers(1, 256, (5, width, 4), np.uint8)
    with (tmp_path / "raw").open("wb") as file:  # 1.04 GB, of which the file system keeps 200 kB
        file.seek((height - 5) * width * 4)
        file.write(last.tobytes())
    pixels = Stored(
        [tmp_path / "raw"], (height, width, 4), np.dtype(np.uint8), (0, 3), (height - 8, 0, height, width)
    )
    found = libvips.to_vips(pixels).numpy()
    assert not found[:3].any()
    np.testing.assert_array_equal(found[3:], last[..., :3])


WRITES = """
import resource, sys
from pathlib import Path
import numpy as np
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.media.pictures.raw import Stored
def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
folder, height = Path(sys.argv[1]), int(sys.argv[2])
with (folder / "raw").open("wb") as file:
    file.truncate(height * 10000 * 4)
pixels = Stored([folder / "raw"], (height, 10000, 4), np.dtype(np.uint8), (0, 3))
write_picture(folder / "small.tif", Picture(pixels=np.zeros((64, 64, 3), np.uint8)))
before = peak()
write_picture(folder / "out.tif", Picture(pixels=pixels))
print(peak() - before)
"""


@pytest.mark.medium
def test_a_written_scratch_file_does_not_count_as_memory(tmp_path):
    height = 10_000  # 400 MB
    ran = subprocess.run(
        [sys.executable, "-c", WRITES, str(tmp_path), str(height)], capture_output=True, text=True, check=True
    )
    assert int(ran.stdout) < height * 10000 * 4 / 2**20 / 2
