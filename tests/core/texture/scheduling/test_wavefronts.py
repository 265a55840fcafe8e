"""Textures laid in waves by several processes: the same for any number of them, and none is left."""

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from mmap import mmap
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.texture import material
from toposeam.texture.canvas import IndexCanvas, Offers
from toposeam.texture.exemplar import Atlas
from toposeam.texture.placement.wave_conflicts import WaveConflicts
from toposeam.texture.repair.seam_mending import Mending
from toposeam.texture.scheduling import Crew, lay_wave, patches_along
from toposeam.texture.scheduling.process_pool import FORKS
from toposeam.texture.scheduling.wavefronts import Laying, waves_of

forks = pytest.mark.skipif(not FORKS, reason="nothing forks here")


@pytest.mark.parametrize("length", [40, 64, 95, 211, 400])
@pytest.mark.parametrize("overlap", [2, 10, 22, 35])
@pytest.mark.parametrize("wraps", [False, True])
def test_windows_of_a_wave_are_disjoint_and_follow_those_above(length, overlap, wraps):
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
def test_an_ordered_texture_is_equal_for_any_process_count():
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
    """What processes do in these tests; the tool is the first one's number and memory that all share."""

    def __init__(self, tool, shape):
        (self.first, self.met), self.calls = tool, 0

    def meets(self, number):
        """Waits until as many as are asked do the same: none of them can do two."""
        self.met[number] = 1
        while 0 in self.met[:]:
            time.sleep(0.001)
        return os.getpid()

    def counts(self, number):
        self.calls += 1
        return number, self.calls, os.getpid()

    def dies(self, number):
        self.befalls(lambda: os.kill(os.getpid(), signal.SIGKILL))

    def fails(self, number):
        def fail():
            raise ts.ImageError("so it is")

        self.befalls(fail)

    def befalls(self, what):
        """Befalls another process; the first waits for it."""
        if os.getpid() != self.first:
            self.met[0] = 1
            what()
        while not self.met[0]:
            time.sleep(0.001)


def meeting(count):
    return os.getpid(), mmap(-1, count)


def met(crew, count):
    """The numbers of all processes of a crew."""
    crew._tool[1][:] = bytes(count)
    crew.begin(Worker, (1, 1), count)
    for k in range(count):
        crew.ask("meets", k)
    return {process for _, process in crew.answers()}


