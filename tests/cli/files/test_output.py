"""Files are written whole or not at all, and nothing that exists is lost."""

import hashlib
import os
import signal
import stat
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from toposeam.errors import OptionError, TopoSeamError
from toposeam_cli.files import temporary as temporary_files
from toposeam_cli.files import writing as output
from toposeam_cli.files.interruption import Terminated, terminations_raised
from toposeam_cli.files.temporary import remove_stale
from toposeam_cli.files.writing import (
    OutputError,
    all_or_nothing,
    atomic_write,
    check_output,
    replacing,
)


def assert_one_sentence(error):
    text = str(error.value)
    assert text
    assert "\n" not in text
    assert "Traceback" not in text
    return text


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def full_disk(monkeypatch):
    """A disk on which nothing can be written: what was not yet written is lost on fsync."""

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(output.os, "fsync", fail)


@pytest.fixture
def no_hard_links(monkeypatch):
    def fail(source, target):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(output.os, "link", fail)


@pytest.mark.parametrize(
    ("content", "stored"),
    [(b"\x00\xff", b"\x00\xff"), ("<svg>é\n</svg>", "<svg>é\n</svg>".encode()), (b"", b"")],
)
def test_content_arrives_byte_for_byte(tmp_path, content, stored):
    atomic_write(tmp_path / "out.svg", content)
    assert (tmp_path / "out.svg").read_bytes() == stored
    assert names(tmp_path) == ["out.svg"]


def test_a_new_file_has_the_rights_the_umask_leaves(tmp_path):
    (tmp_path / "usual").touch()
    atomic_write(tmp_path / "out.json", "{}")
    assert (tmp_path / "out.json").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_replaced_file_keeps_its_rights(tmp_path):
    path = tmp_path / "out.json"
    path.touch(mode=0o640)
    path.chmod(0o640)
    atomic_write(path, "{}", force=True)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert path.read_text() == "{}"


def test_an_existing_file_is_kept_and_the_message_names_force(tmp_path):
    path = tmp_path / "out.svg"
    path.write_text("precious")
    with pytest.raises(OptionError) as error:
        atomic_write(path, "new")
    assert "--force" in assert_one_sentence(error)
    assert str(path) in str(error.value)
    assert path.read_text() == "precious"
    assert names(tmp_path) == ["out.svg"]


@pytest.mark.parametrize("links", ["hard links", "no hard links"])
def test_a_file_that_appears_meanwhile_is_kept(tmp_path, request, links):
    if links == "no hard links":
        request.getfixturevalue("no_hard_links")
    path = tmp_path / "out.svg"

    def write_while_another_does():
        with replacing(path) as temporary:
            temporary.write_text("ours")
            path.write_text("someone else's")

    with pytest.raises(OptionError, match="--force"):
        write_while_another_does()
    assert path.read_text() == "someone else's"
    assert names(tmp_path) == ["out.svg"]


def test_a_file_system_without_hard_links_works(tmp_path, no_hard_links):
    atomic_write(tmp_path / "out.svg", "new")
    assert (tmp_path / "out.svg").read_text() == "new"
    assert names(tmp_path) == ["out.svg"]


def test_a_failed_rename_without_hard_links_leaves_no_file(tmp_path, no_hard_links, monkeypatch):
    def fail(source, target):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OutputError):
        atomic_write(tmp_path / "out.svg", "new")
    assert names(tmp_path) == []


def test_a_full_disk_keeps_the_existing_file(tmp_path, full_disk):
    path = tmp_path / "out.svg"
    path.write_text("precious")
    with pytest.raises(OutputError) as error:
        atomic_write(path, "new", force=True)
    assert "no space left on device" in assert_one_sentence(error)
    assert isinstance(error.value, TopoSeamError)
    assert isinstance(error.value, OSError)
    assert path.read_text() == "precious"
    assert names(tmp_path) == ["out.svg"]


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, RuntimeError, MemoryError])
def test_an_interruption_leaves_nothing_behind(tmp_path, interruption):
    def write_half():
        with replacing(tmp_path / "out.svg") as temporary:
            temporary.write_text("half")
            raise interruption

    with pytest.raises(interruption):
        write_half()
    assert names(tmp_path) == []


