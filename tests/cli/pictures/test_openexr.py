"""OpenEXR in and out: maps of materials as renderers write them."""

import sys

import numpy as np
import pytest
from scipy import ndimage

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.decode import size_of
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


@pytest.fixture
def exr():
    return pytest.importorskip("OpenEXR")


@pytest.fixture
def colours():
    noise = np.random.default_rng(0).normal(size=(70, 90, 3))
    return (4 * ndimage.gaussian_filter(noise, (2, 2, 0)) + 1).astype(np.float32)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("channels", [slice(None), 0])
def test_floats_come_back_as_they_were(exr, here, colours, channels):
    given = colours[..., channels]
    write_picture("map.exr", Picture(pixels=given))
    assert size_of(here / "map.exr") == (90, 70)
    found = read_picture("map.exr")
    assert found.pixels.dtype == np.float32
    np.testing.assert_array_equal(found.pixels, given)


def test_opacity_multiplies_colours_in_the_file_alone(exr, here, colours):
    alpha = np.linspace(0, 1, 70 * 90, dtype=np.float32).reshape(70, 90)
    write_picture("leaf.exr", Picture(pixels=colours, alpha=alpha))
    stored = exr.File("leaf.exr", separate_channels=True).channels()["R"].pixels
    np.testing.assert_allclose(stored, colours[..., 0] * alpha, rtol=1e-6)
    found = read_picture("leaf.exr")
    np.testing.assert_array_equal(found.alpha, alpha)
    np.testing.assert_allclose(found.pixels[alpha > 0], colours[alpha > 0], rtol=1e-5)


def test_half_floats_and_other_names_are_read(exr, here, colours):
    exr.File({}, {"height": colours[..., 0].astype(np.float16)}).write("height.exr")
    np.testing.assert_array_equal(
        read_picture("height.exr").pixels, colours[..., 0].astype(np.float16).astype(np.float32)
    )


def test_a_material_of_exr_stays_one(exr, here, colours, toposeam):
    (here / "wall").mkdir()
    write_picture("wall/wall_albedo.exr", Picture(pixels=colours))
    write_picture("wall/wall_height.exr", Picture(pixels=100 * colours[..., 1]))
    ran = toposeam("tile", "wall", "-o", "tiled", "--band", "10")
    assert ran.code == 0, ran
    made, height = (read_picture(f"tiled/wall_{name}.exr").pixels for name in ("albedo", "height"))
    np.testing.assert_array_equal(made[15:-15, 15:-15], colours[15:-15, 15:-15])
    assert not set(np.unique(height)) - set(np.unique(100 * colours[..., 1]))
    assert toposeam("synth", "wall/wall_albedo.exr", "--size", "99", "-o", "large.exr").code == 0
    assert read_picture("large.exr").pixels.max() > 1


def test_what_exr_cannot_give_ends_in_one_sentence(exr, here, colours, toposeam):
    write_picture("whole.exr", Picture(pixels=colours))
    content = (here / "whole.exr").read_bytes()
    (here / "cut.exr").write_bytes(content[: len(content) // 2])
    exr.File({}, dict.fromkeys(("u", "v", "w"), colours[..., 0])).write("motion.exr")
    window = {"displayWindow": (np.array([0, 0], np.int32), np.array([99, 99], np.int32))}
    exr.File(window, {"Y": colours[..., 0]}).write("part.exr")
    for name, phrase in (
        ("cut", "damaged or cut short"),
        ("motion", "has the channels u, v, w"),
        ("part", "not cropped"),
    ):
        ran = toposeam("tile", f"{name}.exr", "-o", "made.tif")
        assert ran.code != 0
        assert phrase in ran.err, ran.err
        assert len(ran.err.strip().splitlines()) == 1
    assert "write .tif instead" in toposeam("tile", "whole.exr", "-o", "made.png").err
    assert "not supported" in toposeam("stitch", "whole.exr", "whole.exr", "-o", "made.exr").err
    assert not list(here.glob("made*"))
    with pytest.raises(ImageError, match="megapixels allowed"):
        read_picture("whole.exr", 1000)


def test_without_openexr_the_remedy_is_named(here, colours, toposeam, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    (here / "map.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(20))
    write_picture("wall.tif", Picture(pixels=colours))
    for line in ("tile map.exr -o made.tif", "tile wall.tif -o made.exr"):
        ran = toposeam(*line.split())
        assert ran.code != 0
        assert "pip install OpenEXR" in ran.err
    assert not list(here.glob("made*"))
