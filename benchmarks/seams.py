"""Seams against their peers, every method on the same problems in one run.

    python benchmarks/seams.py                  the short version, a few minutes
    python benchmarks/seams.py --all            up to 4000 × 1000 px, ten minutes
    python benchmarks/seams.py --sizes 80x20 160x40 --pairs 20
    python benchmarks/seams.py --methods heat graph-cut --sizes 160x40 640x160 2000x500
    python benchmarks/seams.py --irregular      large rings, Ls and islands, PyMaxflow as oracle

Sizes are length × width of the overlap in px. Pairs are random crops of photographs in scikit-image's wheel,
and generated noise with a 1/f spectrum; where a photograph is too small, a canvas is tiled with different
crops of it, some of them mirrored. Times are medians in ms of processor time on one thread, of everything a
method does once the match cost is given: for heat the coarse networks, for Dijkstra and PyMaxflow the graph
(OpenCV's finders and `find_seam` compute a cost of their own). Quotients are medians over the pairs that both
were asked for; "÷ flow" is to PyMaxflow, "÷ path" to the whole of shortest-path, which "Dijkstra alone",
SciPy's call on the finished graph, is not.

What a seam costs, "÷ best", the optimum of the match cost (2.4), is said of the methods that minimise it.
What it shows is said of all: the mean of 1 - SSIM along it in windows of 15 px, ÷ that of the least cost's
seam.

A method that takes longer than --patience seconds (PyMaxflow: five times that) is not asked for further pairs
of that size, nor for larger sizes.

Peak memory is that of a process of its own that reads a pair, computes the match cost and finds the seam,
interpreter and libraries included, in MiB and as a multiple of one RGB overlap in float32.
"""

from __future__ import annotations

import argparse
import dataclasses
import multiprocessing
import statistics
import textwrap
import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from scipy import ndimage
from skimage.graph import route_through_array

import toposeam as ts
from seam_pairs import IRREGULAR, Labels, Picture, beside, pair, unlikeness
from stamp import stamp
from toposeam import _kernels
from toposeam.heat.threads import one_thread
from toposeam.seam.dynamic_programming import dp_labels
from toposeam.seam.exact import corner_graph
from toposeam.seam.exact.graph_cut import graph_cut_labels
from toposeam.seam.exact.optimum import exact_labels
from toposeam.seam.heat.method import HeatOptions, heat_path
from toposeam.seam.problem.overlap import FREE, B
from toposeam.seam.problem.posing import seam_problem
from toposeam.seam.problem.seam_problem import SeamProblem
from toposeam.seam.thesis.method import thesis_path
from toposeam.seam.thesis.options import ThesisOptions

SIZES = ("80x20", "160x40", "320x80", "640x160", "1000x250", "2000x500", "4000x1000")
#: Overlaps from this many px on have their memory measured; in smaller ones it is the interpreter's.
LARGE = 1_000_000


def opencv(finder: Callable[[], object]) -> Callable[[SeamProblem, Picture, Picture], tuple[Labels, float]]:
    """A seam finder of OpenCV's stitching module, with the border columns fixed by masks as in our strips."""

    def run(problem: SeamProblem, a: Picture, b: Picture) -> tuple[Labels, float]:
        images = [cv2.cvtColor(x, cv2.COLOR_GRAY2BGR) if x.ndim == 2 else x for x in (a, b)]
        masks = [np.full(a.shape[:2], 255, np.uint8) for _ in images]
        masks[0][:, -1] = 0
        masks[1][:, 0] = 0
        started = time.process_time()
        found = finder().find(
            [x.astype(np.float32) for x in images], [(0, 0), (0, 0)], [cv2.UMat(m) for m in masks]
        )  # type: ignore[attr-defined]
        seconds = time.process_time() - started
        shows_b = np.asarray(found[1].get() if isinstance(found[1], cv2.UMat) else found[1]) > 0
        labels = problem.overlap.window(shows_b).astype(bool)
        return labels, seconds

    return run