def test_a_symbolic_link_keeps_pointing_to_the_new_content(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "real.svg").write_text("old")
    (tmp_path / "link.svg").symlink_to(tmp_path / "there" / "real.svg")
    atomic_write(tmp_path / "link.svg", "new", force=True)
    assert (tmp_path / "link.svg").is_symlink()
    assert (tmp_path / "there" / "real.svg").read_text() == "new"


def test_a_dangling_link_is_filled(tmp_path):
    (tmp_path / "link.svg").symlink_to(tmp_path / "real.svg")
    atomic_write(tmp_path / "link.svg", "new")
    assert (tmp_path / "real.svg").read_text() == "new"


def test_a_relative_path_is_relative_to_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    atomic_write("out.json", "{}")
    assert Path("out.json").read_text() == "{}"


def write_all(folder, texts):
    for name, text in texts.items():
        atomic_write(folder / name, text)


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_a_failed_block_leaves_everything_as_it_was(tmp_path):
    (tmp_path / "old.txt").write_text("old")

    def fail():
        with all_or_nothing():
            atomic_write(tmp_path / "new.txt", "new")
            atomic_write(tmp_path / "old.txt", "replaced", force=True)
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert contents(tmp_path) == {"old.txt": "old"}


@pytest.mark.parametrize("links", ["hard links", "no hard links"])
@pytest.mark.parametrize("last", ["taken by another", "a folder", "cannot be renamed"])
def test_a_failed_rename_of_one_output_restores_the_others(tmp_path, request, monkeypatch, links, last):
    if links == "no hard links":
        request.getfixturevalue("no_hard_links")
    (tmp_path / "old.txt").write_text("old")
    (tmp_path / "old.txt").chmod(0o600)

    def write():
        with all_or_nothing():
            atomic_write(tmp_path / "old.txt", "replaced", force=True)
            atomic_write(tmp_path / "new.txt", "new")
            atomic_write(tmp_path / "last.txt", "ours", force=last == "cannot be renamed")
            if last == "taken by another":
                (tmp_path / "last.txt").write_text("theirs")
            else:
                (tmp_path / "last.txt").mkdir()

    with pytest.raises(TopoSeamError) as error:
        write()
    assert "last.txt" in assert_one_sentence(error)
    assert names(tmp_path) == ["last.txt", "old.txt"]
    assert (tmp_path / "old.txt").read_text() == "old"
    assert stat.S_IMODE((tmp_path / "old.txt").stat().st_mode) == 0o600


def test_nothing_appears_before_the_end_of_the_block(tmp_path):
    with all_or_nothing():
        atomic_write(tmp_path / "a.txt", "a")
        assert not (tmp_path / "a.txt").exists()
    assert contents(tmp_path) == {"a.txt": "a"}


def test_a_block_within_a_block_ends_with_that(tmp_path):
    def outer():
        with all_or_nothing():
            with all_or_nothing():
                atomic_write(tmp_path / "inner.txt", "inner")
            with suppress(KeyError), all_or_nothing():
                atomic_write(tmp_path / "failed.txt", "failed")
                raise KeyError
            atomic_write(tmp_path / "outer.txt", "outer")
            assert not [name for name in names(tmp_path) if not name.startswith(".")]
            if failing:
                raise LookupError

    failing = True
    with pytest.raises(LookupError):
        outer()
    assert names(tmp_path) == []
    failing = False
    outer()
    assert contents(tmp_path) == {"inner.txt": "inner", "outer.txt": "outer"}


def test_a_file_replaced_by_another_process_is_not_restored(tmp_path, monkeypatch):
    put = output.OutputBlock._put

    def put_and_be_overtaken(self, prepared):
        if prepared.path.name == "b.txt":
            (tmp_path / "theirs").write_text("theirs")
            (tmp_path / "theirs").replace(tmp_path / "a.txt")
            raise OSError(5, "Input/output error")
        put(self, prepared)

    monkeypatch.setattr(output.OutputBlock, "_put", put_and_be_overtaken)
    with pytest.raises(OutputError), all_or_nothing():
        write_all(tmp_path, {"a.txt": "ours", "b.txt": "ours"})
    assert contents(tmp_path) == {"a.txt": "theirs"}


