"""Ctrl-C and kill end what libvips is doing, and every block that writes a file is left as by an
exception.
"""

import contextlib
import os
import shutil
import signal
import sys
import threading
import weakref
from contextlib import suppress
from contextvars import copy_context

import numpy as np
import pytest

from toposeam import saving
from toposeam_cli.files.interruption import (
    Terminated,
    interruptible,
    terminations_raised,
)
from toposeam_cli.files.temporary import (
    claimed_folder,
    lock,
    remove,
    remove_stale,
    remove_unfinished,
    temporary_beside,
)
from toposeam_cli.files.writing import all_or_nothing, atomic_write, replacing
from toposeam_cli.jobs.workers import Task, answer
from toposeam_cli.media.pictures.libvips import evaluate, load_vips

pytestmark = pytest.mark.usefixtures("hangups_arrive")
SIGNALS = [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated), (signal.SIGHUP, Terminated)]


def soon(number):
    threading.Timer(0.2, os.kill, (os.getpid(), number)).start()


@pytest.mark.parametrize(("number", "error"), SIGNALS)
def test_a_signal_ends_what_libvips_computes(number, error):
    image = load_vips().Image.gaussnoise(100_000, 100_000).gaussblur(30)  # minutes of work
    values, threads = [], threading.active_count()
    with terminations_raised():
        soon(number)
        with pytest.raises(error):
            evaluate(image, lambda: values.append(image.avg()))
    assert not values
    assert threading.active_count() <= threads + 1  # the timer may still be ending


@pytest.mark.parametrize(("number", "error"), SIGNALS)
def test_a_signal_while_nothing_of_libvips_runs_tidies_too(tmp_path, number, error):
    def write_for_ever():
        with terminations_raised(), replacing(tmp_path / "out.png") as temporary:
            temporary.write_text("half")
            soon(number)
            while True:
                sum(range(1000))

    with pytest.raises(error):
        write_for_ever()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("number", "error"), SIGNALS)
def test_a_signal_in_a_swallowed_exception_is_raised_again(number, error, capsys):
    class Referred:
        pass

    class Finalized:
        def __del__(self):
            signal.raise_signal(number)

    def swallow(how):
        with terminations_raised():
            if how == "finalizer":
                Finalized()
            else:
                referred = Referred()
                kept = weakref.ref(referred, lambda _: signal.raise_signal(number))
                del referred
                assert kept() is None
            while True:
                sum(range(1000))

    for how in ("finalizer", "weak reference"):
        with pytest.raises(error):
            swallow(how)
    assert capsys.readouterr().err == ""


def test_an_interruption_that_python_wraps_is_found_behind_it():
    class Attribute:
        def __set_name__(self, owner, name):
            raise Terminated(143)

    with pytest.raises(Terminated), terminations_raised():
        type("Made", (), {"one": Attribute()})
    with pytest.raises(Terminated), terminations_raised():
        raise ImportError("initialization failed") from Terminated(143)  # as a module in C++ does
    for kind in (RuntimeError, ImportError):
        own = kind("its own")
        own.__cause__ = own
        with pytest.raises(kind, match="its own"), terminations_raised():
            raise own


@pytest.mark.parametrize(("number", "error"), SIGNALS)
def test_an_interruption_in_whose_place_a_module_puts_an_error(number, error):
    """As pybind11 does where a signal comes while it looks at arguments."""

    def call():
        with contextlib.suppress(BaseException):
            signal.raise_signal(number)
        raise TypeError("incompatible function arguments")

    with pytest.raises(error), terminations_raised():
        call()
    with pytest.raises(TypeError), terminations_raised():
        raise TypeError


def test_other_exceptions_that_python_swallows_are_told_as_ever(monkeypatch):
    class Finalized:
        def __del__(self):
            raise LookupError

    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda unraisable: told.append(unraisable.exc_type))
    with terminations_raised():
        Finalized()
    assert told == [LookupError]


def test_the_exit_code_is_that_of_the_signal():
    with pytest.raises(SystemExit) as end, terminations_raised():
        signal.raise_signal(signal.SIGTERM)
    assert end.value.code == 128 + signal.SIGTERM


def test_handlers_of_others_are_left_alone():
    seen = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    try:
        with terminations_raised():
            signal.raise_signal(signal.SIGTERM)
        assert seen == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_values_and_errors_come_through():
    assert interruptible(lambda: 3, lambda: None) == 3
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0, lambda: None)
    outcome = []
    thread = threading.Thread(
        target=lambda: outcome.append(
            interruptible(threading.get_ident, lambda: None) == threading.get_ident()
        )
    )
    thread.start()
    thread.join()
    assert outcome == [True]  # elsewhere than in the main thread nobody could interrupt it


def test_only_files_whose_writers_are_gone_are_stale(tmp_path):
    (tmp_path / ".toposeam-0123456789abcdef.part").write_text("half")
    (tmp_path / "picture.part").write_text("someone else's")
    with replacing(tmp_path / "out.txt") as temporary:
        temporary.write_text("ours")
        remove_stale(tmp_path)
        assert sorted(path.name for path in tmp_path.iterdir()) == sorted([temporary.name, "picture.part"])
    assert (tmp_path / "out.txt").read_text() == "ours"
    remove_stale(tmp_path / "missing")


def test_a_locked_file_is_locked_until_it_is_closed(tmp_path):
    path = tmp_path / "file"
    with path.open("wb") as first, path.open("rb+") as second:
        assert lock(first.fileno())
        assert not lock(second.fileno())
        first.close()
        assert lock(second.fileno())


