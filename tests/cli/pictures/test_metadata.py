"""EXIF, XMP and resolution, and what is loaded for them."""

import io
import os
import struct
import subprocess
import sys

import numpy as np
import pytest
import pyvips
from picture_samples import smooth
from PIL import Image

from toposeam_cli.files.writing import TEXTURE_SUFFIXES
from toposeam_cli.media.pictures import picture as picture_module
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.motifs.recipe_files import to_xmp


def test_importing_the_module_does_not_load_libvips():
    code = "import sys, toposeam_cli.media.pictures.picture; sys.exit('pyvips' in sys.modules)"
    assert (
        subprocess.run(
            [sys.executable, "-c", code], env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path))
        ).returncode
        == 0
    )


def test_the_formats_are_the_ones_the_check_allows():
    assert tuple(picture_module._FORMATS) == TEXTURE_SUFFIXES


PACKET = (
    '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF'
    ' xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
    'xmlns:tiff="http://ns.adobe.com/tiff/1.0/" tiff:Orientation="6" '
    'xmlns:dc="http://purl.org/dc/elements/1.1/" dc:source="the attic"/></rdf:RDF></x:xmpmeta><?xpacket '
    'end="w"?>'
).encode()


def photograph(path):
    """A picture with all that a camera and an editor write, lying on its side."""
    exif = Image.Exif()
    exif.update({0x010F: "Maker", 0x0112: 6, 0x8298: "(c) Somebody"})
    exif.get_ifd(0x8769).update(
        {0x829A: (1, 250), 0x9003: "2024:01:02 03:04:05", 0xA002: 60, 0xA003: 40, 0x927C: b"makernote" * 9}
    )
    exif.get_ifd(0x8825).update({1: "N", 2: (47.0, 30.0, 12.5)})
    Image.fromarray(smooth(40, 60)).save(path, exif=exif, xmp=PACKET, dpi=(300, 150))


@pytest.mark.parametrize("target", [".jpg", ".png", ".webp", ".tif"])
@pytest.mark.parametrize("source", [".jpg", ".webp"])
def test_metadata_is_copied_where_the_format_has_a_place_for_it(tmp_path, source, target):
    photograph(tmp_path / f"in{source}")
    write_picture(tmp_path / f"out{target}", read_picture(tmp_path / f"in{source}"))
    again = read_picture(tmp_path / f"out{target}")
    assert again.pixels.shape == (60, 40, 3)
    assert again.xmp == PACKET.replace(b'Orientation="6"', b'Orientation="1"')
    with Image.open(tmp_path / f"out{target}") as image:
        exif = image.getexif()
        assert exif.get(0x0112, 1) == 1
        if target == ".tif":
            return  # libvips writes no EXIF into TIFF
        assert (exif[0x010F], exif[0x8298]) == ("Maker", "(c) Somebody")
        camera = exif.get_ifd(0x8769)
        assert (camera[0x9003], camera[0x829A], camera[0x927C]) == (
            "2024:01:02 03:04:05",
            (1, 250),
            b"makernote" * 9,
        )
        assert (camera[0xA002], camera[0xA003]) == (40, 60)
        assert dict(exif.get_ifd(0x8825)) == {1: "N", 2: (47.0, 30.0, 12.5)}
        if source == ".jpg":
            assert (exif[0x011A], exif[0x011B]) == pytest.approx((150, 300), rel=1e-4)


def test_a_picture_without_metadata_gets_none(tmp_path):
    Image.fromarray(smooth()).save(tmp_path / "in.png")
    picture = read_picture(tmp_path / "in.png")
    assert (picture.exif, picture.xmp) == (None, None)


def test_the_thumbnail_of_the_source_is_not_that_of_the_result(tmp_path):
    thumbnail = io.BytesIO()
    Image.fromarray(smooth(8, 8)).save(thumbnail, "JPEG")
    head = b"II*\0" + struct.pack("<I", 8)
    first = struct.pack("<H", 1) + struct.pack("<HHII", 0x0112, 3, 1, 1) + struct.pack("<I", 26)
    start = 26 + 2 + 2 * 12 + 4
    second = (
        struct.pack("<H", 2)
        + struct.pack("<HHII", 0x0201, 4, 1, start)
        + struct.pack("<HHII", 0x0202, 4, 1, thumbnail.tell())
    )
    exif = b"Exif\0\0" + head + first + second + struct.pack("<I", 0) + thumbnail.getvalue()
    Image.fromarray(smooth()).save(tmp_path / "in.jpg", exif=exif)
    assert thumbnail.getvalue() in (tmp_path / "in.jpg").read_bytes()
    write_picture(tmp_path / "out.jpg", read_picture(tmp_path / "in.jpg"))
    assert thumbnail.getvalue() not in (tmp_path / "out.jpg").read_bytes()


def test_the_recipe_of_a_motif_is_not_read_as_metadata(tmp_path):
    recipe = to_xmp({"recipe": {}})
    write_picture(tmp_path / "motif.png", Picture(pixels=smooth(), xmp=recipe))
    assert pyvips.Image.new_from_file(str(tmp_path / "motif.png")).get("xmp-data") == recipe
    assert read_picture(tmp_path / "motif.png").xmp is None


@pytest.mark.parametrize("target", [".jpg", ".png", ".webp", ".tif"])
def test_oversized_or_damaged_metadata_does_not_stop_writing(tmp_path, target, capfd):
    for index, block in enumerate([b"", b"nonsense" * 20_000, PACKET.replace(b"attic", b"attic" * 40_000)]):
        path = tmp_path / f"{index}{target}"
        write_picture(path, Picture(pixels=smooth(), xmp=block))
        with Image.open(path) as image:
            image.load()
        assert np.abs(read_picture(path).pixels.astype(int) - smooth()).mean() < 3
    for index, block in enumerate(
        [b"", b"II*\0\xff\xff\xff\xff", b"II*\0\x08\0\0\0\xff\xff", b"nonsense" * 7000]
    ):
        Image.fromarray(smooth()).save(tmp_path / "in.jpg", exif=b"Exif\0\0" + block)
        write_picture(tmp_path / f"again{index}{target}", read_picture(tmp_path / "in.jpg"))
    large = (
        b"Exif\0\0II*\0\x08\0\0\0"
        + struct.pack("<H", 1)
        + struct.pack("<HHII", 0x9286, 7, 80_000, 26)
        + bytes(4 + 80_000)
    )
    Image.fromarray(smooth()).save(tmp_path / "in.png", exif=large)
    write_picture(tmp_path / f"large{target}", read_picture(tmp_path / "in.png"))
    assert capfd.readouterr().err == ""


def test_a_resolution_that_is_not_stated_is_not_made_up(tmp_path):
    exif = Image.Exif()
    exif[0x010F] = "Maker"
    Image.fromarray(smooth()).save(tmp_path / "in.webp", exif=exif)
    assert read_picture(tmp_path / "in.webp").resolution is None
