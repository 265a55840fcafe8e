"""The page of a pattern book."""

import re

from toposeam.motif.book import SEASONS
from toposeam.motif.kinds import Kind
from toposeam_cli.motifs.book.html import to_html


def test_the_table_counts_the_patterns_of_every_kind_and_season():
    page = to_html("Leaves", [], [])
    table = re.search(r"<thead>.*</tbody>", page, re.DOTALL)[0]
    rows = re.findall(r"<tr>(.*?)</tr>", table)
    assert [re.findall(r"<th>([^<]*)</th>", rows[0])[1:]] == [list(SEASONS)]
    assert [re.search(r'href="#(\w+)"', row)[1] for row in rows[1:]] == [str(kind) for kind in Kind]
    assert all(re.findall(r"<td>(\d+)</td>", row) == ["0"] * len(SEASONS) for row in rows[1:])


def test_seasons_without_patterns_have_no_heading():
    row = {"number": 4, "kind": str(next(iter(Kind))), "season": SEASONS[1], "repeat": "square", "p": 2.0}
    row |= {"mass": [0.2], "sources": [2], "sinks": [3], "iterations": 30, "base_strength": 0.5}
    row |= {"stroke": 0.1, "likeness": 0.7}
    page = to_html("Leaves", [row], [])
    assert re.findall(r"<h3>(.*?)</h3>", page) == [SEASONS[1]]
    assert re.findall(r'<figure id="(\w+)">', page) == ["n4"]
