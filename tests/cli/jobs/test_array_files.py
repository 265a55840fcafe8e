"""Large arrays that go from process to process by files."""

import gc
import pickle

import numpy as np
import pytest

from toposeam_cli.jobs import array_files
from toposeam_cli.jobs.array_files import ArrayFiles


@pytest.fixture
def table():
    made = np.random.default_rng(0).random((300, 400)).astype(np.float32)
    made.setflags(write=False)
    return made


def copied(pickled):
    return pickle.loads(pickled)  # noqa: S301 - what this test has written


def test_what_is_handed_on_is_the_same_and_is_written_once(tmp_path, table):
    here = ArrayFiles(tmp_path)
    whole, part, turned = (here.pickled({"a": [value]}) for value in (table, table[50:250, 20:399], table.T))
    assert len(list(tmp_path.iterdir())) == 1
    assert here.written == table.nbytes
    assert max(map(len, (whole, part, turned))) < 1000
    for pickled, wanted in ((whole, table), (part, table[50:250, 20:399]), (turned, table.T)):
        (found,) = copied(pickled)["a"]
        np.testing.assert_array_equal(found, wanted)
        assert not found.flags.writeable


def test_parts_of_a_few_kilobytes_go_by_the_file_of_the_whole(tmp_path, table):
    here = ArrayFiles(tmp_path)
    pickled = here.pickled(table[10:30, 20:120])
    assert len(pickled) < 1000
    np.testing.assert_array_equal(copied(pickled), table[10:30, 20:120])
    assert len(here.pickled(table[10:20, 20:30])) < 1000  # which is sooner sent itself
    assert here.written == table.nbytes


def test_a_memory_mapped_array_is_sent_as_its_place_in_the_file(tmp_path, table):
    there = copied(ArrayFiles(tmp_path).pickled(table))
    for hands in (ArrayFiles(tmp_path), ArrayFiles(None)):
        again = hands.pickled(there[100:, ::2])
        assert hands.written == 0
        assert len(again) < 1000
        np.testing.assert_array_equal(copied(again), table[100:, ::2])


def test_what_may_change_or_is_small_is_pickled_as_usual(tmp_path, table):
    here = ArrayFiles(tmp_path)
    values = [
        table.copy(),
        table.copy()[10:],
        table[0],
        np.broadcast_to(np.True_, (3000, 4000)),
        np.array([None] * 9000),
    ]
    back = copied(here.pickled(values))
    assert not list(tmp_path.iterdir())
    for found, wanted in zip(back, values, strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert len(pickle.dumps(table)) == pytest.approx(len(ArrayFiles(None).pickled(table)), abs=100)


def test_an_array_in_the_place_of_one_that_is_gone_is_another(tmp_path, monkeypatch):
    here = ArrayFiles(tmp_path)
    monkeypatch.setattr(array_files, "id", lambda _: 7, raising=False)  # as if memory were used again
    for value in (1, 2, 3):
        made = np.full((300, 400), value)
        made.setflags(write=False)
        assert copied(here.pickled(made)).max() == value
        del made
        gc.collect()
    assert len(list(tmp_path.iterdir())) == 3


def test_a_folder_that_is_gone_is_told(tmp_path, table):
    with pytest.raises(FileNotFoundError):
        ArrayFiles(tmp_path / "gone").pickled(table)
