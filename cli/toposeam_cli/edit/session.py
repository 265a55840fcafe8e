"""A session: placed pictures, the strokes on them, and the label map that follows. It knows nothing of the web."""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import toposeam as ts
from toposeam.arrays import Floats, Labels, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.transforms import Transform
from toposeam_cli.app.options import taken
from toposeam_cli.app.registry import load
from toposeam_cli.edit.likeness import LikenessMap, Place
from toposeam_cli.edit.preview import Preview
from toposeam_cli.edit.strokes import CanvasTransform, discs_of, on_canvas, on_picture, without
from toposeam_cli.edit.warm import Stroke, apply_strokes, recut
from toposeam_cli.edit.work import Work
from toposeam_cli.files.writing import atomic_write
from toposeam_cli.media.layouts.layout import Layout, LayoutLayer, layout_text
from toposeam_cli.stitching.inputs import PlacedPictures, arrange
from toposeam_cli.stitching.joining import join
from toposeam_cli.stitching.outputs import Outputs
from toposeam_cli.stitching.place_options import FindingOptions, with_defaults
from toposeam_cli.stitching.positions import Where
from toposeam_cli.stitching.search_options import Means, SeamOptions, strangers

#: Most pictures that the page shows: each is a texture.
MOST_PICTURES = 100
#: The box round a tap in which a thing that differs is looked for: its half side, and how far from the tap it
#: may begin, px of the preview.
_AROUND_TAP, _NEAR_TAP = 300, 24
#: Mean cost of an interface from which on two pictures differ there, as for a likeness of one half.
_DIFFERENT = 18.0
#: A thing is taken with so many px round it, and is at most this share of the box.
_RIM_PX, _LARGEST_THING = 4, 0.3
#: Radius of the stroke that sends a seam elsewhere, px of the preview.
_OTHER_WAY_PX = 22.0
#: Settings that change where pictures lie; the others change how they are joined.
PLACING = ("model", "projection", "level")


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

    gestures: list[list[Stroke]]
    labels: bytes


