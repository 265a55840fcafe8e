"""A pattern book as one static HTML page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from typing import Any

from toposeam.motif.kinds import CLEAR, THICK, Kind
from toposeam_cli.book_jobs import SEASONS

Row = dict[str, Any]

_STYLE = """
:root { color-scheme: light; --ink: #2b2926; --soft: #7b756c; --line: #e3ded5; --paper: #faf8f4; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 76rem; padding: 3rem 2rem 6rem; background: var(--paper); color: var(--ink);
  font: 15px/1.5 "Iowan Old Style", "Palatino Linotype", Palatino, Georgia, serif; }
h1 { font-size: 2.6rem; font-weight: 400; letter-spacing: .01em; margin: 0 0 .3rem; }
h2 { font-size: 1.5rem; font-weight: 400; margin: 3.5rem 0 .2rem; padding-top: 1rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; font-weight: 400; font-style: italic; color: var(--soft); margin: 1.6rem 0 .7rem; text-transform: capitalize; }
p { max-width: 42rem; color: var(--soft); margin: .3rem 0 1rem; }
table { border-collapse: collapse; margin: 1.2rem 0; } th, td { padding: .25rem 1.1rem .25rem 0; text-align: right; font-weight: 400; }
th:first-child { text-align: left; } thead th { color: var(--soft); font-style: italic; } tbody tr { border-top: 1px solid var(--line); }
.sheet { display: grid; grid-template-columns: repeat(auto-fill, minmax(10.5rem, 1fr)); gap: 1.4rem 1.1rem; }
.sheet figure { margin: 0; } figcaption { font-size: 11.5px; line-height: 1.4; color: var(--soft); margin-top: .4rem; }
figcaption b { color: var(--ink); font-weight: 600; } a { color: inherit; text-decoration: none; } a:hover { text-decoration: underline; }
.swatch { display: block; width: 100%; aspect-ratio: 1; background-size: 66.67%; border-radius: 2px;
  box-shadow: 0 1px 3px rgba(40, 30, 20, .22); }
.products { display: grid; grid-template-columns: repeat(4, 1fr); gap: 1rem; margin-top: 1.4rem; }
.products figure { margin: 0; background: #ebe7e0; } .products img { width: 100%; height: 17rem; object-fit: contain; display: block; }
.products figcaption { padding: .2rem .6rem .5rem; margin: 0; } nav a { margin-right: 1.2rem; }
@media (max-width: 50rem) { .products { grid-template-columns: repeat(2, 1fr); } }
@media print { body { padding: 0; } figure { break-inside: avoid; } }
"""


def to_html(title: str, rows: Sequence[Row], products: Sequence[tuple[Row, str, str]]) -> str:
    """The page; pictures are named relative to it.

    Parameters
    ----------
    title : str
    rows : sequence of mappings
        As :func:`toposeam_cli.book_jobs.draw_pattern` returns them.
    products : sequence of (row, product, path)
        The pattern on each mock-up.
    """
    count = Counter((row["kind"], row["season"]) for row in rows)
    lines = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}: pattern book</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
        f"<p>{len(rows)} patterns made by TopoSeam: heat finds its way from random sources to random sinks through the theme. The kinds are"
        f" measured: strokes are thick when their mean width exceeds {THICK:.0%} of the motif, and the theme shows when its brightness and"
        f" the motif's correlate by {CLEAR} or more.</p>",
        '<table><thead><tr><th></th>' + "".join(f"<th>{season}</th>" for season in SEASONS) + "</tr></thead><tbody>",
    ]  # fmt: skip
    for kind in Kind:
        cells = "".join(f"<td>{count[str(kind), season]}</td>" for season in SEASONS)
        lines.append(f'<tr><th><a href="#{kind}">{kind}: {kind.words}</a></th>{cells}</tr>')
    lines += ["</tbody></table>", '<div class="products">']
    for row, product, path in products:
        lines.append(
            f'<figure><a href="{escape(path)}"><img src="{escape(path)}" alt="{product} with pattern {row["number"]}" loading="lazy"></a>'
            f'<figcaption>{product}, {row["season"]}, <a href="#n{row["number"]}">no. {row["number"]}</a></figcaption></figure>'
        )
    lines.append("</div>")
    for kind in Kind:
        lines.append(f'<h2 id="{kind}">{kind}: {kind.words}</h2>')
        for season in SEASONS:
            found = [row for row in rows if (row["kind"], row["season"]) == (str(kind), season)]
            if found:
                lines += [f"<h3>{season}</h3>", '<div class="sheet">', *map(_card, found), "</div>"]
    lines.append(
        "<p>Every motif carries its recipe: <code>toposeam motif -o large.svg --like motifs/0001.png --sheet 4x4 --motif-width 8cm</code>"
        " prints it at any size, and <code>--vary 0.3</code> makes a relative.</p></body></html>"
    )
    return "\n".join([*lines, ""])


def _card(row: Row) -> str:
    number = row["number"]
    return (
        f'<figure id="n{number}"><a class="swatch" href="motifs/{number:04d}.png"'
        f' style="background-image:url(swatches/{number:04d}.png)" aria-label="pattern {number}"></a>'
        f"<figcaption><b>{number}</b> {caption(row)}</figcaption></figure>"
    )


def caption(row: Row) -> str:
    """The parameters of a pattern."""
    masses = " ".join(f"{mass:.2f}" for mass in row["mass"])
    spots = " ".join(f"{a}–{b}" for a, b in zip(row["sources"], row["sinks"], strict=True))
    return (
        f"{row['repeat']}, p {row['p']:g}, mass {masses}, sources–sinks {spots}, {row['iterations']} iterations,"
        f" base {row['base_strength']:+.2f}; stroke {row['stroke']:.1%}, likeness {row['likeness']:.2f}"
    )
