"""The process that grows motifs: it takes messages in order, and lets go of a motif when one comes."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.arrays import Floats
from toposeam.motif.ink import level, stroke_ends
from toposeam.motif.optimise import tile_size
from toposeam.motif.recipe import Recipe
from toposeam.motif.symmetry import HEXAGONAL
from toposeam.sentence import sentence
from toposeam_cli.edit.inbox import Inbox, Message
from toposeam_cli.edit.motif.session import GrowthTask, MotifSession
from toposeam_cli.edit.motif.work import MotifWork
from toposeam_cli.files.writing import atomic_write
from toposeam_cli.motifs.recipe_files import to_toml

#: Name of the recipe that *Save* is made from, in the folder of the work.
_RECIPE = "save.toml"
#: Time without a message after which the recipe itself is run, s; and the most elements times iterations of
#: all layers for which that begins unasked: some ten seconds.
_REST_S, _UNASKED = 1.2, 60_000_000
#: Least time between two pictures of a motif that grows, s.
_PERIOD_S = 0.03
#: Share of its greatest variance from which on a density is shown as strokes, and only as such: before, a
#: line through it would run anywhere.
_STROKES_FROM, _STROKES_ONLY = 0.02, 0.25
#: Largest motif that is sent whole, elements along a side.
_MOST_SIDE = 1024


class _NewerError(Exception):
    """A message came while the recipe was run."""


def run(connection: Connection, work: MotifWork) -> None:
    """Grow motifs for a page until the connection closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which then ends this process
    with contextlib.suppress(EOFError, BrokenPipeError, OSError):
        MotifSolver(connection, work).serve()


def _is_dragged_on(message: Message, newer: Message) -> bool:
    """Test whether a message continues the dragging of another one."""
    names = ("kind", "layer", "name", "role", "index")
    return message.get("done") is False and all(newer.get(name) == message.get(name) for name in names)


