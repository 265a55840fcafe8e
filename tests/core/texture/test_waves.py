"""Textures laid in waves by several processes: the same for any number of them, and none is left."""

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.texture.atlas import Atlas
from toposeam.texture.beside import Beside
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.crew import FORKS, Crew
from toposeam.texture.raster import patches_along
from toposeam.texture.sites import Offers
from toposeam.texture.waves import waves_of

forks = pytest.mark.skipif(not FORKS, reason="nothing forks here")


@pytest.mark.parametrize("length", [40, 64, 95, 211, 400])
@pytest.mark.parametrize("overlap", [2, 10, 22, 35])
@pytest.mark.parametrize("wraps", [False, True])
def test_windows_of_a_wave_do_not_touch_and_those_above_are_there(length, overlap, wraps):
    width, columns = patches_along(length, 40, overlap, wraps)
    _, rows = patches_along(170, 40, overlap, False)
    reach = 8
    waves = waves_of(rows, columns, width + reach, length if wraps else None)
    assert sorted(at for wave in waves for at in wave) == sorted((y, x) for y in rows for x in columns)

    def touch(one, other):
        apart = abs(one[1] - other[1])
        across = min(apart, length - apart) if wraps else apart
        return abs(one[0] - other[0]) < 40 + reach and across < width + reach

    for wave in waves:
        assert not any(touch(one, other) for k, one in enumerate(wave) for other in wave[:k])
    wave_of = {at: number for number, wave in enumerate(waves) for at in wave}
    for above, below in pairwise(rows):
        for left in columns:
            before = [other for other in columns if touch((below, left), (above, other))]
            assert all(wave_of[above, other] < wave_of[below, left] for other in before)


@forks
@pytest.mark.parametrize(
    ("size", "options"),
    [
        ((203, 157), {}),
        ((150, 211), {"tileable": "both"}),
        ((97, 240), {"tileable": "x", "overlap": 0.6}),
        ((240, 100), {"tileable": "y", "turns": "all", "mend": 1}),
        ((30, 41), {}),
        ((200, 180), {"shares": [2, 1], "most": 1, "variety": 2}),
    ],
)
def test_any_number_of_processes_grows_the_same_texture(size, options):
    gravel = data.gravel()
    sample = [gravel[:70, :81], gravel[100:164, :90]] if "shares" in options else gravel[:70, :81]
    one, *others = (
        ts.synthesize(sample, size, patch=24, seed=4, processes=count, **options) for count in (1, 2, 3)
    )
    for made in others:
        assert (made.image == one.image).all()
        assert (made.source == one.source).all()
        assert (made.labels == one.labels).all()


