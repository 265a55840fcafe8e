"""Workers for the independent parts of one computation: processes of this machine, or a Dask cluster.

:class:`TaskCrew` is an executor of :mod:`toposeam.layers.execution.tasks`. Workers start with the first item.
Items that a worker had begun when it died are done again.
"""

from __future__ import annotations

import ctypes
import functools
import logging
import multiprocessing
import os
import pickle
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toposeam.errors import TopoSeamError
from toposeam.sentence import sentence

if TYPE_CHECKING:
    from toposeam_cli.files.scratch import Scratch
    from toposeam_cli.jobs.array_files import ArrayFiles
    from toposeam_cli.jobs.workers import Workers

_LOGGER = logging.getLogger(__name__)

#: A function and an item, pickled, and the folder with the files of their arrays and of the result's.
Call = tuple[bytes, Path | None]

#: Arguments of glibc's ``mallopt``, bytes: the largest block taken from a heap (M_MMAP_THRESHOLD, -3), and
#: the free memory kept at the end of the main heap (M_TRIM_THRESHOLD, -1) and of those of threads (M_TOP_PAD,
#: -2).
_HEAPS = {-3: 1 << 25, -1: 1 << 28, -2: 1 << 26}

#: Interval at which a waiting call looks for signals, s.
_LOOK_EVERY_S = 1.0
#: Items per worker that may be handed out ahead of the result that is returned next. More would keep more
#: results in memory.
_AHEAD = 4
#: Items queued per worker besides the one in work, so that it never waits for us. On Dask more are queued:
#: all but one wait at the scheduler, which gives each to the first free worker.
_WAITING, _WAITING_ON_DASK = 1, 3


class WorkersDiedError(TopoSeamError, RuntimeError):
    """Workers died again and again of the same part of the work."""


def processes_of(wanted: int | None) -> int:
    """Return the number of processes: `wanted`, else one for each core that this process may use. In a worker
    that is one, as the other workers use the other cores.
    """
    if wanted is not None:
        return wanted
    if multiprocessing.parent_process() is not None:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class TaskCrew:
    """Workers that run for the time of a block (:func:`crew`)."""

    def __init__(self, processes: int, dask: str | None, block: ExitStack, store: Scratch | None) -> None:
        self._processes, self._dask, self._block, self._store = processes, dask, block, store
        self._workers: Workers | None = None
        self._arrays: ArrayFiles
        #: Items handed out, and the bytes sent to workers and received from them.
        self.parts = self.sent = self.received = 0
        #: The same by the name of the function.
        self.kinds: dict[str, Counter[str]] = {}

    def start(self) -> Workers:
        """Return the workers; the first call starts them.

        Raises
        ------
        OptionError, MissingPackageError
            As :func:`toposeam_cli.jobs.dask_workers.dask_workers` raises them.
        """
        if self._workers is None:
            from toposeam_cli.jobs.array_files import ArrayFiles

            self._workers = self._block.enter_context(self._new_workers())
            self._arrays = ArrayFiles(None if self._store is None else self._store.folder())
        return self._workers

    def _new_workers(self) -> AbstractContextManager[Workers]:
        if self._dask is None:
            from toposeam_cli.jobs.workers import worker_processes

            return worker_processes(self._processes, _WAITING)
        from toposeam_cli.jobs.dask_workers import dask_workers

        return dask_workers(self._dask, self._processes, _WAITING_ON_DASK)

    def check(self, probe: Path, files: Iterable[Path]) -> None:
        """Refuse workers on other machines that do not see these files; `probe` is overwritten.

        Raises
        ------
        OptionError
        """
        workers = self.start()
        if self._dask is not None:
            from toposeam_cli.jobs.dask_workers import DaskWorkers, WorkerCheck

            if isinstance(workers, DaskWorkers):
                workers.check(WorkerCheck.at(probe, files))

    def map(self, function: Callable[[Any], Any], items: Iterable[Any], /) -> Iterator[Any]:
        """Yield the results of a function of each item, in the order of the items. An error of a worker is
        raised here.

        Workers begin at once: the caller may work before it asks for results.

        Raises
        ------
        WorkersDiedError
            When workers die of an item.
        """
        waiting, ahead = enumerate(items), _AHEAD * self.start().count
        arrived: dict[int, bytes] = {}
        begun = yielded = 0

        def ready() -> tuple[int, Any] | None:
            nonlocal begun
            found = next(waiting, None) if begun - yielded < ahead else None
            begun += found is not None
            return found

        def values() -> Iterator[Any]:
            nonlocal yielded
            for number, answer in answers:
                arrived[number] = answer
                while yielded in arrived:
                    value = self._value(arrived.pop(yielded))
                    yielded += 1
                    yield value

        answers = self._answered(function, ready)
        return values()

    def stream(
        self, function: Callable[[Any], Any], ready: Callable[[], tuple[int, Any] | None], /
    ) -> Iterator[tuple[int, Any]]:
        """Yield results in the order in which they are done, with their numbers, as
        :class:`toposeam.layers.execution.tasks.Streaming` demands.

        Raises
        ------
        WorkersDiedError
            When workers die of an item.
        """
        for number, answer in self._answered(function, ready):
            yield number, self._value(answer)

    def _answered(
        self, function: Callable[[Any], Any], ready: Callable[[], tuple[int, Any] | None]
    ) -> Iterator[tuple[int, bytes]]:
        """Yield the numbered results of items from workers, which begin at once."""
        workers = self.start()
        kind = self.kinds.setdefault(getattr(function, "__name__", ""), Counter())
        calls: dict[int, Call] = {}
        again: list[int] = []

        def begin() -> None:
            while workers.is_free:
                if again:
                    number = again.pop(0)
                else:
                    found = ready()
                    if found is None:
                        break
                    number, item = found
                    with self._failures_reported():
                        calls[number] = self._arrays.pickled((function, item)), self._arrays.folder
                    self.parts, self.sent = self.parts + 1, self.sent + len(calls[number][0])
                    kind.update(parts=1, sent=len(calls[number][0]))
                workers.begin(str(number), calls[number], done)

        begin()
        return self._answers(workers, kind, calls, again, begin)

    def _answers(
        self,
        workers: Workers,
        kind: Counter[str],
        calls: dict[int, Call],
        again: list[int],
        begin: Callable[[], None],
    ) -> Iterator[tuple[int, bytes]]:
        """Yield the results of calls until none is left and `begin` begins no others."""
        arrived: list[tuple[int, bytes]] = []
        deaths: Counter[int] = Counter()
        while True:
            begin()
            if arrived:
                yield arrived.pop(0)
                continue
            if not calls:
                return
            for name, answer in workers.ended(_LOOK_EVERY_S):
                number = int(name)
                if answer is not None:
                    del calls[number]
                    arrived.append((number, answer))
                    self.received += len(answer)
                    kind.update(received=len(answer))
                    continue
                deaths[number] += 1
                if deaths[number] >= workers.attempts:
                    raise WorkersDiedError(
                        "a worker process died every time, as it does when memory runs out; use fewer (-j), "
                        "or -j 1"
                    )
                again.append(number)

    def _value(self, answer: bytes) -> Any:
        with self._failures_reported():
            succeeded, value = pickle.loads(answer)  # noqa: S301 - from a worker of ours
            if not succeeded:
                raise value
            return value

    def _failures_reported(self) -> AbstractContextManager[None]:
        return nullcontext() if self._store is None else self._store.failures_told()


