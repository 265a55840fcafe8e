"""What pictures say about the lens."""

import numpy as np
from PIL import Image

from toposeam_cli.media.pictures.lens import is_fisheye, noted


def circle(radius, corners=0):
    y, x = np.mgrid[:200, :300] - np.array([99.5, 149.5])[:, np.newaxis, np.newaxis]
    return np.where(np.hypot(x, y) < radius, np.uint8(140), np.uint8(corners))


def test_a_circle_in_the_dark_is_a_fisheye(tmp_path):
    assert is_fisheye(circle(100), {})
    assert is_fisheye(circle(100).astype(np.float32)[..., np.newaxis].repeat(3, 2) / 255, {})
    for other in (circle(190), circle(100, corners=40), circle(0), circle(500), circle(100)[:30, :30]):
        assert not is_fisheye(other, {})


def test_the_name_of_a_lens_is_read(tmp_path):
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA434] = "AF DX Fisheye-Nikkor 10.5mm f/2.8G ED"
    Image.fromarray(circle(500)).save(tmp_path / "a.jpg", exif=exif)
    Image.fromarray(circle(500)).save(tmp_path / "b.jpg")
    assert is_fisheye(circle(500), noted(tmp_path / "a.jpg"))
    assert not is_fisheye(circle(500), noted(tmp_path / "b.jpg"))
