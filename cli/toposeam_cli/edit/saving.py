"""Save: a command, such as ``toposeam stitch`` of a layout, in a process of its own that can be ended."""

from __future__ import annotations

import signal
from multiprocessing.connection import Connection
from pathlib import Path

from toposeam.sentence import sentence
from toposeam_cli.app.progress import listening
from toposeam_cli.app.registry import load
from toposeam_cli.files.interruption import terminations_raised


def run(connection: Connection, command: str, words: list[str], output: Path) -> None:
    """Run a command that writes a file, and say how far it is, whether it is done, or why not."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this process by SIGTERM
    try:
        with terminations_raised(), listening(lambda label, share: connection.send(("saving", label, share))):
            load(command).main(words, standalone_mode=False)
    except Exception as error:
        connection.send(("failed", sentence(error), 0.0))
    else:
        connection.send(("saved", output.name, 1.0))
