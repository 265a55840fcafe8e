"""What the page of ``toposeam edit --motif`` costs, and how near a sketch is to what its recipe makes.

    python benchmarks/edit_motif.py [--side 256] [--seed 7] [--sketches-only]

A session is driven as the page drives it, without a browser: a motif of each style under a rule is grown from
nothing, then an ink's mass is changed and a source moved, each from what is shown. Times are those of the
processor, with all that is sent (`MotifSolver`): from the message to the first densities, and to the last
ones. Columns:

inks        layers of ink
first, all  ms to the first densities from nothing, and s to the last
again       the same after a change, the larger of the two
alike       likeness of the sketch, of its strokes in print, and what the recipe itself makes: Jaccard's index
            of the inked pixels, meaned over the inks; `by chance` is that of another seed's motif
recipe      s that the recipe takes
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from stamp import stamp
from toposeam_cli.edit.motif.session import MotifSession
from toposeam_cli.edit.motif.sketch import Sketch
from toposeam_cli.edit.motif.solver import MotifSolver
from toposeam_cli.edit.motif.work import MotifWork

RULES = ("translate", "p4m", "p6m", "brick", "pgg", "reflect", "p31m", "cm")


class Listener:
    """Takes what a solver says, and when, in time of the processor."""

    def __init__(self) -> None:
        self.first = 0.0

    def send(self, event: Any) -> None:
        """Take an event."""
        if event[0] == "density" and not self.first:
            self.first = time.process_time()

    def poll(self, timeout: float = 0) -> bool:
        """Say that no message waits."""
        return False


class BegunWork(MotifWork):
    """A work that begins with a given recipe."""

    def __init__(self, folder: Path, recipe: ts.motif.Recipe) -> None:
        super().__init__(folder, None)
        self.recipe = recipe

    def first(self, seed: int) -> Sketch:
        """Return the sketch to begin with."""
        return Sketch(recipe=self.recipe)


def timed(solver: MotifSolver, listener: Listener, work: Any) -> tuple[float, float]:
    """Return s of the processor until the first and the last densities of what `work` returns."""
    listener.first = 0.0
    started = time.process_time()
    growing: Iterator[None] = work()
    for _ in growing:
        pass
    return listener.first - started, time.process_time() - started


def inked(layers: list[np.ndarray], masses: list[float]) -> list[np.ndarray]:
    """Return which elements each layer inks."""
    return [layer > np.quantile(layer, 1 - mass) for layer, mass in zip(layers, masses, strict=True)]


def likeness(first: list[np.ndarray], second: list[np.ndarray]) -> float:
    """Return the mean of Jaccard's index over layers."""
    return float(np.mean([(a & b).sum() / max((a | b).sum(), 1) for a, b in zip(first, second, strict=True)]))


def measured(recipe: ts.motif.Recipe, stranger: ts.motif.Recipe, recipes: bool) -> dict[str, float]:
    """Return the figures of one motif."""
    with tempfile.TemporaryDirectory() as folder:
        listener = Listener()
        solver = MotifSolver(listener, BegunWork(Path(folder) / "motif", recipe))  # type: ignore[arg-type]
        session = solver._session = MotifSession(solver._work)
        first, whole = timed(solver, listener, lambda: solver._grow(session.begin()))
        sketch = session.shown() or []
        layer = recipe.layers[0]
        changes: list[dict[str, Any]] = [
            {"kind": "set", "name": "mass", "value": 0.9 * layer.mass, "layer": 0, "done": True}
        ]
        if layer.sinks:
            x, y, _ = layer.sinks[0]
            points = [[(x + 0.1) % 1, y]]
            changes.append({"kind": "move", "role": "sinks", "layer": 0, "index": 0, "points": points})
        again = [
            timed(solver, listener, lambda each=each: solver._answer({"done": True, **each}, None))
            for each in changes
        ]
    found = {
        "inks": len(recipe.layers),
        "first": first,
        "all": whole,
        "again_first": max(one for one, _ in again),
        "again_all": max(one for _, one in again),
    }
    if recipes:
        masses = [each.mass for each in recipe.layers]
        started = time.process_time()
        made = ts.motif(recipe)
        found["recipe"] = time.process_time() - started
        own = made.densities if made.lattice is None else made.lattice
        *_, other = ts.motif.grow(stranger)
        shown = inked(list(own), masses)
        found["alike"] = likeness(inked(sketch, masses), shown)
        found["chance"] = likeness(inked(list(other.densities), masses), shown)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--sketches-only", action="store_true")
    given = parser.parse_args()
    print("style    rule       inks  first ms  all s   again ms  all s   alike  by chance  recipe s")
    rows = []
    for number, style in enumerate(ts.motif.STYLES):
        rule = RULES[number % len(RULES)]
        recipes = [
            ts.motif.random_recipe(given.side, style=style, repeat=rule, seed=given.seed + more)
            for more in (number, number + 1000)
        ]
        row = measured(recipes[0], recipes[1], not given.sketches_only)
        rows.append(row)
        print(
            f"{style:<8} {rule:<10} {row['inks']:4}  {1000 * row['first']:8.0f}  {row['all']:5.2f}  "
            f"{1000 * row['again_first']:8.0f}  {row['again_all']:5.2f}   {row.get('alike', 0):5.2f}  "
            f"{row.get('chance', 0):9.2f}  {row.get('recipe', 0):8.2f}",
            flush=True,
        )
    for name, factor in (("first", 1000), ("all", 1), ("again_first", 1000), ("again_all", 1)):
        values = [factor * row[name] for row in rows]
        print(f"{name:<12} median {np.median(values):.3g}, largest {max(values):.3g}")


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    print(stamp())
    main()
