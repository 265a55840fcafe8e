"""The recipe inside a file: written with a motif, and read back to make it again.

Pictures carry it in an XMP packet, which PNG and TIFF hold and image editors keep; drawings in
``<metadata>``. It is JSON in both.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import tomllib
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import toposeam as ts
from toposeam.errors import ImageError, OptionError
from toposeam.vector.svg import read_metadata
from toposeam_cli.files.regular import check_input
from toposeam_cli.files.tables import read_table, read_text
from toposeam_cli.media.pictures.decode import RECIPE_NAMESPACE
from toposeam_cli.media.pictures.libvips import load_vips

if TYPE_CHECKING:
    from toposeam.motif import Recipe

_RECIPE = f"{{{RECIPE_NAMESPACE}}}recipe"
#: Largest page of motifs that is read, bytes: a page has at most 200 motifs.
_LARGEST_PAGE = 2**28
#: The element of an ``--explore`` page that holds its recipes.
_ON_PAGE = re.compile(r'<script type="application/json" id="recipes">(.*?)</script>', re.DOTALL)


def to_xmp(settings: Mapping[str, Any]) -> bytes:
    """Return an XMP packet with the settings as JSON."""
    text = escape(json.dumps(dict(settings), allow_nan=False), quote=False)
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        '<rdf:Description rdf:about="" '
        f'xmlns:toposeam="{RECIPE_NAMESPACE}"><toposeam:recipe>{text}</toposeam:recipe>'
        "</rdf:Description></rdf:RDF></x:xmpmeta>"
        '<?xpacket end="w"?>'
    ).encode()


def read_settings(path: Path, otherwise: str = "") -> dict[str, Any]:
    """Return the settings that TopoSeam wrote into a picture or a drawing. `otherwise` ends the error's
    sentence where there are none.

    Raises
    ------
    OptionError
        When there are none, or they are damaged.
    ImageError
        When the file cannot be read.
    """
    readers = {".svg": read_metadata, ".pdf": _from_pdf}
    settings = readers.get(path.suffix.lower(), _from_picture)(path)
    if settings is None or "recipe" not in settings:
        raise OptionError(
            f"'{path}' holds no recipe; give a motif that toposeam wrote and no editor stripped{otherwise}"
        )
    return settings


def read_recipe(path: Path) -> Recipe:
    """Return the recipe in a picture or a drawing; raises as :func:`read_settings`."""
    settings = read_settings(path)
    try:
        return ts.motif.Recipe.from_dict(settings["recipe"])
    except (OptionError, ValueError, TypeError) as error:
        raise OptionError(f"the recipe in '{path}' is damaged: {error}") from error


def _from_picture(path: Path) -> dict[str, Any] | None:
    check_input(path)
    vips = load_vips()
    try:
        image = vips.Image.new_from_source(vips.Source.new_from_file(os.fsencode(path)), "")
        packet = bytes(image.get("xmp-data")) if image.get_typeof("xmp-data") else b""
    except vips.Error as error:
        raise ImageError(
            f"'{path}' is not a picture that can be read; give a PNG, TIFF or SVG that toposeam wrote"
        ) from error
    return _from_packet(packet, path)


def _from_pdf(path: Path) -> dict[str, Any] | None:
    check_input(path)
    found = re.search(rb"<\?xpacket begin.*?<\?xpacket end[^>]*>", path.read_bytes(), re.DOTALL)
    return _from_packet(found[0] if found else b"", path)


def _from_packet(packet: bytes, path: Path) -> dict[str, Any] | None:
    """Return the settings in an XMP packet."""
    if not packet:
        return None
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import ParseError, fromstring

    try:
        text = next((element.text for element in fromstring(packet.strip(b"\x00 ")).iter(_RECIPE)), None)
        settings = None if text is None else json.loads(text)
    except (ParseError, DefusedXmlException, ValueError, RecursionError) as error:
        raise OptionError(
            f"the recipe in '{path}' is damaged; use a copy that no editor has changed"
        ) from error
    return settings if isinstance(settings, dict) else None


def read_toml(path: Path) -> dict[str, Any]:
    """Return the table in a TOML file.

    Raises
    ------
    OptionError
        When it cannot be read.
    """
    table, _ = read_table(path, "a file of parameters")
    if not isinstance(table, dict):
        raise OptionError(f"'{path}' is no table of parameters; write it in TOML")
    return table


def to_toml(recipe: Recipe) -> str:
    """Return a recipe as TOML, for people to edit."""
    record = recipe.to_dict()
    layers = record.pop("layers")
    lines = [f"{name} = {_value(value)}" for name, value in record.items()]
    for layer in layers:
        lines += ["", "[[layers]]", *(f"{name} = {_value(value)}" for name, value in layer.items())]
    return "\n".join([*lines, ""])


def _value(value: Any) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value)  # texts and booleans look the same in JSON and TOML
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


def recipe_from_table(table: Mapping[str, Any], path: Path) -> Recipe | None:
    """Return the whole recipe in a table of parameters, None if it holds options only."""
    if "layers" not in table or not isinstance(table["layers"], list):
        return None
    known = {field.name for field in dataclasses.fields(ts.motif.Recipe)}
    unknown = set(table) - known
    if unknown:
        raise OptionError(
            f"'{path}' has {min(unknown)!r} beside [[layers]]; with layers written out, use "
            f"{', '.join(sorted(known))}"
        )
    return ts.motif.Recipe.from_dict(table)


def recipe_on_page(path: Path, number: int | None) -> Recipe:
    """Return the recipe of a motif on an ``--explore`` page, by its number; a page of one motif needs none.

    Raises
    ------
    OptionError
    """
    found = _ON_PAGE.search(read_text(path, "a page of motifs", _LARGEST_PAGE))
    try:
        texts = json.loads(found[1]) if found else []
        if not texts:
            raise ValueError("no recipes in it")
        if number is None and len(texts) > 1:
            raise OptionError(f"'{path}' shows {len(texts)} motifs; say which with --number")
        if (number or 1) > len(texts):
            raise OptionError(f"'{path}' shows {len(texts)} motifs, so it has no number {number}")
        recipe = recipe_from_table(tomllib.loads(texts[(number or 1) - 1]), path)
    except OptionError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise OptionError(f"'{path}' is no page of --explore ({error}); make it again") from error
    if recipe is None:
        raise OptionError(f"'{path}' is no page of --explore; make it again")
    return recipe
