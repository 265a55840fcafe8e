"""``[defaults]`` in a file of jobs: for every entry whose command knows the option, and for no other. Names
of what patterns match.
"""

import shlex
from pathlib import Path

import numpy as np
import pytest

from toposeam_cli.media.pictures.picture import Picture, write_picture

JOBS = """
[defaults]
overlap = "25%"
size = "64x48"

[[synth]]
sources = ["a.png"]
output = "large.png"

[[stitch]]
pictures = ["a.png", "b.png"]
output = "joined.png"

[[synth]]
sources = ["a.png"]
size = "32"
output = "small.png"

[[tile]]
image = "a.png"
output = "tile.png"
"""


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    for name in ("a.png", "b.png"):
        write_picture(name, Picture(pixels=rng.integers(0, 256, (48, 64, 3), np.uint8)))
    Path("jobs.toml").write_text(JOBS)
    return "jobs.toml"


def option(words, name):
    """The values that a command is told, with ``--name value`` or ``--name=value``."""
    told = [words[at + 1] for at, word in enumerate(words) if word == name]
    return told + [word.partition("=")[2] for word in words if word.startswith(f"{name}=")]


def test_defaults_reach_every_command_and_entries_override_them(toposeam, jobs):
    ran = toposeam("batch", jobs, "--dry-run")
    assert (ran.code, ran.err) == (0, "")
    lines = [shlex.split(line) for line in ran.out.splitlines()]
    commands = sorted((words[1], option(words, "--overlap"), option(words, "--size")) for words in lines)
    assert commands == [
        ("stitch", ["25%"], []),
        ("synth", ["25%"], ["32"]),
        ("synth", ["25%"], ["64x48"]),
        ("tile", [], []),
    ]


def test_a_default_valid_for_no_command_is_refused(toposeam, jobs):
    """``size`` is a size for one command and a choice for another; what is neither is told."""
    Path(jobs).write_text(JOBS.replace('size = "64x48"', 'tileable = "bth"'))
    toposeam("batch", jobs, "--dry-run").fails("is not one of 'both'")
    Path(jobs).write_text('[defaults]\nsize = "64x48"\n[[tile]]\nimage = "a.png"\noutput = "t.png"\n')
    toposeam("batch", jobs, "--dry-run").fails("'64x48' is not one of 'auto', 'keep'")


def test_a_pattern_without_extension_matches_names_without_one(toposeam, folder, photographs):
    for name, pixels in zip(("left_7.png", "right_7.png"), photographs, strict=True):
        write_picture(folder / name, Picture(pixels=pixels))
    assert toposeam("batch", "left_*", "right_*", "--overlap", "20", "-o", "out/{name}.png").code == 0
    assert [path.name for path in (folder / "out").iterdir()] == ["7.png"]
