"""Parameter types and options that several commands share. They parse and check, so that a command gets
numbers, lengths and checked paths.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

import toposeam as ts
from toposeam.errors import ImageError, OptionError
from toposeam_cli.app.command import option
from toposeam_cli.files.regular import check_input, check_regular


@dataclass(frozen=True, slots=True)
class Length:
    """A length in pixels, or as a share of a side."""

    value: float
    percent: bool

    def pixels(self, whole: int) -> int:
        """Return the length in px, given the side of which it may be a share, px."""
        return round(self.value / 100 * whole) if self.percent else int(self.value)


class OffsetType(click.ParamType):  # type: ignore[type-arg]  # generic only since click 8.4
    """``X,Y`` in whole pixels; for clips ``T,X,Y``, T in frames."""

    name = "X,Y"
    #: Separator of two numbers.
    sign = ","

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        """Parse the text."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"\s*([+-]?\d+)" + 2 * r"(?:\s*,\s*([+-]?\d+))" + r"?\s*", value)
        if match is not None and max(len(part.lstrip("+-")) for part in match.groups(default="")) > 9:
            self.fail(f"{value!r} lies too far away; nine digits are the most", param, ctx)
        if match is None:
            self.fail(
                f"{value!r} is not an offset; write two whole numbers of pixels, like 120,-4", param, ctx
            )
        return tuple(int(part) for part in match.groups() if part is not None)


class LengthType(click.ParamType):  # type: ignore[type-arg]
    """``N`` pixels or ``N%``."""

    name = "N[%]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Length:
        """Parse the text."""
        if isinstance(value, Length):
            return value
        match = re.fullmatch(r"\s*(\d{1,9}(?:\.\d+)?)\s*(px|%)?\s*", value)
        percent = match is not None and match[2] == "%"
        if (
            match is None
            or (not percent and not float(match[1]).is_integer())
            or not 0 < float(match[1]) <= (100 if percent else 1e9)
        ):
            self.fail(
                f"{value!r} is not an overlap; write pixels, like 80, or a share from 0% to 100%, like 25%",
                param,
                ctx,
            )
        return Length(float(match[1]), percent)


class PairType(click.ParamType):  # type: ignore[type-arg]
    """Two whole numbers ``AxB``, or one for both: WIDTHxHEIGHT, or COLUMNSxROWS of `cells`."""

    #: Separator of two numbers.
    sign = "x"

    def __init__(self, cells: bool = False) -> None:
        self._example = "columns and rows, like 6x4" if cells else "width and height, like 512x384"
        self.name = "COLUMNSxROWS" if cells else "N|WIDTHxHEIGHT"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Parse the text."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"\s*(\d{1,9})(?:\s*[xX×]\s*(\d{1,9}))?\s*", str(value))
        if match is None or int(match[1]) < 1 or (match[2] is not None and int(match[2]) < 1):
            self.fail(
                f"{value!r} is not a size; write one whole number above 0, or {self._example}", param, ctx
            )
        return int(match[1]), int(match[2] or match[1])


@dataclass(frozen=True, slots=True)
class AutoSize:
    """The size at which a regular texture closes that is nearest to a wished one."""

    #: Width and height, px; None leaves it to the command.
    wish: tuple[int, int] | None


class TextureSizeType(PairType):
    """Width and height, or ``auto``, or ``auto:`` and the size wished for."""

    name = "N|WIDTHxHEIGHT|auto[:SIZE]"

    def __init__(self) -> None:
        super().__init__()
        self.name = type(self).name

    def convert(  # type: ignore[override]
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int] | AutoSize:
        """Parse the text."""
        if isinstance(value, AutoSize):
            return value
        word, colon, wish = str(value).strip().partition(":")
        if word.lower() != "auto":
            return super().convert(value, param, ctx)
        return AutoSize(super().convert(wish, param, ctx) if colon else None)


