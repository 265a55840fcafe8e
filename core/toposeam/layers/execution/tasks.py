"""Independent parts of the work, here or elsewhere.

What does not depend on each other is a function and a list of items, each of which says all that its part
needs: pictures as what reads them (:class:`toposeam.Windows`), maps of the canvas cut to where they matter.
Results come in the order of the items, wherever they were computed, so that nothing depends on how many
workers there are.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

from toposeam.errors import OptionError, Term
from toposeam.layers.canvas.layer import Box

Item = TypeVar("Item")
Result = TypeVar("Result")


class Executor(Protocol):
    """What does independent parts of the work: :class:`concurrent.futures.Executor` is one."""

    def map(self, function: Callable[[Any], Any], items: Iterable[Any], /) -> Iterable[Any]:
        """The results of a function of each item, in their order; both can be pickled."""
        ...


@runtime_checkable
class Streaming(Protocol):
    """An executor that tells results when they come, and asks for items when it can begin them."""

    def stream(
        self, function: Callable[[Any], Any], ready: Callable[[], tuple[int, Any] | None], /
    ) -> Iterator[tuple[int, Any]]:
        """The results of a function of items, each with its number.

        `ready` gives the next item that can begin, None while there is none; when there is none and nothing
        is being done, all is.
        """
        ...


def check_executor(executor: Any) -> None:
    """Refuse what does no work.

    Raises
    ------
    OptionError
    """
    if executor is not None and (isinstance(executor, type) or not callable(getattr(executor, "map", None))):
        raise OptionError(
            "{parameter} is of type {type}; pass {allowed}",
            kind="type",
            parameter=Term("executor"),
            value=executor,
            type=type(executor).__name__,
            allowed="a concurrent.futures.Executor or None",
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


def in_bundles(items: Sequence[Item], size: int) -> list[Sequence[Item]]:
    """Items that take so little that so many are handed on at once.

    Examples
    --------
    >>> in_bundles("abcde", 2)
    ['ab', 'cd', 'e']
    """
    return [items[start : start + size] for start in range(0, len(items), size)]


def in_turn(
    executor: Executor | None,
    function: Callable[[Item], Result],
    item: Callable[[int], Item],
    needs: Sequence[Collection[int]],
) -> Iterator[tuple[int, Result]]:
    """A function of items that can be made only when the results of some earlier ones are known: each
    result, with its number, when it comes.

    Parameters
    ----------
    executor : Executor, optional
    function : callable
    item : callable
        Makes the item of a number; called when whoever asked for the results it needs has taken them.
    needs : sequence of collections of int
        Of each item, the earlier ones.

    Examples
    --------
    >>> sums = [1]
    >>> for number, found in in_turn(None, abs, lambda k: -2 * sums[k], [(), (0,), (1,)]):
    ...     sums.append(found)
    >>> sums
    [1, 2, 4, 8]
    """
    waiting, taken = list(range(len(needs))), set[int]()
    if executor is None:
        yield from ((number, function(item(number))) for number in waiting)
        return

    def ready() -> tuple[int, Item] | None:
        for at, number in enumerate(waiting):
            if taken.issuperset(needs[number]):
                del waiting[at]
                return number, item(number)
        return None

    if isinstance(executor, Streaming):
        for number, result in executor.stream(function, ready):
            yield number, result
            taken.add(number)
        return
    while waiting:
        found = list(iter(ready, None))
        results_of = executor.map(function, [made for _, made in found])
        for (number, _), result in zip(found, results_of, strict=True):
            yield number, result
            taken.add(number)


def touching(boxes: Sequence[Box]) -> list[list[int]]:
    """Of work on boxes of one map, done in their order, which earlier ones each must wait for: those that it
    has a pixel in common with.

    Examples
    --------
    >>> touching([Box(0, 0, 9, 5), Box(0, 9, 9, 12), Box(0, 4, 9, 9), Box(3, 0, 6, 12)])
    [[], [], [0], [0, 1, 2]]
    """
    return [
        [earlier for earlier in range(number) if all(boxes[earlier].shared(box).shape)]
        for number, box in enumerate(boxes)
    ]


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


def on_boxes(
    executor: Executor | None,
    function: Callable[[Item], Result],
    item: Callable[[int], Item],
    boxes: Sequence[Box],
) -> Iterator[tuple[int, Result]]:
    """A function of work on boxes of one map, each result with its number: in the order of :func:`groups`,
    and at once where no two boxes have a pixel in common. Whoever asks takes each result in before the next.

    Parameters
    ----------
    executor : Executor, optional
    function : callable
    item : callable
        Makes the item of a number from the map as it is then.
    boxes : sequence of Box

    Examples
    --------
    >>> boxes = [Box(0, 0, 1, 3), Box(0, 2, 1, 5), Box(0, 4, 1, 6)]
    >>> [number for number, _ in on_boxes(None, abs, lambda number: -number, boxes)]
    [0, 2, 1]
    """
    order = [k for group in groups(boxes) for k in group]
    needs = touching([boxes[k] for k in order])
    for number, result in in_turn(executor, function, lambda number: item(order[number]), needs):
        yield order[number], result
