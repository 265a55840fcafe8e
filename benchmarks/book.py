"""A pattern book on one process and on two, in one run.

    python benchmarks/book.py              40 patterns at 128 × 128, three rounds, about three minutes
    python benchmarks/book.py -n 400 --size 512 --rounds 1 --pdf --processes 2

Both run the command as a user would, worker processes started and all, without PDF if it is not asked for;
rounds take turns. The theme is drawn here.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from stamp import stamp
from toposeam_cli.media.pictures.picture import Picture, write_picture


def theme(path: Path) -> None:
    """A flower of five petals, dark on white."""
    y, x = np.mgrid[-1:1:200j, -1:1:200j]
    petals = np.hypot(x, y) < 0.45 + 0.25 * np.cos(5 * np.arctan2(y, x))
    write_picture(path, Picture(pixels=np.where(petals, 20, 255).astype(np.uint8)), force=True)


def run(folder: Path, number: int, size: int, processes: int, pdf: bool) -> tuple[float, float, float]:
    """Wall time of a whole book, CPU time of the process that leads it, and CPU time of its workers."""
    line = [
        sys.executable,
        "-m",
        "toposeam_cli",
        "book",
        str(folder / "theme.png"),
        "-o",
        str(folder / "book"),
    ]
    line += ["--fresh", "-q", "-n", str(number), "--size", str(size), "-j", str(processes)]
    line += [] if pdf else ["--no-pdf"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    leading = 0.0
    with subprocess.Popen(line, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}) as child:
        while child.poll() is None:
            leading = max(leading, own_cpu(child.pid))
            time.sleep(0.05)
    wall = time.perf_counter() - started
    if child.returncode:
        raise SystemExit("the book failed")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    total = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, leading, total - leading


def own_cpu(pid: int) -> float:
    """CPU time of a process without its children, s (Linux)."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print the medians and their ratio."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-n", type=int, default=40)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--pdf", action="store_true", help="with book.pdf, and how large it is")
    parser.add_argument("--processes", type=int, choices=(1, 2), help="only by so many, instead of both")
    chosen = parser.parse_args()
    several = (1, 2) if chosen.processes is None else (chosen.processes,)
    runs: dict[int, list[tuple[float, float, float]]] = {processes: [] for processes in several}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        theme(folder / "theme.png")
        for _ in range(chosen.rounds):
            for processes, found in runs.items():
                found.append(run(folder, chosen.n, chosen.size, processes, chosen.pdf))
                wall, leading, working = found[-1]
                load = os.getloadavg()[0]
                print(
                    f"-j {processes}: {wall:.1f} s; CPU {leading:.1f} s leading, {working:.1f} s working; "
                    f"load {load:.1f}",
                    flush=True,
                )
        if chosen.pdf:
            print(f"book.pdf: {(folder / 'book/book.pdf').stat().st_size / 1e6:.0f} MB")
    if len(several) == 1:
        return
    wall = {processes: statistics.median(times[0] for times in found) for processes, found in runs.items()}
    # What the CPU times allow where nothing else runs: the leading process alone, then the workers side by
    # side.
    idle = {
        processes: statistics.median(a + b / processes for _, a, b in found)
        for processes, found in runs.items()
    }
    print(
        f"{chosen.n} patterns of {chosen.size}² and 16 products: -j 2 is {wall[1] / wall[2]:.2f} × as fast "
        "as -j 1"
    )
    print(f"by CPU time, as on two cores with nothing else to do: {idle[1] / idle[2]:.2f} ×")


if __name__ == "__main__":
    print(stamp())
    main()
