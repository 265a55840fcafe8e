"""Numbers put into the documents by the scripts that measured them, between two marks:
``<!-- numbers: written by SCRIPT -->`` and ``<!-- end of numbers -->``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
_END = "<!-- end of numbers -->"


def write_table(page: str, script: str, rows: Sequence[Sequence[str]]) -> None:
    """Put rows of cells, the head first, between a script's marks on a page of the documents."""
    head, *others = ("| " + " | ".join(row) + " |" for row in rows)
    write_numbers(page, script, "\n".join([head, "|---" * len(rows[0]) + "|", *others]))


def write_numbers(page: str, script: str, numbers: str) -> None:
    """Put a text between a script's marks on a page of the documents."""
    path = DOCS / page
    begin = f"<!-- numbers: written by {script} -->"
    text = path.read_text(encoding="utf-8")
    before, found, rest = text.partition(begin)
    _, end, after = rest.partition(_END)
    if not found or not end:
        raise SystemExit(f"{path} has no place for the numbers of {script}")
    path.write_text(f"{before}{begin}\n{numbers}\n{_END}{after}", encoding="utf-8")
