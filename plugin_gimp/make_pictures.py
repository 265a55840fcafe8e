"""The small pictures by which the plug-in's dialogs show rules and palettes: ``make_pictures.py [FOLDER]``.

A rule is shown on a comma, its mirrored copies in another colour; a palette as its paper with its inks.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

import toposeam as ts
from toposeam.motif.symmetry.rules import HEXAGONAL, operations
from toposeam.motif.symmetry.tiling import period, shift_of

FOLDER = Path(__file__).parent / "toposeam_gimp" / "pictures"
#: Px a side, twice what is shown on an ordinary screen; drawn larger, for smooth edges.
SIZE, FINE = 112, 8
PAPER, INK, MIRRORED = "#f6f3ea", "#24376b", "#c4583a"
#: The lattice vectors of the hexagonal groups, as columns.
_SLANTED = np.array([[1.0, -0.5], [0.0, np.sqrt(0.75)]])
_COLOURS = 32


def main() -> None:
    """Draw all of them into the folder."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    folder.mkdir(exist_ok=True)
    for rule in ts.motif.REPEATS:
        save(rule_picture(rule), folder / f"rule-{rule}.png")
    for name in ts.motif.PALETTES:
        save(palette_picture(name), folder / f"palette-{name}.png")


def save(picture: Image.Image, file: Path) -> None:
    """Write a picture, small, in few colours."""
    small = picture.resize((SIZE, SIZE), Image.Resampling.BOX)
    small.quantize(_COLOURS).save(file, optimize=True)


def comma() -> np.ndarray:
    """Return a bent drop, which no turn or mirror takes to itself: (N, 2), about 1 long, round the origin."""
    along = np.linspace(0, 1, 40)
    angle = 2.6 * (1 - along) - 0.4
    spine = np.stack([0.42 * np.cos(angle), 0.42 * np.sin(angle)], axis=1)
    wide = 0.02 + 0.27 * along**1.5
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tip = np.linspace(0, np.pi, 16)
    end = np.stack([np.cos(angle[-1]) * np.cos(tip), np.sin(angle[-1]) * np.cos(tip)], axis=1)
    forward = np.array([np.sin(angle[-1]), -np.cos(angle[-1])])
    head = spine[-1] + wide[-1] * (end + np.sin(tip)[:, np.newaxis] * forward)
    outline = np.concatenate([spine + wide[:, np.newaxis] * across, head])
    outline = np.concatenate([outline, (spine - wide[:, np.newaxis] * across)[::-1]])
    return outline - outline.mean(axis=0)


def copies(rule: str) -> tuple[list[tuple[np.ndarray, np.ndarray]], np.ndarray]:
    """Return the copies of a point in a pattern's translational cell, each as a matrix and a shift in cells
    of the motif; and the translations, as columns.
    """
    lattice = _SLANTED if rule in HEXAGONAL else np.eye(2)
    if rule in ("reflect", "rotate"):
        found = []
        for row, column in np.ndindex(2, 2):
            turned = (row + column) % 2
            flips = [-1 if column else 1, -1 if row else 1] if rule == "reflect" else [1 - 2 * turned] * 2
            found.append((np.diag(flips).astype(float), np.array([column, row], float)))
        return found, np.diag([2.0, 2.0])
    shift = shift_of(rule)
    if shift is not None:
        axis, share = shift
        rows, columns = period(rule)
        steps = [np.array([column, row], float) for row in range(rows) for column in range(columns)]
        aside = np.array([1.0, 0.0] if axis == 1 else [0.0, 1.0]) * float(share)
        moved = [step + index * aside for index, step in enumerate(steps)]
        return [(np.eye(2), step) for step in moved], np.diag([float(columns), float(rows)])
    inverse = np.linalg.inv(lattice)
    return [
        (lattice @ np.array([a, b], float) @ inverse, lattice @ (np.array(half, float) / 2))
        for a, b, half in operations(rule)
    ], lattice


def rule_picture(rule: str) -> Image.Image:
    """Return a pattern of commas by a rule."""
    group, lattice = copies(rule)
    extent = 1.0 if rule == "none" else 2.0 if len(group) <= 4 or rule in ("reflect", "rotate") else 1.5
    around = [lattice @ np.array([x, y], float) for x in range(-4, 5) for y in range(-4, 5)]
    if rule == "none":
        around = [np.zeros(2)]
    place, reach = best_place(group, around, rule)
    mark = comma() * min(0.75 * reach, 0.55)
    px = SIZE * FINE / extent
    picture = Image.new("RGB", (SIZE * FINE, SIZE * FINE), PAPER)
    draw = ImageDraw.Draw(picture)
    for matrix, shift in group:
        colour = MIRRORED if np.linalg.det(matrix) < 0 else INK
        middle = 0.5 if rule in ("reflect", "rotate") else 0.0  # of the cell, round which copies turn
        points = (place + mark - middle) @ matrix.T + shift + middle
        for step in around:
            draw.polygon([tuple(point) for point in ((points + step) * px).tolist()], fill=colour)
    return picture


def best_place(group: list[Any], around: list[np.ndarray], rule: str) -> tuple[np.ndarray, float]:
    """Find the place where copies are farthest from each other, and their distance."""
    if rule in ("none", "translate", "p1", "drop", "brick", "reflect", "rotate"):
        return np.array([0.5, 0.5]), 0.7
    places = (np.indices((24, 24)).reshape(2, -1).T + 0.5) / 24
    steps = np.array([step for step in around if np.abs(step).max() < 3.6])
    images = [(places @ matrix.T + shift)[:, np.newaxis] + steps for matrix, shift in group]
    away = np.sort(np.hypot(*np.moveaxis(np.concatenate(images, axis=1) - places[:, np.newaxis], 2, 0)))[:, 1]
    best = int(np.argmax(np.round(away, 9)))
    return places[best], float(away[best])


def palette_picture(name: str) -> Image.Image:
    """Return a palette's paper with six of its inks."""
    colours = ts.motif.PALETTES[name]
    side = SIZE * FINE
    picture = Image.new("RGB", (side, side), colours[0])
    draw = ImageDraw.Draw(picture)
    radius = 0.13 * side
    for index, ink in enumerate(colours[1:7]):
        x, y = (0.2 + 0.3 * (index % 3)) * side, (0.32 + 0.36 * (index // 3)) * side
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=ink)
    return picture


if __name__ == "__main__":
    main()
