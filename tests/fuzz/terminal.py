"""Commands on a terminal, with files whose names try to write to it.

``python terminal.py SEED COUNT`` does so many in an empty working folder, and tells of each in a line of
JSON.
"""

import contextlib
import io
import os
import pty
import random
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

from commands import TEMPORARY, Fuzzer
from watched import TooLong, tell, watched

from toposeam_cli.app.main import main

#: Parts of names: a title, colours, lines, the order of text, a rubber, control characters of eight bits.
STRANGE = [
    "\x1b]0;OWNED\a",
    "\x1b[31m",
    "li\nne",
    "li\rne",
    "\u202e",
    "\u2028",
    "\b\b",
    "\x7f",
    "\x9b31m",
    "\t",
]
#: What click writes round a bar.
BARS = ("\x1b[?25l", "\x1b[?25h")


class Terminal:
    """A terminal, and what has arrived there."""

    def __init__(self):
        self._master, slave = pty.openpty()
        self.stream = os.fdopen(slave, "w", encoding="utf-8", errors="backslashreplace", buffering=1)
        self._arrived = bytearray()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while True:
            self._arrived += os.read(self._master, 65536)

    def seen(self):
        """All since the last time."""
        end = "-- end of the case --"
        self.stream.write(end)
        self.stream.flush()
        deadline = time.monotonic() + 60
        while end.encode() not in self._arrived and time.monotonic() < deadline:
            time.sleep(0.001)
        text = self._arrived.decode("utf-8", "replace").partition(end)[0]
        self._arrived.clear()
        return text


class OnTerminal(Fuzzer):
    """The fuzzer of commands, whose files have strange names here."""

    def __init__(self, seed):
        super().__init__(seed)
        self.terminal = Terminal()

    def file(self, suffixes=None):
        """A copy with a strange name, most of the time."""
        name = super().file(suffixes)
        path = Path(name)
        if path.parent != self.pool or not path.is_file() or path.stat().st_size > 10**6:
            return name
        if path.suffix in (".toml", ".json", ".pto") or self.rng.random() < 0.2:
            return name  # they name files beside themselves
        copy = self.strange(path.name)
        shutil.copy(path, copy)
        return copy

    def output(self):
        """A strange one, too."""
        name = super().output()
        return name if "/" in name or not name or self.rng.random() < 0.3 else self.strange(name)

    def strange(self, name):
        """A name with something strange in front."""
        return self.rng.choice(STRANGE) + name.replace("\n", "")

    def run(self, number):
        """Do one, and tell what the terminal was shown."""
        Path("case").mkdir()
        os.chdir("case")
        try:
            words, _, given = self.draw()
            line = [*words, *(word for part in given.values() for word in part)]
            code, problem = None, None
            with watched() as spent:
                try:
                    streams = self.terminal.stream
                    with contextlib.redirect_stdout(streams), contextlib.redirect_stderr(streams):
                        main(line, prog_name="toposeam")
                except SystemExit as end:
                    code = end.code or 0
                except TooLong:
                    problem = "took too long"
            shown = self.terminal.seen()
            problem = problem or judge(shown)
            tell(case=number, words=line, code=code, said=shown[-300:], problem=problem, **spent)
        finally:
            os.chdir("..")
            shutil.rmtree("case")


def judge(shown):
    """What a terminal should not have been shown; None if there is nothing."""
    for each in BARS:
        shown = shown.replace(each, "")
    if "li\r\nne" in shown or "li\rne" in shown:
        return f"a name breaks a line: {shown[-500:]!r}"
    raw = {each for each in shown if not each.isprintable() and each not in "\r\n"}
    return f"{sorted(raw)} in {shown[-500:]!r}" if raw else None


if __name__ == "__main__":
    home = Path("home").absolute()
    home.mkdir()
    os.environ |= {"HOME": str(home), "XDG_CONFIG_HOME": str(home), "PATH": str(home)}
    TEMPORARY.mkdir()
    tempfile.tempdir = os.environ["TMPDIR"] = str(TEMPORARY)
    sys.stdin = io.StringIO()
    random.seed(0)
    fuzzer = OnTerminal(int(sys.argv[1]))
    for index in range(int(sys.argv[2])):
        fuzzer.run(index)
