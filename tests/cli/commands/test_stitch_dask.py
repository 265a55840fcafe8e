"""``stitch --dask``: pictures, overlaps and windows as tasks of a Dask cluster; the same file as here."""

import gc
import logging
import os
import signal
import threading
import time
from contextlib import suppress

import pytest

import toposeam as ts
from stitching import make_six, names
from toposeam_cli.jobs import dask_workers
from toposeam_cli.jobs.dask_workers import WorkerCheck

WORDS = ("stitch", "six.toml", "--match-tones", "--blend", "multiband", "-q")


@pytest.fixture
def six(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_six(tmp_path, 300, 220)
    return tmp_path


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of distributed about its own sockets, when a worker is killed
def test_workers_make_the_same_file_also_when_they_are_killed(six, toposeam, caplog, dask_cluster):
    caplog.set_level(logging.INFO, "toposeam_cli.jobs.crew")
    assert toposeam(*WORDS, "-o", "here.tif", "-j", 1).code == 0
    with dask_cluster(2) as cluster:
        ran = toposeam(*WORDS, "-o", "there.tif", "--dask", cluster.scheduler_address)
        assert ran.code == 0, ran
        before = {worker.pid for worker in cluster.workers.values()}
        killing = threading.Thread(target=kill_when_something_waits, args=(six, before.copy().pop()))
        killing.start()
        ran = toposeam(*WORDS, "-o", "killed.tif", "--dask", cluster.scheduler_address)
        killing.join()
        assert ran.code == 0, ran
    made = {(six / name).read_bytes() for name in ("here.tif", "there.tif", "killed.tif")}
    assert len(made) == 1
    (parts, sent, received), _ = (
        record.args for record in caplog.records if record.name == "toposeam_cli.jobs.crew"
    )
    assert parts >= 6 + 7 + 6 + 1, "pictures, tones of pairs, headrooms and windows"
    assert min(sent, received) > 0
    assert not [name for name in names(six) if name.endswith(".part")]
    gc.collect()  # sockets of the worker that was killed, of which other tests would be told


def kill_when_something_waits(folder, pid):
    """Kill a worker when the command has begun to keep pixels, which is after its first look at them."""
    deadline = time.monotonic() + 60
    begun = False
    while not begun and time.monotonic() < deadline:
        with suppress(FileNotFoundError):
            begun = any(p.is_file() and p.stat().st_size > 1000 for p in folder.glob(".toposeam-*"))
        time.sleep(0.01)
    os.kill(pid, signal.SIGKILL)


@pytest.mark.slow
def test_a_cluster_made_on_the_spot_makes_the_same_file(six, started):
    pytest.importorskip("distributed")
    assert started(*WORDS, "-o", "here.tif").code == 0
    ran = started(*WORDS, "-o", "there.tif", "--dask", "local", "-j", 2)
    assert (ran.code, ran.out, ran.err) == (0, "", "")
    assert (six / "here.tif").read_bytes() == (six / "there.tif").read_bytes()


@pytest.mark.slow
def test_what_workers_cannot_read_is_named_and_can_be_left_out(six, started):
    pytest.importorskip("distributed")
    assert started(*WORDS, "-o", "here.tif").code == 0
    (six / "broken.tif").write_bytes((six / "0.tif").read_bytes()[:3000])
    with (six / "six.toml").open("a") as layout:
        layout.write('\n[[layer]]\nfile = "broken.tif"\nat = [0, 0]\n')
    before = names(six)
    words = *WORDS, "-o", "there.tif", "--dask", "local", "-j", 2
    started(*words).fails("broken.tif")
    assert names(six) == before
    ran = started(*words, "--skip-bad")
    assert (ran.code, ran.out) == (0, "")
    assert ran.err.startswith("left out: ")
    assert "broken.tif'" in ran.err
    assert (six / "here.tif").read_bytes() == (six / "there.tif").read_bytes()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", ""])
def test_an_address_where_nobody_answers_is_one_sentence(six, toposeam, address, monkeypatch):
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    monkeypatch.setattr(dask_workers, "_ANSWER_S", 0.5)  # nobody does in any time
    before, running = names(six), set(threading.enumerate())
    toposeam(*WORDS, "-o", "out.tif", "--dask", address).fails("Dask scheduler")
    assert names(six) == before
    assert dask.config.get("scheduler", None) is None  # arrays in this process are computed as before
    assert set(threading.enumerate()) <= running, "whose clients would be closed in other tests' time"


@pytest.mark.parametrize("words", [["-o", "out.ora"], ["-o", "out.tif", "--blend", "gradient"]])
def test_results_that_need_everything_at_once_are_refused(six, toposeam, words):
    toposeam(*WORDS, *words, "--dask", "local").fails("window by window")


def test_workers_look_whether_they_see_the_same_files(tmp_path):
    (tmp_path / "a.png").write_bytes(b"picture")
    look = WorkerCheck.at(tmp_path / "probe", [tmp_path / "a.png"])
    assert look() == ""
    (tmp_path / "a.png").write_bytes(b"another")
    assert look() == "", "as long as it was: nobody reads all of it"
    (tmp_path / "a.png").write_bytes(b"longer than it was")
    assert f"does not see '{tmp_path / 'a.png'}'" in look()
    look = WorkerCheck.at(tmp_path / "probe", [tmp_path / "a.png"])
    (tmp_path / "probe").write_text("0" * 32)
    assert f"does not see '{tmp_path / 'probe'}'" in look(), "a file of the same name on another disk"


def test_workers_with_other_versions_are_refused(tmp_path, monkeypatch):
    look = WorkerCheck.at(tmp_path / "probe", [])
    monkeypatch.setattr(dask_workers, "versions", lambda: {**look.versions, "numpy": "1.0"})
    assert look().startswith("has numpy 1.0, and ")


class Client:
    """A client of workers that answer what it was made with."""

    def __init__(self, answers):
        self._answers = answers

    def get_executor(self, pure):
        return None

    def run(self, look, on_error):
        if isinstance(self._answers, Exception):
            raise self._answers
        return self._answers


@pytest.mark.parametrize(
    ("answers", "says"),
    [
        ({"tls://one:1": "", "tls://two:2": "does not see 'a'; move it"}, "worker at tls://two:2 does not"),
        ({"tls://one:1": OSError("Stream is closed")}, "worker at tls://one:1 cannot run TopoSeam"),
        ({"tls://one:1": ModuleNotFoundError("No module named 'toposeam_cli'")}, "cannot run TopoSeam"),
        (TypeError("cannot be sent"), "cannot run TopoSeam"),
    ],
)
def test_what_is_wrong_with_a_worker_is_told(tmp_path, answers, says, monkeypatch):
    monkeypatch.setattr(dask_workers, "_AGAIN_S", 0)
    workers = dask_workers.DaskWorkers(Client(answers), 2)
    with pytest.raises(ts.OptionError, match=says):
        workers.check(WorkerCheck.at(tmp_path / "probe", []))


def test_a_worker_killed_during_its_check_is_not_asked_again(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_workers, "_AGAIN_S", 0)
    client = Client({"tls://one:1": OSError("Stream is closed"), "tls://two:2": ""})
    asked = []

    def run(look, on_error):
        asked.append(look)
        return dict(list(client._answers.items())[len(asked) - 1 :])

    monkeypatch.setattr(client, "run", run)
    dask_workers.DaskWorkers(client, 2).check(WorkerCheck.at(tmp_path / "probe", []))
    assert len(asked) == 2
