"""Independent parts of the work, here or elsewhere.

What does not depend on each other is a function and a list of items, each of which says all that its part
needs: pictures as what reads them (:class:`toposeam.Windows`), maps of the canvas cut to where they matter.
Results come in the order of the items, wherever they were computed, so that nothing depends on how many
workers there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, TypeVar

from toposeam.errors import OptionError
from toposeam.layers.layer import Box

Item = TypeVar("Item")
Result = TypeVar("Result")


class Executor(Protocol):
    """What does independent parts of the work: :class:`concurrent.futures.Executor` is one."""

    def map(self, function: Callable[[Any], Any], items: Iterable[Any], /) -> Iterable[Any]:
        """The results of a function of each item, in their order; both can be pickled."""
        ...


def check_executor(executor: Any) -> None:
    """Refuse what does no work.

    Raises
    ------
    OptionError
    """
    if executor is not None and (isinstance(executor, type) or not callable(getattr(executor, "map", None))):
        raise OptionError(
            f"executor is of type {type(executor).__name__}; pass a concurrent.futures.Executor or None"
        )


def results(
    executor: Executor | None, function: Callable[[Item], Result], items: Iterable[Item]
) -> Iterable[Result]:
    """A function of each item, in their order; in this process, one when it is asked for, without executor.

    Examples
    --------
    >>> list(results(None, abs, [-1, 2]))
    [1, 2]
    """
    return map(function, items) if executor is None else executor.map(function, items)


def groups(boxes: Sequence[Box]) -> list[list[int]]:
    """Work on boxes of one map, in groups to be done one after another: within a group no two boxes have a
    pixel in common. The largest boxes come first, each in the first group that it fits in, so that there are
    few groups, however many boxes there are.

    Examples
    --------
    >>> groups([Box(0, 0, 9, 5), Box(0, 4, 9, 9), Box(0, 9, 9, 12), Box(3, 0, 6, 12)])
    [[0, 2], [1], [3]]
    """
    found: list[list[int]] = []
    for index in sorted(range(len(boxes)), key=lambda k: (-boxes[k].shape[0] * boxes[k].shape[1], k)):
        for group in found:
            if not any(all(boxes[k].shared(boxes[index]).shape) for k in group):
                group.append(index)
                break
        else:
            found.append([index])
    return found