def test_pixels_computed_in_a_thread_are_the_same():
    pixels = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    image = load_vips().Image.new_from_array(pixels)
    assert np.array_equal(evaluate(image, image.numpy), pixels)


#: Of so many steps one is tried; 1 tries all, which takes minutes.
STRIDE = int(os.environ.get("TOPOSEAM_STRIDE", "7"))
#: Files that an interruption kept from being closed are closed by whoever collects them.
unclosed = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


class AtStep:
    """A signal at one step of our own code that writes, and of what it is in."""

    WHERE = (
        "files/writing.py",
        "files/temporary.py",
        "jobs/workers.py",
        "contextlib.py",
        "saving.py",
    )

    def __init__(self, step, number=signal.SIGTERM):
        self.left, self.number = step, number

    def trace(self, frame, event, arg):
        if not frame.f_code.co_filename.endswith(self.WHERE):
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            self.left -= 1
            if self.left == 0:
                sys.settrace(None)
                signal.raise_signal(self.number)
        return self.trace

    @property
    def came(self):
        return self.left <= 0

    def __enter__(self):
        sys.settrace(self.trace)
        return self

    def __exit__(self, *_):
        sys.settrace(None)


def contents(folder):
    assert not [path for path in folder.glob(".*") if path.is_dir()]
    return {
        path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()
    }


def write_a_file_and_a_folder(folder, force):
    with all_or_nothing():
        with replacing(folder / "a", force) as temporary:
            temporary.write_text("new")
        with replacing(folder / "b", force, folder=True) as temporary:
            (temporary / "in").write_text("new")


OLD, NEW = {"a": "old", "b/in": "old"}, {"a": "new", "b/in": "new"}


@unclosed
@pytest.mark.slow
@pytest.mark.parametrize("force", [False, True], ids=["new", "replaced"])
def test_an_interrupted_command_leaves_nothing_unfinished(tmp_path, force):
    before = OLD if force else {}
    step, outcomes = 0, []
    while not outcomes or outcomes[-1][0]:
        step += STRIDE
        folder = tmp_path / f"{step}"
        folder.mkdir()
        if force:
            (folder / "b").mkdir()
            for name, text in OLD.items():
                (folder / name).write_text(text)
        with suppress(Terminated), terminations_raised(), AtStep(step) as signalled:
            copy_context().run(write_a_file_and_a_folder, folder, force)
        remove_unfinished()  # as at the end of the process
        outcomes.append((signalled.came, contents(folder)))
        assert outcomes[-1][1] in (before, NEW), f"at step {step}"
        shutil.rmtree(folder)
    assert step > 500
    assert outcomes[-1] == (False, NEW)
    assert (True, before) in outcomes


def job_of_a_worker(folder):
    atomic_write(f"{folder}/a", "new")
    atomic_write(f"{folder}/b", "new")


@unclosed
@pytest.mark.slow
def test_an_ended_worker_tidies_up_at_every_step(tmp_path, monkeypatch):
    class Gone(BaseException):
        pass

    seen = []

    def gone(code):
        seen.append(contents(folder))  # nothing more would happen in a process that has ended
        raise Gone

    monkeypatch.setattr(os, "_exit", gone)
    monkeypatch.setitem(sys.modules, "job_of_a_worker", sys.modules[__name__])
    step, came = 0, True
    while came:
        step += STRIDE
        folder = tmp_path / f"{step}"
        folder.mkdir()
        task = Task("job_of_a_worker:job_of_a_worker", {"folder": str(folder)})
        with suppress(Gone, Terminated), terminations_raised(), AtStep(step) as signalled:
            copy_context().run(answer, task)
        came = signalled.came
        if came and seen:
            assert seen.pop() in ({}, {"a": "new", "b": "new"}), f"at step {step}"
        remove_unfinished()
        shutil.rmtree(folder)
    assert step > 500


def test_a_child_that_is_forked_leaves_the_files_of_its_parent(tmp_path):
    with replacing(tmp_path / "out") as temporary:
        child = os.fork()
        if not child:
            remove_unfinished()
            os._exit(0)
        os.waitpid(child, 0)
        assert temporary.exists()


def test_what_has_the_name_of_a_removed_file_is_left(tmp_path):
    path = temporary_beside(tmp_path / "out")
    path.write_text("ours")
    remove(path)
    path.write_text("someone else's")
    remove_unfinished()
    assert path.exists()


def test_folders_whose_writers_are_gone_are_stale_too(tmp_path):
    (tmp_path / f".toposeam-{'a' * 16}.part" / "deep").mkdir(parents=True)
    with claimed_folder(tmp_path / f".toposeam-{'b' * 16}.part") as ours:
        remove_stale(tmp_path)
        assert list(tmp_path.iterdir()) == [ours]
    assert not list(tmp_path.iterdir())


def test_a_file_written_by_core_is_claimed_until_it_is_finished(tmp_path, monkeypatch):
    met = []

    def tidied_meanwhile(descriptor):
        met.extend(tmp_path.iterdir())
        remove_stale(tmp_path)

    monkeypatch.setattr(os, "fsync", tidied_meanwhile)
    saving.save(tmp_path / "drawing.svg", "<svg/>")
    assert [path.name for path in tmp_path.iterdir()] == ["drawing.svg"]
    met[0].write_text("left by somebody who was killed")
    remove_stale(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["drawing.svg"]
