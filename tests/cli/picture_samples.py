"""What the tests beside this have in common."""

import struct
import zlib

import numpy as np
import pytest
import pyvips
import tifffile
from PIL import Image, ImageCms

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.picture import read_picture

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


OTHER_SRGB = pyvips.Image.profile_load("srgb")


P3 = pyvips.Image.profile_load("p3")


DEPTHS = {"uint8": 255, "uint16": 65535, "float32": 1.0}


def gray_profile(gamma):
    """A minimal ICC version 2 profile: gray with a plain gamma."""
    description = b"desc\0\0\0\0" + struct.pack(">I", 5) + b"gray\0" + bytes(8 + 2 + 1 + 67 + 2)
    white = b"XYZ \0\0\0\0" + struct.pack(">3i", 63190, 65536, 54061)
    curve = b"curv\0\0\0\0" + struct.pack(">IHH", 1, round(gamma * 256), 0)
    tags = [
        (b"desc", description),
        (b"cprt", b"text\0\0\0\0none\0\0\0\0"),
        (b"wtpt", white),
        (b"kTRC", curve),
    ]
    table, body, start = struct.pack(">I", len(tags)), b"", 128 + 4 + 12 * len(tags)
    for signature, data in tags:
        table += signature + struct.pack(">II", start + len(body), len(data))
        body += data
    size = 128 + len(table) + len(body)
    header = (
        struct.pack(">I4xI", size, 0x02400000)
        + b"mntrGRAYXYZ "
        + struct.pack(">6H", 2020, 1, 1, 0, 0, 0)
        + b"acsp"
        + bytes(28)
    )
    return header + struct.pack(">3i", 63190, 65536, 54061) + bytes(48) + table + body


GRAY22 = gray_profile(2.2)


def sample(dtype, n_channels=3, size=(11, 17), seed=0):
    shape = size if n_channels == 1 else (*size, n_channels)
    values = np.random.default_rng(seed).random(shape) * DEPTHS[dtype]
    return values.astype(dtype) if dtype == "float32" else np.rint(values).astype(dtype)


def smooth(height=40, width=60):
    """An RGB picture that survives lossy compression."""
    y, x = np.mgrid[:height, :width]
    return np.stack([60 + 2 * x, 60 + 3 * y, 200 - x - y], axis=-1).astype(np.uint8)


def fails(function, *arguments, error=ImageError, **options):
    """The one sentence a call fails with."""
    with pytest.raises(error) as caught:
        function(*arguments, **options)
    text = str(caught.value)
    assert text
    assert "\n" not in text
    return text


def refusal(path, **options):
    """The sentence a file is refused with, empty if it is read."""
    try:
        read_picture(path, **options)
    except ImageError as error:
        return str(error)
    return ""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def png_file(width, height, body=b""):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(body))
        + chunk(b"IEND", b"")
    )


def stored(path):
    """The values another program finds in a file."""
    if path.suffix in (".tif", ".tiff"):
        return tifffile.imread(path)
    with Image.open(path) as image:
        return np.asarray(image)
