"""The library of kernels: built from what lies beside it, left out where it is not wanted."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from toposeam import _kernels

HERE = Path(__file__).parents[2]
SAYS = "from toposeam import _kernels; print(_kernels.library is not None)"


def said(environment=None):
    ended = subprocess.run(
        [sys.executable, "-c", SAYS], check=True, capture_output=True, text=True, env=environment
    )
    return ended.stdout.strip()


def test_kernels_can_be_refused(monkeypatch):
    assert said() == str(_kernels.library is not None)
    monkeypatch.setenv("TOPOSEAM_KERNELS", "0")
    assert said() == "False"


@pytest.fixture
def hook(tmp_path, monkeypatch):
    """hatch_build.py, at work on a copy of the kernels."""
    pytest.importorskip("hatchling")
    spec = importlib.util.spec_from_file_location("hatch_build", HERE / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for file in (HERE / "core/toposeam/_kernels").glob("*.*"):
        if file.suffix in (".c", ".h", ".py"):
            (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    monkeypatch.delenv("TOPOSEAM_KERNELS", raising=False)
    return module


def library_in(folder):
    """What the copy of the package there loads."""
    spec = importlib.util.spec_from_file_location("copied", folder / "__init__.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.library


@pytest.mark.medium
def test_a_library_serves_the_sources_it_was_built_from(hook, tmp_path):
    assert library_in(tmp_path) is None
    built = hook.build()
    if built is None:
        pytest.skip("there is no C compiler")
    assert library_in(tmp_path) is not None
    (tmp_path / "flow.c").write_text("/* changed */\n" + (tmp_path / "flow.c").read_text())
    assert library_in(tmp_path) is None
    again = hook.build()
    assert library_in(tmp_path) is not None
    assert [file.name for file in tmp_path.glob("kernels-*")] == [again.name]


@pytest.mark.parametrize("wrong", ["no compiler", "one that fails", "refused", "no sense"])
def test_without_a_compiler_nothing_is_built(hook, tmp_path, monkeypatch, wrong):
    if wrong == "no compiler":
        monkeypatch.setattr(hook.shutil, "which", lambda _: None)
    elif wrong == "one that fails":
        monkeypatch.setenv("CC", sys.executable)
    elif wrong == "refused":
        monkeypatch.setenv("TOPOSEAM_KERNELS", "0")
    else:
        (tmp_path / "flow.c").write_text("no C")
    assert hook.build() is None
    assert not list(tmp_path.glob("kernels-*"))


def test_a_file_that_is_no_library_is_left_out(hook, tmp_path, monkeypatch):
    monkeypatch.setattr(hook.subprocess, "run", lambda words, **_: Path(words[-1]).write_text("text"))
    monkeypatch.setattr(hook, "_compiler", lambda: ["cc"])
    assert hook.build().read_text() == "text"
    assert library_in(tmp_path) is None
