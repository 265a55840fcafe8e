"""``stitch -j``: the same files whoever does the work, and nothing left when it ends early."""

import os
import platform
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from processes import descendants, living

from stitching import make_six, names
from toposeam.layers.search import options as search_options
from toposeam_cli.files.scratch import scratch
from toposeam_cli.files.writing import OutputError
from toposeam_cli.jobs import crew as crews
from toposeam_cli.jobs import workers
from toposeam_cli.jobs.crew import WorkersDiedError, crew, processes_of
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.stitching import inputs as placing

WORDS = ("stitch", "six.toml", "--match-tones", "--blend", "multiband", "--max-megapixels", 2000)


@pytest.fixture
def six(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_six(tmp_path, 300, 220)
    return tmp_path


@pytest.fixture
def waiting(monkeypatch):
    """Pictures of any size wait in files, and so are worked on by several processes."""
    monkeypatch.setattr(placing, "STORED_PIXELS", 0)


@pytest.mark.slow
def test_the_file_is_the_same_for_any_number_of_processes(six, waiting, toposeam, caplog):
    caplog.set_level("INFO", "toposeam_cli.jobs.crew")
    for count in (1, 2, 3):
        outputs = "-o", f"out{count}.tif", "--labels", f"labels{count}.png", "--overlay", f"over{count}.png"
        ran = toposeam(*WORDS, *outputs, "-j", count, "-q")
        assert ran.code == 0, ran
        for name in outputs[1::2]:
            assert (six / name).read_bytes() == (six / name.replace(str(count), "1")).read_bytes()
    parts = [record.args[0] for record in caplog.records]
    assert len(parts) == 2, "one process does not hand anything to itself"
    assert min(parts) >= 6 + 7 + 6 + 1, "pictures, tones of pairs, headrooms and windows were handed out"
    assert parts[0] == parts[1]
    assert [name for name in names(six) if name.endswith(".part")] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "does"),
    [((), {"describe_picture", "_shared_with", "_match_pair"}), (("six.toml", "--align"), {"_match"})],
)
def test_places_are_found_by_workers(six, waiting, toposeam, caplog, where, does):
    caplog.set_level("DEBUG", "toposeam_cli.jobs.crew")
    pictures = where or [f"{number}.tif" for number in range(6)]
    for count in (1, 2):
        outputs = "-o", f"out{count}.tif", "--save-layout", f"found{count}.toml"
        ran = toposeam("stitch", *pictures, *outputs, "-j", count, "-q")
        assert ran.code == 0, ran
        for name in outputs[1::2]:
            assert (six / name).read_bytes() == (six / name.replace(str(count), "1")).read_bytes()
    parts = {record.args[0]: record.args[1] for record in caplog.records if record.levelname == "DEBUG"}
    assert does <= parts.keys()
    assert min(parts[name] for name in does) >= 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "does"),
    [
        (("turned.toml", "--blend", "soft"), {"_warped", "divided"}),
        (("six.toml", "--avoid", "avoid.png", "--blend", "feather"), {"divided"}),
        (("six.toml", "--wrap", 690, "--blend", "multiband"), {"divided"}),
    ],
    ids=["turned and soft", "avoid", "wrap"],
)
def test_everything_that_can_be_asked_is_done_by_workers(
    six, waiting, toposeam, caplog, monkeypatch, words, does
):
    """Pictures turned, overlaps divided, windows blended: none of it by the command itself."""
    # Small canvases are divided as large ones are.
    monkeypatch.setattr(search_options, "FAST", search_options.SearchOptions(together=0))
    layout = (six / "six.toml").read_text()
    (six / "turned.toml").write_text(layout.replace("at = [210, 0]", "at = [210, 0]\nturn = 0.7"))
    away = np.zeros((374, 720), np.uint8)
    away[80:140, 220:310] = 255
    write_picture(six / "avoid.png", Picture(pixels=away))
    caplog.set_level("DEBUG", "toposeam_cli.jobs.crew")
    for count in (1, 2):
        ran = toposeam("stitch", *words, "-o", f"out{count}.tif", "-j", count, "-q")
        assert ran.code == 0, ran
    assert (six / "out1.tif").read_bytes() == (six / "out2.tif").read_bytes()
    parts = {record.args[0]: record.args[1] for record in caplog.records if record.levelname == "DEBUG"}
    assert {*does, "_rendered"} <= parts.keys()
    assert not [name for name in names(six) if name.endswith(".part")]


def test_small_pictures_take_one_process(six, toposeam, monkeypatch):
    monkeypatch.setattr(workers, "worker_processes", lambda *_: pytest.fail("processes were started"))
    assert toposeam(*WORDS, "-o", "out.tif", "-j", 2, "-q").code == 0


@pytest.mark.parametrize("count", ["0", "-1", "1000000000000", "two"])
def test_invalid_process_counts_are_refused_in_one_sentence(six, toposeam, count):
    toposeam(*WORDS, "-o", "out.tif", "-j", count).fails("-j", code=2)
    assert not (six / "out.tif").exists()


