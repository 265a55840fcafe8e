"""The processes there are, as Linux tells. It lies here for those who start GIMP without pytest."""

import time
from pathlib import Path
from typing import NamedTuple


class Process(NamedTuple):
    """One that has not ended."""

    number: int
    parent: int
    group: int
    command: bytes


def living():
    """Every process but those that have ended and are still listed: in a container there may be nobody who
    takes them off the list.
    """
    found = []
    for task in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent, group = task.read_text().rpartition(")")[2].split()[:3]
            command = (task.parent / "cmdline").read_bytes()
        except (OSError, ValueError):
            continue
        if state not in "ZX":
            found.append(Process(int(task.parent.name), int(parent), int(group), command))
    return found


def descendants(number):
    """The living among a process's children, their children, and so on; what Linux lists as children leaves
    some out while others end.
    """
    children = {}
    for process in living():
        children.setdefault(process.parent, []).append(process)
    found, waiting = [], [number]
    while waiting:
        below = children.get(waiting.pop(), [])
        found += below
        waiting += [process.number for process in below]
    return found


def wait_for(found, seconds=180):
    """Wait until something is found."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        value = found()
        if value:
            return value
        time.sleep(0.05)
    raise AssertionError(f"waited for {seconds} s")
