"""Options of joining placed layers, each said once."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy.typing as npt

from toposeam.arrays import Labels, Mask
from toposeam.checks import (
    check_choice,
    check_function,
    check_items,
    check_kind,
    check_number,
    check_whole,
    with_meant,
)
from toposeam.errors import OptionError, Term
from toposeam.layers.blending.blend import Blend, Blending, blending_of
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import MAX_MEGAPIXELS
from toposeam.layers.execution.tasks import Executor, Progressed, check_executor
from toposeam.layers.labelling.label_map import LabelMap, Pair
from toposeam.layers.search.options import Effort, SearchOptions, search_options
from toposeam.seam.find import Method, method_for, method_options, usual_law
from toposeam.seam.problem.match_cost import MatchCost, match_options
from toposeam.seam.problem.overlap import check_core
from toposeam.typing import MOST_BENT as MOST_BENT

if TYPE_CHECKING:
    from toposeam.layers.canvas.transforms import Transform
    from toposeam.layers.labelling.problem import Labelling
    from toposeam.layers.labelling.strokes import Stroke
    from toposeam.layers.search.problem import Problem
    from toposeam.seam.heat.method import HeatOptions
    from toposeam.seam.thesis.options import ThesisOptions
    from toposeam.vector.svg import SvgSeam

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StitchOptions:
    """Options of :func:`toposeam.stitch`.

    Raises
    ------
    OptionError
        When an option is out of range whatever the layers are, or two contradict each other.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> options = ts.layers.StitchOptions(blend="feather", blend_width=9)
    >>> options.effort, options.max_rounds
    (None, 10)
    """

    #: As for :func:`toposeam.find_seam`. Regions between more than two layers are no strips: `thesis` and
    #: `dp` leave them to `auto`. Of two layers the blend "soft" makes `auto` choose `heat`.
    method: Method = "auto"
    #: As for :func:`toposeam.find_seam`.
    gradient: bool | None = None
    #: The match cost; without it, the blends "soft" and "multiband" set its `reach` to how far they reach.
    cost: MatchCost | None = None
    #: Those of the method, which may also be given as keywords.
    options: HeatOptions | ThesisOptions | None = None
    #: (H, W) on the canvas: a positive factor on the cost of each pixel's interfaces.
    weight: npt.ArrayLike | None = field(default=None, repr=False)
    #: (H, W) on the canvas: pixels no seam may touch.
    avoid: npt.ArrayLike | None = field(default=None, repr=False)
    #: What must show of a layer that others cover wholly: this share, in (0, 1], of its depth, from its
    #: middle outwards; 1 is all of it but its border, where the seam must run. By default a layer that lies
    #: inside one other layer shows the half of its depth, and one that several others together cover shows
    #: only where that makes the seams cheaper, which may be nowhere (:attr:`Composition.hidden`).
    core: float | None = None
    #: A piece of a layer that others cover wholly need not show if it cannot show this many connected pixels,
    #: unless the layer has hardly anything else; by default 64, or 0.05 % of the layer's own if that is more.
    #: 0 lets every piece show.
    speck: float | None = None
    #: What happens across the seams (:mod:`toposeam.layers.blending.blend`). The masks stay hard.
    blend: Blend = "none"
    #: Of `feather`, `multiband` and `gradient`, px.
    blend_width: float | None = None
    #: First give each layer a gain per channel so that overlaps agree
    #: (:mod:`toposeam.layers.exposure.gains`).
    match_tones: bool = False
    #: The same, and a smooth field of gain, since lenses darken towards the corners
    #: (:mod:`toposeam.layers.exposure.gains`).
    match_shading: bool = False
    #: Bend the layers by up to this many px until what crosses a seam goes on behind it, and search the seams
    #: again (:mod:`toposeam.layers.composite.local_warp`), where that makes them clearly cheaper. All layers
    #: have to fit into memory.
    give: int = 0
    #: Seams that were read from files, on the canvas: of the only two layers, or of pairs of layers by
    #: number.
    use_path: SvgSeam | Mapping[Pair, SvgSeam] | None = None
    #: Strokes of a brush that say which layer shows, or where no seam may run; later ones win. Those that
    #: change nothing are named in :attr:`LabelMap.lost_strokes`.
    strokes: Sequence[Stroke] | None = None
    #: For strokes on layers that are warped: per layer the map from the pixels of its picture to the
    #: coordinates of the layers (:attr:`Placement.transforms`), or None if it is only moved.
    transforms: Sequence[Transform | None] | None = None
    #: A label map that was found for the same layers at a smaller size, with its `at` and `scale`: the seams
    #: are searched in a band round those of it.
    preview: LabelMap | None = field(default=None, repr=False)
    #: Rounds of expansions at most, of which three are typical; 0 leaves the seams as they were found one
    #: after another.
    max_rounds: int = 10
    #: How thoroughly the seams of more than two layers are searched. By default "fast" up to 12 layers and
    #: "best" from 13 on. "best" searches canvases of up to 4 megapixels twice, on costs reduced in two ways,
    #: and once more at full size where three layers meet; it takes two to four times as long, and its seams
    #: cost the same or less by up to some per cent.
    effort: Effort | SearchOptions | None = None
    #: Refuse a larger canvas.
    max_megapixels: float = MAX_MEGAPIXELS
    #: The canvas goes round, as a panorama of 360° does, and has this width, px: what reaches over the right
    #: edge lies at the left one, and seams and blending know it.
    wrap: int | None = None
    #: Of two layers: keep the densities of every iteration in ``Seam.frames``.
    record_frames: bool = False
    #: Where what does not depend on each other is done, a :class:`concurrent.futures.Executor`; the result is
    #: the same. Layers are handed to it: let their images be Windows that are small when pickled, such as
    #: those that know a file's name.
    executor: Executor | None = None
    #: Called with the share of the work done, in [0, 1].
    progress: Callable[[float], None] | None = None

    def __post_init__(self) -> None:
        check_function("progress", self.progress)
        check_executor(self.executor)
        self._check_give()
        if self.strokes is not None:
            from toposeam.layers.labelling.strokes import Stroke  # most pictures need none

            given = check_items("strokes", self.strokes, Stroke, "a sequence of Strokes")
            object.__setattr__(self, "strokes", tuple(given))
        check_kind("preview", self.preview, (LabelMap, type(None)), "a LabelMap or None")
        check_whole("max_rounds", self.max_rounds, 0)
        search_options(self.effort, 0)
        check_core(self.core, self.speck)
        blending_of(self.blend, self.blend_width)
        for name in ("record_frames", "match_tones", "match_shading"):
            check_choice(name, getattr(self, name), (True, False))
        method_options(self.method_of(0), {}, self.options)
        self.match_of("auto")
        check_number("max_megapixels", self.max_megapixels, 0, above=True)

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> StitchOptions:
        """Check the keywords of a call, among which those of its method may be.

        Raises
        ------
        OptionError
            Also for keywords that neither this nor the method has.
        """
        names = {option.name for option in dataclasses.fields(cls)}
        own = {name: value for name, value in given.items() if name in names}
        if keywords := {name: value for name, value in given.items() if name not in names}:
            method = method_for(own.get("method", "auto"), heats=True)
            try:
                own["options"] = method_options(method, keywords, own.get("options"))
            except OptionError as error:
                raise with_meant(error, names) from None
        return cls(**own)

    def _check_give(self) -> None:
        """Refuse what is no displacement, and seams that are given, as they are searched again."""
        paths = self.use_path
        given = bool(paths) if isinstance(paths, Mapping) else paths is not None
        if check_whole("give", self.give, 0, MOST_BENT) and given:
            raise OptionError(
                "{give} bends layers and searches their seams again, and {other} says where they are; leave "
                "one of them out",
                kind="conflict",
                other=Term("use_path"),
            )

    @property
    def blending(self) -> Blending:
        """What happens across the seams."""
        return blending_of(self.blend, self.blend_width)

    def method_of(self, count: int) -> Method:
        """Choose the method for a number of layers."""
        heats = self.record_frames or self.options is not None
        heats = heats or (count == 2 and self.blending.needs_potential)
        return method_for(self.method, heats=heats)

    def match_of(self, method: Method) -> MatchCost:
        """Choose the match cost that a method minimises, which reaches as far as the blend does."""
        match = match_options(self.gradient, self.cost, usual_law(method))
        if match.reach is not None:
            return match
        return dataclasses.replace(match, reach=self.blending.reach)


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
        from toposeam.layers.search.problem import Problem  # two layers need none

        steps = Progressed(self.options.progress)
        return Problem.of(labelling, self.method, self.settings, self.thorough, self.options.executor, steps)

    def common(self, canvas: Canvas) -> dict[str, Any]:
        """Return the options of :func:`toposeam.find_seam` that are the same for all pairs of layers."""
        core, white = self.options.core, canvas.layers[0].data_range
        kept = {} if core is None else {"core": core}
        return {"cost": self.match, **kept, "speck": self.options.speck, "data_range": white}

    def pose(self, canvas: Canvas, **more: Any) -> Labelling:
        """Pose the labelling problem of a flat canvas."""
        from toposeam.layers.labelling.posing import pose_labelling

        options = self.options
        return pose_labelling(canvas, core=options.core, speck=options.speck, match=self.match, **more)

    def struck(self, labelling: Labelling, canvas: Canvas) -> tuple[Labelling, tuple[int, ...]]:
        """Apply the strokes to a problem of a canvas; also return those that change nothing."""
        if not self.options.strokes:
            return labelling, ()
        from toposeam.layers.labelling.strokes import apply_strokes

        return apply_strokes(labelling, self.options.strokes, canvas, self.options.transforms)

    def preview_on(self, x: int, y: int) -> LabelMap | None:
        """Return the preview in the coordinates of a canvas that begins at x, y."""
        preview = self.options.preview
        if preview is None:
            return None
        return dataclasses.replace(preview, at=(preview.at[0] - x, preview.at[1] - y))

    def recut(
        self,
        labelling: Labelling,
        label_map: LabelMap,
        opened: Mask | None = None,
        fixed: Labels | None = None,
    ) -> LabelMap:
        """Search a part of a label map again, by the same method if one was named."""
        from toposeam.layers.search.recutting import recut

        solver = None if self.method == "auto" else self.problem(labelling).solver
        return recut(labelling, label_map, opened, fixed, solver=solver, search=self.thorough)

    def recorded(self) -> dict[str, Any]:
        """Return the settings that are recorded with every seam."""
        return {
            "core": self.options.core,
            "speck": self.options.speck,
            **dataclasses.asdict(self.match),
        }


def with_signature(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Show the fields of :class:`StitchOptions` in the signature of a function that takes them."""
    own = inspect.signature(function).parameters
    fields = inspect.signature(StitchOptions).parameters
    ordered = sorted([*own.values(), *fields.values()], key=lambda one: one.kind)
    setattr(function, "__signature__", inspect.Signature(ordered))  # noqa: B010
    return function
