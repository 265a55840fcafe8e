"""Styles under every rule: pieces and holes too small to be meant, borders, and a sheet of what seeds draw.

    python benchmarks/styles.py [--size 96] [--seeds 1 2 3] [--styles vein cutout …] [--sheet drawn.png]

Each style is printed under each of the 22 rules with three seeds, 2 x 2 motifs. A piece of ink, or a hole, is
too small below a 1500th of the cell's area (wash has none). Borders are measured by
`ts.motif.border_visibility`, of every ink and of the composite. The time is that of the processor.
``--sheet`` draws the motifs of seeds 1 to 200 as ``toposeam motif`` does without options, ten a row.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from PIL import Image

import toposeam as ts
from stamp import stamp
from strokes import specks
from toposeam.motif.symmetry.tiling import period

#: Styles of strokes that are measured, and the largest speck as a share of the cell's area.
STYLES = ("vein", "cutout", "chain", "seed", "leaf", "folk", "pebble", "daisy")
SPECK = 1 / 1500


def measured(motif: ts.motif.Motif) -> tuple[int, int, list[float]]:
    """Return a motif's small pieces, small holes, and the visibility of borders of its inks and composite."""
    rows, columns = motif.densities.shape[1:]
    most = round(SPECK * rows * columns)
    layers = ts.motif.repeat_densities(motif, (2, 2))
    crisp = [layer for layer, edge in zip(layers, motif.edges, strict=True) if edge == "crisp"]
    pieces = sum(specks(layer > 0.5, most, 2) for layer in crisp)
    holes = sum(specks(layer <= 0.5, most, 1) for layer in crisp)
    counts = period(motif.repeat)
    planes = (*ts.motif.repeat_densities(motif, counts), ts.repeat(motif, counts))
    return pieces, holes, [ts.motif.border_visibility(plane, (rows, columns)) for plane in planes]


def sheet(path: str, size: int) -> None:
    """Draw a sheet of what the first 200 seeds draw."""
    side = 140
    canvas = Image.new("RGB", (10 * side, 20 * side), "white")
    for seed in range(1, 201):
        motif = ts.motif(size, style=None, repeat=None, seed=seed)
        shown = Image.fromarray(np.rint(255 * ts.repeat(motif, (2, 2))).astype(np.uint8))
        scale = (side - 4) / shown.width  # tiles of hexagonal rules are cut
        shown = shown.resize((side - 4, round(shown.height * scale)), Image.Resampling.LANCZOS)
        place = ((seed - 1) % 10 * side + 2, (seed - 1) // 10 * side + 2)
        canvas.paste(shown.crop((0, 0, side - 4, min(side - 4, shown.height))), place)
    canvas.save(path)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--styles", nargs="+", default=STYLES, choices=ts.motif.STYLES)
    parser.add_argument("--sheet", help="draw what 200 seeds draw, and measure nothing")
    given = parser.parse_args()
    if given.sheet:
        sheet(given.sheet, given.size)
        return
    print(f"{'':<10}{'motifs':>8}{'pieces':>8}{'holes':>8}{'worst border':>14}{'above 1':>12}{'s each':>8}")
    for style in given.styles:
        pieces = holes = 0
        borders: list[float] = []
        worst = (0.0, "", 0)
        started = time.process_time()
        rules = ts.motif.REPEATS[1:]
        for rule in rules:
            for seed in given.seeds:
                motif = ts.motif(given.size, style=style, repeat=rule, seed=seed)
                small, open_, shown = measured(motif)
                pieces, holes = pieces + small, holes + open_
                borders += shown
                worst = max(worst, (max(shown), rule, seed))
        many = len(rules) * len(given.seeds)
        each = (time.process_time() - started) / many
        above = f"{sum(one > 1 for one in borders)} of {len(borders)}"
        print(
            f"{style:<10}{many:>8}{pieces:>8}{holes:>8}{worst[0]:>14.2f}{above:>12}{each:>8.2f}"
            f"  {worst[1]} {worst[2]}",
            flush=True,
        )


if __name__ == "__main__":
    print(stamp())
    main()