class NumbersType(click.ParamType):  # type: ignore[type-arg]
    """A number, or one per layer with commas between."""

    def __init__(self, kind: type[int] | type[float]) -> None:
        self.kind = kind
        self.name = "N[,N...]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text."""
        if isinstance(value, list | tuple):
            value = ",".join(map(str, value))
        try:
            numbers = [self.kind(word) for word in str(value).split(",")]
        except ValueError:
            numbers = [math.nan]
        if not all(math.isfinite(number) for number in numbers):
            self.fail(
                f"{value!r} is not a number, nor one per layer; write them like "
                f"{'2,5' if self.kind is int else '0.2,0.3'}",
                param,
                ctx,
            )
        return numbers[0] if len(numbers) == 1 else numbers


class PaperLengthType(click.ParamType):  # type: ignore[type-arg]
    """A length on paper, in mm."""

    name = "LENGTH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse the text."""
        if isinstance(value, float):
            return value
        match = re.fullmatch(r"\s*(\d{1,6}(?:\.\d+)?)\s*(mm|cm|m|in)\s*", str(value))
        if match is None or float(match[1]) == 0:
            self.fail(f"{value!r} is not a length; write it with its unit, like 80mm, 8cm or 3in", param, ctx)
        return float(match[1]) * {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}[match[2]]


class FiniteRange(click.FloatRange):
    """A number within bounds; NaN and infinity, which comparisons let through, are none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse the text."""
        with suppress(TypeError, ValueError, OverflowError):
            if not math.isfinite(float(value)):
                self.fail(f"{value!r} is not a finite number", param, ctx)
        number: float = super().convert(value, param, ctx)
        return number


@dataclass(frozen=True, slots=True)
class Keyed:
    """A file, and the key of the picture or pair of pictures that it belongs to."""

    key: str | None
    path: Path

    def __fspath__(self) -> str:
        return str(self.path)


class KeyedFile(click.Path):
    """``KEY=FILE``, the key being a number or a name; where it is optional, also ``FILE``."""

    name = "KEY=FILE"

    def __init__(self, needed: bool) -> None:
        super().__init__()
        self._needed = needed

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text; a folder before the key, which relative paths get in a batch, belongs to
        the file.
        """
        if isinstance(value, Keyed):
            return value
        before, sign, file = str(value).partition("=")
        if not self._needed and (not sign or Path(value).exists()):
            check_regular(Path(value))
            return Keyed(None, Path(value))
        if not sign or not file or not Path(before).name:
            self.fail(f"{value!r} does not say for which picture; write it like 0=mask.png", param, ctx)
        check_regular(Path(before).parent / file)
        return Keyed(Path(before).name, Path(before).parent / file)


class FileType(click.Path):
    """The name of a file, which is to be read or made."""

    def __init__(self, read: bool) -> None:
        super().__init__(path_type=Path, readable=False)  # its reader or writer reports more
        self._read = read

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse a text that names no file."""
        if not str(value) or "\0" in str(value):
            self.fail(f"{str(value)!r} is not the name of a file; write one", param, ctx)
        if self._read:
            check_regular(Path(value))
        return super().convert(value, param, ctx)


def check_inputs(files: Sequence[Path]) -> None:
    """Refuse files that cannot be read, of several that ``--skip-bad`` could leave out.

    Raises
    ------
    ImageError
    """
    try:
        for path in files:
            check_input(path)
    except ImageError as error:
        raise with_skip_bad(error, len(files)) from error


def with_skip_bad(error: ImageError, count: int) -> ImageError:
    """Point to ``--skip-bad`` in an error about one of `count` pictures, if enough would be left."""
    return error if count <= 2 else error.within("{error}; --skip-bad leaves out what cannot be read")


OptionsT = TypeVar("OptionsT")


def taken(kind: type[OptionsT], given: dict[str, Any]) -> OptionsT:
    """Take the options that belong together out of a command's parameters, as one frozen value.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are named like the command's parameters.
    given : dict
        The parameters that click passed to the command; those taken are removed.
    """
    names = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
    return kind(**{name: given.pop(name) for name in names})


