"""What the kernels gain: each alone, ÷ what runs without them and ÷ a peer, then whole commands and a stroke.

    python benchmarks/kernels.py                     the samples, and the same enlarged to 2 x 12 megapixels
    python benchmarks/kernels.py A.jpg B.jpg ...     other photographs, two by two, in their place

Processor time, s, the least of three (of one where it takes long), in one run. *Flow*: networks of a closed
seam, and of one across, in windows of 300,000 px of photographs. *Paths*: along random costs. *Blurs*: of a
photograph, one after the other. *Warp*: 12 megapixels of colours. Peers are PyMaxflow and OpenCV, where they
are installed. It ends where the two ways show other cuts, lengths or pixels.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy import ndimage

from brush import row
from measured import measured
from seam_pairs import pair, ring
from stamp import stamp
from toposeam import _kernels
from toposeam.heat.network import Network
from toposeam.images import blurred
from toposeam.layers.canvas import Box, Layer, PlaneTransform, coordinates, inside, warped
from toposeam.layers.mesh import find_lines
from toposeam.seam import MatchCost
from toposeam.seam.exact import cheapest_path, minimum_cut
from toposeam.seam.problem.overlap import FREE
from toposeam.seam.problem.posing import seam_problem
from toposeam_cli.stitching.resample import _splined

SAMPLES = Path(__file__).parents[1] / "samples"
ENLARGED = 12e6
LONG = 3.0  # s
TURNED = PlaneTransform(np.array([[1.02, 0.05, 3.2], [-0.04, 0.97, -7.7], [6e-6, -4e-6, 1.0]]))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """The least processor time of three calls, and the result."""
    times: list[float] = []
    while len(times) < 3 and sum(times) < LONG:
        started = time.process_time()
        found = call()
        times.append(time.process_time() - started)
    return min(times), found


def compare(name: str, call: Callable[[], Any], peer: Callable[[], Any] | None = None) -> None:
    """Print a line: the kernel's time, and ÷ those of the other way and of the peer."""
    by_kernel, one = timed(call)
    library, _kernels.library = _kernels.library, None
    without, other = timed(call)
    _kernels.library = library
    if not np.array_equal(one, other):
        raise SystemExit(f"{name}: the two ways differ")
    against = f"{by_kernel / timed(peer)[0]:10.2f}" if peer else f"{'':10}"
    print(f"{name:36}{by_kernel:10.3f}{by_kernel / without:10.2f}{against}", flush=True)


def flows() -> None:
    """Maximum flow in large windows."""
    closed = seam_problem(*pair(590, 590, 1, 0), *ring(590, 80), "right", MatchCost(law="gradient"))[0]
    compare_cut("flow, a closed seam, 300,000 px", *closed.grid.network(closed.overlap.side == FREE)[:2])
    images, whole = pair(600, 500, 2, 0), np.ones((600, 500), bool)
    left, right = whole.copy(), whole.copy()
    left[:, -1:] = right[:, :1] = False
    across = seam_problem(*images, left, right, "right", MatchCost(law="natural"))[0]
    compare_cut("flow, a seam across, 300,000 px", *across.grid.network(across.overlap.side == FREE)[:2])


def compare_cut(name: str, network: Network, weight: np.ndarray) -> None:
    """Print the line of a cut."""
    compare(name, lambda: minimum_cut(network, weight), by_pymaxflow(network, weight))


def by_pymaxflow(network: Network, weight: np.ndarray) -> Callable[[], np.ndarray] | None:
    """The same cut, with the capacities rounded as finely, by PyMaxflow."""
    try:
        import maxflow
    except ImportError:
        return None
    n, tail, head = network.n, network.tail, network.head
    capacity = np.rint(weight * (2**29 / weight.sum())).astype(np.int32)
    inner, low, high = (tail < n) & (head < n), np.minimum(tail, head), np.maximum(tail, head)

    def cut() -> np.ndarray:
        graph = maxflow.GraphInt(n, np.count_nonzero(inner))
        nodes = graph.add_nodes(n)
        graph.add_edges(tail[inner], head[inner], capacity[inner], capacity[inner])
        ends = [
            np.bincount(low[high == end], capacity[high == end], n).astype(np.int32) for end in (n + 1, n)
        ]
        graph.add_grid_tedges(nodes, *ends)
        graph.maxflow()
        return np.asarray(graph.get_grid_segments(nodes))

    return cut


