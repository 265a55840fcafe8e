"""Which code drew the pictures of the documents: ``python docs/made.py SCRIPT…`` after a script has run.

``figures/made.json`` keeps, for each script, the commit at which it drew, what the code gave then, and the
digest of each picture. A test compares (tests/test_documents.py): when a script has changed, or the small
results of ``tests/golden.json`` that its pictures show, they are older than the code, and have to be drawn
again.
"""

from __future__ import annotations

import ast
import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
FIGURES = DOCS / "figures"
TABLE = FIGURES / "made.json"

#: Each script: the pictures it draws, the golden results they show (by how their names begin), and further
#: files they show.
SCRIPTS: dict[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    "make_figures.py": (
        ("fig-3.0*", "fig-3.1*", "fig-3.20*", "fig-3.21*", "fig-3.22*", "fig-3.23*", "hero.png"),
        ("seam",),
        ("docs/toy_figures.py", "docs/thesis_cases.py", "docs/photographs.py", "samples/still_life_left.png"),
    ),
    "compared_figures.py": (
        ("compared.jpg",),
        ("seam",),
        ("samples/still_life_left.png", "samples/still_life_right.png"),
    ),
    "panorama_figures.py": (
        ("panoramas-*",),
        ("seam",),
        ("docs/compared_figures.py", "samples/portrait_left.jpg", "samples/portrait_right.jpg"),
    ),
    "method_figures.py": (
        ("method-*", "heat-*", "tutorial-*"),
        ("seam", "texture", "motif"),
        (
            "docs/compared_figures.py",
            *(
                f"samples/{name}"
                for name in ("portrait_left.jpg", "portrait_right.jpg", "grass_a.png", "grass_b.png")
            ),
        ),
    ),
    "texture_figures.py": (
        ("fig-3.24*", "fig-3.25*", "fig-3.26*", "texture-*"),
        ("texture", "tile"),
        (),
    ),
    "motif_figures.py": (("motifs-*",), ("motif", "recipe"), ()),
    "style_figures.py": (("styles-*",), ("motif", "recipe"), ("core/toposeam/motif/recipe/styles.py",)),
    "make_pattern_figures.py": (("patterns-*", "paths-*"), ("motif", "recipe"), ()),
    "pattern_book.py": (
        ("book-*",),
        ("motif", "recipe"),
        ("docs/make_pattern_figures.py", "samples/leaf.png"),
    ),
    "pattern_studies.py": (
        ("studies-*",),
        ("motif", "recipe"),
        ("docs/pattern_cases.py", "docs/make_pattern_figures.py"),
    ),
    "volume_figures.py": (("loop-*", "surface-*", "volume-*"), (), ("samples/clips.py",)),
    "edit_figures.py": (
        ("edit-*",),
        (),
        ("samples/portrait_left.jpg", "samples/portrait_right.jpg"),
    ),
    "stitching_figures.py": (("stitching-*",), ("seam", "three layers"), ()),
    "picture_page.py": (
        ("page-*",),
        ("seam", "three layers", "texture", "tile", "motif"),
        ("docs/pictures.md",),
    ),
    "gimp_figures.py": (
        ("gimp-*",),
        ("seam", "texture", "tile", "motif"),
        ("plugin_gimp/toposeam_gimp/entries/table.py", "plugin_gimp/toposeam_gimp/texts.py"),
    ),
    "../benchmarks/seams.py": (("fig-3.27*",), (), ()),
    "results_figures.py": (("results-*",), (), ()),
}

#: Their pictures show times, which no result of the code can be held against: only the commit is told.
MEASURED = {"../benchmarks/seams.py", "results_figures.py"}


def fingerprint(script: str) -> str:
    """Of what the pictures of a script depend on: its code and the listed files' (comments and docstrings do
    not count), and the golden results.
    """
    if script in MEASURED:
        return "measured"
    _, shown, files = SCRIPTS[script]
    golden: dict[str, Any] = json.loads((ROOT / "tests/golden.json").read_text(encoding="utf-8"))
    hashed = hashlib.sha256()
    for path in (DOCS / script, *(ROOT / name for name in files)):
        hashed.update(_code(path))
    for name in sorted(golden):
        if name.startswith(shown):
            hashed.update(json.dumps([name, golden[name]]).encode())
    return hashed.hexdigest()[:16]


def _code(path: Path) -> bytes:
    if path.suffix != ".py":
        return path.read_bytes().replace(b"\r\n", b"\n")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(
            node, clean=False
        ):
            node.body = node.body[1:]
    return _dumped(tree).encode()


def _dumped(node: Any) -> str:
    """What ``ast.dump`` of Python 3.11 gives, whichever Python reads the code; later ones leave more out."""
    if isinstance(node, list):
        return f"[{', '.join(map(_dumped, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    fields = {name: getattr(node, name, None) for name in node._fields if name != "type_params"}
    kept = [f"{name}={_dumped(value)}" for name, value in fields.items() if not _left_out(node, name, value)]
    return f"{type(node).__name__}({', '.join(kept)})"


def _left_out(node: ast.AST, name: str, value: object) -> bool:
    return value is None and (not isinstance(node, ast.Constant) or name == "kind")


def pictures(script: str) -> dict[str, str]:
    """The pictures of a script and their digests."""
    found = sorted({path for pattern in SCRIPTS[script][0] for path in FIGURES.glob(pattern)})
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for path in found}


def record(scripts: list[str]) -> None:
    """Write down that these scripts have just drawn."""
    table = json.loads(TABLE.read_text(encoding="utf-8")) if TABLE.exists() else {}
    commit = subprocess.run(  # noqa: S603 - our own words
        ["git", "-C", ROOT, "rev-parse", "--short=12", "HEAD"],  # noqa: S607 - git is wherever the user has it
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    for script in scripts:
        table[script] = {"commit": commit, "code": fingerprint(script), "pictures": pictures(script)}
    TABLE.write_text(json.dumps(dict(sorted(table.items())), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    unknown = sorted(set(sys.argv[1:]) - set(SCRIPTS))
    if unknown or len(sys.argv) < 2:
        sys.exit(f"usage: python docs/made.py SCRIPT…, of {', '.join(SCRIPTS)}")
    record(sys.argv[1:])
