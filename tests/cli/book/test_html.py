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
