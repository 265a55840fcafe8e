"""References are cited and listed alike."""

import re
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]
LISTED = re.findall(
    r"^@\w+\{(\w+),", (HERE / "docs/references.bib").read_text(encoding="utf-8"), re.MULTILINE
)
CITED = re.compile(r"\[((?:\w+\d{4})(?:; \w+\d{4})*)\]")


def test_every_reference_is_listed_once_and_cited():
    cited = set(CITED.findall((HERE / "docs/related.md").read_text(encoding="utf-8")))
    assert len(LISTED) == len(set(LISTED)) > 20
    assert set(LISTED) == cited


@pytest.mark.parametrize("field", ["author", "title", "year"])
def test_every_reference_has_its_fields(field):
    for line in (HERE / "docs/references.bib").read_text(encoding="utf-8").splitlines():
        assert re.search(rf"\b{field} = \{{", line), line[:60]


def test_the_paper_cites_what_is_listed():
    cited = set(re.findall(r"@(\w+\d{4})", (HERE / "paper/paper.md").read_text(encoding="utf-8")))
    assert cited <= set(LISTED)
    assert len(cited) > 10
