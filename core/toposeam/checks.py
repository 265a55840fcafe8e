"""Checks of arguments: numbers, choices, classes, arrays, seeds, options."""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Collection, Mapping
from typing import Any, SupportsFloat, TypeVar

import numpy as np
import numpy.typing as npt

from toposeam.errors import Interval, OptionError, Term

#: A whole number, a generator from which one is drawn, or None for a new one at every call.
Seed = int | np.random.Generator | None

OptionsT = TypeVar("OptionsT")
#: Name of the checked parameter, as error texts show it.
Name = str | Term


def check_number(
    name: Name,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    infinite: bool = False,
) -> float:
    """Return a value as float if it is a number in [low, high], or in (low, high] with `above`.

    Parameters
    ----------
    name : str or Term
        Name of the parameter.
    value : object
        int, float and NumPy's scalars are numbers; bool and text are not.
    low, high : float
    above : bool
        Exclude `low` itself.
    infinite : bool
        Accept ``inf``. NaN is always refused.

    Returns
    -------
    float

    Raises
    ------
    OptionError
        States the value and the allowed interval.

    Examples
    --------
    >>> check_number("weight", 1, 0, 1)
    1.0
    >>> check_number("weight", "x", 0, 1)
    Traceback (most recent call last):
        ...
    toposeam.errors.OptionError: weight is 'x'; it must be a number between 0 and 1
    """
    number = math.nan
    # Test for float and int first: the test for the protocol takes thirty times as long.
    if isinstance(value, (float, int, SupportsFloat)) and not isinstance(value, (bool, np.bool_, np.ndarray)):
        try:
            number = float(value)
        except (OverflowError, TypeError, ValueError):
            number = math.nan
    inside = low < number if above else low <= number
    if inside and number <= high and (infinite or math.isfinite(number)):
        return number
    raise OptionError(
        "{parameter} is {value!r}; it must be {allowed}",
        kind="number",
        parameter=term_of(name),
        value=value,
        allowed=Interval(low, high, above),
    )


def check_whole(name: Name, value: Any, low: int, high: int | None = None) -> int:
    """Return a value as int if it is a whole number in [low, high].

    Raises
    ------
    OptionError
        For anything else; 2.5, 2.0, True and "2" are no whole numbers.

    Examples
    --------
    >>> check_whole("max_iterations", np.int64(3), 1)
    3
    """
    number = None
    if not isinstance(value, bool | np.bool_):
        try:
            number = operator.index(value)
        except TypeError:
            number = None
    if number is not None and low <= number and (high is None or number <= high):
        return number
    raise OptionError(
        "{parameter} is {value!r}; it must be {allowed}",
        kind="whole number",
        parameter=term_of(name),
        value=value,
        allowed=Interval(low, math.inf if high is None else high, noun="a whole number"),
    )


def check_range(low: float, high: float = math.inf, *, above: bool = False, **options: Any) -> None:
    """Refuse options that are no finite number in [low, high], or in (low, high] with `above`.

    Raises
    ------
    OptionError
        Names the first option that is out of range.
    """
    for name, value in options.items():
        check_number(name, value, low, high, above=above)


def check_choice(name: Name, value: Any, choices: Collection[Any]) -> None:
    """Refuse a value that is not among the choices.

    Raises
    ------
    OptionError
    """
    if not isinstance(value, str | int | bool | None) or value not in choices:
        raise OptionError(
            "{parameter} is {value!r}; choose one of {allowed}",
            kind="choice",
            parameter=term_of(name),
            value=value,
            allowed=tuple(choices),
        )


def check_kind(name: Name, value: Any, kind: type | tuple[type, ...], wanted: str) -> None:
    """Refuse a value of another class.

    Parameters
    ----------
    name : str or Term
        Name of the parameter.
    value : object
    kind : type or tuple of types
    wanted : str
        Description of an allowed value for the error text: "a Motif", "a sequence of Layers".

    Raises
    ------
    OptionError

    Examples
    --------
    >>> check_kind("motif", "x", int, "a Motif")
    Traceback (most recent call last):
        ...
    toposeam.errors.OptionError: motif is 'x'; pass a Motif
    """
    if not isinstance(value, kind):
        raise kind_error(name, value, wanted)


def check_function(name: Name, value: Any) -> None:
    """Refuse a callback that is neither callable nor None, before any work is done.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> check_function("progress", print)
    """
    if value is not None and not callable(value):
        raise kind_error(name, value, "a function, or None")


def check_items(name: Name, values: Any, kind: type | tuple[type, ...], wanted: str) -> tuple[Any, ...]:
    """Return the items of a sequence as a tuple if all are of one class.

    Raises
    ------
    OptionError
        For an item of another class, and when `values` is no sequence.
    """
    if isinstance(values, str | bytes) or (kind is not object and isinstance(values, kind)):
        raise kind_error(name, values, wanted)
    try:
        items = tuple(values)
    except TypeError as error:
        raise kind_error(name, values, wanted) from error
    for item in items:
        if not isinstance(item, kind):
            raise OptionError(
                "{parameter} holds {value!r}; pass {allowed}",
                kind="type",
                parameter=term_of(name),
                value=item,
                allowed=wanted,
            )
    return items


