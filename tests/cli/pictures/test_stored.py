"""Pictures that are decoded a few rows at a time into files: the same as those decoded at once."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import pyvips

from toposeam import ImageError
from toposeam_cli.files.scratch import scratch
from toposeam_cli.media.pictures import decode, picture, stored
from toposeam_cli.media.pictures.picture import Picture, match_pictures, read_picture, write_picture
from toposeam_cli.media.pictures.stored import read_stored, store

HEIGHT, WIDTH = 61, 43


@pytest.fixture(autouse=True)
def few_rows(monkeypatch):
    monkeypatch.setattr(decode, "STRIP_BYTES", 2000)
    monkeypatch.setattr(stored, "_ROWS", 7)


def pixels(*shape, dtype=np.uint8, seed=0):
    values = np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH, *shape))
    return (values / 255).astype(dtype) if dtype == np.float32 else values.astype(dtype) * (dtype(1) + 0)


def half(dtype):
    alpha = np.full((HEIGHT, WIDTH), 1 if dtype == np.float32 else np.iinfo(dtype).max, dtype)
    alpha[40:50, 3:9] = 0
    return alpha


def read(path, tmp_path):
    (tmp_path / "raw").write_bytes(b"")
    return read_stored(path, 10**6, tmp_path / "raw")


def assert_same(ours, theirs):
    np.testing.assert_array_equal(np.asarray(ours.pixels), theirs.pixels)
    assert (ours.alpha is None) == (theirs.alpha is None)
    if theirs.alpha is not None:
        np.testing.assert_array_equal(np.asarray(ours.alpha), theirs.alpha)
    for name in ("icc", "resolution", "exif", "xmp", "source"):
        assert getattr(ours, name) == getattr(theirs, name)


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(), (3,)])
@pytest.mark.parametrize("transparent", [False, True])
def test_rows_make_the_picture(tmp_path, name, dtype, shape, transparent):
    path = tmp_path / name
    alpha = half(dtype) if transparent else None
    write_picture(path, Picture(pixels=pixels(*shape, dtype=dtype), alpha=alpha, resolution=(3, 4)))
    assert_same(read(path, tmp_path), read_picture(path))


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turned_pictures_and_photographs(tmp_path, orientation):
    path = tmp_path / "a.jpg"
    image = pyvips.Image.new_from_array(pixels(3)).copy(interpretation="srgb", xres=3, yres=5)
    image.set_type(pyvips.GValue.gint_type, "orientation", orientation)
    image.write_to_file(str(path))
    assert_same(read(path, tmp_path), read_picture(path))


@pytest.mark.parametrize("form", ["char", "short", "uint", "int"])
def test_other_depths_become_floats(tmp_path, form):
    path = tmp_path / "a.tif"
    pyvips.Image.new_from_array(pixels() // 2).cast(form).write_to_file(str(path))
    expected = read_picture(path)
    assert expected.pixels.dtype == np.float32
    assert_same(read(path, tmp_path), expected)


def test_inks_become_colours(tmp_path):
    path = tmp_path / "a.tif"
    pyvips.Image.new_from_array(pixels(4)).copy(interpretation="cmyk").write_to_file(str(path))
    assert_same(read(path, tmp_path), read_picture(path))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_opacity_that_says_nothing_is_left_out_of_the_file(tmp_path, dtype):
    path, full = tmp_path / "a.png", np.full((HEIGHT, WIDTH), np.iinfo(dtype).max, dtype)
    write_picture(path, Picture(pixels=pixels(3, dtype=dtype), alpha=full))
    assert_same(read(path, tmp_path), replace(read_picture(path), alpha=None))
    assert (tmp_path / "raw").stat().st_size == HEIGHT * WIDTH * 3 * np.dtype(dtype).itemsize


@pytest.mark.parametrize(("transparent", "written"), [(None, HEIGHT), (0, HEIGHT), (40, HEIGHT + 33)])
def test_rows_are_rewritten_only_if_transparency_begins_below(tmp_path, monkeypatch, transparent, written):
    path, alpha, rows = tmp_path / "a.png", np.full((HEIGHT, WIDTH), 255, np.uint8), []
    if transparent is not None:
        alpha[transparent] = 7
    write_picture(path, Picture(pixels=pixels(3), alpha=alpha))
    write = stored._write
    monkeypatch.setattr(
        stored, "_write", lambda target, part: (rows.append(len(part.pixels)), write(target, part))
    )
    read(path, tmp_path)
    assert sum(rows) == written  # 11 rows at a time


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif"])
def test_a_file_that_was_cut_short_is_the_same_sentence(tmp_path, name):
    path = tmp_path / name
    write_picture(path, Picture(pixels=pixels(3)))
    path.write_bytes(path.read_bytes()[:-900])
    with pytest.raises(ImageError) as expected:
        read_picture(path)
    with pytest.raises(ImageError) as ours:
        read(path, tmp_path)
    assert str(ours.value) == str(expected.value)


def test_nan_values_are_refused_in_any_row(tmp_path):
    values = pixels(3, dtype=np.float32)
    values[-1, -1, 0] = np.nan
    pyvips.Image.new_from_array(values).write_to_file(str(tmp_path / "a.tif"))
    with pytest.raises(ImageError, match="NaN"):
        read(tmp_path / "a.tif", tmp_path)


def test_depths_and_channels_are_matched_by_rows(tmp_path, monkeypatch):
    deep = Picture(pixels=pixels(3, dtype=np.uint16))
    flat = Picture(pixels=pixels(seed=1), alpha=half(np.uint8))
    expected = match_pictures([deep, flat])[1]
    converted = []
    real = picture._convert

    def noted(part, **options):
        converted.append(part.pixels.shape[0])
        return real(part, **options)

    with scratch(tmp_path) as files:
        waiting = store(flat, scratch=files)
        monkeypatch.setattr(picture, "_convert", noted)
        one, other = match_pictures([deep, waiting], lambda *given: store(*given, scratch=files))
        assert one is deep
        assert_same(other, expected)
    assert max(converted) == 7
    assert sum(converted) == HEIGHT


PEAK = """
import resource, sys
from pathlib import Path
from toposeam_cli.media.pictures.stored import read_stored
from toposeam_cli.media.pictures.libvips import load_vips
load_vips()
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
before = peak()
picture = read_stored(Path(sys.argv[1]), 10**9, Path(sys.argv[2]))
print(picture.pixels.shape, picture.alpha is None, peak() - before)
"""


@pytest.mark.medium
@pytest.mark.skipif(sys.platform != "linux", reason="counts kB only there")
@pytest.mark.parametrize("bands", [3, 4])
def test_a_large_picture_is_never_in_memory_as_a_whole(tmp_path, bands):
    image = (pyvips.Image.black(10_000, 6000, bands=bands) + 255).cast("uchar")
    image.copy(interpretation="srgb").tiffsave(str(tmp_path / "a.tif"), compression="deflate")
    (tmp_path / "raw").write_bytes(b"")
    code = [sys.executable, "-c", PEAK, str(tmp_path / "a.tif"), str(tmp_path / "raw")]
    # A small process starts it: its own largest memory would be passed on.
    starter = "import subprocess, sys; sys.exit(subprocess.run(sys.argv[1:]).returncode)"
    ran = subprocess.run([sys.executable, "-c", starter, *code], capture_output=True, text=True, check=True)
    assert ran.stdout.startswith("(6000, 10000, 3) True ")
    assert int(ran.stdout.split()[-1]) < 150_000  # kB; 180 and 240 MB of pixels
