"""Loops in C, built where a compiler was (``hatch_build.py``); :data:`library` holds them, or is None.

Who calls one has NumPy's or SciPy's way besides, with the same results, and takes it where `library` is None:
where there was no compiler, where the sources have changed since, or if the environment says
``TOPOSEAM_KERNELS=0``.
"""

from __future__ import annotations

import ctypes
import os
import zlib
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from numpy.ctypeslib import ndpointer

#: The functions of the C files, called by array; others may run meanwhile, as they let go of Python's lock.
library: Any = None

_FOLDER = Path(__file__).parent
_INT, _LONG, _FLOAT, _DOUBLE = ctypes.c_int32, ctypes.c_int64, ctypes.c_float, ctypes.c_double
_FLAGS, _BYTES, _INTS, _FLOATS, _DOUBLES, _PIXELS = map(
    partial(ndpointer, flags="C"), ("?", "u1", "i4", "f4", "f8", None)
)
#: What each function takes, in the order of its declaration in C.
_TAKES = {
    "blurred": (_INT, _INT, _INT, _FLOATS, _INT, _DOUBLES, _FLOATS),
    "smallest_hot_side": (_INT, _LONG, _INTS, _INTS, _INTS, _FLAGS),
    "sweep_bricks": (_LONG, _INT, _INT, _INT, _FLOAT, *[ctypes.c_void_p] * 18),
    "nearest_patches": (*[_INT] * 5, _FLOATS, _INTS, _FLOATS, _INTS, _INTS, _FLOATS),
    "between_knots": (_INT, _INT, _INT, _INT, _DOUBLES, _DOUBLES),
    "spline_values": (_INT, _INT, _INT, _FLOATS, _DOUBLES, _LONG, _DOUBLES, _FLOATS),
    "cheapest_way": (_INT, _INT, _FLOATS, _FLOATS, _INT, _INT, _DOUBLE, _BYTES, _DOUBLES),
    "join_pieces": (_INT, _DOUBLES, _DOUBLES, _DOUBLES),
    "catmull_values": (_INT, _INT, _INT, _INT, _PIXELS, _LONG, _DOUBLES, _DOUBLE, _FLAGS, _PIXELS),
}

if os.environ.get("TOPOSEAM_KERNELS") != "0":
    _sources = b"".join(map(Path.read_bytes, sorted(_FOLDER.glob("*.[ch]"))))
    _name = f"kernels-{zlib.crc32(_sources):08x}{'.dll' if os.name == 'nt' else '.so'}"
    with suppress(OSError):  # there is none, or one of another system
        library = ctypes.CDLL(str(_FOLDER / _name))
        for _function, _kinds in _TAKES.items():
            getattr(library, _function).argtypes = _kinds
