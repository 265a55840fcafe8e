"""The making of the engine's environment; the wheel is a tiny one that needs no network."""

import json
import subprocess
import sys
import zipfile

import pytest

from toposeam_gimp import __version__
from toposeam_gimp.engine import process, setting_up
from toposeam_gimp.engine.process import EngineError
from toposeam_gimp.engine.setting_up import SettingUp, StoppedError, source_of


@pytest.fixture
def record(tmp_path, monkeypatch):
    """Where the Python is noted."""
    file = tmp_path / "plug-in" / "engine.json"
    file.parent.mkdir()
    for module in (process, setting_up):
        monkeypatch.setattr(module, "settings_file", lambda: file)
    monkeypatch.setattr(setting_up, "_pythons", lambda: iter([["no-such-python"], [sys.executable]]))
    monkeypatch.delenv("TOPOSEAM_PYTHON", raising=False)
    return file


def _wheel(folder, version):
    """TopoSeam as far as the plug-in asks for it."""
    file, about = folder / f"toposeam-{version}-py3-none-any.whl", f"toposeam-{version}.dist-info"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("toposeam/__init__.py", f"__version__ = {version!r}")
        archive.writestr("toposeam_engine/__init__.py", "")
        archive.writestr(f"{about}/METADATA", f"Metadata-Version: 2.1\nName: toposeam\nVersion: {version}\n")
        archive.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}/RECORD", "")
    return file


@pytest.mark.medium
def test_an_environment_is_made_and_found(tmp_path, record):
    folder, steps = tmp_path / "engine", []
    SettingUp().make(folder, _wheel(tmp_path, __version__), lambda step, _size: steps.append(step))
    assert sorted(set(steps)) == [0, 1, 2]
    assert steps == sorted(steps)
    python = process.find_python(home=tmp_path)
    assert python.startswith(str(folder))
    assert json.loads(record.read_text())["without"] == ["graph-cut"]
    subprocess.run([python, "-c", "import toposeam_engine"], check=True)


def test_what_is_fetched_is_counted():
    said = [
        "  Downloading numpy-2.4.6-cp313-manylinux_2_28_x86_64.whl (16.8 MB)",
        "  Using cached click-8.5.1-py3-none-any.whl (126 kB)",
        "     ━━━━━━━━━━━━━━━━ 16.8/16.8 MB 42.0 MB/s",
        "Processing ./toposeam-0.2.0-py3-none-any.whl (from toposeam==0.2.0)",
    ]
    found = [match.groups() for line in said if (match := setting_up._FETCHED.search(line))]
    assert found == [("16.8", "MB"), ("126", "kB")]


@pytest.mark.medium
def test_another_release_is_refused_and_nothing_left(tmp_path, record):
    with pytest.raises(EngineError, match=r"is TopoSeam 0\.0\.1"):
        SettingUp().make(tmp_path / "engine", _wheel(tmp_path, "0.0.1"))
    assert not (tmp_path / "engine").exists()
    assert not record.exists()


def test_folders_with_other_things_are_left_alone(tmp_path, record):
    (tmp_path / "engine").mkdir()
    (tmp_path / "engine" / "letter.txt").write_text("dear")
    with pytest.raises(EngineError, match="holds something else"):
        SettingUp().make(tmp_path / "engine", _wheel(tmp_path, __version__))
    assert (tmp_path / "engine" / "letter.txt").read_text() == "dear"


def test_what_is_stopped_leaves_nothing(tmp_path, record):
    stopped = SettingUp()
    stopped.stop()
    with pytest.raises(StoppedError):
        stopped.make(tmp_path / "engine", _wheel(tmp_path, __version__))
    assert not (tmp_path / "engine").exists()
    assert not record.exists()


def test_no_python_is_one_sentence(tmp_path, record, monkeypatch):
    monkeypatch.setattr(setting_up, "_pythons", lambda: iter([["no-such-python"]]))
    with pytest.raises(EngineError, match=r"No Python 3\.11 or later"):
        SettingUp().make(tmp_path / "engine", _wheel(tmp_path, __version__))


def test_only_toposeam_itself_is_installed(tmp_path):
    wheel = _wheel(tmp_path, __version__)
    assert source_of(wheel) == wheel
    checkout = tmp_path / "checkout"
    (checkout / "core" / "toposeam").mkdir(parents=True)
    (checkout / "pyproject.toml").write_text("")
    assert source_of(checkout / "pyproject.toml") == checkout
    (tmp_path / "pyproject.toml").write_text("")
    (tmp_path / "numpy-2-py3-none-any.whl").write_text("")
    for name in ("pyproject.toml", "numpy-2-py3-none-any.whl", "toposeam-1.whl"):
        with pytest.raises(EngineError, match="is not TopoSeam"):
            source_of(tmp_path / name)