def test_what_we_made_may_be_replaced_until_somebody_changes_it(tmp_path):
    with all_or_nothing(digests=True) as outputs:
        atomic_write(tmp_path / "a.txt", "first")
    made = dict(outputs.made)
    assert made == {str(tmp_path / "a.txt"): hashlib.sha256(b"first").hexdigest()}
    with all_or_nothing(made, digests=True) as outputs:
        check_output(tmp_path / "a.txt", suffixes=None)
        atomic_write(tmp_path / "a.txt", "second")
    assert contents(tmp_path) == {"a.txt": "second"}
    with pytest.raises(OptionError, match="--force"), all_or_nothing(made):
        atomic_write(tmp_path / "a.txt", "third")  # of which "second" is not the digest
    (tmp_path / "a.txt").write_text("retouched by hand")
    with pytest.raises(OptionError, match="--force"), all_or_nothing(outputs.made):
        check_output(tmp_path / "a.txt", suffixes=None)
    assert contents(tmp_path) == {"a.txt": "retouched by hand"}


def test_a_second_try_keeps_what_the_first_had_written(tmp_path):
    (tmp_path / "a.txt").write_text("a")
    before = (tmp_path / "a.txt").stat()
    with all_or_nothing(resumed=True):
        atomic_write(tmp_path / "a.txt", "a")
        atomic_write(tmp_path / "b.txt", "b")
    assert contents(tmp_path) == {"a.txt": "a", "b.txt": "b"}
    after = (tmp_path / "a.txt").stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    with pytest.raises(OptionError, match="--force"), all_or_nothing(resumed=True):
        write_all(tmp_path, {"c.txt": "c", "a.txt": "other"})
    assert contents(tmp_path) == {"a.txt": "a", "b.txt": "b"}


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs users")
def test_leftovers_of_a_killed_command_are_removed_by_the_next(tmp_path):
    ours, live = (tmp_path / f".toposeam-{digit * 16}.part" for digit in "ab")
    foreign = [
        tmp_path / ".toposeam-notes.part",
        tmp_path / ".toposeam-0123456789abcdef.part.txt",
        tmp_path / f".toposeam-{'c' * 16}.part",
        tmp_path / f".toposeam-{'d' * 16}.old",
    ]
    for path in (ours, live, *foreign[:2]):
        path.write_text("half")
    foreign[2].symlink_to(foreign[0])
    foreign[3].mkdir()
    script = (
        "import sys; from pathlib import Path; from toposeam_cli.files.writing import atomic_write;"
        "atomic_write(Path(sys.argv[1]), 'x')"
    )
    with live.open("rb") as file:
        assert temporary_files.lock(file.fileno())
        subprocess.run([sys.executable, "-c", script, str(tmp_path / "out.txt")], check=True)
    assert sorted(tmp_path.iterdir()) == sorted([live, *foreign, tmp_path / "out.txt"])
    if os.getuid() == 0:
        ours.write_text("of another user")
        os.chown(ours, 12345, 12345)
        remove_stale(tmp_path)
        assert ours.exists()


def test_without_locks_only_old_leftovers_go(tmp_path, monkeypatch):
    monkeypatch.setattr(temporary_files, "_lock", lambda descriptor: None)
    new, old = (tmp_path / f".toposeam-{digit * 16}.part" for digit in "ab")
    new.touch()
    old.touch()
    os.utime(old, (time.time() - 2 * 86400,) * 2)
    remove_stale(tmp_path)
    assert names(tmp_path) == [new.name]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_during_renames_is_raised_after_them(tmp_path, monkeypatch, number):
    put = output.OutputBlock._put

    def interrupted(self, prepared):
        os.kill(os.getpid(), number)
        put(self, prepared)

    monkeypatch.setattr(output.OutputBlock, "_put", interrupted)
    with pytest.raises((KeyboardInterrupt, Terminated)), terminations_raised(), all_or_nothing():
        write_all(tmp_path, {"a": "a", "b": "b", "c": "c"})
    assert contents(tmp_path) == {"a": "a", "b": "b", "c": "c"}
