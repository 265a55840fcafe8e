"""Entries of a batch, from a TOML file or from patterns on the command line. Each holds the settings of one
or several runs of a command.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from toposeam.errors import OptionError
from toposeam_cli.app.options import is_input, is_path
from toposeam_cli.files.tables import read_table

#: Placeholder for the text that the wildcards of the patterns match.
NAME = "{name}"
#: Key of an entry that is no option of its command: the files that the command takes as arguments, in one
#: list.
_PICTURES = "pictures"
#: Regular expression of each wildcard. Brackets stand for themselves, as they are common in names of
#: pictures.
_MEANINGS = {"**/": "(.*/|)", "**": "(.*)", "*": "([^/]*)", "?": "([^/])"}
_WILDCARD = re.compile("|".join(map(re.escape, _MEANINGS)))


@dataclass(frozen=True, slots=True)
class Entry:
    """The settings of one run of a command, or, with patterns among them, of several."""

    command: click.Command
    #: Texts, numbers, booleans or lists of them, by the names of :func:`setting_names`.
    settings: Mapping[str, Any]
    #: Folder to which paths are relative.
    folder: Path
    #: Place of the entry in its file, for messages; "" for the command line.
    where: str = ""

    def refuse(self, reason: str) -> OptionError:
        """Return an error that says where."""
        return OptionError(f"{self.where}: {reason}" if self.where else reason)


def read_entries(path: Path, commands: Mapping[str, click.Command]) -> list[Entry]:
    """Read the entries of a file like this; relative paths begin at its folder::

        [defaults]               # for every entry whose command knows the option
        overlap = "25%"

        [[stitch]]
        pictures = ["left.png", "right.png"]
        output = "joined.png"

    Raises
    ------
    OptionError
        With the line, where there is one.
    """
    table, text = read_table(path, "a file of jobs")
    if not isinstance(table, dict):
        raise OptionError(f"'{path}' is no table of jobs; write it in TOML")
    lines = _Lines(path, text)
    defaults = table.pop("defaults", {})
    if not isinstance(defaults, dict):
        raise OptionError(
            f"{lines.of_key('defaults')}: defaults is no table; write [defaults] and the options below it"
        )
    entries = []
    for name, tables in table.items():
        if name not in commands:
            known = ", ".join(f"[[{known}]]" for known in commands)
            raise OptionError(
                f"{lines.of_key(name)}: {name!r} is nothing to be done in a batch; use {known}, or [defaults]"
            )
        if not isinstance(tables, list) or not all(isinstance(settings, dict) for settings in tables):
            raise OptionError(
                f"{lines.of_key(name)}: write [[{name}]], in double brackets, and the options below it"
            )
        known_here = setting_names(commands[name])
        for index, settings in enumerate(tables):
            entry = Entry(commands[name], {}, path.parent, lines.of_entry(name, index))
            named = {"name": settings["name"]} if "name" in settings and "name" not in known_here else {}
            own = _by_parameter(entry, {key: value for key, value in settings.items() if key not in named})
            general = _by_parameter(
                entry,
                {
                    key: value
                    for key, value in defaults.items()
                    if _plain(key) in known_here and _is_meant(commands, table, name, key, value)
                },
            )
            entries.append(replace(entry, settings=general | own | named))
    if not entries:
        raise OptionError(f"'{path}' asks for nothing; add an entry, such as [[{next(iter(commands))}]]")
    for key in defaults:
        if not any(_plain(key) in setting_names(commands[name]) for name in table):
            raise OptionError(
                f"{lines.of_key(key)}: no command of this file has the option {key!r}; correct it or leave "
                "it out"
            )
    return entries


def _is_meant(
    commands: Mapping[str, click.Command], table: Mapping[str, Any], name: str, key: str, value: object
) -> bool:
    """Test whether a default applies to a command that has the option. It does not if it is none of the
    option's choices and another command of the file accepts it.
    """

    def takes(other: str) -> bool:
        parameter = setting_names(commands[other]).get(_plain(key))
        if parameter is None or not isinstance(parameter.type, click.Choice):
            return parameter is not None
        return value in parameter.type.choices

    return takes(name) or not any(takes(other) for other in table)


def parse_patterns(command: click.Command, words: Sequence[str], folder: Path) -> Entry:
    """Parse the words of a command, which hold patterns, as an entry.

    Raises
    ------
    OptionError
        If there is no pattern.
    click.UsageError
        If they are not words of that command.
    """
    context = click.Context(
        command,
        parent=click.get_current_context(silent=True),
        info_name=command.name,
        **command.context_settings,
    )
    try:
        settings, rest, _ = command.make_parser(context).parse_args(list(words))
    except click.UsageError as error:
        raise click.UsageError(error.format_message()) from error  # of `batch`: its usage is to be shown
    if rest:
        raise click.UsageError(
            f"too many words: {' '.join(rest)}; put patterns in quotes, so that the shell leaves them alone"
        )
    settings = {
        name: value for name, value in settings.items() if isinstance(value, str | bool | tuple | list)
    }
    entry = Entry(command, settings, folder)
    if not any(_has_wildcard(text, folder) for _, text in _input_texts(entry)):
        raise OptionError(
            "none of the inputs is a pattern; put patterns in quotes, like 'left_*.png', so that the shell "
            "leaves them alone, or give a file of jobs that ends in .toml"
        )
    return entry


def expand(entry: Entry) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the settings of each run, and the text that the wildcards match in it, without an extension; ""
    without wildcards.

    Inputs whose wildcards match the same text belong together. The run itself reports an input that is
    missing.

    Raises
    ------
    OptionError
        If nothing matches.
    """
    patterns = {
        text: _matches(text, entry.folder)
        for _, text in _input_texts(entry)
        if _has_wildcard(text, entry.folder)
    }
    if not patterns:
        yield dict(entry.settings), ""
        return
    for pattern, matches in patterns.items():
        if not matches:
            raise entry.refuse(
                f"no file matches {pattern!r}; check its folder and spelling, and your right to look into it"
            )
    counts = {pattern: len(_WILDCARD.findall(pattern)) for pattern in patterns}
    if len(set(counts.values())) > 1:
        raise entry.refuse(
            f"the patterns {', '.join(map(repr, patterns))} have different numbers of wildcards; give them "
            "equally many"
        )
    for found in sorted({found for matches in patterns.values() for found in matches}):
        name = "-".join(part.rstrip("/") for part in found if part)
        if any(pattern.endswith("*") for pattern in patterns):
            name = name.removesuffix(Path(found[-1]).suffix)
        paths = {
            pattern: matches.get(found) or _filled(pattern, found) for pattern, matches in patterns.items()
        }
        yield {key: _substituted(value, paths, name) for key, value in entry.settings.items()}, name


