"""Find the label map of a canvas: by one seam for two layers, by rounds of expansions for more, or from
masks.

Two layers are left to the engines of :mod:`toposeam.seam`, the best of which find the optimal seam.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels, Mask
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_mask
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.cylinder import turned_map
from toposeam.layers.canvas.layer import Box, Layer, cut
from toposeam.layers.canvas.painting import channel_count
from toposeam.layers.canvas.tile_map import blocks, made_map, new_map
from toposeam.layers.composite.options import StitchOptions
from toposeam.layers.composite.seams import KnownSeams, Seams, SeamsOfMap
from toposeam.layers.composite.two_layers import divided, join, order_of
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.labelling.label_map import LabelMap, Pair
from toposeam.layers.labelling.posing import CORE, pose_labelling
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.search.multilevel import minimise, recut
from toposeam.layers.search.options import SearchOptions, search_options
from toposeam.layers.search.problem import Problem
from toposeam.seam.find import Method, method_options
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.posing import as_weights
from toposeam.vector.svg import SvgSeam

#: A round canvas is searched again in a band round its cut. The band reaches 1 / _BAND_SHARE of the width to
#: either side, so that the seams near the cut can move; it holds at most _BAND_PIXELS pixels, which bounds
#: the time, but reaches at least _LEAST_BAND_HALF px to either side.
_BAND_SHARE, _BAND_PIXELS, _LEAST_BAND_HALF = 16, 150_000, 32


@dataclass(frozen=True, slots=True, eq=False)
class SeamSearch:
    """The options of a search for seams, with the defaults filled in for the number of layers."""

    options: StitchOptions
    method: Method
    match: MatchCost
    #: The method's own options, by name.
    settings: Mapping[str, Any]
    thorough: SearchOptions

    @classmethod
    def of(cls, options: StitchOptions, count: int) -> SeamSearch:
        """Fill in the options that depend on the number of layers."""
        method = options.method_of(count)
        own = method_options(method, {}, options.options)
        return cls(
            options=options,
            method=method,
            match=options.match_of(method),
            settings={} if own is None else dataclasses.asdict(own),
            thorough=search_options(options.effort, count),
        )

    def problem(self, labelling: Labelling) -> Problem:
        """Pose a labelling as a problem to be solved."""
        steps = Progressed(self.options.progress)
        return Problem.of(labelling, self.method, self.settings, self.thorough, self.options.executor, steps)

    def common(self, canvas: Canvas) -> dict[str, Any]:
        """Return the options of :func:`toposeam.find_seam` that are the same for all pairs of layers."""
        core = CORE if self.options.core is None else self.options.core
        white = canvas.layers[0].data_range
        return {"cost": self.match, "core": core, "speck": self.options.speck, "data_range": white}

    def pose(self, canvas: Canvas, **more: Any) -> Labelling:
        """Pose the labelling problem of a flat canvas."""
        options = self.options
        return pose_labelling(canvas, core=options.core, speck=options.speck, match=self.match, **more)

    def recut(
        self, labelling: Labelling, label_map: LabelMap, opened: Mask, fixed: Labels | None = None
    ) -> LabelMap:
        """Search a part of a label map again, by the same method."""
        solver = self.problem(labelling).solver
        return recut(labelling, label_map, opened, fixed, solver=solver, search=self.thorough)

    def recorded(self) -> dict[str, Any]:
        """Return the settings that are recorded with every seam."""
        return {
            "core": self.options.core,
            "speck": self.options.speck,
            **dataclasses.asdict(self.match),
        }


def check_alike(layers: Sequence[Layer]) -> None:
    """Refuse layers that differ in dtype, white level or number of channels.

    Raises
    ------
    ImageError
    """
    dtypes = {layer.image.dtype for layer in layers}
    if len(dtypes) > 1:
        raise ImageError(
            "the layers have dtypes {dtypes}; convert them to one",
            kind="dtype",
            dtypes=tuple(sorted(map(str, dtypes))),
        )
    if len({layer.data_range for layer in layers}) > 1:
        raise ImageError(
            "the layers have different values of {parameter}; give them the same white",
            kind="white",
            parameter=Term("data_range"),
        )
    channel_count(layers)


def find_label_map(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam]
) -> tuple[LabelMap, Seams]:
    """Find the label map of a canvas and its seams; `paths` are seams that are given.

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError
    """
    options = search.options
    if canvas.period is not None:
        return _by_cutting_open(canvas, search, paths)
    maps = {
        "weight": None if options.weight is None else as_weights(options.weight, canvas.shape),
        "avoid": None if options.avoid is None else as_mask(options.avoid, canvas.shape, "avoid"),
    }
    find = _by_one_seam if len(canvas.layers) == 2 else _by_rounds
    return find(canvas, search, paths, maps)


def _by_one_seam(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam], maps: Mapping[str, Any]
) -> tuple[LabelMap, Seams]:
    pair, options = (0, 1), search.options
    settings = {
        "method": search.method,
        "record_frames": options.record_frames,
        "progress": options.progress,
        **search.settings,
    }
    seam, labels = join(canvas, {**search.common(canvas), **maps}, settings, paths.get(pair))
    found = LabelMap(labels=labels, method=seam.method, seconds=seam.seconds)
    return found, KnownSeams({pair: seam}, partial(search.pose, canvas, **maps))


def _by_rounds(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam], maps: Mapping[str, Any]
) -> tuple[LabelMap, Seams]:
    common = search.common(canvas)
    given = [(pair, divided(canvas, pair, drawing, common)) for pair, drawing in paths.items()]
    labelling = search.pose(canvas, given=given, **maps)
    found = minimise(search.problem(labelling), order_of(canvas), search.options.max_rounds)
    seams = SeamsOfMap(labelling, found, list(paths), search.recorded())
    seams.check(search.options.executor)
    return found, seams


def _by_cutting_open(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam]
) -> tuple[LabelMap, Seams]:
    """Search a round canvas as a flat one, cut open at the column on which fewest layers lie.

    If one layer lies at the cut, no seam crosses it. If several do, the labels in a band round the cut are
    searched again, and all others stay.
    """
    options, period = search.options, canvas.shape[1]
    if options.weight is not None or options.avoid is not None or paths:
        raise OptionError(
            "{wrap} goes without {weight}, {avoid} and {paths}; leave them out",
            kind="conflict",
            paths=Term("use_path", "paths"),
        )
    half = max(8, min(period // _BAND_SHARE, max(_LEAST_BAND_HALF, _BAND_PIXELS // (2 * canvas.shape[0]))))
    column, beside = canvas.sparsest_column(away=half)
    opened = canvas.cut_open(column)
    labelling = search.pose(opened)
    found = minimise(search.problem(labelling), order_of(opened), options.max_rounds)
    if column:
        labels = turned_map(found.labels, period, -column, period)
        found, labelling = dataclasses.replace(found, labels=labels), search.pose(canvas.cut_open())
    if beside > 1:
        band = _columns(canvas.shape, column - half, column + half)
        found = search.recut(labelling, found, band)
    return found, SeamsOfMap(labelling, found, (), search.recorded())


def _columns(shape: tuple[int, int], left: int, right: int) -> Mask:
    """Return an (H, W) bool map that is True in a range of columns."""

    def values(box: Box) -> Mask:
        columns = np.arange(box.left, box.right)
        return np.broadcast_to((columns >= left) & (columns < right), box.shape)

    return made_map(shape, bool, values)


def label_map_of_masks(canvas: Canvas, masks: Sequence[npt.ArrayLike] | None) -> LabelMap:
    """Compute the label map of given masks, of which later ones win.

    `masks` are on the canvas; None stands for masks that are True everywhere. A pixel that no mask claims
    shows the first layer that has pixels there.
    """
    flat = canvas.cut_open()
    labels: Labels = new_map(flat.shape, -1, np.int16)
    for box in blocks(flat.box):
        shows = np.full(box.shape, -1, np.int16)
        for index, (place, cover) in enumerate(zip(flat.places, flat.covers, strict=True)):
            here = cut(cover, place, box)
            wanted = True if masks is None else np.asarray(masks[index])[box.slices] != 0
            shows[here & (wanted | (shows < 0))] = index
        labels[box.slices] = shows
    return LabelMap(labels=labels, method="masks")
