"""Processes beside the server: their messages arrive in the server's loop, in order."""

from __future__ import annotations

import asyncio
import multiprocessing
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

#: A process that holds so many unread messages is stuck.
_MOST_WAITING = 1000
#: Time that a process has to end after it was asked to, s.
_END_S = 5.0


class Worker:
    """A process that runs a function of a connection and further arguments."""

    def __init__(
        self, function: Callable[..., None], arguments: tuple[Any, ...], take: Callable[[Any], None]
    ) -> None:
        """Start it; `take` gets each message in the running loop, and None when the process has ended."""
        context = multiprocessing.get_context("spawn")
        self._own, theirs = context.Pipe()
        self._process = context.Process(target=function, args=(theirs, *arguments), daemon=True)
        self._process.start()
        theirs.close()
        self._loop, self._take = asyncio.get_running_loop(), take
        self._outgoing: queue.Queue[Any] = queue.Queue(_MOST_WAITING)
        for target in (self._read, self._write):
            threading.Thread(target=target, daemon=True).start()

    def send(self, message: Any) -> bool:
        """Send a message; False if too many wait."""
        try:
            self._outgoing.put_nowait(message)
        except queue.Full:
            return False
        return True

    def ask_to_end(self) -> None:
        """Ask the process to end; what it has not finished goes with it."""
        self._process.terminate()

    def end(self) -> None:
        """End the process, at once if it does not by itself."""
        with suppress(queue.Full):
            self._outgoing.put_nowait(None)
        self._process.terminate()
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _read(self) -> None:
        message: Any = ()
        while message is not None:
            try:
                message = self._own.recv()
            except (EOFError, OSError):
                message = None
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._take, message)

    def _write(self) -> None:
        while (message := self._outgoing.get()) is not None:
            try:
                self._own.send(message)
            except OSError:
                return
