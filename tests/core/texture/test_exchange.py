"""Objects of a texture that are made whole, and exchanged where one comes twice near by."""

import os
from mmap import mmap

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.closed_cuts import Cutting, Patch, closed_cuts
from toposeam.texture.crew import FORKS, Crew
from toposeam.texture.exchange import Exchange
from toposeam.texture.lay import PatchPlacer
from toposeam.texture.objects import Objects

SIDE = 128


def discs(count=16):
    """Discs of 16 px on paper, and the number of the disc at each pixel."""
    y, x = np.mgrid[:SIDE, :SIDE]
    objects, rng, middles = np.zeros((SIDE, SIDE), int), np.random.default_rng(1), []
    for _ in range(4000):
        row, column = rng.integers(10, SIDE - 10, 2)
        if len(middles) < count and all(np.hypot(row - a, column - b) > 24 for a, b in middles):
            middles.append((row, column))
            objects[np.hypot(y - row, x - column) < 8] = len(middles)
    paper = 0.8 + 0.04 * rng.normal(size=(SIDE, SIDE))
    return np.clip(np.where(objects > 0, 0.2, paper), 0, 1).astype(np.float32), objects, np.array(middles)


def placer_on(image, index, wrap=(False, False)):
    """A placer whose canvas shows pixels of an image, by flat index into it."""
    atlas = Atlas.of([np.ones(image.shape, bool)], 8)
    canvas = IndexCanvas(index.shape, wrap, atlas.usable.size)
    row, column = np.divmod(index, image.shape[1])
    top, left = atlas.corners[0]
    canvas.begin(((row + top) * atlas.width + column + left).astype(np.int32))
    canvas.usage[:] = np.bincount(canvas.index.ravel(), minlength=atlas.usable.size)
    features = atlas.spread([image[..., np.newaxis]])
    options = ts.LayOptions(copy_share=1.0, copy_patches=100)
    return PatchPlacer(atlas, features, canvas, options, np.random.default_rng(0), index.size)


def shown(placer, objects):
    """The number of the disc at each pixel of a placer's canvas."""
    _, place = placer.atlas.locate(placer.canvas.index)
    return objects[place[..., 0], place[..., 1]]


def test_objects_and_where_they_show_are_found():
    image, _, middles = discs()
    index = np.arange(image.size).reshape(image.shape)
    placer = placer_on(image, np.roll(index, (5, 9), (0, 1)), (True, True))
    found = Objects(placer.guard, placer.atlas, placer.canvas)
    assert len(found.all) == len(middles)
    assert all(one.whole for one in found.all)
    counts = found.shown()
    assert len(counts) == len(middles)
    assert {key: found.room(key) for key in counts} == dict(counts)
    at = {tuple(place) for place in (middles + np.array([5, 9])) % SIDE}
    assert all(min(np.hypot(*(np.array(key[1:]) - place)) for place in at) < 2 for key in counts)


def test_a_cut_object_is_made_whole_and_what_is_left_of_one_goes():
    image, objects, middles = discs(9)
    index = np.arange(image.size).reshape(image.shape)
    bare = ndimage.maximum_filter(objects, 21, mode="constant", cval=1) == 0
    (row, column), (cut, small) = np.argwhere(bare)[0], middles[[3, 8]]
    placer = placer_on(image, index)
    atlas, canvas = placer.atlas, placer.canvas
    for (top, left), height in (cut, 6), (small, 13):
        corner = atlas.corners[0] + (row - 8, column - 8)
        ground = placer.patch(tuple(corner), (height, 17))
        canvas.paint(top - 8, left - 8, ground, np.ones(ground.shape, bool))
    area = np.bincount(objects.ravel())
    assert np.count_nonzero(shown(placer, objects) == 4) < 0.9 * area[4]
    assert Exchange(placer, (40, 40), Crew(1, placer, lambda: None)).run() == 2
    made = np.bincount(shown(placer, objects).ravel(), minlength=len(area))
    assert made[4] == area[4]
    assert made[9] == 0
    np.testing.assert_array_equal(np.delete(made, [0, 9]), np.delete(area, [0, 9]))
    usage = np.bincount(canvas.index.ravel(), minlength=len(canvas.usage))
    np.testing.assert_array_equal(canvas.usage, usage)


