"""Draw the parameter studies, the two laws for base images and solids: ``python docs/pattern_studies.py``,
about a minute.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from PIL import Image, ImageDraw

import toposeam as ts
from make_pattern_figures import _DARK, _GRAY, _PAPER, _theme, bytes_of, font, save
from pattern_cases import STUDIES


def main() -> None:
    """Draw what is named on the command line, or every picture."""
    drawings = (studies, laws, solids)
    for draw in drawings:
        if len(sys.argv) > 1 and draw.__name__ not in sys.argv[1:]:
            continue
        started = time.perf_counter()
        draw()
        print(f"{draw.__name__}: {time.perf_counter() - started:.0f} s", flush=True)


def studies() -> None:
    """One motif with one parameter changed at a time, and what that does, measured."""
    side, gap, foot = 176, 12, 26
    canvas = Image.new("RGB", (5 * side + 4 * gap, len(STUDIES) * (side + foot)), _PAPER)
    pen = ImageDraw.Draw(canvas)
    for line, study in enumerate(STUDIES):
        for column, (motif, options) in enumerate(zip(study.motifs(), study.options, strict=True)):
            x, y = column * (side + gap), line * (side + foot)
            canvas.paste(Image.fromarray(bytes_of(motif.image((side, side)))), (x, y))
            words = study.words.format(**options)
            pen.text((x, y + side + 4), words, font=font(12), fill=_GRAY)
            value = f"{study.measured(motif):.2g}"
            pen.text((x + side, y + side + 4), value, font=font(12), fill=_DARK, anchor="ra")
    save(canvas, "studies-parameters.jpg")


def laws() -> None:
    """A base image, and what becomes of it by the thesis's law and by ours, by strength."""
    theme = _theme()
    side, gap, foot = 176, 12, 26
    strengths = (-0.5, -0.8, -0.95, -1.0)
    canvas = Image.new("RGB", (5 * side + 4 * gap, 2 * (side + foot)), _PAPER)
    pen = ImageDraw.Draw(canvas)
    shown = Image.fromarray(bytes_of(theme)).convert("RGB").resize((side, side))
    for line, law in enumerate(("brightness", "contrast")):
        y = line * (side + foot)
        canvas.paste(shown, (0, y))
        pen.text((0, y + side + 4), f"--base-law {law}", font=font(12), fill=_GRAY)
        for column, strength in enumerate(strengths, 1):
            motif = ts.motif(
                128,
                layers=2,
                seed=4,
                repeat="translate",
                palette="fall",
                mass=[0.2, 0.14],
                ambient=0.9,
                penalty=3,
                sources=[[[0.5, 0.45]], [[0.35, 0.4]]],
                sinks=[[[0.5, 0.85]], [[0.6, 0.4]]],
                base=theme,
                base_law=law,
                base_strength=strength,
            )
            x = column * (side + gap)
            canvas.paste(Image.fromarray(bytes_of(motif.image((side, side)))), (x, y))
            pen.text((x, y + side + 4), f"--base-strength {strength:g}", font=font(12), fill=_GRAY)
    save(canvas, "studies-laws.jpg")


def solids() -> None:
    """Solids, each by another rule."""
    shown: tuple[dict[str, Any], ...] = (
        {"repeat": "p4m", "sinks": 1, "mass": 0.1, "seed": 4},
        {"repeat": "none", "sinks": [[0.5, 0.5]], "mass": 0.07, "seed": 2},
        {"repeat": "p2", "sinks": 2, "mass": 0.1, "seed": 8},
    )
    figure = Figure(figsize=(10.8, 4.4), dpi=100, facecolor="white")
    for index, options in enumerate(shown):
        recipe = ts.motif.random_recipe(64, layers=1, **options)
        mesh = ts.solid.generate_solid(recipe, 64).mesh()
        corner = mesh.vertices[:, ::-1]
        axes: Any = figure.add_axes((index / 3, 0, 1 / 3, 1), projection="3d")
        light = LightSource(azdeg=315, altdeg=40)
        axes.add_collection3d(
            Poly3DCollection(
                corner[mesh.faces], facecolors="#d08a5b", shade=True, lightsource=light, linewidth=0
            )
        )
        axes.set(xlim=(0, 64), ylim=(0, 64), zlim=(0, 64))
        axes.set_box_aspect((1, 1, 1), zoom=1.08)
        axes.view_init(elev=18, azim=35)
        axes.set_axis_off()
        axes.text2D(0.5, 0.03, f"--repeat {options['repeat']}", transform=axes.transAxes, ha="center")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    save(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()), "studies-solids.jpg")


if __name__ == "__main__":
    main()
