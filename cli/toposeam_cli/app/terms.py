"""The command line's names for the terms in core's errors: its options, and the names of files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from toposeam.errors import Term, TopoSeamError

#: Names a term, given the values of a command's parameters; None where the command has no name for it.
Called = Callable[[Term, Mapping[str, Any]], str | None]


def said(error: TopoSeamError) -> str:
    """Return the error's sentence with the running command's names for its terms."""
    context = click.get_current_context(silent=True)
    if context is None:
        return str(error)
    written = {
        name: value
        for name, value in context.params.items()
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE
    }
    parameters = {each.name: each for each in context.command.params if each.name is not None}
    table = _CALLED.get(context.command.name or "", {})
    # A parameter that was not written comes from elsewhere, such as a recipe, which has core's names.
    options = error.parameter is None or error.parameter in written

    def word(term: Term) -> str | None:
        if term.name in table:
            return table[term.name](term, context.params)
        parameter = parameters.get(term.name)
        if isinstance(parameter, click.Option):
            return _option(parameter, term) if options else None
        value = context.params.get(term.name)
        return value.name if isinstance(value, Path) else None

    return error.sentence(word)


def _option(option: click.Option, term: Term) -> str:
    """Return an option with its value, if the term has one."""
    if term.value is None:
        name = max(option.opts, key=len)
        return name if term.index is None else f"one of {name}"
    if not option.is_flag:
        return f"{max(option.opts, key=len)} {term.value}"
    return max(option.opts if term.value is True else option.secondary_opts or option.opts, key=len)


def _noun(noun: str) -> Called:
    return lambda term, given: noun


def _file(parameter: str) -> Called:
    def called(term: Term, given: Mapping[str, Any]) -> str | None:
        path = given.get(parameter)
        return path.name if isinstance(path, Path) else None

    return called


def _exemplar(term: Term, given: Mapping[str, Any]) -> str | None:
    """Return the file of the sample that an error is about; None if it does not say which of several."""
    sources = given["sources"]
    if term.index is None and len(sources) != 1:
        return None
    return str(sources[term.index or 0].name)


def _map(term: Term, given: Mapping[str, Any]) -> str | None:
    """Return the files of a further map, one for each source; ``--also`` if the error does not say which."""
    if term.index is None:
        return "--also"
    count = len(given.get("sources", ())) or 1
    files = given["also"][term.index * count : (term.index + 1) * count]
    return " or ".join(path.name for path in files) or None


def _normal(term: Term, given: Mapping[str, Any]) -> str | None:
    """Return the files of the normal map; None if it is one of a folder."""
    return " or ".join(path.name for path in given["normal"]) or None


_JOINED: Mapping[str, Called] = {
    "patch": _noun("picture"),
    "patches": _noun("pictures"),
}
_TEXTURE: Mapping[str, Called] = {"maps": _map, "normal": _normal, "exemplars": _noun("pictures")}
_OF_IMAGE: Mapping[str, Called] = {**_TEXTURE, "exemplar": _file("image")}

#: By command: names of the terms that are neither its options nor its arguments.
_CALLED: Mapping[str, Mapping[str, Called]] = {
    "stitch": _JOINED,
    "compare": _JOINED,
    "volume": {"patch": _noun("stack"), "patches": _noun("stacks"), "cells": _noun("--avoid")},
    "motif": {
        "rows": lambda term, given: "--sheet" if given["sheet"] else None,
        "columns": lambda term, given: "--sheet" if given["sheet"] else None,
    },
    "synth": {
        **_TEXTURE,
        "source": _exemplar,
        "exemplar": _exemplar,
        "source_mask": _noun("--from"),
        "mask": _noun("--from"),
    },
    "tile": {**_OF_IMAGE, "source": _file("image")},
    "fill": {**_OF_IMAGE, "mask": _file("mask")},
}
