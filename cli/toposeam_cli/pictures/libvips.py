"""libvips, which decodes and encodes every picture: loaded late, kept quiet, its images made from arrays."""

import functools
import logging
import os
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from toposeam.errors import MissingPackageError
from toposeam_cli.files.interruption import interruptible
from toposeam_cli.pictures.raw import Stored

#: A ``pyvips.Image``; pyvips carries no types.
VipsImage = Any

Value = TypeVar("Value")

_INTERPRETATIONS = {
    (np.dtype(np.uint8), 1): "b-w",
    (np.dtype(np.uint8), 3): "srgb",
    (np.dtype(np.uint16), 1): "grey16",
    (np.dtype(np.uint16), 3): "rgb16",
    (np.dtype(np.float32), 1): "b-w",
    (np.dtype(np.float32), 3): "scrgb",
}

#: Files of raw values are read in strips of about so many bytes, and not in more: each is open for itself.
_STRIP_BYTES, _MOST_OPEN = 1 << 25, 300
_RAW_FORMATS = {
    np.dtype(np.uint8): "uchar",
    np.dtype(np.uint16): "ushort",
    np.dtype(np.float32): "float",
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
    return pyvips


def channels(pixels: np.ndarray | Stored) -> int:
    """The number of channels: 1 for ``(H, W)``, else the last axis."""
    return 1 if pixels.ndim == 2 else pixels.shape[2]


def to_vips(pixels: np.ndarray | Stored) -> VipsImage:
    """A libvips image over the memory of a gray or RGB array, or over a file of raw values."""
    if isinstance(pixels, Stored):
        height, width, bands = pixels.file_shape
        line, count = width * bands * pixels.dtype.itemsize, len(pixels.paths)
        rows = max(1, _STRIP_BYTES // line, -(-height * count // _MOST_OPEN))
        strips = [_strip(pixels, first, min(rows, height - first)) for first in range(0, height, rows)]
        image = load_vips().Image.arrayjoin(strips, across=1) if len(strips) > 1 else strips[0]
        (top, left), (high, wide) = pixels.corner, pixels.shape[:2]
        image = image.extract_band(pixels.bands[0], n=channels(pixels)).crop(left, top, wide, high)
        return image.copy(interpretation=_INTERPRETATIONS[pixels.dtype, channels(pixels)])
    image = load_vips().Image.new_from_array(np.ascontiguousarray(pixels))
    return image.copy(interpretation=_INTERPRETATIONS[pixels.dtype, channels(pixels)])


def _strip(pixels: Stored, first: int, rows: int) -> VipsImage:
    """Some rows of all bands of files, each opened for them alone.

    libvips maps what it reads, and lets go of a strip when it is done with it. Strips are cut from whole
    files, as it takes no offset above 10⁹ bytes.
    """
    height, _, bands = pixels.file_shape
    load, values = load_vips().Image.rawload, _RAW_FORMATS[pixels.dtype]
    pieces = [
        load(os.fsdecode(path), width, height, bands, format=values).crop(0, first, width, rows)
        for path, width in zip(pixels.paths, pixels.widths, strict=True)
    ]
    return functools.reduce(lambda beside, piece: beside.join(piece, "horizontal"), pieces)


def with_profile(image: VipsImage, icc: bytes) -> VipsImage:
    """Return the same pixels with `icc` as the embedded profile."""
    image = image.copy()
    image.set_type(load_vips().GValue.blob_type, "icc-profile-data", icc)
    return image


def evaluate(image: VipsImage, call: Callable[[], Value]) -> Value:
    """The value of a call that computes the pixels of an image, which Ctrl-C and ``kill`` can end."""
    return interruptible(call, lambda: image.set_kill(True))


def reason(error: Exception) -> str:
    """Pick the cause from what libvips says: the operating system's, else the first line."""
    lines = [line.strip() for line in getattr(error, "detail", "").splitlines() if line.strip()]
    system = [line.removeprefix("system error: ") for line in lines if line.startswith("system error: ")]
    return (system or lines or ["unreadable header"])[0]
