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


#: Run by a small process: the largest memory of the one that starts a program is passed on to it.
STARTER = """
import json, os, subprocess, sys, time
begin = time.perf_counter()
process = subprocess.Popen(sys.argv[1:])
_, status, usage = os.wait4(process.pid, 0)
clock, seconds = time.perf_counter() - begin, usage.ru_utime + usage.ru_stime
print(json.dumps([seconds, clock, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status)]))
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
    seconds, clock, megabytes, code = json.loads(said[-1])
    return Measured(seconds, clock, megabytes, code, ran.stderr + "\n".join(said[:-1]))


def toposeam(words: list[str], folder: Path) -> Measured:
    """One command of ours, which must succeed."""
    ran = measured([sys.executable, "-m", "toposeam_cli", *words], folder)
    if ran.code:
        raise SystemExit(f"toposeam ended with {ran.code}: {ran.said}")
    return ran
