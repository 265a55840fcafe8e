"""Files are written whole or not at all, and nothing that exists is lost."""

import stat
from pathlib import Path

import pytest

from toposeam.errors import OptionError, TopoSeamError
from toposeam_cli import output
from toposeam_cli.output import PICTURE_SUFFIXES, OutputError, all_or_nothing, atomic_write, check_output, replacing


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


@pytest.mark.parametrize(("content", "stored"), [(b"\x00\xff", b"\x00\xff"), ("<svg>é\n</svg>", "<svg>é\n</svg>".encode()), (b"", b"")])
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


def test_a_failed_rename_without_hard_links_leaves_no_empty_file(tmp_path, no_hard_links, monkeypatch):
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


@pytest.mark.parametrize("suffix", [*PICTURE_SUFFIXES, ".PNG", ".Tif"])
def test_supported_extensions_pass_in_either_case(tmp_path, suffix):
    assert check_output(tmp_path / f"out{suffix}") == tmp_path / f"out{suffix}"
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["out", "out.gif", "out.bmp", "out.png.txt", ".png", "out.", "", "."])
def test_other_extensions_are_refused_with_the_list(tmp_path, name):
    with pytest.raises(OptionError) as error:
        check_output(tmp_path / name)
    assert all(suffix in assert_one_sentence(error) for suffix in PICTURE_SUFFIXES)


def test_a_caller_names_its_own_extensions(tmp_path):
    check_output(tmp_path / "out.svg", suffixes=(".svg",))
    check_output(tmp_path / "anything", suffixes=None)
    with pytest.raises(OptionError, match=r"\.svg"):
        check_output(tmp_path / "out.png", suffixes=(".svg",))


@pytest.mark.parametrize(
    ("path", "remedy"),
    [
        ("{tmp}/missing/out.png", "there is no folder"),
        ("{tmp}/file/out.png", "there is no folder"),
        ("{tmp}/folder.png", "other than a file"),
        ("{tmp}/" + "n" * 300 + ".png", "choose another name"),
        ("{tmp}/nul\0.png", "choose another name"),
        ("{tmp}/loop.png", "choose another"),
        ("/proc/out.png", "choose another name or folder"),
    ],
)
def test_hopeless_places_are_refused_before_any_work(tmp_path, path, remedy):
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    before = names(tmp_path)
    for force in (False, True):
        with pytest.raises(OptionError) as error:
            check_output(path.format(tmp=tmp_path), force)
        assert remedy in assert_one_sentence(error)
    assert names(tmp_path) == before


def test_a_read_only_folder_is_refused(tmp_path, monkeypatch):
    def fail(**options):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(output.tempfile, "TemporaryFile", fail)
    with pytest.raises(OptionError, match="read-only file system"):
        check_output(tmp_path / "out.png")


def test_an_existing_file_passes_the_check_with_force_only(tmp_path):
    path = tmp_path / "out.png"
    path.write_bytes(b"old")
    assert check_output(str(path), force=True) == path
    with pytest.raises(OptionError, match="--force"):
        check_output(path)
    assert path.read_bytes() == b"old"


def test_a_relative_path_is_relative_to_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    atomic_write("out.json", "{}")
    assert Path("out.json").read_text() == "{}"


def test_a_failed_block_takes_its_new_files_back_and_nothing_else(tmp_path):
    (tmp_path / "old.txt").write_text("old")

    def fail():
        with all_or_nothing():
            atomic_write(tmp_path / "new.txt", "new")
            atomic_write(tmp_path / "old.txt", "replaced", force=True)
            atomic_write(tmp_path / "theirs.txt", "ours")
            atomic_write(tmp_path / "other.txt", "theirs")
            (tmp_path / "other.txt").replace(tmp_path / "theirs.txt")  # as another process would
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"old.txt": "replaced", "theirs.txt": "theirs"}
