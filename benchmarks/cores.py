"""A core for each process, on a machine with fewer: everyone has half of one, by Linux's control groups."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

#: Each process may run for so much of each period, µs.
RUNS_US, PERIOD_US = 10_000, 20_000
GROUPS = Path("/sys/fs/cgroup")


@contextlib.contextmanager
def cores(count: int) -> Iterator[list[list[str]]]:
    """For each of so many commands, which end within the block, the words before it that give it, and what it
    starts, half a core and no more.
    """
    if count * RUNS_US > PERIOD_US * (os.cpu_count() or 1):
        raise SystemExit(f"{count} halves of a core are more than this machine has")
    of_all = (GROUPS / "cgroup.controllers").exists()  # the second version, else the first
    limits = (
        {"cpu.max": f"{RUNS_US} {PERIOD_US}"}
        if of_all
        else {"cpu.cfs_period_us": f"{PERIOD_US}", "cpu.cfs_quota_us": f"{RUNS_US}"}
    )
    made: list[Path] = []
    try:
        if of_all:
            (GROUPS / "cgroup.subtree_control").write_text("+cpu")
        for _ in range(count):
            made.append(Path(tempfile.mkdtemp(prefix="half-", dir=GROUPS if of_all else GROUPS / "cpu")))
            for name, value in limits.items():
                (made[-1] / name).write_text(value)
    except OSError as error:
        raise SystemExit(f"no control groups ({error}); run it as root, or without --own-cores") from error
    else:
        yield [["sh", "-c", 'echo $$ > "$0" && exec "$@"', f"{group / 'cgroup.procs'}"] for group in made]
    finally:
        for group in made:
            group.rmdir()