def test_default_is_one_process_per_core_and_one_in_a_worker(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3, 4}, raising=False)
    assert processes_of(None) == 3
    assert processes_of(2) == 2
    monkeypatch.setattr(crews.multiprocessing, "parent_process", lambda: "another")
    assert processes_of(None) == 1
    assert processes_of(2) == 2


def squared(number):
    return number * number


def killed_once(item):
    """Its process is killed where nobody was before."""
    path, number = item
    try:
        path.touch(exist_ok=False)
    except FileExistsError:
        return number
    return os.kill(os.getpid(), signal.SIGKILL)


def killed(item):
    os.kill(os.getpid(), signal.SIGKILL)


def refused(item):
    raise placing.ts.ImageError(f"{item} cannot be used; take another")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="Windows has no such signal")
def test_results_come_in_order_also_of_workers_that_were_killed(tmp_path):
    with crew(2) as workers:
        assert list(workers.map(squared, range(40))) == [number * number for number in range(40)]
        items = [(tmp_path / str(number // 3), number) for number in range(9)]
        assert list(workers.map(killed_once, items)) == list(range(9))
        with pytest.raises(placing.ts.ImageError, match=r"^3 cannot be used; take another$"):
            list(workers.map(refused, [3]))
        assert list(workers.map(squared, [])) == []
    with crew(2) as workers, pytest.raises(WorkersDiedError, match="use fewer"):
        list(workers.map(killed, [1, 2, 3]))


def table(seed):
    made = np.random.default_rng(seed).random((400, 300))
    made.setflags(write=False)
    return made


def looked_up(item):
    values, row = item
    return values[row].sum()


@pytest.mark.slow
def test_large_tables_go_by_files_and_none_is_left(tmp_path):
    with scratch(tmp_path) as store, crew(2, None, store) as workers:
        tables = [*workers.map(table, range(3)), table(3)]
        items = [(values[row:], 5) for values in tables for row in range(0, 300, 50)]
        sums = list(workers.map(looked_up, items))
        assert sums == [table(seed)[row + 5].sum() for seed in range(4) for row in range(0, 300, 50)]
        assert workers.sent + workers.received < 20_000
        assert len(list(next(tmp_path.iterdir()).iterdir())) == 4, "each is written once"
    assert not list(tmp_path.iterdir())


def test_workers_begin_before_results_are_asked_for(tmp_path):
    with crew(2) as workers:
        answers = workers.map(touched, [tmp_path / "first", tmp_path / "second"])
        deadline = time.monotonic() + 60
        while len(list(tmp_path.iterdir())) < 2:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        assert list(answers) == ["first", "second"]


def touched(path):
    path.touch()
    return path.name


def pages_taken_again(item):
    """How many pages arrays need anew whose like were given back, in threads as Dask's workers have one: in
    several, as something small at the end of one's heap keeps all of it.
    """
    import resource

    together = threading.Barrier(4)

    def taken(_):
        together.wait()
        for _ in range(10):
            arrays = [np.ones(3 << 20, np.uint8) for _ in range(10)]
            del arrays

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(taken, range(4)))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        list(threads.map(taken, range(4)))
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif("glibc" not in platform.libc_ver(), reason="told to glibc only")
def test_workers_keep_memory_that_is_free_again():
    with crew(2) as workers:
        (pages,) = workers.map(pages_taken_again, [0])
    assert pages < 5_000, "of 17,000 to 160,000"


def test_what_is_not_needed_any_more_takes_no_space_to_the_end(tmp_path):
    with scratch(tmp_path) as store:
        files = [store.new() for _ in range(3)]
        for file in files:
            file.write_bytes(b"pixels")
        store.empty([files[1]])
        deadline = time.monotonic() + 60
        while any(files[k].stat().st_size for k in (0, 2)):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        assert files[1].read_bytes() == b"pixels"
    assert not list(tmp_path.iterdir())


def full(path, data):
    raise OSError(28, "No space left on device")


def test_a_full_disk_is_one_sentence(tmp_path, monkeypatch):
    with scratch(tmp_path) as store, crew(2, None, store) as workers:
        monkeypatch.setattr(Path, "write_bytes", full)
        with pytest.raises(OutputError, match=r"cannot keep pixels .*; free some space"):
            list(workers.map(looked_up, [(table(0), 1)]))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_ends_all_processes_and_leaves_nothing(tmp_path, process, number):
    make_six(tmp_path, 5000, 3400)  # 102 megapixels
    before = names(tmp_path)
    with process(*WORDS, "-o", "out.tif", "-j", 2, "-q", cwd=tmp_path) as child:
        deadline = time.monotonic() + 300
        # Two workers, and what looks after their resources.
        while len(workers := {one.number for one in descendants(child.pid)}) < 3:
            assert time.monotonic() < deadline
            assert child.poll() is None
            time.sleep(0.05)
        child.send_signal(number)
        assert child.wait(120) == (130 if number == signal.SIGINT else 128 + number)
        deadline = time.monotonic() + 60
        while workers & {one.number for one in living()}:
            assert time.monotonic() < deadline, "a worker outlives its command"
            time.sleep(0.1)
    assert names(tmp_path) == before
