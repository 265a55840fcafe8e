"""Draw the pictures of docs/motifs.md, Figures 4.1 to 4.9 in kind: ``python docs/motif_figures.py``, about a
minute.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

import toposeam as ts

FIGURES = Path(__file__).resolve().parent / "figures"
_GRAY, _PAPER = (110, 105, 98), (255, 255, 255)
_HOT, _COLD = (190, 60, 40), (40, 80, 150)
_GAP, _FOOT = 16, 30
#: Seeds of the two motifs that are joined.
_A, _B = 11, 12


class Canvas:
    """Pictures on white paper, each with words below it."""

    def __init__(self, width: int, height: int) -> None:
        self.image = Image.new("RGB", (width, height), _PAPER)
        self._pen = ImageDraw.Draw(self.image)

    def picture(self, image: npt.NDArray[np.floating], x: int, y: int, words: str = "") -> None:
        """A picture with its upper left corner at a point."""
        pixels = np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)
        self.image.paste(Image.fromarray(pixels), (x, y))
        self.words(words, x, y + len(pixels) + 5)

    def words(self, text: str, x: int, y: int, size: int = 15) -> None:
        """Words with their upper left corner at a point."""
        font = ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"), size)
        self._pen.text((x, y), text, font=font, fill=_GRAY)

    def conditions(self, recipe: ts.motif.Recipe, x: int, y: int, side: int, words: str) -> None:
        """Where heat enters and leaves, as in Figure 4.6: discs in proportion to their strengths."""
        self._pen.rectangle((x, y, x + side - 1, y + side - 1), outline=_GRAY)
        layer = recipe.layers[0]
        for points, colour in ((layer.sources, _HOT), (layer.sinks, _COLD)):
            for px, py, strength in points:
                radius = 8 * np.sqrt(strength)
                at = x + px * side, y + py * side
                self._pen.ellipse(
                    (at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius), fill=colour
                )
        self.words(words, x, y + side + 5)

    def save(self, name: str, quality: int = 78) -> None:
        """Write the sheet as JPEG: branching strokes do not compress otherwise."""
        self.image.save(FIGURES / name, quality=quality, optimize=True, progressive=True)


def main() -> None:
    """Draw every picture."""
    for draw in (repeats, joined, stages, seeds):
        started = time.perf_counter()
        draw()
        print(f"{draw.__name__}: {time.perf_counter() - started:.0f} s", flush=True)


def repeats() -> None:
    """Figures 4.1 to 4.4: one start, three rules; motifs above, 8 × 8 of them below."""
    start = ts.motif.random_recipe(
        128,
        seed=6,
        repeat="reflect",
        palette="terracotta",
        sources=4,
        sinks=3,
        ambient=0.5,
        filter_radius=1.2,
    )
    side = 384
    canvas = Canvas(3 * side + 2 * _GAP, 2 * (side + _FOOT) + _GAP)
    for column, rule in enumerate(("reflect", "translate", "rotate")):
        motif = ts.motif(replace(start, repeat=rule))
        x = column * (side + _GAP)
        canvas.picture(motif.image((side, side)), x, 0, f"{rule}: the motif")
        canvas.picture(
            ts.repeat(motif, (8, 8), size=(side // 8, side // 8)), x, side + _FOOT + _GAP, f"{rule}: 8 × 8"
        )
    canvas.save("motifs-repeats.jpg")


def pairs() -> tuple[int, int]:
    """Print how the mismatch of twelve pairs of seeds falls with the stages; the pair that is shown is the
    one nearest to their mean.
    """
    seeds = [(seed, seed + 1) for seed in range(1, 24, 2)]
    fallen = []
    for pair in seeds:
        made = ts.motif.join_motifs(_recipes(*pair), weight=0.5, stages=3, shared=0)
        fallen.append([made.mismatch(stage) for stage in (1, 2, 3)])
        print(*pair, *(f"{value:.2f}" for value in fallen[-1]), flush=True)
    mean = np.mean(fallen, axis=0)
    print("mean", *(f"{value:.2f}" for value in mean))
    return seeds[int(np.square(np.array(fallen) - mean).sum(axis=1).argmin())]


def _recipes(first: int = _A, second: int = _B) -> list[ts.motif.Recipe]:
    options = {"layers": 1, "repeat": "translate", "palette": "sea", "penalty": 3.0, "filter_radius": 1.0}
    few = ts.motif.random_recipe(128, seed=first, sources=4, sinks=3, mass=0.3, **options)
    many = ts.motif.random_recipe(128, seed=second, sources=9, sinks=7, mass=0.22, **options)
    return [few, many]


def joined() -> None:
    """Figures 4.6 and 4.7: the conditions, then each motif by itself and both together for three weights."""
    recipes, side = _recipes(), 240
    canvas = Canvas(4 * side + 3 * _GAP, 3 * (side + _FOOT))
    for row, (recipe, name) in enumerate(zip(recipes, "AB", strict=True)):
        canvas.conditions(recipe, 0, row * (side + _FOOT), side, f"{name}: mass {recipe.layers[0].mass:.2f}")
    canvas.words("red: sources, blue: sinks", 0, 2 * (side + _FOOT) + 4)
    half = (side // 2, side // 2)
    for row, weight in enumerate((0.0, 0.5, 1.0)):
        result = ts.motif.join_motifs(recipes, weight=weight, shared=0)
        y = row * (side + _FOOT)
        a, b = result.motifs
        shown = (
            ([[0, 0], [0, 0]], f"w = {weight:g}: A, {ts.motif.border_mismatch(a, a):.1f}"),
            ([[1, 1], [1, 1]], f"B, {ts.motif.border_mismatch(b, b):.1f}"),
            ([[0, 1], [1, 0]], f"A and B, {ts.motif.border_mismatch(a, b):.1f}"),
        )
        for column, (grid, words) in enumerate(shown):
            canvas.picture(
                ts.motif.arrange(result.motifs, grid).image((2 * half[0], 2 * half[1])),
                (column + 1) * (side + _GAP),
                y,
                words,
            )
    canvas.save("motifs-joined.jpg")


def stages() -> None:
    """Figures 4.8 and 4.9: the row of motifs after each stage, and patterns of them."""
    recipes, side, large = _recipes(), 228, 291
    free = ts.motif.join_motifs(recipes, weight=0.5, stages=3, shared=0)
    shared = ts.motif.join_motifs(recipes, weight=0.5, stages=3)
    width = 5 * side + 4 * _GAP
    canvas = Canvas(max(width, 4 * large + 3 * _GAP), 3 * (side + _FOOT) + large + _FOOT)
    for stage in (1, 2, 3):
        row = free.at_stage(stage)
        for index, motif in enumerate(row):
            x = round(index * (width - side) / (len(row) - 1))
            words = f"stage {stage}, border mismatch {free.mismatch(stage):.2f}" if index == 0 else ""
            canvas.picture(motif.image((side, side)), x, (stage - 1) * (side + _FOOT), words)
    y, cell = 3 * (side + _FOOT), (large // 7, large // 7)
    patterns = (
        (free.at_stage(1), None, "stage 1, at random"),
        (free.at_stage(2), 1, "stage 2, neighbours in the row together"),
        (free.at_stage(3), 1, "stage 3, likewise"),
        (shared.motifs, None, f"shared border ({shared.mismatch():.2f}), at random"),
    )
    for column, (motifs, reach, words) in enumerate(patterns):
        canvas.picture(
            ts.motif.arrange(motifs, (7, 7), seed=3, reach=reach).image((7 * cell[0], 7 * cell[1])),
            column * (large + _GAP),
            y,
            words,
        )
    canvas.save("motifs-stages.jpg")


def seeds() -> None:
    """What random seeds give."""
    rules = ("translate", "rotate", "reflect", "p4m", "p6m", "p2", "cmm", "p3", "pgg", "p4", "p31m", "pmg")
    side, gap = 184, 8
    canvas = Canvas(6 * side + 5 * gap, 4 * side + 3 * gap)
    for index in range(24):
        motif = ts.motif(160, repeat=rules[index % 12], seed=index)
        tall = motif.densities.shape[1] > motif.densities.shape[2]
        pattern = ts.repeat(motif, (2, 2), size=(159, 92) if tall else (92, 92))[:side, :side]
        canvas.picture(pattern, index % 6 * (side + gap), index // 6 * (side + gap))
    canvas.save("motifs-seeds.jpg")


if __name__ == "__main__":
    main()
