"""Ctrl-C and the signals of ``kill`` and a closed terminal, turned into exceptions, so that unfinished files
are removed.
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

#: Interval at which a waiting main thread looks for signals, s; only Windows needs it.
_LOOK_EVERY_S = 0.2
#: Delay until a missed interruption is raised again, s.
_AGAIN_S = 0.02
#: Time after a signal in which others are ignored, s, so that clean-up is not interrupted.
_DEAF_S = 5.0


class Terminated(SystemExit):
    """The process was asked to end; its exit code is the usual one, 128 + the signal's number."""


@contextmanager
def terminations_raised() -> Iterator[None]:
    """Raise :class:`Terminated` in the main thread on ``kill`` and when the terminal closes, and
    KeyboardInterrupt on Ctrl-C, unless another handler is set. While one of them takes effect, during
    clean-up, others are ignored for some seconds.

    Python swallows exceptions in callbacks of weak references, which imports use, and in finalizers; they are
    raised again a moment later. Where Python wraps them in an error of its own, or a foreign module replaces
    them by one, the block raises the original exception.
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
            usual_hook(unraisable)

    def again() -> None:
        if within:
            os.kill(os.getpid(), latest)

    usual = {"SIGINT": signal.default_int_handler, "SIGTERM": signal.SIG_DFL, "SIGHUP": signal.SIG_DFL}
    handlers = {
        getattr(signal, name): end
        for name, handler in usual.items()
        if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) == handler
    }
    usual_hook, sys.unraisablehook = sys.unraisablehook, swallowed
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
        sys.unraisablehook = usual_hook


def _interruption_behind(error: BaseException) -> BaseException | None:
    """Return the interruption that an exception hides. Python 3.11 wraps one that comes while a class is
    made, as in imports, in a RuntimeError, and modules made with pybind11 wrap one that comes while they load
    in an ImportError.
    """
    return next((each for each in causes(error) if isinstance(each, KeyboardInterrupt | Terminated)), None)


@contextmanager
def ctrl_c_later() -> Iterator[None]:
    """Block Ctrl-C in processes that are started in the block, from their first moment on. In this process it
    and the other signals take effect after the block, so that no process is left half started.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield  # Windows
        return
    start_resource_tracker()  # before the block, as starting it unblocks Ctrl-C
    with uninterrupted():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_resource_tracker() -> None:
    """Start the resource tracker of :mod:`multiprocessing`, if it does not run yet, so that it survives a
    closed terminal: every process would complain of its death. Call this before anything is shared.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return  # Windows has none
    from multiprocessing import resource_tracker

    name_semaphores()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGHUP,))  # the new process inherits the mask
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C and ``kill`` to the end of a short block that must not be left half done."""
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
    while the main thread waits. An interrupted main thread calls `stop`, waits for the call to give up, and
    raises the interruption.
    """
    if threading.current_thread() is not threading.main_thread():
        return call()  # signals go to the main thread, whose waiting call handles them
    results: list[Value] = []
    errors: list[BaseException] = []
    #: Taken by the thread, which then begins the call, or by an interruption, which so prevents it.
    begins = threading.Lock()
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
                stop()  # repeatedly, as a stop between two steps is lost
                done.wait(_LOOK_EVERY_S)
        raise
    if errors:
        raise errors[0]
    return results[0]
