"""Jobs on a Dask cluster of worker processes: the same files, and a worker that is killed costs nothing but time."""

import os
import signal
import threading
import time

import pytest

from toposeam_cli.runner import Job, run

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
        "from toposeam_cli.output import atomic_write\n"
        "def write(output, seconds):\n"
        "    time.sleep(seconds)\n"
        "    atomic_write(output, output)\n"
        "    return os.getpid()\n"
    )
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]))


def test_one_of_the_workers_is_killed(tmp_path, functions):
    out = tmp_path / "out"
    out.mkdir()
    jobs = [
        Job(f"{index}", "dask_functions:write", {"output": str(out / f"{index}.txt"), "seconds": 0.3}, (out / f"{index}.txt",))
        for index in range(COUNT)
    ]
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        outcomes = []
        for outcome in run(jobs, dask=cluster.scheduler_address, journal=tmp_path / "results.jsonl"):
            outcomes.append(outcome)
            if len(outcomes) == 3:
                victim = outcome.result
                threading.Timer(0.1, os.kill, (victim, signal.SIGKILL)).start()  # in the middle of its next job
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
    assert ran.err.startswith("dask/3.png: cannot read"), ran
    assert len(ran.err.splitlines()) == 1, ran
    assert started(*words, "-o", "here/{name}.png").code == 1
    assert {path.name: path.read_bytes() for path in (folder / "dask").iterdir()} == {
        path.name: path.read_bytes() for path in (folder / "here").iterdir()
    }


def test_ctrl_c_ends_a_local_cluster(process, folder):
    for index in range(40):
        for side in "ab":
            (folder / f"{side}{index}.png").write_bytes((folder / f"{side}.png").read_bytes())
    with process("batch", "a*.png", "b*.png", "--overlap", "20", "-o", "out/{name}.png", "--dask", "local", "-j", 2) as child:
        deadline = time.monotonic() + 60
        while not list(folder.glob("out/*.png")):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        child.send_signal(signal.SIGINT)
        assert child.wait(60) == 130
    assert not list(folder.glob("out/*.part"))
