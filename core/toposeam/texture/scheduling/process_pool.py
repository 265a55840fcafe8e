"""Processes that share the work on one texture.

They are forked when there is something to share, so that they have all that has been prepared, and see what
changes in shared memory (:meth:`toposeam.texture.canvas.index_canvas.IndexCanvas.share`). Most of the time
goes into calls on small arrays, for which threads would wait for one another. Requests lie in one pipe, from
which the next free process takes one, the asking process included. The processes use no library that cannot
be forked, and end when asked to, or when the pipe closes because their parent is gone.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import select
import signal
import sys
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

from toposeam.errors import SolverError

#: Whether processes can be forked, and the system's libraries allow it; else one process does all.
FORKS = hasattr(os, "fork") and sys.platform != "darwin"

#: Largest number of processes, above any machine of today.
MAX_PROCESSES = 1024
#: Size of a request in the pipe, bytes: it is written and read at once.
_REQUEST_BYTES = 512

#: A method's name and arguments.
Call = tuple[str, tuple[Any, ...]]
#: Number and class of the object whose methods are called, and the shape it is made for.
Turn = tuple[int, type, tuple[int, int]]


class Crew:
    """Some processes, this one among them; a context that ends with the work.

    Parameters
    ----------
    processes : int
    tool : object
        The object that every process works with.
    prepare : callable
        Called before the first fork.
    """

    def __init__(self, processes: int, tool: Any, prepare: Callable[[], None]) -> None:
        self._count, self._tool, self._prepare = processes if FORKS else 1, tool, prepare
        self._others: dict[int, tuple[int, Connection]] = {}  # process and its answers, by their descriptor
        self._turn: Turn = 0, object, (0, 0)
        self._made: tuple[int, Any] = -1, None
        self._asked: deque[Call] = deque()
        self._awaited, self._shares = 0, False

    def __enter__(self) -> Crew:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.dismiss()
        others, self._others, self._count = list(self._others.values()), {}, 1
        if not others:
            return
        for process, pipe in others:
            if error is not None:
                os.kill(process, signal.SIGKILL)  # their results are no longer needed
            pipe.close()
        os.close(self._requests)
        os.close(self._given)
        for process, _ in others:
            with contextlib.suppress(ChildProcessError):  # where children are not waited for
                os.waitpid(process, 0)

    def dismiss(self) -> None:
        """End the other processes, which takes them some time; they have ended when the context is left."""
        for _ in self._others if self._tool is not None else ():
            self._give(b"")
        self._tool, self._made = None, (-1, None)

    def begin(self, kind: type, shape: tuple[int, int], count: int) -> None:
        """Choose the object whose methods are called from now on: each process makes its own from the tool
        and a shape. With one call at first, or one process, this process works alone.
        """
        self._turn, self._shares = (self._turn[0] + 1, kind, shape), min(self._count, count) > 1
        if self._shares and not self._others:
            self._prepare()
            self._fork()

    def own(self) -> Any:
        """Return the object of this process."""
        return self._object(self._turn)

    def ask(self, method: str, *given: Any) -> None:
        """Queue a call of a method for any process; calls begin in the order of the queue."""
        self._asked.append((method, given))
        self._awaited += 1

    def pass_on(self) -> None:
        """Hand queued calls to the other processes, as far as the pipe has room, before answers are
        wanted.
        """
        while self._shares and self._asked and self._give(pickle.dumps((self._turn, self._asked[0]))):
            self._asked.popleft()

    def answers(self) -> Iterator[tuple[Call, Any]]:
        """Yield each call with its result as soon as it is ready, until none is left; more may be queued
        meanwhile.

        Raises
        ------
        SolverError
            When a process was killed.
        """
        while self._awaited:
            call = self._next()
            if call is not None:
                self._awaited -= 1
                yield call, self._called(self._turn, call)
            if self._shares:
                for answer in self._ready(waits=call is None):
                    self._awaited -= 1
                    yield answer

    def _next(self) -> Call | None:
        """Take the next call of this process, after handing on as many as the pipe has room for."""
        if not self._shares:
            return self._asked.popleft()
        self.pass_on()
        try:
            _, call = _read(self._requests)
        except BlockingIOError:
            return None
        return call

    def _give(self, request: bytes) -> bool:
        """Put a request into the pipe, the empty one to end a process; False where the pipe is full."""
        try:
            return os.write(self._given, request.ljust(_REQUEST_BYTES, b"\0")) > 0
        except BlockingIOError:
            return False

    def _ready(self, *, waits: bool) -> list[tuple[Call, Any]]:
        """Collect the results of the other processes."""
        found = []
        for descriptor, _ in self._poll.poll(None if waits else 0):
            try:
                succeeded, *answer = self._others[descriptor][1].recv()
            except (EOFError, ConnectionError) as error:
                raise SolverError(
                    "a process that worked on the texture was killed, as happens when memory runs out; use "
                    "fewer of them",
                    kind="killed",
                ) from error
            if not succeeded:
                raise answer[1]
            found.append((answer[0], answer[1]))
        return found

    def _fork(self) -> None:
        self._requests, self._given = os.pipe()
        self._poll = select.poll()
        for end in (self._requests, self._given):
            os.set_blocking(end, False)
        # Ctrl-C on a terminal goes to all of them; it is this process that answers.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
        try:
            for _ in range(self._count - 1):
                ours, theirs = Pipe(duplex=False)
                with warnings.catch_warnings():
                    # Python warns of locks of other threads; the new process takes none of them.
                    warnings.simplefilter("ignore", DeprecationWarning)
                    process = os.fork()
                if not process:
                    for _, pipe in self._others.values():
                        pipe.close()
                    ours.close()
                    self._serve(theirs)
                self._others[ours.fileno()] = process, ours
                self._poll.register(ours, select.POLLIN)
                theirs.close()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _serve(self, pipe: Connection) -> None:
        """Run another process, which ends here."""
        try:
            gc.freeze()  # what others hold is theirs to tidy away
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            for number in (signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
            os.close(self._given)
            poll = select.poll()
            poll.register(self._requests, select.POLLIN)
            while poll.poll():
                try:
                    turn, call = _read(self._requests)
                except BlockingIOError:  # another process took it
                    continue
                answer: tuple[bool, Call, Any]
                try:
                    answer = True, call, self._called(turn, call)
                except Exception as error:
                    answer = False, call, error
                pipe.send(answer)
        except (EOFError, OSError):
            pass  # asked to end, or the reader has gone
        finally:
            os._exit(0)

    def _called(self, turn: Turn, call: Call) -> Any:
        method, given = call
        return getattr(self._object(turn), method)(*given)

    def _object(self, turn: Turn) -> Any:
        number, kind, shape = turn
        if self._made[0] != number:
            self._made = number, kind(self._tool, shape)
        return self._made[1]


def _read(requests: int) -> tuple[Turn, Call]:
    """Read the next request from a pipe.

    Raises
    ------
    BlockingIOError
        When there is none.
    EOFError
        When it is the one to end, or the parent is gone.
    """
    request = os.read(requests, _REQUEST_BYTES)
    if not request.strip(b"\0"):
        raise EOFError
    turn, call = pickle.loads(request)  # noqa: S301 - what this program wrote
    return turn, call