def setting_names(command: click.Command) -> dict[str, click.Parameter]:
    """Return the options and arguments of a command, by every name a setting may have: long options without
    dashes, underscores for hyphens.
    """
    names = {}
    for parameter in command.params:
        if parameter.name is not None:
            names[parameter.name] = parameter
        names |= {
            _plain(option.lstrip("-")): parameter for option in parameter.opts if option.startswith("--")
        }
    return names


def to_words(entry: Entry, settings: Mapping[str, Any]) -> list[str]:
    """Return the settings as words of the command line, with absolute paths."""
    options: list[str] = []
    arguments: list[str] = []
    for parameter in entry.command.params:
        value = settings.get(str(parameter.name))
        if value is None:
            continue
        if isinstance(parameter, click.Option) and parameter.is_flag:
            options += _flag(entry, parameter, value)
            continue
        if value is False:  # overrides a default
            continue
        texts = _texts(entry, parameter, value)
        if is_path(parameter):
            if not all(texts) or any("\0" in text for text in texts):
                raise entry.refuse(f"{parameter.name} is {value!r}, which names no file; write one")
            texts = [str(entry.folder.absolute() / text) for text in texts]
        if isinstance(parameter, click.Argument):
            arguments += texts
        elif parameter.multiple:
            options += [f"{parameter.opts[0]}={text}" for text in texts]
        elif parameter.nargs != 1:
            options += [_long(parameter), *texts]
        else:
            options.append(f"{_long(parameter)}={texts[0]}")
    return [*options, "--", *arguments] if arguments else options


def _flag(entry: Entry, parameter: click.Option, value: Any) -> list[str]:
    if not isinstance(value, bool):
        raise entry.refuse(f"{_long(parameter).lstrip('-')} is {value!r}; write true or false")
    if value:
        return [_long(parameter)]
    return parameter.secondary_opts[:1]


def _texts(entry: Entry, parameter: click.Parameter, value: Any) -> list[str]:
    """Return a setting's value as texts for the command line."""
    values = list(value) if isinstance(value, list | tuple) else [value]
    several = parameter.nargs != 1 or (isinstance(parameter, click.Option) and parameter.multiple)
    if several and values and all(isinstance(item, list) for item in values):  # at = [[0, 0], [900, 10]]
        return [",".join(_plain_texts(entry, parameter, item)) for item in values]
    texts = _plain_texts(entry, parameter, values)
    return texts if several else [",".join(texts)]


def _plain_texts(entry: Entry, parameter: click.Parameter, values: Sequence[Any]) -> list[str]:
    if not values or not all(
        isinstance(item, str | int | float) and not isinstance(item, bool) for item in values
    ):
        raise entry.refuse(f"{parameter.name} is {values!r}; write a text or a number, or a list of them")
    return [item if isinstance(item, str) else repr(item) for item in values]


def _long(parameter: click.Parameter) -> str:
    return max(parameter.opts, key=len)


def _plain(key: str) -> str:
    return key.replace("-", "_")


