"""Another user of the same machine, who can write where temporary files lie."""

import os
import shutil
import tempfile
import time
from pathlib import Path

import pytest

from toposeam_cli.files import temporary
from toposeam_cli.files.temporary import private_folder

#: Nobody's number, as good as another user's.
OTHER = 65534

pytestmark = pytest.mark.skipif(
    not hasattr(os, "getuid") or os.getuid() != 0, reason="only root can act as another user"
)


def as_other(*attempts):
    """How many of some attempts another user gets through with."""
    child = os.fork()
    if child == 0:
        done = 99
        try:
            os.setgroups([])
            os.setgid(OTHER)
            os.setuid(OTHER)
            done = 0
            for attempt in attempts:
                try:
                    attempt()
                    done += 1
                except PermissionError:
                    continue
        finally:
            os._exit(done)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.fixture
def shared(monkeypatch):
    """A folder like /tmp, in which everyone may write, and nobody remove what is another's."""
    folder = Path(tempfile.mkdtemp(dir="/tmp"))
    folder.chmod(0o1777)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr(temporary, "_tidied", set())
    yield folder
    shutil.rmtree(folder)


def test_nobody_else_gets_into_a_temporary_folder(shared):
    before = os.umask(0)
    try:
        with private_folder() as folder:
            (folder / "secret").write_text("secret")
            let_in = as_other(
                lambda: list(folder.iterdir()),
                lambda: (folder / "secret").read_text(),
                lambda: (folder / "mine").write_text("x"),
                lambda: folder.rename(folder.with_name("elsewhere")),
                lambda: folder.rmdir(),
                lambda: folder.chmod(0o777),
            )
            assert let_in == 0
            assert as_other(lambda: (shared / "mine").write_text("x")) == 1  # it can act at all
            assert [path.name for path in folder.iterdir()] == ["secret"]
    finally:
        os.umask(before)
    assert [path.name for path in shared.iterdir()] == ["mine"]


def test_what_others_leave_under_our_names_is_left_alone(shared):
    theirs, link, trap = (shared / f".toposeam-{digit * 16}.part" for digit in "abc")
    assert as_other(theirs.mkdir, lambda: link.symlink_to("/etc"), lambda: os.mkfifo(trap)) == 3
    before = sorted(shared.iterdir())
    with private_folder() as folder:
        assert folder not in before
    assert sorted(shared.iterdir()) == before
    assert Path("/etc/passwd").exists()


def test_request_folders_of_others_are_not_swept(shared):
    """Also where their sign of life is a link to a file of ours."""
    from toposeam_gimp.engine import folder as requests

    theirs = shared / "toposeam-request-evil"
    made = as_other(
        theirs.mkdir,
        lambda: (theirs / requests.MARKER).write_text("x"),
        lambda: (theirs / requests._SIGN_OF_LIFE).symlink_to("/etc/hostname"),
    )
    assert made == 3
    requests.sweep(shared, now=time.time() + 10 * requests.STALE_S)
    assert theirs.is_dir()
