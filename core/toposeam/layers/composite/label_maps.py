"""Which of placed layers shows where: of two by one seam, of more by rounds of expansions, or as masks say.

Two layers are left to the engines of :mod:`toposeam.seam`, whose seams cost less than those of rounds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels
from toposeam.errors import ImageError, Term
from toposeam.images import as_mask
from toposeam.layers.blending.blend import Blend, Placed
from toposeam.layers.canvas.layer import Extent, Layer, cut
from toposeam.layers.canvas.painting import channel_count
from toposeam.layers.canvas.tile_map import blocks, new_map
from toposeam.layers.composite.composition import Composition, Totals
from toposeam.layers.composite.composition_seams import Made
from toposeam.layers.composite.options import StitchOptions
from toposeam.layers.composite.two_layers import LayersOnCanvas, divided, join, order_of
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.labelling.posing import CORE, pose_labelling
from toposeam.layers.labelling.problem import Labelling, Pair
from toposeam.layers.search.multilevel import minimise
from toposeam.layers.search.options import SearchOptions, search_options
from toposeam.layers.search.problem import Problem
from toposeam.seam.find import Method, method_options
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.posing import as_weights
from toposeam.seam.result.seam import Seam
from toposeam.vector.svg import SvgSeam


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Labelled:
    """A label map of placed layers, and the seams in it."""

    canvas: Extent
    placed: Placed
    #: Gives the seam between two layers of `pairs`, as :class:`Composition` asks for it.
    seam: Callable[[Pair, bool], Seam]
    pairs: Sequence[Pair] = ()
    rounds: int = 0
    totals: Callable[[Executor | None], Totals] | None = None
    #: Where the canvas begins on what `placed` holds, and whether it goes all the way round.
    begin: int = 0
    goes_round: bool = False

    def composition(self, layers: Sequence[Layer], blend: Blend, blend_width: float | None) -> Composition:
        """Compose the layers as the label map shows them, blended across the seams."""
        return Composition(
            layers=layers,
            canvas=self.canvas,
            rounds=self.rounds,
            pairs=tuple(self.pairs),
            _placed=self.placed,
            _channels=channel_count(layers),
            _blend=blend,
            _blend_width=blend_width,
            _seam=self.seam,
            _begin=self.begin,
            _goes_round=self.goes_round,
            _totals=self.totals,
        )


@dataclass(frozen=True, slots=True, eq=False)
class SeamSearch:
    """How the seams of a number of layers are searched: options, and what follows from them."""

    options: StitchOptions
    method: Method
    match: MatchCost
    #: Fields of the method's own options.
    settings: Mapping[str, Any]
    thorough: SearchOptions

    @classmethod
    def of(cls, options: StitchOptions, count: int) -> SeamSearch:
        """Choose what the options leave open, for a number of layers."""
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

    def recorded(self) -> dict[str, Any]:
        """Return the settings that all seams have in common."""
        return {
            "core": self.options.core,
            "speck": self.options.speck,
            **dataclasses.asdict(self.match),
        }


def check_alike(layers: Sequence[Layer]) -> None:
    """Refuse layers whose values do not mean the same.

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


def labelled(
    layers: Sequence[Layer], canvas: Extent, search: SeamSearch, paths: Mapping[Pair, SvgSeam]
) -> Labelled:
    """Find which of placed layers shows where on a flat canvas; `paths` are seams that are given.

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError
    """
    options = search.options
    maps = {
        "weight": None if options.weight is None else as_weights(options.weight, canvas.shape),
        "avoid": None if options.avoid is None else as_mask(options.avoid, canvas.shape, "avoid"),
    }
    find = _by_one_seam if len(layers) == 2 else _by_rounds
    return find(LayersOnCanvas.of(layers, canvas), search, paths, maps)


def _common(ground: LayersOnCanvas, search: SeamSearch) -> dict[str, Any]:
    """Return the options of :func:`toposeam.find_seam` that all pairs of the layers have in common."""
    options = search.options
    core = CORE if options.core is None else options.core
    white = ground.layers[0].data_range
    return {"cost": search.match, "core": core, "speck": options.speck, "data_range": white}


def _by_one_seam(
    ground: LayersOnCanvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam], maps: Mapping[str, Any]
) -> Labelled:
    pair, options = (0, 1), search.options
    settings = {
        "method": search.method,
        "record_frames": options.record_frames,
        "progress": options.progress,
        **search.settings,
    }
    seam, label_map = join(ground, {**_common(ground, search), **maps}, settings, paths.get(pair))
    return Labelled(
        canvas=ground.canvas,
        placed=ground.showing(label_map),
        seam=lambda asked, beside: seam,
        pairs=[pair],
    )


def _by_rounds(
    ground: LayersOnCanvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam], maps: Mapping[str, Any]
) -> Labelled:
    options, common = search.options, _common(ground, search)
    labelling = pose_labelling(
        ground.layers,
        ground.canvas,
        ground.covered,
        core=options.core,
        speck=options.speck,
        match=search.match,
        given=[(pair, divided(ground, pair, drawing, common)) for pair, drawing in paths.items()],
        **maps,
    )
    label_map, report = minimise(
        search.problem(labelling), order_of(ground), options.max_rounds, options.blend == "soft"
    )
    made = Made(labelling, label_map, report, list(paths), search.recorded())
    made.check(options.executor)
    return Labelled(
        canvas=ground.canvas,
        placed=ground.showing(label_map),
        seam=made,
        pairs=made.pairs,
        rounds=report.rounds,
        totals=made.totals,
    )


def masked(ground: LayersOnCanvas, masks: Sequence[npt.ArrayLike] | None) -> Labels:
    """Compute the label map that masks on the canvas say, of which later ones win; None shows every layer
    wherever it has pixels. What no mask gives to anybody is the first layer's that has pixels there.
    """
    label_map: Labels = new_map(ground.canvas.shape, -1, np.int16)
    for box in blocks(ground.canvas.box):
        labels = np.full(box.shape, -1, np.int16)
        for index, (place, cover) in enumerate(zip(ground.places, ground.covered, strict=True)):
            here = cut(cover, place, box)
            wanted = True if masks is None else np.asarray(masks[index])[box.slices] != 0
            labels[here & (wanted | (labels < 0))] = index
        label_map[box.slices] = labels
    return label_map
