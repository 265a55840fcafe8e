"""Checks of the unpacked size of compressed bytes before unpacking: two megabytes can hold gigabytes."""

from __future__ import annotations

import bz2
import lzma
import struct
import zlib
from collections.abc import Callable
from typing import Any

#: Decompressors of methods that are measured by unpacking piece by piece, without keeping the pieces.
_STREAMS: dict[str, Callable[[], Any]] = {
    "zlib": zlib.decompressobj,
    "gzip": lambda: zlib.decompressobj(wbits=31),
    "bz2": bz2.BZ2Decompressor,
    "lzma": lambda: lzma.LZMADecompressor(memlimit=1 << 28),
}
_PIECE = 1 << 20
#: Magic numbers of Zstandard's frames and of skippable ones, and the most bytes of a block.
_ZSTD_MAGIC, _ZSTD_SKIPPED, _ZSTD_BLOCK = 0xFD2FB528, 0x184D2A50, 1 << 17
#: Tolerated ratio of the blocks' capacity to the size, for writers that do not fill their blocks.
_ZSTD_WASTE = 16


def unpacks_within(packed: bytes, method: str, most: int) -> bool:
    """Test whether bytes unpack to at most `most` bytes, as exactly as the method allows.

    Parameters
    ----------
    packed : bytes
    method : str
        ``zlib``, ``gzip``, ``bz2``, ``lzma``, ``zstd``, ``blosc`` or ``lz4`` (as numcodecs writes it). Other
        methods always pass.
    most : int
        Limit, bytes.

    Raises
    ------
    ValueError, OSError, EOFError, struct.error, zlib.error, lzma.LZMAError
        If the bytes are damaged.

    Examples
    --------
    >>> [unpacks_within(zlib.compress(bytes(1000)), "zlib", most) for most in (999, 1000)]
    [False, True]
    """
    if method in _STREAMS:
        return _stream_within(packed, _STREAMS[method], most)
    if method == "zstd":
        return _zstd_blocks(packed) * _ZSTD_BLOCK <= max(_ZSTD_WASTE * most, 1 << 26)
    if method == "blosc":
        return int(struct.unpack_from("<I", packed, 4)[0]) <= most
    if method == "lz4":
        return int(struct.unpack_from("<I", packed)[0]) <= most
    return True


def _stream_within(packed: bytes, new: Callable[[], Any], most: int) -> bool:
    total = 0
    while packed:
        stream = new()
        piece = packed
        while not stream.eof:
            unpacked = stream.decompress(piece, _PIECE)
            total += len(unpacked)
            if total > most:
                return False
            piece = getattr(stream, "unconsumed_tail", b"")
            if not unpacked and not piece:
                break  # truncated; the reader reports it
        packed = stream.unused_data
        if new is not _STREAMS["gzip"]:
            break  # only gzip may have further streams
    return True


def _zstd_blocks(packed: bytes) -> int:
    """Count the blocks in frames of Zstandard (RFC 8878)."""
    at, count = 0, 0
    while at + 5 <= len(packed):
        magic, head = struct.unpack_from("<IB", packed, at)
        if magic & 0xFFFFFFF0 == _ZSTD_SKIPPED:
            at += 8 + int(struct.unpack_from("<I", packed, at + 4)[0])
            continue
        if magic != _ZSTD_MAGIC:
            break
        single = head >> 5 & 1
        at += 5 + (not single) + (0, 1, 2, 4)[head & 3] + (single, 2, 4, 8)[head >> 6]
        last = False
        while not last and at + 3 <= len(packed):
            block = int.from_bytes(packed[at : at + 3], "little")
            last, kind, size = bool(block & 1), block >> 1 & 3, block >> 3
            at += 3 + (1 if kind == 1 else size)
            count += 1
        at += 4 * (head >> 2 & 1)
    return count