def kind_error(name: Name, value: Any, wanted: str) -> OptionError:
    """Return the error for a value of the wrong kind; `wanted` describes an allowed one."""
    return OptionError(
        "{parameter} is {value!r}; pass {allowed}",
        kind="type",
        parameter=term_of(name),
        value=value,
        allowed=wanted,
    )


def term_of(name: Name) -> Term:
    """Return a name as the term that front ends may translate."""
    return name if isinstance(name, Term) else Term(name)


def is_masked(values: Any) -> bool:
    """Return whether values are a masked array; plain arrays do not load ``numpy.ma``."""
    return type(values) is not np.ndarray and isinstance(values, np.ma.MaskedArray)


def check_numbers(name: Name, values: Any) -> npt.NDArray[np.float64]:
    """Return values as a float64 array of any shape.

    Raises
    ------
    OptionError
        For text, objects, lists of unequal lengths, and masked arrays.
    """
    if is_masked(values):
        raise OptionError(
            "{parameter} is a masked array; pass {parameter}.filled(…)", kind="type", parameter=term_of(name)
        )
    try:
        array = np.asarray(values)
        if array.dtype.kind in "biuf":
            return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise kind_error(name, values, "numbers")


def check_whole_array(name: Name, values: Any) -> npt.NDArray[np.integer[Any]]:
    """Return values as an integer array of any shape.

    Raises
    ------
    OptionError
        For other dtypes, and lists of unequal lengths.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind in "iu":
            return array
    except (TypeError, ValueError, OverflowError):
        pass
    raise kind_error(name, values, "whole numbers")


def check_pair(name: Name, value: Any, low: int, high: int | None = None) -> tuple[int, int]:
    """Return a value as two ints if it is a pair of whole numbers in [low, high].

    Raises
    ------
    OptionError
    """
    try:
        first, second = value
    except (TypeError, ValueError) as error:
        raise kind_error(name, value, "two whole numbers") from error
    return check_whole(name, first, low, high), check_whole(name, second, low, high)


def seed_of(seed: Seed) -> int:
    """Return a seed as a whole number, drawn from a generator if one is given, or new for None.

    Results keep this number, so that they can be made again.

    Raises
    ------
    OptionError
        For a negative number or another class.

    Examples
    --------
    >>> seed_of(7), seed_of(np.random.default_rng(0)) == seed_of(np.random.default_rng(0))
    (7, True)
    """
    if seed is None:
        seed = np.random.default_rng()
    if isinstance(seed, np.random.Generator):
        return int(seed.integers(2**53))
    try:
        return check_whole("seed", seed, 0)
    except OptionError as error:
        raise kind_error(
            "seed", seed, "a whole number from 0 on, a numpy.random.Generator, or None"
        ) from error


def options_from(
    kind: type[OptionsT], options: OptionsT | None, given: Mapping[str, Any], taker: str
) -> OptionsT:
    """Return the options of a call as an instance of their dataclass.

    The caller gives either the instance or plain keywords, not both.

    Parameters
    ----------
    kind : type
        The dataclass.
    options : instance of `kind` or None
    given : dict
        The keywords.
    taker : str
        Name, in error texts, of the method that takes the options: "method heat".

    Raises
    ------
    OptionError
        For another class, for both at once, and for keywords that are no field of `kind`.
    """
    if options is not None:
        if not isinstance(options, kind):
            raise OptionError(
                "{parameter} is of class {type}; {taker} takes {allowed}",
                kind="type",
                parameter=Term("options"),
                value=options,
                type=type(options).__name__,
                taker=taker,
                allowed=kind.__name__,
            )
        if given:
            raise OptionError(
                "{names} was given beside {parameter}; write it into {type}",
                kind="conflict",
                parameter=Term("options"),
                names=tuple(map(Term, sorted(given))),
                type=kind.__name__,
            )
        return options
    known = [option.name for option in dataclasses.fields(kind)]  # type: ignore[arg-type]
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise OptionError(
            "{taker} does not know {names}; its options are {allowed}",
            kind="unknown",
            parameter=Term(unknown[0]),
            names=tuple(map(Term, unknown)),
            taker=taker,
            allowed=tuple(known),
        )
    return kind(**given)


def with_meant(error: OptionError, names: Collection[str]) -> OptionError:
    """Return an error about an unknown option with the name of `names` that was meant, if one is alike."""
    from difflib import get_close_matches  # only for errors

    unknown = str(error.parameter) if error.kind == "unknown" else ""
    meant = get_close_matches(unknown, names, 1, 0.8)
    if not meant:
        return error
    return OptionError(
        "there is no option {name}; did you mean {meant}?",
        kind="unknown",
        parameter=error.parameter,
        name=unknown,
        meant=Term(meant[0]),
    )
