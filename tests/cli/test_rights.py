"""Without the right to read or to write: one sentence, and nothing is touched. Root is asked for no rights,
and gives its privilege up first.
"""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from bad_files import snapshot

from toposeam_cli.media.pictures.picture import Picture, write_picture

UNPRIVILEGED = ("setpriv", "--bounding-set", "-dac_override,-dac_read_search,-fowner")
READ, WRITE = "your right to read it", "ermission denied); choose another"


@pytest.fixture
def ruled(folder):
    """The words before a command so that rights count, in a folder that has files without."""
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    if root and shutil.which(UNPRIVILEGED[0]) is None:
        pytest.skip("root is asked for no rights, and there is no setpriv")
    words = UNPRIVILEGED if root else ()
    for name in ("locked", "hidden"):
        (folder / name).mkdir()
        shutil.copy(folder / "a.png", folder / name)
    (folder / "mine.png").write_text("precious")
    mask = np.zeros((40, 56), np.uint8)
    mask[10:20, 10:20] = 255
    write_picture(folder / "mask.png", Picture(pixels=mask))
    shutil.copy(folder / "a.png", folder / "secret.png")
    (folder / "secret.toml").write_text("[[tile]]\n")
    modes = {"secret.png": 0, "secret.toml": 0, "mine.png": 0o400, "locked": 0o500, "hidden": 0}
    before = snapshot(folder)
    for name, mode in modes.items():
        (folder / name).chmod(mode)
    probe = [*words, sys.executable, "-c", "open('locked/x', 'w')"]
    told = subprocess.run(probe, capture_output=True, text=True, check=False).stderr
    try:
        if "PermissionError" not in told:
            pytest.skip("nobody asks for rights here")
        yield words
    finally:
        for name in modes:
            (folder / name).chmod(0o700)
    assert snapshot(folder) == before


@pytest.mark.medium
@pytest.mark.parametrize(
    ("line", "phrase"),
    [
        ("stitch a.png b.png --overlap 20 -o locked/x.png", WRITE),
        ("stitch a.png b.png --overlap 20 -o locked/a.png --force", WRITE),
        ("stitch a.png b.png --overlap 20 -o x.png --seam locked/x.svg", WRITE),
        ("stitch a.png b.png --overlap 20 -o hidden/x.png", WRITE),
        ("stitch a.png b.png --overlap 20 -o mine.png", "exists already"),
        ("stitch a.png secret.png --overlap 20 -o x.png", READ),
        ("stitch a.png hidden/a.png --overlap 20 -o x.png", READ),
        ("fill a.png --mask secret.png -o x.png", READ),
        ("synth a.png --also secret.png --size 48 -o x.png", READ),
        ("motif --like secret.png -o x.png", READ),
        ("batch secret.toml", READ),
        ("batch hidden/*.png b.png --overlap 20 -o x/{name}.png", "your right to look into it"),
        ("batch a*.png b*.png --overlap 20 -o x/{name}.png --results locked/x.jsonl", WRITE),
        ("batch a*.png b*.png --overlap 20 -o locked/x/{name}.png", "ermission denied"),
        ("book a.png -n 2 --size 32 -o locked/book", WRITE),
        ("gimp install --dir locked", "check the rights of the folder"),
    ],
)
def test_what_may_not_be_read_or_written_is_one_sentence(started, ruled, line, phrase):
    ran = started(*line.split(), before=ruled)
    assert ran.code == 1
    assert phrase in ran.err
    assert ran.err.startswith("Error: ")
    assert ran.err.count("\n") == 1
