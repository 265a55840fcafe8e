"""The journal of a batch: a table of results in JSON lines, from which an interrupted run goes on."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Iterable, Mapping
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from toposeam.errors import OptionError
from toposeam_cli.files.temporary import lock
from toposeam_cli.files.writing import OutputError, check_output, replacing

Row = dict[str, Any]

#: Values of a row's ``status``.
STATUSES = ("started", "done", "failed")
#: Largest table that is read, bytes; that of a hundred thousand jobs has 100 MB.
_LARGEST_BYTES = 2**30


class Journal:
    """A table that grows by one line as soon as a job starts or ends; while it is open, no other run may use
    it.

    Every line is a JSON object with ``name`` and ``status``; of several of one name the last counts. An
    incomplete last line, left by a crash of the machine, is dropped.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: FileIO
        #: The last row of each name.
        self.rows: dict[str, Row] = {}

    def __enter__(self) -> Self:
        """Open the table and read what is there.

        Raises
        ------
        OptionError
            If the file is something else, cannot be written, or is in use.
        """
        check_output(self._path, force=True, suffixes=None)
        self._file = self._path.open("ab+", buffering=0)
        try:
            if not lock(self._file.fileno()):
                raise OptionError(
                    f"another run is writing '{self._path}'; wait for it to end, or choose another file of "
                    "results"
                )
            self._read()
        except BaseException:
            self._file.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the table."""
        self._file.close()

    def add(self, row: Row) -> None:
        """Append a row, and have it on disk before going on.

        Raises
        ------
        OutputError
            If the disk is full or gone.
        """
        self.rows[row["name"]] = row
        try:
            line = _line(row)
            if self._file.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._file.fileno())
        except OSError as error:
            raise OutputError(
                f"cannot write '{self._path}' ({error.strerror}); free some space and run the same again"
            ) from error

    def tidy(self, names: Iterable[str]) -> None:
        """Rewrite the table: one row a job, in the order of `names`, then what the table holds of others."""
        rows = [self.rows[name] for name in dict.fromkeys([*names, *self.rows]) if name in self.rows]
        with replacing(self._path, force=True) as temporary:
            temporary.write_bytes(b"".join(map(_line, rows)))

    def _read(self) -> None:
        if os.fstat(self._file.fileno()).st_size > _LARGEST_BYTES:
            raise OptionError(
                f"'{self._path}' is too large for a table of results; choose another file for them"
            )
        self._file.seek(0)
        lines = self._file.read().split(b"\n")
        torn = lines.pop()
        for number, line in enumerate(lines, start=1):
            row = _row(line)
            if row is None:
                raise OptionError(
                    f"'{self._path}', line {number}, is no row of results; choose another file for them"
                )
            self.rows[row["name"]] = row
        if torn:
            if not lines and not torn.startswith(b'{"name"'):
                raise OptionError(f"'{self._path}' is no table of results; choose another file for them")
            self._file.truncate(sum(map(len, lines)) + len(lines))


def _line(row: Mapping[str, Any]) -> bytes:
    return json.dumps(row, ensure_ascii=False).encode(errors="backslashreplace") + b"\n"


def _row(line: bytes) -> Row | None:
    """Return the row in a line; None if it is not a valid row."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict) or not isinstance(row.get("name"), str) or row.get("status") not in STATUSES:
        return None
    made = row.get("made", {})
    seconds = row.get("seconds", 0.0)
    sane = (
        isinstance(row.get("key", ""), str)
        and isinstance(made, dict)
        and all(isinstance(digest, str) for digest in made.values())
        and isinstance(seconds, int | float)
        and not isinstance(seconds, bool)
        and 0 <= seconds < math.inf
    )
    return row if sane else None
