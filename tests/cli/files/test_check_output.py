"""What cannot be written is refused before any work."""

import pytest

from toposeam.errors import OptionError
from toposeam_cli.files import temporary
from toposeam_cli.files import writing as output
from toposeam_cli.files.writing import PICTURE_SUFFIXES, check_output


def assert_one_sentence(error):
    text = str(error.value)
    assert text
    assert "\n" not in text
    assert "Traceback" not in text
    return text


def names(folder):
    return sorted(path.name for path in folder.iterdir())


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


def test_leftovers_go_also_where_the_output_is_refused(tmp_path, monkeypatch):
    """A command was killed after its outputs had their names, and before it had tidied."""
    monkeypatch.setattr(temporary, "_tidied", set())
    (tmp_path / "out.png").write_text("mine")
    (tmp_path / f".toposeam-{'a' * 16}.part").write_text("half")
    with pytest.raises(OptionError, match="exists already"):
        check_output(tmp_path / "out.png")
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]
