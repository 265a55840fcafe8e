"""Draw the picture of docs/styles.md: ``python docs/style_figures.py``, about two minutes.

Each style under five rules; the seeds are counted up, and nothing is chosen by hand.
"""

from __future__ import annotations

from itertools import count
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import toposeam as ts

FIGURES = Path(__file__).resolve().parent / "figures"
RULES = ("translate", "p4m", "pgg", "p6m", "rotate")
SIDE, GAP, FOOT = 230, 10, 22


def main() -> None:
    """Draw two sheets of eight styles."""
    font = ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"), 13)
    names, seeds = list(ts.motif.STYLES), count(1)
    for number in (1, 2):
        rows = names[8 * (number - 1) : 8 * number]
        width, height = len(RULES) * (SIDE + GAP) - GAP, len(rows) * (SIDE + FOOT)
        sheet = Image.new("RGB", (width, height), "white")
        pen = ImageDraw.Draw(sheet)
        for row, style in enumerate(rows):
            for column, rule in enumerate(RULES):
                seed, known = next(seeds), ts.motif.STYLES[style].rules
                chosen = rule if rule in known else known[column % len(known)]
                motif = ts.motif(160, style=style, repeat=chosen, seed=seed)
                x, y = column * (SIDE + GAP), row * (SIDE + FOOT)
                sheet.paste(pattern(motif), (x, y))
                pen.text((x, y + SIDE + 3), f"{style}, {chosen}, seed {seed}", font=font, fill="#78726a")
        sheet.save(FIGURES / f"styles-{number}.jpg", quality=80, optimize=True, progressive=True)


def pattern(motif: ts.motif.Motif) -> Image.Image:
    """Two motifs side by side, and as many below each other as fill a square."""
    rows, columns = motif.densities.shape[1:]
    side = SIDE // 2
    image = ts.repeat(motif, (2, 2), size=(round(side * rows / columns), side))[:SIDE]
    return Image.fromarray(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8))


if __name__ == "__main__":
    main()
