"""Independent parts of one piece of work, on processes of this machine or on Dask.

:class:`TaskCrew` is what :mod:`toposeam.layers.execution.tasks` calls an executor. Workers start when there
is something for them to do; what one that died had begun is done again.
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

#: A function and an item, pickled, and the folder of arrays that they and the result say the place of.
Call = tuple[bytes, Path | None]

#: Arguments of glibc's ``mallopt``: blocks of up to this many bytes come from heaps (M_MMAP_THRESHOLD, -3),
#: which keep this many that are free at their end, the main one (M_TRIM_THRESHOLD, -1) and those of threads
#: (M_TOP_PAD, -2).
_HEAPS = {-3: 1 << 25, -1: 1 << 28, -2: 1 << 26}

#: Interval at which a waiting call looks for signals, s.
_LOOK_EVERY_S = 1.0
#: Results that may wait for earlier ones, and items that may be made ready, per worker.
_AHEAD = 4
#: Items that wait for each worker, so that it need not wait for us; on Dask all but one wait with the
#: scheduler, which gives each to the first free one.
_WAITING, _WAITING_ON_DASK = 1, 3


class WorkersDiedError(TopoSeamError, RuntimeError):
    """Workers died again and again of the same part of the work."""


def processes_of(wanted: int | None) -> int:
    """Return the number of processes: `wanted`, else one for each core this process may use; in a worker only
    one, since its like are at work beside it.
    """
    if wanted is not None:
        return wanted
    if multiprocessing.parent_process() is not None:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class TaskCrew:
    """Workers for the time of a block (:func:`crew`)."""

    def __init__(self, processes: int, dask: str | None, block: ExitStack, store: Scratch | None) -> None:
        self._processes, self._dask, self._block, self._store = processes, dask, block, store
        self._workers: Workers | None = None
        self._arrays: ArrayFiles
        #: Parts that were handed out, and the bytes that went there and came back.
        self.parts = self.sent = self.received = 0
        #: The same by what was done.
        self.kinds: dict[str, Counter[str]] = {}

    def start(self) -> Workers:
        """Return the workers, started when they are needed first.

        Raises
        ------
        OptionError, MissingPackageError
            As :func:`toposeam_cli.jobs.dask_workers.dask_workers` has them.
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
        """Refuse workers on other machines that do not see some files; `probe` is overwritten.

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
        """Yield the results of a function of each item, in their order; raise here what one raises.

        Workers begin at once: the caller may work before it asks for results.

        Raises
        ------
        WorkersDiedError
            When workers die of an item.
        """
        waiting, ahead = enumerate(items), _AHEAD * self.start().count
        said: dict[int, bytes] = {}
        begun = told = 0

        def ready() -> tuple[int, Any] | None:
            nonlocal begun
            found = next(waiting, None) if begun - told < ahead else None
            begun += found is not None
            return found

        def values() -> Iterator[Any]:
            nonlocal told
            for number, answer in answers:
                said[number] = answer
                while told in said:
                    value = self._value(said.pop(told))
                    told += 1
                    yield value

        answers = self._said(function, ready)
        return values()

    def stream(
        self, function: Callable[[Any], Any], ready: Callable[[], tuple[int, Any] | None], /
    ) -> Iterator[tuple[int, Any]]:
        """Yield results as they come, as :class:`toposeam.layers.execution.tasks.Streaming` has them.

        Raises
        ------
        WorkersDiedError
            When workers die of an item.
        """
        for number, answer in self._said(function, ready):
            yield number, self._value(answer)

    def _said(
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
                    with self._failures_told():
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
        """Yield the results of calls from workers, until there are none and no others begin."""
        said: list[tuple[int, bytes]] = []
        deaths: Counter[int] = Counter()
        while True:
            begin()
            if said:
                yield said.pop(0)
                continue
            if not calls:
                return
            for name, answer in workers.ended(_LOOK_EVERY_S):
                number = int(name)
                if answer is not None:
                    del calls[number]
                    said.append((number, answer))
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

    def _value(self, said: bytes) -> Any:
        with self._failures_told():
            succeeded, value = pickle.loads(said)  # noqa: S301 - from a worker of ours
            if not succeeded:
                raise value
            return value

    def _failures_told(self) -> AbstractContextManager[None]:
        return nullcontext() if self._store is None else self._store.failures_told()


def done(call: Call) -> bytes:
    """Run in a worker: return what a function of an item gives, or what it raises."""
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
    """Let the C library keep what is free again: glibc returns large blocks at once, and what a worker gives
    back after each array it takes anew for the next one, page by page, which costs a twentieth of its time.
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
    """Start processes, or the workers of a Dask cluster, which end with the block; None where this process
    does everything itself.

    Parameters
    ----------
    processes : int
    dask : str, optional
        As for :func:`toposeam_cli.jobs.dask_workers.dask_workers`.
    store : Scratch, optional
        Where large arrays lie that several look things up in; else they go through the scheduler.
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
