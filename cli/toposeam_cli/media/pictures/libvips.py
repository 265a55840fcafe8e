"""libvips, which decodes and encodes every picture: its import, its images of arrays, and its errors."""

import functools
import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np

from toposeam.errors import MissingPackageError
from toposeam.images import Windows
from toposeam_cli.files.interruption import interruptible

#: A ``pyvips.Image``; pyvips carries no types.
VipsImage = Any

Value = TypeVar("Value")

#: Loaders that are allowed. libvips chooses a loader by a file's content, so all others are blocked:
#: drawings, tables, documents, libvips' own dumps, and all formats of ImageMagick.
_DECODED = ("Png", "Jpeg", "Tiff", "Webp", "Nsgif", "Heif")
#: Loader of our own drawings, from memory; files are read from sources, by other loaders.
_DRAWN = "SvgBuffer"

_INTERPRETATIONS = {
    (np.dtype(np.uint8), 1): "b-w",
    (np.dtype(np.uint8), 3): "srgb",
    (np.dtype(np.uint16), 1): "grey16",
    (np.dtype(np.uint16), 3): "rgb16",
    (np.dtype(np.float32), 1): "b-w",
    (np.dtype(np.float32), 3): "scrgb",
}


@functools.cache
def load_vips() -> Any:
    """Import pyvips on first use, which keeps ``toposeam --help`` fast, and keep libvips quiet and its memory
    bounded.

    Worker processes must be spawned: libvips' threads do not survive a fork, and the child would wait for
    them forever.
    """
    logging.getLogger("pyvips").setLevel(logging.CRITICAL)  # errors arrive as exceptions
    try:
        import pyvips
    except (ImportError, OSError) as error:
        raise MissingPackageError(
            "reading and writing pictures needs libvips; install it with: pip install 'pyvips[binary]'"
        ) from error
    pyvips.cache_set_max(0)  # cached operations would keep finished pictures in memory
    pyvips.operation_block_set("VipsForeignLoad", True)
    for kind in (*_DECODED, _DRAWN):
        pyvips.operation_block_set(f"VipsForeignLoad{kind}", False)
    return pyvips


def channels(pixels: np.ndarray | Windows) -> int:
    """Return the number of channels: 1 for ``(H, W)``, else the last axis."""
    return 1 if pixels.ndim == 2 else pixels.shape[2]


def to_vips(pixels: np.ndarray | Windows) -> VipsImage:
    """Return a libvips image that shares the memory of a gray or RGB array. Of an array that is read by
    windows the image can be read once, from the top down.
    """
    if isinstance(pixels, Windows):
        image = _streamed(pixels)
    else:
        image = load_vips().Image.new_from_array(np.ascontiguousarray(pixels))
    return image.copy(interpretation=_INTERPRETATIONS[pixels.dtype, channels(pixels)])


def _streamed(pixels: Windows) -> VipsImage:
    """Make an image whose windows libvips reads while it writes. A failure ends the stream early, which
    libvips reports as an error.
    """
    from toposeam_cli.media.pictures.tiff_stream import TiffStream

    stream, source = TiffStream(pixels), load_vips().SourceCustom()

    def read(size: int) -> bytes | None:
        with suppress(Exception):  # libvips reports the early end of the file
            return stream.read(size)
        return None

    source.on_read(read)
    source.on_seek(stream.seek)
    return load_vips().Image.new_from_source(source, "", access="sequential", fail_on="error")


def with_profile(image: VipsImage, icc: bytes) -> VipsImage:
    """Return the same pixels with `icc` as the embedded profile."""
    image = image.copy()
    image.set_type(load_vips().GValue.blob_type, "icc-profile-data", icc)
    return image


def fits_profile(icc: bytes | None, n_channels: int) -> bool:
    """Test whether a profile describes that many channels; its colour space stands at byte 16 (ICC.1:2022,
    7.2.6).
    """
    return icc is not None and icc[16:20] == (b"GRAY" if n_channels == 1 else b"RGB ")


def evaluate(image: VipsImage, call: Callable[[], Value]) -> Value:
    """Call a function that computes the pixels of an image, such that Ctrl-C and ``kill`` can end it."""
    return interruptible(call, lambda: image.set_kill(True))


def reason(error: Exception) -> str:
    """Return the cause in libvips' error: the operating system's message, else the first line."""
    lines = [line.strip() for line in getattr(error, "detail", "").splitlines() if line.strip()]
    system = [line.removeprefix("system error: ") for line in lines if line.startswith("system error: ")]
    return (system or lines or ["unreadable header"])[0]