def _by_parameter(entry: Entry, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings under the names of the command's parameters."""
    names = setting_names(entry.command)
    renamed: dict[str, Any] = {}
    settings = dict(settings)
    if _PICTURES in settings and _PICTURES not in names:
        renamed = _spread(entry, settings.pop(_PICTURES))
    for key, value in settings.items():
        if _plain(key) not in names:
            arguments = {
                str(parameter.name) for parameter in names.values() if isinstance(parameter, click.Argument)
            }
            known = {_shown(parameter) for parameter in names.values()} - {"help"} - arguments | (
                {_PICTURES} if arguments else set()
            )
            raise entry.refuse(
                f"{entry.command.name} has no option {key!r}; correct it to one of {', '.join(sorted(known))}"
            )
        parameter = str(names[_plain(key)].name)
        if parameter in renamed:
            raise entry.refuse(f"{key!r} is given twice; give it once")
        renamed[parameter] = value
    return renamed


def _spread(entry: Entry, pictures: Any) -> dict[str, Any]:
    """Return the pictures of an entry as the arguments of its command, in their order."""
    if not isinstance(pictures, list):
        raise entry.refuse(f"{_PICTURES} is {pictures!r}; write a list of files")
    rest, spread = list(pictures), {}
    for parameter in entry.command.params:
        if isinstance(parameter, click.Argument) and rest:
            count = len(rest) if parameter.nargs < 0 else parameter.nargs
            spread[str(parameter.name)] = rest[:count] if parameter.nargs != 1 else rest[0]
            rest = rest[count:]
    if rest:
        raise entry.refuse(
            f"{entry.command.name} takes no {len(pictures)} pictures; leave {', '.join(map(str, rest))} out"
        )
    return spread


def _shown(parameter: click.Parameter) -> str:
    return (
        str(parameter.name)
        if isinstance(parameter, click.Argument)
        else max(parameter.opts, key=len).lstrip("-")
    )


def _input_texts(entry: Entry) -> Iterator[tuple[click.Parameter, str]]:
    for parameter in entry.command.params:
        value = entry.settings.get(str(parameter.name))
        if is_input(parameter) and value is not None:
            for text in value if isinstance(value, list | tuple) else [value]:
                if isinstance(text, str):
                    yield parameter, text


def _has_wildcard(text: str, folder: Path) -> bool:
    return _WILDCARD.search(text) is not None and not os.path.lexists(folder / text)


def _matches(pattern: str, folder: Path) -> dict[tuple[str, ...], str]:
    """Return the files that a pattern matches, by the texts that its wildcards match."""
    expression, end = "", 0
    for wildcard in _WILDCARD.finditer(pattern):
        expression += re.escape(pattern[end : wildcard.start()])
        expression += _MEANINGS[wildcard[0]]
        end = wildcard.end()
    whole = re.compile(expression + re.escape(pattern[end:]), re.DOTALL)
    found = {}
    for text in sorted(glob.glob(pattern.replace("[", "[[]"), root_dir=folder, recursive=True)):  # noqa: PTH207 - Path.glob takes no absolute patterns
        match = whole.fullmatch(text.replace(os.sep, "/"))
        if match is not None and (folder / text).is_file():
            found[match.groups()] = text
    return found


def _filled(pattern: str, found: Sequence[str]) -> str:
    """Return the name that a pattern would match, with its wildcards replaced by these texts."""
    texts = iter(found)
    return _WILDCARD.sub(lambda _: next(texts), pattern)


def _substituted(value: Any, paths: Mapping[str, str], name: str) -> Any:
    if isinstance(value, list | tuple):
        return [_substituted(item, paths, name) for item in value]
    return paths.get(value, value.replace(NAME, name)) if isinstance(value, str) else value


class _Lines:
    """Line numbers in a TOML file, which the parser does not report."""

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._lines = path, text.splitlines()
        #: The lines where tables of a name begin, by the name.
        self._entries: dict[str, list[int]] = {}

    def of_key(self, key: str) -> str:
        """Name the line where a key is given, or where a table of that name begins."""
        expression = re.compile(rf"""\s*(\[\[?\s*)?["']?{re.escape(key)}["']?\s*(\]|=|\.)""")
        return self._where(
            [number for number, line in enumerate(self._lines, start=1) if expression.match(line)]
        )

    def of_entry(self, name: str, index: int) -> str:
        """Name the line where the table of that number begins."""
        if name not in self._entries:
            expression = re.compile(rf"""\s*\[\[\s*["']?{re.escape(name)}["']?\s*\]\]""")
            self._entries[name] = [
                number for number, line in enumerate(self._lines, start=1) if expression.match(line)
            ]
        if index < len(self._entries[name]):
            return self._where(self._entries[name][index : index + 1])
        return f"'{self._path}', entry {index + 1} of {name}"

    def _where(self, numbers: Sequence[int]) -> str:
        return f"'{self._path}', line {numbers[0]}" if numbers else f"'{self._path}'"
