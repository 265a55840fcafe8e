"""Layers in, one picture out: each further layer is joined to what is there along a seam, then all seams are improved in pairs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OptionError, OverlapError, PathError
from toposeam.images import Image, Mask, as_mask, full_scale
from toposeam.layers.blend import Blend, Placed, blend_seams, check_blend
from toposeam.layers.labelling import Labelling, Pair, exclusive_covers
from toposeam.layers.layer import Box, Canvas, Layer, common_canvas, cut
from toposeam.layers.painting import Owner, channel_count, paint
from toposeam.layers.rounds import best_labelling
from toposeam.layers.tones import match_tones as matched
from toposeam.seam.find import Method, apply_paths, as_weights, find_seam
from toposeam.seam.match_cost import MatchCost
from toposeam.seam.seam import Seam
from toposeam.vector.svg import SvgSeam, write_svg

#: Largest canvas that is made without being asked to: a gigapixel.
MAX_PIXELS = 10**9

#: Swap rounds at most; three are typical.
MAX_ROUNDS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stitched:
    """The composite of placed layers."""

    #: (H, W) or (H, W, C), dtype of the layers; 0 where no layer has pixels.
    image: Image
    #: (H, W) opacity in the layers' dtype, or None where every pixel is opaque.
    alpha: npt.NDArray[Any] | None
    #: One (H, W) bool mask per layer: where it shows. They never overlap and together cover what any layer covers.
    masks: tuple[Mask, ...]
    #: One seam per pair of layers that adjoin where both have pixels.
    seams: tuple[Seam, ...]
    #: Which two layers each seam divides, by number; ``b`` of the seam is the second one.
    pairs: tuple[Pair, ...]
    #: The layers' names.
    names: tuple[str, ...]
    #: Swap rounds that were made, 0 for two layers.
    rounds: int
    #: Column and row of the canvas's upper left pixel in the layers' coordinates.
    origin: tuple[int, int]

    @property
    def cost(self) -> float:
        """Σ M over all seams."""
        return sum(seam.cost for seam in self.seams)

    def to_svg(self) -> str:
        """All seams as one SVG document; the paths of a seam are named after its layers, as ``"first.png : second.png"``."""
        height, width = self.masks[0].shape
        lines = [
            (line, pair_name(self.names[i], self.names[j]))
            for seam, (i, j) in zip(self.seams, self.pairs, strict=True)
            for line in seam.paths
        ]
        settings: dict[str, Any] = {"layers": self.names, "cost": self.cost, "rounds": self.rounds}
        settings["seams"] = [
            {**seam.settings, "pair": pair, "method": seam.method, "cost": seam.cost}
            for seam, pair in zip(self.seams, self.pairs, strict=True)
        ]
        return write_svg([line for line, _ in lines], width, height, settings, [name for _, name in lines])


def pair_name(first: str, second: str) -> str:
    """What the paths between two layers are called in SVG."""
    return " ".join(f"{first} : {second}".split())


def stitch(
    layers: Sequence[Layer],
    *,
    method: Method = "heat",
    gradient: bool = True,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    blend: Blend = "none",
    blend_width: float | None = None,
    match_tones: bool = False,
    use_path: SvgSeam | Mapping[Pair, SvgSeam] | None = None,
    max_rounds: int = MAX_ROUNDS,
    max_pixels: int = MAX_PIXELS,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Stitched:
    """Join placed layers.

    They are joined one after another in the order given (one that overlaps none of those before waits until one does), then swap rounds
    divide what each two layers hold between them anew, until the total cost no longer falls (:mod:`toposeam.layers.rounds`). What shows
    where, and at what cost, is defined in :mod:`toposeam.layers.labelling`.

    Parameters
    ----------
    layers : sequence of Layer
        At least two, of one dtype; gray layers are widened to the others' channels.
    method, gradient, cost, core, **options
        As for :func:`toposeam.find_seam`. Regions between more than two layers are no strips: `thesis` and `dp` find the first seams and
        leave the swap rounds to `heat`.
    weight : (H, W) array_like on the canvas, optional
        A positive factor on the cost of each pixel's interfaces.
    avoid : (H, W) array_like on the canvas, optional
        Pixels no seam may touch.
    blend : {"none", "feather", "soft", "multiband", "gradient"}
        What happens across the seams (:mod:`toposeam.layers.blend`). The masks stay hard.
    blend_width : float, optional
        Of `feather`, `multiband` and `gradient`, in px.
    match_tones : bool
        First give each layer a gain per channel so that overlaps agree (:mod:`toposeam.layers.tones`).
    use_path : SvgSeam, or mapping of (int, int) to SvgSeam, optional
        Seams that were read from files, on the canvas: of the only two layers, or of pairs of layers by number.
    max_rounds : int
        Swap rounds at most; 0 leaves the seams as they were found one after another.
    max_pixels : int
        Refuse a larger canvas.
    record_frames : bool
        For two layers: keep the densities of every iteration in ``Seam.frames``.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Stitched

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError
    """
    if len(layers) < 2:
        raise OptionError(f"{len(layers)} layer was given; stitching needs at least two")
    dtypes = {layer.image.dtype for layer in layers}
    if len(dtypes) > 1:
        raise ImageError(f"the layers have dtypes {', '.join(sorted(map(str, dtypes)))}; convert them to one")
    channels = channel_count(layers)
    paths = _paths(use_path, len(layers))
    check_blend(blend, blend_width)
    canvas = common_canvas(layers, max_pixels)
    if match_tones:
        layers = matched(layers, [canvas.place(layer) for layer in layers])
    match = cost if cost is not None else MatchCost(gradient=gradient)
    factor = None if weight is None else as_weights(weight, canvas.shape)
    away = None if avoid is None else as_mask(avoid, canvas.shape, "avoid")
    steps = _Steps(layers, canvas, channels, {"weight": factor, "avoid": away}, {"cost": match, "core": core})
    if len(layers) == 2:
        found = {"method": method, "record_frames": record_frames, "progress": progress, **options}
        seams = {(0, 1): steps.join(1, found, paths.get((0, 1)))}
        owner, rounds = steps.owner, 0
    else:
        steps.join_all({"method": method, **options}, None if progress is None else _share(progress, 0.0, 0.3))
        labelling = Labelling(layers, canvas, steps.covered, core, match, factor, away)
        for pair, drawing in paths.items():
            labelling.divide(pair, _divided(layers, canvas, pair, drawing, match, core))
        labelling.legal(steps.owner)
        report = None if progress is None else _share(progress, 0.3, 1.0)
        moves, rounds = best_labelling(labelling, steps.owner, method, options, max_rounds, report)
        owner = moves.owner
        seams = moves.seams(paths, {"core": core, **dataclasses.asdict(match)}, potentials=blend == "soft")
    image, alpha = paint(layers, steps.places, owner, canvas.box, channels)
    placed = Placed(layers=layers, places=steps.places, covered=steps.covered, owner=owner)
    blend_seams(placed, seams.items(), image, alpha, blend, blend_width)
    if progress is not None:
        progress(1.0)
    return Stitched(
        image=image, alpha=None if bool((alpha == full_scale(image.dtype)).all()) else alpha,
        masks=tuple(owner == index for index in range(len(layers))), seams=tuple(seams.values()), pairs=tuple(seams),
        names=tuple(layer.name for layer in layers), rounds=rounds, origin=canvas.origin,
    )  # fmt: skip


class _Steps:
    """Layers joined one after another; `owner` says which one shows so far."""

    def __init__(
        self, layers: Sequence[Layer], canvas: Canvas, channels: int | None, on_canvas: Mapping[str, Any], options: dict[str, Any]
    ) -> None:
        self._layers, self._canvas, self._channels = layers, canvas, channels
        self._on_canvas, self._options = on_canvas, options
        self.places = [canvas.place(layer) for layer in layers]
        self.covered = exclusive_covers(layers, self.places, canvas)
        self.owner: Owner = np.full(canvas.shape, -1, np.int16)
        self.owner[self.places[0].slices][self.covered[0]] = 0

    def join_all(self, options: Mapping[str, Any], progress: Callable[[float], None] | None) -> None:
        waiting = list(range(1, len(self._layers)))
        while waiting:
            index = next((index for index in waiting if self._reaches(index)), waiting[0])
            waiting.remove(index)
            self.join(index, options)
            if progress is not None:
                progress(1 - len(waiting) / (len(self._layers) - 1))

    def _reaches(self, index: int) -> bool:
        return bool(((self.owner[self.places[index].slices] >= 0) & self.covered[index]).any())

    def join(self, index: int, options: Mapping[str, Any], drawing: SvgSeam | None = None) -> Seam:
        """The seam of one more layer with what is there."""
        layer, place = self._layers[index], self.places[index]
        # All that matters lies on the layer's place and one pixel around it; a drawing is one of the whole canvas.
        box = place.grown(1).shared(self._canvas.box) if drawing is None else self._canvas.box
        there = cut(self.owner, self._canvas.box, box)
        image, _ = paint(self._layers, self.places, there, box, self._channels)
        covered = cut(self.covered[index], place, box)
        patch, _ = paint([layer], [place], np.where(covered, np.int16(0), np.int16(-1)), box, self._channels)
        common: dict[str, Any] = {
            name: None if values is None else cut(values, self._canvas.box, box) for name, values in self._on_canvas.items()
        }
        try:
            if drawing is not None:
                seam = apply_paths(drawing, image, patch, there >= 0, covered, **common, **self._options)
            else:
                seam = find_seam(image, patch, there >= 0, covered, **common, **self._options, **options)
        except OverlapError as error:
            raise OverlapError(f"{layer.name} (at {layer.offset[0]},{layer.offset[1]}): {error}") from error
        shows = seam.labels[place.within(box)]
        self.owner[place.slices][shows] = index
        return _moved(seam, box, self._canvas, self.owner == index)


def _moved(seam: Seam, box: Box, canvas: Canvas, shows: Mask) -> Seam:
    """A seam on a box of the canvas as one on the canvas."""
    overlap = seam.problem.overlap
    origin = overlap.origin[0] + box.top, overlap.origin[1] + box.left
    problem = dataclasses.replace(seam.problem, overlap=dataclasses.replace(overlap, origin=origin, canvas=canvas.shape))
    return dataclasses.replace(seam, problem=problem, only_b=shows)


def _paths(given: SvgSeam | Mapping[Pair, SvgSeam] | None, count: int) -> dict[Pair, SvgSeam]:
    """The given seams by pair, the lower number first."""
    if given is None:
        return {}
    if isinstance(given, SvgSeam):
        if count != 2:
            raise OptionError(f"a path joins two layers, but {count} were given; say between which two it runs, as {{(0, 1): path}}")
        return {(0, 1): given}
    paths: dict[Pair, SvgSeam] = {}
    for (first, second), drawing in given.items():
        if not (0 <= first < count and 0 <= second < count) or first == second:
            raise OptionError(f"a path was given between layers {first} and {second}; choose two different ones from 0 to {count - 1}")
        paths[min(first, second), max(first, second)] = drawing
    return paths


def _divided(layers: Sequence[Layer], canvas: Canvas, pair: Pair, drawing: SvgSeam, match: MatchCost, core: float) -> Mask:
    """(H, W) bool on the canvas, True where a given seam shows the second layer of its pair."""
    steps = _Steps([layers[index] for index in pair], canvas, channel_count(layers), {}, {"cost": match, "core": core})
    try:
        return steps.join(1, {}, drawing).labels
    except PathError as error:
        raise PathError(f"between {layers[pair[0]].name} and {layers[pair[1]].name}: {error}") from error


def _share(progress: Callable[[float], None], start: float, end: float) -> Callable[[float], None]:
    return lambda part: progress(start + (end - start) * part)