def grouped(
    name: str, kind: type[Any], options: Sequence[Callable[[Any], Any]]
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds options to a command and passes them as one frozen value.

    Parameters
    ----------
    name : str
        The command's parameter.
    kind : type
        A dataclass whose fields are called as the options.
    options : sequence of click options
    """

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def call(**given: Any) -> Any:
            return command(**{name: taken(kind, given)}, **given)

        with_options: Callable[..., Any] = call
        for each in reversed(options):
            with_options = each(with_options)
        return with_options

    return decorate


#: Options that all commands share.
force_option = option("--force", heading="Output", is_flag=True, help="Replace existing files.")
quiet_option = option("-q", "--quiet", heading="Output", is_flag=True, help="Print nothing but errors.")
jobs_option = option(
    "-j",
    "--jobs",
    "processes",
    heading="Speed and memory",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="How many at a time.",
)

#: Millions of pixels; no machine has more than a million of them.
MEGAPIXELS = FiniteRange(min=0, max=1e6, min_open=True)

FILE = FileType(read=True)
#: A file that a command makes: ``toposeam batch`` has to know it from those it reads.
OUTPUT = FileType(read=False)


def is_output(parameter: click.Parameter) -> bool:
    """Test whether a parameter names a file that the command makes."""
    return parameter.type is OUTPUT


def is_input(parameter: click.Parameter) -> bool:
    """Test whether a parameter names files that the command reads."""
    return is_path(parameter) and not is_output(parameter)


def is_path(parameter: click.Parameter) -> bool:
    """Test whether a parameter names files."""
    return isinstance(parameter.type, click.Path)


def refuse_besides(option: str, allowed: Collection[str], reason: str) -> None:
    """Refuse options of the running command that have no effect beside another one.

    Parameters
    ----------
    option : str
        The other option, as it is written.
    allowed : collection of str
        Names of parameters that may stand beside it.
    reason : str
        Why others have no effect, for the error's text.

    Raises
    ------
    OptionError
    """
    context = click.get_current_context()
    for parameter in context.command.params:
        name = str(parameter.name)
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and name not in allowed and max(parameter.opts, key=len) != option:
            raise OptionError(
                f"{max(parameter.opts, key=len)} changes nothing with {option}, as {reason}; leave it out"
            )


#: Options for the position of two pictures and the cost of a seam between them.
PLACEMENT: tuple[Callable[[Any], Any], ...] = (
    option(
        "--offset",
        heading="Place",
        type=OffsetType(),
        help="Where B's upper left corner lies in A, in px; may be negative.",
    ),
    option(
        "--overlap",
        heading="Place",
        type=LengthType(),
        help="Instead of --offset: how far B overlaps A, in px or % of A.",
    ),
    option(
        "--side",
        heading="Place",
        type=click.Choice(ts.typing.SIDES),
        help="With --overlap: the side of A on which B continues; right by default.",
    ),
    option(
        "--avoid",
        heading="Seam",
        kept=True,
        type=FILE,
        help="Image of the canvas's size; no seam touches its white pixels. Or box:X,Y,W,H, ellipse:X,Y,W,H.",
    ),
    option(
        "--cost",
        "law",
        heading="Seam",
        kept=True,
        type=click.Choice(ts.typing.LAWS),
        help="What a seam avoids: what eyes notice (natural, the default), differences away from edges "
        "(gradient), differences of colour (colour).",
    ),
    option(
        "--core",
        heading="Seam",
        kept=True,
        type=FiniteRange(0, 1, min_open=True),
        help="For pictures inside others: the share of their depth, from the middle outwards, that must "
        "show; 0.5 inside a single one.",
    ),
    option(
        "--speck",
        heading="Seam",
        kept=True,
        type=click.IntRange(min=0),
        help="Pieces inside others may be hidden if they can show fewer px; 64, or 0.05 % of a picture.",
    ),
)


surface_cost_option = option(
    "--cost",
    "law",
    heading="Seam",
    type=click.Choice(ts.typing.LAWS),
    default="natural",
    show_default=True,
    help="What a surface avoids: what eyes notice (natural), differences of colour (colour), or "
    "those away from edges (gradient).",
)


def placement(megapixels: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds the options for the overlap, and ``--max-megapixels`` with its default."""
    limit = option(
        "--max-megapixels",
        heading="Speed and memory",
        type=MEGAPIXELS,
        default=megapixels,
        show_default=True,
        help="Refuse pictures that are larger, each or all together, and if given a canvas that is; else a "
        "canvas over 16 megapixels may have 16 times the pixels of its pictures.",
    )

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for each in reversed((*PLACEMENT, limit)):
            command = each(command)
        return command

    return decorate
