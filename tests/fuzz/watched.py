"""What both fuzzers share: hostile values, files gone bad, and a watch on time and memory."""

import json
import random
import resource
import signal
import struct
import sys
import time
import zlib
from contextlib import contextmanager

#: No case may take more processor time, s, or make the process grow by more, bytes.
LONGEST_S, LARGEST_BYTES = 20.0, 2**30

NUMBERS = [
    "0",
    "1",
    "-1",
    "2",
    "0.5",
    "1e308",
    "1e309",
    "-1e9",
    "nan",
    "inf",
    "-inf",
    "1e-300",
    "2147483648",
    "18446744073709551616",
    "9" * 40,
    "9" * 5001,
    "0x10",
    "1_000",
    "١",
    "",
    " ",
    "1,5",
    "½",
]
WORDS = [
    *NUMBERS,
    "x",
    "a b",
    "é",
    "\x1b[31m",
    "\udcff",
    "'",
    '"',
    "%s",
    "{name}",
    "{0}",
    "*",
    "?",
    "..",
    "/",
    "~",
    "--",
    "-",
    "-o",
    "=",
    "0=",
    "=a.png",
    "\n",
    "]]>",
    "&amp;",
    "none",
    "auto",
    "both",
    "true",
    "a" * 300,
]


class TooLong(BaseException):
    """A case took too long; nobody catches it by accident."""


@contextmanager
def watched(longest=LONGEST_S):
    """Raise :class:`TooLong` in time; the yielded dict says afterwards what was spent: time, and memory."""

    def ring(number, frame):
        raise TooLong

    spent = {}
    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, longest)
    start, most = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        yield spent
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
        spent["seconds"] = round(time.process_time() - start, 3)
        spent["grown"] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - most) * 1024


def plain_png(width, height):
    """A PNG in one colour that is much smaller than what it unpacks to."""

    def chunk(kind, content):
        body = kind + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    packed = zlib.compressobj(1)
    rows = bytes(100 * (width + 1))
    content = b"".join([*(packed.compress(rows) for _ in range(height // 100)), packed.flush()])
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", content) + chunk(b"IEND", b"")


def gone_bad(content: bytes, rng: random.Random) -> bytes:
    """A file of which something is wrong, be it text or a picture, its checksums right where they can be."""
    how = rng.randrange(8)
    if not content or how == 0:
        return b""
    if how == 1:
        return content[: rng.randrange(len(content))]
    data = bytearray(content)
    if how == 2:
        for _ in range(rng.choice([1, 3, 30])):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif how == 3:
        start = rng.randrange(len(data))
        data[start:start] = bytes(rng.choices(range(256), k=rng.choice([1, 8, 300])))
    elif how == 4:
        start = rng.randrange(len(data))
        del data[start : start + rng.choice([1, 4, 64])]
    elif how == 5 and content.startswith(b"\x89PNG"):  # another size, told with the right checksum
        for place in (16, 20):
            if rng.random() < 0.7:
                size = rng.choice([0, 1, 60000, 2**31 - 1, 2**32 - 1])
                data[place : place + 4] = size.to_bytes(4, "big")
        data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    else:
        text = content.decode("utf-8", "surrogateescape")
        tokens = [
            index for index, character in enumerate(text) if character.isdigit() or character in "\"'[]{},=<>"
        ]
        for _ in range(rng.choice([1, 1, 2, 5])):
            if tokens:
                index = min(rng.choice(tokens), len(text) - 1)
                text = text[:index] + rng.choice([*WORDS, "[" * 2000, "{}", "null", "-"]) + text[index + 1 :]
        return text.encode("utf-8", "surrogateescape")
    return bytes(data)


def tell(**what):
    """One line for whoever started us."""
    sys.__stdout__.write(json.dumps(what, default=repr) + "\n")
    sys.__stdout__.flush()
