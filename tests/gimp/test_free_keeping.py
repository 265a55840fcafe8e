"""Of the engine that is kept between calls: it answers again, recovers, and ends by itself."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import pytest
from processes import living
from processes import wait_for as wait_long

from toposeam_engine import listening
from toposeam_gimp.engine import folder, keeping, turns
from toposeam_gimp.engine import process as engine

wait_for = partial(wait_long, seconds=30)
pytestmark = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="there are no Unix sockets")


@pytest.fixture
def session(monkeypatch):
    """The folder of a session; the process that stands for GIMP, this process's parent for the plug-in."""
    tmp_path = Path(tempfile.mkdtemp())  # pytest's are longer than the address of a socket may be
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("TOPOSEAM_PYTHON", sys.executable)
    monkeypatch.setattr(folder.tempfile, "gettempdir", lambda: str(tmp_path))
    tmp_path.chmod(0o700)
    gimp = subprocess.Popen(["sleep", "600"])
    monkeypatch.setattr(keeping.os, "getppid", lambda: gimp.pid)
    yield gimp, tmp_path
    gimp.kill()
    gimp.wait()
    wait_for(lambda: not sockets(tmp_path))
    shutil.rmtree(tmp_path)


def listening_in(folder):
    return [each.number for each in living() if f"--listen\0{folder}".encode() in each.command]


def sockets(folder):
    return list(folder.glob("toposeam-engine-*"))


def kept():
    return engine.kept_engine(engine.command_of(sys.executable), engine.PROTOCOL)


def keep(where):
    engine.keep()
    wait_for(lambda: sockets(where))
    wait_for(lambda: (one := kept()) and one.end() == 0 and one)


def ask():
    """Ask for Re-stitch of nothing: the engine's answer is a sentence."""
    with folder.RequestFolder() as made:
        engine.begin(made, "restitch")
        kind = type(made.engine)
        with pytest.raises(engine.EngineError) as raised:
            engine.ask(made, {"operation": "restitch", "layers": []}, lambda share: None)
    return kind, str(raised.value)


@pytest.mark.medium
def test_one_engine_answers_call_after_call(session):
    _gimp, where = session
    assert ask()[0] is engine.Engine  # none is kept yet
    keep(where)
    (address,) = sockets(where)
    assert address.stat().st_mode & 0o777 == 0o600
    answers = [ask() for _ in range(3)]
    assert {kind for kind, _said in answers} == {keeping.KeptEngine}
    assert {said for _kind, said in answers} == {answers[0][1]}
    engine.keep()
    time.sleep(0.5)
    assert sockets(where) == [address]
    assert not list(where.glob("toposeam-request-*"))


@pytest.mark.medium
def test_a_busy_engine_is_not_waited_for(session):
    keep(session[1])
    first = kept()
    assert kept() is None
    first.end()
    wait_for(lambda: (one := kept()) and one.end() == 0)


@pytest.mark.medium
def test_a_killed_engine_is_replaced(session):
    _gimp, where = session
    keep(where)
    for number in listening_in(where):
        os.kill(number, signal.SIGKILL)
    wait_for(lambda: not listening_in(where))
    assert ask()[0] is engine.Engine
    keep(where)
    assert ask()[0] is keeping.KeptEngine


@pytest.mark.medium
def test_another_engine_answers_when_the_kept_one_ends(session):
    own, other = socket.socketpair()
    with folder.RequestFolder() as made:
        made.engine = keeping.KeptEngine(own)
        other.close()
        with pytest.raises(engine.EngineError, match="layers"):
            engine.ask(made, {"operation": "restitch", "layers": []}, lambda share: None)


@pytest.mark.medium
def test_it_ends_with_its_owner(session):
    gimp, where = session
    keep(where)
    gimp.kill()
    gimp.wait()
    wait_for(lambda: not sockets(where))


def test_it_ends_when_nobody_asks(session, monkeypatch):
    monkeypatch.setattr(listening, "IDLE_S", 0.1)
    monkeypatch.setattr(listening, "_LOOK_EVERY_S", 0.05)
    listener = listening.bound(session[1] / "socket")
    assert listening.next_asker(listener, os.getpid()) is None
    listener.close()


def test_it_ends_when_installed_anew(session, monkeypatch):
    times = iter([[1, 1], [2, 1]])
    monkeypatch.setattr(listening, "_installed", lambda: next(times))
    with listening.bound(session[1] / "socket") as listener:
        assert listening.next_asker(listener, os.getpid()) is None


def test_sockets_of_earlier_sessions_are_removed(session, monkeypatch):
    _gimp, where = session
    ended = subprocess.Popen(["true"])
    ended.wait()
    old = where / f"toposeam-engine-{ended.pid}-0123456789ab"
    old.touch()
    monkeypatch.setattr(keeping, "leave_running", lambda command: None)
    engine.keep()
    assert not old.exists()


def test_no_engine_is_kept_where_others_can_enter(session):
    session[1].chmod(0o755)
    assert turns.session_folder() != session[1]
