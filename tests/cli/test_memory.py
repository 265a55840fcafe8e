"""Large pictures are joined without many copies of them."""

import os
import subprocess
import sys

import numpy as np
import pytest

from toposeam_cli.pictures.picture import Picture, write_picture

SIDE, OVERLAP = 3000, 300
#: What a process has before it reads anything: the interpreter, NumPy, SciPy and libvips.
BASE = 250 * 2**20
#: 6 GiB for two layers of 10,000 × 10,000 px that overlap by 1,000 px.
BYTES_PER_PIXEL = 6 * 2**30 / (19_000 * 10_000)


@pytest.mark.slow
def test_two_large_rgb_layers_take_no_more_memory_than_stated(tmp_path):
    rng = np.random.default_rng(0)
    for name in "ab":
        coarse = rng.integers(0, 256, (SIDE // 8, SIDE // 8, 3), np.uint8)
        write_picture(tmp_path / f"{name}.tif", Picture(pixels=coarse.repeat(8, axis=0).repeat(8, axis=1)))
    words = [
        "stitch",
        tmp_path / "a.tif",
        tmp_path / "b.tif",
        "--overlap",
        OVERLAP,
        "-o",
        tmp_path / "out.tif",
    ]
    # A small process starts it: its own largest memory would be passed on.
    code = (
        "import resource, subprocess, sys; done = subprocess.run([sys.executable, '-m', 'toposeam_cli', "
        "*sys.argv[1:]]); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); "
        "sys.exit(done.returncode)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        capture_output=True,
        text=True,
        env=os.environ,
        check=True,
    )
    peak = int(ran.stdout.splitlines()[-1]) * 1024
    assert peak < BASE + BYTES_PER_PIXEL * SIDE * (2 * SIDE - OVERLAP)
