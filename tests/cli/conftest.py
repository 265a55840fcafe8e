"""A folder with two overlapping photographs, and the command run in it as a user would."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from bad_files import here, inputs  # noqa: F401 - fixtures of more than one file
from click.testing import CliRunner
from engine_requests import Request
from skimage import data
from three_pictures import three  # noqa: F401 - a fixture of more than one file

from toposeam_cli.app.main import main
from toposeam_cli.media.pictures.picture import Picture, write_picture

#: Size of both photographs, and where B lies in A.
SIZE, OFFSET = (40, 56), (36, 0)


@dataclass(frozen=True)
class Ran:
    """What a run of the command left behind."""

    code: int
    out: str
    err: str

    def fails(self, phrase, code=1):
        """It ended in one sentence that holds a phrase."""
        assert self.code == code, self
        assert phrase in self.err, self
        self.is_one_sentence()

    def is_one_sentence(self):
        """Nothing but one line of error, after click's two lines of usage where the command line itself is
        wrong.
        """
        usage = r"Usage: [^\n]+\n(Try [^\n]+\n)?\n" if self.code == 2 else ""
        assert re.fullmatch(usage + r"Error: [^\n]{10,}\n", self.err), self
        assert self.err.rstrip()[-1] not in ",;:", self
        for never in ("Traceback", "something went wrong", "Warning"):
            assert never not in self.err, self
        assert self.out == "", self


@pytest.fixture
def toposeam():
    """Run ``toposeam`` in this process: ``toposeam("stitch", "a.png", …)``."""

    def run(*arguments):
        result = CliRunner().invoke(main, [str(argument) for argument in arguments])
        return Ran(result.exit_code, result.stdout, result.stderr)

    return run


@pytest.fixture
def process(monkeypatch):
    """Start ``toposeam`` in a process of its own, numerics on one thread; takes what
    :class:`subprocess.Popen` takes.
    """
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")

    def start(*arguments, before=(), **options):
        return subprocess.Popen(
            [*before, sys.executable, "-m", "toposeam_cli", *map(str, arguments)], **options
        )

    return start


@pytest.fixture
def started(process):
    """Run ``toposeam`` in a process of its own and wait for it: ``started("stitch", "a.png", …,
    env={…})``.
    """

    def run(*arguments, env=None, **options):
        settings = {
            "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE,
            "env": os.environ | (env or {}),
        } | options
        with process(*arguments, **settings) as child:
            out, err = (
                text.decode(errors="replace") if text else "" for text in child.communicate(timeout=600)
            )
        return Ran(child.returncode, out, err)

    return run


@pytest.fixture
def photographs():
    """Two (40, 56, 3) uint8 crops of one photograph that overlap by 20 px, B a little brighter."""
    height, width = SIZE
    image = data.coffee()[60:, 250:]
    a, b = image[:height, :width], image[:height, OFFSET[0] : OFFSET[0] + width]
    return np.ascontiguousarray(a), np.clip(b.astype(int) + 9, 0, 255).astype(np.uint8)


@pytest.fixture
def folder(tmp_path, monkeypatch, photographs):
    """The working folder, with ``a.png`` and ``b.png`` in it."""
    monkeypatch.chdir(tmp_path)
    for name, pixels in zip("ab", photographs, strict=True):
        write_picture(tmp_path / f"{name}.png", Picture(pixels=pixels))
    return tmp_path


@pytest.fixture
def request_folder(tmp_path):
    made = Request(tmp_path / "request")
    yield made
    made.close()


@pytest.fixture
def pair():
    """Two RGBA patches, the second 20 px to the right and 5 px below."""
    rng = np.random.default_rng(3)
    return [
        np.dstack([rng.integers(0, 256, (30, 40, 3)), np.full((30, 40), 255)]).astype(np.uint8)
        for _ in range(2)
    ]
