"""``toposeam gimp``: the plug-in's way into GIMP's folders, without a GIMP."""

import json
import os
import stat
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest
from gimp_home import plug_in, run

import toposeam as ts
from toposeam_cli.gimp import folders as gimp_folders

CHECKOUT = Path(__file__).parents[3]


def test_install_goes_into_every_gimp_3_profile(home):
    output = run("install")
    assert str(plug_in(home, "3.0")) in output
    for version in ("3.0", "3.2"):
        main_file = plug_in(home, version) / "toposeam_gimp.py"
        assert main_file.stat().st_mode & stat.S_IXUSR
        record = json.loads((plug_in(home, version) / "engine.json").read_text())
        assert record["python"] == sys.executable
        assert sorted(record["files"]) == sorted(
            path.relative_to(plug_in(home, version)).as_posix()
            for path in plug_in(home, version).rglob("*")
            if path.is_file()
        )
        assert sorted(path.name for path in plug_in(home, version).parent.iterdir()) == ["toposeam_gimp"]
    assert not plug_in(home, "2.10").exists()


def test_reinstalling_replaces_old_files_with_newer_ones(home):
    run("install", "--gimp-version", "3.0")
    stale = plug_in(home, "3.0") / "stale.py"
    stale.touch()
    record = json.loads((plug_in(home, "3.0") / "engine.json").read_text())
    record["files"].append("stale.py")  # as an older version had put it there
    (plug_in(home, "3.0") / "engine.json").write_text(json.dumps(record))
    (plug_in(home, "3.0") / "__pycache__").mkdir()
    (plug_in(home, "3.0") / "__pycache__" / "seams.cpython-313.pyc").touch()
    os.utime(plug_in(home, "3.0") / "toposeam_gimp.py", (0, 0))
    run("install", "--gimp-version", "3.0")
    assert not stale.exists()
    assert (plug_in(home, "3.0") / "toposeam_gimp.py").stat().st_mtime > 1e9


def test_a_version_that_was_never_started_gets_its_folder(home):
    run("install", "--gimp-version", "3.4")
    assert (plug_in(home, "3.4") / "toposeam_gimp.py").is_file()


def test_a_folder_of_ones_own_and_another_python(home, tmp_path):
    run("install", "--dir", tmp_path / "mine", "--python", sys.executable)
    assert (tmp_path / "mine" / "toposeam_gimp" / "toposeam_gimp.py").is_file()


@pytest.mark.parametrize("command", ["install", "uninstall"])
@pytest.mark.parametrize("what", ["work", "a file beside it", "a link", "a file", "a plug-in of that name"])
def test_what_is_not_the_plug_in_is_left_untouched(home, tmp_path, command, what):
    there = tmp_path / "mine" / "toposeam_gimp"
    if what == "a file beside it":
        run("install", "--dir", tmp_path / "mine")
        (there / "notes.txt").write_text("precious")
    elif what == "a link":
        (tmp_path / "elsewhere").mkdir()
        (tmp_path / "elsewhere" / "notes.txt").write_text("precious")
        there.parent.mkdir()
        there.symlink_to(tmp_path / "elsewhere")
    elif what == "a file":
        there.parent.mkdir()
        there.write_text("precious")
    else:
        there.mkdir(parents=True)
        (there / ("thesis.txt" if what == "work" else "toposeam_gimp.py")).write_text("precious")
        (there / "chapter").mkdir()
        (there / "chapter" / "one.txt").write_text("precious")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert "move it elsewhere" in run(command, "--dir", tmp_path / "mine", code=1)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_failed_installation_brings_the_old_one_back(home, monkeypatch):
    run("install", "--gimp-version", "3.0")
    before = {path.name: path.stat().st_mtime_ns for path in plug_in(home, "3.0").iterdir()}
    rename = Path.rename

    def fail_once(path, target):
        if path.suffix == ".new":
            raise OSError(5, "Input/output error")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fail_once)
    assert "cannot write" in run("install", "--gimp-version", "3.0", code=1)
    assert {path.name: path.stat().st_mtime_ns for path in plug_in(home, "3.0").iterdir()} == before
    assert [path.name for path in plug_in(home, "3.0").parent.iterdir()] == ["toposeam_gimp"]


