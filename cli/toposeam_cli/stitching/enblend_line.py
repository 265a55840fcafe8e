"""Translate the command line of enblend, as Hugin and scripts write it, into options of ``stitch``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from glob import escape, glob
from pathlib import Path

import toposeam as ts
from toposeam_cli.files.tables import read_text

#: The version that Hugin's preferences and scripts read.
VERSION = "enblend 4.2 (TopoSeam)"

#: Options that are translated, by their short and long names: the long name, and the value that is implied if
#: none is given, or None if one is required.
_TRANSLATED: dict[str, tuple[str, str | None]] = {
    "o": ("output", None),
    "f": ("frame", None),
    "l": ("levels", None),
    "w": ("wrap", "horizontal"),
    "compression": ("compression", None),
    "output": ("output", None),
    "levels": ("levels", None),
    "wrap": ("wrap", "horizontal"),
    "save-masks": ("save-masks", "mask-%n.tif"),
    "load-masks": ("load-masks", "mask-%n.tif"),
}
#: Options that do not affect the picture and are ignored.
_IGNORED_FLAGS = {"a", "x", "pre-assemble", "no-pre-assemble", "gpu", "no-gpu", "prefer-gpu"}
_IGNORED_OPTIONAL = {"v", "verbose"}
_IGNORED_VALUES = {"b", "m"}
#: Options without effect here, which are reported to the user.
_REPORTED_FLAGS = {"c", "g", "ciecam", "no-ciecam", "fine-mask", "optimize", "no-optimize"}
_REPORTED_OPTIONAL = {"coarse-mask", "visualize"}
_REPORTED_VALUES = {
    "d",
    "depth",
    "blend-colorspace",
    "fallback-profile",
    "layer-selector",
    "parameter",
    "primary-seam-generator",
    "image-difference",
    "smooth-difference",
    "optimizer-weights",
    "mask-vectorize",
    "anneal",
    "dijkstra",
}
_FLAGS, _OPTIONAL = _IGNORED_FLAGS | _REPORTED_FLAGS, _IGNORED_OPTIONAL | _REPORTED_OPTIONAL
_VALUES = _IGNORED_VALUES | _REPORTED_VALUES
_FRAME_SIZE = re.compile(r"(\d+)x(\d+)(?:([+-]\d+)([+-]\d+))?")


@dataclass(frozen=True, slots=True)
class CanvasFrame:
    """The rectangle of the plane that the result shows, px."""

    width: int
    height: int
    x: int = 0
    y: int = 0


def understood(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Translate the words of an enblend command line.

    Returns the words for ``stitch``, and the options without effect that the user may miss.

    Raises
    ------
    OptionError
        For options that enblend does not have either.

    Examples
    --------
    >>> understood(["-w", "-f8000x4000+0+0", "--compression=LZW", "-x", "-oout.tif", "a.tif"])
    (['--wrap=horizontal', '--frame=8000x4000+0+0', '--compression=LZW', '--output=out.tif', 'a.tif'], [])
    """
    options, files, ignored = [], [], []
    waiting = list(words)
    while waiting:
        word = waiting.pop(0)
        if word == "--":
            files += waiting
            break
        rest: str | None
        if word.startswith("--"):
            long, equals, after = word[2:].partition("=")
            names, rest = [long], after if equals else None
        elif word.startswith("-") and len(word) > 1:
            names, rest = _bundle(word[1:])
        else:
            files.append(word)
            continue
        for name in names:
            value = rest if name == names[-1] else None
            if name in ("h", "help", "V", "version"):
                options.append("--help" if name in ("h", "help") else "--version")
            elif name == "z":
                options.append("--compression=lzw")
            elif name in _TRANSLATED:
                ours, alone = _TRANSLATED[name]
                if value is None:
                    value = alone if alone is not None else _next(waiting, name)
                options.append(f"--{ours}={value}")
            elif name in _FLAGS | _OPTIONAL | _VALUES:
                if name in _VALUES and value is None:
                    _next(waiting, name)
                if name in _REPORTED_FLAGS | _REPORTED_OPTIONAL | _REPORTED_VALUES:
                    ignored.append(f"--{name}" if len(name) > 1 else f"-{name}")
            else:
                raise ts.OptionError(f"'{word}' is no option of enblend; correct or remove it")
    return [*options, *files], ignored


def _bundle(letters: str) -> tuple[list[str], str | None]:
    """Return the short options of one word, and the value of the last one, if that stands in it."""
    names: list[str] = []
    for index, letter in enumerate(letters):
        names.append(letter)
        rest = letters[index + 1 :]
        needs = letter in _VALUES or (letter in _TRANSLATED and _TRANSLATED[letter][1] is None)
        if rest and (needs or letter in _OPTIONAL or (letter == "w" and rest in _MODES)):
            return names, rest
        if needs:
            return names, None
    return names, None


