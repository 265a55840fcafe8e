"""Surfaces beside PyMaxflow's three-dimensional graph cut, and loops beside cross-fades, in one run.

    python benchmarks/surfaces.py                      quality, sizes and loops: a few minutes
    python benchmarks/surfaces.py --quality 40 --whole 0   the same volumes with a slab, whatever their size
    python benchmarks/surfaces.py --large              also up to 150 × 360 × 640 voxels, without PyMaxflow
    python benchmarks/surfaces.py --quality 0 --sizes --loops others   loops only, of other clips

Volumes are clips of noise that two flows carry across each other; a and b are moments of one clip, far apart.
Times are processor seconds on one thread of what a method does once the match cost is given. PyMaxflow's is
that of its ``maxflow()`` alone, without building its graph. Costs are divided by the optimum that it finds.
Memory is the peak of a process of its own, interpreter and libraries included.

Of loops, made with ``level``: the greatest step from frame to frame within the transition, and the step from
the last frame to the first, each divided by the 95th percentile of the given clip's steps (means of absolute
differences); spot: the same of the place that steps most, which a mean over the picture would hide; and
edges: how far the energy of gradients in the transition's frames is from that of the two stretches it is made
of (0: as many edges as there should be; a cross-fade of unlike frames loses half, a hard cut adds some).
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage

import toposeam as ts
from toposeam.heat.threads import one_thread
from toposeam.volume.heat.method import SurfaceOptions, heat_surface
from toposeam.volume.problem.posing import surface_problem
from toposeam.volume.problem.surface_problem import SurfaceProblem

sys.path.insert(0, str(Path(__file__).parents[1] / "samples"))
import clips

from stamp import stamp
from volumes import Masks, carried, drawn

SIZES = ("16x60x80", "32x90x120", "40x120x160")
LARGE = ("70x160x240", "100x240x420", "150x360x640")


def posed(shape: tuple[int, ...], masks: Masks, gradient: bool, seed: int) -> SurfaceProblem:
    rng = np.random.default_rng(seed)
    a, b = carried(*shape, rng, 2 * shape[0])
    axis = 0
    return surface_problem(a, b, *masks, axis, ts.seam.MatchCost(law="gradient" if gradient else "colour"))[0]


def optimum(problem: SurfaceProblem) -> tuple[float, float]:
    """The least cost, and the seconds PyMaxflow takes for it."""
    import maxflow

    network, weight, index = problem.network()
    n = network.n
    graph = maxflow.GraphFloat(n, len(weight))
    graph.add_nodes(n)
    inner = network.head < n
    graph.add_edges(network.tail[inner], network.head[inner], weight[inner], weight[inner])
    ends = [
        np.bincount(network.tail[network.head == terminal], weight[network.head == terminal], n)
        for terminal in (n, n + 1)
    ]
    graph.add_grid_tedges(np.arange(n), ends[0], ends[1])
    started = time.process_time()
    graph.maxflow()
    seconds = time.process_time() - started
    labels = np.zeros(problem.overlap.side.shape, bool)
    labels.ravel()[index] = graph.get_grid_segments(np.arange(n))
    return problem.cost(labels), seconds


def heated(
    problem: SurfaceProblem, options: SurfaceOptions
) -> tuple[npt.NDArray[np.bool_], float, float, int]:
    """Labels, bound, seconds and sweeps of method heat."""
    started = time.process_time()
    with one_thread():
        solution, bound = heat_surface(problem, options)
    seconds = time.process_time() - started
    sweeps = 50 * (sum(record.stage == 1 for record in solution.history) - 1)
    return solution.labels, bound, seconds, sweeps


def quality(count: int, whole: int) -> None:
    print(f"{'':<9}{'volumes':>8}{'÷ optimum':>11}{'worst':>9}{'÷ bound':>9}{'÷ PyMaxflow':>13}{'worst':>8}")
    everything: list[float] = []
    for name, volumes in drawn(count):
        ratios, proven, times = [], [], []
        for volume in volumes:
            problem = posed(*volume)
            best, cut_time = optimum(problem)
            labels, bound, seconds, _ = heated(problem, SurfaceOptions(whole=whole))
            ratios.append(problem.cost(labels) / best)
            proven.append(problem.cost(labels) / bound if bound else np.nan)
            times.append(seconds / cut_time)
        everything += ratios
        print(
            f"{name:<9}{len(ratios):>8}{np.median(ratios):>11.5f}{max(ratios):>9.5f}{np.median(proven):>9.4f}"
            f"{np.median(times):>13.2f}{max(times):>8.2f}",
            flush=True,
        )
    print(f"{'all':<9}{len(everything):>8}{np.median(everything):>11.5f}{max(everything):>9.5f}")


def sizes(names: tuple[str, ...], peer: bool) -> list[tuple[float, float]]:
    print(
        f"\n{'voxels':<14}{'cost':<8}{'heat, s':>9}{'sweeps':>8}{'PyMaxflow, s':>14}{'heat ÷ it':>11}"
        f"{'÷ optimum':>11}{'÷ bound':>9}{'peak, MiB':>11}"
    )
    measured = []
    for name in names:
        shape = tuple(map(int, name.split("x")))
        for gradient in (False, True) if peer else (False,):
            with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
                cost, bound, seconds, sweeps, peak = pool.submit(one_size, shape, gradient).result()
            best, cut_time = np.nan, np.nan
            if peer:
                best, cut_time = optimum(posed(shape, (None, None), gradient, 0))
            print(
                f"{name:<14}{'(2.4)' if gradient else '(3.22)':<8}{seconds:>9.2f}{sweeps:>8}{cut_time:>14.2f}"
                f"{seconds / cut_time:>11.2f}{cost / best:>11.5f}"
                f"{cost / bound if bound else np.nan:>9.4f}{peak:>11.0f}",
                flush=True,
            )
            if not gradient:
                measured.append((float(np.prod(shape)), seconds))
    return measured


def one_size(shape: tuple[int, int, int], gradient: bool) -> tuple[float, float, float, int, float]:
    problem = posed(shape, (None, None), gradient, 0)
    labels, bound, seconds, sweeps = heated(problem, SurfaceOptions())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return problem.cost(labels), bound, seconds, sweeps, peak


def edges(frames: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Energy of the gradients of each frame."""
    rows, columns = np.diff(frames, axis=1), np.diff(frames, axis=2)
    return np.square(rows).mean(axis=(1, 2, 3)) + np.square(columns).mean(axis=(1, 2, 3))


