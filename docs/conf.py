"""The documentation site: ``make docs`` builds it from the Markdown there is and the docstrings (Sphinx).

The source folder is the checkout, so that links between documents, pictures and files are those that work in
it; what leads to a file that is no document becomes a download.
"""

from __future__ import annotations

import ast
import json
import posixpath
import re
import sys
from pathlib import Path
from typing import Any, ClassVar

from latex2mathml.converter import convert
from pygments.lexers.shell import BashLexer
from pygments.token import Name
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))

from command_reference import command_pages  # noqa: E402 - it lies beside this file
from toposeam import typing  # noqa: E402 - of the checkout

_MADE = json.loads((ROOT / "docs/figures/made.json").read_text(encoding="utf-8"))
_PUBLIC = ROOT / "core/toposeam"

project = "TopoSeam"
author = copyright = "The TopoSeam developers"  # noqa: A001 - Sphinx's name
version = release = re.search(
    r'__version__ = "([^"]+)"', (ROOT / "core/toposeam/__init__.py").read_text(encoding="utf-8")
)[1]
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
root_doc = "docs/index"
include_patterns = ["*.md", "docs/*.md", "docs/tutorials/*.md", "docs/reference/*.rst", "samples/README.md"]
exclude_patterns = [".*", "**/.*", "build", "demo", "dist", "tests", "plugin_gimp"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_enable_extensions = ["dollarmath", "attrs_inline", "colon_fence"]
myst_heading_anchors = 4
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_default_options = {"members": True, "member-order": "bysource"}
autosummary_generate = False
autodoc_typehints = "none"  # the docstrings say it with shapes and units
nitpicky = False
highlight_language = "none"  # tables in text blocks are no Python
html_theme = "furo"
html_title = f"TopoSeam {release}"
html_static_path = ["site"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_permalinks = False
suppress_warnings = ["ref.python"]  # a name that two classes share, like `cost`
copybutton_prompt_text = "$ "


class Commands(BashLexer):
    """Commands whose options are words of their own, which `site.css` keeps from being broken."""

    tokens: ClassVar[dict[str, list[Any]]] = {
        **BashLexer.tokens,
        "data": [(r"(?<!\S)--?[a-z][\w-]*", Name.Attribute), *BashLexer.tokens["data"]],
    }


def setup(app: Sphinx) -> None:
    """Formulas as MathML, which browsers draw by themselves; the reference from what the package offers."""
    app.add_lexer("sh", Commands)
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.connect("builder-inited", lambda app: write_reference(ROOT / "docs/reference"))
    app.connect("html-page-context", _finish)
    app.connect("build-finished", _front_door)


html_math_renderer = "mathml"


def _inline(self: Any, node: Any) -> None:
    self.body.append(convert(node.astext()))
    raise _skip()


def _block(self: Any, node: Any) -> None:
    text = node.astext().strip()
    self.body.append(f'<div class="formula">{convert(text, display="block")}</div>')
    raise _skip()


def _skip() -> Exception:
    from docutils.nodes import SkipNode

    return SkipNode()


def _finish(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """A click on a picture shows it in full, unless it leads elsewhere, and its title says what drew it; no
    dash where nothing follows; cells of much text are marked, which `site.css` gives room on a telephone.
    """
    if "body" not in context:
        return
    body = re.sub(r"\s–\s*(?=</p>)", "", context["body"])
    body = re.sub(r"<td>(?=(?:[^<]|<(?!/td)){80})", '<td class="long">', body)
    body = re.sub(r'<img (?=[^>]*src="[^"]*/([^"/]+)")', _with_title, body)
    parts = re.split(r"(<a [^>]*>.*?</a>)", body, flags=re.DOTALL)
    picture = re.compile(r'<img [^>]*src="([^"]+)"[^>]*>')
    parts[::2] = [picture.sub(r'<a class="picture" href="\1">\g<0></a>', part) for part in parts[::2]]
    context["body"] = "".join(parts)


def _with_title(found: re.Match[str]) -> str:
    """The beginning of an ``img`` whose picture is one of ``figures/made.json``."""
    for script, made in _MADE.items():
        if found[1] in made["pictures"]:
            return f'{found[0]}title="{posixpath.normpath(f"docs/{script}")} at commit {made["commit"]}" '
    return found[0]


def _front_door(app: Sphinx, error: Exception | None) -> None:
    """``index.html`` at the top leads to the first page."""
    if error is None and app.builder.format == "html":
        target = f"{root_doc}.html"
        (Path(app.outdir) / "index.html").write_text(
            f'<!doctype html><meta charset="utf-8"><title>TopoSeam</title>'
            f'<meta http-equiv="refresh" content="0; url={target}"><a href="{target}">TopoSeam</a>\n',
            encoding="utf-8",
        )


#: A page of the reference each: its name, its heading, and the rooms it holds.
PAGES = {
    "seams": ("Seams", ("seam", "optimize")),
    "layers": ("Stitching", ("layers",)),
    "textures": ("Textures", ("texture",)),
    "motifs": ("Motifs and patterns", ("motif",)),
    "paths": ("Ways", ("path",)),
    "volumes": ("Volumes", ("volume",)),
    "vectors": ("Lines and SVG", ("vector",)),
    "rest": ("Errors, images, display", ()),
}


#: Former names, which stay for a version, and the verbs that took their place.
FORMER = {
    "generate_motif": "motif",
    "join_volumes": "volume",
    "make_tileable": "tile",
    "plan_path": "path",
    "synthesize": "synth",
}


def offered() -> dict[str, str]:
    """Every public name as one writes it after ``toposeam.``, and the module that it comes from; former names
    are left out.
    """
    found = {}
    for stub in sorted([_PUBLIC / "__init__.pyi", *_PUBLIC.glob("*/__init__.pyi")]):
        room = ".".join(stub.parent.relative_to(_PUBLIC).parts)
        for node in ast.parse(stub.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                module = ".".join(filter(None, ("toposeam", room, node.module)))
                for alias in node.names:
                    name = alias.name if room else FORMER.get(alias.name, alias.name)
                    found[".".join(filter(None, (room, name)))] = module
    return found


#: Tables that are too long to be shown.
LONG = {"motif.STYLES"}

#: Figures that show what a function does.
PICTURED = {
    "fill": "texture-fill.jpg",
    "find_places": "compared.jpg",
    "find_seam": "hero.png",
    "find_surface": "surface-heat.png",
    "loop": "loop-strip.jpg",
    "motif": "motifs-seeds.jpg",
    "motif.join_motifs": "motifs-joined.jpg",
    "path": "paths-obstacles.png",
    "repeat": "patterns-rules.jpg",
    "solid.generate_solid": "studies-solids.jpg",
    "stitch": "stitching-coffee.jpg",
    "synth": "texture-maps.jpg",
    "texture.tile_set": "texture-tiles.jpg",
    "tile": "texture-tile.jpg",
    "volume": "volume-cells.png",
}


def write_reference(folder: Path) -> None:
    """A page for each name, and one for each room that lists them; pages that would be the same are left
    alone.
    """
    folder.mkdir(exist_ok=True)
    names, pages = offered(), {"index"}
    rooms = {room for _, kept in PAGES.values() for room in kept}
    for page, (title, kept) in PAGES.items():
        found = [
            (name, module)
            for name, module in sorted(
                names.items(), key=lambda pair: (pair[0].split(".")[-1][0].isupper(), "." in pair[0], pair)
            )
            if (room := module.split(".")[1]) in kept or (not kept and room not in rooms)
        ]
        listed = [name for name, _ in found if not name.split(".")[-1].isupper()]
        lines = [
            title,
            "=" * len(title),
            "",
            ".. currentmodule:: toposeam",
            "",
            ".. autosummary::",
            "   :nosignatures:",
            "",
        ]
        lines += [*(f"   {name}" for name in listed), "", ".. toctree::", "   :hidden:", ""]
        lines += [*(f"   {_page(name)}" for name in listed), ""]
        for name, module in found:
            if name.split(".")[-1].isupper():
                constant = name.split(".")[-1]
                room = "toposeam.typing" if hasattr(typing, constant) else module
                lines += [f".. autodata:: {room}.{constant}"]
                lines += ["   :no-value:", ""] if name in LONG else [""]
            else:
                _write(folder / f"{_page(name)}.rst", _described(name))
        _write(folder / f"{page}.rst", "\n".join(lines))
        pages |= {page, *map(_page, listed)}
    index = ["Reference", "=========", "", "What ``import toposeam as ts`` offers.", ""]
    index += [
        ".. toctree::",
        "   :maxdepth: 2",
        "   :includehidden:",
        "",
        *(f"   {page}" for page in PAGES),
        "",
    ]
    _write(folder / "index.rst", "\n".join(index))
    for page, text in command_pages().items():
        _write(folder / f"{page}.rst", text)
        pages.add(page)
    for old in folder.glob("*.rst"):
        if old.stem not in pages:
            old.unlink()


def _page(name: str) -> str:
    """The name of a page; classes and functions may differ by a capital alone."""
    return f"class.{name}" if name.split(".")[-1][0].isupper() else name


def _described(name: str) -> str:
    """The page of a class or a function."""
    title = f"ts.{name}"
    former = [old for old, verb in FORMER.items() if verb == name]
    kind = "autoclass" if name.split(".")[-1][0].isupper() else "autofunction"
    lines = [title, "=" * len(title), "", f".. {kind}:: toposeam.{name}", ""]
    if name in PICTURED:
        lines += [f".. image:: ../figures/{PICTURED[name]}", f"   :alt: what ts.{name} makes", ""]
    lines += [f"``ts.{old}`` is a former name of it, and stays for a version.\n" for old in former]
    return "\n".join(lines)


def _write(path: Path, text: str) -> None:
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
