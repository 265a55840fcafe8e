"""The processes there are, as Linux tells."""

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
