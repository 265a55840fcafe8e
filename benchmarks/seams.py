"""Seams against their peers, every method on the same problems in one run.

    python benchmarks/seams.py                  the short version, about five minutes
    python benchmarks/seams.py --sizes 80x20 160x40 --pairs 20

Sizes are length × width of the overlap in px. Pairs are random crops of photographs in scikit-image's wheel; where a photograph is too
small it is continued by reflection. Times are medians in ms of the seam search alone, with the match cost given, on one BLAS thread (for
OpenCV: its own call, which computes its own cost). Ratios are cost ÷ exact optimum of the match cost (2.4), or (3.22) for OpenCV's
colour-only finders, which minimise something like it.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import platform
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator

import cv2
import numpy as np
import numpy.typing as npt
from skimage import data
from skimage.graph import route_through_array

import toposeam as ts
from toposeam.heat.threads import one_thread
from toposeam.seam.dynamic_programming import dp_labels
from toposeam.seam.exact import exact_labels
from toposeam.seam.find import seam_problem
from toposeam.seam.graph_cut import graph_cut_labels
from toposeam.seam.heat import HeatOptions, heat_path
from toposeam.seam.problem import SeamProblem
from toposeam.seam.thesis import ThesisOptions, thesis_path

PHOTOGRAPHS = ("brick", "grass", "gravel", "coffee", "chelsea", "astronaut", "rocket")
Labels = npt.NDArray[np.bool_]


def crops(name: str, length: int, width: int, rng: np.random.Generator) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Two crops of a photograph, (length, width[, 3])."""
    image = getattr(data, name)()
    room = [max(0, size + 40 - image.shape[axis]) for axis, size in enumerate((length, width))]
    image = np.pad(image, [(0, room[0]), (0, room[1])] + [(0, 0)] * (image.ndim - 2), mode="symmetric")

    def crop() -> npt.NDArray[np.uint8]:
        y, x = (rng.integers(image.shape[axis] - size + 1) for axis, size in enumerate((length, width)))
        return np.ascontiguousarray(image[y : y + length, x : x + width])

    return crop(), crop()


