"""GI-free: the manual as one page, made of the table of entries, in the user's language, without network."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path

from toposeam_gimp.entries.entry import Option, Procedure
from toposeam_gimp.texts import LANGUAGE, _

_STYLE = (
    "body{font:16px/1.5 sans-serif;max-width:44em;margin:2em auto;padding:0 1em;color:#222}h2{margin-top:2em}"
    "dt{font-weight:bold;margin-top:.6em}dd{margin-left:1.5em}code{color:#666;font-weight:normal}"
)


def write_help_page(entries: Iterable[Procedure], folder: Path) -> Path:
    """Write the page into a folder; return its path."""
    file = folder / f"toposeam-help-{LANGUAGE}.html"
    file.write_text(help_page(entries), encoding="utf-8")
    return file


def help_page(entries: Iterable[Procedure]) -> str:
    """Return an HTML document with a section per entry. Its id is the last part of the procedure's name."""
    sections = "".join(_section(entry) for entry in entries)
    return (
        f'<!DOCTYPE html><html lang="{LANGUAGE}"><head><meta charset="utf-8"><title>TopoSeam</title>'
        f"<style>{_STYLE}</style></head><body><h1>TopoSeam</h1>{sections}</body></html>"
    )


def _section(entry: Procedure) -> str:
    fields = "".join(_field(option) for option in entry.options)
    return (
        f'<h2 id="{entry.name.rpartition("-")[2]}">{escape(entry.title)}</h2><p>{escape(entry.blurb)}.</p>'
        f"<p>{escape(entry.help)}</p><dl>{fields}</dl>"
        f"<p>{escape(_('In scripts:'))} <code>{entry.name}</code></p>"
    )


def _field(option: Option) -> str:
    choices = escape(", ".join(label for _nick, label in option.choices))
    return (
        f"<dt>{escape(option.title)} <code>{option.name}</code></dt><dd>{escape(option.help)}."
        + (f" {choices}." if choices else "")
        + "</dd>"
    )
