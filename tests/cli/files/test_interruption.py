"""Ctrl-C and kill end what libvips is doing, and every block that writes a file is left as by an
exception.
"""

import os
import signal
import threading

import numpy as np
import pytest

from toposeam_cli.files.interruption import Terminated, interruptible, terminations_raised
from toposeam_cli.files.writing import lock, remove_stale, replacing
from toposeam_cli.pictures.libvips import evaluate, load_vips

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
