"""The XML of an SVG document: bounded parsing that never loads anything, names and settings."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from toposeam.checks import check_kind
from toposeam.errors import PathError

#: Largest document that is read, bytes.
LARGEST_BYTES = 64 * 2**20
#: Most elements of a document that is read.
MOST_ELEMENTS = 200_000

#: The namespace of SVG.
NAMESPACE = "http://www.w3.org/2000/svg"
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


def document_of(source: str | bytes | os.PathLike[str]) -> str | bytes:
    """Read the text of a document, which is given itself or as the name of a file."""
    if isinstance(source, bytes) or (isinstance(source, str) and ("<" in source or not source.strip())):
        document: str | bytes = source
    else:
        check_kind("source", source, (str, os.PathLike), "the name of a file, or the document itself")
        try:
            with Path(source).open("rb") as file:
                document = file.read(LARGEST_BYTES + 1)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise PathError(
                "{file} cannot be read ({reason}); check the name of the SVG file",
                kind="unreadable",
                file=repr(os.fspath(source)[:200]),
                reason=reason,
            ) from error
    if len(document) > LARGEST_BYTES:
        raise PathError(
            "the SVG document is larger than {most} MiB; save the path alone, without embedded pictures",
            kind="large document",
            most=LARGEST_BYTES // 2**20,
        )
    if not document.strip():
        raise PathError("the SVG document is empty; export the path again", kind="empty document")
    if isinstance(document, bytes) and document.startswith(b"\x1f\x8b"):
        raise PathError("the SVG document is compressed (.svgz); save it as plain SVG", kind="not SVG")
    return document


def parse(document: str | bytes) -> Any:
    """Parse a document; returns its root element.

    Entities and internal DTDs are refused, and nothing outside the document is ever loaded.
    """
    from xml.etree.ElementTree import TreeBuilder

    from defusedxml import DefusedXmlException, DTDForbidden
    from defusedxml.ElementTree import DefusedXMLParser, ParseError

    class Tree(TreeBuilder):
        """A builder of the elements of a document, up to `MOST_ELEMENTS`."""

        count = 0

        def start(self, tag: str, attrs: dict[Any, Any], /) -> Any:
            self.count += 1
            if self.count > MOST_ELEMENTS:
                raise PathError(
                    "the SVG document has more than {most} elements; save the path alone",
                    kind="too complex",
                    most=MOST_ELEMENTS,
                )
            return super().start(tag, attrs)

    def refuse_declarations(name: str, system: str | None, public: str | None, has_declarations: int) -> None:
        # GIMP's export has a DOCTYPE that names the DTD of SVG, which is harmless, as it is never fetched.
        # Declarations in the document are not.
        if has_declarations:
            raise DTDForbidden(name, system, public)

    parser = DefusedXMLParser(target=Tree(), forbid_dtd=False, forbid_entities=True, forbid_external=True)
    parser.parser.StartDoctypeDeclHandler = refuse_declarations
    try:
        parser.feed(document)
        return parser.close()
    except PathError:
        raise
    except DefusedXmlException as error:
        raise PathError(
            "the document declares XML entities or DTD rules, which can be hostile; save the path as plain "
            "SVG",
            kind="hostile",
        ) from error
    except (ParseError, ValueError, LookupError) as error:
        raise PathError(
            "the document is not XML ({reason}); save or export the path as SVG",
            kind="not SVG",
            reason=str(error),
        ) from error


def tag_of(element: Any) -> str:
    """Return the element's name in SVG, "" for elements of other namespaces."""
    namespace, brace, name = str(element.tag).rpartition("}")
    return name if not brace or namespace == "{" + NAMESPACE else ""


def name_of(element: Any) -> str:
    """Return the element's title, else its Inkscape label, else its id, else ""."""
    titles = [child.text or "" for child in element if tag_of(child) == "title"]
    for name in (*titles, element.get(_LABEL), element.get("id")):
        if name and name.strip():
            return " ".join(name.split())
    return ""


def settings_of(root: Any) -> dict[str, Any] | None:
    """Find the first JSON object in any ``<metadata>``; editors add elements of their own around it."""
    waiting = [(root, False)]
    while waiting:
        element, inside = waiting.pop()
        inside = inside or tag_of(element) == "metadata"
        for text in (element.text, *(child.tail for child in element)) if inside else ():
            if text and text.lstrip().startswith("{"):
                try:
                    settings = json.loads(text)
                except (ValueError, RecursionError):
                    continue
                if isinstance(settings, dict):
                    return settings
        waiting += [(child, inside) for child in reversed(element)]
    return None