def test_gimp_sees_that_what_was_installed_is_new(home):
    """GIMP asks a plug-in for its procedures where its file is newer than what it remembers."""
    begun = time.time()
    run("install", "--gimp-version", "3.0")
    main = plug_in(home, "3.0") / "toposeam_gimp.py"
    assert main.stat().st_mtime >= begun - 2
    assert main.stat().st_mtime > (main.parent / "texts.py").stat().st_mtime


def test_uninstall_leaves_nothing(home):
    run("install")
    assert str(plug_in(home, "3.2")) in run("uninstall")
    assert not plug_in(home, "3.0").exists()
    assert "nothing to remove" in run("uninstall")


@pytest.mark.parametrize(
    ("arguments", "phrase"),
    [
        (("--gimp-version", "2.10"), "GIMP 3"),
        (("--gimp-version", "3.0", "--dir", "x"), "give one of them"),
        (("--python", "nowhere"), "no such program"),
    ],
)
def test_bad_requests_are_one_sentence(home, arguments, phrase):
    assert phrase in run("install", *arguments, code=1)
    assert not plug_in(home, "3.0").exists()


def test_without_any_profile_it_says_where_it_looked(home):
    for version in ("3.0", "3.2"):
        (home / ".config" / "GIMP" / version).rmdir()
    output = run("install", code=1)
    assert "install GIMP 3, or say --gimp-version" in output
    assert str(home / ".config" / "GIMP") in output


@pytest.mark.parametrize(
    ("platform", "environment", "expected"),
    [
        (
            "linux",
            {},
            [".config/GIMP", ".var/app/org.gimp.GIMP/config/GIMP", "snap/gimp/current/.config/GIMP"],
        ),
        (
            "linux",
            {"XDG_CONFIG_HOME": "HOME/xdg"},
            ["xdg/GIMP", ".var/app/org.gimp.GIMP/config/GIMP", "snap/gimp/current/.config/GIMP"],
        ),
        ("win32", {"APPDATA": "HOME/roaming"}, ["roaming/GIMP"]),
        ("darwin", {}, ["Library/Application Support/GIMP"]),
    ],
)
def test_profiles_of_each_system(tmp_path, platform, environment, expected):
    environment = {name: value.replace("HOME", str(tmp_path)) for name, value in environment.items()}
    for root in expected:
        (tmp_path / root / "3.0").mkdir(parents=True)
    found = gimp_folders.profiles(None, environment, platform, tmp_path)
    assert [profile.plug_ins for profile in found] == [
        tmp_path / root / "3.0" / "plug-ins" for root in expected
    ]


def test_gimp3_directory_is_where_gimp_looks_then(home, monkeypatch):
    monkeypatch.setenv("GIMP3_DIRECTORY", str(home / "elsewhere"))
    run("install")
    assert (home / "elsewhere" / "plug-ins" / "toposeam_gimp" / "toposeam_gimp.py").is_file()


@pytest.mark.medium
def test_doctor_finds_a_working_engine_and_no_gimp(home):
    run("install", "--gimp-version", "3.0")
    output = run("doctor", "--gimp-version", "3.0", code=1)
    assert "no GIMP 3 was found" in output
    assert f"ok       the engine works: {sys.executable}" in output


def test_doctor_names_each_trouble_and_its_remedy(home):
    assert "the plug-in is not in" in run("doctor", "--gimp-version", "3.0", code=1)
    run("install", "--gimp-version", "3.0")
    folder = plug_in(home, "3.0")
    (folder / "toposeam_gimp.py").chmod(0o644)
    (folder / "__init__.py").write_text('__version__ = "0.0.1"\n')
    (folder / "engine.json").write_text('{"python": "/nowhere/python"}')
    output = run("doctor", "--gimp-version", "3.0", code=1)
    assert "chmod +x" in output
    assert f"the plug-in there is of TopoSeam 0.0.1, and this is {ts.__version__}" in output
    assert "/nowhere/python does not start" in output
    (folder / "engine.json").unlink()
    assert "engine.json is missing" in run("doctor", "--gimp-version", "3.0", code=1)


def test_doctor_finds_nested_folders_and_files_without_a_folder(home):
    inner = plug_in(home, "3.0") / "toposeam_gimp"
    inner.mkdir(parents=True)
    (inner / "toposeam_gimp.py").touch()
    assert "move the inner folder up" in run("doctor", "--gimp-version", "3.0", code=1)
    (plug_in(home, "3.2").parent).mkdir()
    (plug_in(home, "3.2").parent / "toposeam_gimp.py").touch()
    assert "a folder of its own" in run("doctor", "--gimp-version", "3.2", code=1)


