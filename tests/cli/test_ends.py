"""However the command ends, it ends without a traceback and without leftovers: full disks behind stdout,
Ctrl-C again and again, closed terminals, batches killed at any moment.
"""

import json
import multiprocessing
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from processes import descendants, living

from toposeam_cli.__main__ import _flushed
from toposeam_cli.media.pictures.picture import Picture, write_picture

sys.path.append(str(Path(__file__).parents[1] / "fuzz"))
from strangers import views

pytestmark = pytest.mark.usefixtures("hangups_arrive")
QUIET = ("Traceback", "resource_tracker", "Exception ignored", "something went wrong", "leaked")


def shell(line, folder):
    script = f'toposeam() {{ "{sys.executable}" -m toposeam_cli "$@"; }}; {line}'
    return subprocess.run(
        ["bash", "-c", script], cwd=folder, capture_output=True, text=True, timeout=600, check=False
    )


def assert_quiet(text):
    for never in QUIET:
        assert never not in text, text


@pytest.mark.medium
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "line", ["--help", "--version", "stitch --help", "completion bash", "compare a.png b.png --overlap 20"]
)
def test_a_full_disk_behind_stdout_is_one_sentence(folder, photographs, line):
    ran = shell(f"toposeam {line} >/dev/full", folder)
    assert ran.returncode == 1
    assert_quiet(ran.stderr)
    assert ran.stderr.startswith("Error: ")
    assert ran.stderr.count("\n") == 1


@pytest.mark.medium
@pytest.mark.parametrize("line", ["--help", "bogus", "stitch a.png b.png --overlap 20 -o x.png"])
def test_a_full_disk_behind_both_streams_ends_without_a_word(folder, photographs, line):
    ran = shell(f"toposeam {line} >/dev/full 2>/dev/full; echo $?", folder)
    assert ran.stdout.strip() in ("1", "2")
    assert ran.stderr == ""


