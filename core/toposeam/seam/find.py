"""`find_seam`: one call for every method."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask
from toposeam.checks import check_choice, check_function, options_from
from toposeam.errors import MissingPackageError, OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.seam.problem.match_cost import Law, MatchCost
from toposeam.seam.problem.overlap import Side
from toposeam.seam.problem.posing import pose
from toposeam.seam.problem.seam_problem import SeamProblem, Solution
from toposeam.seam.result.seam import Seam, seam_of
from toposeam.typing import METHODS as METHODS
from toposeam.typing import Method as Method

if TYPE_CHECKING:
    from toposeam.seam.heat.method import HeatOptions
    from toposeam.seam.keywords import SeamKeywords
    from toposeam.seam.thesis.options import ThesisOptions


@dataclass(frozen=True, slots=True)
class _Engine:
    """The place of a method's code. Its modules are imported when the method is first asked for."""

    #: A module of `toposeam.seam`, and the function in it that solves a `SeamProblem`.
    module: str
    function: str
    #: Module and name of the class of its options; None for a direct method, whose function returns labels.
    options: tuple[str, str] | None = None
    #: Whether its labelling is the one of least cost.
    exact: bool = False


#: The engine of every method but "auto", which chooses one of them (:mod:`toposeam.seam.automatic`).
_ENGINES = {
    "heat": _Engine("heat.method", "heat_path", ("heat.method", "HeatOptions")),
    "thesis": _Engine("thesis.method", "thesis_path", ("thesis.options", "ThesisOptions")),
    "shortest-path": _Engine("exact.optimum", "exact_labels", exact=True),
    "dp": _Engine("dynamic_programming", "dp_labels"),
    "graph-cut": _Engine("exact.graph_cut", "graph_cut_labels", exact=True),
}


def _loaded(module: str, name: str) -> Any:
    return getattr(import_module(f"toposeam.seam.{module}"), name)


def find_seam(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None = None,
    mask_b: npt.ArrayLike | None = None,
    *,
    side: Side | None = None,
    method: Method = "auto",
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    speck: float | None = None,
    data_range: float | None = None,
    options: HeatOptions | ThesisOptions | None = None,
    prove: bool = False,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
    **given: Unpack[SeamKeywords],
) -> Seam:
    """Find the seam along which two overlapping patches join unnoticed.

    Parameters
    ----------
    a, b : (H, W) or (H, W, C) array_like
        The patches on one canvas, same height and width; integers are scaled to [0, 1], one channel is
        widened to the other's number.
    mask_a, mask_b : (H, W) array_like, optional
        Where each patch has pixels. The overlap is their intersection, and what only one patch covers fixes
        its side. A mask that is left out covers the whole canvas. With neither, the arrays *are* the overlap.
    side : {"right", "left", "bottom", "top"}, optional
        Without masks: where ``b`` continues, by default to the right. The border column or row on ``a``'s
        side stays ``a``'s, the opposite one ``b``'s. Masks say it themselves: not both.
    method : {"auto", "heat", "thesis", "shortest-path", "dp", "graph-cut"}
        `auto` takes the exact solver that is fastest for the overlap (:mod:`toposeam.seam.automatic`), and
        ``Seam.method`` says which; `heat` converges the flux of a conductor network; `thesis` follows
        Algorithms 1 and 2 of the thesis with MMA; `shortest-path` is the exact optimum; `dp` the best seam
        that never turns back; `graph-cut` needs PyMaxflow.
    gradient : bool, optional
        Short for the law "gradient" (2.4), or "colour" (3.22). Not together with `cost`.
    cost : MatchCost, optional
        All options of the match cost. By default its law is "natural", and "gradient" for method `thesis`.
    weight : (H, W) array_like, optional
        A positive factor on the cost of each pixel's interfaces.
    avoid : (H, W) array_like, optional
        Pixels the seam must not touch.
    core : float in (0, 1]
        For a patch that lies inside the other, the share of its depth, from its middle outwards, that must
        show: 1 is all of it but its border, where the seam must run, and 0.05 hardly more than its middle
        (:mod:`toposeam.seam.problem.overlap`).
    speck : float, optional
        Least number of connected pixels that a piece inside the other patch must be able to show; a smaller
        one need not show at all, unless the patch has hardly anything else. By default 64, or 0.05 % of the
        patch's own pixels if that is more. 0 lets every piece show.
    data_range : float, optional
        The value that counts as white, for integers other than uint8 and uint16 and for floats beyond [0, 1].
    options : HeatOptions or ThesisOptions, optional
        Options of the method; their fields may be given as plain keywords instead. With `auto` they are
        those of `heat`, and choose it.
    prove : bool
        Also compute the cost of the best seam as ``Seam.bound``: by shortest path where the seam is one, else
        by maximum flow (PyMaxflow's where it is installed). The seam stays the method's.
    record_frames : bool
        Keep the densities of every iteration in ``Seam.frames``. With `auto` that chooses `heat`.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    **given
        Fields of :class:`HeatOptions` or :class:`ThesisOptions`.

    Returns
    -------
    Seam

    Raises
    ------
    ImageError, OverlapError, OptionError, MissingPackageError
        Their text says what was received and what to do.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> rng = np.random.default_rng(0)
    >>> a = rng.random((20, 12)); b = a.copy(); b[:, :5] = 1 - b[:, :5]
    >>> seam = ts.find_seam(a, b)
    >>> seam.labels[:, 0].any(), seam.labels[:, -1].all()
    (np.False_, np.True_)
    """
    check_function("progress", progress)
    for name, value in (("prove", prove), ("record_frames", record_frames)):
        check_choice(name, value, (True, False))
    method = method_for(method, heats=record_frames or bool(given) or options is not None)
    chosen = method_options(method, given, options)
    problem, only_b, settings = pose(
        a,
        b,
        mask_a,
        mask_b,
        side,
        gradient,
        cost,
        weight=weight,
        avoid=avoid,
        core=core,
        speck=speck,
        data_range=data_range,
        usual=usual_law(method),
    )
    if chosen is not None:
        settings |= dataclasses.asdict(chosen)
    started = time.perf_counter()
    solution = solve(problem, method, chosen, record_frames=record_frames, progress=progress)
    seconds = time.perf_counter() - started
    if prove:
        solution = dataclasses.replace(solution, bound=least_cost(problem, problem.total(solution.labels)))
    return seam_of(problem, only_b, solution, solution.method or method, settings, seconds)


