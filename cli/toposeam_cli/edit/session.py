"""A session: placed pictures, strokes, and the label map that follows. It knows nothing of the web."""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.arrays import Floats, Labels
from toposeam.images import box_of
from toposeam.layers.canvas.layer import Box
from toposeam_cli.edit.likeness import LikenessMap, SeamPlace
from toposeam_cli.edit.opening import open_work
from toposeam_cli.edit.strokes import on_picture, under, without
from toposeam_cli.edit.things import strokes_of_thing
from toposeam_cli.edit.work import Work
from toposeam_cli.media.layouts.layout import LayoutStroke

_NOWHERE, _NOTHING = Box(0, 0, 0, 0), np.zeros((0, 0), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """What a page has to draw anew."""

    #: The box of the canvas whose labels changed, and (h, w) their labels, plus one.
    box: Box
    labels: np.ndarray
    #: The box of squares whose likeness changed, counted in squares, and (h, w) uint8.
    squares: Box
    likeness: np.ndarray
    #: Whether a stroke asks for a picture where it has no pixels.
    lost: bool = False


@dataclass(slots=True, eq=False)
class _State:
    """What an undone gesture comes back to."""

    gestures: list[list[ts.layers.Stroke]]
    labels: bytes
    #: The crop that was drawn, as in the settings of the work.
    crop: str | None


class Session:
    """Placed pictures and the strokes on them."""

    def __init__(
        self, work: Work, progress: Callable[[float], None] | None = None, horizon: str | None = None
    ) -> None:
        """Place the pictures of a work as :func:`~toposeam_cli.edit.opening.open_work` does, find seams, and
        repeat the strokes.

        Raises
        ------
        TopoSeamError
            If they cannot be placed or joined.
        """
        self.work, self.opened = work, open_work(work, progress, horizon)
        self.labels: Labels = np.array(self.opened.joined.label_map)
        self.gestures: list[list[ts.layers.Stroke]] = []
        self.places: list[SeamPlace] = []
        self._first = self.labels.copy()
        self._shown = np.full_like(self.labels, -2)
        self._likeness = LikenessMap(self.labels.shape)
        self._labelling = ts.layers.keep_costs(self.opened.joined.labelling)
        #: The problem in which the strokes hold that are kept.
        self._held = self._labelling
        self._past: list[_State] = []
        self._future: list[_State] = []
        self._resume()
        self._write()

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the preview, px."""
        return self.opened.joined.canvas.shape

    @property
    def layers(self) -> Sequence[ts.Layer]:
        """The pictures as they lie on the preview, with their tones matched."""
        return self.opened.joined.canvas.cut_open().layers

    @property
    def can(self) -> dict[str, int]:
        """How many gestures can be undone and redone."""
        return {"undo": len(self._past), "redo": len(self._future)}

    def scene(self) -> dict[str, Any]:
        """Return what a page has to know besides the pixels."""
        canvas = self.opened.joined.canvas.cut_open()
        model = None if self.opened.job.placement is None else self.opened.job.placement.model
        return {
            "shape": list(self.shape),
            "round": self.opened.joined.canvas.period is not None,
            "scale": self.opened.scale,
            "model": model,
            "placed": self.work.is_placed,
            "blends": self.opened.blends,
            "crop": self.opened.crop,
            "settings": self.work.settings,
            "warnings": list(self.opened.warnings),
            "layers": [
                {"name": layer.name, "box": [place.left, place.top, place.shape[1], place.shape[0]]}
                for layer, place in zip(canvas.layers, canvas.places, strict=True)
            ],
        }

    def crop_to(self, box: Sequence[float]) -> None:
        """Crop to left, top, width and height, px of the preview, and write this; Undo takes it back."""
        if self.opened.crop is not None:
            self._past.append(self._state())
            self._future.clear()
        self.work.settings["crop"] = self.opened.crop_to(box)
        self._save()

    def first(self) -> bytes:
        """Return the label map before any stroke, plus one, as bytes."""
        return _packed(self._first)

    def all(self) -> Change:
        """Return everything as changed."""
        self._shown = np.full_like(self.labels, -2)
        return self._change(self.labels)

    def refresh(self) -> Change:
        """Return what leads back from a stroke that was not kept."""
        return self._change(self.labels)

    def push(self, stroke: Mapping[str, Any]) -> Change:
        """Return what a stroke that still grows changes; it is not kept."""
        made = self._stroke(stroke)
        if made is None:
            return self._change(self.labels, lost=True)
        asked, lost = self._with_strokes(self._held, [made])
        return self._change(self._recut(asked), lost=bool(lost))

    def paint(self, strokes: Sequence[Mapping[str, Any]]) -> bool:
        """Keep strokes as one gesture and write them to disk; False if no picture sees them."""
        made = [one for one in map(self._stroke, strokes) if one is not None]
        if made:
            self._keep([*self.gestures, made])
        return bool(made)

    def erase(self, points: Floats, radius: float) -> bool:
        """Rub out strokes under a stroke of the canvas; False if there are none."""
        changed, left = False, list[list[ts.layers.Stroke]]()
        for gesture in self.gestures:
            own = [self.opened.transforms[stroke.layer] for stroke in gesture]
            gone = [under(*each, points, radius) for each in zip(gesture, own, strict=True)]
            changed |= any(one.any() for one in gone)
            rest = without(gesture, gone)
            left += [rest] if rest else []
        if changed:
            self._keep(left)
        return changed

    def settle(self, interrupted: Callable[[], bool] = lambda: False) -> Change:
        """Search the whole label map again after a gesture that was kept; only the window round it if
        `interrupted`, which is asked between cuts, says that another gesture waits.
        """

        def ask(_: float) -> None:
            if interrupted():
                raise InterruptedError

        self._held, lost = self._with_strokes(self._labelling, self.strokes)
        try:
            self.labels = self._recut(self._held, whole=True, progress=ask)
        except InterruptedError:
            self.labels = self._recut(self._held)
        self._write()
        return self._change(self.labels, lost=len(self.strokes) - 1 in lost)

    def undo(self) -> Change:
        """Take the last gesture back."""
        return self._step(self._past, self._future)

    def redo(self) -> Change:
        """Repeat the gesture that was taken back last."""
        return self._step(self._future, self._past)

    def thing_at(self, x: float, y: float, layer: int) -> list[dict[str, Any]]:
        """Return strokes that take all of what differs at a point from another picture, or none."""
        return strokes_of_thing(self._labelling, self.labels, (x, y), layer)

    def worst(self) -> list[SeamPlace]:
        """Return the worst places along the seams, and those that were and are no longer."""
        self.places = self._likeness.worst(self.places)
        return self.places

    def blended(self, box: Box) -> np.ndarray:
        """Return the pixels of a box of the canvas as they are joined."""
        return self.opened.blended(self.labels, box)

    def judge(self, box: Box, pixels: np.ndarray) -> Change:
        """Judge the seams of a box by the steps and breaks that its blended pixels show."""
        steps = self.opened.steps(self.labels, box, pixels, self._likeness.poor(box))
        squares = self._likeness.judge(steps, box)
        return Change(_NOWHERE, _NOTHING, squares, self._squares(squares))

    @property
    def strokes(self) -> list[ts.layers.Stroke]:
        """The strokes of all gestures, in their order."""
        return [stroke for gesture in self.gestures for stroke in gesture]

    def _stroke(self, stroke: Mapping[str, Any]) -> ts.layers.Stroke | None:
        layer = int(stroke["layer"])
        points = np.array(stroke["points"], float)
        return on_picture(
            points, float(stroke["radius"]), layer, self.opened.transforms[layer], stroke["kind"]
        )

    def _keep(self, gestures: list[list[ts.layers.Stroke]]) -> None:
        self._past.append(self._state())
        self._future.clear()
        self.gestures = gestures
        self._save()

    def _state(self) -> _State:
        crop = None if self.opened.crop is None else self.work.settings.get("crop")
        return _State(self.gestures, zlib.compress(self.labels.tobytes(), 1), crop)

    def _step(self, source: list[_State], target: list[_State]) -> Change:
        if source:
            state = source.pop()
            target.append(self._state())
            self.gestures = state.gestures
            if state.crop is not None:
                self.work.settings["crop"] = self.opened.take_crop(state.crop)
            self.labels = _unpacked(state.labels, self.shape)
            self._held, _ = self._with_strokes(self._labelling, self.strokes)
            self._save()
        return self._change(self.labels)

    def _with_strokes(
        self, problem: ts.layers.Labelling, strokes: Sequence[ts.layers.Stroke]
    ) -> tuple[ts.layers.Labelling, tuple[int, ...]]:
        transforms = [one.whole for one in self.opened.transforms]
        return ts.layers.apply_strokes(problem, strokes, self.opened.joined.canvas, transforms)

    def _recut(
        self,
        problem: ts.layers.Labelling,
        *,
        whole: bool = False,
        progress: Callable[[float], None] | None = None,
    ) -> Labels:
        shows = dataclasses.replace(self.opened.joined.solution, labels=self.labels)
        return np.asarray(ts.layers.recut(problem, shows, whole=whole, progress=progress).labels)

    def _change(self, labels: Labels, *, lost: bool = False) -> Change:
        """Return how labels differ from those that the page shows, and take them as shown."""
        differs = labels != self._shown
        if not differs.any():
            return Change(_NOWHERE, _NOTHING, _NOWHERE, _NOTHING, lost)
        box = Box.of(*box_of(differs))
        squares = self._likeness.update(self._labelling, labels, box)
        self._shown = labels.copy()
        return Change(box, (labels[box.slices] + 1).astype(np.uint8), squares, self._squares(squares), lost)

    def _squares(self, box: Box) -> np.ndarray:
        return np.ascontiguousarray(self._likeness.squares[box.slices])

    def _save(self) -> None:
        self.work.gestures = [[_plain(stroke) for stroke in gesture] for gesture in self.gestures]
        self.work.save()
        self._write()

    def _write(self) -> None:
        """Write the layout of the work, which ``toposeam stitch`` joins at full size."""
        strokes = [LayoutStroke(**_plain(stroke)) for stroke in self.strokes]
        self.opened.write(self.work.layout, strokes, self.labels)

    def _resume(self) -> None:
        """Repeat the strokes of the work, or else of its layout, from the labels that the layout shows."""
        layout, known = self.opened.layout, self.work.gestures
        if not known and layout is not None:
            known = [[dataclasses.asdict(one)] for one in layout.strokes]
        count = len(self.layers)
        there = ([_of_plain(one) for one in gesture if one["layer"] < count] for gesture in known)
        self.gestures = [gesture for gesture in there if gesture]
        if not self.gestures:
            return
        blank = self._state()
        self._past = [
            dataclasses.replace(blank, gestures=self.gestures[:k]) for k in range(len(self.gestures))
        ]
        seen = self.opened.labels()
        if seen is not None:
            self.labels = seen
        self._held, _ = self._with_strokes(self._labelling, self.strokes)
        self.labels = self._recut(self._held, whole=seen is None)


def _packed(labels: Labels) -> bytes:
    return (labels + 1).astype(np.uint8).tobytes()


def _unpacked(data: bytes, shape: tuple[int, int]) -> Labels:
    """Return a label map from bytes; they are refused if they are those of another canvas."""
    return np.frombuffer(zlib.decompress(data), np.int16).reshape(shape).copy()


def _plain(stroke: ts.layers.Stroke) -> dict[str, Any]:
    points = [(x, y) for x, y in np.round(np.asarray(stroke.points, float), 2).tolist()]
    return {
        "kind": stroke.kind,
        "layer": stroke.layer,
        "radius": max(round(float(stroke.radius), 2), 0.01),
        "points": points,
    }


def _of_plain(values: Mapping[str, Any]) -> ts.layers.Stroke:
    return ts.layers.Stroke(**values)
