"""Rooms that are called as their commands are: ``ts.motif(64)`` is ``toposeam motif --size 64``.

What type checkers know of them stands in ``verbs.pyi``.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from inspect import Signature


class Verb(ModuleType):
    """A room that can be called; help and notebooks show its function's parameters."""

    #: The module of the room that holds the function, and the function's name.
    _verb: tuple[str, str]

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function."""
        return _function(self)(*arguments, **options)

    @property
    def __doc__(self) -> str | None:  # type: ignore[override]
        """The function's docstring."""
        return _function(self).__doc__

    @property
    def __signature__(self) -> Signature:
        """The function's signature."""
        from inspect import signature

        return signature(_function(self))


def _function(room: Verb) -> Callable[..., Any]:
    module, name = room._verb
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function


def called(room: str, module: str, function: str) -> None:
    """Let a room be called.

    Parameters
    ----------
    room : str
        Name of the room.
    module, function : str
        Name of the function, and of the room's module that holds it.
    """
    verb = sys.modules[room]
    verb.__dict__["_verb"] = (f"{room}.{module}", function)
    verb.__class__ = Verb
