"""The messages between the server and a process that solves, at the process's end."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import Any

Message = dict[str, Any]


class Inbox:
    """Messages of a page that wait for an answer; answers go back by :meth:`say`."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._waiting: deque[Message] = deque()

    def say(self, kind: str, head: Message, blocks: Sequence[bytes] = ()) -> None:
        """Send an answer."""
        self._connection.send((kind, head, list(blocks)))

    def receive(self) -> deque[Message]:
        """Take in what has come; return all messages that wait."""
        while self._connection.poll():
            self._waiting.append(self._connection.recv())
        return self._waiting

    def rests(self, seconds: float) -> bool:
        """Return whether no message waits, and none comes for some time."""
        return not self._waiting and not self._connection.poll(seconds)

    def next(self, replaces: Callable[[Message, Message], bool]) -> Message:
        """Wait for the next message; those that are replaced by the one after them are dropped.

        Parameters
        ----------
        replaces : callable
            Tells whether its second message, which came later, replaces the first one.
        """
        if not self._waiting:
            self._waiting.append(self._connection.recv())
        self.receive()
        message = self._waiting.popleft()
        while self._waiting and replaces(message, self._waiting[0]):
            message = self._waiting.popleft()
        return message
