"""libvips, which decodes and encodes every picture: loaded late, kept quiet, its images made from arrays."""

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

#: What may be decoded. Whatever else a libvips has is blocked, so that nobody's file reaches it by its
#: content: drawings, tables, documents, dumps of libvips' own, all that ImageMagick knows.
_DECODED = ("Png", "Jpeg", "Tiff", "Webp", "Nsgif", "Heif")
#: Drawings of our own are rendered from memory; files are read from sources, which this is not.
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

    Worker processes have to be spawned: libvips' threads do not survive a fork, and the child would wait for
    them forever.
    """
    logging.getLogger("pyvips").setLevel(logging.CRITICAL)  # what matters arrives as an exception
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
    """Return a libvips image over the memory of a gray or RGB array, or over one that is read by windows,
    which may be looked at once, from the top down.
    """
    if isinstance(pixels, Windows):
        image = _streamed(pixels)
    else:
        image = load_vips().Image.new_from_array(np.ascontiguousarray(pixels))
    return image.copy(interpretation=_INTERPRETATIONS[pixels.dtype, channels(pixels)])


def _streamed(pixels: Windows) -> VipsImage:
    """Make an image that libvips reads while it writes. On a failure the file ends there for it, which is an
    error.
    """
    from toposeam_cli.media.pictures.tiff_stream import TiffStream

    stream, source = TiffStream(pixels), load_vips().SourceCustom()

    def read(size: int) -> bytes | None:
        with suppress(Exception):  # the end of the file tells libvips
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
    """Return the value of a call that computes the pixels of an image, which Ctrl-C and ``kill`` can end."""
    return interruptible(call, lambda: image.set_kill(True))


def reason(error: Exception) -> str:
    """Pick the cause from what libvips says: the operating system's, else the first line."""
    lines = [line.strip() for line in getattr(error, "detail", "").splitlines() if line.strip()]
    system = [line.removeprefix("system error: ") for line in lines if line.startswith("system error: ")]
    return (system or lines or ["unreadable header"])[0]
