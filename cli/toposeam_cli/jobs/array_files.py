"""Files by which processes pass large arrays to each other, on storage that all of them see.

A table that one worker makes and others read in places would be most of the traffic through a scheduler. So
each read-only array is written once, into a folder, and its pickle holds the file's path: unpickling maps the
file, and reads only the pages that are used.
"""

from __future__ import annotations

import io
import pickle
import uuid
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

#: Least size of an array that goes by a file, and of a part of it, bytes: smaller ones are faster in the
#: pickle.
LEAST_BYTES, _LEAST_PART = 1 << 14, 1 << 12

Array = npt.NDArray[Any]


class ArrayFiles:
    """Pickles of values whose large arrays lie as files in one folder.

    Parameters
    ----------
    folder : Path, optional
        Where the files are written; without it every array is pickled as usual.

    Examples
    --------
    >>> import tempfile
    >>> table = np.zeros((500, 700))
    >>> table.setflags(write=False)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     one = ArrayFiles(Path(folder))
    ...     first, second = one.pickled(table), one.pickled(table[100:200])
    ...     len(first) + len(second) < 1000, len(list(Path(folder).iterdir()))
    ...     pickle.loads(second).shape
    (True, 1)
    (100, 700)
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        #: Bytes written into the folder.
        self.written = 0
        #: Arrays that have a file, by their identity in memory.
        self._stored: dict[int, tuple[weakref.ref[Array], Path]] = {}

    def pickled(self, value: Any) -> bytes:
        """Pickle a value for any process that sees the folder.

        Raises
        ------
        OSError
            When the folder cannot be written to.
        """
        stream = io.BytesIO()
        _Pickler(stream, self).dump(value)
        return stream.getvalue()

    def place(self, array: Array) -> tuple[Any, ...] | None:
        """Store an array; return the arguments of :func:`mapped`, or None when it is to be pickled as
        usual.
        """
        owner = array
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        if owner.flags.writeable or array.dtype.hasobject:
            return None
        if owner.nbytes < LEAST_BYTES or array.nbytes < _LEAST_PART:
            return None
        if isinstance(owner, np.memmap) and owner.filename is not None:
            path = Path(owner.filename)
        elif self.folder is None or owner.nbytes < array.nbytes or not owner.flags.c_contiguous:
            return None  # no folder, or a broadcast view of one value
        else:
            path = self._path(owner, self.folder)
        start = array.__array_interface__["data"][0] - owner.__array_interface__["data"][0]
        return str(path), array.dtype.str, array.shape, array.strides, start

    def _path(self, owner: Array, folder: Path) -> Path:
        known = self._stored.get(id(owner))
        if known is not None and known[0]() is owner:
            return known[1]
        path = folder / uuid.uuid4().hex
        path.write_bytes(owner.data)
        self.written += owner.nbytes
        number = id(owner)
        self._stored[number] = weakref.ref(owner, lambda _: self._stored.pop(number, None)), path
        return path


class _Pickler(pickle.Pickler):
    def __init__(self, stream: io.BytesIO, arrays: ArrayFiles) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self._arrays = arrays

    def reducer_override(self, value: Any) -> Any:
        """Pickle an array that has a file as its place there."""
        place = self._arrays.place(value) if isinstance(value, np.ndarray) else None
        return NotImplemented if place is None else (mapped, place)


def mapped(path: str, dtype: str, shape: tuple[int, ...], strides: tuple[int, ...], start: int) -> Array:
    """Map a read-only array of a file.

    Parameters
    ----------
    path : str
    dtype : str
    shape, strides : tuple of int
    start : int
        Offset of its first value in the file, bytes.
    """
    return np.ndarray(shape, dtype, np.memmap(path, np.uint8, "r"), start, strides)
