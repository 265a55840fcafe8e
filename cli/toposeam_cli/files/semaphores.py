"""Named semaphores of :mod:`multiprocessing`. The system keeps them when all processes that share them are
killed at once. So their names hold their process, and the next command removes those of killed ones.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import sys
from contextlib import suppress
from pathlib import Path

#: Folder of named semaphores in Linux.
_FOLDER = Path("/dev/shm")  # noqa: S108 - the system's
_OURS = re.compile(r"sem\.toposeam-(\d+)-(\d+)-.*")


def name_semaphores() -> None:
    """Put this process's number into the names of the semaphores that it makes from now on, and remove those
    of our processes that have ended.
    """
    configuration = getattr(multiprocessing.current_process(), "_config", {})
    if not sys.platform.startswith("linux") or str(configuration.get("semprefix")) != "/mp":
        return
    with suppress(OSError):
        # Numbers of processes are valid in one namespace only.
        space = re.sub(r"\D", "", str(Path("/proc/self/ns/pid").readlink()))
        configuration["semprefix"] = f"/toposeam-{space}-{os.getpid()}"
        for entry in list(os.scandir(_FOLDER)):
            found = _OURS.fullmatch(entry.name)
            if found is not None and found[1] == space and not _lives(int(found[2])):
                with suppress(OSError):
                    if entry.stat(follow_symlinks=False).st_uid == os.getuid():
                        (_FOLDER / entry.name).unlink()


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
