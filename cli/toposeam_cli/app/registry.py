"""The list of commands: a new one is a module in :mod:`toposeam_cli.commands` and a line here."""

from __future__ import annotations

import gc
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec
from types import ModuleType
from typing import Any, NamedTuple

import click

from toposeam.errors import TopoSeamError

#: Each command and its first line of help, equal to its own text: loading all commands to ask them takes a
#: second.
COMMANDS = {
    "stitch": "Join pictures where they overlap, along seams that nobody sees.",
    "edit": "Join pictures on a page in the browser, where seams follow the brush, or grow a motif.",
    "enblend": "Blend pictures that Hugin's nona has placed: in enblend's place, with its options.",
    "compare": "Find the seam between A and B with every method: cost, cost ÷ optimum, seconds.",
    "synth": "Grow a large texture from a small SOURCE, or from several.",
    "tile": "Make IMAGE repeat without a visible border, changing only a band along its borders.",
    "tileset": "Make tiles of two materials that fit each other, for maps of games.",
    "fill": "Replace part of IMAGE by what the rest of it is like.",
    "motif": "Invent a motif by leading heat from sources to sinks, one layer of ink at a time.",
    "repeat": "Lay a motif side by side, mirrored or turned where its rule says so.",
    "join": "Remake motifs so that they join each other, and lay them out.",
    "mockup": "Show MOTIF on a product, to scale.",
    "book": "Make a book of patterns round a theme: a logo, a symbol, a photograph.",
    "path": "Find a way over MAP by heat: easy where it is bright, blocked where it is black.",
    "volume": "Join stacks A, B and others along the surfaces that show least and cut the fewest cells.",
    "loop": "Make CLIP repeat without a visible jump.",
    "doctor": "Check what works here, and say what the rest needs.",
    "batch": "Run many jobs: those of a TOML file, or one for each set of pictures that patterns match.",
    "gimp": "Filters > TopoSeam in GIMP 3.",
}

#: No jobs of a batch: the command that runs others, the one that makes nothing, and the one that waits for
#: somebody at a browser.
NO_JOBS = ("batch", "doctor", "edit")

#: Commands that load their numerics after their options and files were checked (:func:`numerics_loading`).
LOADS_ITSELF = ("stitch",)

#: Settings of every command, also when it is used without the group: click keeps the first help option it has
#: made.
CONTEXT = {"help_option_names": ["-h", "--help"]}

#: Submodules of NumPy that we never use. SciPy names all that NumPy has (``scipy._lib.array_api_compat``) and
#: so loads its Fortran wrappers, its tests with :mod:`unittest` and its masked arrays. That is an eighth of
#: the time that a command's modules take to load.
UNUSED = ("numpy.ctypeslib", "numpy.f2py", "numpy.ma", "numpy.polynomial", "numpy.testing")


def load(name: str) -> click.Command:
    """Return the command of that name."""
    command: click.Command = getattr(_module(f"toposeam_cli.commands.{name}"), name)
    command.context_settings.update(CONTEXT)
    return speaking(command)


def _module(name: str) -> ModuleType:
    """Import the module of a command, sparingly if it is new."""
    if name in sys.modules or name.rpartition(".")[2] in LOADS_ITSELF:
        return import_module(name)
    with numerics_loading():
        return import_module(name)


@contextmanager
def numerics_loading() -> Iterator[None]:
    """Let what a block imports load in less time: without garbage collection meanwhile, as all that is loaded
    stays, without :data:`UNUSED`, and with SciPy's docstrings as they are written.

    Of each function SciPy parses the docstring as it loads, and adds which libraries of arrays it takes: a
    fifth of the time that numerics take to load, for what no command shows.
    """
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        loaded_later()
        sys.modules.setdefault(_DOCSTRINGS, _Docstrings(_DOCSTRINGS))
        yield
    finally:
        gc.freeze()
        gc.enable()


def speaking(command: click.Command) -> click.Command:
    """Return the command; its errors name parameters by its options, and files by their names."""
    callback = command.callback
    if callback is None or hasattr(callback, "speaks"):
        return command

    @wraps(callback)
    def call(*arguments: Any, **given: Any) -> Any:
        try:
            return callback(*arguments, **given)
        except TopoSeamError as error:
            from toposeam_cli.app.terms import said

            text = said(error)
            if text == str(error):
                raise
            raise type(error)(text) from error

    call.speaks = True  # type: ignore[attr-defined]
    command.callback = call
    return command


def loaded_later(names: tuple[str, ...] = UNUSED) -> None:
    """Let submodules load at the first access to one of their attributes, not when they are imported.

    Parameters
    ----------
    names : tuple of str
        Full names of the submodules; their packages are loaded. Modules that are loaded already or are
        missing stay as they are.
    """
    for name in names:
        spec = None if name in sys.modules else find_spec(name)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = sys.modules[name] = module_from_spec(spec)
        spec.loader.exec_module(module)
        package, _, own = name.rpartition(".")
        setattr(sys.modules[package], own, module)


#: SciPy's module that parses docstrings.
_DOCSTRINGS = "scipy._lib._docscrape"


class _Docstrings(ModuleType):
    """Stands for SciPy's module; what else it is asked for comes from that."""

    class FunctionDoc(defaultdict[str, list[Any]]):
        """A docstring as it is written; it takes parts for its sections, and shows none."""

        def __init__(self, function: Any) -> None:
            super().__init__(list)
            self._text = function.__doc__ or ""

        def __str__(self) -> str:
            return f"\n{self._text}"

    class Parameter(NamedTuple):
        """What is said of a parameter."""

        name: str
        type: str
        desc: list[str]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        del sys.modules[self.__name__]
        try:
            return getattr(import_module(self.__name__), name)
        finally:
            sys.modules[self.__name__] = self
