"""The errors a caller can meet. Each derives from :class:`TopoSeamError` and from the builtin it
specialises.

An error is a template and data that fill it. ``str(error)`` fills it with the words of this package. A front
end says the same with words of its own (:meth:`TopoSeamError.said`), or has another sentence for errors of
that ``kind``. No text is searched for that, so what users have written, such as names of files, comes through
unharmed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from string import Formatter
from typing import Any, TypeVar

ErrorT = TypeVar("ErrorT", bound="TopoSeamError")


@dataclass(frozen=True, slots=True)
class Term:
    """A word in an error's sentence for which a front end may have another: a parameter, or a noun.

    Examples
    --------
    >>> str(Term("band")), str(Term("maps", "map 2", index=1)), str(Term("by", value="shifts"))
    ('band', 'map 2', "by='shifts'")
    """

    #: The parameter's name, or the noun; empty for what the user has named and nobody may rename.
    name: str
    #: How this package says it; by default the name.
    text: str = ""
    #: Of a parameter that takes several values, which one is meant.
    index: int | None = None
    #: Of a parameter with a certain value, the value.
    value: Any = None

    def __str__(self) -> str:
        if self.text:
            return self.text
        return self.name if self.value is None else f"{self.name}={self.value!r}"


#: A front end's word for a term; None where it has none.
Words = Callable[[Term], str | None]


@dataclass(frozen=True, slots=True)
class Interval:
    """The numbers that are allowed: [low, high], or (low, high] if `above`.

    Examples
    --------
    >>> str(Interval(0, 1)), str(Interval(1, noun="a whole number")), str(Interval(0, above=True))
    ('a number between 0 and 1', 'a whole number of at least 1', 'a positive number')
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    noun: str = "a number"

    def __str__(self) -> str:
        noun, low, high = self.noun, self.low, self.high
        if high < math.inf:
            if low == -math.inf:
                return f"{noun} of at most {high:g}"
            if self.above:
                return f"{noun} above {low:g} and at most {high:g}"
            return f"{noun} between {low:g} and {high:g}"
        if low == -math.inf:
            return noun
        if self.above and low == 0:
            return f"a positive {noun.removeprefix('a ')}"
        return f"{noun} {'above' if self.above else 'of at least'} {low:g}"


class TopoSeamError(Exception):
    """Root of every error this package raises on purpose; its text says what was received and what to do.

    Parameters
    ----------
    message : str
        The sentence. With a kind or data it is a template in the syntax of :meth:`str.format`: a field is
        filled with the data of that name, or stands for a :class:`Term`. ``{field!r}`` shows a value shortly.
    kind : str
        What went wrong, in one or two words that stay the same when the sentence changes.
    **data
        What the sentence is about, such as ``parameter``, ``value``, ``allowed`` or ``layers``.

    Examples
    --------
    >>> error = OptionError(
    ...     "{parameter} is {value!r}; it must be {allowed}",
    ...     kind="number", parameter=Term("band"), value=1, allowed=Interval(4, 10),
    ... )
    >>> str(error)
    'band is 1; it must be a number between 4 and 10'
    >>> error.said(lambda term: f"--{term.name}")
    '--band is 1; it must be a number between 4 and 10'
    >>> error.parameter, error.value, error.allowed.high
    ('band', 1, 10)
    """

    def __init__(self, message: str = "", *, kind: str = "", **data: Any) -> None:
        super().__init__(message)
        self.kind = kind
        self.data: dict[str, Any] = data

    @property
    def parameter(self) -> str | None:
        """The parameter that was given something wrong."""
        term = self.data.get("parameter")
        return term.name if isinstance(term, Term) and term.name else None

    @property
    def value(self) -> Any:
        """What it was given."""
        return self.data.get("value")

    @property
    def allowed(self) -> Any:
        """What it may be given: an :class:`Interval`, a tuple of choices, or a description."""
        return self.data.get("allowed")

    @property
    def layers(self) -> tuple[int, ...]:
        """Which of the given layers or pictures it is about, counted from 0."""
        return tuple(self.data.get("layers", ()))

    def said(self, words: Words | None = None) -> str:
        """The sentence with a front end's words for its terms."""
        message = str(self.args[0]) if self.args else ""
        return _Sentence(words).vformat(message, (), self.data) if self.kind or self.data else message

    def within(self: ErrorT, message: str, **data: Any) -> ErrorT:
        """The same error in a longer sentence, where the field ``error`` stands for the shorter one.

        Examples
        --------
        >>> str(PathError("it is bent").within("'{file}': {error}", file="a {b}.svg"))
        "'a {b}.svg': it is bent"
        """
        return type(self)(message, kind=self.kind, **{**self.data, **data, "error": self})

    def naming(self: ErrorT, **names: str) -> ErrorT:
        """The same error with names, such as a layer's, for terms; front ends do not replace them.

        Examples
        --------
        >>> str(OverlapError("{a} is smaller than {b}", kind="small").naming(a="c", b="d"))
        'c is smaller than d'
        """

        def named(value: Any) -> Any:
            if isinstance(value, TopoSeamError):
                return value.naming(**names)
            if isinstance(value, Term) and value.name in names:
                return Term("", names[value.name])
            return value

        data: dict[str, Any] = {name: Term("", text) for name, text in names.items()}
        data |= {name: named(value) for name, value in self.data.items()}
        return type(self)(str(self.args[0]), kind=self.kind, **data)

    def __str__(self) -> str:
        return self.said()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        data = {name: _portable(value) for name, value in self.data.items()}
        return type(self), self.args, {**self.__dict__, "data": data}


class ImageError(TopoSeamError, ValueError):
    """An image array (or file) that cannot be used: shape, channels, dtype, NaN."""


class OverlapError(TopoSeamError, ValueError):
    """The patches do not overlap in a way that admits a seam."""


class OptionError(TopoSeamError, ValueError):
    """An option outside its range, or options that contradict each other."""


class PathError(TopoSeamError, ValueError):
    """A vector path that cannot be read, or that does not cut the overlap."""


class MissingPackageError(TopoSeamError, ImportError):
    """An optional package that was asked for is not installed."""


class SolverError(TopoSeamError, RuntimeError):
    """The numerical solution broke down."""


class _Sentence(Formatter):
    """Fills a sentence's gaps."""

    def __init__(self, words: Words | None) -> None:
        self._words = words

    def get_value(self, key: int | str, args: Any, kwargs: Mapping[str, Any]) -> Any:
        return self._named(kwargs.get(str(key), Term(str(key))))

    def _named(self, value: Any) -> Any:
        if isinstance(value, Term):
            own = self._words(value) if self._words is not None and value.name else None
            return own or str(value)
        if isinstance(value, tuple):
            return tuple(map(self._named, value))
        return value.said(self._words) if isinstance(value, TopoSeamError) else value

    def convert_field(self, value: Any, conversion: Any) -> Any:
        return shown(value) if conversion == "r" else super().convert_field(value, conversion)

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, tuple):
            return ", ".join(format(item, format_spec) for item in value)
        return str(format(value, format_spec)) if format_spec else str(value)


class _Shown(str):
    """What a value looked like that does not go to another process."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def shown(value: Any) -> str:
    """What was received, on one line and not too long, for error texts."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}…"


def _portable(value: Any) -> Any:
    """The value, or for values that other processes may not be able to read what it looks like."""
    if value is None or isinstance(value, bool | int | float | str | Interval | TopoSeamError):
        return value
    if isinstance(value, Term):
        return Term(value.name, value.text, value.index, _portable(value.value))
    if isinstance(value, tuple):
        return tuple(_portable(item) for item in value)
    return _Shown(shown(value))
