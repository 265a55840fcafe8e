"""Ctrl-C and the signals of ``kill`` and a closed terminal, turned into exceptions, so that what is
unfinished is tidied away.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

from toposeam.sentence import causes
from toposeam_cli.files.semaphores import name_semaphores

Value = TypeVar("Value")

#: How often a waiting main thread looks for signals, s; only Windows needs it.
_LOOK_EVERY_S = 0.2
#: Delay until a missed interruption is raised again, s.
_AGAIN_S = 0.02
#: How long the first signal has to take effect before another one is heard, s.
_DEAF_S = 5.0


class Terminated(SystemExit):
    """The process was asked to end; leaves it with the exit code shells expect, 128 + the signal's number."""


@contextmanager
def terminations_raised() -> Iterator[None]:
    """Raise :class:`Terminated` in the main thread on ``kill`` and when the terminal closes, and
    KeyboardInterrupt on Ctrl-C, unless another handler is set. While one of them takes effect, during
    clean-up, others are ignored for some seconds.

    Where Python swallows exceptions (in callbacks of weak references, which importing has, and in
    finalizers) they are raised again a moment later; where it wraps them in an error of its own, or a foreign
    module puts one in their place, they leave the block themselves.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last, latest, within = -math.inf, 0, True

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal last, latest
        if time.monotonic() - last < _DEAF_S:
            return
        last, latest = time.monotonic(), number
        raise interruption(number)

    def interruption(number: int) -> BaseException:
        return KeyboardInterrupt() if number == signal.SIGINT else Terminated(128 + number)

    def swallowed(unraisable: Any) -> None:
        nonlocal last
        if latest and issubclass(unraisable.exc_type, KeyboardInterrupt | Terminated):
            last = -math.inf
            timer = threading.Timer(_AGAIN_S, again)
            timer.daemon = True
            timer.start()
        else:
            told(unraisable)

    def again() -> None:
        if within:
            os.kill(os.getpid(), latest)

    usual = {"SIGINT": signal.default_int_handler, "SIGTERM": signal.SIG_DFL, "SIGHUP": signal.SIG_DFL}
    handlers = {
        getattr(signal, name): end
        for name, handler in usual.items()
        if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) == handler
    }
    told, sys.unraisablehook = sys.unraisablehook, swallowed
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    except Exception as error:
        hidden = _interruption_behind(error)
        if hidden is None and latest and time.monotonic() - last < _DEAF_S:
            hidden = interruption(latest)  # modules made with pybind11 put a TypeError in its place
        if hidden is None:
            raise
        raise hidden from None
    finally:
        within = False
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = told


def _interruption_behind(error: BaseException) -> BaseException | None:
    """Return the interruption that an exception hides: Python 3.11 tells of one that comes while a class is
    made, as importing does, by a RuntimeError of its own, and modules made with pybind11 tell of one that
    comes while they are loaded by an ImportError.
    """
    return next((each for each in causes(error) if isinstance(each, KeyboardInterrupt | Terminated)), None)


@contextmanager
def ctrl_c_later() -> Iterator[None]:
    """Keep Ctrl-C from processes that are started in the block, from their first moment on; here it and the
    others take effect after the block, so that no process is left half started.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield  # Windows
        return
    start_resource_tracker()  # here, as it would unblock Ctrl-C
    with uninterrupted():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_resource_tracker() -> None:
    """Start the resource tracker of :mod:`multiprocessing`, if it does not run yet, such that a closed
    terminal spares it: when it dies, every process complains. To be called before anything is shared.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return  # Windows has none
    from multiprocessing import resource_tracker

    name_semaphores()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGHUP,))  # which the new process inherits
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let Ctrl-C and ``kill`` take effect after a block that must not be left half done, and is short."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[tuple[int, FrameType | None]] = []
    before: dict[int, Any] = {}
    try:
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not None:
                before[number] = signal.getsignal(number)
                signal.signal(number, lambda number, frame: arrived.append((number, frame)))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number, frame in arrived[:1]:
            handler = before[number]
            if callable(handler):
                handler(number, frame)
            elif handler == signal.SIG_DFL:
                os.kill(os.getpid(), number)


def interruptible(call: Callable[[], Value], stop: Callable[[], object]) -> Value:
    """Return the value of a long call into foreign code, which Ctrl-C and ``kill`` can end.

    A signal takes effect only when the main thread is back in Python, so the call runs in a thread of its own
    while this one waits. When this one is interrupted it calls `stop`, waits for the call to give up, and
    lets the interruption go on.
    """
    if threading.current_thread() is not threading.main_thread():
        return call()  # signals go to the main thread, and the waiting call there decides
    results: list[Value] = []
    errors: list[BaseException] = []
    begins = (
        threading.Lock()
    )  # its taker decides: the thread that the call begins, or an interruption that it never does
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
