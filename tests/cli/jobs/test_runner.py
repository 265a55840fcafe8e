"""Jobs on several processes: none is lost, none stops the others, and an interrupted run goes on where it
was.
"""

import dataclasses
import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from processes import living

from toposeam.errors import OptionError
from toposeam_cli.files.writing import OutputError
from toposeam_cli.jobs.runner import Job, Progress, run

JOBS = """
    import os, signal, time
    from pathlib import Path
    from toposeam.errors import ImageError
    from toposeam_cli.files.writing import atomic_write, replacing

    def write(output, text="", seconds=0.0, force=False):
        time.sleep(seconds)
        atomic_write(output, text, force)
        return {"text": text, "threads": os.environ["OPENBLAS_NUM_THREADS"]}

    def write_then_fail(output):
        atomic_write(output, "unwanted")
        raise ImageError("the picture is upside down; turn it")

    def write_then_die(output, tombstone, deaths):
        died = Path(tombstone).read_text() if Path(tombstone).exists() else ""
        Path(tombstone).write_text(died + "+")
        if len(died) < deaths:
            (Path(output).parent / ".toposeam-0123456789abcdef.part").write_text("unfinished")
            os.kill(os.getpid(), signal.SIGKILL)
        atomic_write(output, "finished")

    def write_then_die_before_telling(output, other, tombstone, text="finished"):
        if not Path(tombstone).exists():
            Path(tombstone).touch()
            Path(output).write_text(text)  # as if it had got its name
            os.kill(os.getpid(), signal.SIGKILL)
        atomic_write(output, "finished")
        atomic_write(other, "finished")

    def write_slowly(output, begun):
        with replacing(Path(output)) as temporary:
            temporary.write_text("half")
            Path(begun).touch()
            time.sleep(60)

    def nothing():
        pass

    def unspeakable():
        return object()
"""


@pytest.fixture
def functions(tmp_path, monkeypatch):
    """A module of job functions that workers can import."""
    folder = tmp_path / "modules"
    folder.mkdir()
    (folder / "job_functions.py").write_text(textwrap.dedent(JOBS))
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), *sys.path]))
    return folder


def writing(path, *, name=None, function="write", **arguments):
    return Job(
        name or path.name, f"job_functions:{function}", {"output": str(path), **arguments}, outputs=(path,)
    )


def statuses(outcomes):
    return {outcome.job.name: outcome.status for outcome in outcomes}


