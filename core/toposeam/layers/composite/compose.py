"""From placed layers to a composition: two along one seam, more by rounds, and canvases that go round."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack, cast

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_choice, check_function, check_whole
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import Mask, as_mask
from toposeam.layers.blending.blend import Blend, Placed, check_blend, reach_of
from toposeam.layers.canvas.layer import (
    MAX_MEGAPIXELS,
    Box,
    Extent,
    Layer,
    as_layers,
    check_layers,
    common_canvas,
    cut,
)
from toposeam.layers.canvas.painting import LabelMap, channel_count
from toposeam.layers.canvas.tile_map import blocks, cover_of, new_map
from toposeam.layers.composite.composition import Composition, Totals
from toposeam.layers.composite.composition_seams import Made
from toposeam.layers.composite.cylindrical import (
    Turned,
    band,
    best_cut,
    margin,
    round_canvas,
    turned,
    turned_gathered,
    turned_map,
    unrolled,
)
from toposeam.layers.composite.two_layers import Steps, divided, order_of, paths_by_pair
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.execution.tasks import Executor, check_executor
from toposeam.layers.exposure.gains import match_tones as matched
from toposeam.layers.labelling.posing import CORE, exclusive_covers, pose_labelling
from toposeam.layers.labelling.problem import Labelling, Pair
from toposeam.layers.registration.find_places import find_places
from toposeam.layers.search.local_search import find_potentials, refine
from toposeam.layers.search.multilevel import minimise
from toposeam.layers.search.options import Effort, SearchOptions, search_options
from toposeam.layers.search.problem import Problem, State
from toposeam.seam.find import Method, method_for, method_options, usual_law
from toposeam.seam.heat.method import HeatOptions
from toposeam.seam.keywords import SeamKeywords
from toposeam.seam.problem.match_cost import MatchCost, match_options
from toposeam.seam.problem.overlap import check_core
from toposeam.seam.problem.posing import as_weights
from toposeam.seam.result.seam import Seam
from toposeam.seam.thesis.options import ThesisOptions
from toposeam.vector.svg import SvgSeam

#: Rounds of expansions at most; three are typical.
MAX_ROUNDS = 10


def compose(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]],
    *,
    method: Method = "auto",
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float | None = None,
    speck: float | None = None,
    blend: Blend = "none",
    blend_width: float | None = None,
    match_tones: bool = False,
    match_shading: bool = False,
    use_path: SvgSeam | Mapping[Pair, SvgSeam] | None = None,
    max_rounds: int = MAX_ROUNDS,
    effort: Effort | SearchOptions | None = None,
    options: HeatOptions | ThesisOptions | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
    wrap: int | None = None,
    record_frames: bool = False,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
    **keywords: Unpack[SeamKeywords],
) -> Composition:
    """Decide which of placed layers shows where, for a picture that need not fit into memory.

    Parameters
    ----------
    layers : sequence of Layer
        As for :func:`toposeam.stitch`; their images may be :class:`toposeam.Windows`.
    executor : concurrent.futures.Executor, optional
        Where what does not depend on each other is done; the result is the same. Layers are handed to it:
        let their images be Windows that are small when pickled, such as those that know a file's name.
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
    Composition(2 layers, 60 × 30 px, 1 seam)
    """
    check_function("progress", progress)
    check_executor(executor)
    layers, round_way = _with_places(layers, executor)
    layers, wrap = check_layers(layers), round_way if wrap is None else wrap
    check_whole("max_rounds", max_rounds, 0)
    thorough = search_options(effort, len(layers))
    check_core(core, speck)
    check_blend(blend, blend_width)
    check_choice("record_frames", record_frames, (True, False))
    method = method_for(
        method,
        heats=record_frames
        or bool(keywords)
        or options is not None
        or (blend == "soft" and len(layers) == 2),
    )
    chosen = method_options(method, keywords, options)
    match = match_options(gradient, cost, usual_law(method))
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
    channels = channel_count(layers)
    paths = paths_by_pair(use_path, len(layers))
    if match.reach is None:
        match = dataclasses.replace(match, reach=reach_of(blend, blend_width))
    canvas = common_canvas(layers, max_megapixels=max_megapixels)
    for name, value in (("match_tones", match_tones), ("match_shading", match_shading)):
        check_choice(name, value, (True, False))
    if match_tones or match_shading:
        layers = matched(layers, shading=match_shading, executor=executor)
    factor = None if weight is None else as_weights(weight, canvas.shape)
    away = None if avoid is None else as_mask(avoid, canvas.shape, "avoid")
    share = CORE if core is None else core
    common = {"cost": match, "core": share, "speck": speck, "data_range": layers[0].data_range}
    steps = Steps(layers, canvas, channels, {"weight": factor, "avoid": away}, common)
    given = {} if chosen is None else dataclasses.asdict(chosen)
    if wrap is not None:
        if factor is not None or away is not None or paths:
            raise OptionError(
                "{wrap} goes without {weight}, {avoid} and {paths}; leave them out",
                kind="conflict",
                paths=Term("use_path", "paths"),
            )
        search = _Search(method, given, thorough, max_rounds, progress, executor, core, speck, match)
        most = max(2, int(max_megapixels * 1e6) // canvas.shape[0])
        return _round(layers, check_whole("wrap", wrap, 2, most), search, channels, blend, blend_width)
    seam_of: Callable[[Pair, bool], Seam]
    totals: Callable[[Executor | None], Totals] | None = None
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
            speck=speck,
            match=match,
            weight=factor,
            avoid=away,
            given=[(pair, divided(layers, canvas, pair, paths[pair], common)) for pair in paths],
        )
        order = order_of(layers, steps.places, steps.covered)
        search = _Search(method, given, thorough, max_rounds, progress, executor, core, speck, match)
        label_map, report = minimise(search.problem(labelling), order, max_rounds, blend == "soft")
        rounds = report.rounds
        made = Made(labelling, label_map, report, list(paths), search.recorded())
        pairs = made.pairs
        made.check(executor)
        seam_of, totals = made, made.totals
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
        _totals=totals,
    )


def _with_places(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], executor: Executor | None
) -> tuple[Sequence[Layer], int | None]:
    """Find the places of images that are given without any, and the canvas's width if it goes round."""
    images = as_layers(layers)
    if (
        isinstance(images, tuple)
        and len(images) > 1
        and not any(image is layer for image, layer in zip(images, layers, strict=True))
    ):
        found = find_places(images, executor=executor)
        for reason in found.left_out.values():
            warnings.warn(f"left out: {reason}", stacklevel=4)
        return found.layers, found.wrap
    return layers, None  # type: ignore[return-value]  # checked by the caller