class MotifSolver:
    """Answers the messages of a page."""

    def __init__(self, connection: Connection, work: MotifWork) -> None:
        self._inbox, self._work = Inbox(connection), work
        self._say = self._inbox.say
        self._number, self._spoke = 0, 0.0
        self._resting = True

    def serve(self) -> None:
        """Show the motif, then answer messages one after another and grow in between."""
        try:
            self._session = MotifSession(self._work)
        except Exception as error:
            self._say("refused", {"text": sentence(error)})
            while True:
                self._inbox.next(_is_dragged_on)
        self._describe()
        growing: Iterator[None] | None = self._grow(self._session.begin())
        while True:
            if growing is not None and not self._inbox.receive():
                growing = self._advanced(growing)
                continue
            message = self._next()
            if message is None:
                self._finish()
                continue
            self._resting = True
            try:
                growing = self._answer(message, growing)
            except Exception as error:
                self._say("failed", {"text": sentence(error)})
                self._describe()
                growing = None
            if growing is not None:  # a step for every message, however many there are
                growing = self._advanced(growing)

    def _advanced(self, growing: Iterator[None]) -> Iterator[None] | None:
        """Take a step; return None after the last one."""
        try:
            next(growing)
        except StopIteration:
            return None
        except Exception as error:
            self._say("failed", {"text": sentence(error)})
            return None
        return growing

    def _next(self) -> Message | None:
        """Return the next message, or None after a rest; of what is dragged only the newest counts."""
        settles = self._resting and not self._session.final and self._is_cheap()
        if settles and self._inbox.rests(_REST_S):
            return None
        return self._inbox.next(_is_dragged_on)

    def _answer(self, message: dict[str, Any], growing: Iterator[None] | None) -> Iterator[None] | None:
        """Answer a message; return what grows then."""
        kind = message["kind"]
        if kind == "finish":
            self._finish()
            return None
        if kind == "save":
            self._write(message)
            return growing
        if kind == "relatives":
            return self._breed(message["seed"])
        task = self._session.change(message)
        self._describe()
        if task is not None:
            return self._grow(task)
        shown = self._session.shown()
        if kind in ("undo", "redo") and shown is not None:
            self._show(shown, 1.0, final=self._session.final, printed=self._session.printed)
            return None
        return growing

    def _write(self, message: dict[str, Any]) -> None:
        """Write the recipe that is to be saved, and say where it is and how large one motif is, in px."""
        recipe = self._session.recipe
        source = self._work.folder / _RECIPE
        self._work.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        atomic_write(source, to_toml(recipe).encode(), force=True)
        rows, columns = tile_size(recipe.size[0]) if recipe.repeat in HEXAGONAL else recipe.size
        height = max(1, round(message["px"] * rows / columns))
        self._say("recipe", {**message, "source": str(source), "width": message["px"], "height": height})

    def _describe(self) -> None:
        self._say("state", self._session.describe())

    def _is_cheap(self) -> bool:
        recipe = self._session.recipe
        rounds = sum(recipe.of_layer(index).iterations for index in range(len(recipe.layers)))
        return bool(rounds * recipe.size[0] * recipe.size[1] <= _UNASKED)

    def _grow(self, task: GrowthTask) -> Iterator[None]:
        """Grow a motif, and show it."""
        self._number += 1
        started = time.process_time()
        for grown in ts.motif.grow(task.recipe, start=task.start, kept=task.kept, most=task.most):
            if grown.share == 1 or time.monotonic() - self._spoke >= _PERIOD_S:
                self._show(grown.densities, grown.share, seconds=time.process_time() - started)
            yield

    def _finish(self) -> None:
        """Run the recipe itself, unless a message comes, and show what it makes."""
        self._resting = False
        started = time.process_time()

        def report(share: float) -> None:
            if self._inbox.receive():
                raise _NewerError
            self._say("finishing", {"share": round(share, 3)})

        try:
            made = ts.motif(self._session.recipe, progress=report)
        except _NewerError:
            self._say("finishing", {"share": 0.0})
            return
        except ts.TopoSeamError as error:
            self._say("failed", {"text": sentence(error)})
            return
        own = made.densities if made.lattice is None else made.lattice
        step = -(-max(own.shape[1:]) // _MOST_SIDE)
        ends = [made.ends(index) for index in range(len(own))]
        seconds = time.process_time() - started
        self._show(list(own[:, ::step, ::step]), 1.0, final=True, ends=ends, seconds=seconds)

    def _breed(self, seed: int) -> Iterator[None]:
        """Grow relatives, and show each when it is there."""
        tasks = self._session.breed(seed)
        self._say("relatives", {"count": len(tasks)})
        for number, task in enumerate(tasks):
            densities: Sequence[Floats] = ()
            for grown in ts.motif.grow(task.recipe, most=task.most):
                densities = grown.densities
                yield
            self._session.bred(number, densities)
            levels = [np.rint(255 * density).astype(np.uint8) for density in densities]
            head = {
                "number": number,
                "shape": list(densities[0].shape),
                "repeat": task.recipe.repeat,
                **self._printed(task.recipe, densities, 1.0, None),
            }
            self._say("relative", head, [one.tobytes() for one in levels])

    def _show(
        self,
        densities: Sequence[np.ndarray],
        share: float,
        *,
        final: bool = False,
        ends: Sequence[tuple[float, Any]] | None = None,
        printed: dict[str, list[float]] | None = None,
        seconds: float = 0.0,
    ) -> None:
        printed = printed or self._printed(self._session.recipe, densities, share, ends)
        self._spoke = time.monotonic()
        head = {
            "number": self._number,
            "shape": list(densities[0].shape),
            "share": share,
            "final": final,
            "seconds": round(seconds, 3),
            **printed,
        }
        self._say("density", head, self._session.show(densities, printed, final=final))

    def _printed(
        self,
        recipe: Recipe,
        densities: Sequence[np.ndarray],
        share: float,
        ends: Sequence[tuple[float, Any]] | None,
    ) -> dict[str, list[float]]:
        """Return how layers are printed: where strokes end, the factor on ink inside, and how far they are
        strokes yet.
        """
        levels, gains, strokes = [], [], []
        for index, (layer, density) in enumerate(zip(recipe.layers, densities, strict=True)):
            field = density.astype(np.float32)
            if ends is not None:
                at, gain = ends[index]
            elif share == 1:
                at, gain = stroke_ends([field], layer.edge, recipe.repeat, 1)
            else:
                at, gain = level(field, float(field.mean())), np.float32(1)
            contrast = float(field.var()) / max(layer.mass * (1 - layer.mass), 1e-6)
            ripe = min(1.0, max(0.0, (contrast - _STROKES_FROM) / (_STROKES_ONLY - _STROKES_FROM)))
            levels.append(round(float(at), 5))
            gains.append(round(float(gain), 4))
            strokes.append(0.0 if layer.edge == "soft" else 1.0 if share == 1 else round(ripe, 3))
        return {"ends": levels, "gains": gains, "strokes": strokes}