def gone(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


@forks
def test_others_begin_before_answers_are_wanted():
    with Crew(2, meeting(2), lambda: None) as crew:
        seen = crew._tool[1]
        crew.begin(Worker, (0, 0), 2)
        crew.ask("meets", 1)
        crew.pass_on()
        until = time.monotonic() + 20
        while not seen[1] and time.monotonic() < until:
            time.sleep(0.001)
        began, seen[0] = seen[1], 1
        ((_, process),) = crew.answers()
    assert began
    assert process != os.getpid()


@forks
def test_every_process_takes_part():
    prepared = []
    with Crew(3, meeting(3), lambda: prepared.append(1)) as crew:
        crew.begin(Worker, (1, 1), 1)
        crew.ask("counts", 9)
        assert list(crew.answers()) == [(("counts", (9,)), (9, 1, os.getpid()))]
        assert not prepared
        processes = met(crew, 3)
        assert processes == met(crew, 3)
        crew.begin(Worker, (1, 1), 1)  # one alone
        crew.ask("counts", 8)
        assert list(crew.answers()) == [(("counts", (8,)), (8, 1, os.getpid()))]
    assert len(processes) == 3
    assert os.getpid() in processes
    assert prepared == [1]
    assert all(gone(process) for process in processes - {os.getpid()})


@forks
def test_those_that_are_dismissed_end_while_the_work_goes_on():
    with Crew(3, meeting(3), lambda: None) as crew:
        others = met(crew, 3) - {os.getpid()}
        crew.dismiss()
        until = time.monotonic() + 20
        ended = os.WEXITED | os.WNOWAIT | os.WNOHANG
        while time.monotonic() < until and not all(os.waitid(os.P_PID, one, ended) for one in others):
            time.sleep(0.001)
        assert time.monotonic() < until
    assert all(gone(process) for process in others)


@forks
@pytest.mark.parametrize("count", [1, 3])
def test_all_that_is_asked_is_answered_once(count):
    asked, found = 600, []  # more than the pipe holds
    with Crew(count, meeting(count), lambda: None) as crew:
        crew.begin(Worker, (1, 1), asked)
        for k in range(asked - 100):
            crew.ask("counts", k)
        for (method, (number,)), (answer, calls, process) in crew.answers():
            assert (method, number) == ("counts", answer)
            found.append((number, process, calls))
            if len(found) <= 100:
                crew.ask("counts", asked - len(found))
        assert not list(crew.answers())
    assert sorted(number for number, _, _ in found) == list(range(asked))
    for one in {process for _, process, _ in found}:
        calls = sorted(calls for _, process, calls in found if process == one)
        assert calls == list(range(1, len(calls) + 1))


@forks
@pytest.mark.parametrize(
    ("method", "error", "said"),
    [("dies", ts.SolverError, "was killed, .* use fewer"), ("fails", ts.ImageError, "so it is")],
)
def test_what_befalls_a_process_is_told(method, error, said):
    processes = set()

    def work():
        with Crew(2, meeting(2), lambda: None) as crew:
            processes.update(met(crew, 2) - {os.getpid()})
            crew._tool[1][0] = 0
            crew.begin(Worker, (1, 1), 2)
            for k in range(2):
                crew.ask(method, k)
            list(crew.answers())

    with pytest.raises(error, match=said):
        work()
    assert len(processes) == 1
    assert all(map(gone, processes))


@forks
def test_an_interruption_leaves_no_process():
    processes = set()

    def work():
        with Crew(3, meeting(3), lambda: None) as crew:
            processes.update(met(crew, 3))
            crew.ask("counts", 0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert len(processes) == 3
    assert all(gone(process) for process in processes - {os.getpid()})


@forks
@pytest.mark.medium
def test_processes_end_when_their_parent_is_killed():
    code = f"""if True:
        import sys, time
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_wavefronts import Crew, meeting, met
        crew = Crew(3, meeting(3), lambda: None)
        print(*met(crew, 3), flush=True)
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

    def conflicts(near=1.0, most=100):
        return WaveConflicts(canvas, atlas, 30, near, limit, lambda *_: most)

    def offers(*places, new=10, continued=()):
        rows, columns = np.array(places).T
        return Offers(
            rows=rows, columns=columns, errors=np.ones(len(rows), np.float32), new=new, continued=[*continued]
        )

    shape, found = (20, 20), offers((10, 10), (15, 10), (40, 40))
    keeps = conflicts()
    assert (keeps.judged((0, 0), shape, found) == 1).all()
    keeps.add((0, 0), (10, 10), found)
    assert np.allclose(keeps.judged((0, 40), shape, found), [2, 1.75, 1])
    assert (keeps.judged((0, 90), shape, found) == 1).all()
    across = keeps.judged((0, 160), shape, found)
    assert np.allclose(across, [2, 1.75, 1] if wrap[1] else 1)
    # Pixels that show once already show twice with what was just picked, and that is all they may.
    canvas.paint(60, 60, atlas_patch(atlas, (10, 10)), np.ones((20, 20), bool))
    keeps = conflicts()  # of the next wave
    keeps.add((0, 0), (10, 10), found)
    assert np.isinf(keeps.judged((0, 90), shape, found)[:2]).all()
    assert (keeps.judged((0, 90), shape, offers((10, 10))) == 1).all()  # better it than none
    # A copy of 400 px: two patches that continue it are one too many.
    limit[:] = 100
    keeps, copy = conflicts(0.0, 415), offers((30, 30), (40, 40), continued=[(30, 30, 0)])
    assert (keeps.judged((0, 0), shape, copy) == 1).all()
    keeps.add((0, 0), (30, 30), copy)
    assert np.isinf(keeps.judged((0, 90), shape, copy)).tolist() == [True, False]
    keeps = conflicts(0.0, 425)
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
    assert [canvas.area_of(first) for first in canvas.copies(0, 0, 12, 30).first] == [36]
    for _ in range(3000):  # more than there was room for at first
        canvas.paint(3, 3, source, every)
    assert canvas.usage.sum() == (canvas.index >= 0).sum()


@pytest.mark.parametrize("kind", [Laying, Mending])
def test_whoever_cuts_a_patch_cuts_it_alike(kind, monkeypatch):
    placers = []
    monkeypatch.setattr(material, "mend", lambda placer, *_: placers.append(placer))
    ts.synthesize(data.gravel()[:70, :81], (90, 100), patch=24, seed=4)
    placer, at, shape = placers[0], (30, 41), (24, 24)
    if kind is Laying:
        placer.canvas.index[40:, 50:] = -1
    one, other = kind(placer, shape), kind(placer, shape)
    offers = one.offers(at)
    for place in zip(offers.rows.tolist(), offers.columns.tolist(), strict=True):
        one.offers(at)
        shows, again = one.shows(at, place), other.shows(at, place)
        assert shows is again is None or (shows == again).all()
    assert offers is not None


def test_nothing_is_laid_where_nothing_is_wanted(monkeypatch):
    placers = []
    monkeypatch.setattr(material, "mend", lambda placer, *_: placers.append(placer))
    ts.synthesize(data.gravel()[:70, :81], (90, 100), patch=24, seed=4)
    with Crew(1, placers[0], lambda: None) as crew:
        before = placers[0].canvas.index.copy()
        assert lay_wave(placers[0], crew, Laying, [(0, 0), (40, 50)], (24, 24)) == [False, False]
        assert (placers[0].canvas.index == before).all()
        placers[0].canvas.index[50, 60] = -1
        assert lay_wave(placers[0], crew, Laying, [(0, 0), (40, 50)], (24, 24)) == [False, True]
        assert (placers[0].canvas.index >= 0).all()
