"""A pattern book as one static HTML page: the template ``book.html``, filled in."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

from toposeam.motif.book import SEASONS
from toposeam.motif.kinds import CLEAR, THICK, Kind

Row = dict[str, Any]


def to_html(title: str, rows: Sequence[Row], products: Sequence[tuple[Row, str, str]]) -> str:
    """Return the page; pictures are named relative to it.

    Parameters
    ----------
    title : str
    rows : sequence of mappings
        As :func:`toposeam_cli.motifs.book.patterns.draw_pattern` returns them.
    products : sequence of (row, product, path)
        The row of the pattern, the product and the picture of each mock-up.
    """
    count = Counter((row["kind"], row["season"]) for row in rows)
    seasons = "".join(f"<th>{season}</th>" for season in SEASONS)
    table = [f"<thead><tr><th></th>{seasons}</tr></thead>", "<tbody>"]
    for kind in Kind:
        cells = "".join(f"<td>{count[str(kind), season]}</td>" for season in SEASONS)
        table.append(f'<tr><th><a href="#{kind}">{kind}: {kind.words}</a></th>{cells}</tr>')
    patterns = []
    for kind in Kind:
        patterns.append(f'<h2 id="{kind}">{kind}: {kind.words}</h2>')
        for season in SEASONS:
            found = [row for row in rows if (row["kind"], row["season"]) == (str(kind), season)]
            if found:
                patterns += [f"<h3>{season}</h3>", '<div class="sheet">', *map(_card, found), "</div>"]
    places = {
        "title": escape(title),
        "number": str(len(rows)),
        "thick": f"{THICK:.0%}",
        "clear": f"{CLEAR}",
        "table": "\n".join([*table, "</tbody>"]),
        "products": "\n".join(_product(*shown) for shown in products),
        "patterns": "\n".join(patterns),
    }
    page = files("toposeam_cli.motifs.book").joinpath("book.html").read_text("utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: places[place[1]], page)


def _product(row: Row, product: str, path: str) -> str:
    return (
        f'<figure><a href="{escape(path)}"><img src="{escape(path)}" alt="{product} with pattern '
        f'{row["number"]}" loading="lazy"></a><figcaption>{product}, {row["season"]}, <a '
        f'href="#n{row["number"]}">no. {row["number"]}</a>{beside(row)}</figcaption></figure>'
    )


def _card(row: Row) -> str:
    number = row["number"]
    return (
        f'<figure id="n{number}"><a class="swatch" href="motifs/{number:04d}.png"'
        f' style="background-image:url(swatches/{number:04d}.png)" aria-label="pattern {number}"></a>'
        f"<figcaption><b>{number}</b> {caption(row)}</figcaption></figure>"
    )


def beside(row: Row) -> str:
    """Return the number of a product's second pattern as an addition to the first's; an empty text for
    products with one.
    """
    return f" and {row['beside']}" if row.get("beside") else ""


def caption(row: Row) -> str:
    """Return the caption of a pattern: its parameters."""
    masses = " ".join(f"{mass:.2f}" for mass in row["mass"])
    spots = " ".join(f"{a}–{b}" for a, b in zip(row["sources"], row["sinks"], strict=True))
    theme = f"{row['theme']}, " if row.get("several") else ""
    return (
        f"{theme}{row['repeat']}, p {row['p']:g}, mass {masses}, sources–sinks {spots}, {row['iterations']} "
        f"iterations, base {row['base_strength']:+.2f}; stroke {row['stroke']:.1%}, likeness "
        f"{row['likeness']:.2f}"
    )
