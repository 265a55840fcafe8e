"""Rooms that are called as their commands are: ``ts.motif(64)`` is ``toposeam motif --size 64``."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspect import Signature


class Verb(ModuleType):
    """A room that can be called. Type checkers know of none: they want the function by its own name."""

    #: Name of the function in :mod:`toposeam`.
    _function: str

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function."""
        return getattr(sys.modules["toposeam"], self._function)(*arguments, **options)

    @property
    def __signature__(self) -> Signature:
        """The function's signature, which notebooks show."""
        from inspect import signature

        return signature(getattr(sys.modules["toposeam"], self._function))


def called(room: str, function: str) -> None:
    """Let a room be called.

    Parameters
    ----------
    room : str
        Name of the module.
    function : str
        Name of the function in :mod:`toposeam`.
    """
    module = sys.modules[room]
    module.__class__ = Verb
    module.__dict__["_function"] = function
