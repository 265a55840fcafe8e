"""One iteration of a heat plate's optimisation against its peers, and what coarse plates save; all in one
run.

    python benchmarks/plate.py --write            about four minutes; the table of docs/motifs.md
    python benchmarks/plate.py --peer-size 300    quicker peers

The peers solve the same problem on the same elements (uniform heat, a sink in the middle of the left side,
mass 0.4, p = 3, ε = 1e-3, a filter of 1.5 elements): a plain transcription of the well-known 88-line
structure (coordinates assembled to a sparse matrix, SuperLU, bisection) and, where installed, pyMOTO with the
direct solvers it finds (cvxopt for CHOLMOD, pypardiso). Ours is solved as far as motifs are, and once more to
a residual of 10⁻³ of the load. Times are those of the processor, medians per iteration, and per unknown
temperature; trust the ratios.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import resource
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from statistics import median
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
from scipy.ndimage import correlate1d  # noqa: E402
from scipy.sparse import coo_array  # noqa: E402
from scipy.sparse.linalg import spsolve  # noqa: E402

import toposeam as ts  # noqa: E402
from stamp import stamp  # noqa: E402
from toposeam.heat.plate import CONDUCTION, Plate  # noqa: E402
from toposeam.motif.optimise.conduction import VOID  # noqa: E402
from toposeam.motif.optimise.layer import ENERGY, MIN_DENSITY, TOLERANCE, optimise_layer, problem_at  # noqa: E402
from toposeam.optimize.oc import OCOptions, oc_step  # noqa: E402
from written import write_table  # noqa: E402

MASS, PENALTY, MOVE, RADIUS = 0.4, 3.0, 0.2, 1.5
Step = Callable[[], float]
Rows = list[tuple[str, str]]


def problem(n: int) -> tuple[np.ndarray, np.ndarray]:
    heat, sink = np.full((n, n), 1.0 / n**2), np.zeros((n, n))
    sink[n // 2 - n // 20 : n // 2 + n // 20, 0] = 100.0
    return heat, sink


def ours(n: int, energy: float = ENERGY) -> Step:
    heat, sink = problem(n)
    plate = Plate(heat, sink)
    weights = RADIUS - np.abs(np.arange(-1, 2))
    state: dict[str, Any] = {"x": np.full((n, n), MASS), "nodes": None}

    def step() -> float:
        x = state["x"]
        solution = plate.solve(VOID + (1 - VOID) * x**3, state["nodes"], tolerance=TOLERANCE, energy=energy)
        slope = -(1 - VOID) * PENALTY * x**2 * solution.energy * x
        for axis in (0, 1):
            slope = correlate1d(slope, weights / weights.sum(), axis=axis, mode="reflect")
        slope /= x
        new = oc_step(x.ravel(), slope.ravel(), 1.0, MASS * n * n, MIN_DENSITY, 1.0, OCOptions(move=MOVE))
        state["x"], state["nodes"] = new.reshape(n, n), solution.nodes
        return solution.compliance

    return step


def plain_sparse(n: int) -> Step:
    """Assembled from coordinates, factorised anew in every iteration, a sparse filter matrix, bisection."""
    heat, sink = problem(n)
    count = (n + 1) ** 2
    node = np.arange(count).reshape(n + 1, n + 1)
    corners = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, :-1], node[1:, 1:]], axis=-1).reshape(-1, 4)
    rows, columns = np.repeat(corners, 4, axis=1).ravel(), np.tile(corners, (1, 4)).ravel()
    load = np.bincount(corners.ravel(), np.repeat(heat.ravel() / 4, 4), count)
    convection = np.bincount(corners.ravel(), np.repeat(sink.ravel() / 4, 4), count)
    element = np.arange(n * n).reshape(n, n)
    parts = []
    for dy, dx, weight in ((0, 0, 1.5), (0, 1, 0.5), (1, 0, 0.5), (1, 1, RADIUS - 2**0.5)):
        for sy, sx in {(dy, dx), (-dy, dx), (dy, -dx), (-dy, -dx)}:
            a = element[max(0, sy) : n + min(0, sy), max(0, sx) : n + min(0, sx)].ravel()
            b = element[max(0, -sy) : n + min(0, -sy), max(0, -sx) : n + min(0, -sx)].ravel()
            parts.append((a, b, np.full(a.size, weight)))
    a, b, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    smooth = coo_array((values, (a, b)), shape=(n * n, n * n)).tocsr()
    total = smooth.sum(axis=1)
    state = {"x": np.full(n * n, MASS)}

    def step() -> float:
        x = state["x"]
        k = VOID + (1 - VOID) * x**3
        data = np.concatenate([(k[:, None] * CONDUCTION.ravel()).ravel(), convection])
        index = np.arange(count)
        matrix = coo_array(
            (data, (np.concatenate([rows, index]), np.concatenate([columns, index]))), shape=(count, count)
        ).tocsc()
        theta = spsolve(matrix, load)
        local = theta[corners]
        slope = -(1 - VOID) * PENALTY * x**2 * np.einsum("ea,ab,eb->e", local, CONDUCTION, local)
        slope = smooth @ (x * slope) / (total * np.maximum(x, 1e-3))
        low, high = 0.0, 1e9
        while (high - low) / (high + low) > 1e-3:
            middle = (low + high) / 2
            new = np.clip(
                x * np.sqrt(-slope / middle), np.maximum(MIN_DENSITY, x - MOVE), np.minimum(1.0, x + MOVE)
            )
            low, high = (middle, high) if new.mean() > MASS else (low, middle)
        state["x"] = new
        return float(load @ theta)

    return step


def pymoto(n: int, solver: str) -> Step:
    import pymoto as pym
    from pymoto import solvers

    kinds = {
        "CHOLMOD": solvers.SolverSparseCholeskyCVXOPT,
        "Pardiso": solvers.SolverSparsePardiso,
        "SuperLU": solvers.SolverSparseLU,
    }
    domain = pym.VoxelDomain(n, n)
    cold = domain.get_nodenumber(0, np.arange(n // 2 - n // 20, n // 2 + n // 20 + 1))
    load = np.full(domain.nnodes, 1.0 / domain.nnodes)
    load[cold] = 0.0
    x = pym.Signal("x", state=np.full(domain.nel, MASS))
    with pym.Network() as network:
        density = pym.DensityFilter(domain, radius=RADIUS)(x)
        k = pym.MathExpression(f"{VOID} + {1 - VOID}*inp0^3")(density)
        matrix = pym.AssemblePoisson(domain, bc=cold)(k)
        theta = pym.LinSolve(symmetric=True, positive_definite=True, solver=kinds[solver]())(matrix, load)
        compliance = pym.EinSum("i,i->")(theta, load)
    optimiser = pym.OC(
        [x], compliance, network, move=MOVE, xmin=MIN_DENSITY, xmax=1.0, verbosity=0, maxvol=MASS
    )

    def step() -> float:
        network.response()
        value = float(compliance.state)
        network.reset()
        compliance.sensitivity = 1.0
        network.sensitivity()
        x.state, *_ = optimiser.step(x=x.state, g=np.array([value]), dg=np.asarray(x.sensitivity))
        network.reset()
        return value

    return step


def time_iterations(sides: dict[str, Step], iterations: int) -> dict[str, float]:
    """Median processor time of an iteration, the sides in turns; the first iteration does not count."""
    times: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(iterations + 1):
        for name, step in sides.items():
            started = time.process_time()
            step()
            times[name].append(time.process_time() - started)
    return {name: median(values[1:]) for name, values in times.items()}


def peers(n: int, iterations: int) -> Rows:
    sides: dict[str, Step] = {
        "toposeam": ours(n),
        "… residual of 1e-3": ours(n, 0.0),
        "88-line structure": plain_sparse(n),
    }
    for solver in ("CHOLMOD", "Pardiso", "SuperLU"):
        with contextlib.suppress(Exception):  # not installed
            step = pymoto(min(n, 32), solver)
            step()
            sides[f"pyMOTO, {solver}"] = pymoto(n, solver)
    if len(sides) == 3:
        print("pyMOTO is not installed: pip install pymoto cvxopt pypardiso")
    unknowns = (n + 1) ** 2
    times = time_iterations(sides, iterations)
    print(f"\nAn iteration at {n} × {n}, {iterations} of each in turns\n")
    for name, seconds in times.items():
        print(
            f"  {name:<20}{1e6 * seconds / unknowns:8.3f} µs per unknown{seconds / times['toposeam']:9.1f} ×"
        )
    per = {name: 1e6 * seconds / unknowns for name, seconds in times.items()}
    own = per.pop("toposeam")
    rows = [(f"an iteration at {n}², per unknown", f"{own:.2f} µs")]
    return rows + [(name, f"{value:.2f} µs, {value / own:.1f} ×") for name, value in per.items()]


def growth(iterations: int) -> Rows:
    print("\nGrowth with size\n")
    sizes = (128, 256, 512, 1024)
    sides = {str(n): ours(n) for n in sizes}
    times = time_iterations(sides, iterations)
    per = {n: times[str(n)] / (n + 1) ** 2 for n in sizes}
    for n in sizes:
        print(f"  {n:>4}²{1e6 * per[n]:8.3f} µs per unknown")
    print(f"  256² to 1024²: {per[1024] / per[256]:.2f} ×")
    return [("growth per unknown from 256² to 1024²", f"{per[1024] / per[256]:.1f} ×")]


def coarse_to_fine(seeds: int) -> Rows:
    shares, every = [], []
    print("\nA motif of 512² with 3 layers, 40 iterations: most on coarse plates, against all at full size\n")
    for seed in range(seeds):
        recipe = ts.motif.random_recipe(512, seed=seed, repeat="translate")
        seconds, compliance = {}, {}
        for name, one in (("coarse", recipe), ("full", replace(recipe, coarse=False))):
            started = time.process_time()
            densities = [optimise_layer(one.of_layer(index))[0] for index in range(len(one.layers))]
            seconds[name] = time.process_time() - started
            values = []
            for layer, density in zip(one.layers, densities, strict=True):
                at_size = problem_at(layer, one, one.size)
                values.append(
                    at_size.plate.solve(at_size.conductivity(density.astype(float), layer.penalty)).compliance
                )
            compliance[name] = np.array(values)
        ratios = compliance["coarse"] / compliance["full"]
        share = seconds["coarse"] / seconds["full"]
        shares.append(share)
        every += list(ratios)
        print(
            f"  seed {seed}: {seconds['coarse']:5.2f} s and {seconds['full']:6.2f} s, {share:.3f} of the "
            f"time, compliance {ratios.min():.4f} to {ratios.max():.4f} of full"
        )
    return [
        (
            "512², 3 layers, coarse plates: time of 40 iterations at full size",
            f"{min(shares):.2f} to {max(shares):.2f}",
        ),
        ("… its compliance against theirs", f"{min(every):.3f} to {max(every):.3f}"),
    ]


def large() -> Rows:
    print("\nLarge motifs, 3 layers\n")
    seconds = {}
    for n in (512, 2048):
        started = time.process_time()
        ts.motif(n, seed=1, repeat="translate")
        seconds[n] = time.process_time() - started
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"  {n}²: {seconds[n]:6.1f} s, peak memory so far {peak:.2f} GiB")
    ratio = f"{seconds[2048] / seconds[512]:.1f} ×"
    print(f"  ratio {ratio}")
    return [("2048² against 512²; peak memory", f"{ratio} the time; {peak:.1f} GiB")]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--peer-size", type=int, default=600)
    parser.add_argument("--iterations", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument(
        "--part",
        action="append",
        choices=("large", "growth", "coarse", "peers"),
        help="only this; may be repeated",
    )
    parser.add_argument("--write", action="store_true", help="put the table into docs/motifs.md")
    options = parser.parse_args()
    if options.write and options.part:
        parser.error("--write needs all parts")
    measured: dict[str, Callable[[], Rows]] = {  # memory first, before the peers need any
        "large": large,
        "growth": lambda: growth(options.iterations),
        "coarse": lambda: coarse_to_fine(options.seeds),
        "peers": lambda: peers(options.peer_size, options.iterations),
    }
    rows: Rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for part, measure in measured.items():
            if part in (options.part or measured):
                rows += measure()
    if options.write:
        write_table("motifs.md", "benchmarks/plate.py", [("", ""), *rows])


if __name__ == "__main__":
    print(stamp())
    main()