def route(problem: SeamProblem) -> Labels:
    """scikit-image's minimum cost path over pixels, from the top row to the bottom row; b to its right, the
    path itself a's.
    """
    across = (((0, 0), (0, 1)), ((0, 0), (1, 0)))
    along = (((0, 1), (0, 0)), ((1, 0), (0, 0)))
    cost = 0.25 * sum(
        np.pad(array, pad) for array, pads in ((problem.right, across), (problem.down, along)) for pad in pads
    )
    inner = cost[1:-1, 2:-2]
    room = np.pad(inner, ((1, 1), (0, 0)), constant_values=1e-9)
    path, _ = route_through_array(room, (0, 0), (room.shape[0] - 1, 0), fully_connected=False)
    on_path = np.zeros(room.shape, bool)
    on_path[tuple(np.array(path).T)] = True
    rest, _ = ndimage.label(np.pad(~on_path[1:-1], ((0, 0), (1, 1)), constant_values=True))
    labels = np.zeros(cost.shape, bool)
    labels[1:-1, 1:-1] = rest == rest[0, -1]
    return labels


def timed(solve: Callable[[SeamProblem], Labels]) -> Callable[..., tuple[Labels, float]]:
    """A method that takes a problem, with its seconds; nothing it derives from the match cost is there
    before.
    """

    def run(problem: SeamProblem, *_: Picture) -> tuple[Labels, float]:
        fresh = dataclasses.replace(problem)
        with one_thread():
            started = time.process_time()
            labels = solve(fresh)
            return labels, time.process_time() - started

    return run


def shortest_path(problem: SeamProblem) -> tuple[Labels, float, float]:
    """The exact seam, the seconds of the whole method, and those of SciPy's Dijkstra alone."""
    alone, inner = [], corner_graph.dijkstra

    def watched(*arguments: object, **options: object) -> object:
        started = time.process_time()
        result = inner(*arguments, **options)
        alone.append(time.process_time() - started)
        return result

    labels, whole = timed(exact_labels)(problem)
    library, _kernels.library = _kernels.library, None
    corner_graph.dijkstra = watched
    try:
        timed(exact_labels)(problem)
    finally:
        corner_graph.dijkstra, _kernels.library = inner, library
    return labels, whole, sum(alone)


def default(problem: SeamProblem, a: Picture, b: Picture) -> tuple[Labels, float]:
    """`find_seam` as anybody calls it: the natural law, and the method that is fastest."""
    with one_thread():
        started = time.process_time()
        labels = ts.find_seam(a, b).labels
        return np.pad(labels, 1), time.process_time() - started


HEAT, DIJKSTRA, MAXFLOW = "heat", "shortest-path", "graph-cut (PyMaxflow)"
ALONE = "    Dijkstra alone"

#: Whose times the others are compared with, and the width of the column.
PEERS = ((MAXFLOW, 8), (DIJKSTRA, 8))

#: name: (run, whether it minimises the match cost)
METHODS: dict[str, tuple[Callable[..., tuple[Labels, float]], bool]] = {
    HEAT: (timed(lambda p: heat_path(p, HeatOptions()).labels), True),
    "thesis": (timed(lambda p: thesis_path(p, ThesisOptions()).labels), True),
    DIJKSTRA: (timed(exact_labels), True),
    ALONE: (timed(exact_labels), True),
    "dp": (timed(dp_labels), True),
    MAXFLOW: (timed(graph_cut_labels), True),
    "find_seam, natural law": (default, False),
    "skimage route_through_array": (timed(route), False),
    "OpenCV GraphCut COLOR": (opencv(lambda: cv2.detail_GraphCutSeamFinder("COST_COLOR")), False),
    "OpenCV GraphCut COLOR_GRAD": (opencv(lambda: cv2.detail_GraphCutSeamFinder("COST_COLOR_GRAD")), False),
    "OpenCV DP COLOR": (opencv(lambda: cv2.detail_DpSeamFinder("COLOR")), False),
}


def problem_of(a: Picture, b: Picture, *masks: Labels) -> SeamProblem:
    return seam_problem(a, b, *(masks or (None, None)), "right", ts.seam.MatchCost(law="gradient"))[0]