_MODES = ("none", "horizontal", "vertical", "both")


def _next(waiting: list[str], name: str) -> str:
    if not waiting:
        raise ts.OptionError(f"-{'-' if len(name) > 1 else ''}{name} needs a value; add it, or leave it out")
    return waiting.pop(0)


def frame_of(text: str) -> CanvasFrame:
    """Return the frame of ``-f``: ``8000x4000+120+40``.

    Raises
    ------
    OptionError
    """
    found = _FRAME_SIZE.fullmatch(text.replace("+-", "-"))
    if found is None or int(found[1]) == 0 or int(found[2]) == 0:
        raise ts.OptionError(f"-f is {text!r}; write it like 8000x4000+0+0: width, height and offsets")
    return CanvasFrame(*(int(part or 0) for part in found.groups()))


def blend_width(levels: str) -> float | None:
    """Compute the blending width of `levels` levels, px; None for the default."""
    if levels.lower() in ("auto", "automatic"):
        return None
    try:
        number = int(levels)
    except ValueError:
        number = 0
    if not -29 <= number <= 29 or number == 0:
        raise ts.OptionError(f"-l is {levels!r}; give 1 to 29 levels, or auto")
    return None if number < 0 else float(min(2**number, 512))


def wrap_of(mode: str) -> bool:
    """Test whether the canvas wraps round.

    Raises
    ------
    OptionError
    """
    if mode.lower() not in _MODES[:2]:
        if mode.lower() in _MODES:
            raise ts.OptionError(
                f"--wrap={mode} goes round upwards, which TopoSeam does not; use --wrap=horizontal"
            )
        raise ts.OptionError(f"--wrap is {mode!r}; choose {', '.join(_MODES)}")
    return mode.lower() == "horizontal"


def compression_of(text: str) -> tuple[str, int | None]:
    """Return our compression of TIFF and quality of JPEG for a value of enblend's ``--compression``.

    Raises
    ------
    OptionError
    """
    name, _, level = text.lower().partition(":")
    if name in ("none", "lzw", "deflate"):
        return name, None
    number = level if name.startswith("jpeg") else name
    if name in ("packbits", "jpeg", "jpeg-arith") and not level:
        return "lzw", None
    if number.isdecimal() and int(number) <= 100:
        return "lzw", max(1, int(number))
    raise ts.OptionError(f"--compression is {text!r}; choose none, lzw, deflate, or 0 to 100 for JPEG")


def files_of(words: Sequence[str]) -> list[Path]:
    """Expand the list of files.

    ``@list`` stands for the files that a text file names, one a line; the names may have patterns, and are
    relative to the folder of the list.

    Raises
    ------
    OptionError
    """
    files: list[Path] = []
    for word in words:
        if not word.startswith("@"):
            files.append(Path(word))
            continue
        path = Path(word[1:])
        for line in read_text(path, "a list of pictures").splitlines():
            name = line.partition("#")[0].strip()
            if not name:
                continue
            if "\0" in name:
                raise ts.OptionError(f"'{path}' is no list of pictures: no name holds NUL; check the file")
            found = [path.parent / name]
            if re.search(r"[*?\[]", name):
                pattern = Path(escape(str(path.parent))) / name  # an absolute name replaces the folder
                found = [Path(one) for one in sorted(glob(str(pattern)))]  # noqa: PTH207
            if not found:
                raise ts.OptionError(f"'{path}' names '{name}', and there is no such file; correct it")
            files += found
    if not files:
        raise ts.OptionError(f"{' '.join(words)} names no pictures; name at least one")
    return files


def mask_name(template: str, index: int, source: Path, output: Path) -> Path:
    """Return the name of a mask: ``%n`` is the picture's number from 1, ``%i`` from 0, ``%p %d %b %f %e`` are
    path, folder, stem, name and extension of the picture, and in capitals of the output.

    Raises
    ------
    OptionError
    """

    def part(found: re.Match[str]) -> str:
        letter = found[1]
        if letter in "%ni":
            return {"%": "%", "n": str(index + 1), "i": str(index)}[letter]
        path = source if letter.islower() else output
        parts = {
            "p": str(path.with_suffix("")),
            "d": str(path.parent),
            "b": path.stem,
            "f": path.name,
            "e": path.suffix,
        }
        if letter.lower() not in parts:
            raise ts.OptionError(f"the masks' name has %{letter}; use %n, %i, %p, %d, %b, %f or %e")
        return parts[letter.lower()]

    return Path(re.sub(r"%(.)", part, template))