def method_for(method: Method, *, heats: bool) -> Method:
    """Return the method to run: `auto` becomes `heat` where the call asks for what only heat provides.

    Raises
    ------
    OptionError
        When there is no such method.
    """
    check_choice("method", method, METHODS)
    return "heat" if method == "auto" and heats else method


def usual_law(method: Method) -> Law:
    """Return the law of the match cost that a method minimises by default."""
    return "gradient" if method == "thesis" else "natural"


def least_cost(problem: SeamProblem, known: float) -> float:
    """Compute the cost of the best labelling, given the cost of a known one.

    Capacities of maximum flows are rounded (:func:`toposeam.seam.exact.maximum_flow.minimum_cut`);
    PyMaxflow's are not.
    """
    from toposeam.seam.exact.graph_cut import least_cut
    from toposeam.seam.exact.optimum import exact_labels, labels_of_nodes

    def flow(problem: SeamProblem, pixels: Mask) -> Mask:
        network, weight, index = problem.grid.network(pixels)
        return labels_of_nodes(least_cut(network, weight), index, pixels.shape)

    try:
        labels = exact_labels(problem, known, flow)
    except MissingPackageError:
        labels = exact_labels(problem, known)
    return min(known, problem.total(labels))


def method_options(
    method: Method, given: Mapping[str, Any], options: HeatOptions | ThesisOptions | None = None
) -> HeatOptions | ThesisOptions | None:
    """Return the checked options of a method; None for `auto` and for direct methods, which take none.

    Parameters
    ----------
    method : str
    given : mapping
        Options as plain keywords.
    options : HeatOptions or ThesisOptions, optional
        Instead of them.

    Raises
    ------
    OptionError
        For an unknown method or options it does not have.
    """
    check_choice("method", method, METHODS)
    engine = _ENGINES.get(method)
    if engine is None or engine.options is None:
        unwanted = sorted(given) + ([] if options is None else ["options"])
        if unwanted:
            raise OptionError(
                "{method} takes no options, but {names} was given; leave it out",
                kind="conflict",
                parameter=Term(unwanted[0]),
                method=Term("method", f"method {method}", value=method),
                names=tuple(map(Term, unwanted)),
            )
        return None
    kind: type[HeatOptions | ThesisOptions] = _loaded(*engine.options)
    return options_from(kind, options, dict(given), f"method {method}")


def solve(
    problem: SeamProblem,
    method: Method,
    options: HeatOptions | ThesisOptions | None,
    *,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Solution:
    """Solve a problem by a method.

    Parameters
    ----------
    problem : SeamProblem
    method : str
    options : HeatOptions or ThesisOptions or None
        As :func:`method_options` returns them for the method.
    record_frames, progress
        As for :func:`find_seam`; direct methods have no use for them.
    """
    if method == "auto":
        from toposeam.seam.automatic import best_path

        return best_path(problem, progress)
    engine = _ENGINES[method]
    run = _loaded(engine.module, engine.function)
    if engine.options is not None:
        with one_thread():
            found: Solution = run(problem, options, record_frames=record_frames, progress=progress)
        return found
    labels: Mask = run(problem)
    bound = problem.total(labels) if engine.exact else 0.0
    return Solution(labels=labels, soft=labels.astype(np.float32), bound=bound)
