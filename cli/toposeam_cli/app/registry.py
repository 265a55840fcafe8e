"""The list of commands: a new one is a module in :mod:`toposeam_cli.commands` and a line here."""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from types import ModuleType

import click

from toposeam_cli.app.lazy_modules import loaded_later
from toposeam_cli.app.terms import speaking

#: Each command and its first line of help, as its own text has it: loading the commands loads the numerics,
#: which takes a second.
COMMANDS = {
    "stitch": "Join pictures where they overlap, along seams that nobody sees.",
    "enblend": "Blend pictures that Hugin's nona has placed: in enblend's place, with its options.",
    "compare": "Find the seam between A and B with every method: cost, cost ÷ optimum, seconds.",
    "synth": "Grow a large texture from a small SOURCE, or from several.",
    "tile": "Make IMAGE repeat without a visible border, changing only a band along its borders.",
    "fill": "Replace part of IMAGE by what the rest of it is like.",
    "motif": "Invent a motif by leading heat from sources to sinks, one layer of ink at a time.",
    "repeat": "Lay a motif side by side, mirrored or turned where its rule says so.",
    "join": "Make motifs again so that they join each other, and lay them out.",
    "mockup": "Show MOTIF on a product, to scale.",
    "book": "Make a book of patterns round a theme: a logo, a symbol, a photograph.",
    "path": "Find a way over MAP by heat: easy where it is bright, none where it is black.",
    "volume": "Join stacks A and B along the surface that shows least.",
    "loop": "Make CLIP repeat without a visible jump.",
    "batch": "Run many jobs: those of a TOML file, or one for each set of pictures that patterns match.",
    "gimp": "Filters > TopoSeam in GIMP 3.",
}


#: Of every command, also when it is used without the group: click keeps the first help option it has made.
CONTEXT = {"help_option_names": ["-h", "--help"]}


def load(name: str) -> click.Command:
    """Return the command of that name."""
    command: click.Command = getattr(_module(f"toposeam_cli.commands.{name}"), name)
    command.context_settings.update(CONTEXT)
    return speaking(command)


def _module(name: str) -> ModuleType:
    """Return a module, imported without looking for garbage meanwhile: what is being loaded stays."""
    if name in sys.modules or not gc.isenabled():
        return import_module(name)
    gc.disable()
    try:
        loaded_later()
        return import_module(name)
    finally:
        gc.freeze()
        gc.enable()
