"""What does not go out, and leaves what is there."""

import resource
from dataclasses import replace

import numpy as np
import pytest
from picture_samples import SRGB, fails, names, sample, smooth, stored
from PIL import Image

from toposeam.errors import ImageError, OptionError
from toposeam_cli.files.scratch import scratch
from toposeam_cli.files.writing import PICTURE_SUFFIXES, OutputError
from toposeam_cli.media.pictures import picture
from toposeam_cli.media.pictures.deep_zoom import write_deep_zoom
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.media.pictures.stored import read_stored


def test_too_large_for_the_format_ends_in_one_sentence(tmp_path):
    for suffix, side in ((".webp", 16_384), (".jpg", 65_501)):
        text = fails(write_picture, tmp_path / f"out{suffix}", Picture(pixels=np.zeros((1, side), np.uint8)))
        assert str(side) in text
        assert ".png or .tif" in text
        write_picture(tmp_path / f"fits{suffix}", Picture(pixels=np.zeros((1, side - 1), np.uint8)))
    assert names(tmp_path) == ["fits.jpg", "fits.webp"]


def test_unsupported_extensions_and_existing_files_are_refused(tmp_path):
    picture = Picture(pixels=smooth())
    assert ".webp" in fails(write_picture, tmp_path / "out.gif", picture, error=OptionError)
    write_picture(tmp_path / "out.png", picture)
    before = (tmp_path / "out.png").read_bytes()
    black = Picture(pixels=np.zeros((3, 3), np.uint8))
    assert "--force" in fails(write_picture, tmp_path / "out.png", black, error=OptionError)
    assert (tmp_path / "out.png").read_bytes() == before
    write_picture(tmp_path / "out.png", black, force=True)
    assert not stored(tmp_path / "out.png").any()
    assert "no folder" in fails(write_picture, tmp_path / "missing" / "out.png", picture, error=OptionError)
    assert names(tmp_path) == ["out.png"]


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
def test_a_disk_that_fills_up_keeps_the_existing_file(tmp_path, suffix, capfd):
    path = tmp_path / f"out{suffix}"
    path.write_bytes(b"precious")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    picture = Picture(pixels=sample("uint8", 3, (200, 300)))
    resource.setrlimit(
        resource.RLIMIT_FSIZE, (20_000, limits[1])
    )  # libvips meets a real failing write after 20 kB
    try:
        text = fails(write_picture, path, picture, error=OutputError, force=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "file too large" in text.lower()
    assert "free some space" in text
    assert path.read_bytes() == b"precious"
    assert names(tmp_path) == [path.name]
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("way", ["BigTIFF", "pyramid", "deep zoom"])
def test_a_disk_that_fills_up_in_the_middle_of_a_large_picture(
    tmp_path, monkeypatch, way, transparent, capfd
):
    monkeypatch.setattr(picture, "_BIGTIFF_BYTES", 0)
    alpha = sample("uint8", 1, (600, 700)) if transparent else None
    noise = Picture(pixels=sample("uint8", 3, (600, 700)), alpha=alpha)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, limits[1]))  # the first tiles are smaller
    try:
        if way == "deep zoom":
            text = fails(write_deep_zoom, tmp_path / "out.dzi", noise, False, error=OutputError)
        else:
            text = fails(
                write_picture,
                tmp_path / "out.tif",
                noise,
                error=OutputError,
                pyramid=way == "pyramid",
                compression="none",
            )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "free some space" in text
    assert names(tmp_path) == []
    assert capfd.readouterr().err == ""


def test_a_disk_that_fills_up_while_pixels_wait(tmp_path):
    write_picture(tmp_path / "in.png", Picture(pixels=np.zeros((300, 400, 3), np.uint8)))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with scratch(tmp_path) as files:
            waits = files.new()
            with pytest.raises(OutputError, match="cannot keep pixels in"), files.failures_told():
                read_stored(tmp_path / "in.png", 10**6, waits)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert names(tmp_path) == ["in.png"]


def test_the_source_itself_can_be_replaced(tmp_path):
    path = tmp_path / "in.png"
    Image.fromarray(smooth()).save(path)
    read = read_picture(path)
    write_picture(path, replace(read, pixels=255 - read.pixels), force=True)
    np.testing.assert_array_equal(stored(path), 255 - smooth())


def test_the_same_picture_gives_the_same_bytes(tmp_path):
    picture = Picture(pixels=sample("uint8", 3, (100, 200)), icc=SRGB, resolution=(10, 10))
    for suffix in PICTURE_SUFFIXES:
        write_picture(tmp_path / f"a{suffix}", picture)
        write_picture(tmp_path / f"b{suffix}", picture)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes(), suffix


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"pixels": np.zeros((3, 4, 4), np.uint8)}, r"\(3, 4, 4\)"),
        ({"pixels": np.zeros((3, 4, 1), np.uint8)}, r"\(3, 4, 1\)"),
        ({"pixels": np.zeros((0, 4), np.uint8)}, r"\(0, 4\)"),
        ({"pixels": np.zeros(4, np.uint8)}, r"\(4,\)"),
        ({"pixels": np.zeros((3, 4))}, "float64"),
        ({"pixels": np.zeros((3, 4), bool)}, "bool"),
        ({"pixels": np.zeros((3, 4), np.uint8), "alpha": np.zeros((4, 3), np.uint8)}, r"\(4, 3\)"),
        ({"pixels": np.zeros((3, 4), np.uint8), "alpha": np.zeros((3, 4), np.uint16)}, "uint16"),
        ({"pixels": np.zeros((3, 4), np.uint8), "resolution": (0.0, 4.0)}, "pixels per mm"),
        ({"pixels": np.zeros((3, 4), np.float32), "alpha": np.full((3, 4), np.nan, np.float32)}, "NaN"),
    ],
)
def test_a_picture_is_checked_on_construction(fields, message):
    with pytest.raises(ImageError, match=message):
        Picture(**fields)
