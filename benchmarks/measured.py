"""A command in a process of its own: what it took."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Measured:
    """A process that ended."""

    #: Of its processors, and by the clock.
    seconds: float
    clock: float
    #: Its largest resident set, MiB.
    megabytes: float
    code: int
    said: str
    #: The most memory that all processes of it had together, pages that they share counted once, MiB; looked
    #: at every second.
    together: float = 0.0


#: Run by a small process: the largest memory of the one that starts a program is passed on to it.
STARTER = """
import json, os, subprocess, sys, threading, time
ended, together = threading.Event(), [0.0]
def shares(pid):
    try:
        with open(f"/proc/{pid}/smaps_rollup") as file:
            own = next(int(line.split()[1]) for line in file if line.startswith("Pss:"))
        with open(f"/proc/{pid}/task/{pid}/children") as file:
            return own + sum(map(shares, file.read().split()))
    except (OSError, StopIteration):  # it has just ended
        return 0
def look():
    while not ended.wait(1.0):
        together[0] = max(together[0], shares(process.pid) / 1024)
begin = time.perf_counter()
process = subprocess.Popen(sys.argv[1:])
looks = threading.Thread(target=look)
looks.start()
_, status, usage = os.wait4(process.pid, 0)
clock, seconds = time.perf_counter() - begin, usage.ru_utime + usage.ru_stime
ended.set()
looks.join()
print(json.dumps([seconds, clock, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status), together[0]]))
"""


def measured(command: list[str], folder: Path) -> Measured:
    """One process, its time and its largest resident set."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # installed, all has been compiled
    ran = subprocess.run(
        [sys.executable, "-c", STARTER, *command],
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        env=environment,
        check=True,
    )
    said = ran.stdout.splitlines()
    seconds, clock, megabytes, code, together = json.loads(said[-1])
    return Measured(seconds, clock, megabytes, code, ran.stderr + "\n".join(said[:-1]), together)


def toposeam(words: list[str], folder: Path) -> Measured:
    """One command of ours, which must succeed."""
    ran = measured([sys.executable, "-m", "toposeam_cli", *words], folder)
    if ran.code:
        raise SystemExit(f"toposeam ended with {ran.code}: {ran.said}")
    return ran
