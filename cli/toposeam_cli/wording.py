"""What core says of arrays and arguments, in the words of the command line: the names of files, and options.

Core's sentences name its own parameters ("map 1", "patch b", "band is 1"), which a caller in Python has just
written. Who calls a command has written the names of files and options instead.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial, wraps
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from toposeam.errors import TopoSeamError
from toposeam.sentence import causes

#: What a match of a pattern becomes, from the values of the command's parameters; None leaves it.
Words = Callable[[re.Match[str], Mapping[str, Any]], str | None]


def speaking(command: click.Command) -> click.Command:
    """The command, its errors retold in its own words."""
    callback = command.callback
    if callback is None or hasattr(callback, "speaks"):
        return command

    @wraps(callback)
    def call(*arguments: Any, **given: Any) -> Any:
        try:
            return callback(*arguments, **given)
        except TopoSeamError as error:
            context = click.get_current_context(silent=True)
            said = _said_by_core(error)
            if context is None or not said:
                raise
            given = {
                name: value
                for name, value in context.params.items()
                if context.get_parameter_source(name) is ParameterSource.COMMANDLINE
            }
            text = str(error).replace(said, retold(said, command, given))
            raise type(error)(text) from error

    call.speaks = True  # type: ignore[attr-defined]
    command.callback = call
    return command


def retold(text: str, command: click.Command, given: Mapping[str, Any]) -> str:
    """A sentence of core as the command would say it.

    Parameters
    ----------
    text : str
    command : click.Command
    given : mapping
        The values of the parameters that were given.
    """
    for pattern, words in _SAID.get(command.name or "", ()):
        text = re.sub(pattern, partial(_put, words, given), text)
    known = {each.name: each for each in command.params if each.name is not None}

    def called(found: re.Match[str]) -> str:
        words = [word for word in found.groups() if word]
        if not any(word in given for word in words):  # it came from elsewhere, such as a recipe
            return found[0]
        return " and ".join(_called(known, word, given) for word in words)

    text = re.sub(
        r"^([a-z]\w*)(?: and ([a-z]\w*))?(?= (?:is|are|has|have|says?|span|belongs?)\b)", called, text
    )
    names = {name: parameter for name, parameter in known.items() if name in given}
    return re.sub(r"\b([a-z]\w*)=(?:'([^']*)'|([\w.]+))", lambda found: _option_and_value(names, found), text)


def _said_by_core(error: BaseException) -> str:
    """What of an error's text comes from core; the command line itself speaks its own words already."""
    for source in causes(error):
        if str(source) not in str(error):
            break
        trace = source.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        if trace is not None and str(trace.tb_frame.f_globals.get("__name__")).startswith("toposeam."):
            return str(source)
    return ""


def _put(words: Words, given: Mapping[str, Any], found: re.Match[str]) -> str:
    told = words(found, given)
    return found[0] if told is None else told


def _called(names: Mapping[str, click.Parameter], word: str, given: Mapping[str, Any]) -> str:
    """What a parameter of core is on the command line: an option, or the file that was given for it."""
    parameter = names.get(word)
    if isinstance(parameter, click.Option):
        return max(parameter.opts, key=len)
    value = given.get(word)
    return value.name if parameter is not None and isinstance(value, Path) else word


def _option_and_value(names: Mapping[str, click.Parameter], found: re.Match[str]) -> str:
    parameter = names.get(found[1])
    if not isinstance(parameter, click.Option):
        return found[0]
    value = found[2] if found[2] is not None else found[3]
    if not parameter.is_flag:
        return f"{max(parameter.opts, key=len)} {value}"
    return max(parameter.opts if value == "True" else parameter.secondary_opts or parameter.opts, key=len)


# Pictures that are joined.


def _picture(found: re.Match[str], given: Mapping[str, Any]) -> str | None:
    path = given.get({"a": "first", "b": "second"}[found[1]])
    return path.name if isinstance(path, Path) else None


_JOINED: tuple[tuple[str, Words], ...] = (
    (r"\bpatch ([ab])\b", _picture),
    (r"\bpatch(es)?\b", lambda found, given: "pictures" if found[1] else "picture"),
)


# Textures.


def _sources(given: Mapping[str, Any]) -> Sequence[Path]:
    given_sources = given.get("sources") or given.get("image")
    return (given_sources,) if isinstance(given_sources, Path) else tuple(given_sources or ())


def _map(found: re.Match[str], given: Mapping[str, Any]) -> str | None:
    """A further map's files, one for each source."""
    count = max(len(_sources(given)), 1)
    first = (int(found[1]) - 1) * count
    return " or ".join(path.name for path in given.get("also", ())[first : first + count]) or None


def _source(found: re.Match[str], given: Mapping[str, Any]) -> str | None:
    """The sample, or one of several: of several "the source" is whichever is largest."""
    sources = _sources(given)
    if found[1] is None and len(sources) != 1:
        return None
    index = int(found[1] or 1) - 1
    return sources[index].name if index < len(sources) else None


def _mask(found: re.Match[str], given: Mapping[str, Any]) -> str | None:
    mask = given.get("mask")
    return mask.name if isinstance(mask, Path) else None


_TEXTURES: tuple[tuple[str, Words], ...] = (
    (r"\bmap (\d+)\b", _map),
    (r"\bexemplars\b", lambda found, given: "pictures"),
    (r"^one of the (shares|weights)\b", lambda found, given: f"one of --{found[1]}"),
    (r"weights were given for the picture and", lambda found, given: "--weights for the picture and"),
)

#: By command: patterns, and what takes their place.
_SAID: Mapping[str, Sequence[tuple[str, Words]]] = {
    "stitch": _JOINED,
    "compare": _JOINED,
    "volume": (
        (r"(?<=\band )b(?= has\b)", lambda found, given: given["b"].name),
        (r"\bpatches\b", lambda found, given: "stacks"),
    ),
    "motif": ((r"^(?:rows|columns)\b", lambda found, given: "--sheet" if "sheet" in given else None),),
    "synth": (
        *_TEXTURES,
        (r"\b(?:the )?source(?: (\d+)(?! ×))?\b(?!s| of\b)", _source),
        (r"\b(?:its|the) mask\b", lambda found, given: "--from"),
    ),
    "tile": (
        *_TEXTURES,
        (r"^source\b", lambda found, given: given["image"].name),
        (r"(?<!\bone )(?<!\ban )\b(?:the )?image()\b", lambda found, given: given["image"].name),
    ),
    "fill": (
        *_TEXTURES,
        (r"(?<!\bone )(?<!\ban )\b(?:the )?image()\b", lambda found, given: given["image"].name),
        (r"\bthe source is\b", lambda found, given: f"{given['image'].name} is"),
        (r"\bthe mask\b", _mask),
    ),
}