@forks
@pytest.mark.medium
def test_an_ordered_texture_and_its_plan_are_the_same_for_any_number():
    rng, (y, x) = np.random.default_rng(2), np.mgrid[:120, :120]
    rows = np.sin(2 * np.pi * (y + 4 * ndimage.gaussian_filter(rng.normal(size=(120, 120)), 9)) / 11)
    wandering = rows + 0.3 * rng.random((120, 120))
    bricks = ((y % 12 < 2) | ((x + 9 * (y // 12 % 2)) % 18 < 2)) + 0.1 * rng.random((120, 120))
    for sample in (wandering, bricks):
        values = (sample - sample.min()) / np.ptp(sample)
        one, two = (
            ts.synthesize(values, (140, 150), patch=30, tileable="both", processes=count) for count in (1, 2)
        )
        assert (one.source == two.source).all()


class Worker:
    """What processes do in these tests."""

    def __init__(self, tool, shape):
        self.tool = tool

    def where(self, number):
        return number, os.getpid()

    def dies(self, number):
        if os.getpid() != self.tool:
            os.kill(os.getpid(), signal.SIGKILL)

    def fails(self, number):
        if os.getpid() != self.tool:
            raise ts.ImageError(f"not number {number}")


def gone(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


@forks
def test_a_process_meets_again_what_it_has_met():
    prepared = []
    with Crew(3, os.getpid(), lambda: prepared.append(1)) as crew:
        assert not prepared
        first = crew.each(Worker, (1, 1), "where", [(k,) for k in range(5)])
        again = crew.each(Worker, (1, 1), "where", [(k,) if k != 3 else None for k in range(5)])
        pair = crew.each(Worker, (1, 1), "where", [(7,), (8,)])
        alone = crew.each(Worker, (1, 1), "where", [(9,)])
    assert [k for k, _ in first] == list(range(5))
    assert [one for k, one in enumerate(again) if k != 3] == first[:3] + first[4:]
    assert again[3] is None
    assert [k for k, _ in pair] == [7, 8]
    assert alone == [(9, os.getpid())]
    processes = {process for _, process in first}
    assert len(processes) == 3
    assert prepared == [1]
    assert all(gone(process) for process in processes - {os.getpid()})


@forks
@pytest.mark.parametrize(
    ("method", "error", "said"),
    [("dies", ts.SolverError, "was killed, .* use fewer"), ("fails", ts.ImageError, "not number 0")],
)
def test_what_befalls_a_process_is_told(method, error, said):
    with Crew(2, os.getpid(), lambda: None) as crew:
        (_, process), _ = crew.each(Worker, (1, 1), "where", [(0,), (1,)])
        with pytest.raises(error, match=said):
            crew.each(Worker, (1, 1), method, [(0,), (1,)])
    assert gone(process)


@forks
def test_an_interruption_leaves_no_process():
    processes = set()

    def work():
        with Crew(3, os.getpid(), lambda: None) as crew:
            processes.update(number for _, number in crew.each(Worker, (1, 1), "where", [(0,), (1,), (2,)]))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert len(processes) == 3
    assert all(gone(process) for process in processes - {os.getpid()})


@forks
@pytest.mark.medium
def test_processes_end_when_their_parent_is_killed():
    code = """if True:
        import os, time
        from toposeam.texture.crew import Crew
        class Worker:
            def __init__(self, tool, shape): pass
            def where(self): return os.getpid()
        crew = Crew(3, None, lambda: None)
        print(*crew.each(Worker, (1, 1), "where", [()] * 3), flush=True)
        time.sleep(600)
    """
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        processes = [int(word) for word in parent.stdout.readline().split()]
        assert len(processes) == 3
        parent.kill()
    for process in processes:
        while not gone(process) and not ended(process):
            time.sleep(0.02)


def ended(process):
    """Where nobody takes it off the list, as in some containers."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except FileNotFoundError:
        return True


@pytest.mark.parametrize("wrap", [(False, False), (True, True)])
def test_what_is_picked_together_keeps_apart(wrap):
    atlas = Atlas.of([np.ones((60, 60), bool)], 8)
    canvas = IndexCanvas((200, 200), wrap, atlas.usable.size)
    limit = np.full((atlas.usable.shape[0], 1), 2.0)

    def beside(near=1.0, most=100):
        return Beside(canvas, atlas, 30, near, limit, lambda _: most)

    def offers(*places, new=10, continued=()):
        rows, columns = np.array(places).T
        return Offers(
            rows=rows, columns=columns, errors=np.ones(len(rows), np.float32), new=new, continued=[*continued]
        )

    shape, found = (20, 20), offers((10, 10), (15, 10), (40, 40))
    keeps = beside()
    assert (keeps.judged((0, 0), shape, found) == 1).all()
    keeps.add((0, 0), (10, 10), found)
    assert np.allclose(keeps.judged((0, 40), shape, found), [2, 1.75, 1])
    assert (keeps.judged((0, 90), shape, found) == 1).all()
    across = keeps.judged((0, 160), shape, found)
    assert np.allclose(across, [2, 1.75, 1] if wrap[1] else 1)
    # Pixels that show once already show twice with what was just picked, and that is all they may.
    canvas.paint(60, 60, atlas_patch(atlas, (10, 10)), np.ones((20, 20), bool))
    assert np.isinf(keeps.judged((0, 90), shape, found)[:2]).all()
    assert (keeps.judged((0, 90), shape, offers((10, 10))) == 1).all()  # better it than none
    # A copy of 400 px: two patches that continue it are one too many.
    limit[:] = 100
    keeps, copy = beside(0.0, 415), offers((30, 30), (40, 40), continued=[(30, 30, 0)])
    assert (keeps.judged((0, 0), shape, copy) == 1).all()
    keeps.add((0, 0), (30, 30), copy)
    assert np.isinf(keeps.judged((0, 90), shape, copy)).tolist() == [True, False]
    keeps = beside(0.0, 425)
    keeps.add((0, 0), (30, 30), copy)
    assert (keeps.judged((0, 90), shape, copy) == 1).all()


def atlas_patch(atlas, place):
    return ((place[0] + np.arange(20)[:, None]) * atlas.width + place[1] + np.arange(20)).astype(np.int32)


def test_what_is_shared_stays_what_it_was():
    canvas = IndexCanvas((12, 30), (False, False), 1600)
    every = np.ones((6, 6), bool)
    source = (np.arange(6)[:, None] * 40 + np.arange(6)).astype(np.int32)
    canvas.paint(0, 0, source, every)
    index, usage = canvas.index.copy(), canvas.usage.copy()
    canvas.share(5000)
    assert (canvas.index == index).all()
    assert (canvas.usage == usage).all()
    assert canvas.copies(0, 0, 12, 30).areas == [36]
    for _ in range(3000):  # more than there was room for at first
        canvas.paint(3, 3, source, every)
    assert canvas.usage.sum() == (canvas.index >= 0).sum()
