"""What the seams of piles of pictures cost, against α-expansion from several starts, in any order of layers.

    python benchmarks/seam_costs.py                  small piles and large ones, about ten minutes
    python benchmarks/seam_costs.py --large 0        only those of benchmarks/stitching.py
    python benchmarks/seam_costs.py --frames         30 frames that overlap by 60 %, with cores and without

*Small*: the crops of benchmarks/stitching.py. *Large*: 4 to 7 crops of photographs enlarged to 1200 px, at
places where three or more of them overlap and more than 100,000 px have several layers to choose from. A
third of these show the same but for exposure and noise, in a third each shows objects of its own, and in a
third every layer is a piece of another photograph.

The peer is α-expansion at full size, each move decided by PyMaxflow, until no layer gains anything, from six
starts: the layers joined one after another in their order and in the opposite one, on top of each other in
both, and on top in two random orders. The cheapest end counts. Ours is ``toposeam.stitch`` with the layers in
their order, in the opposite one, and shuffled. The peer's layers are in their order. *Apart* is the dearest
of ours ÷ the cheapest of ours and the peer's, which is how much any order misses of what somebody found.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import stitching
import toposeam as ts
from piles import frames, large_pile
from stamp import stamp
from toposeam.layers.labelling.posing import pose_labelling
from toposeam.layers.search.expansion_moves import Choices
from toposeam.seam.exact.graph_cut import least_cut

LEAST_PIXELS = 100_000


def peer(layers: list[ts.Layer], rng: np.random.Generator) -> tuple[float, float, int]:
    """The cheapest end of α-expansion, the dearest one, and how many pixels have several layers."""
    canvas = ts.layers.common_canvas(layers)
    labelling = pose_labelling(canvas, match=ts.seam.MatchCost())
    count, box = len(layers), canvas.box
    allowed = [labelling.allowed_in(k, box) for k in range(count)]
    choices = Choices(labelling, box, labelling.on_top(), allowed, range(count))
    order = list(range(count))
    ends = []
    for joined in (order, order[::-1]):
        choices.shows = np.full(choices.shows.shape, count, np.int16)
        for k in joined:
            choices.lay(k, allowed[k].ravel())
            choices.expand(k, least_cut)
        ends.append(finished(choices, labelling))
    for top in (order, order[::-1], rng.permutation(count), rng.permutation(count)):
        choices.shows = np.full(choices.shows.shape, count, np.int16)
        for k in top:
            choices.shows[allowed[k].ravel()] = k
        ends.append(finished(choices, labelling))
    return min(ends), max(ends), int(choices.several.sum())


def finished(choices: Choices, labelling) -> float:
    choices.run(least_cut, 100)
    return labelling.total(choices.label_map(), labelling.canvas)


def measured(
    layers: list[ts.Layer], rng: np.random.Generator
) -> tuple[list[float], float, float, int, float]:
    """Ours ÷ the peer's cheapest end, in three orders; the dearest of these ÷ the cheapest of all, the peer's
    among them; the peer's dearest end ÷ its cheapest; pixels to choose for; our seconds.
    """
    orders = [list(range(len(layers))), list(range(len(layers)))[::-1], list(rng.permutation(len(layers)))]
    ours, seconds = [], []
    for order in orders:
        pile = [layers[k] for k in order]
        started = time.process_time()
        ours.append(ts.stitch(pile).cost)
        seconds.append(time.process_time() - started)
    best, worst, pixels = peer(layers, rng)
    ratios = [cost / best for cost in ours]
    return ratios, max(ours) / min(*ours, best), worst / best, pixels, float(np.median(seconds))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", type=int, default=20, help="how many small piles")
    parser.add_argument("--large", type=int, default=12, help="how many large ones")
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--each", action="store_true", help="a line for every pile")
    parser.add_argument("--frames", action="store_true", help="30 frames that overlap by 60 %% instead")
    options = parser.parse_args()
    if options.frames:
        for core in (None, 0.5):
            started = time.process_time()
            found = ts.stitch(frames(options.seed), core=core)
            took = time.process_time() - started
            hidden, count = len(found.hidden), len(found.names)
            print(f"core {core}: cost {found.cost:.0f}, {hidden} of {count} show nowhere, {took:.1f} s")
        return
    rng = np.random.default_rng(options.seed)
    rows: dict[str, list[tuple[list[float], float, float, int, float]]] = {}
    for index in range(options.small):
        rows.setdefault("small", []).append(measured(stitching.make_set(index, options.seed)[1], rng))
        if options.each:
            show(f"small {index}", rows["small"][-1])
    index = 0
    while sum(map(len, rows.values())) < options.small + options.large:
        kind, layers = large_pile(index, options.seed)
        index += 1
        try:
            ts.stitch(layers[:], max_rounds=0)
        except ts.OverlapError:
            continue
        row = measured(layers, rng)
        if row[3] < LEAST_PIXELS:
            continue
        rows.setdefault(f"large, {kind}", []).append(row)
        if options.each:
            show(f"large {index - 1}, {kind}", row)
    print(f"{'':<18}{'piles':>6}{'median':>9}{'worst':>8}{'orders apart':>14}{'peer apart':>12}{'s':>8}")
    every = [row for found in rows.values() for row in found]
    for name, found in {**rows, "all": every}.items():
        ratios = np.array([ratio for row in found for ratio in row[0]])
        print(
            f"{name:<18}{len(found):>6}{np.median(ratios):>9.4f}{ratios.max():>8.4f}"
            f"{max(row[1] for row in found):>14.4f}{max(row[2] for row in found):>12.4f}"
            f"{np.median([row[4] for row in found]):>8.2f}"
        )


def show(name: str, row: tuple[list[float], float, float, int, float]) -> None:
    ratios, apart, spread, pixels, seconds = row
    print(
        f"{name:<18} {pixels:>8} px  "
        + " ".join(f"{ratio:.4f}" for ratio in ratios)
        + f"  apart {apart:.4f}, peer {spread:.4f}, {seconds:.2f} s",
        flush=True,
    )


if __name__ == "__main__":
    print(stamp())
    main()
