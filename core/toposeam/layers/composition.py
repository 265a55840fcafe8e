"""Placed layers, and which of them shows where: a composite before it is a picture.

The picture is made window by window, and nothing as large as the canvas is held but the label map
(:mod:`toposeam.layers.maps`): layers, too, are read where they are looked at (:class:`toposeam.Windows`), and
seams are made one after another. :func:`toposeam.stitch` is the same for pictures that fit into memory.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_kind, check_whole, options_from
from toposeam.errors import ImageError, OptionError, OverlapError, PathError
from toposeam.images import Image, Mask, as_mask
from toposeam.layers.blend import Blend, Blender, Placed, check_blend
from toposeam.layers.labelling import Pair
from toposeam.layers.layer import MAX_MEGAPIXELS, Box, Extent, Layer, check_layers, common_canvas, cut
from toposeam.layers.maps import BLOCK, blocks, dense, new_map
from toposeam.layers.painting import LabelMap, channel_count, paint
from toposeam.layers.posing import exclusive_covers, meets, pose_labelling
from toposeam.layers.rounds import Rounds, best_rounds
from toposeam.layers.tones import match_tones as matched
from toposeam.optimize.history import Termination
from toposeam.seam.find import Method, find_seam, method_options
from toposeam.seam.heat import HeatOptions
from toposeam.seam.match_cost import MatchCost, match_options
from toposeam.seam.posing import as_weights
from toposeam.seam.seam import Seam, apply_paths
from toposeam.seam.thesis_options import ThesisOptions
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg import SvgSeam

#: Swap rounds at most; three are typical.
MAX_ROUNDS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """What a seam looks like and how it was found."""

    pair: Pair
    paths: tuple[Polyline, ...]
    cost: float
    method: str
    termination: Termination
    iterations: int
    seconds: float
    settings: Mapping[str, Any]

    @property
    def length(self) -> float:
        """Length of all its lines, px."""
        return sum(line.length for line in self.paths)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Composition:
    """Which layer shows where, and the picture of that by windows.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> composed = ts.compose(ts.overlapping(a, b, overlap=10))
    >>> composed.shape, composed.pairs
    ((30, 70), ((0, 1),))
    >>> image, alpha = composed.window(slice(0, 8), slice(60, 70))
    >>> bool((image == b[:8, 30:]).all()), alpha.min()
    (True, np.float64(1.0))
    """

    #: The layers as they show, after their tones were matched.
    layers: Sequence[Layer]
    #: Where the canvas lies, and its size.
    canvas: Extent
    #: Swap rounds that were made, 0 for two layers.
    rounds: int
    #: Which two layers each seam divides, by number.
    pairs: tuple[Pair, ...]
    _placed: Placed
    _channels: int | None
    _blend: Blend
    _blend_width: float | None
    _seam: Callable[[Pair, bool], Seam]

    def __repr__(self) -> str:
        height, width = self.shape
        return f"Composition({len(self.layers)} layers, {width} × {height} px, {len(self.pairs)} seams)"

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the canvas, px."""
        return self.canvas.shape

    @property
    def names(self) -> tuple[str, ...]:
        """The layers' names."""
        return tuple(layer.name for layer in self.layers)

    @property
    def origin(self) -> tuple[int, int]:
        """(x, y) of the canvas's upper left pixel in the layers' coordinates."""
        return self.canvas.origin

    def labels(self, rows: slice, columns: slice) -> LabelMap:
        """(h, w) int16, the number of the layer that shows in a window of the canvas; -1 where none does."""
        bounds = (part.indices(side)[:2] for part, side in zip((rows, columns), self.shape, strict=True))
        return self._placed.label_map[tuple(slice(*two) for two in bounds)].copy()

    def window(self, rows: slice, columns: slice) -> tuple[Image, Image]:
        """The picture in a window of the canvas, (h, w[, C]), and its opacity, (h, w), in the layers' dtype;
        0 where no layer has pixels.

        Windows whose edges are multiples of 1024 px cost the least. The blend "gradient" knows no windows:
        the first one computes the whole picture.
        """
        (top, bottom), (left, right) = (
            part.indices(side)[:2] for part, side in zip((rows, columns), self.shape, strict=True)
        )
        box = Box(top, left, max(top, bottom), max(left, right))
        if self._blend == "gradient":
            image, alpha = self._spread
            return image[box.slices].copy(), alpha[box.slices].copy()
        image, alpha = self._empty(box)
        canvas = self.canvas.box
        for row in range(top - top % BLOCK, bottom, BLOCK):
            for column in range(left - left % BLOCK, right, BLOCK):
                tile = Box(row, column, row + BLOCK, column + BLOCK).shared(canvas)
                common = tile.shared(box)
                part, opacity = self._tile(tile)
                image[common.within(box)] = part[common.within(tile)]
                alpha[common.within(box)] = opacity[common.within(tile)]
        return image, alpha

    def seams(self) -> Iterator[tuple[Pair, Seam]]:
        """The seams with their pairs of layers, each made when its turn comes."""
        for pair in self.pairs:
            yield pair, self._seam(pair, False)

    def outlines(self) -> Iterator[Outline]:
        """The seams without the problems they solve, which may be larger than memory."""
        for pair in self.pairs:
            seam = self._seam(pair, True)
            yield Outline(
                pair=pair,
                paths=tuple(seam.paths),
                cost=seam.cost,
                method=seam.method,
                termination=seam.termination,
                iterations=len(seam.history),
                seconds=seam.seconds,
                settings=seam.settings,
            )

    def _empty(self, box: Box) -> tuple[Image, Image]:
        dtype = self.layers[0].image.dtype
        shape = box.shape if self._channels is None else (*box.shape, self._channels)
        return np.zeros(shape, dtype), np.zeros(box.shape, dtype)

    def _tile(self, tile: Box) -> tuple[Image, Image]:
        placed = self._placed
        shows = placed.label_map[tile.slices]
        image, alpha = paint(self.layers, placed.places, shows, tile, self._channels)
        self._blender.blend(tile, image, alpha)
        return image, alpha

    @cached_property
    def _blender(self) -> Blender:
        return Blender(self._placed, self.seams, self._blend, self._blend_width)

    @cached_property
    def _spread(self) -> tuple[Image, Image]:
        box = self.canvas.box
        image, alpha = self._empty(box)
        for tile in blocks(box):
            image[tile.slices], alpha[tile.slices] = paint(
                self.layers, self._placed.places, self._placed.label_map[tile.slices], tile, self._channels
            )
        self._blender.spread(image)
        return image, alpha


