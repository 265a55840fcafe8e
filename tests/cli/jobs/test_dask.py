"""Jobs on a Dask cluster of worker processes: the same files, and a worker that is killed costs nothing but
time.
"""

import http.client
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from toposeam_cli.jobs.dask_workers import dask_workers
from toposeam_cli.jobs.runner import Job, run
from toposeam_cli.jobs.workers import Task

distributed = pytest.importorskip("distributed")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # of distributed about its own sockets, when a worker is killed
]

COUNT = 16


@pytest.fixture
def functions(tmp_path, monkeypatch):
    """A module of job functions that workers can import."""
    folder = tmp_path / "modules"
    folder.mkdir()
    (folder / "dask_functions.py").write_text(
        "import os, time\n"
        "from toposeam_cli.files.writing import atomic_write\n"
        "def write(output, seconds):\n"
        "    time.sleep(seconds)\n"
        "    atomic_write(output, output)\n"
        "    return os.getpid()\n"
    )
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]))


def test_one_of_the_workers_is_killed(tmp_path, functions, dask_cluster):
    out = tmp_path / "out"
    out.mkdir()
    jobs = [
        Job(
            f"{index}",
            "dask_functions:write",
            {"output": str(out / f"{index}.txt"), "seconds": 0.3},
            (out / f"{index}.txt",),
        )
        for index in range(COUNT)
    ]
    with dask_cluster(2) as cluster:
        outcomes = []
        for outcome in run(jobs, dask=cluster.scheduler_address, journal=tmp_path / "results.jsonl"):
            outcomes.append(outcome)
            if len(outcomes) == 3:
                victim = outcome.result
                threading.Timer(
                    0.1, os.kill, (victim, signal.SIGKILL)
                ).start()  # in the middle of its next job
    assert {outcome.status for outcome in outcomes} == {"done"}, [outcome.message for outcome in outcomes]
    assert sorted(outcome.job.name for outcome in outcomes) == sorted(job.name for job in jobs)
    assert sorted(path.name for path in out.iterdir()) == sorted(f"{index}.txt" for index in range(COUNT))
    pids = [outcome.result for outcome in outcomes]
    assert victim in pids
    assert len(set(pids)) > 1
    again = list(run(jobs, journal=tmp_path / "results.jsonl"))
    assert {outcome.status for outcome in again} == {"skipped"}


def test_the_command_makes_the_same_files_on_dask(started, folder, photographs):
    for name in ("1", "2"):
        for side in "ab":
            (folder / f"{side}{name}.png").write_bytes((folder / f"{side}.png").read_bytes())
    (folder / "a3.png").write_bytes(b"no picture")
    words = ("batch", "a?.png", "b?.png", "--overlap", "20")
    ran = started(*words, "-o", "dask/{name}.png", "--dask", "local", "-j", 2)
    assert (ran.code, ran.out[:16]) == (1, "2 done, 1 failed"), ran
    assert ran.err.startswith("dask/3.png: there is no file"), ran
    assert len(ran.err.splitlines()) == 1, ran
    assert started(*words, "-o", "here/{name}.png").code == 1
    assert {path.name: path.read_bytes() for path in (folder / "dask").iterdir()} == {
        path.name: path.read_bytes() for path in (folder / "here").iterdir()
    }


def test_ctrl_c_ends_a_local_cluster(process, folder):
    for index in range(40):
        for side in "ab":
            (folder / f"{side}{index}.png").write_bytes((folder / f"{side}.png").read_bytes())
    with process(
        "batch", "a*.png", "b*.png", "--overlap", "20", "-o", "out/{name}.png", "--dask", "local", "-j", 2
    ) as child:
        deadline = time.monotonic() + 60
        while not list(folder.glob("out/*.png")):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        child.send_signal(signal.SIGINT)
        assert child.wait(60) == 130
    assert not list(folder.glob("out/*.part"))


SCRIPT = """
    import sys
    from distributed import Client, get_client
    from distributed.security import Security

    how, address = sys.argv[1:]
    security = Security.temporary() if how == "certificate" else None
    address = address.replace("tls://", "tcp://") if how == "plain" else address
    with Client(address, timeout=5, security=security) as client:
        print("in", client.submit(int, "7").result(timeout=5))
"""


@pytest.mark.parametrize("how", ["plain", "no certificate", "certificate"])
def test_nobody_else_can_submit_to_a_local_cluster(tmp_path, how):
    with dask_workers("local", 1) as workers:
        assert workers.is_free
        scheduler = workers._client.scheduler.address
        assert scheduler.startswith("tls://127.0.0.1:")
        outsider = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(SCRIPT), how, scheduler],
            capture_output=True,
            text=True,
            timeout=300,
            cwd=tmp_path,
        )
        assert outsider.returncode != 0
        assert "in 7" not in outsider.stdout
        workers.begin("seven", Task("json:loads", {"s": "7"}))
        assert [answer.result for _, answer in workers.ended(30.0)] == ["7"], "it serves its owner"


def test_a_local_cluster_shows_nothing_to_whoever_looks():
    before = set(listening())
    with dask_workers("local", 1):
        opened = sorted(set(listening()) - before)
        assert opened
        for host, port in opened:
            assert host == "127.0.0.1"
            for page in (
                "/",
                "/status",
                "/health",
                "/metrics",
                "/info/main/workers.html",
                "/json/counts.json",
            ):
                with suppress(OSError, http.client.HTTPException):
                    connection = http.client.HTTPConnection(host, port, timeout=5)
                    connection.request("GET", page)
                    assert connection.getresponse().status == 404
        assert 8787 not in {port for _, port in opened}  # where Dask's own pages would be