@pytest.fixture
def many(tmp_path):
    """A batch of pairs that take a few hundredths of a second each."""
    rng = np.random.default_rng(1)
    for index in range(24):
        for side in "ab":
            pixels = rng.integers(0, 256, (60, 80, 3)).astype(np.uint8)
            write_picture(tmp_path / f"{side}{index:02}.png", Picture(pixels=pixels))
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("delay", np.linspace(0.05, 2.5, 12).round(2))
@pytest.mark.parametrize("what", ["one", "batch"])
def test_ctrl_c_again_and_again_is_one_ctrl_c(many, delay, what):
    words = {
        "one": ["motif", "-o", "m.png", "--size", "512", "--seed", "1"],
        "batch": ["batch", "a*.png", "b*.png", "--overlap", "40", "-o", "out/{name}.png", "-j", "2"],
    }[what]
    # What comes before the first line of ours, which sets the signal aside, is Python's to answer.
    begin = """if True:
        import signal
        from toposeam_cli import __main__
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        print("begun", flush=True)
        __main__.start()
    """
    child = subprocess.Popen(
        [sys.executable, "-c", begin, *words],
        cwd=many,
        stderr=subprocess.PIPE,
        text=True,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert child.stdout.readline() == "begun\n"
    time.sleep(delay)
    for _ in range(6):
        try:
            os.killpg(child.pid, signal.SIGINT)
        except ProcessLookupError:
            break
        time.sleep(0.03)
    _, told = child.communicate(timeout=300)
    assert child.returncode in (130, -signal.SIGINT, 0)
    assert_quiet(told)
    assert not list(many.rglob(".toposeam-*"))


def test_one_more_ctrl_c_after_all_is_tidied_away_says_nothing(monkeypatch):
    """As it comes in the very moment before signals are ignored."""
    from toposeam_cli import __main__
    from toposeam_cli.app import main

    def stop(prog_name):
        raise KeyboardInterrupt

    ignored = []

    def ignore(number, handler):
        ignored.append(number)
        if len(ignored) == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(main, "main", stop)
    monkeypatch.setattr(__main__.signal, "getsignal", lambda _: signal.SIG_IGN)
    monkeypatch.setattr(__main__.signal, "signal", ignore)
    with pytest.raises(SystemExit) as end:
        __main__.start()
    assert end.value.code == 130
    assert ignored[1:] == [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


def test_ctrl_c_in_text_that_is_run_ends_with_130(tmp_path):
    """As in a dataclass of an import; Python 3.11 would kill itself by SIGINT at its end."""
    (tmp_path / "case.py").write_text(
        "from toposeam_cli import __main__ as entry\n"
        "import toposeam_cli.app.main as app\n"
        "def main(**options):\n"
        "    exec('raise KeyboardInterrupt')\n"
        "app.main = main\n"
        "entry.start()\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    ran = subprocess.run([sys.executable, "-m", "case"], env=environment, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (130, "")


# Killed at any moment.

#: The full measure is TOPOSEAM_KILLS=100: about ten minutes each.
KILLS = int(os.environ.get("TOPOSEAM_KILLS", "12"))
#: Other moments: TOPOSEAM_KILLS_SEED.
SEED = int(os.environ.get("TOPOSEAM_KILLS_SEED", "7"))
WAYS = [
    (number, whom)
    for whom in ("process", "group", "worker")
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
]


def strike(child, number, whom, rng):
    """Kill somebody; whether there was anybody to kill."""
    if child.poll() is not None:
        return False
    try:
        if whom == "process":
            os.kill(child.pid, number)
        elif whom == "group":
            os.killpg(child.pid, number)
        else:
            # By what they run: what has been forked and not yet begun may be the resource tracker.
            workers = [one.number for one in descendants(child.pid) if b"spawn_main" in one.command]
            os.kill(rng.choice(workers), number)
    except (ProcessLookupError, IndexError):
        return False
    return True


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="nobody tells of processes as Linux does")
@pytest.mark.parametrize("where", [["-j", "2"], ["-j", "2", "--dask", "local"]], ids=["workers", "dask"])
def test_a_batch_that_is_killed_again_and_again_loses_nothing(many, where):
    if "--dask" in where:
        pytest.importorskip("distributed")
    rng = random.Random(SEED)  # noqa: S311 - no secret
    words = [sys.executable, "-m", "toposeam_cli", "batch", "a*.png", "b*.png", "--overlap", "40", "-q"]
    whole = [*words, "-o", "whole/{name}.png", "--labels", "whole/{name}.tif", "--results", "whole.jsonl"]
    subprocess.run(whole, cwd=many, check=True)
    expected = {path.name: path.read_bytes() for path in (many / "whole").iterdir()}
    kills = turns = 0
    placed, way = False, WAYS[0]
    while kills < KILLS:
        turns += 1
        out, table = many / f"out{turns}", many / f"results{turns}.jsonl"
        outputs = ["-o", f"{out.name}/{{name}}.png", "--labels", f"{out.name}/{{name}}.tif"]
        line = [*words, *outputs, *where, "--results", table.name]
        theirs = out / "23.png"  # where somebody else puts a file meanwhile
        done: dict[str, tuple[int, int]] = {}
        code = None
        while code != 0:
            child = subprocess.Popen(
                line, cwd=many, stderr=subprocess.PIPE, text=True, start_new_session=True
            )
            if kills < KILLS:
                time.sleep(rng.uniform(0.3, 5.0 if "--dask" in where else 2.5))
                way = WAYS[kills % len(WAYS)]
                while child.poll() is None:  # workers may not be there yet
                    if strike(child, *way, rng):
                        kills += 1
                        break
                    time.sleep(rng.uniform(0.0, 0.2))
            _, told = child.communicate(timeout=600)
            code = child.returncode
            if way != (signal.SIGKILL, "process"):
                assert_quiet(told)  # else a worker it was starting may say that nobody told it what to do
            wait_for_the_group(child)
            states = {path.name: (path.stat().st_mtime_ns, path.stat().st_ino) for path in out.glob("[!.]*")}
            assert states.items() >= done.items(), "what was done is done again"
            done = {
                Path(path).name: states[Path(path).name]
                for row in rows(table)
                if row["status"] == "done"
                for path in row["outputs"]
            }
            if not placed and out.is_dir() and not theirs.exists():
                placed = True
                theirs.write_bytes(b"precious")
            elif code == 1 and "cluster does not start" in told:
                pass  # it was struck while it started
            elif code == 1 and theirs.exists() and theirs.read_bytes() != expected[theirs.name]:
                assert theirs.read_bytes() == b"precious"
                assert "23.png' exists already; pass --force" in told
                theirs.unlink()
        assert {path.name: path.read_bytes() for path in out.iterdir()} == expected


def rows(table):
    """What a table of results says, but for a torn last line."""
    if not table.exists():
        return []
    return [json.loads(line) for line in table.read_bytes().rpartition(b"\n")[0].splitlines()]


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="nobody tells of processes as Linux does")
def test_photographs_that_are_killed_are_joined_whole_or_not(tmp_path):
    rng = random.Random(SEED)  # noqa: S311 - no secret
    files = [f"{number}.png" for number in range(3)]
    for name, pixels in zip(files, views(np.random.default_rng(3)), strict=False):
        write_picture(tmp_path / name, Picture(pixels=np.ascontiguousarray(pixels)))
    made = ("-o", "out.png", "--save-layout", "out.toml", "--seam", "out.svg", "--report", "out.html")
    line = [sys.executable, "-m", "toposeam_cli", "stitch", *files, *made, "-q"]
    subprocess.run(line, cwd=tmp_path, check=True)
    expected = {path.name: path.read_bytes() for path in tmp_path.glob("out.*")}
    begun = time.monotonic()
    subprocess.run([*line, "--force"], cwd=tmp_path, check=True)
    longest, struck = time.monotonic() - begun, 0
    for number in range(max(KILLS, 1)):
        for path in tmp_path.glob("out.*"):
            path.unlink()
        child = subprocess.Popen(
            line, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        time.sleep(rng.uniform(0.05, 1.1) * longest)
        struck += strike(child, *[way for way in WAYS if way[1] != "worker"][number % 8], rng)
        _, told = child.communicate(timeout=600)
        assert_quiet(told)
        wait_for_the_group(child)
        left = {path.name: path.read_bytes() for path in tmp_path.glob("out.*")}
        assert left.items() <= expected.items(), "something is half written"
    assert struck > KILLS / 4
    subprocess.run([*line, "--force"], cwd=tmp_path, check=True)
    assert {path.name: path.read_bytes() for path in tmp_path.glob("out.*")} == expected
    assert not list(tmp_path.glob(".toposeam-*"))


def wait_for_the_group(child):
    """Wait until the processes below a dead one are gone too."""
    deadline = time.monotonic() + 120
    while any(process.group == child.pid for process in living()):
        assert time.monotonic() < deadline, "something outlived the batch"
        time.sleep(0.05)


class _Full:
    """A stream whose reader has no room."""

    def __init__(self, reason, number):
        self.reason, self.number = reason, number

    def flush(self):
        raise self.reason

    def fileno(self):
        return self.number


@pytest.mark.parametrize("name", ["stdout", "stderr"])
@pytest.mark.parametrize("reason", [BrokenPipeError(), OSError(28, "No space left on device")])
def test_what_was_printed_is_known_to_have_arrived(monkeypatch, capsys, name, reason, tmp_path):
    assert _flushed(quiet=False)
    with (tmp_path / "out").open("wb") as file:
        monkeypatch.setattr(sys, name, _Full(reason, file.fileno()))
        assert not _flushed(quiet=False)
        assert os.fstat(file.fileno()).st_rdev == Path(os.devnull).stat().st_rdev  # the rest goes nowhere
        monkeypatch.undo()
    said = capsys.readouterr().err
    assert said.count("\n") == (name == "stdout" and not isinstance(reason, BrokenPipeError))
    assert ("no space left" in said) == (said != "")


def test_a_ctrl_c_that_comes_while_click_ends_is_one(monkeypatch, capsys):
    """Click takes it for an abortion, with exit code 1."""
    from toposeam_cli import __main__
    from toposeam_cli.app import main

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(main.click, "echo", stop)  # of the line on the first Ctrl-C comes the second one
    monkeypatch.setattr(main.click.Group, "invoke", stop)
    monkeypatch.setattr(sys, "argv", ["toposeam", "manual"])
    monkeypatch.setattr(__main__.signal, "getsignal", lambda _: signal.SIG_IGN)
    monkeypatch.setattr(__main__.signal, "signal", lambda *_: None)
    with pytest.raises(SystemExit) as end:
        __main__.start()
    assert end.value.code == 130


def test_semaphores_of_processes_that_are_gone_are_removed(tmp_path, monkeypatch):
    from toposeam_cli.files import semaphores

    space = re.sub(r"\D", "", str(Path("/proc/self/ns/pid").readlink()))
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    kept = {f"sem.toposeam-{space}-{os.getpid()}-a", f"sem.toposeam-1-{dead.pid}-a", "sem.mp-abc", "other"}
    for name in {*kept, f"sem.toposeam-{space}-{dead.pid}-b"}:
        (tmp_path / name).touch()
    monkeypatch.setattr(semaphores, "_FOLDER", tmp_path)
    configuration = {"semprefix": "/mp"}
    monkeypatch.setattr(multiprocessing.current_process(), "_config", configuration)
    semaphores.name_semaphores()
    assert {path.name for path in tmp_path.iterdir()} == kept
    assert configuration["semprefix"] == f"/toposeam-{space}-{os.getpid()}"


@pytest.mark.slow
def test_semaphores_of_a_killed_group_are_removed_by_the_next(many, process):
    def ours(pid):
        return [path for path in Path("/dev/shm").iterdir() if f"-{pid}-" in path.name]

    words = ("batch", "a*.png", "b*.png", "--overlap", "40", "-o", "out/{name}.png", "-j", "2")
    with process(*words, cwd=many, start_new_session=True) as child:
        deadline = time.monotonic() + 60
        while not ours(child.pid):
            assert time.monotonic() < deadline
            assert child.poll() is None
            time.sleep(0.01)
        os.killpg(child.pid, signal.SIGKILL)
    assert ours(child.pid)
    with process(*words, "--force", cwd=many, stdout=subprocess.DEVNULL) as after:
        assert after.wait(120) == 0
    assert not ours(child.pid)
    assert not ours(after.pid)