def compose(
    layers: Sequence[Layer],
    *,
    method: Method = "heat",
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    blend: Blend = "none",
    blend_width: float | None = None,
    match_tones: bool = False,
    use_path: SvgSeam | Mapping[Pair, SvgSeam] | None = None,
    max_rounds: int = MAX_ROUNDS,
    options: HeatOptions | ThesisOptions | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
    **keywords: Any,
) -> Composition:
    """Decide which of placed layers shows where, for a picture that need not fit into memory.

    Parameters
    ----------
    layers : sequence of Layer
        As for :func:`toposeam.stitch`; their images may be :class:`toposeam.Windows`.
    **options
        All of them are those of :func:`toposeam.stitch`.

    Returns
    -------
    Composition
        Its windows together are what :func:`toposeam.stitch` returns, pixel by pixel.

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError

    Examples
    --------
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> compose([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    Composition(2 layers, 60 × 30 px, 1 seams)
    """
    layers = check_layers(layers)
    check_whole("max_rounds", max_rounds, 0)
    match = match_options(gradient, cost)
    chosen = method_options(method, keywords) if options is None else options
    if options is not None:
        _check_options(method, options, keywords)
    dtypes = {layer.image.dtype for layer in layers}
    if len(dtypes) > 1:
        raise ImageError(f"the layers have dtypes {', '.join(sorted(map(str, dtypes)))}; convert them to one")
    if len({layer.data_range for layer in layers}) > 1:
        raise ImageError("the layers have different values of data_range; give them the same white")
    channels = channel_count(layers)
    paths = _paths(use_path, len(layers))
    check_blend(blend, blend_width)
    canvas = common_canvas(layers, max_megapixels=max_megapixels)
    if match_tones:
        layers = matched(layers)
    factor = None if weight is None else as_weights(weight, canvas.shape)
    away = None if avoid is None else as_mask(avoid, canvas.shape, "avoid")
    common = {"cost": match, "core": core, "data_range": layers[0].data_range}
    steps = _Steps(layers, canvas, channels, {"weight": factor, "avoid": away}, common)
    given = {} if chosen is None else dataclasses.asdict(chosen)
    seam_of: Callable[[Pair, bool], Seam]
    if len(layers) == 2:
        found = {"method": method, "record_frames": record_frames, "progress": progress, **given}
        one = steps.join(1, found, paths.get((0, 1)))
        label_map, rounds, pairs = steps.label_map, 0, [(0, 1)]

        def seam_of(pair: Pair, beside: bool) -> Seam:
            return one
    else:
        labelling = pose_labelling(
            layers,
            canvas,
            steps.covered,
            core=core,
            match=match,
            weight=factor,
            avoid=away,
            given=[(pair, _divided(layers, canvas, pair, paths[pair], match, core)) for pair in paths],
        )
        order = _order(layers, steps.places, steps.covered)
        moves, rounds = best_rounds(labelling, order, method, given, max_rounds, progress, blend == "soft")
        label_map = moves.label_map
        pairs = moves.pairs(potentials=blend == "soft")
        seam_of = _Made(moves, list(paths), {"core": core, **dataclasses.asdict(match)})
    placed = Placed(layers=layers, places=steps.places, covered=steps.covered, label_map=label_map)
    return Composition(
        layers=layers,
        canvas=canvas,
        rounds=rounds,
        pairs=tuple(pairs),
        _placed=placed,
        _channels=channels,
        _blend=blend,
        _blend_width=blend_width,
        _seam=seam_of,
    )


