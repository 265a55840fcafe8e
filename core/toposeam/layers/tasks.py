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


def waves(boxes: Sequence[Box]) -> list[list[int]]:
    """Work on boxes of one map, in groups to be done one after another: within a group no two boxes have a
    pixel in common, and of two that do the first one comes first.

    Examples
    --------
    >>> waves([Box(0, 0, 9, 5), Box(0, 4, 9, 9), Box(0, 9, 9, 12), Box(3, 0, 6, 12)])
    [[0, 2], [1], [3]]
    """
    groups: list[list[int]] = []
    number: list[int] = []
    for index, box in enumerate(boxes):
        after = [number[k] + 1 for k in range(index) if all(boxes[k].shared(box).shape)]
        number.append(max(after, default=0))
        if number[-1] == len(groups):
            groups.append([])
        groups[number[-1]].append(index)
    return groups
