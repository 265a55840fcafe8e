"""Where jobs are done: worker processes on this machine, or those of a Dask cluster, both as :mod:`concurrent.futures` knows them."""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from toposeam.errors import MissingPackageError, OptionError
from toposeam_cli.interruption import Terminated, ctrl_c_later, terminations_raised

#: How long a worker that must end may take to leave a call into compiled code, s.
_PATIENCE_S = 5.0
#: The work is parallel already: each worker keeps its libraries to one thread.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VIPS_CONCURRENCY")


@dataclass(frozen=True, slots=True)
class Answer:
    """What a worker says about a job."""

    succeeded: bool
    seconds: float
    #: Why it failed, one sentence.
    message: str = ""
    #: The value of the function as JSON: what cannot be written down is found out in the worker.
    result: str = "null"


class Workers(ABC):
    """Some workers, each with one job at a time."""

    #: How often a job is begun whose worker dies.
    attempts = 2

    def __init__(self) -> None:
        self._running: dict[Future[Answer], tuple[str, Executor]] = {}

    @property
    @abstractmethod
    def is_free(self) -> bool:
        """Whether another job can begin."""

    def begin(self, name: str, function: str, arguments: Mapping[str, Any]) -> None:
        """Give a free worker a job."""
        executor = self._take()
        try:
            future = self._submit(executor, function, arguments)
        except BrokenExecutor:  # its worker died while it had nothing to do
            self._give_back(executor, died=True)
            executor = self._take()
            future = self._submit(executor, function, arguments)
        self._running[future] = name, executor

    def _submit(self, executor: Executor, function: str, arguments: Mapping[str, Any]) -> Future[Answer]:
        with ctrl_c_later():  # a terminal sends it to workers too, but it is their parent that answers
            return executor.submit(answer, function, arguments)

    def ended(self, timeout_s: float) -> list[tuple[str, Answer | None]]:
        """Wait for jobs to end: their names, and what became of them, None where the worker died."""
        done, _ = wait(self._running, timeout_s, FIRST_COMPLETED)
        answers: list[tuple[str, Answer | None]] = []
        for future in done:
            name, executor = self._running.pop(future)
            died = future.cancelled() or future.exception() is not None
            self._give_back(executor, died)
            answers.append((name, None if died else future.result()))
        return answers

    @abstractmethod
    def _take(self) -> Executor:
        """An executor with a free worker."""

    @abstractmethod
    def _give_back(self, executor: Executor, died: bool) -> None:
        """The worker is free, or dead."""


def answer(function: str, arguments: Mapping[str, Any]) -> Answer:
    """Do one job: call ``module:callable`` with keyword arguments. A failed job leaves no new file behind."""
    from toposeam_cli.output import all_or_nothing
    from toposeam_cli.sentence import sentence

    start = time.perf_counter()
    try:
        module, _, name = function.partition(":")
        with all_or_nothing():
            result = json.dumps(getattr(import_module(module), name)(**arguments))
    except Terminated as end:
        os._exit(int(end.code or 0))  # the executor would take it for the failure of the job
    except Exception as error:
        return Answer(False, time.perf_counter() - start, sentence(error))
    return Answer(True, time.perf_counter() - start, result=result)


class _Processes(Workers):
    """Worker processes, each an executor of its own: when one dies, only the job it had is concerned, and another takes its place.

    They are spawned, as libvips does not survive a fork. All hold one end of a pipe into which nobody ever writes: when the other end
    closes, be it that the run is interrupted or that the parent is gone, they end.
    """

    def __init__(self, count: int) -> None:
        super().__init__()
        self._context = multiprocessing.get_context("spawn")
        self._ending, self._alive = self._context.Pipe(duplex=False)
        self._idle: list[Executor] = [self._start() for _ in range(count)]

    @property
    def is_free(self) -> bool:
        return bool(self._idle)

    def end(self, now: bool) -> None:
        """End the workers, `now` or when they have done what they were given."""
        if now:
            self._alive.close()
        for executor in [*self._idle, *(executor for _, executor in self._running.values())]:
            executor.shutdown(cancel_futures=True)
        self._alive.close()

    def _take(self) -> Executor:
        return self._idle.pop()

    def _give_back(self, executor: Executor, died: bool) -> None:
        self._idle.append(self._start() if died else executor)

    def _start(self) -> Executor:
        return ProcessPoolExecutor(1, self._context, _prepare, (self._ending,))


def _prepare(ending: Connection) -> None:
    """Make ready a worker process."""
    for name in _ONE_THREAD:
        os.environ[name] = "1"  # before the numerics are loaded
    terminations_raised().__enter__()  # until the process ends
    threading.Thread(target=_end_with, args=(ending,), daemon=True).start()


def _end_with(ending: Connection) -> None:
    with suppress(OSError):
        ending.poll(None)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PATIENCE_S)
    os._exit(128 + signal.SIGTERM)


class _Dask(Workers):
    """The workers of a Dask cluster, through its executor."""

    attempts = 4  # a worker that dies takes what waits for it along, so that the innocent are tried again too

    def __init__(self, executor: Executor, count: int) -> None:
        super().__init__()
        self._executor, self._count = executor, count

    @property
    def is_free(self) -> bool:
        return len(self._running) < self._count

    def _take(self) -> Executor:
        return self._executor

    def _give_back(self, executor: Executor, died: bool) -> None:
        pass


@contextmanager
def worker_processes(count: int) -> Iterator[Workers]:
    """Workers on this machine; they end with the block, at once if it is left by an exception."""
    workers = _Processes(count)
    try:
        yield workers
    except BaseException:
        workers.end(now=True)
        raise
    workers.end(now=False)


@contextmanager
def dask_workers(address: str, count: int) -> Iterator[Workers]:
    """Workers of the Dask cluster at an address, or of ``local``: one that is made for the block, with `count` processes.

    Raises
    ------
    MissingPackageError
        Without ``distributed``.
    OptionError
        If there is no cluster at the address.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingPackageError("running on Dask needs distributed; install it with: pip install 'toposeam[dask]'") from error
    # A worker's death is ours to answer: only we know which files it may have left.
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        quiet = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
        with ctrl_c_later():
            cluster = LocalCluster(n_workers=count, threads_per_worker=1, **quiet) if address == "local" else None
        try:
            try:
                client = Client(cluster or address, timeout=10)
            except (OSError, ValueError, TimeoutError) as error:
                raise OptionError(
                    f"there is no Dask scheduler at {address!r}; start one, or give its address, or use --dask local"
                ) from error
            with client:
                threads = sum(client.nthreads().values())
                if not threads:
                    raise OptionError(f"the Dask scheduler at {address!r} has no workers; start some with: dask worker {address}")
                yield _Dask(client.get_executor(pure=False), threads)
        finally:
            if cluster is not None:
                cluster.close()