@dataclass(frozen=True, eq=False)
class _Made:
    """The seams of rounds, each made when it is asked for."""

    moves: Rounds
    given: Sequence[Pair]
    settings: Mapping[str, Any]

    def __call__(self, pair: Pair, beside: bool) -> Seam:
        return self.moves.seam(pair, self.given, self.settings, beside)


class _Steps:
    """Layers joined one after another; `label_map` says which one shows so far."""

    def __init__(
        self,
        layers: Sequence[Layer],
        canvas: Extent,
        channels: int | None,
        on_canvas: Mapping[str, Any],
        options: dict[str, Any],
    ) -> None:
        self._layers, self._canvas, self._channels = layers, canvas, channels
        self._on_canvas, self._options = on_canvas, options
        self.places = [canvas.place(layer) for layer in layers]
        self.covered = exclusive_covers(layers, self.places, canvas)
        self.label_map: LabelMap = new_map(canvas.shape, -1, np.int16)

    def join(self, index: int, options: Mapping[str, Any], drawing: SvgSeam | None = None) -> Seam:
        """The seam of the second of two layers with the first."""
        layer, place = self._layers[index], self.places[index]
        # All that matters lies where both are, and two pixels around: gradients and grounds end there. A
        # drawing is one of the whole canvas.
        box = place.shared(self.places[0]).grown(2).shared(self._canvas.box)
        if drawing is not None or not all(place.shared(self.places[0]).shape):
            box = self._canvas.box
        covers = [cut(cover, at, box) for cover, at in zip(self.covered, self.places, strict=True)]
        first, second = (
            paint([one], [at], np.where(cover, np.int16(0), np.int16(-1)), box, self._channels)[0]
            for one, at, cover in zip(self._layers, self.places, covers, strict=True)
        )
        common: dict[str, Any] = {
            name: None if values is None else cut(values, self._canvas.box, box)
            for name, values in self._on_canvas.items()
        } | self._options
        try:
            if drawing is not None:
                seam = apply_paths(drawing, first, second, covers[0], covers[1], **common)
            else:
                seam = find_seam(first, second, covers[0], covers[1], **common, **options)
        except OverlapError as error:
            raise OverlapError(f"{layer.name} (at {layer.at[0]},{layer.at[1]}): {error}") from error
        self._show(seam, box)
        return moved_seam(seam, box, self._canvas, self.label_map, index)

    def _show(self, seam: Seam, box: Box) -> None:
        canvas = self._canvas.box
        for index, (place, cover) in enumerate(zip(self.places, self.covered, strict=True)):
            for part in blocks(place):
                here = cut(cover, place, part)
                before = self.label_map[part.slices]
                self.label_map[part.slices] = np.where(here, np.int16(index), before)
        shared = [cut(cover, place, box) for cover, place in zip(self.covered, self.places, strict=True)]
        labels = cut(self.label_map, canvas, box)
        both = shared[0] & shared[1]
        labels[both] = np.where(seam.labels[both], np.int16(1), np.int16(0))
        self.label_map[box.slices] = labels