def done(call: Call) -> bytes:
    """Run a call in a worker; return its result or its error, pickled."""
    from toposeam_cli.jobs.array_files import ArrayFiles

    _keep_memory()
    pickled, folder = call
    try:
        function, item = pickle.loads(pickled)  # noqa: S301 - from the process that started this worker
        return ArrayFiles(folder).pickled((True, function(item)))
    except Exception as error:
        return pickle.dumps((False, _portable(error)), pickle.HIGHEST_PROTOCOL)


@functools.cache
def _keep_memory() -> None:
    """Let the C library keep freed memory. By default glibc returns large blocks to the system at once, and a
    worker takes them again for the next array, page by page, which costs a twentieth of its time.
    """
    with suppress(OSError, AttributeError, TypeError):  # other libraries, other systems
        library = ctypes.CDLL(None)
        for name, value in _HEAPS.items():
            library.mallopt(name, value)


def _portable(error: Exception) -> Exception:
    """Return a picklable form of an error for another process."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301
    except Exception:
        return TopoSeamError(sentence(error))
    return error


@contextmanager
def crew(processes: int, dask: str | None = None, store: Scratch | None = None) -> Iterator[TaskCrew | None]:
    """Yield workers that end with the block, processes or those of a Dask cluster; None where this process
    does all work itself.

    Parameters
    ----------
    processes : int
    dask : str, optional
        As for :func:`toposeam_cli.jobs.dask_workers.dask_workers`.
    store : Scratch, optional
        Where arrays are written that several workers read; without it they go through the scheduler.
    """
    if processes == 1 and dask is None:
        yield None
        return
    with ExitStack() as block:
        workers = TaskCrew(processes, dask, block, store)
        yield workers
        _LOGGER.info("%d parts, %d bytes to workers, %d back", workers.parts, workers.sent, workers.received)
        for name, of in workers.kinds.items():
            _LOGGER.debug("%s %d %d %d", name, of["parts"], of["sent"], of["received"])