@pytest.mark.medium
def test_doctor_knows_whether_gimp_was_started_since(home):
    run("install", "--gimp-version", "3.0")
    record = home / ".config" / "GIMP" / "3.0" / "pluginrc"
    record.write_text("(plug-in-def …)")
    os.utime(record, (0, 0))
    assert "was not started since" in run("doctor", "--gimp-version", "3.0", code=1)
    os.utime(record)
    os.utime(plug_in(home, "3.0") / "toposeam_gimp.py", (1e9, 1e9))
    assert "did not register it" in run("doctor", "--gimp-version", "3.0", code=1)
    record.write_text('(plug-in-def "${gimp_dir}/plug-ins/toposeam_gimp/toposeam_gimp.py" 1')
    assert "has registered it" in run("doctor", "--gimp-version", "3.0", code=1)


def test_a_profile_that_cannot_be_written_keeps_the_old_plug_in(home, monkeypatch):
    run("install", "--gimp-version", "3.0")
    before = sorted(path.name for path in plug_in(home, "3.0").rglob("*"))

    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(gimp_folders.shutil, "copytree", full)
    assert "cannot write" in run("install", "--gimp-version", "3.0", code=1)
    assert sorted(path.name for path in plug_in(home, "3.0").rglob("*")) == before
    assert [path.name for path in plug_in(home, "3.0").parent.iterdir()] == ["toposeam_gimp"]


def test_a_failed_installation_keeps_the_old_plug_in(home, monkeypatch):
    run("install", "--gimp-version", "3.0")
    (plug_in(home, "3.0") / "plugin.py").write_text("old")
    rename = Path.rename

    def refuse(self, target):
        if self.suffix == ".new":
            raise PermissionError(13, "Permission denied")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", refuse)
    assert "cannot write" in run("install", "--gimp-version", "3.0", code=1)
    assert (plug_in(home, "3.0") / "plugin.py").read_text() == "old"
    assert [path.name for path in plug_in(home, "3.0").parent.iterdir()] == ["toposeam_gimp"]


def test_the_zip_has_one_folder_whose_main_file_is_executable(tmp_path):
    target, wheel = tmp_path / "plug-in.zip", tmp_path / "toposeam-0-py3-none-any.whl"
    wheel.write_bytes(b"wheel")
    subprocess.run(
        [sys.executable, str(CHECKOUT / "plugin_gimp" / "make_zip.py"), str(target), str(wheel)],
        check=True,
        capture_output=True,
    )
    with zipfile.ZipFile(target) as archive:
        rights = {entry.filename: entry.external_attr >> 16 for entry in archive.infolist()}
    assert {name.split("/")[0] for name in rights} == {"toposeam_gimp"}
    assert rights["toposeam_gimp/toposeam_gimp.py"] == 0o755
    assert rights["toposeam_gimp/actions/seams.py"] == 0o644
    assert rights["toposeam_gimp/pictures/rule-p4m.png"] == 0o644
    assert {"toposeam_gimp/GUIDE.txt", f"toposeam_gimp/wheel/{wheel.name}"} <= set(rights)
    assert not any(name.endswith((".pyc", "engine.json")) for name in rights)


def test_a_profile_is_not_taken_for_a_plug_ins_folder(toposeam, tmp_path):
    (tmp_path / "3.0" / "plug-ins").mkdir(parents=True)
    toposeam("gimp", "install", "--dir", str(tmp_path / "3.0")).fails(
        "a GIMP profile, where GIMP looks for no plug-ins"
    )
    assert not (tmp_path / "3.0" / "toposeam_gimp").exists()


def test_the_main_file_can_be_run_whatever_the_package_says(home, monkeypatch):
    copied = gimp_folders.shutil.copytree

    def unpacked(*arguments, **options):
        folder = copied(*arguments, **options)
        for path in Path(folder).rglob("*.py"):  # as a wheel has them
            path.chmod(0o644)
        return folder

    monkeypatch.setattr(gimp_folders.shutil, "copytree", unpacked)
    run("install")
    assert (plug_in(home, "3.0") / "toposeam_gimp.py").stat().st_mode & 0o111 == 0o111
