"""What is written for systems that the tests do not run on, taken on this one by its other branches."""

import os

import pytest

import toposeam_cli.files.temporary as temporary_files
from toposeam_cli.files.temporary import remove_stale
from toposeam_cli.files.writing import all_or_nothing, atomic_write, replacing
from toposeam_gimp import engine


@pytest.fixture
def like_windows(monkeypatch):
    """No fcntl, no user numbers."""
    monkeypatch.setattr(temporary_files, "fcntl", None)
    monkeypatch.delattr(os, "getuid")


def test_without_fcntl_files_are_written_whole_or_not_at_all(tmp_path, like_windows):
    atomic_write(tmp_path / "a", "first")

    def fail_after_one():
        with all_or_nothing():
            atomic_write(tmp_path / "b", "second")
            raise FileExistsError

    def fail_halfway():
        with replacing(tmp_path / "a", force=True) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    for fail, error in ((fail_after_one, FileExistsError), (fail_halfway, ZeroDivisionError)):
        with pytest.raises(error):
            fail()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "first"}
    atomic_write(tmp_path / "a", "new", force=True)
    assert (tmp_path / "a").read_text() == "new"


def test_without_fcntl_what_a_killed_command_left_goes(tmp_path, like_windows):
    (tmp_path / f".toposeam-{'a' * 16}.part").write_text("half")
    (tmp_path / "other.part").write_text("not ours")
    remove_stale(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["other.part"]


def test_the_engine_is_looked_for_where_windows_has_programs(tmp_path, monkeypatch):
    monkeypatch.setattr(engine.sys, "platform", "win32")
    places = list(engine._usual_places(tmp_path))
    assert places
    assert all(place.parts[-2:] == ("Scripts", "python.exe") for place in places)
