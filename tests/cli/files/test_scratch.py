"""Temporary files for pixels: as many as there are pictures."""

import subprocess
import sys

import pytest

pytest.importorskip("resource")

MANY = """
import resource, sys
from pathlib import Path
from toposeam_cli.files.scratch import scratch
soft, hard = map(int, sys.argv[2:])
resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
with scratch(Path(sys.argv[1])) as store:
    print(len({store.new() for _ in range(150)}))
"""


def many(folder, soft, hard):
    call = [sys.executable, "-c", MANY, str(folder), str(soft), str(hard)]
    return subprocess.run(call, capture_output=True, text=True, timeout=60)


def test_more_files_are_kept_than_a_process_may_open_at_first(tmp_path):
    ran = many(tmp_path, 60, 400)
    assert (ran.returncode, ran.stdout.strip()) == (0, "150"), ran.stderr
    assert not list(tmp_path.iterdir())


def test_too_many_open_files_are_reported_with_ulimit(tmp_path):
    ran = many(tmp_path, 60, 100)
    assert ran.returncode == 1
    assert "too many open files); allow more with `ulimit -n 4096`" in ran.stderr
    assert not list(tmp_path.iterdir())
