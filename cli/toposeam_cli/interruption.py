"""Ctrl-C and the signals of ``kill`` and a closed terminal, turned into exceptions, so that what is unfinished is tidied away."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

Value = TypeVar("Value")

#: How often a waiting main thread looks for signals, s; only Windows needs it.
_LOOK_EVERY_S = 0.2


class Terminated(SystemExit):
    """The process was asked to end; leaves it with the exit code shells expect, 128 + the signal's number."""


@contextmanager
def terminations_raised() -> Iterator[None]:
    """Raise :class:`Terminated` in the main thread on ``kill`` and when the terminal closes, unless somebody handles that already."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers: dict[int, Callable[[int, FrameType | None], None] | signal.Handlers] = {
        getattr(signal, name): _terminate
        for name in ("SIGTERM", "SIGHUP")
        if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) == signal.SIG_DFL
    }
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def ctrl_c_later() -> Iterator[None]:
    """Keep Ctrl-C from processes that are started in the block, from their first moment on; here it takes effect after the block."""
    if not hasattr(signal, "pthread_sigmask"):
        yield  # Windows
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # which would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated(128 + number)


def interruptible(call: Callable[[], Value], stop: Callable[[], object]) -> Value:
    """The value of a long call into foreign code, which Ctrl-C and ``kill`` can end.

    A signal takes effect only when the main thread is back in Python, so the call runs in a thread of its own while this one waits. When
    this one is interrupted it calls `stop`, waits for the call to give up, and lets the interruption go on.
    """
    if threading.current_thread() is not threading.main_thread():
        return call()  # signals go to the main thread, and whoever waits there decides
    results: list[Value] = []
    errors: list[BaseException] = []
    begins = threading.Lock()  # whoever takes it decides: the thread that the call begins, or an interruption that it never does
    done = threading.Event()

    def work() -> None:
        try:
            if begins.acquire(blocking=False):
                results.append(call())
        except BaseException as error:
            errors.append(error)
        finally:
            done.set()

    thread = threading.Thread(target=work, name="libvips")
    try:
        thread.start()
        while not done.wait(_LOOK_EVERY_S):
            pass
    except BaseException:
        if not begins.acquire(blocking=False):
            while not done.is_set():
                stop()  # again and again: what is stopped between two steps forgets it
                done.wait(_LOOK_EVERY_S)
        raise
    if errors:
        raise errors[0]
    return results[0]