def test_the_workers_of_a_local_cluster_do_not_watch_themselves():
    def periods(dask_worker):
        return {name: callback.callback_time for name, callback in dask_worker.periodic_callbacks.items()}

    with dask_workers("local", 1) as workers:
        (found,) = workers._client.run(periods).values()
    assert "profile" not in found
    assert found["tick"] == 1000


def listening():
    """Where this process and its children wait for others to connect."""
    import psutil

    me = psutil.Process()
    for process in (me, *me.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):  # it has just ended
            for connection in process.net_connections():
                if connection.status == psutil.CONN_LISTEN:
                    yield connection.laddr.ip, connection.laddr.port


def test_what_dask_tells_of_connections_that_end_is_not_told_on(tmp_path):
    (tmp_path / "ends.py").write_text(
        "import logging\n"
        "from toposeam_cli.jobs.dask_workers import dask_workers\n"
        "if __name__ == '__main__':\n"
        "    with dask_workers('local', 1):\n"
        "        pass\n"
        "    logging.getLogger('distributed.batched').info('closed')\n"
    )
    ran = subprocess.run(
        [sys.executable, "ends.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=True
    )
    assert "closed" not in ran.stderr


def test_an_address_without_tls_is_warned_of_once(tmp_path, functions, caplog, dask_cluster):
    jobs = [
        Job(name, "dask_functions:write", {"output": str(tmp_path / name), "seconds": 0}, (tmp_path / name,))
        for name in "ab"
    ]
    with dask_cluster(1) as cluster:
        assert {outcome.status for outcome in run(jobs, dask=cluster.scheduler_address)} == {"done"}
    assert [record.name for record in caplog.records if "does not use TLS" in record.message] == [
        "toposeam_cli.jobs.dask_workers"
    ]


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "tls://127.0.0.1:1", "nowhere://x", "", "a b"])
def test_an_address_where_nobody_answers_is_one_sentence(toposeam, folder, photographs, address):
    toposeam("batch", "a.png", "?.png", "--overlap", "20", "-o", "out_{name}.png", "--dask", address).fails(
        "Dask scheduler"
    )


def test_a_cluster_interrupted_at_its_start_is_closed_silently(monkeypatch):
    """The signal may end its processes as well, so that closing it fails; Dask would try once more at the
    exit, and tell.
    """
    closed = []

    class Interrupted:
        shutdown_on_close = True

        def __init__(self, **settings):
            closed.append(self)
            os.kill(os.getpid(), signal.SIGINT)

        def close(self, timeout):
            assert not self.shutdown_on_close
            closed.append("closed")
            raise OSError("the scheduler is gone")

    monkeypatch.setattr(distributed, "LocalCluster", Interrupted)
    with pytest.raises(KeyboardInterrupt), dask_workers("local", 1):
        pytest.fail("there is no cluster")
    assert closed[1:] == ["closed"]


def test_a_hangup_spares_what_a_local_cluster_shares(tmp_path):
    """Every process would complain that the resource tracker died."""
    (tmp_path / "hangup.py").write_text(
        "import os, signal\n"
        "from multiprocessing import resource_tracker\n"
        "from toposeam_cli.jobs.dask_workers import dask_workers\n"
        "if __name__ == '__main__':\n"
        "    with dask_workers('local', 1):\n"
        "        os.kill(resource_tracker._resource_tracker._pid, signal.SIGHUP)\n"
    )
    ran = subprocess.run([sys.executable, "hangup.py"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0
    assert "resource_tracker" not in ran.stderr


def test_a_local_cluster_keeps_what_it_spills_to_itself(tmp_path, monkeypatch):
    """In a folder that nobody else can open or have made before, gone at the end."""
    trap = tmp_path / "dask-scratch-space"
    trap.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))

    def place(dask_worker):
        return dask_worker.local_directory, sys.path

    with dask_workers("local", 2) as workers:
        places = workers._client.run(place)
        (own,) = set(tmp_path.iterdir()) - {trap}
        assert own.stat().st_mode & 0o777 == 0o700
        for spilled, imported in places.values():
            assert Path(spilled).is_relative_to(own)
            assert str(trap) not in " ".join(imported)
        assert not list(trap.iterdir())
    assert list(tmp_path.iterdir()) == [trap]


def test_what_a_killed_cluster_leaves_is_removed(process, folder, monkeypatch):
    shared = folder / "tmp"
    shared.mkdir()
    monkeypatch.setenv("TMPDIR", str(shared))
    words = ("batch", "a*.png", "b*.png", "--overlap", "20", "-o", "{name}_o.png", "--dask", "local")
    with process(*words, start_new_session=True) as child:
        deadline = time.monotonic() + 60
        while not list(shared.rglob("worker-*")):
            assert time.monotonic() < deadline
            assert child.poll() is None
            time.sleep(0.01)
        os.killpg(child.pid, signal.SIGKILL)
    assert list(shared.iterdir())
    with process(*words, "--force") as child:
        assert child.wait(120) == 0
    assert not list(shared.iterdir())