def irregular(seeds: list[int]) -> None:
    """Large overlaps of other shapes than strips; PyMaxflow says what is best."""
    print(
        f"{'':<34}{'free px':>9}{'heat s':>8}{'÷ PyMaxflow':>13}{'÷ path':>8}"
        f"{'cost ÷ optimum':>16}{'worst':>9}"
    )
    for name, shape in IRREGULAR.items():
        masks = shape()
        took, peers, exacts, ratios = [], [], [], []
        for seed in seeds:
            problem = problem_of(*pair(*masks[0].shape, 1 + seed, seed), *masks)
            found, seconds = METHODS[HEAT][0](problem)
            best, peer = METHODS[MAXFLOW][0](problem)
            if name.startswith("L"):
                exacts.append(METHODS[DIJKSTRA][0](problem)[1])
            took.append(seconds)
            peers.append(peer)
            ratios.append(problem.cost(found) / problem.cost(best))
        free = np.count_nonzero(problem.overlap.side == FREE)
        share = f"{quotient(took, exacts):>8.2f}" if exacts else f"{'–':>8}"
        print(
            f"{name:<34}{free:>9}{statistics.median(took):>8.2f}{quotient(took, peers):>13.3f}{share}"
            f"{statistics.median(ratios):>16.4f}{max(ratios):>9.4f}",
            flush=True,
        )


def peak_memory(name: str, length: int, width: int, seed: int) -> int:
    """Bytes that this process, which has just started, has had at most once the method is done."""
    a, b = pair(length, width, 0, seed)
    METHODS[name][0](problem_of(a, b), a, b)
    status = Path("/proc/self/status").read_text(
        encoding="ascii"
    )  # unlike ru_maxrss, not passed on by the process that started this one
    return 1024 * next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM"))


