"""The reference of the command line for the site: a page for each command, from what ``--help-all`` shows."""

from __future__ import annotations

import re
from collections.abc import Iterator

import click

from toposeam_cli.app.command import HeadedOption
from toposeam_cli.app.main import GROUPS, main
from toposeam_cli.app.registry import COMMANDS, load

#: These headings come after a command's own.
_LAST = ("Output", "Speed and memory", "Options")


def command_pages() -> dict[str, str]:
    """Return the pages in reStructuredText by their names, of which "commands" lists the others."""
    names = main.list_commands(click.Context(main))
    grouped = [name for group in GROUPS.values() for name in group]
    groups = {**GROUPS, "Tools": [name for name in names if name not in grouped]}
    pages = {}
    lines = [*_title("Command line"), "What ``toposeam COMMAND --help-all`` shows, to be searched.", ""]
    for heading, members in groups.items():
        lines += [*_title(heading, "-"), ".. list-table::", "   :widths: 20 80", ""]
        for name in members:
            command = main.commands.get(name) or load(name)
            summary = COMMANDS.get(name) or (command.help or "").split("\n\n")[0]
            lines += [f"   * - :doc:`{name} <command.{name}>`", f"     - {_escaped(summary)}"]
            pages[f"command.{name}"] = "\n".join(_page(command, f"toposeam {name}"))
        lines += [""]
    lines += [".. toctree::", "   :hidden:", "", *(f"   command.{name}" for name in names), ""]
    return {"commands": "\n".join(lines), **pages}


def _title(text: str, line: str = "=") -> list[str]:
    return [text, line * len(text), ""]


def _page(command: click.Command, called: str) -> Iterator[str]:
    """Yield the lines of a command's page, and of the commands it holds."""
    context = click.Context(command, info_name=called)
    yield from _title(called)
    yield from _described(command, context, called)
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            yield from _title(f"{called} {name}", "-")
            yield from _described(inner, click.Context(inner, info_name=name), f"{called} {name}")


def _described(command: click.Command, context: click.Context, called: str) -> Iterator[str]:
    words = " ".join([called, *command.collect_usage_pieces(context)])
    yield from (".. code-block:: text", "", f"   {words}", "")
    for paragraph in re.split(r"\n\s*\n", (command.help or "").strip()):
        lines = [line.strip() for line in paragraph.splitlines()]
        if lines[0] == "\b":
            yield from (".. code-block:: text", "", *(f"   {line}" for line in lines[1:]), "")
        else:
            yield from (_escaped(" ".join(lines)), "")
    sections: dict[str, list[click.Option]] = {}
    for each in command.params:
        if isinstance(each, click.Option) and not each.hidden:
            heading = each.heading if isinstance(each, HeadedOption) else "Options"
            sections.setdefault(heading, []).append(each)
    yield from (f".. program:: {called}", "")
    for heading in sorted(sections, key=lambda name: _LAST.index(name) if name in _LAST else -1):
        yield from (f".. rubric:: {heading}", "")
        for each in sections[heading]:
            record = each.get_help_record(context)
            if record is not None:
                yield from (f".. option:: {_signature(each, context)}", "", f"   {_escaped(record[1])}", "")


def _signature(each: click.Option, context: click.Context) -> str:
    """Return the names of an option, each with what it takes."""
    taken = "" if each.is_flag or each.count else f" {each.make_metavar(context)}"
    return ", ".join(f"{name}{taken}" for name in [*each.opts, *each.secondary_opts])


def _escaped(text: str) -> str:
    """Return plain text as reStructuredText, with options as code: two hyphens would become a dash."""
    parts = re.split(r"(?<![\w-])(--?[a-z][\w-]*)", " ".join(text.split()))
    parts[::2] = [re.sub(r"([\\*`|_])", r"\\\1", part) for part in parts[::2]]
    parts[1::2] = [f"\\ ``{part}``\\ " for part in parts[1::2]]
    return "".join(parts)
