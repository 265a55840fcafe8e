"""Files that core itself writes (drawings, meshes): whole, or not at all."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path


def save(path: str | Path, content: str | bytes) -> None:
    """Write a file under another name and rename it when it is complete; an existing one is replaced.

    Parameters
    ----------
    path : str or Path
    content : str or bytes
        Text is written as UTF-8.

    Raises
    ------
    OSError
        When it cannot be written; what was there is still there.
    """
    target = Path(os.path.realpath(path))
    handle, name = tempfile.mkstemp(prefix=".toposeam-", suffix=".part", dir=target.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp's are for the owner alone
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
