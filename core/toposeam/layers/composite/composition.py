"""The result of joining layers: a picture of a canvas, whole or by windows, with its seams and figures."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Image, Labels, Mask
from toposeam.images import Windows, full_scale
from toposeam.layers.blending.blend import Blending, Fading
from toposeam.layers.canvas.canvas import Canvas, channel_count
from toposeam.layers.canvas.layer import Box, Layer, cut
from toposeam.layers.canvas.tile_map import BLOCK, blocks, dense, uniform
from toposeam.layers.composite.painter import Filling, Painter
from toposeam.layers.composite.seams import KnownSeams, SeamFigures, SeamOutline, with_steps
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.label_map import LabelMap, Pair
from toposeam.picture_files import PictureResult
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import Verdict, worst_of
from toposeam.sentence import counted

if TYPE_CHECKING:
    from toposeam.layers.composite.seams_of_map import SeamsOfMap
    from toposeam.layers.composite.sinks import Sink
    from toposeam.layers.labelling.problem import Labelling
    from toposeam.layers.registration.placement import Placement

#: Width of a rendered window, in blocks of 1024 px; it is one block high.
WINDOW_BLOCKS = 4
#: Distance from a seam, px, of points that it passes.
_BESIDE = 16


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Composition(PictureResult):
    """A label map applied to the layers of a canvas: the picture, whole or by windows, and its seams.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> joined = ts.stitch(ts.layers.overlapping(a, b, overlap=10))
    >>> joined.image.shape, len(joined.masks), joined.pairs
    ((30, 70), 2, ((0, 1),))
    >>> image, alpha = joined.window(slice(0, 8), slice(60, 70))
    >>> bool((image == b[:8, 30:]).all()), alpha.min()
    (True, np.float64(1.0))
    """

    #: The layers, with their tones matched, in their places.
    canvas: Canvas
    #: The label map of the canvas, with the engine, rounds and seconds of its search.
    solution: LabelMap
    #: The blend that is applied across the seams.
    blending: Blending
    #: The largest displacement by which layers were bent to meet at the seams, px.
    bent: float = 0.0
    _seams: KnownSeams | SeamsOfMap
    #: The box of the canvas that the picture shows; it may reach beyond the canvas. None for all of it.
    _view: Box | None = None
    #: What was filled, as no layer shows there, on the canvas.
    patches: tuple[Filling, ...] = ()

    def __repr__(self) -> str:
        height, width = self.shape
        seams = counted(len(self.pairs), "seam")
        return f"Composition({len(self.layers)} layers, {width} × {height} px, {seams})"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Image:
        """Return the picture, so that NumPy and matplotlib take the composition as one."""
        return np.array(self.image, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        from toposeam.display import to_png
        from toposeam.seam.result.drawing import draw_seams

        return to_png(draw_seams(self.image, self.seams) if self._view is None else self.image, self.alpha)

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers, with their tones matched."""
        return tuple(self.canvas.layers)

    @property
    def names(self) -> tuple[str, ...]:
        """The layers' names."""
        return self.canvas.names

    @property
    def view(self) -> Box:
        """The box of the canvas that the picture shows."""
        return self.canvas.box if self._view is None else self._view

    @property
    def cropped(self) -> tuple[int, int, int, int] | None:
        """(left, top, width, height) of the view on the canvas, px; None if it is the whole canvas."""
        view = self.view
        return None if view == self.canvas.box else (view.left, view.top, view.shape[1], view.shape[0])

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, px."""
        return self.view.shape

    @property
    def origin(self) -> tuple[int, int]:
        """(x, y) of the picture's upper left pixel in the layers' coordinates."""
        return self.canvas.origin[0] + self.view.left, self.canvas.origin[1] + self.view.top

    @property
    def period(self) -> int | None:
        """The canvas's width, px, if it goes all the way round."""
        return self.canvas.period

    def crop(self, box: Box | tuple[int, int, int, int]) -> Composition:
        """Return a composition that shows only a box of this picture.

        `box` is (top, left, bottom, right) in px of the picture; bottom and right are exclusive. Beyond the
        canvas the result is transparent.
        """
        view = Box(*box).moved(*self.view[:2])
        return self._with_painter(dataclasses.replace(self, _view=view))

    def patched(self, patches: Sequence[Filling]) -> Composition:
        """Return a composition with pixels where no layer shows."""
        return self._with_painter(dataclasses.replace(self, patches=(*self.patches, *patches)))

    def _with_painter(self, other: Composition) -> Composition:
        """Hand on what has been computed of the same canvas, label map and blend."""
        if "_painter" in self.__dict__:
            other.__dict__["_painter"] = self._painter
        if "_picture" in self.__dict__ and other.view.shared(self.view) == other.view:
            part = other.view.within(self.view)
            image, alpha = (each[part].copy() for each in self._picture)
            for patch in other.patches:
                patch.onto(other.view, image, alpha)
            other.__dict__["_picture"] = image, alpha
        return other

    def moved(self, right: int, down: int) -> Composition:
        """Return the composition with its canvas moved right and down by px."""
        return dataclasses.replace(self, canvas=self.canvas.moved(right, down))

    @property
    def image(self) -> Image:
        """(H, W) or (H, W, C) array in the layers' dtype; 0 where no layer has pixels."""
        return self._picture[0]

    @cached_property
    def alpha(self) -> Image | None:
        """(H, W) opacity in the layers' dtype, up to full scale; None if every pixel is opaque."""
        alpha = self._picture[1]
        return None if alpha.min() == full_scale(alpha.dtype) else alpha

    @cached_property
    def _picture(self) -> tuple[Image, Image]:
        return self.window(slice(None), slice(None))

    @cached_property
    def label_map(self) -> Labels:
        """(H, W) int16 array: the number of the layer that shows, -1 where none has pixels."""
        return dense(self.labels(slice(None), slice(None)))

    @property
    def masks(self) -> tuple[Mask, ...]:
        """One (H, W) bool mask per layer, True where it shows.

        The masks do not overlap; their union is every pixel that some layer covers.
        """
        return tuple(self.label_map == index for index in range(len(self.names)))

    @cached_property
    def shown(self) -> tuple[int, ...]:
        """The number of pixels of the picture that show each layer."""
        return self._shown_in(self.view.shared(self.canvas.box))

    @cached_property
    def kept(self) -> float:
        """The share of the pixels that layers show on the canvas that the picture shows, in [0, 1]."""
        whole = sum(self._shown_in(self.canvas.box))
        return sum(self.shown) / whole if whole else 1.0

    @cached_property
    def filled(self) -> float:
        """The share of the picture's pixels that were filled, as no layer shows there, in [0, 1]."""
        height, width = self.shape
        parts = ((patch, patch.box.shared(self.view)) for patch in self.patches)
        count = sum(
            int(patch.where[part.within(patch.box)].sum()) for patch, part in parts if all(part.shape)
        )
        return count / max(1, height * width)

    def _shown_in(self, whole: Box) -> tuple[int, ...]:
        count = np.zeros(len(self.names) + 1, np.int64)
        labels = self.solution.labels
        for box in blocks(whole):
            value = uniform(labels, box)
            if value is not None:
                count[value + 1] += box.shape[0] * box.shape[1]
            else:
                count += np.bincount(labels[box.slices].ravel() + 1, minlength=len(count))
        return tuple(count[1:].tolist())

    @property
    def hidden(self) -> tuple[int, ...]:
        """The numbers of the layers that show at no pixel, since other layers cover them at less cost."""
        return tuple(index for index, count in enumerate(self.shown) if not count)

    @property
    def labelling(self) -> Labelling:
        """The labelling problem that the label map solves, for :func:`toposeam.layers.recut`."""
        return self._seams.labelling

    @property
    def rounds(self) -> int:
        """The number of rounds of expansions that were made, 0 for two layers."""
        return self.solution.rounds

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The pair of layers of each seam, by number; ``b`` of the seam is the second one."""
        return tuple(self._seams.pairs)

    @cached_property
    def seams(self) -> tuple[Seam, ...]:
        """One seam per pair of layers that adjoin where both have pixels, on the canvas.

        For more than two layers they are computed when this is first read.
        """
        return tuple(self._seams.seam(pair) for pair in self.pairs)

    @cached_property
    def outlines(self) -> tuple[SeamOutline, ...]:
        """The seams without their problems, which together may be larger than memory."""
        return tuple(SeamOutline.of(pair, self._seams.seam(pair, beside=True)) for pair in self.pairs)

    def figures(self, executor: Executor | None = None) -> Mapping[Pair, SeamFigures]:
        """Compute length, cost and verdict of each seam, without making the seams.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            Evaluates the costs along the seams, one seam a task.

        Examples
        --------
        >>> import numpy as np, toposeam as ts
        >>> a, b = np.random.default_rng(0).random((2, 30, 40))
        >>> figures = ts.stitch(ts.layers.overlapping(a, b, overlap=10)).figures()
        >>> figures[0, 1].length >= 30
        True
        """
        return self._seams.figures(executor)

    @property
    def cost(self) -> float:
        """Σ M over all seams."""
        return sum(figures.cost for figures in self.figures().values())

    def verdicts(
        self, executor: Executor | None = None, window: Callable[[slice, slice], Image] | None = None
    ) -> Mapping[Pair, Verdict]:
        """Judge each seam by the steps of tone, hue and grain, and the broken lines and things, that are
        shown.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            As for :meth:`figures`.
        window : callable, optional
            Returns the pixels of rows and columns of the picture, if it has been rendered already.

        Returns
        -------
        mapping of (int, int) to Verdict
            Places are on the canvas. Empty unless the law of the match cost is "natural".
        """
        if "_verdicts" not in self.__dict__:
            verdicts = {pair: figures.verdict for pair, figures in self.figures(executor).items()}
            known = {pair: verdict for pair, verdict in verdicts.items() if verdict is not None}
            stored = any(isinstance(layer.image, Windows) for layer in self.layers)
            window = window or (lambda *at: self.window(*at)[0] if stored else self.image[at])
            judged = with_steps(self.canvas.cut_open(), self.solution.labels, self.view, window, known)
            self.__dict__["_verdicts"] = judged if len(known) == len(verdicts) else {}
        found: Mapping[Pair, Verdict] = self.__dict__["_verdicts"]
        return found

    @property
    def verdict(self) -> Verdict | None:
        """The verdict on the most visible seam; None unless the law of the match cost is "natural"."""
        return worst_of(self.verdicts().values())

    def misfits(
        self,
        placement: Placement,
        onto: Callable[[Floats], Floats] | None = None,
        executor: Executor | None = None,
    ) -> list[tuple[Pair, float, tuple[int, int]]]:
        """Find where seams pass points at which the pictures of a placement do not meet.

        Places where the seam is unlikely to be noticed are left out.

        Parameters
        ----------
        placement : Placement
            Of the layers.
        onto : callable, optional
            From (M, 2) points x, y of its canvas to those of the layers, if these were moved or the boundary
            was bent.
        executor : concurrent.futures.Executor, optional
            As for :meth:`figures`.

        Returns
        -------
        list of ((int, int), float, (int, int))
            A pair of layers, how far their points are apart, px, and x and y in the picture; at most one for
            each pair, the farthest first.
        """
        verdicts, (height, width) = self.verdicts(executor), self.shape
        found = list[tuple[Pair, float, tuple[int, int]]]()
        for pair, residual in placement.residuals.items():
            if pair not in self.pairs:
                continue
            verdict, apart = verdicts.get(pair), np.array(residual.apart).reshape(-1, 3)
            verdict = verdict and verdict.inside(self.cropped)
            at = apart[:, :2] if onto is None else onto(apart[:, :2])
            at = np.nan_to_num(at - self.origin, nan=-1).round().astype(int)
            inside = ((at >= 0) & (at < (width, height))).all(axis=1)
            for (x, y), off in zip(at[inside].tolist(), apart[inside, 2].tolist(), strict=True):
                rows, columns = (slice(max(0, one - _BESIDE), one + _BESIDE + 1) for one in (y, x))
                if verdict is not None and not verdict.is_noticed_near(x, y):
                    continue
                if set(pair) <= set(np.unique(np.asarray(self.labels(rows, columns))).tolist()):
                    found.append((pair, off, (x, y)))
                    break
        return sorted(found, key=lambda misfit: -misfit[1])

    def summary(self, *, optima: bool = True) -> dict[str, Any]:
        """Return the composition in numbers, as JSON has them (:mod:`toposeam.layers.composite.summary`).

        Parameters
        ----------
        optima : bool
            Whether to compute the least possible cost of each seam, which can take longer than finding the
            seams; otherwise these entries are None.
        """
        from toposeam.layers.composite.summary import summary_of

        return summary_of(self, optima=optima)

    def to_svg(self, path: str | Path | None = None) -> str:
        """Return all seams as one SVG document that lies on the picture; each path has the names of its two
        layers, as ``"first.png : second.png"``. Its coordinates are those of the canvas.

        Parameters
        ----------
        path : str or Path, optional
            Also write the document there (an existing file is replaced).
        """
        from toposeam.layers.composite.summary import seams_svg

        text = seams_svg(self.outlines, self.names, self.canvas.box, self.view, self.rounds)
        if path is not None:
            from toposeam.saving import save

            save(path, text)
        return text

    def labels(self, rows: slice, columns: slice) -> Labels:
        """(h, w) int16 array: the number of the layer that shows in a window of the picture, -1 for none."""
        box, labels = self._window(rows, columns), self.solution.labels
        inside = box.shared(self.canvas.box)
        if inside == box:
            found: Labels = labels[box.slices]
            return found.copy() if isinstance(labels, np.ndarray) else found  # a TileMap returns copies
        return cut(labels, self.canvas.box, box, fill=-1)

    def window(self, rows: slice, columns: slice) -> tuple[Image, Image]:
        """Return the picture in a window, (h, w[, C]), and its opacity, (h, w), both in the layers' dtype.

        Both are 0 where no layer has pixels. Windows of the whole canvas whose edges are multiples of 1024 px
        are the fastest. The blend "gradient" cannot be computed by windows: the first call computes the whole
        picture.
        """
        return _painted(self._painter, self.patches, self._window(rows, columns))

    def render(
        self,
        sink: Sink,
        *,
        executor: Executor | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Write the picture to a sink, window by window.

        Parameters
        ----------
        sink : Sink
        executor : concurrent.futures.Executor, optional
            Paints and writes the windows; the result is the same. The layers are pickled for it: their
            images should be Windows that pickle small, such as those that hold a file's name.
        progress : callable, optional
            Called with the fraction of the work that is done, in [0, 1].
        """
        painter, channels = self._painter, self._painter.channels
        workers = None if self.blending.needs_whole else executor
        boxes = list(self._windows())
        sink.open(self.shape if channels is None else (*self.shape, channels), self.layers[0].image.dtype)

        def item(box: Box) -> tuple[Painter, Sequence[Filling], Box, Box, Sink]:
            on_canvas = box.moved(*self.view[:2])
            part = painter if workers is None else painter.part(on_canvas.shared(painter.box))
            patches = [patch for patch in self.patches if all(patch.box.shared(on_canvas).shape)]
            return part, patches, on_canvas, box, sink

        for number, (box, answer) in enumerate(
            zip(boxes, results(workers, _rendered, map(item, boxes)), strict=True), start=1
        ):
            sink.take(box, answer)
            if progress is not None:
                progress(number / len(boxes))
        sink.close()

    def _windows(self) -> Iterator[Box]:
        """Yield the boxes in which the picture is rendered, row by row."""
        height, width = self.shape
        for top in range(0, height, BLOCK):
            for left in range(0, width, WINDOW_BLOCKS * BLOCK):
                yield Box(top, left, top + BLOCK, left + WINDOW_BLOCKS * BLOCK).shared(
                    Box(0, 0, height, width)
                )

    def _window(self, rows: slice, columns: slice) -> Box:
        """Convert a window of the picture to a box of the canvas."""
        (top, bottom), (left, right) = (
            part.indices(side)[:2] for part, side in zip((rows, columns), self.shape, strict=True)
        )
        return Box(top, left, max(top, bottom), max(left, right)).moved(*self.view[:2])

    @cached_property
    def _painter(self) -> Painter:
        channels = channel_count(self.layers)
        return Painter.of(self.canvas, self.solution.labels, self.blending, channels, self._fadings)

    def _fadings(self) -> list[Fading]:
        """Return the label potentials of all seams, for the blend."""
        return [Fading.of(pair, self._seams.seam(pair)) for pair in self.pairs]


def _painted(painter: Painter, patches: Sequence[Filling], box: Box) -> tuple[Image, Image]:
    """Paint a box of the canvas; return its pixels and opacity, 0 beyond the canvas."""
    inside = box.shared(painter.box)
    if inside == box:
        image, alpha = painter.window(box)
    else:
        part, opacity = painter.window(inside if all(inside.shape) else Box(0, 0, 0, 0))
        image, alpha = np.zeros((*box.shape, *part.shape[2:]), part.dtype), np.zeros(box.shape, part.dtype)
        if part.size:
            image[inside.within(box)], alpha[inside.within(box)] = part, opacity
    for patch in patches:
        patch.onto(box, image, alpha)
    return image, alpha


def _rendered(item: tuple[Painter, Sequence[Filling], Box, Box, Sink]) -> Any:
    """Paint a box of the canvas, write it to the sink, and return the sink's answer."""
    painter, patches, on_canvas, box, sink = item
    return sink.write(box, *_painted(painter, patches, on_canvas))