def test_patches_that_do_not_touch_are_cut_together_as_each_alone():
    image, _, _ = discs()
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    canvas, corner, rng = placer.canvas, placer.atlas.corners[0], np.random.default_rng(4)
    patches = []
    for number, (height, width) in enumerate([(30, 24), (21, 33), (27, 27), (16, 40)]):
        top, left = 4 + 62 * (number // 2), 5 + 60 * (number % 2)
        must = np.zeros((height, width), bool)
        must[height // 2 - 2 : height // 2 + 2, width // 2 - 3 : width // 2 + 3] = True
        source = placer.patch(tuple(corner + rng.integers(0, 80, 2)), (height, width))
        before = canvas.read(top - 1, left - 1, height + 2, width + 2)
        one = {"source": source, "before": before, "must": must, "may": np.ones(must.shape, bool)}
        patches.append(Patch(at=(top, left), joined=frozenset(), **one))
    same = patches[0].before[1:-1, 1:-1]
    patches.append(
        Patch(
            at=patches[0].at,
            **{
                **one,
                "source": same,
                "must": patches[0].must,
                "before": patches[0].before,
                "may": patches[0].may,
            },
            joined=frozenset(),
        )
    )
    together = closed_cuts(placer, patches)
    for patch, shows in zip(patches, together, strict=True):
        padded = patch.before.copy()
        padded[1:-1, 1:-1][patch.must] = -1
        alone = placer.cut(padded, patch.source, patch.may, closed=True) | patch.must
        np.testing.assert_array_equal(shows, alone)
        assert shows[patch.must].all()
        assert not shows.all()
    np.testing.assert_array_equal(together[-1], patches[0].must)
    np.testing.assert_array_equal(closed_cuts(placer, patches[:1])[0], together[0])


def test_patches_that_wait_are_cut_by_their_places_alone():
    image, _, _ = discs()
    placer = placer_on(image, np.roll(np.arange(image.size).reshape(image.shape), 9, 0), (True, True))
    rng, patches, places = np.random.default_rng(5), [], []
    for top, left in (-7, 30), (40, SIDE - 12):  # across both borders
        must, may = np.zeros((24, 26), bool), np.ones((24, 26), bool)
        must[9:14, 10:15], may[:3, :4] = True, False
        row, column = (placer.atlas.corners[0] + rng.integers(0, 90, 2)).tolist()
        before = placer.canvas.read(top - 1, left - 1, 26, 28)
        source = placer.patch((row, column), must.shape)
        patches.append(Patch(at=(top, left), source=source, before=before, must=must, may=may))
        lines = [(start + np.arange(n)) % SIDE for start, n in zip((top, left), must.shape, strict=True)]
        placer.canvas.waiting[np.ix_(*lines)] = may.astype(np.uint8) + must
        places.append((top, left, row, column, *must.shape))
    found = Cutting(placer, (40, 40)).shows(np.array(places, np.int32).tobytes())
    for one, other in zip(found, closed_cuts(placer, patches), strict=True):
        np.testing.assert_array_equal(one, other)
        assert 0 < one.sum() < one.size


def test_objects_are_cut_by_others_and_come_out_the_same(monkeypatch):
    image, _, _ = discs()
    cutters = mmap(-1, 2)  # whether this process has cut, and whether another one has
    own, shows = os.getpid(), Cutting.shows

    def noted(self, places):
        cutters[os.getpid() != own] = 1
        return shows(self, places)

    monkeypatch.setattr(Cutting, "shows", noted)
    one = ts.synthesize(image, 400, patch=40, seed=3)
    assert cutters[:] == b"\1\0"
    two = ts.synthesize(image, 400, patch=40, seed=3, processes=2)
    np.testing.assert_array_equal(one.index, two.index)
    assert cutters[1] == FORKS


def test_others_begin_to_cut_objects_while_the_next_are_looked_for(monkeypatch):
    image, _, _ = discs()
    done = []
    for name in ("ask", "pass_on", "answers"):
        method = getattr(Crew, name)

        def noted(self, *given, name=name, method=method):
            done.append("cuts" if name == "ask" and isinstance(given[1], bytes) else name)
            return method(self, *given)

        monkeypatch.setattr(Crew, name, noted)
    ts.synthesize(image, 400, patch=40, seed=3)
    after = [done[k + 1] for k, what in enumerate(done) if what == "cuts"]
    assert after
    assert set(after) == {"pass_on"}


def test_an_object_that_comes_twice_becomes_another_one_if_what_was_chosen_has_no_room(monkeypatch):
    image, objects, middles = discs()
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    apart = np.hypot(*(middles[:, np.newaxis] - middles).transpose(2, 0, 1))
    inner = ((middles > 20) & (middles < SIDE - 20)).all(axis=1)
    one, other = next((i, j) for i, j in np.argwhere(apart < SIDE / 2) if i != j and inner[i] and inner[j])
    source = placer.patch(tuple(placer.atlas.corners[0] + middles[one] - 9), (19, 19))
    placer.canvas.paint(*(middles[other] - 9).tolist(), source, np.ones(source.shape, bool))

    def twice():
        return np.count_nonzero(shown(placer, objects) == one + 1) > 1.5 * (objects == one + 1).sum()

    assert twice()
    monkeypatch.setattr(Exchange, "_chosen", lambda *_: {})
    assert Exchange(placer, (40, 40), Crew(1, placer, lambda: None)).run() == 1
    assert not twice()


@pytest.mark.parametrize("tileable", ["none", "both"])
def test_objects_stay_whole_and_none_comes_twice_near_by(tileable):
    image, objects, _ = discs()
    area = np.bincount(objects.ravel())
    made = ts.synthesize(image, 300, patch=40, seed=2, tileable=tileable)
    number = objects[made.source[..., 0], made.source[..., 1]]
    middles, whole = [], []
    for k in range(1, len(area)):
        pieces, _ = ndimage.label(number == k)
        for piece, box in enumerate(ndimage.find_objects(pieces), 1):
            if all(side.start > 0 and side.stop < 300 for side in box):
                size = np.count_nonzero(pieces[box] == piece)
                whole.append(size > 0.9 * area[k])
                if 2 * size > area[k]:
                    middles.append((k, *ndimage.center_of_mass(pieces == piece)))
    assert np.mean(whole) > 0.97
    found = np.array(middles)
    near = np.hypot(*(found[:, np.newaxis, 1:] - found[:, 1:]).transpose(2, 0, 1)) < SIDE / 2
    twice = near & (found[:, np.newaxis, 0] == found[:, 0])
    assert twice.sum() - len(found) <= 2
    again = ts.synthesize(image, 300, patch=40, seed=2, tileable=tileable, processes=2)
    np.testing.assert_array_equal(again.source, made.source)
