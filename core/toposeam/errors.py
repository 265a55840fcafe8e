"""The errors that this package raises. Each derives from :class:`TopoSeamError` and from a builtin.

An error is a template and the data that fill it. ``str(error)`` fills it with the terms of this package. A
front end fills it with terms of its own (:meth:`TopoSeamError.sentence`), or has another sentence for errors
of that ``kind``. Neither searches texts, so that texts of the user, such as names of files, stay unchanged.
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
    """A word in an error's sentence that a front end may translate: a parameter or a noun.

    Examples
    --------
    >>> str(Term("band")), str(Term("maps", "map 2", index=1)), str(Term("by", value="shifts"))
    ('band', 'map 2', "by='shifts'")
    """

    #: The parameter's name, or the noun; empty for a name given by the user, which is never translated.
    name: str
    #: The word of this package; by default the name.
    text: str = ""
    #: Number of the value that is meant, from 0, if the parameter takes several.
    index: int | None = None
    #: The value that is meant, if the term is a parameter with a certain value.
    value: Any = None

    def __str__(self) -> str:
        if self.text:
            return self.text
        return self.name if self.value is None else f"{self.name}={self.value!r}"


#: Returns a front end's word for a term, or None to keep this package's.
Words = Callable[[Term], str | None]


@dataclass(frozen=True, slots=True)
class Interval:
    """The interval of allowed numbers: [low, high], or (low, high] if `above`.

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
    """Root of every error this package raises on purpose; its text states the value received and a remedy.

    Parameters
    ----------
    message : str
        The sentence. With a kind or data it is a template in the syntax of :meth:`str.format`: a field is
        filled with the data of that name, or stands for a :class:`Term`. ``{field!r}`` is a short repr.
    kind : str
        Code of the error, one or two words that stay the same when the sentence changes.
    **data
        Values for the fields, such as ``parameter``, ``value``, ``allowed`` or ``layers``.

    Examples
    --------
    >>> error = OptionError(
    ...     "{parameter} is {value!r}; it must be {allowed}",
    ...     kind="number", parameter=Term("band"), value=1, allowed=Interval(4, 10),
    ... )
    >>> str(error)
    'band is 1; it must be a number between 4 and 10'
    >>> error.sentence(lambda term: f"--{term.name}")
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
        """Name of the parameter with the wrong value, or None."""
        term = self.data.get("parameter")
        return term.name if isinstance(term, Term) and term.name else None

    @property
    def value(self) -> Any:
        """The wrong value, or None."""
        return self.data.get("value")

    @property
    def allowed(self) -> Any:
        """The allowed values: an :class:`Interval`, a tuple of choices, a description, or None."""
        return self.data.get("allowed")

    @property
    def layers(self) -> tuple[int, ...]:
        """Numbers of the layers or pictures that caused the error, counted from 0."""
        return tuple(self.data.get("layers", ()))

    def sentence(self, words: Words | None = None) -> str:
        """Return the text of the error, with a front end's words for its terms."""
        message = str(self.args[0]) if self.args else ""
        return _Sentence(words).vformat(message, (), self.data) if self.kind or self.data else message

    def within(self: ErrorT, message: str, **data: Any) -> ErrorT:
        """Return the same error with a longer sentence, in which the field ``error`` holds this one's text.

        Examples
        --------
        >>> str(PathError("it is bent").within("'{file}': {error}", file="a {b}.svg"))
        "'a {b}.svg': it is bent"
        """
        return type(self)(message, kind=self.kind, **{**self.data, **data, "error": self})

    def naming(self: ErrorT, **names: str) -> ErrorT:
        """Return the same error with names, such as a layer's, for terms; front ends do not translate names.

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
        return self.sentence()

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
    """Formatter that fills a template with data and with a front end's words."""

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
        return value.sentence(self._words) if isinstance(value, TopoSeamError) else value

    def convert_field(self, value: Any, conversion: Any) -> Any:
        return short_repr(value) if conversion == "r" else super().convert_field(value, conversion)

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, tuple):
            return ", ".join(format(item, format_spec) for item in value)
        return str(format(value, format_spec)) if format_spec else str(value)


class _ReprText(str):
    """Text in place of a value that cannot be sent to another process; its repr is the text itself."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def short_repr(value: Any) -> str:
    """Return the repr of a value for error texts: on one line, at most 60 characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}…"


def _portable(value: Any) -> Any:
    """Return a value that can be pickled: the value itself if it is of a known class, else its short repr."""
    if value is None or isinstance(value, bool | int | float | str | Interval | TopoSeamError):
        return value
    if isinstance(value, Term):
        return Term(value.name, value.text, value.index, _portable(value.value))
    if isinstance(value, tuple):
        return tuple(_portable(item) for item in value)
    return _ReprText(short_repr(value))
