"""How much faster many small jobs are done with two processes than with one: python benchmarks/batch.py
[jobs].

Both sides do the same stitch jobs, start-up of the workers included, turn by turn; the median ratio is what
counts.
"""

from __future__ import annotations

import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from skimage import data

from stamp import stamp
from toposeam_cli.jobs.runner import Job, run
from toposeam_cli.media.pictures.picture import Picture, write_picture

SIZE, OVERLAP = (160, 160), 40
ROUNDS = 3


def main(count: int) -> None:
    """Print the times and ratios."""
    photograph = data.coffee()
    height, width = SIZE
    rng = np.random.default_rng(0)
    memory = Path("/dev/shm")  # noqa: S108 - where there is such a place, the disk, which others use too, stays out of it
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as name:
        folder = Path(name)
        for index in range(count):
            top = rng.integers(photograph.shape[0] - height)
            left = rng.integers(photograph.shape[1] - 2 * width + OVERLAP)
            for side, start in (("a", left), ("b", left + width - OVERLAP)):
                pixels = photograph[top : top + height, start : start + width]
                write_picture(folder / f"{side}{index}.png", Picture(pixels=np.ascontiguousarray(pixels)))
        ratios = []
        for turn in range(ROUNDS):
            seconds, cpu = {}, {}
            for processes in (1, 2) if turn % 2 else (2, 1):
                start, used = time.perf_counter(), cpu_seconds()
                outcomes = list(run(jobs(folder, count), processes=processes))
                seconds[processes], cpu[processes] = time.perf_counter() - start, cpu_seconds() - used
                if any(outcome.status != "done" for outcome in outcomes):
                    raise SystemExit("a job failed")
            ratios.append(seconds[1] / seconds[2])
            sides = "   ".join(
                f"-j {side} {seconds[side]:6.2f} s ({cpu[side]:.2f} s of CPU)" for side in (1, 2)
            )
            print(f"{count} jobs: {sides}   {ratios[-1]:.2f} × as fast", flush=True)
        print(f"median {statistics.median(ratios):.2f} × as fast")


def cpu_seconds() -> float:
    """CPU time of this process and the workers that have ended: what other programs take from the machine
    does not count.
    """
    usages = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def jobs(folder: Path, count: int) -> list[Job]:
    """The same stitch jobs each time, replacing what they made."""
    made = []
    for index in range(count):
        first, second, output = (str(folder / f"{name}{index}.png") for name in ("a", "b", "out"))
        words = [f"--overlap={OVERLAP}", "--force", f"--output={output}", first, second]
        made.append(
            Job(
                output,
                "toposeam_cli.batch.running:run_command",
                {"command": "stitch", "words": words},
                outputs=(Path(output),),
            )
        )
    return made


if __name__ == "__main__":
    print(stamp())
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