@dataclass(frozen=True, eq=False, slots=True)
class _Search:
    """How seams are searched."""

    method: Method
    options: dict[str, Any]
    thorough: SearchOptions
    rounds: int
    progress: Callable[[float], None] | None
    executor: Executor | None
    core: float | None
    speck: float | None
    match: MatchCost

    def problem(self, labelling: Labelling) -> Problem:
        """A labelling as a problem to be solved."""
        steps = Progressed(self.progress)
        return Problem.of(labelling, self.method, self.options, self.thorough, self.executor, steps)

    def recorded(self) -> dict[str, Any]:
        """The settings that all seams have in common."""
        return {"core": self.core, "speck": self.speck, **dataclasses.asdict(self.match)}


def _round(
    layers: Sequence[Layer],
    period: int,
    search: _Search,
    channels: int | None,
    blend: Blend,
    blend_width: float | None,
) -> Composition:
    """A composition on a canvas that goes round."""
    canvas = round_canvas(layers, period)
    frame = Extent(origin=(0, 0), shape=canvas.shape)
    left, top = canvas.origin
    moved = [dataclasses.replace(layer, at=(layer.at[0] - left, layer.at[1] - top)) for layer in layers]

    def posed(start: int) -> tuple[Labelling, list[Layer], list[Mask]]:
        parts = [turned(layer, period, start) for layer in moved]
        places = [frame.place(part) for part in parts]
        covered = exclusive_covers(parts, places, frame)
        labelling = pose_labelling(
            parts, frame, covered, core=search.core, speck=search.speck, match=search.match
        )
        return labelling, parts, covered

    cut_at, beside = best_cut(moved, period)
    labelling, parts, covered = posed(cut_at)
    order = order_of(parts, labelling.places, covered)
    soft = blend == "soft"
    labels, report = minimise(search.problem(labelling), order, search.rounds, soft)
    start = cut_at - period // 2
    labels = turned_map(labels, period, start - cut_at, period)
    if soft or beside > 1:
        problem, state = search.problem(posed(start)[0]), State(labels, band(frame.shape))
    if beside > 1:
        refine(problem, state, search.rounds)
    if soft:
        joint = find_potentials(problem, state)
        gathered = turned_gathered([(report.gathered, cut_at), (joint, start)], period)
        report = dataclasses.replace(report, gathered=gathered)
    labels = turned_map(labels, period, -start, period)
    labelling, parts, covered = posed(0)
    made = Made(labelling, labels, report, [], search.recorded())
    flat = blend == "gradient"
    placed = (
        Placed(layers=parts, places=labelling.places, covered=covered, label_map=labels)
        if flat
        else _on_both_sides(moved, labelling.places, covered, labels, period)
    )
    return Composition(
        layers=layers,
        canvas=canvas,
        rounds=report.rounds,
        pairs=tuple(made.pairs),
        _placed=placed,
        _channels=channels,
        _blend=blend,
        _blend_width=blend_width,
        _seam=made,
        _begin=0 if flat else margin(period),
        _goes_round=True,
    )


