"""Processes that share the work on one texture.

They are forked when there is something to share, so that they have all that has been prepared, and see what
changes in shared memory (:meth:`toposeam.texture.canvas.IndexCanvas.share`). Most of the time goes into calls
on small arrays, for which threads would wait for one another. The processes compute with what they have, use
no library that minds a fork, and end when their parent's end of the pipe closes: when the work is done or
interrupted, or the parent is gone.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

from toposeam.errors import SolverError

#: Where processes cannot be forked, or must not be as the system's own libraries mind it, one does all.
FORKS = hasattr(os, "fork") and sys.platform != "darwin"

#: More than any machine of today has.
MAX_PROCESSES = 1024


class Crew:
    """Some processes, this one among them; a context that ends with the work.

    Parameters
    ----------
    processes : int
    tool : object
        What every process works with.
    prepare : callable
        Called before the first fork.
    """

    def __init__(self, processes: int, tool: Any, prepare: Callable[[], None]) -> None:
        self._count, self._tool, self._prepare = processes if FORKS else 1, tool, prepare
        self._others: list[tuple[int, Connection]] = []
        self._work: dict[tuple[Any, ...], Any] = {}

    def __enter__(self) -> Crew:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        others, self._others, self._count = self._others, [], 1
        for _, pipe in others:
            pipe.close()
        if error is not None:
            for process, _ in others:
                os.kill(process, signal.SIGKILL)  # nobody waits for what they compute
        for process, _ in others:
            os.waitpid(process, 0)

    def each(
        self, kind: type, shape: tuple[int, int], method: str, arguments: Sequence[Sequence[Any] | None]
    ) -> list[Any]:
        """The values of a method of an object, which is made of the tool and a shape and stays, for several
        arguments, None for None. Lists of one length are divided alike: an object meets in later calls what
        it has met at the same place before.

        Raises
        ------
        SolverError
            When a process was killed.
        """
        count = min(self._count, len(arguments))
        if count < 2:
            return self._called(kind, shape, method, arguments)
        if not self._others:
            self._prepare()
            self._fork()
        parts, others = [arguments[first::count] for first in range(count)], self._others[: count - 1]
        results: list[Any] = [None] * len(arguments)
        try:
            for (_, pipe), part in zip(others, parts, strict=False):
                pipe.send((kind, shape, method, part))
            results[count - 1 :: count] = self._called(kind, shape, method, parts[-1])
            for first, (_, pipe) in enumerate(others):
                succeeded, answer = pipe.recv()
                if not succeeded:
                    raise answer
                results[first::count] = answer
        except (EOFError, ConnectionError) as error:
            raise SolverError(
                "a process that worked on the texture was killed, as happens when memory runs out; use fewer "
                "of them"
            ) from error
        return results

    def _fork(self) -> None:
        # Ctrl-C on a terminal goes to all of them; it is this process that answers.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
        try:
            for _ in range(self._count - 1):
                ours, theirs = Pipe()
                with warnings.catch_warnings():
                    # Python warns of locks of other threads; the new process takes none of them.
                    warnings.simplefilter("ignore", DeprecationWarning)
                    process = os.fork()
                if not process:
                    for _, pipe in self._others:
                        pipe.close()
                    ours.close()
                    self._serve(theirs)
                self._others.append((process, ours))
                theirs.close()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _serve(self, pipe: Connection) -> None:
        """Another process, which ends here."""
        try:
            gc.freeze()  # what others hold is theirs to tidy away
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            for number in (signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
            while True:
                wanted = pipe.recv()
                answer: tuple[bool, Any]
                try:
                    answer = True, self._called(*wanted)
                except Exception as error:
                    answer = False, error
                pipe.send(answer)
        except (EOFError, OSError):
            pass  # nobody listens any more
        finally:
            os._exit(0)

    def _called(
        self, kind: type, shape: tuple[int, int], method: str, arguments: Sequence[Sequence[Any] | None]
    ) -> list[Any]:
        if (kind, shape) not in self._work:
            self._work[kind, shape] = kind(self._tool, shape)
        call = getattr(self._work[kind, shape], method)
        return [None if given is None else call(*given) for given in arguments]
