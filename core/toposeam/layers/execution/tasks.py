"""Run independent tasks in this process or by an executor.

Tasks are a function and a list of items. An item holds everything that its task needs: pictures as readers
(:class:`toposeam.Windows`), and maps of the canvas cut to where they are used. Results come in the order of
the items, wherever they were computed, so that nothing depends on the number of workers.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

from toposeam.errors import OptionError, Term
from toposeam.layers.canvas.layer import Box

Item = TypeVar("Item")
Result = TypeVar("Result")


class Executor(Protocol):
    """Runs independent tasks: a :class:`concurrent.futures.Executor`, for example."""

    def map(self, function: Callable[[Any], Any], items: Iterable[Any], /) -> Iterable[Any]:
        """Return the results of a function of each item, in their order; both can be pickled."""
        ...


@runtime_checkable
class Streaming(Protocol):
    """An executor that yields results as they come, and asks for items as soon as it can begin them."""

    def stream(
        self, function: Callable[[Any], Any], ready: Callable[[], tuple[int, Any] | None], /
    ) -> Iterator[tuple[int, Any]]:
        """Yield the results of a function of items, each with the item's number.

        `ready` returns the next item that can begin, None if there is none at the moment. All work is done
        when there is none and no task is running.
        """
        ...


def check_executor(executor: Any) -> None:
    """Refuse a value that is not an executor.

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
    """Map a function over items, in their order; without an executor in this process, lazily.

    Examples
    --------
    >>> list(results(None, abs, [-1, 2]))
    [1, 2]
    """
    return map(function, items) if executor is None else executor.map(function, items)


def in_bundles(items: Sequence[Item], size: int) -> list[Sequence[Item]]:
    """Group small items into lists of `size`, each of which is one task.

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
    """Run tasks of which each can be made only from the results of some earlier ones; yield results with
    their numbers as they come.

    Parameters
    ----------
    executor : Executor, optional
    function : callable
    item : callable
        Makes the item of a number; called when the caller has consumed the results that it needs.
    needs : sequence of collections of int
        For each item, the numbers of the earlier items whose results it needs.

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
    """For each box, list the earlier boxes that share a pixel with it, whose work it must wait for.

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
    """Group boxes of one map so that no two boxes of a group share a pixel.

    The largest boxes come first, each in the first group in which it fits, so that there are few groups,
    however many boxes there are.

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
    """Run tasks on boxes of one map, in the order of :func:`groups`; yield results with their numbers.

    Tasks whose boxes share no pixel run at the same time. The caller writes each result to the map before
    asking for the next one.

    Parameters
    ----------
    executor : Executor, optional
    function : callable
    item : callable
        Makes the item of a number from the current map.
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