def exponent(points: list[tuple[int, float]]) -> float:
    """P of the power law seconds ~ pixels^p through (pixels, seconds), by least squares of the logarithms."""
    pixels, seconds = np.log(np.array(points, float)).T
    return float(np.polyfit(pixels, seconds, 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--sizes",
        nargs="+",
        help=f"length x width of the overlaps, px; {' '.join(SIZES[:4])} 1000x250 by default",
    )
    parser.add_argument(
        "--pairs", type=int, default=8, help="pairs of crops per size and seed, half as many from 2000x500 on"
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument(
        "--methods",
        nargs="+",
        metavar="NAME",
        help="only methods whose names begin so; the exact one is always asked",
    )
    parser.add_argument(
        "--irregular", action="store_true", help="large overlaps of other shapes, instead of strips"
    )
    parser.add_argument(
        "--patience", type=float, default=2.0, help="seconds for a method, five times that for PyMaxflow"
    )
    parser.add_argument("--all", action="store_true", help="every size")
    parser.add_argument(
        "--figure", type=Path, help="draw times over sizes, as the thesis's Figure 3.27, into this file"
    )
    options = parser.parse_args()
    cv2.setNumThreads(1)
    sizes = options.sizes or (SIZES if options.all else SIZES[:5])
    print(stamp())
    if options.irregular:
        irregular(options.seeds)
        return
    curves: dict[str, list[tuple[int, float]]] = defaultdict(list)
    begin = tuple(options.methods or ("",))
    wanted = [name for name in METHODS if name in (DIJKSTRA, ALONE) or name.startswith(begin)]
    for size in sizes:
        length, width = (int(part) for part in size.split("x"))
        pairs = [(index, seed) for seed in options.seeds for index in range(options.pairs)]
        wanted = measure(length, width, pairs, wanted, options.patience, curves)
    fits = {
        name: exponent(part)
        for name, points in curves.items()
        if len(part := [p for p in points if p[0] >= 6400]) > 2
    }
    if fits:
        powers = ", ".join(f"{name.strip()} {p:.2f}" for name, p in fits.items())
        print(textwrap.fill(f"time ~ pixels^p from 160 × 40 px on: {powers}", 88))
    if options.figure:
        draw(curves, fits, options.figure)


def measure(
    length: int,
    width: int,
    pairs: list[tuple[int, int]],
    asked: list[str],
    patience: float,
    curves: dict[str, list[tuple[int, float]]],
) -> list[str]:
    """Print the table of one size and add to the curves; returns the methods to ask for the next size."""
    limit = {
        name: float("inf")
        if name in (HEAT, DIJKSTRA, ALONE)
        else 5 * patience
        if name == MAXFLOW
        else patience
        for name in asked
    }
    large = length * width >= LARGE
    seconds, ratios, shown, spent = defaultdict(list), defaultdict(list), defaultdict(list), []
    for index, seed in pairs:
        if large and index >= max(1, len(pairs) // 4):
            continue
        a, b = pair(length, width, index, seed)
        started = time.process_time()
        problem = problem_of(a, b)
        spent.append(time.process_time() - started)
        best, whole, alone = shortest_path(problem)
        seen = along(problem, a, b)
        best_seen, best_cost = seen(best), problem.cost(best)
        for name in asked:
            if max(seconds[name], default=0.0) > limit[name]:
                continue
            run, minimises = METHODS[name]
            labels, took = (
                (best, whole) if name == DIJKSTRA else (best, alone) if name == ALONE else run(problem, a, b)
            )
            seconds[name].append(took)
            shown[name].append(seen(labels) / best_seen)
            if minimises:
                ratios[name].append(problem.cost(labels) / best_cost)
    median = {name: statistics.median(seconds[name]) for name in asked}
    patient = [name for name in asked if median[name] <= limit[name]]
    memory = {}
    for name in patient if large else []:
        if name != ALONE:
            with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as own:
                memory[name] = own.submit(peak_memory, name, length, width, pairs[0][1]).result()
    print(f"{length} × {width} px, {len(spent)} pairs; match cost {1e3 * statistics.median(spent):.1f} ms")
    print(
        f"{'':<28}{'ms':>9}{'÷ flow':>8}{'÷ path':>8}{'÷ best':>8}{'worst':>7}"
        f"{'1-SSIM':>8}{'MiB':>6}{'× RGB':>7}"
    )
    for name in asked:
        took = median[name]
        quotients = "".join(
            f"{quotient(seconds[name], seconds[peer]):>{space}.3f}" if seconds[peer] else f"{'–':>{space}}"
            for peer, space in PEERS
        )
        cost = (
            f"{statistics.median(ratios[name]):>8.4f}{max(ratios[name]):>7.3f}"
            if ratios[name]
            else f"{'–':>8}{'':>7}"
        )
        peak = (
            f"{memory[name] / 2**20:>6.0f}{memory[name] / (12 * length * width):>7.1f}"
            if name in memory
            else ""
        )
        few = "" if len(seconds[name]) == len(spent) else f"  (pairs: {len(seconds[name])})"
        seen = statistics.median(shown[name])
        line = f"{name:<28}{1e3 * took:>9.2f}{quotients}{cost}{seen:>8.3f}{peak}{few}"
        print(line.rstrip())
        curves.setdefault(name, []).append((length * width, took))
    if HEAT in median:
        both = median[HEAT] + statistics.median(spent)
        curves.setdefault("heat and match cost", []).append((length * width, both))
    print(flush=True)
    return patient


def along(problem: SeamProblem, a: Picture, b: Picture) -> Callable[[Labels], float]:
    """What a seam of a strip shows: the mean of 1 - SSIM on both sides of it."""
    everywhere = np.ones(a.shape[:2], bool)
    unlike, side = unlikeness(a, b, everywhere)[0], problem.overlap.side

    def seen(labels: Labels) -> float:
        shows_b = np.where(side == FREE, labels, side == B)[1:-1, 1:-1]
        return float(unlike[beside(shows_b, everywhere)].mean())

    return seen


def quotient(mine: list[float], peers: list[float]) -> float:
    """Median quotient of times over the pairs that both methods were asked for."""
    return statistics.median([m / p for m, p in zip(mine, peers, strict=False)] or [float("nan")])


def draw(curves: dict[str, list[tuple[int, float]]], fits: dict[str, float], file: Path) -> None:
    """Times over sizes with their fitted exponents, both axes logarithmic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    shown = {
        HEAT: ("C3", "o"),
        "thesis": ("C1", "s"),
        DIJKSTRA: ("C0", "^"),
        ALONE: ("C9", "v"),
        MAXFLOW: ("0.2", "D"),
        "OpenCV GraphCut COLOR_GRAD": ("0.6", "x"),
    }
    for name, (colour, marker) in shown.items():
        if name in curves:
            pixels, seconds = zip(*curves[name], strict=True)
            label = name.strip() + (f", p = {fits[name]:.2f}" if name in fits else "")
            axes.loglog(
                pixels, seconds, color=colour, marker=marker, markersize=4, linewidth=1.2, label=label
            )
    axes.set(xlabel="overlap, px", ylabel="processor time, s")
    axes.grid(which="major", color="0.9")
    axes.legend(
        fontsize=8,
        frameon=False,
        title="time ~ pixels$^p$ from 160 × 40 px on",
        title_fontsize=8,
        alignment="left",
    )
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.savefig(file)


if __name__ == "__main__":
    main()
