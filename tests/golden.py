"""Small results that a release must not change silently: whoever made a picture with --like or a seed wants
it again.

``python tests/golden.py --write`` stores what this version makes, in ``golden.json``. A change of that file
is a line in CHANGELOG, which says what looks different and why.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from skimage import data

import toposeam as ts

STORED = Path(__file__).with_name("golden.json")
GRAVEL = data.gravel()[:96, :96]
COFFEE = data.coffee()[100:196, 200:320]


def digest(*arrays: Any) -> str:
    """The same for the same values, shapes and dtypes on every platform."""
    hashed = hashlib.sha256()
    for array in arrays:
        array = np.ascontiguousarray(array)
        hashed.update(f"{array.shape}{array.dtype.newbyteorder('<').str}".encode())
        hashed.update(array.astype(array.dtype.newbyteorder("<")).tobytes())
    return hashed.hexdigest()[:16]


def seam(method: str) -> str:
    """A seam across two crops of gravel, as its labels."""
    return digest(ts.find_seam(GRAVEL[:48, :24], GRAVEL[40:88, 50:74], method=method).labels)


def island() -> str:
    """A closed seam round an island of one photograph in another, as its labels."""
    inside = np.zeros((60, 60), bool)
    inside[12:48, 12:48] = True
    return digest(ts.find_seam(COFFEE[:60, :60], COFFEE[30:90, 50:110], mask_b=inside).labels)


def layers() -> str:
    """Three layers joined, as their masks and the composite."""
    placed = [
        ts.Layer(COFFEE[:60, :70], at=(0, 0)),
        ts.Layer(COFFEE[4:64, 40:110], at=(41, 2)),
        ts.Layer(COFFEE[30:90, 20:90], at=(22, 33)),
    ]
    made = ts.stitch(placed)
    return digest(*made.masks, made.image)


def texture(**options: Any) -> str:
    """A texture grown from gravel, as the source of every pixel."""
    return digest(ts.synthesize(GRAVEL, (80, 112), patch=24, seed=3, **options).source)


def tile() -> str:
    """A picture made to repeat, as the source of every pixel."""
    return digest(ts.make_tileable(GRAVEL).source)


def recipe() -> str:
    """What a seed alone decides of a motif."""
    made = ts.motif.random_recipe(64, repeat="p4m", seed=11).to_dict()
    return hashlib.sha256(json.dumps(made, sort_keys=True).encode()).hexdigest()[:16]


def motif(repeat: str) -> list[list[int]]:
    """A small motif, reduced to 8 × 8 shares of ink in 0..15, which rounding leaves as they are."""
    image = ts.generate_motif(32, repeat=repeat, seed=5, layers=1, iterations=12).densities[0]
    coarse = image.reshape(8, 4, 8, 4).mean(axis=(1, 3))
    return [[int(value) for value in row] for row in np.floor(coarse * 15.99)]


CASES = {
    "seam by heat": lambda: seam("heat"),
    "seam by thesis": lambda: seam("thesis"),
    "seam by shortest-path": lambda: seam("shortest-path"),
    "seam by dp": lambda: seam("dp"),
    "seam round an island": island,
    "three layers": layers,
    "texture": texture,
    "texture that repeats": lambda: texture(tileable="both"),
    "tile": tile,
    "recipe": recipe,
    "motif by translation": lambda: motif("translate"),
    "motif by p2": lambda: motif("p2"),
}


if __name__ == "__main__" and "--write" in sys.argv:
    STORED.write_text(
        json.dumps({"version": ts.__version__, **{name: make() for name, make in CASES.items()}}, indent=1)
        + "\n"
    )
