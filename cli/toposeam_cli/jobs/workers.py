"""Worker processes on this machine, by executors of :mod:`concurrent.futures`."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from toposeam_cli.files.interruption import (
    Terminated,
    ctrl_c_later,
    start_resource_tracker,
    terminations_raised,
)
from toposeam_cli.files.temporary import remove_unfinished

#: Time that a worker has to leave a call into compiled code before it is ended by force, s.
_PATIENCE_S = 5.0
#: Variables that limit the libraries of a worker to one thread, as the workers are parallel already.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VIPS_CONCURRENCY")


@dataclass(frozen=True, slots=True)
class Task:
    """Task of a worker."""

    #: ``module:callable``, and its keyword arguments.
    function: str
    arguments: Mapping[str, Any]
    #: Passed to :func:`toposeam_cli.files.writing.all_or_nothing`, as is `resumed`.
    own: Mapping[str, str] = field(default_factory=dict)
    resumed: bool = False


@dataclass(frozen=True, slots=True)
class Answer:
    """Report of a worker about a job."""

    succeeded: bool
    seconds: float
    #: Why it failed, one sentence.
    message: str = ""
    #: The function's value as JSON. The worker converts it, so that a value that JSON cannot hold fails
    #: there.
    result: str = "null"
    #: The SHA-256 of every file it made, by its real path.
    made: Mapping[str, str] = field(default_factory=dict)


class Workers(ABC):
    """Workers that do one job at a time each."""

    #: Most times that a job is begun if its worker dies.
    attempts = 2

    def __init__(self, count: int) -> None:
        #: Number of workers.
        self.count = count
        self._running: dict[Future[Any], tuple[str, Executor]] = {}

    @property
    @abstractmethod
    def is_free(self) -> bool:
        """True if another job can begin."""

    def begin(self, name: str, task: Any, does: Callable[[Any], Any] | None = None) -> None:
        """Give a free worker a job: a :class:`Task`, or the argument of another function, `does`."""
        does = answer if does is None else does
        executor = self._take()
        try:
            future = executor.submit(does, task)
        except BrokenExecutor:  # its worker died while it had nothing to do
            self._give_back(executor, died=True)
            executor = self._take()
            future = executor.submit(does, task)
        self._running[future] = name, executor

    def ended(self, timeout_s: float) -> list[tuple[str, Any]]:
        """Wait for jobs to end; return their names and results (of a task an :class:`Answer`), None where the
        worker died.
        """
        done, _ = wait(self._running, timeout_s, FIRST_COMPLETED)
        answers: list[tuple[str, Any]] = []
        for future in done:
            name, executor = self._running.pop(future)
            died = future.cancelled() or future.exception() is not None
            self._give_back(executor, died)
            answers.append((name, None if died else future.result()))
        return answers

    @abstractmethod
    def _take(self) -> Executor:
        """Return an executor with a free worker."""

    @abstractmethod
    def _give_back(self, executor: Executor, died: bool) -> None:
        """Free the worker, or note its death."""


def answer(task: Task) -> Answer:
    """Do one job: call ``module:callable`` with keyword arguments. A failed job leaves no new file behind."""
    from toposeam.sentence import sentence
    from toposeam_cli.files.writing import all_or_nothing

    start = time.perf_counter()
    try:
        module, _, name = task.function.partition(":")
        with (
            terminations_raised(),
            all_or_nothing(task.own, resumed=task.resumed, digests=True) as outputs,
        ):
            result = json.dumps(getattr(import_module(module), name)(**task.arguments))
    except Terminated as end:
        remove_unfinished()  # also of blocks whose clean-up the signal skipped
        os._exit(int(end.code or 0))  # the executor would take it for the failure of the job
    except Exception as error:
        return Answer(False, time.perf_counter() - start, sentence(error))
    return Answer(True, time.perf_counter() - start, result=result, made=outputs.made)


class _Processes(Workers):
    """Worker processes, each with an executor of its own: when one dies, only its jobs are lost, and another
    takes its place.

    They are spawned, as libvips does not survive a fork. All hold one end of a pipe that is never
    written to: when the other end closes, as the run is interrupted or the parent is gone, they end.
    """

    def __init__(self, count: int, waiting: int = 0) -> None:
        super().__init__(count)
        if waiting:
            self.attempts = 4  # a worker that dies loses all jobs queued for it
        start_resource_tracker()
        self._context = multiprocessing.get_context("spawn")
        self._ending, self._alive = self._context.Pipe(duplex=False)
        self._most = 1 + waiting
        #: Number of jobs that each has, the one in work included.
        self._load: dict[Executor, int] = {self._start(): 0 for _ in range(count)}

    @property
    def is_free(self) -> bool:
        """True if a worker has room for another job."""
        return min(self._load.values()) < self._most

    def end(self, now: bool) -> None:
        """End the workers, `now` or when their jobs are done."""
        if now:
            self._alive.close()
        for executor in self._load:
            executor.shutdown(cancel_futures=True)
        self._alive.close()

    def _take(self) -> Executor:
        executor = min(self._load, key=lambda one: self._load[one])
        self._load[executor] += 1
        return executor

    def _give_back(self, executor: Executor, died: bool) -> None:
        if executor not in self._load:
            return  # another took its place when the first of its jobs was reported
        if not died:
            self._load[executor] -= 1
            return
        del self._load[executor]
        self._load[self._start()] = 0

    def _start(self) -> Executor:
        executor = ProcessPoolExecutor(1, self._context, _prepare, (self._ending,))
        with ctrl_c_later():  # a terminal sends it to workers too, but it is their parent that answers
            executor.submit(int)  # with which the process starts
        return executor


def _prepare(ending: Connection) -> None:
    """Initialize a worker process. Outside of its jobs a signal ends it at once, as it has nothing to tidy;
    the executor would print an exception in here with a traceback.
    """
    for name in _ONE_THREAD:
        os.environ[name] = "1"  # before the numerics are loaded
    threading.Thread(target=_end_with, args=(ending,), daemon=True).start()


def _end_with(ending: Connection) -> None:
    with suppress(OSError):
        ending.poll(None)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PATIENCE_S)
    remove_unfinished()
    os._exit(128 + signal.SIGTERM)


@contextmanager
def worker_processes(count: int, waiting: int = 0) -> Iterator[Workers]:
    """Start workers on this machine, each with up to `waiting` queued jobs. They end with the block, at once
    if an exception leaves it.
    """
    workers = _Processes(count, waiting)
    try:
        yield workers
    except BaseException:
        workers.end(now=True)
        raise
    workers.end(now=False)