@dataclass(eq=False)
class Session:
    """Placed pictures and the strokes on them."""

    work: Work
    job: PlacedPictures
    joined: ts.layers.Composition
    transforms: tuple[Transform, ...]
    scale: float
    warnings: list[str]
    #: Whether pictures are blended across the seams.
    blends: bool
    labels: Labels
    gestures: list[list[Stroke]] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    _past: list[_State] = field(default_factory=list)
    _future: list[_State] = field(default_factory=list)

    @classmethod
    def open(cls, work: Work, progress: Callable[[float], None] | None = None) -> Session:
        """Place the pictures of a work, find their seams, and repeat its strokes.

        Raises
        ------
        TopoSeamError
            If they cannot be placed or joined.
        """
        sources = [work.layout] if work.layout.exists() else work.files
        given = _given(sources, work.settings)
        find = SeamOptions.taken(given)
        where, out, finding = taken(Where, given), taken(Outputs, given), taken(FindingOptions, given)
        preview = Preview()
        job = arrange(
            sources,
            where,
            masks=given["masks"],
            keeps=given["keeps"],
            max_megapixels=find.of_stitch("max_megapixels"),
            progress=progress,
            finding=finding.of(sources),
            lay=preview,
        )
        _check_count(len(job.layers))
        find, out = with_defaults(find, out, job, finding)
        wrap = job.wrap
        if wrap is not None:
            find = find.with_stitch(wrap=round(wrap * preview.scale))
        warnings = list(job.skipped) + (strangers(job) if job.placement is not None else [])
        joined = join(job, find, out, sources, Means(None, None, False))
        transforms = tuple(CanvasTransform(one, joined.canvas.origin) for one in preview.transforms)
        session = cls(
            work=work,
            job=job,
            joined=joined,
            transforms=transforms,
            scale=preview.scale,
            warnings=warnings,
            blends=find.of_stitch("blend") != "none",
            labels=np.array(joined.label_map),
        )
        session._write_places()
        session._resume()
        return session

    def __post_init__(self) -> None:
        self._first = self.labels.copy()
        self._shown = np.full_like(self.labels, -2)
        self._likeness = LikenessMap(self.labels.shape)
        self._labelling = self.joined.labelling

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the preview, px."""
        return self.joined.canvas.shape

    @property
    def layers(self) -> Sequence[ts.Layer]:
        """The pictures as they lie on the preview, with their tones matched."""
        return self.joined.canvas.cut_open().layers

    @property
    def can(self) -> dict[str, int]:
        """How many gestures can be undone and redone."""
        return {"undo": len(self._past), "redo": len(self._future)}

    def scene(self) -> dict[str, Any]:
        """Return what a page has to know besides the pixels."""
        canvas = self.joined.canvas.cut_open()
        model = None if self.job.placement is None else self.job.placement.model
        return {
            "shape": list(self.shape),
            "round": self.joined.canvas.period is not None,
            "scale": self.scale,
            "model": model,
            "blends": self.blends,
            "settings": self.work.settings,
            "warnings": self.warnings,
            "layers": [
                {"name": layer.name, "box": [place.left, place.top, place.shape[1], place.shape[0]]}
                for layer, place in zip(canvas.layers, canvas.places, strict=True)
            ],
        }

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
        labels, lost = self._solved([*self._strokes(), made], whole=False)
        return self._change(labels, lost=lost)

    def paint(self, strokes: Sequence[Mapping[str, Any]]) -> bool:
        """Keep strokes as one gesture and write them to disk; False if no picture sees them."""
        made = [one for one in map(self._stroke, strokes) if one is not None]
        if made:
            self._keep([*self.gestures, made])
        return bool(made)

    def erase(self, points: Floats, radius: float) -> bool:
        """Rub out strokes under a stroke of the canvas; False if there are none."""
        changed, left = False, list[list[Stroke]]()
        for gesture in self.gestures:
            gone = [self._rubbed(stroke, points, radius) for stroke in gesture]
            changed |= any(one.any() for one in gone)
            rest = without(gesture, gone)
            left += [rest] if rest else []
        if changed:
            self._keep(left)
        return changed

    def settle(self) -> Change:
        """Search the whole label map again after a gesture that was kept."""
        self.labels, lost = self._solved(self._strokes(), whole=True)
        self.work.folder.mkdir(parents=True, exist_ok=True)
        atomic_write(self.work.labels, zlib.compress(self.labels.tobytes(), 1), force=True)
        return self._change(self.labels, lost=lost)

    def undo(self) -> Change:
        """Take the last gesture back."""
        return self._step(self._past, self._future)

    def redo(self) -> Change:
        """Repeat the gesture that was taken back last."""
        return self._step(self._future, self._past)

    def thing_at(self, x: float, y: float, layer: int) -> list[dict[str, Any]]:
        """Return strokes that take all of what differs at a point from a picture that does not show there.

        Parameters
        ----------
        x, y : float
            A point of the canvas, px.
        layer : int
            The picture to take it from.

        Returns
        -------
        list of dict
            Strokes for :meth:`paint`; none if both pictures show the same there.
        """
        row, column = int(y), int(x)
        box = Box(row, column, row + 1, column + 1).grown(_AROUND_TAP).shared(self._labelling.canvas)
        shows = int(self.labels[row, column])
        cost = self._labelling.costs.get((min(shows, layer), max(shows, layer)))
        if shows < 0 or shows == layer or cost is None:
            return []
        right, down = cost.on(box)
        differs = np.zeros(box.shape, np.float32)
        differs[:, :-1] += right
        differs[:, 1:] += right
        differs[:-1] += down
        differs[1:] += down
        differs = scipy.ndimage.gaussian_filter(differs / 4, 2.0)
        differs[~cost.shared(box)] = 0
        thing = _blob(differs, (row - box.top, column - box.left))
        if thing is None:
            return []
        return [
            {
                "kind": "show",
                "layer": layer,
                "radius": radius + _RIM_PX / 2,
                "points": [[x + box.left, y + box.top]],
            }
            for x, y, radius in discs_of(thing)
        ]

    def other_way(self, x: float, y: float) -> list[dict[str, Any]]:
        """Return a stroke that keeps seams away from a place, for :meth:`paint`."""
        layer = int(self.labels[min(int(y), self.shape[0] - 1), min(int(x), self.shape[1] - 1)])
        stroke = {"kind": "away", "layer": max(layer, 0), "radius": _OTHER_WAY_PX, "points": [[x, y]]}
        return [stroke]

    def worst(self) -> list[Place]:
        """Return the worst places along the seams, and those that were and are no longer."""
        self.places = self._likeness.worst(self.places)
        return self.places

    def blended(self, box: Box) -> np.ndarray:
        """Return the pixels of a box of the canvas as they are joined."""
        solution = dataclasses.replace(self.joined.solution, labels=self.labels)
        shown = dataclasses.replace(self.joined, solution=solution)
        if shown.blending.needs_potential:
            from toposeam.layers.blending.blend import blending_of

            shown = dataclasses.replace(shown, blending=blending_of(shown.blending.without_potential, None))
        return np.asarray(shown.window(box.slices[0], box.slices[1])[0])

    def drawn(self) -> list[dict[str, Any]]:
        """Return the strokes as they lie on the canvas, to be drawn."""
        found = []
        for stroke in self._strokes():
            points, radius = on_canvas(stroke, self.transforms[stroke.layer])
            if len(points):
                found.append(
                    {
                        "kind": stroke.kind,
                        "layer": stroke.layer,
                        "radius": round(radius, 1),
                        "points": np.round(points, 1).tolist(),
                    }
                )
        return found

    def _strokes(self) -> list[Stroke]:
        return [stroke for gesture in self.gestures for stroke in gesture]

    def _stroke(self, stroke: Mapping[str, Any]) -> Stroke | None:
        layer = int(stroke["layer"])
        points = np.array(stroke["points"], float)
        return on_picture(points, float(stroke["radius"]), layer, self.transforms[layer], stroke["kind"])

    def _rubbed(self, stroke: Stroke, points: Floats, radius: float) -> Mask:
        """(n,) bool: which points of a stroke lie under a stroke of the canvas."""
        own, width = on_canvas(stroke, self.transforms[stroke.layer])
        if len(own) != len(stroke.points):
            return np.zeros(len(stroke.points), bool)
        distance = np.linalg.norm(own[:, np.newaxis] - points[np.newaxis], axis=2).min(axis=1)
        return np.asarray(distance < radius + width / 2)

    def _keep(self, gestures: list[list[Stroke]]) -> None:
        self._past.append(_State(self.gestures, zlib.compress(self.labels.tobytes(), 1)))
        self._future.clear()
        self.gestures = gestures
        self._save()

    def _step(self, source: list[_State], target: list[_State]) -> Change:
        if source:
            state = source.pop()
            target.append(_State(self.gestures, zlib.compress(self.labels.tobytes(), 1)))
            self.gestures = state.gestures
            self.labels = _unpacked(state.labels, self.shape)
            self._save()
            atomic_write(self.work.labels, state.labels, force=True)
        return self._change(self.labels)

    def _solved(self, strokes: Sequence[Stroke], *, whole: bool) -> tuple[Labels, bool]:
        problem, lost = apply_strokes(self._labelling, strokes, self.transforms)
        shows = dataclasses.replace(self.joined.solution, labels=self.labels)
        found = recut(problem, shows, whole=whole)
        return np.asarray(found.labels), len(strokes) - 1 in lost

    def _change(self, labels: Labels, *, lost: bool = False) -> Change:
        """Return how labels differ from those that the page shows, and take them as shown."""
        differs = labels != self._shown
        if not differs.any():
            none = Box(0, 0, 0, 0)
            return Change(none, np.zeros((0, 0), np.uint8), none, np.zeros((0, 0), np.uint8), lost)
        rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
        box = Box(int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1)
        squares = self._likeness.update(self._labelling, labels, box)
        self._shown = labels.copy()
        return Change(
            box,
            (labels[box.slices] + 1).astype(np.uint8),
            squares,
            np.ascontiguousarray(self._likeness.squares[squares.slices]),
            lost,
        )

    def _save(self) -> None:
        self.work.gestures = [[_plain(stroke) for stroke in gesture] for gesture in self.gestures]
        self.work.save()

    def _resume(self) -> None:
        """Repeat the strokes of the work; the label map is read where it was written."""
        known = [
            [_of_plain(one) for one in gesture if 0 <= one["layer"] < len(self.job.layers)]
            for gesture in self.work.gestures
        ]
        self.gestures = [gesture for gesture in known if gesture]
        if not self.gestures:
            return
        blank = zlib.compress(self._first.tobytes(), 1)
        self._past = [_State(self.gestures[:k], blank) for k in range(len(self.gestures))]
        try:
            self.labels = _unpacked(self.work.labels.read_bytes(), self.shape)
        except (OSError, ValueError, zlib.error):
            self.settle()
            self._shown = np.full_like(self.labels, -2)

    def _write_places(self) -> None:
        """Write where the pictures lie, so that they need not be placed again."""
        if self.work.layout.exists() or len(self.job.files) != len(self.job.layers) or self.job.placement is None:
            return
        layers = [
            LayoutLayer(file=file, name=layer.name, transform=transform)
            for file, layer, transform in zip(
                self.job.files, self.job.layers, self.job.transforms, strict=True
            )
        ]
        self.work.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        text = layout_text(self.work.folder, Layout(layers=tuple(layers), wrap=self.job.wrap))
        atomic_write(self.work.layout, text, force=True)


def _given(sources: Sequence[Path], settings: Mapping[str, str]) -> dict[str, Any]:
    """Return the options of ``toposeam stitch`` for some pictures."""
    command = load("stitch")
    words = [word for name, value in settings.items() for word in words_of(name, value)]
    context = command.make_context("stitch", [*map(str, sources), "-o", "joined.png", *words])
    return dict(context.params)


def words_of(name: str, value: str) -> list[str]:
    """Return an option of ``toposeam stitch`` as it is written."""
    if name == "level":
        return [] if value == "yes" else ["--no-level"]
    if name == "tones":
        return {"none": ["--as", "scans"], "shading": ["--match-shading"], "gains": ["--match-tones"]}[value]
    return [f"--{name}", value]


def _check_count(count: int) -> None:
    if count > MOST_PICTURES:
        raise ts.OptionError(
            f"{count} pictures are more than the page shows, which is {MOST_PICTURES}; join them by toposeam "
            "stitch, or open fewer"
        )


def _blob(differs: np.ndarray, at: tuple[int, int]) -> Mask | None:
    """Find what differs at a point, or the nearest such thing; None if nothing does nearby."""
    rows, columns = np.indices(differs.shape, sparse=True)
    near = (rows - at[0]) ** 2 + (columns - at[1]) ** 2 <= _NEAR_TAP**2
    least = _DIFFERENT
    while True:
        mask = differs > least
        piece, _ = scipy.ndimage.label(scipy.ndimage.binary_closing(np.pad(mask, 8), iterations=4)[8:-8, 8:-8])
        there = near & (piece > 0)
        if not there.any():
            return None
        ys, xs = np.nonzero(there)
        first = int(np.argmin((ys - at[0]) ** 2 + (xs - at[1]) ** 2))
        thing = piece == piece[ys[first], xs[first]]
        if np.count_nonzero(thing) <= _LARGEST_THING * thing.size:
            break
        least *= 1.6
    grown = scipy.ndimage.binary_dilation(scipy.ndimage.binary_fill_holes(thing), iterations=_RIM_PX)
    return np.asarray(grown)


def _packed(labels: Labels) -> bytes:
    return (labels + 1).astype(np.uint8).tobytes()


def _unpacked(data: bytes, shape: tuple[int, int]) -> Labels:
    """Return a label map from bytes; they are refused if they are those of another canvas."""
    return np.frombuffer(zlib.decompress(data), np.int16).reshape(shape).copy()


def _plain(stroke: Stroke) -> dict[str, Any]:
    points = np.round(np.asarray(stroke.points, float), 2).tolist()
    return {
        "kind": stroke.kind,
        "layer": stroke.layer,
        "radius": round(float(stroke.radius), 2),
        "points": points,
    }


def _of_plain(values: Mapping[str, Any]) -> Stroke:
    return Stroke(np.array(values["points"], float), values["radius"], values["layer"], values["kind"])