def _on_both_sides(
    layers: Sequence[Layer], places: Sequence[Box], covered: Sequence[Mask], labels: LabelMap, period: int
) -> Placed:
    """A round canvas with some of the other end on both sides, so that blending sees it."""
    beyond = margin(period)
    wide = Extent(origin=(-beyond, 0), shape=(labels.shape[0], period + 2 * beyond))
    longer = [unrolled(layer, period, beyond) for layer in layers]
    return Placed(
        layers=longer,
        places=[wide.place(layer) for layer in longer],
        covered=[
            cast(Mask, Turned(cover, place.left, period, -beyond, wide.shape[1]))
            for cover, place in zip(covered, places, strict=True)
        ],
        label_map=turned_map(labels, period, -beyond, wide.shape[1]),
    )


def shown_as(
    layers: Sequence[Layer],
    masks: Sequence[npt.ArrayLike] | None,
    shape: tuple[int, int],
    *,
    blend: Blend = "none",
    blend_width: float | None = None,
    wrap: int | None = None,
) -> Composition:
    """A composition of which it is known where each layer shows.

    Parameters
    ----------
    layers : sequence of Layer
        At least one.
    masks : sequence of (H, W) array_like, or None
        Where each layer shows, on a canvas that begins at 0,0; later ones win, and None shows every layer
        wherever it has pixels. What no mask gives to anybody is the first layer's that has pixels there.
    shape : (int, int)
        Height and width of the canvas, px.
    blend, blend_width, wrap
        As for :func:`toposeam.stitch`; `wrap` is the canvas's width.
    """
    canvas = Extent(origin=(0, 0), shape=shape)
    parts = [turned(layer, wrap, 0) for layer in layers] if wrap is not None else list(layers)
    places = [canvas.place(part) for part in parts]
    covered = [cover_of(part) for part in parts]
    label_map: LabelMap = new_map(shape, -1, np.int16)
    for box in blocks(canvas.box):
        labels = np.full(box.shape, -1, np.int16)
        for index, (place, cover) in enumerate(zip(places, covered, strict=True)):
            here = cut(cover, place, box)
            wanted = True if masks is None else np.asarray(masks[index])[box.slices] != 0
            labels[here & (wanted | (labels < 0))] = index
        label_map[box.slices] = labels

    def nothing(pair: Pair, beside: bool) -> Seam:
        raise OptionError(
            "layers {first} and {second} were not divided by a seam",
            kind="no seam",
            layers=pair,
            first=pair[0],
            second=pair[1],
        )

    placed = Placed(layers=parts, places=places, covered=covered, label_map=label_map)
    if wrap is not None:
        placed = _on_both_sides(layers, places, covered, label_map, wrap)
    return Composition(
        layers=layers,
        canvas=canvas,
        rounds=0,
        pairs=(),
        _placed=placed,
        _channels=channel_count(layers),
        _blend=blend,
        _blend_width=blend_width,
        _seam=nothing,
        _begin=0 if wrap is None else margin(wrap),
        _goes_round=wrap is not None,
    )
