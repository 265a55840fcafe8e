"""The two engines of maximum flow, SciPy and OR-tools (``pip install '.[fast]'``), in one run: processor time
of whole results and of the cuts in them.

    python benchmarks/flows.py                 the sets of stitching.py and the samples of texture_samples.py
    python benchmarks/flows.py --count 5       the first few of each

Each is made with both, one after the other, three times; the least time of each counts. It ends where the two
show other pixels. OR-tools is loaded before.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np

import toposeam as ts
from engines import cutting_by
from stamp import stamp
from stitching import make_set
from texture_samples import samples
from toposeam.seam.exact import maximum_flow as flow

TIMES = 3


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=50, help="how many sets, and samples, at most")
    count = parser.parse_args().count
    by_or_tools = flow.or_tools()
    if by_or_tools is None:
        parser.error("OR-tools is not installed, or does not work; install it with: pip install '.[fast]'")
    engines = {"scipy": flow.by_scipy, "OR-tools": by_or_tools}
    print(stamp())
    print(f"{'':16}{'':10}{'whole, ms':>12}{'cuts, ms':>12}{'cuts':>8}{'nodes':>10}")
    sets = [make_set(index, 4)[1] for index in range(count)]
    compare(f"{len(sets)} sets", [lambda layers=layers: ts.stitch(layers).image for layers in sets], engines)
    for sample in samples()[:count]:
        compare(sample.name, [partial(grown, sample.image)], engines)


def grown(image: np.ndarray) -> np.ndarray:
    return ts.synthesize(image, 512, patch=40, seed=1).image


def compare(name: str, works: list[Callable[[], np.ndarray]], engines: dict[str, flow.Engine]) -> None:
    """Print what each engine takes for some works, in the mean."""
    works[0]()  # not counted: what is loaded and prepared once
    took = {engine: np.zeros((len(works), 4)) for engine in engines}
    for index, work in enumerate(works):
        found = []
        for turn in range(TIMES):
            for engine, cut in engines.items():
                spent = np.zeros(4)
                begin = time.process_time()
                with cutting_by(timed(cut, spent)):
                    found.append(work())
                spent[0] = time.process_time() - begin
                took[engine][index] = spent if turn == 0 else np.minimum(took[engine][index], spent)
        if not all(np.array_equal(found[0], other) for other in found[1:]):
            raise SystemExit(f"{name}: other pixels")
    for engine, each in took.items():
        whole, cuts, calls, nodes = each.mean(axis=0)
        print(
            f"{name:16}{engine:10}{1e3 * whole:12.0f}{1e3 * cuts:12.1f}{calls:8.0f}{nodes:10.0f}", flush=True
        )
        name = ""


def timed(cut: flow.Engine, spent: np.ndarray) -> flow.Engine:
    """The same, adding up its time, how often it is called, and with how many nodes."""

    def measured(n: int, *graph: np.ndarray) -> np.ndarray:
        begin = time.process_time()
        reached = cut(n, *graph)
        spent[1:] += time.process_time() - begin, 1, n
        return reached

    return measured


if __name__ == "__main__":
    main()
