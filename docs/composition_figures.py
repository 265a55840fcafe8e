"""Draw the pictures of docs/composition.md: ``python docs/composition_figures.py``, about a minute."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import toposeam as ts
from toposeam.motif.ink.mixing import mix

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS / "figures"
FONTS = Path(mpl.get_data_path()) / "fonts/ttf"
SIDE, GAP, FOOT = 300, 12, 24
SIZE = 192


def letter(text: str) -> np.ndarray:
    """Return a dark letter on white."""
    image = Image.new("L", (400, 400), 255)
    font = ImageFont.truetype(str(FONTS / "DejaVuSerif-Bold.ttf"), 430)
    ImageDraw.Draw(image).text((200, 205), text, fill=0, font=font, anchor="mm")
    return np.asarray(image)


def spiral() -> np.ndarray:
    """Return a dark spiral on white."""
    image = Image.new("L", (400, 400), 255)
    turn = np.linspace(0.6, 4.6 * np.pi, 300)
    points = [(200 + 11 * t * np.cos(t), 200 + 11 * t * np.sin(t)) for t in turn]
    ImageDraw.Draw(image).line(points, fill=0, width=5, joint="curve")
    return np.asarray(image)


#: Two wavy lines and three dots, as an editor would save them.
POINTS = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
    '<path d="M0,30 C30,10 60,50 100,30" fill="none" stroke="black"/>'
    '<circle cx="20" cy="75" r="2"/><circle cx="50" cy="80" r="2"/><circle cx="80" cy="75" r="2"/></svg>'
)


def pattern(motif: ts.motif.Motif, counts: tuple[int, int] = (2, 2)) -> Image.Image:
    """Return motifs as a square picture."""
    rows, columns = motif.densities.shape[1:]
    across = SIDE // counts[1]
    image = ts.repeat(motif, counts, size=(round(across * rows / columns), across))[:SIDE]
    return picture(image)


def picture(image: np.ndarray) -> Image.Image:
    """Return an array as a picture."""
    return Image.fromarray(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8))


def sheet(name: str, panels: Sequence[tuple[str, Image.Image]], across: int) -> None:
    """Write named panels in rows."""
    font = ImageFont.truetype(str(FONTS / "DejaVuSans.ttf"), 13)
    rows = -(-len(panels) // across)
    page = Image.new("RGB", (across * (SIDE + GAP) - GAP, rows * (SIDE + FOOT + GAP) - GAP), "white")
    pen = ImageDraw.Draw(page)
    for index, (words, panel) in enumerate(panels):
        x, y = index % across * (SIDE + GAP), index // across * (SIDE + FOOT + GAP)
        page.paste(panel, (x, y))
        pen.text((x, y + SIDE + 4), words, font=font, fill="#78726a")
    page.save(FIGURES / name, quality=82, optimize=True, progressive=True)


def shapes() -> None:
    """Draw outlines, scales, guides and places."""
    leaf = np.asarray(Image.open(DOCS.parent / "samples/leaf.png").convert("L"))
    leaf = leaf if leaf.mean() > 127 else 255 - leaf
    two = {"style": ["seed", "vein"], "place": ["outside", "inside"], "scale": [3, 1]}
    panels = [
        ("an outline that strokes fill", {"outline": letter("g"), "style": "vein", "palette": "sea"}),
        ("… that they avoid", {"outline": leaf, "place": "outside", "style": "leaf", "palette": "botanic"}),
        ("a fine ground and a figure", {"outline": leaf, **two, "palette": "fall", "mass": [0.2, 0.5]}),
        ("… by p4m", {"outline": leaf, **two, "repeat": "p4m", "palette": "night", "scale": [2, 1]}),
        ("a band, by pm", {"outline": "band", "style": "fern", "repeat": "pm", "palette": "plum"}),
        ("a guide", {"guide": spiral(), "style": "vein", "palette": "indigo", "layers": 2}),
        ("… by p6", {"guide": spiral(), "style": "vein", "repeat": "p6", "palette": "spring", "layers": 2}),
        ("sources along a line", {"sources": ts.motif.places_in_drawing(POINTS), "palette": "terracotta"}),
    ]
    drawn = []
    for seed, (words, options) in enumerate(panels, 3):
        given = {"repeat": "translate", "style": "vein", "layers": 2, "seed": seed, **options}
        given["penalty"] = 3.0
        drawn.append((words, pattern(ts.motif(SIZE, **given))))
    sheet("composition-shapes.jpg", drawn, 4)


def pieces() -> None:
    """Draw inks that knock each other out, and strokes in one piece."""
    inks = {"style": "cutout", "layers": 3, "repeat": "pgg", "palette": "fall", "seed": 3}
    cut = {"style": "seed", "layers": 1, "repeat": "p4g", "palette": "sumi", "seed": 4}
    panels = [
        ("as they are", inks),
        ("--knock-out", inks | {"knock_out": True}),
        ("--knock-out --trap -1%", inks | {"knock_out": True, "trap": -1.0}),
        ("as they are", cut),
        ("--one-piece --frame", cut | {"one_piece": "ink"}),
        ("--stencil --frame", cut | {"one_piece": "paper"}),
    ]
    drawn = []
    for words, options in panels:
        motif = ts.motif(SIZE, **options)
        across = SIDE // 2
        layers = ts.motif.repeat_densities(motif, (2, 2), size=(across, across), frame=motif.frame)
        drawn.append((words, picture(mix(layers, motif.inks, motif.paper))))
    sheet("composition-pieces.jpg", drawn, 3)


def growth() -> None:
    """Draw motifs while they grow."""
    drawn = []
    for rule, style, palette in (("p4m", "vein", "sea"), ("p6", "seed", "fall")):
        animation = ts.motif.animate(SIZE, style=style, repeat=rule, layers=2, seed=5, palette=palette)
        drawn += [(f"{rule}, {share:.0%}", pattern(animation.at(share))) for share in (0.3, 0.45, 0.6, 1.0)]
    sheet("composition-growth.jpg", drawn, 4)


def main() -> None:
    """Draw all of them."""
    shapes()
    pieces()
    growth()


if __name__ == "__main__":
    main()