def rows(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_one_failure_stops_nothing_and_leaves_nothing(tmp_path, functions):
    jobs = [writing(tmp_path / f"{name}.txt", text=name) for name in "abc"]
    jobs[1] = writing(tmp_path / "b.txt", function="write_then_fail")
    jobs.append(Job("d", "job_functions:unspeakable", {}))
    outcomes = {
        outcome.job.name: outcome for outcome in run(jobs, processes=2, journal=tmp_path / "results.jsonl")
    }
    assert statuses(outcomes.values()) == {"a.txt": "done", "b.txt": "failed", "c.txt": "done", "d": "failed"}
    assert outcomes["a.txt"].result == {"text": "a", "threads": "1"}
    assert outcomes["b.txt"].message == "the picture is upside down; turn it"
    assert not (tmp_path / "b.txt").exists()
    assert [row["name"] for row in rows(tmp_path / "results.jsonl")] == ["a.txt", "b.txt", "c.txt", "d"]


def test_a_dead_worker_costs_only_its_job_a_second_try(tmp_path, functions):
    once = writing(tmp_path / "once.txt", function="write_then_die", tombstone=str(tmp_path / "1"), deaths=1)
    always = writing(
        tmp_path / "always.txt", function="write_then_die", tombstone=str(tmp_path / "2"), deaths=9
    )
    others = [writing(tmp_path / f"{index}.txt", seconds=0.05) for index in range(6)]
    outcomes = list(run([once, always, *others], processes=2))
    assert statuses(outcomes) == {"once.txt": "done", "always.txt": "failed"} | {
        job.name: "done" for job in others
    }
    assert (tmp_path / "once.txt").read_text() == "finished"
    assert not (tmp_path / "always.txt").exists()
    assert not list(tmp_path.glob(".toposeam*"))
    assert [len((tmp_path / tombstone).read_text()) for tombstone in "12"] == [2, 2]
    assert "memory" in next(outcome.message for outcome in outcomes if outcome.status == "failed")


def test_an_input_that_was_saved_again_makes_another_job(tmp_path):
    source = tmp_path / "source.png"
    source.write_text("pixels")
    job = Job("a", "job_functions:write", {}, (tmp_path / "a",), (source,))
    before = job.key
    assert job.key == before
    source.write_text("PIXELS")  # as long as before
    os.utime(source, ns=(0, source.stat().st_mtime_ns + 1_000_000))
    assert job.key != before


def test_what_is_done_is_not_done_again(tmp_path, functions):
    table, source = tmp_path / "results.jsonl", tmp_path / "source.png"
    source.write_text("pixels")
    jobs = [writing(tmp_path / f"{name}.txt", force=True) for name in "abcd"]
    jobs.append(
        Job(
            "e.txt",
            "job_functions:write",
            {"output": str(tmp_path / "e.txt"), "force": True},
            (tmp_path / "e.txt",),
            (source,),
        )
    )
    assert set(statuses(run(jobs, journal=table)).values()) == {"done"}
    table.write_bytes(table.read_bytes()[:-7])  # torn: the last row is lost
    assert statuses(run(jobs, journal=table)) == dict.fromkeys(
        ("a.txt", "b.txt", "c.txt", "d.txt"), "skipped"
    ) | {"e.txt": "done"}
    (tmp_path / "a.txt").unlink()
    jobs[1] = writing(tmp_path / "b.txt", force=True, text="other")
    source.write_text("other pixels")
    again = statuses(run(jobs, journal=table))
    assert again == {
        "a.txt": "done",
        "b.txt": "done",
        "c.txt": "skipped",
        "d.txt": "skipped",
        "e.txt": "done",
    }
    assert [row["name"] for row in rows(table)] == [job.name for job in jobs]
    assert set(statuses(run(jobs, journal=table, resume=False)).values()) == {"done"}


@pytest.mark.medium
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="nobody tells of processes as Linux does")
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_ends_too_early_goes_on(tmp_path, functions, end):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
            import sys
            from pathlib import Path
            from toposeam_cli.files.interruption import terminations_raised
            from toposeam_cli.jobs.runner import Job, run

            def jobs(folder):
                for index in range(12):
                    path = folder / f"{index}.txt"
                    words = {"output": str(path), "text": str(index), "seconds": 0.1}
                    yield Job(path.name, "job_functions:write", words, (path,))

            if __name__ == "__main__":
                folder = Path(sys.argv[1])
                with terminations_raised():
                    for outcome in run(list(jobs(folder)), processes=2, journal=folder / "results.jsonl"):
                        print(outcome.job.name, outcome.status, flush=True)
        """)
    )
    folder = tmp_path / "out"
    folder.mkdir()
    with subprocess.Popen(
        [sys.executable, str(script), str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        first = [child.stdout.readline().split() for _ in range(4)]
        children = [process.number for process in living() if process.parent == child.pid]
        assert children
        child.send_signal(end)
        child.wait(timeout=300)
    assert {status for _, status in first} == {"done"}
    deadline = time.monotonic() + 60
    while set(children) & {process.number for process in living()}:
        assert time.monotonic() < deadline, "a worker outlived its parent"
        time.sleep(0.02)
    # As if it had been killed between writing a file and writing the row: the file is there, the row is not.
    (folder / "results.jsonl").write_bytes(
        b"\n".join((folder / "results.jsonl").read_bytes().split(b"\n")[:-3]) + b'\n{"name": "7.t'
    )
    (folder / ".toposeam-0123456789abcdef.part").write_text("half")
    rest = subprocess.run(
        [sys.executable, str(script), str(folder)], capture_output=True, text=True, timeout=300, check=True
    )
    second = dict(line.split() for line in rest.stdout.splitlines())
    assert set(second.values()) == {"done", "skipped"}, rest
    assert list(second.values()).count("skipped") >= 3
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [f"{index}.txt" for index in range(12)] + ["results.jsonl"]
    )
    assert all((folder / f"{index}.txt").read_text() == str(index) for index in range(12))


@pytest.mark.parametrize("since", [0.0, 1e12])
def test_a_file_present_after_an_interruption_is_kept(tmp_path, functions, since):
    job, table = writing(tmp_path / "a.txt"), tmp_path / "results.jsonl"
    (tmp_path / "a.txt").write_text("precious")
    (tmp_path / "b.txt").write_text("precious, too")
    absent = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt")]
    row = {"name": job.name, "status": "started", "key": job.key, "absent": absent, "since": since}
    table.write_text(json.dumps(row) + "\n")
    assert statuses(run([job], journal=table)) == {"a.txt": "failed"}
    assert (tmp_path / "a.txt").read_text() == "precious"
    assert (tmp_path / "b.txt").read_text() == "precious, too"


@pytest.mark.parametrize(("text", "status"), [("finished", "done"), ("somebody's own", "failed")])
def test_a_worker_that_died_between_renames_is_resumed(tmp_path, functions, text, status):
    first, second = tmp_path / "a.txt", tmp_path / "b.txt"
    words = {"output": str(first), "other": str(second), "tombstone": str(tmp_path / "died"), "text": text}
    job = Job("job", "job_functions:write_then_die_before_telling", words, (first, second))
    assert statuses(run([job])) == {"job": status}
    assert first.read_text() == text
    assert second.exists() == (status == "done")


def test_the_table_knows_what_was_made_by_its_digest(tmp_path, functions):
    table = tmp_path / "results.jsonl"
    job = writing(tmp_path / "a.txt", text="first")
    list(run([job], journal=table))
    made = {str(tmp_path / "a.txt"): hashlib.sha256(b"first").hexdigest()}
    assert rows(table)[0]["made"] == made
    other = writing(tmp_path / "a.txt", text="second")
    assert statuses(run([other], journal=table)) == {"a.txt": "failed"}  # it exists, and nobody forces it
    assert rows(table)[0]["made"] == made
    remade = dataclasses.replace(other, remakes=True)
    assert statuses(run([remade], journal=table)) == {"a.txt": "done"}
    assert (tmp_path / "a.txt").read_text() == "second"
    (tmp_path / "a.txt").write_text("retouched")
    again = dataclasses.replace(writing(tmp_path / "a.txt", text="third"), remakes=True)
    assert statuses(run([again], journal=table)) == {"a.txt": "failed"}
    assert (tmp_path / "a.txt").read_text() == "retouched"


@pytest.mark.parametrize(
    "row",
    [
        {"name": "a.txt", "status": "done", "seconds": "long"},
        {"name": "a.txt", "status": "done", "seconds": float("nan")},
        {"name": "a.txt", "status": "done", "seconds": True},
        {"name": "a.txt", "status": "eaten"},
        {"name": "a.txt", "status": ["done"]},
        {"name": "a.txt", "status": "done", "key": 3},
        {"name": "a.txt", "status": "started", "made": ["/etc/passwd"]},
        {"name": "a.txt", "status": "started", "made": {"/etc/passwd": 7}},
    ],
    ids=str,
)
def test_a_row_with_values_of_wrong_types_is_refused_by_line(tmp_path, functions, row):
    table = tmp_path / "results.jsonl"
    table.write_text('{"name": "b", "status": "done"}\n' + json.dumps(row) + "\n")
    before = table.read_bytes()
    with pytest.raises(OptionError, match="line 2, is no row of results"):
        list(run([writing(tmp_path / "a.txt")], journal=table))
    assert table.read_bytes() == before


@pytest.mark.parametrize(
    "torn", ['{"name": "a.t', '{"name": "a.txt", "status": "done"}', "{", "\x00\x00\x00"]
)
def test_a_torn_last_line_is_dropped_and_earlier_rows_count(tmp_path, functions, torn):
    table, jobs = tmp_path / "results.jsonl", [writing(tmp_path / f"{name}.txt") for name in "ab"]
    list(run(jobs, journal=table))
    whole = table.read_bytes()
    table.write_bytes(whole + torn.encode())
    assert statuses(run(jobs, journal=table)) == {"a.txt": "skipped", "b.txt": "skipped"}
    assert table.read_bytes() == whole


def test_a_row_added_after_a_torn_line_begins_a_new_line(tmp_path, functions):
    table, jobs = tmp_path / "results.jsonl", [writing(tmp_path / f"{name}.txt") for name in "abc"]
    list(run(jobs[:2], journal=table))
    table.write_bytes(table.read_bytes() + b'{"name": "a.t')
    going = run(jobs, journal=table)
    assert [next(going).status for _ in jobs] == ["skipped", "skipped", "done"]
    rows = [json.loads(line) for line in table.read_text().splitlines()]  # before the end tidies it
    assert [row["name"] for row in rows if row["status"] == "done"] == ["a.txt", "b.txt", "c.txt"]


def test_two_runs_do_not_share_a_table(tmp_path, functions):
    first = run(
        [writing(tmp_path / f"{name}.txt", seconds=0.05) for name in "ab"], journal=tmp_path / "results.jsonl"
    )
    next(first)
    with pytest.raises(OptionError, match="another run"):
        next(run([writing(tmp_path / "c.txt")], journal=tmp_path / "results.jsonl"))
    assert [outcome.status for outcome in first] == ["done"]


def test_a_disk_that_is_full_for_the_table_is_one_sentence(tmp_path, functions):
    table = tmp_path / "results.jsonl"
    jobs = [Job(f"job {index}", "job_functions:nothing", {}) for index in range(9)]
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (700, hard))
        with pytest.raises(OutputError, match="free some space and run the same again"):
            list(run(jobs, journal=table))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    again = statuses(run(jobs, journal=table))
    assert set(again) == {job.name for job in jobs}
    assert "skipped" in again.values()


def test_progress_is_reported_from_beginning_to_end(tmp_path, functions):
    jobs = [writing(tmp_path / f"{index}.txt") for index in range(3)]
    reports = []
    list(run([*jobs, Job("d", "job_functions:unspeakable", {})], progress=reports.append))
    assert reports[0] == Progress(0, 4, 0, 0.0, None)
    assert reports[-1] == Progress(4, 4, 1, 1.0, 0.0)
    assert [report.share for report in reports] == sorted(report.share for report in reports)


def test_ended_workers_remove_their_unfinished_files(functions, tmp_path):
    output, begun = tmp_path / "one.txt", tmp_path / "begun"

    def end(progress):
        if begun.exists():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(run([writing(output, function="write_slowly", begun=str(begun))], progress=end))
    assert not list(tmp_path.glob(".toposeam-*"))
    assert not output.exists()


@pytest.mark.slow
def test_a_worker_without_a_parent_at_its_start_ends_silently():
    code = """
        from concurrent.futures.process import BrokenProcessPool
        from multiprocessing import get_context
        from concurrent.futures import ProcessPoolExecutor
        from toposeam_cli.jobs.workers import _prepare

        if __name__ == "__main__":
            context = get_context("spawn")
            for _ in range(10):
                ending, alive = context.Pipe(duplex=False)
                alive.close()
                # Waited for: Python 3.11 may complain at its end of a broken one that is being closed.
                with ProcessPoolExecutor(1, context, _prepare, (ending,)) as pool:
                    try:
                        pool.submit(print).result()
                    except BrokenProcessPool:
                        continue
    """
    ran = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")


def test_a_hangup_spares_the_resource_tracker(functions, tmp_path):
    code = """
        import os, signal, sys
        from multiprocessing import resource_tracker
        from toposeam_cli.jobs.workers import worker_processes

        with worker_processes(1):
            os.kill(resource_tracker._resource_tracker._pid, signal.SIGHUP)
    """
    ran = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")
