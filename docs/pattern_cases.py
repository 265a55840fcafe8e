"""What the page of parameter studies shows (docs/pattern_studies.py), and what each of its rows claims: a
number that grows, or falls, along it (tests/test_studies.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage
from skimage.morphology import skeletonize

import toposeam as ts
from toposeam.motif.kinds import measure

SIZE = 96
FIXED: dict[str, Any] = {
    "layers": 1,
    "seed": 21,
    "repeat": "translate",
    "palette": "sumi",
    "sources": 3,
    "sinks": 3,
    "ambient": 0.5,
    "mass": 0.25,
    "penalty": 3,
}


@dataclass(frozen=True)
class Study:
    """One row: a caption for each picture, the options of each, and what is measured."""

    words: str
    options: tuple[dict[str, Any], ...]
    claim: str
    measured: Callable[[ts.motif.Motif], float]
    grows: bool

    def motifs(self) -> list[ts.motif.Motif]:
        """The row's motifs."""
        return [ts.motif(SIZE, **(FIXED | options)) for options in self.options]


def inked(motif: ts.motif.Motif) -> float:
    """Share of the area that is printed."""
    return float(motif.coverage().mean())


def gray(motif: ts.motif.Motif) -> float:
    """Share of the area that is neither paper nor full ink."""
    density = motif.densities[0]
    return float(((density > 0.1) & (density < 0.9)).mean())


def stroke(motif: ts.motif.Motif) -> float:
    """Mean width of the strokes."""
    return measure(motif.image()).stroke


def ends(motif: ts.motif.Motif) -> float:
    """Number of ends of strokes."""
    margin = SIZE // 6
    lines = skeletonize(np.pad(motif.coverage()[0] > 0.5, margin, mode="wrap"))
    around = ndimage.convolve(lines.astype(int), np.ones((3, 3), int)) * lines
    return float((around == 2)[margin:-margin, margin:-margin].sum())


def uneven(motif: ts.motif.Motif) -> float:
    """How much the ink round the sources differs: deviation over mean."""
    density = motif.densities[0]
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    found = []
    for px, py, _ in motif.recipe.layers[0].sources:
        away = [np.abs(place - at * SIZE) for place, at in ((x, px), (y, py))]
        found.append(density[np.hypot(*(np.minimum(gap, SIZE - gap) for gap in away)) < 9].mean())
    return float(np.std(found) / np.mean(found))


COUNTS = (1, 2, 4, 8, 16)
STUDIES = (
    Study("--mass {mass}", tuple({"mass": m} for m in (0.1, 0.2, 0.3, 0.4, 0.5)), "more ink", inked, True),
    Study("--penalty {penalty}", tuple({"penalty": p} for p in (1, 1.5, 2, 3, 5)), "less gray", gray, False),
    Study(
        "{sources} sources, 1 sink",
        tuple({"sources": n, "sinks": 1} for n in COUNTS),
        "thinner arms to one place",
        stroke,
        False,
    ),
    Study(
        "1 source, {sinks} sinks",
        tuple({"sources": 1, "sinks": n} for n in COUNTS),
        "more ends",
        ends,
        True,
    ),
    Study(
        "{sources} sources, {sinks} sinks",
        tuple({"sources": n, "sinks": n} for n in COUNTS),
        "finer strokes",
        stroke,
        False,
    ),
    Study(
        "--strengths {strengths[0]},{strengths[1]}",
        tuple(
            {"sources": 6, "sinks": 2, "ambient": 0.1, "strengths": (low, high)}
            for low, high in ((1, 1), (0.8, 1.25), (0.5, 2), (0.25, 4), (0.1, 10))
        ),
        "less even",
        uneven,
        True,
    ),
    Study(
        "--ambient {ambient}", tuple({"ambient": a} for a in (0, 0.1, 0.3, 0.6, 1)), "more ends", ends, True
    ),
    Study(
        "--iterations {iterations}",
        tuple({"iterations": n, "coarse": False} for n in (5, 10, 20, 40, 80)),
        "less gray",
        gray,
        False,
    ),
)
