"""Temporary files beside the output for pixels that do not fit into memory; none outlives its command."""

from __future__ import annotations

import errno
import functools
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Thread

from toposeam_cli.files.regular import real_path
from toposeam_cli.files.temporary import claimed, claimed_folder, remove, temporary_beside, tidy_once
from toposeam_cli.files.writing import OutputError, reason

#: Number of files that may be open at once, if the system allows as many: each picture needs a few.
_MOST_OPEN = 1 << 16


class Scratch:
    """A folder for temporary files. The next command removes those that a killed one left."""

    def __init__(self, folder: Path, open_files: ExitStack) -> None:
        self._folder, self._open = folder, open_files
        self._files: list[Path] = []

    def new(self) -> Path:
        """Return an empty file.

        Raises
        ------
        OutputError
        """
        path = temporary_beside(self._folder / "scratch")
        with self.failures_told():
            tidy_once(self._folder)
            self._open.callback(remove, path)
            self._open.enter_context(claimed(path))
        self._files.append(path)
        return path

    def empty(self, needed: Iterable[Path]) -> None:
        """Truncate all files but those that are still needed, in a thread. The files themselves stay to the
        end.
        """
        others = set(self._files).difference(needed)
        thread = Thread(target=_emptied, args=(others,), daemon=True)
        thread.start()
        self._open.callback(thread.join)

    def folder(self) -> Path:
        """Return an empty folder.

        Raises
        ------
        OutputError
        """
        path = temporary_beside(self._folder / "scratch")
        with self.failures_told():
            tidy_once(self._folder)
            return self._open.enter_context(claimed_folder(path))

    @contextmanager
    def failures_told(self) -> Iterator[None]:
        """Report the system's failure to write as one sentence."""
        try:
            yield
        except OutputError:
            raise
        except OSError as error:
            remedy = "free some space or choose another folder for the output"
            if error.errno == errno.EMFILE:
                remedy = "allow more with `ulimit -n 4096`, or join fewer pictures at a time"
            raise OutputError(
                f"cannot keep pixels in '{self._folder}' ({reason(error)}); {remedy}"
            ) from error


@functools.cache
def _let_many_be_open() -> None:
    """Raise the limit of open files. Each temporary file stays open, and the usual limit of 1,024 is too low
    for a thousand pictures.
    """
    with suppress(ImportError, OSError, ValueError):  # Windows has no such limit, others may refuse
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = _MOST_OPEN if most == resource.RLIM_INFINITY else min(most, _MOST_OPEN)
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def _emptied(paths: Iterable[Path]) -> None:
    for path in paths:
        with suppress(OSError):  # they are removed at the end anyway
            os.truncate(path, 0)


@contextmanager
def scratch(folder: Path) -> Iterator[Scratch]:
    """Open a folder for temporary files, which are gone after the block."""
    _let_many_be_open()
    with ExitStack() as open_files:
        yield Scratch(real_path(folder), open_files)