def opencv(finder: Callable[[], object]) -> Callable[[SeamProblem, npt.NDArray[np.uint8], npt.NDArray[np.uint8]], tuple[Labels, float]]:
    """A seam finder of OpenCV's stitching module, with the border columns fixed by masks as in our strips."""

    def run(problem: SeamProblem, a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> tuple[Labels, float]:
        images = [cv2.cvtColor(x, cv2.COLOR_GRAY2BGR) if x.ndim == 2 else x for x in (a, b)]
        masks = [np.full(a.shape[:2], 255, np.uint8) for _ in images]
        masks[0][:, -1] = 0
        masks[1][:, 0] = 0
        started = time.perf_counter()
        found = finder().find([x.astype(np.float32) for x in images], [(0, 0), (0, 0)], [cv2.UMat(m) for m in masks])  # type: ignore[attr-defined]
        seconds = time.perf_counter() - started
        shows_b = np.asarray(found[1].get() if isinstance(found[1], cv2.UMat) else found[1]) > 0
        labels = problem.overlap.window(shows_b).astype(bool)
        return labels, seconds

    return run


def route(problem: SeamProblem) -> Labels:
    """scikit-image's minimum cost path over pixels, from the top row to the bottom row; b to its right, the path itself a's."""
    across = (((0, 0), (0, 1)), ((0, 0), (1, 0)))
    along = (((0, 1), (0, 0)), ((1, 0), (0, 0)))
    cost = 0.25 * sum(np.pad(array, pad) for array, pads in ((problem.right, across), (problem.down, along)) for pad in pads)
    inner = cost[1:-1, 2:-2]
    room = np.pad(inner, ((1, 1), (0, 0)), constant_values=1e-9)
    path, _ = route_through_array(room, (0, 0), (room.shape[0] - 1, 0), fully_connected=False)
    on_path = np.zeros(room.shape, bool)
    on_path[tuple(np.array(path).T)] = True
    from scipy import ndimage

    rest, _ = ndimage.label(np.pad(~on_path[1:-1], ((0, 0), (1, 1)), constant_values=True))
    labels = np.zeros(cost.shape, bool)
    labels[1:-1, 1:-1] = rest == rest[0, -1]
    return labels


def timed(solve: Callable[[SeamProblem], Labels]) -> Callable[..., tuple[Labels, float]]:
    """A method that takes a problem, with its seconds."""

    def run(problem: SeamProblem, a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> tuple[Labels, float]:
        with one_thread():
            started = time.perf_counter()
            labels = solve(problem)
            return labels, time.perf_counter() - started

    return run


#: name: (run, largest overlap in px it is asked to do in the short version, whether it minimises the cost without gradients)
METHODS: dict[str, tuple[Callable[..., tuple[Labels, float]], int, bool]] = {
    "heat": (timed(lambda p: heat_path(p, HeatOptions()).labels), 10**8, False),
    "thesis": (timed(lambda p: thesis_path(p, ThesisOptions()).labels), 60_000, False),
    "shortest-path (dual Dijkstra)": (timed(exact_labels), 10**8, False),
    "dp": (timed(dp_labels), 10**8, False),
    "graph-cut (PyMaxflow)": (timed(graph_cut_labels), 300_000, False),
    "scikit-image route_through_array": (timed(route), 10**8, False),
    "OpenCV GraphCut COLOR": (opencv(lambda: cv2.detail_GraphCutSeamFinder("COST_COLOR")), 120_000, True),
    "OpenCV GraphCut COLOR_GRAD": (opencv(lambda: cv2.detail_GraphCutSeamFinder("COST_COLOR_GRAD")), 120_000, False),
    "OpenCV DP COLOR": (opencv(lambda: cv2.detail_DpSeamFinder("COLOR")), 10**8, True),
}


def problems(
    length: int, width: int, pairs: int, seed: int
) -> Iterator[tuple[SeamProblem, SeamProblem, npt.NDArray[np.uint8], npt.NDArray[np.uint8]]]:
    """Pairs of crops with their problems: match cost with and without gradients."""
    for index in range(pairs):
        rng = np.random.default_rng([seed, length, width, index])
        a, b = crops(PHOTOGRAPHS[index % len(PHOTOGRAPHS)], length, width, rng)
        with_gradient, plain = (seam_problem(a, b, None, None, "right", ts.MatchCost(gradient=gradient))[0] for gradient in (True, False))
        yield with_gradient, plain, a, b


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", default=["80x20", "160x40", "320x80", "640x160"], help="length x width of the overlaps, px")
    parser.add_argument("--pairs", type=int, default=14, help="pairs of crops per size (fewer for the largest)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--all", action="store_true", help="ask every method for every size")
    options = parser.parse_args()
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("numpy", "scipy", "PyMaxflow", "opencv-python-headless"))
    print(f"toposeam {ts.__version__}, Python {platform.python_version()}, {versions}; {platform.processor() or platform.machine()}\n")
    for size in options.sizes:
        length, width = (int(part) for part in size.split("x"))
        pairs = max(3, min(options.pairs, round(options.pairs * 60_000 / (length * width))))
        seconds, ratios = defaultdict(list), defaultdict(list)
        for with_gradient, plain, a, b in problems(length, width, pairs, options.seed):
            optimum = {id(p): p.cost(exact_labels(p)) for p in (with_gradient, plain)}
            for name, (run, largest, colour_only) in METHODS.items():
                if length * width > largest and not options.all:
                    continue
                problem = plain if colour_only else with_gradient
                _ = problem.grid, problem.interfaces  # given to every method alike
                labels, took = run(problem, a, b)
                seconds[name].append(took)
                ratios[name].append(problem.cost(labels) / optimum[id(problem)])
        reference = statistics.median(seconds["graph-cut (PyMaxflow)"]) if seconds["graph-cut (PyMaxflow)"] else float("nan")
        print(f"{length} × {width} px, {pairs} pairs")
        print(f"{'':<34}{'ms':>10}{'÷ PyMaxflow':>13}{'cost ÷ optimum':>17}{'worst':>9}")
        for name in METHODS:
            if seconds[name]:
                median, ratio = statistics.median(seconds[name]), statistics.median(ratios[name])
                print(f"{name:<34}{1e3 * median:>10.2f}{median / reference:>13.2f}{ratio:>17.4f}{max(ratios[name]):>9.3f}")
        print(flush=True)


if __name__ == "__main__":
    main()
