"""Options of joining placed layers, each said once: of `stitch`, of `compose`, and of the command line."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ParamSpec, TypeVar

import numpy.typing as npt

from toposeam.checks import check_choice, check_function, check_number, check_whole
from toposeam.layers.blending.blend import Blend, check_blend, reach_of
from toposeam.layers.canvas.layer import MAX_MEGAPIXELS
from toposeam.layers.composite.local_warp import check_give
from toposeam.layers.execution.tasks import Executor, check_executor
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.search.options import Effort, SearchOptions, search_options
from toposeam.seam.find import Method, method_for, method_options, usual_law
from toposeam.seam.heat.method import HeatOptions
from toposeam.seam.keywords import SeamKeywords
from toposeam.seam.problem.match_cost import MatchCost, match_options
from toposeam.seam.problem.overlap import check_core
from toposeam.seam.thesis.options import ThesisOptions
from toposeam.vector.svg import SvgSeam

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

#: Rounds of expansions at most; three are typical.
MAX_ROUNDS = 10


class StitchKeywords(SeamKeywords, total=False):
    """Fields of :class:`StitchOptions`, and those of the options of methods."""

    method: Method
    gradient: bool | None
    cost: MatchCost | None
    options: HeatOptions | ThesisOptions | None
    weight: npt.ArrayLike | None
    avoid: npt.ArrayLike | None
    core: float | None
    speck: float | None
    blend: Blend
    blend_width: float | None
    match_tones: bool
    match_shading: bool
    give: int
    use_path: SvgSeam | Mapping[Pair, SvgSeam] | None
    max_rounds: int
    effort: Effort | SearchOptions | None
    max_megapixels: float
    wrap: int | None
    record_frames: bool
    executor: Executor | None
    progress: Callable[[float], None] | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StitchOptions:
    """Options of :func:`toposeam.stitch`, which says what each means, and :func:`toposeam.layers.compose`.

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

    method: Method = "auto"
    gradient: bool | None = None
    cost: MatchCost | None = None
    options: HeatOptions | ThesisOptions | None = None
    weight: npt.ArrayLike | None = field(default=None, repr=False)
    avoid: npt.ArrayLike | None = field(default=None, repr=False)
    core: float | None = None
    speck: float | None = None
    blend: Blend = "none"
    blend_width: float | None = None
    match_tones: bool = False
    match_shading: bool = False
    give: int = 0
    use_path: SvgSeam | Mapping[Pair, SvgSeam] | None = None
    max_rounds: int = MAX_ROUNDS
    effort: Effort | SearchOptions | None = None
    max_megapixels: float = MAX_MEGAPIXELS
    wrap: int | None = None
    record_frames: bool = False
    executor: Executor | None = None
    progress: Callable[[float], None] | None = None

    def __post_init__(self) -> None:
        check_function("progress", self.progress)
        check_executor(self.executor)
        check_give(self.give, self.use_path)
        check_whole("max_rounds", self.max_rounds, 0)
        search_options(self.effort, 0)
        check_core(self.core, self.speck)
        check_blend(self.blend, self.blend_width)
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
            own["options"] = method_options(method, keywords, own.get("options"))
        return cls(**own)

    def method_of(self, count: int) -> Method:
        """Choose the method for a number of layers."""
        heats = self.record_frames or self.options is not None or (self.blend == "soft" and count == 2)
        return method_for(self.method, heats=heats)

    def match_of(self, method: Method) -> MatchCost:
        """Choose the match cost that a method minimises, which reaches as far as the blend does."""
        match = match_options(self.gradient, self.cost, usual_law(method))
        if match.reach is not None:
            return match
        return dataclasses.replace(match, reach=reach_of(self.blend, self.blend_width))


def with_signature(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Show the fields of :class:`StitchOptions` in the signature of a function that takes them."""
    own = inspect.signature(function).parameters
    fields = inspect.signature(StitchOptions).parameters
    ordered = sorted([*own.values(), *fields.values()], key=lambda one: one.kind)
    setattr(function, "__signature__", inspect.Signature(ordered))  # noqa: B010
    return function
