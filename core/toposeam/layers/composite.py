"""Layers in, one picture out: each further layer is joined to what is there along a seam, then all seams are
improved in pairs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_kind, check_whole, options_from
from toposeam.display import to_png
from toposeam.errors import ImageError, OptionError, OverlapError, PathError
from toposeam.images import Image, Mask, as_mask, full_scale
from toposeam.layers.blend import Blend, Placed, blend_seams, check_blend
from toposeam.layers.labelling import Pair
from toposeam.layers.layer import MAX_MEGAPIXELS, Box, Extent, Layer, check_layers, common_canvas, cut
from toposeam.layers.painting import LabelMap, channel_count, paint
from toposeam.layers.posing import exclusive_covers, pose_labelling
from toposeam.layers.rounds import best_rounds
from toposeam.layers.tones import match_tones as matched
from toposeam.saving import save
from toposeam.seam.drawing import draw_seams
from toposeam.seam.find import Method, find_seam, method_options
from toposeam.seam.heat import HeatOptions
from toposeam.seam.match_cost import MatchCost, match_options
from toposeam.seam.posing import as_weights
from toposeam.seam.seam import Seam, apply_paths
from toposeam.seam.thesis_options import ThesisOptions
from toposeam.vector.svg import SvgSeam, write_svg

#: Swap rounds at most; three are typical.
MAX_ROUNDS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Stitched:
    """The composite of placed layers.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> stitched = ts.stitch(ts.overlapping(a, b, overlap=10))
    >>> stitched.image.shape, len(stitched.masks), stitched.pairs
    ((30, 70), 2, ((0, 1),))
    """

    #: (H, W) or (H, W, C), dtype of the layers; 0 where no layer has pixels.
    image: Image
    #: (H, W) opacity in the layers' dtype, or None where every pixel is opaque.
    alpha: npt.NDArray[Any] | None
    #: (H, W) int16, the number of the layer that shows at each pixel; -1 where none has pixels.
    label_map: LabelMap
    #: One seam per pair of layers that adjoin where both have pixels.
    seams: tuple[Seam, ...]
    #: Which two layers each seam divides, by number; ``b`` of the seam is the second one.
    pairs: tuple[Pair, ...]
    #: The layers' names.
    names: tuple[str, ...]
    #: Swap rounds that were made, 0 for two layers.
    rounds: int
    #: (x, y) of the canvas's upper left pixel in the layers' coordinates.
    origin: tuple[int, int]

    @property
    def masks(self) -> tuple[Mask, ...]:
        """One (H, W) bool mask per layer: where it shows. They never overlap and together cover what any
        layer covers.
        """
        return tuple(self.label_map == index for index in range(len(self.names)))

    @property
    def cost(self) -> float:
        """Σ M over all seams."""
        return sum(seam.cost for seam in self.seams)

    def __repr__(self) -> str:
        height, width = self.label_map.shape
        return (
            f"Stitched({len(self.names)} layers, {width} × {height} px, {len(self.seams)} seams of cost "
            f"{self.cost:.4g})"
        )

    def _repr_png_(self) -> bytes:
        return to_png(draw_seams(self.image, self.seams), self.alpha)

    def to_svg(self, path: str | Path | None = None) -> str:
        """All seams as one SVG document; the paths of a seam are named after its layers, as ``"first.png :
        second.png"``.

        Parameters
        ----------
        path : str or Path, optional
            Also write the document there (an existing file is replaced).
        """
        height, width = self.label_map.shape
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
        text = write_svg([line for line, _ in lines], width, height, settings, [name for _, name in lines])
        if path is not None:
            save(path, text)
        return text


def pair_name(first: str, second: str) -> str:
    """What the paths between two layers are called in SVG.

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.pair_name("a", "b")
    'a : b'
    """
    return " ".join(f"{first} : {second}".split())


def stitch(
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
) -> Stitched:
    """Join placed layers.

    They are joined one after another in the order given (one that overlaps none of those before waits until
    one does), then swap rounds divide what each two layers hold between them anew, until the total cost no
    longer falls (:mod:`toposeam.layers.rounds`). What shows where, and at what cost, is defined in
    :mod:`toposeam.layers.labelling`.

    Parameters
    ----------
    layers : sequence of Layer
        At least two, of one dtype; gray layers are widened to the others' channels.
    method, gradient, cost, core, options, **keywords
        As for :func:`toposeam.find_seam`. Regions between more than two layers are no strips: `thesis` and
        `dp` find the first seams and leave the swap rounds to `heat`.
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
        Seams that were read from files, on the canvas: of the only two layers, or of pairs of layers by
        number.
    max_rounds : int
        Swap rounds at most; 0 leaves the seams as they were found one after another.
    max_megapixels : float
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

    Examples
    --------
    >>> from toposeam.layers.layer import Layer
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> stitch([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    Stitched(2 layers, 60 × 30 px, 1 seams of cost 0.03)
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
    steps = _Steps(
        layers,
        canvas,
        channels,
        {"weight": factor, "avoid": away},
        {"cost": match, "core": core, "data_range": layers[0].data_range},
    )
    given = {} if chosen is None else dataclasses.asdict(chosen)
    if len(layers) == 2:
        found = {"method": method, "record_frames": record_frames, "progress": progress, **given}
        seams = {(0, 1): steps.join(1, found, paths.get((0, 1)))}
        label_map, rounds = steps.label_map, 0
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
        moves, rounds = best_rounds(labelling, order, method, given, max_rounds, progress)
        label_map = moves.label_map
        seams = moves.seams(paths, {"core": core, **dataclasses.asdict(match)}, potentials=blend == "soft")
    placed = Placed(layers=layers, places=steps.places, covered=steps.covered, label_map=label_map)
    stitched = composed(placed, canvas, seams, blend, blend_width, rounds)
    if progress is not None:
        progress(1.0)
    return stitched


def composed(
    placed: Placed,
    canvas: Extent,
    seams: Mapping[Pair, Seam],
    blend: Blend,
    blend_width: float | None,
    rounds: int = 0,
    *,
    potentials: bool = True,
) -> Stitched:
    """The picture of layers of which it is known where each shows, mixed across its seams.

    Parameters
    ----------
    placed : Placed
    canvas : Extent
    seams : mapping from pairs of layers to Seam
    blend, blend_width
        As for :func:`stitch`.
    rounds : int
        How often the seams were improved.
    potentials : bool
        Whether the seams have label potentials to blend by.
    """
    layers, label_map = placed.layers, placed.label_map
    image, alpha = paint(layers, placed.places, label_map, canvas.box, channel_count(layers))
    blend_seams(placed, seams.items() if potentials else (), image, alpha, blend, blend_width)
    return Stitched(
        image=image,
        alpha=None if bool((alpha == full_scale(image.dtype)).all()) else alpha,
        label_map=label_map,
        seams=tuple(seams.values()),
        pairs=tuple(seams),
        names=tuple(layer.name for layer in layers),
        rounds=rounds,
        origin=canvas.origin,
    )


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
        self.label_map: LabelMap = np.full(canvas.shape, -1, np.int16)
        self.label_map[self.places[0].slices][self.covered[0]] = 0

    def join(self, index: int, options: Mapping[str, Any], drawing: SvgSeam | None = None) -> Seam:
        """The seam of one more layer with what is there."""
        layer, place = self._layers[index], self.places[index]
        # All that matters lies on the layer's place and one pixel around it; a drawing is one of the whole
        # canvas.
        box = place.grown(1).shared(self._canvas.box) if drawing is None else self._canvas.box
        there = cut(self.label_map, self._canvas.box, box)
        image, _ = paint(self._layers, self.places, there, box, self._channels)
        covered = cut(self.covered[index], place, box)
        patch, _ = paint([layer], [place], np.where(covered, np.int16(0), np.int16(-1)), box, self._channels)
        common: dict[str, Any] = {
            name: None if values is None else cut(values, self._canvas.box, box)
            for name, values in self._on_canvas.items()
        }
        try:
            if drawing is not None:
                seam = apply_paths(drawing, image, patch, there >= 0, covered, **common, **self._options)
            else:
                seam = find_seam(image, patch, there >= 0, covered, **common, **self._options, **options)
        except OverlapError as error:
            raise OverlapError(f"{layer.name} (at {layer.at[0]},{layer.at[1]}): {error}") from error
        shows = seam.labels[place.within(box)]
        self.label_map[place.slices][shows] = index
        return moved_seam(seam, box, self._canvas, self.label_map == index)


def moved_seam(seam: Seam, box: Box, canvas: Extent, shows: Mask) -> Seam:
    """A seam on a box of the canvas as one on the canvas."""
    overlap = seam.problem.overlap
    start = overlap.start[0] + box.top, overlap.start[1] + box.left
    problem = dataclasses.replace(
        seam.problem, overlap=dataclasses.replace(overlap, start=start, canvas=canvas.shape)
    )
    return dataclasses.replace(seam, problem=problem, only_b=shows)


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
        index = next((k for k in waiting if any(_meet(places, covered, k, j) for j in order)), None)
        if index is None:
            x, y = layers[waiting[0]].at
            hidden = any(each.alpha is not None or each.mask is not None for each in layers)
            raise OverlapError(
                f"{layers[waiting[0]].name} (at {x},{y}): the patches do not overlap: no pixel of it is "
                "covered by another one; move it, or check where they lie"
                f"{' and what is transparent or masked' if hidden else ''}"
            )
        waiting.remove(index)
        order.append(index)
    return order


def _meet(places: Sequence[Box], covered: Sequence[Mask], i: int, j: int) -> bool:
    common = places[i].shared(places[j])
    if not all(common.shape):
        return False
    return bool((covered[i][common.within(places[i])] & covered[j][common.within(places[j])]).any())


def _check_options(method: Method, options: Any, keywords: Mapping[str, Any]) -> None:
    """Refuse options of another method, and both ways of giving them at once."""
    usual = method_options(method, {})
    if usual is None or not isinstance(options, type(usual)):
        wanted = "no options" if usual is None else type(usual).__name__
        raise OptionError(f"options is of class {type(options).__name__}; method {method} takes {wanted}")
    options_from(type(usual), options, dict(keywords), f"method {method}")