def spot(steps: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Of steps (T, H, W, C), the greatest one of any place, a Gaussian of 6 px, in each."""
    places: npt.NDArray[np.float64] = ndimage.gaussian_filter(np.abs(steps).mean(axis=3), (0, 6, 6))
    return places.max(axis=(1, 2))


#: The ten clips, and others that nothing was chosen on.
CASES = {
    "ten": {"water": (0, 10, 20), "flames": (1, 11, 21), "flag": (2, 12, 22), "clouds": (4,)},
    "others": {"water": (60, 70), "flames": (61, 71, 81), "flag": (62, 72, 82), "clouds": (64, 74)},
}


def loops(which: str, level: bool) -> None:
    print(
        f"\n{'clip':<12}{'frames':>7}{'within':>8}{'spot':>6}{'at the point':>14}{'cut off':>9}{'edges':>8}"
        f"{'cross-fade':>12}{'÷ it':>7}{'s':>7}"
    )
    found = []
    for name, seeds in CASES[which].items():
        for seed in seeds:
            clip = clips.CLIPS[name](seed=seed)
            started = time.process_time()
            made = ts.loop(clip, level=level)
            seconds = time.process_time() - started
            count, (jump,) = made.transition, made.jumps
            given = clip.astype(float)
            going = np.diff(given, axis=0)
            ordinary = np.percentile(np.abs(going).mean(axis=(1, 2, 3)), 95)
            closed = np.concatenate([made.frames[-1:], made.frames, made.frames[:1]]).astype(float)
            changes = np.diff(closed, axis=0)[: count + 1]
            steps = np.abs(changes).mean(axis=(1, 2, 3))  # steps[0] leads to the first frame
            a, b = given[jump.leaves :][:count], given[jump.enters :][:count]
            share = np.linspace(0, 1, count)[:, None, None, None]
            wanted = (edges(a) + edges(b)) / 2
            ours = np.abs(edges(made.frames[:count].astype(float)) / wanted - 1).mean()
            faded = np.abs(edges((1 - share) * a + share * b) / wanted - 1).mean()
            cut_off = np.abs(given[jump.leaves - 1] - given[jump.enters]).mean() / ordinary
            local = spot(changes).max() / np.percentile(spot(going), 95)
            found.append((steps.max() / ordinary, local, steps[0] / ordinary, ours / faded))
            within, local, point, ghosts = found[-1]
            print(
                f"{f'{name} {seed}':<12}{len(made.frames):>7}{within:>8.2f}{local:>6.2f}{point:>14.2f}"
                f"{cut_off:>9.2f}{ours:>8.3f}{faded:>12.3f}{ghosts:>7.2f}{seconds:>7.1f}",
                flush=True,
            )
    within, local, point, ghosts = np.array(found).T
    print(
        f"of {len(found)}: at the point ≤ 1.1: {np.count_nonzero(point <= 1.1)}; within ≤ 1.1: "
        f"{np.count_nonzero(within <= 1.1)}; spot ≤ 1.5: {np.count_nonzero(local <= 1.5)}; "
        f"edges ÷ cross-fade's ≤ 0.5: {np.count_nonzero(ghosts <= 0.5)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quality", type=int, default=40, help="how many volumes; 0 leaves them out")
    parser.add_argument("--whole", type=int, default=SurfaceOptions().whole)
    parser.add_argument("--sizes", nargs="*", default=SIZES)
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--loops", choices=["none", *CASES], default="ten")
    parser.add_argument("--no-level", action="store_true", help="loops of the clips' own pixels only")
    options = parser.parse_args()
    if options.quality:
        quality(options.quality, options.whole)
    if options.sizes:
        measured = sizes(tuple(options.sizes), True)
        if options.large:
            measured += sizes(LARGE, False)
            (few, short), (many, long) = measured[len(options.sizes) - 1], measured[-1]
            growth = np.log(long / short) / np.log(many / few)
            print(f"growth from {options.sizes[-1]} to {LARGE[-1]}: exponent {growth:.2f}")
    if options.loops != "none":
        loops(options.loops, not options.no_level)


if __name__ == "__main__":
    print(stamp())
    main()
