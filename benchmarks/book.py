"""A pattern book on one process and on two, in one run.

    python benchmarks/book.py              40 patterns at 128 × 128, three rounds, about three minutes
    python benchmarks/book.py -n 400 --rounds 1

Both run the command as a user would, worker processes started and all, without PDF; rounds take turns. The theme is drawn here.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from toposeam_cli.picture import Picture, write_picture


def theme(path: Path) -> None:
    """A flower of five petals, dark on white."""
    y, x = np.mgrid[-1:1:200j, -1:1:200j]
    petals = np.hypot(x, y) < 0.45 + 0.25 * np.cos(5 * np.arctan2(y, x))
    write_picture(path, Picture(pixels=np.where(petals, 20, 255).astype(np.uint8)), force=True)


def seconds(folder: Path, number: int, size: int, processes: int) -> float:
    """Wall time of a whole book."""
    line = [sys.executable, "-m", "toposeam_cli.main", "book", str(folder / "theme.png"), "-o", str(folder / "book")]
    line += ["--fresh", "--no-pdf", "-q", "-n", str(number), "--size", str(size), "-j", str(processes)]
    started = time.perf_counter()
    subprocess.run(line, check=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
    return time.perf_counter() - started


def main() -> None:
    """Print the medians and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=40)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    times: dict[int, list[float]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        theme(folder / "theme.png")
        for _ in range(chosen.rounds):
            for processes, found in times.items():
                found.append(seconds(folder, chosen.n, chosen.size, processes))
                print(f"-j {processes}: {found[-1]:.1f} s, load {os.getloadavg()[0]:.1f}", flush=True)
    one, two = (statistics.median(found) for found in times.values())
    print(f"{chosen.n} patterns of {chosen.size}², 16 products: {one:.1f} s on one process, {two:.1f} s on two: {one / two:.2f} × as fast")


if __name__ == "__main__":
    main()