def paths() -> None:
    """Shortest paths between corners, and lines of edges."""
    rng = np.random.default_rng(0)
    below, beside = (
        ndimage.gaussian_filter(rng.random((2000, 500)), 2).astype(np.float32) - np.float32(0.3)
        for _ in range(2)
    )
    below[-1], beside[:, -1] = np.inf, np.inf
    compare(
        "shortest path, 2000 x 500",
        lambda: np.round(cheapest_path(below, beside, (250, below.size - 250))[1], 6),
    )
    with Image.open(SAMPLES / "portrait_left.jpg") as opened:
        gray = np.asarray(opened.convert("L"), np.float32) / 255
    compare("blurs of an octave of features", lambda: blurred(gray, 1.25, 1.23, 1.55, 1.95, 2.45, 3.09))
    compare("straight lines of a photograph", lambda: find_lines(gray, 30.0).round(6))


def warps() -> None:
    """Coordinates and pixels of a picture of 12 megapixels."""
    with Image.open(SAMPLES / "portrait_left.jpg") as opened:
        photograph = np.asarray(opened.convert("RGB").resize((4000, 3000)))
    box = Box(0, 0, 3000, 4000)
    at = coordinates(TURNED, box)
    shown = inside(at, (4000, 3000))
    compare("coordinates", lambda: coordinates(TURNED, box))
    compare("Catmull-Rom, as libvips", lambda: _splined(photograph, at, 0, shown), by_opencv(photograph, at))
    layer = Layer(photograph[:1000, :1200])
    compare("a core warp, 1.2 megapixels", lambda: warped(layer, TURNED).image)


def by_opencv(photograph: np.ndarray, at: np.ndarray) -> Callable[[], np.ndarray] | None:
    """The same by OpenCV's bicubic splines, on one thread."""
    try:
        import cv2
    except ImportError:
        return None
    cv2.setNumThreads(1)
    where = at.astype(np.float32)
    return lambda: cv2.remap(photograph, where, None, cv2.INTER_CUBIC)


def commands(files: list[Path]) -> None:
    """Whole commands on pairs of photographs, with the kernels and without."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for pictures in zip(files[::2], files[1::2], strict=True):
            times, made = [], []
            for wanted in ("1", "0"):
                os.environ["TOPOSEAM_KERNELS"] = wanted
                words = ["-m", "toposeam_cli", "stitch", *map(str, pictures), "-o", f"joined-{wanted}.tif"]
                ran = measured([sys.executable, *words, "--force"], folder)
                if ran.code:
                    raise SystemExit(f"{pictures[0].name}: the command failed")
                times.append(ran.seconds)
                made.append((folder / f"joined-{wanted}.tif").read_bytes())
            same = "" if made[0] == made[1] else "   other bytes"
            print(
                f"{pictures[0].name:36}{times[0]:10.2f}{times[0] / times[1]:10.2f}{same}",
                flush=True,
            )
        del os.environ["TOPOSEAM_KERNELS"]


def enlarged(folder: Path) -> list[Path]:
    """The two samples, and the same of 12 megapixels."""
    files = [SAMPLES / f"portrait_{side}.jpg" for side in ("left", "right")]
    large = [folder / f"large_{file.name}" for file in files]
    for file, target in zip(files, large, strict=True):
        with Image.open(file) as opened:
            factor = (ENLARGED / (opened.width * opened.height)) ** 0.5
            size = round(opened.width * factor), round(opened.height * factor)
            opened.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(target, quality=95)
    return files + large


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photographs", type=Path, nargs="*")
    asked = [file.resolve() for file in parser.parse_args().photographs]
    if _kernels.library is None:
        parser.error("no kernels were built; build them with: make kernels")
    print(stamp())
    print(f"{'':36}{'kernel, s':>10}{'÷ without':>10}{'÷ peer':>10}")
    flows()
    paths()
    warps()
    with tempfile.TemporaryDirectory() as folder:
        files = asked or enlarged(Path(folder))
        commands(files)
        library = _kernels.library
        for name, chosen in (("with the kernels", library), ("without", None)):
            _kernels.library = chosen
            print(f"strokes {name} (columns as brush.py): {row(files[:2], 2.0, 8)}", flush=True)


if __name__ == "__main__":
    main()