def moved_seam(seam: Seam, box: Box, canvas: Extent, label_map: LabelMap, index: int) -> Seam:
    """A seam on a box of the canvas as one on the canvas; `index` is the number of its second layer."""
    overlap = seam.problem.overlap
    start = overlap.start[0] + box.top, overlap.start[1] + box.left
    problem = dataclasses.replace(
        seam.problem, overlap=dataclasses.replace(overlap, start=start, canvas=canvas.shape)
    )
    return dataclasses.replace(seam, problem=problem, _only_b=lambda: dense(label_map) == index)


def _paths(given: SvgSeam | Mapping[Pair, SvgSeam] | None, count: int) -> dict[Pair, SvgSeam]:
    """The given seams by pair, the lower number first."""
    if given is None:
        return {}
    if isinstance(given, SvgSeam):
        if count != 2:
            raise OptionError(
                f"a path joins two layers, but {count} were given; say between which two it runs, as "
                f"{{(0, 1): path}}"
            )
        return {(0, 1): given}
    check_kind("use_path", given, Mapping, "an SvgSeam, or one for each pair of layers")
    paths: dict[Pair, SvgSeam] = {}
    for (first, second), drawing in given.items():
        if not (0 <= first < count and 0 <= second < count) or first == second:
            raise OptionError(
                f"a path was given between layers {first} and {second}; choose two different ones from 0 to "
                f"{count - 1}"
            )
        paths[min(first, second), max(first, second)] = drawing
    return paths


def _divided(
    layers: Sequence[Layer], canvas: Extent, pair: Pair, drawing: SvgSeam, match: MatchCost, core: float
) -> Mask:
    """(H, W) bool on the canvas, True where a given seam shows the second layer of its pair."""
    options = {"cost": match, "core": core, "data_range": layers[0].data_range}
    steps = _Steps([layers[index] for index in pair], canvas, channel_count(layers), {}, options)
    try:
        return steps.join(1, {}, drawing).labels
    except PathError as error:
        raise PathError(f"between {layers[pair[0]].name} and {layers[pair[1]].name}: {error}") from error


def _order(layers: Sequence[Layer], places: Sequence[Box], covered: Sequence[Mask]) -> list[int]:
    """The layers in their order, each that overlaps none before it waiting until one does.

    Raises
    ------
    OverlapError
    """
    order, waiting = [0], list(range(1, len(layers)))
    while waiting:
        index = next((k for k in waiting if any(meets(places, covered, k, j) for j in order)), None)
        if index is None:
            x, y = layers[waiting[0]].at
            raise OverlapError(
                f"{layers[waiting[0]].name} (at {x},{y}): the patches do not overlap: no pixel of it is "
                "covered by another one; move it, or check the places and the masks"
            )
        waiting.remove(index)
        order.append(index)
    return order


def _check_options(method: Method, options: Any, keywords: Mapping[str, Any]) -> None:
    """Refuse options of another method, and both ways of giving them at once."""
    usual = method_options(method, {})
    if usual is None or not isinstance(options, type(usual)):
        wanted = "no options" if usual is None else type(usual).__name__
        raise OptionError(f"options is of class {type(options).__name__}; method {method} takes {wanted}")
    options_from(type(usual), options, dict(keywords), f"method {method}")
