"""A virtual TIFF file whose strips are made while libvips reads it, from pixels that may come later."""

from __future__ import annotations

import io
import math
import struct
from typing import Any

from toposeam.images import Windows
from toposeam_cli.media.layouts.tiff_place import KINDS

#: Rows of a strip.
_ROWS = 16
#: The types of TIFF values that are written here.
_SHORT, _LONG, _LONG8 = 3, 4, 16
#: Values of `SampleFormat` for floats, and of `PhotometricInterpretation` for gray and RGB.
_FLOAT, _GRAY, _RGB = 3, 1, 2
#: Sizes of BigTIFF's header, of an entry of its directory, and of the count and link around the entries,
#: bytes.
_BEGINS, _ENTRY, _AROUND = 16, 20, 16


class TiffStream(io.RawIOBase):
    """A stream of the bytes of an uncompressed BigTIFF file; its image is read a strip at a time.

    Parameters
    ----------
    pixels : Windows
        (H, W) or (H, W, 3) of uint8, uint16 or float32.

    Examples
    --------
    >>> import tifffile
    >>> import numpy as np
    >>> class Ramp(Windows):
    ...     def read(self, rows, columns):
    ...         return np.add.outer(np.r_[rows], np.r_[columns]).astype(self.dtype)
    >>> tifffile.imread(TiffStream(Ramp((50, 70), np.uint16)))[49, 66:].tolist()
    [115, 116, 117, 118]
    """

    def __init__(self, pixels: Windows) -> None:
        self._pixels, self._at = pixels, 0
        height, width = pixels.shape[:2]
        line = width * math.prod(pixels.shape[2:]) * pixels.dtype.itemsize
        self._strip = _ROWS * line
        self._head = _head(pixels, line)
        self._size = len(self._head) + height * line
        self._kept: tuple[int, bytes] = -1, b""

    def readable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def tell(self) -> int:
        """Return the byte that is read next."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a byte, counted from the start of the file, from here, or from its end."""
        self._at = max(0, offset + (0, self._at, self._size)[whence])
        return self._at

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer as far as the file goes; return the number of bytes."""
        buffer, filled = memoryview(buffer).cast("B"), 0
        while filled < len(buffer) and self._at < self._size:
            if self._at < len(self._head):
                source, start = self._head, self._at
            else:
                number, start = divmod(self._at - len(self._head), self._strip)
                source = self._bytes(number)
            found = memoryview(source)[start : start + len(buffer) - filled]
            buffer[filled : filled + len(found)] = found
            filled += len(found)
            self._at += len(found)
        return filled

    def _bytes(self, number: int) -> bytes:
        """Return the bytes of a strip, which are kept until another strip is read."""
        if self._kept[0] != number:
            height, width = self._pixels.shape[:2]
            rows = slice(number * _ROWS, min((number + 1) * _ROWS, height))
            values = self._pixels.read(rows, slice(0, width))
            self._kept = number, values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
        return self._kept[1]


def _head(pixels: Windows, line: int) -> bytes:
    """Build the bytes before the pixels: header, directory and long values. A row has `line` bytes."""
    height, width = pixels.shape[:2]
    bands = math.prod(pixels.shape[2:])
    starts = range(0, height, _ROWS)
    sizes = [min(_ROWS, height - start) * line for start in starts]
    tags = {
        256: (_LONG, [width]),
        257: (_LONG, [height]),
        258: (_SHORT, [8 * pixels.dtype.itemsize] * bands),
        259: (_SHORT, [1]),  # not compressed
        262: (_SHORT, [_GRAY if bands == 1 else _RGB]),
        273: (_LONG8, [start * line for start in starts]),
        277: (_SHORT, [bands]),
        278: (_LONG, [_ROWS]),
        279: (_LONG8, sizes),
        339: (_SHORT, [_FLOAT if pixels.dtype.kind == "f" else 1] * bands),
    }
    lengths = {tag: len(values) * struct.calcsize("<" + KINDS[kind]) for tag, (kind, values) in tags.items()}
    at = _BEGINS + len(tags) * _ENTRY + _AROUND
    begin = at + sum(length for length in lengths.values() if length > 8)
    tags[273] = _LONG8, [begin + start for start in tags[273][1]]
    entries, behind = [], []
    for tag, (kind, values) in tags.items():
        packed = struct.pack(f"<{len(values)}{KINDS[kind]}", *values)
        if len(packed) > 8:
            behind.append(packed)
            packed, at = struct.pack("<Q", at), at + len(packed)
        entries.append(struct.pack("<HHQ8s", tag, kind, len(values), packed))
    first = struct.pack("<2sHHHQ", b"II", 43, 8, 0, _BEGINS)
    return b"".join([first, struct.pack("<Q", len(tags)), *entries, bytes(8), *behind])
