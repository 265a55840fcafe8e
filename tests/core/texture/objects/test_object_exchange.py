"""Objects of a texture that are made whole, and exchanged where one comes twice near by."""

import os
from mmap import mmap

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.texture import objects as objects_room
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.exemplar import Atlas
from toposeam.texture.objects import make_objects_whole
from toposeam.texture.objects.object_catalog import WHOLE_SHARE, ObjectCatalog
from toposeam.texture.objects.object_exchange import ObjectExchange
from toposeam.texture.objects.object_replacement import (
    GROUND,
    MAX_FORBIDDEN,
    MENDED,
    ObjectReplacer,
    ReplacementTask,
)
from toposeam.texture.placement import ClosedPatch, PatchPlacer
from toposeam.texture.scheduling import Crew
from toposeam.texture.scheduling.process_pool import FORKS

SIDE = 128
MANY = 1 << 20


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
    options = ts.texture.LayOptions(copy_share=1.0, copy_patches=100)
    return PatchPlacer(atlas, features, canvas, options, np.random.default_rng(0), index.size)


def exchange_on(placer):
    """The exchange of a placer's objects by one process."""
    return ObjectExchange(placer, (40, 40), Crew(1, placer, lambda: None), MANY)


def shown(placer, objects):
    """The number of the disc at each pixel of a placer's canvas."""
    _, place = placer.atlas.locate(placer.canvas.index)
    return objects[place[..., 0], place[..., 1]]


def test_the_room_of_objects_has_two_doors():
    scattered = ["ScatteredObjects", "atlas_without", "find_scattered", "lay_scattered"]
    assert objects_room.__all__ == [*scattered, "make_objects_whole"]


def test_objects_and_where_they_show_are_found():
    image, _, middles = discs()
    index = np.arange(image.size).reshape(image.shape)
    placer = placer_on(image, np.roll(index, (5, 9), (0, 1)), (True, True))
    found = ObjectCatalog(placer.guard, placer.features, placer.atlas, placer.canvas)
    assert len(found.all) == len(middles)
    assert all(one.whole for one in found.all)
    counts = found.shown()
    assert len(counts) == len(middles)
    assert {key: found.room(key) for key in counts} == dict(counts)
    at = {tuple(place) for place in (middles + np.array([5, 9])) % SIDE}
    assert all(min(np.hypot(*(np.array(key[1:]) - place)) for place in at) < 2 for key in counts)


@pytest.mark.parametrize("enough", [False, True])
def test_cut_objects_are_completed_or_removed(enough):
    image, objects, middles = discs(9)
    index = np.arange(image.size).reshape(image.shape)
    # 6 rows of one disc are hidden, and 13 of another one, of which less than half is left.
    (cut, small), bare = middles[[3, 8]], np.argwhere(objects_apart(objects) > 20)
    placer = placer_on(image, index)
    atlas, canvas = placer.atlas, placer.canvas
    row, column = bare[0]
    for (top, left), height in (cut, 6), (small, 13):
        corner = atlas.corners[0] + (row - 8, column - 8)
        ground = placer.patch(tuple(corner), (height, 17))
        canvas.paint(top - 8, left - 8, ground, np.ones(ground.shape, bool))
    area, more = np.bincount(objects.ravel()), 4 * enough
    for middle in middles[4 : 4 + more]:  # these show once more
        disc = placer.patch(tuple(atlas.corners[0] + middle - 11), (23, 23))
        free = np.argwhere(objects_apart(shown(placer, objects)) > 14)[-1]
        canvas.paint(*(free - 11), disc, np.ones(disc.shape, bool))
    assert np.count_nonzero(shown(placer, objects) == 4) < 0.9 * area[4]
    make_objects_whole(placer, (40, 40), Crew(1, placer, lambda: None), MANY)
    there = shown(placer, objects)
    assert [there[tuple(cut)], there[tuple(small)]] == ([0, 0] if enough else [4, 9])
    made = np.bincount(there.ravel())
    assert set(made[1:] % area[4]) == {0}  # all are whole
    assert made[1:].sum() >= 9 * area[4]
    usage = np.bincount(canvas.index.ravel(), minlength=len(canvas.usage))
    np.testing.assert_array_equal(canvas.usage, usage)


def objects_apart(objects):
    """How far each pixel is from the nearest disc, and from the border."""
    return ndimage.distance_transform_cdt(np.pad(objects == 0, 1), "chessboard")[1:-1, 1:-1]


@pytest.mark.parametrize("flat", [False, True])
def test_discs_cut_by_the_sample_border_are_not_whole_objects(flat):
    image, objects, middles = discs()
    image = np.where(objects > 0, np.float32(0.2), np.float32(0.8)) if flat else image
    full, (row, column) = np.bincount(objects.ravel()), middles[0]
    image, objects = image[row:, : column + 6], objects[row:, : column + 6]
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    found = ObjectCatalog(placer.guard, placer.features, placer.atlas, placer.canvas)
    on_border = np.unique(np.concatenate([objects[0], objects[-1], objects[:, 0], objects[:, -1]]))
    whole = [number for number in np.unique(objects) if number and number not in on_border]
    assert len(whole) < len(np.unique(objects)) - 1
    assert sum(one.whole for one in found.all) == len(whole)
    made = ts.synthesize(image, (256, 256), patch=32, seed=2)
    pieces, _ = ndimage.label(objects[made.source[..., 0], made.source[..., 1]] > 0)
    sizes = [
        np.count_nonzero(pieces[box] == number)
        for number, box in enumerate(ndimage.find_objects(pieces), 1)
        if all(side.start > 0 and side.stop < 256 for side in box)
    ]
    assert len(sizes) > 20
    assert np.mean(np.abs(np.array(sizes) / full[1:].mean() - 1) < 0.1) > 0.95


@pytest.mark.parametrize(("more", "there"), [(-0.25, 0), (0.25, 1)])
def test_a_cut_object_is_completed_if_half_of_it_is_due(more, there):
    image, objects, (middle, *_) = discs()
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    bare = placer.patch(tuple(placer.atlas.corners[0]), (8, 17))
    placer.canvas.paint(*(middle - 8).tolist(), bare, np.ones(bare.shape, bool))
    exchange = exchange_on(placer)
    (key,) = [key for key, count in exchange._shown.items() if count < exchange._catalog.room(key)]
    # What is shown now, and half of what there is room for.
    half = exchange._covered - exchange._shown[key] + exchange._catalog.room(key) / 2
    exchange._wanted = half + more
    exchange.run()
    assert shown(placer, objects)[tuple(middle)] == there


def test_a_patch_that_continues_shows_where_nothing_is():
    image, _, _ = discs()
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    source = placer.patch(tuple(placer.atlas.corners[0] + 30), (12, 14))
    before = placer.canvas.read(29, 29, 14, 16)
    before[4:9, 5:] = -1
    covers = np.ones(source.shape, bool)
    covers[:5] = False
    shows = placer.cut(before, source, covers)
    np.testing.assert_array_equal(shows, (before[1:-1, 1:-1] < 0) & covers)


def test_disjoint_patches_are_cut_together_as_singly():
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
        patches.append(ClosedPatch(at=(top, left), **one))
    same = patches[0].before[1:-1, 1:-1]
    patches.append(
        ClosedPatch(
            at=patches[0].at,
            **{
                **one,
                "source": same,
                "must": patches[0].must,
                "before": patches[0].before,
                "may": patches[0].may,
            },
        )
    )
    together = placer.cut_closed(patches)
    for patch, shows in zip(patches, together, strict=True):
        padded = patch.before.copy()
        padded[1:-1, 1:-1][patch.must] = -1
        alone = placer.cut(padded, patch.source, patch.may, closed=True) | patch.must
        np.testing.assert_array_equal(shows, alone)
        assert shows[patch.must].all()
        assert not shows.all()
    np.testing.assert_array_equal(together[-1], patches[0].must)
    np.testing.assert_array_equal(placer.cut_closed(patches[:1])[0], together[0])


def test_object_replacement_is_deterministic_and_has_no_effects():
    image, _, middles = discs()
    placer = placer_on(image, np.roll(np.arange(image.size).reshape(image.shape), 9, 0), (True, True))
    rng, canvas = np.random.default_rng(5), placer.canvas
    for middle in middles[1:8]:
        top, left = (middle + np.array([-3, -12])).tolist()
        source = placer.patch(tuple(placer.atlas.corners[0] + rng.integers(0, 100, 2)), (12, 25))
        canvas.paint(top, left, source, np.ones(source.shape, bool))
    one, again = (ObjectReplacer(placer, (40, 40)) for _ in range(2))
    shown, before = one.catalog.shown(), canvas.index.copy()
    cut = {key for key, count in shown.items() if count < WHOLE_SHARE * one.catalog.room(key)}
    assert {key for key in shown if one.catalog.is_cut(key)} == cut
    assert 0 < len(cut) < len(shown)
    tasks = [
        ReplacementTask(key, (MENDED, GROUND, 3)[number % 3], number % 2)
        for number, key in enumerate(sorted(shown))
    ]
    done = 0
    for task in tasks:
        given = np.array(task.numbers(), np.int32).tobytes()
        (found,), (same,) = one.replace_all(given), again.replace_all(given)
        assert (found is None) == (same is None)
        if found is not None:
            assert found[:2] == same[:2]
            assert found[3:] == same[3:]
            np.testing.assert_array_equal(found.shows, same.shows)
            assert 0 < found.shows.sum() < found.shows.size
            done += 1
    assert done > 8
    np.testing.assert_array_equal(canvas.index, before)


def test_objects_replaced_at_the_same_time_do_not_touch(monkeypatch):
    image, _, _ = discs()
    rounds, found = [], ObjectExchange._answers_to

    def noted(self, tasks):
        rounds.append([(task, self._replacer.reach_of(task)) for task in tasks])
        return found(self, tasks)

    monkeypatch.setattr(ObjectExchange, "_answers_to", noted)
    for tileable in "none", "both":
        rounds.clear()
        ts.synthesize(image, 400, patch=40, seed=3, tileable=tileable)
        assert max(map(len, rounds)) > 8
        for tasks in rounds:
            for number, (task, around) in enumerate(tasks):
                for other, far in tasks[:number]:
                    away = np.abs(np.subtract(task.key[1:], other.key[1:]))
                    away = np.minimum(away, 400 - away) if tileable == "both" else away
                    assert max(away) > around + far + 2


def test_objects_are_replaced_by_others_and_come_out_the_same(monkeypatch):
    image, _, _ = discs()
    workers = mmap(-1, 2)  # whether this process has replaced any, and whether another one has
    own, replaced = os.getpid(), ObjectReplacer.replace_all

    def noted(self, tasks):
        workers[os.getpid() != own] |= bool(tasks)
        return replaced(self, tasks)

    monkeypatch.setattr(ObjectReplacer, "replace_all", noted)
    one = ts.synthesize(image, 400, patch=40, seed=3)
    assert workers[:] == b"\1\0"
    two = ts.synthesize(image, 400, patch=40, seed=3, processes=2)
    np.testing.assert_array_equal(one.index, two.index)
    assert workers[1] == FORKS


def test_shared_copies_have_room_for_all_replacements(monkeypatch):
    image, _, _ = discs()
    shared, grown = [], []
    share, grow = IndexCanvas.share, IndexCanvas._grow

    def noted_share(self, patches):
        share(self, patches)
        shared.append(self)

    def noted_grow(self, patches):
        grown.extend(one for one in shared if one is self)
        grow(self, patches)

    monkeypatch.setattr(IndexCanvas, "share", noted_share)
    monkeypatch.setattr(IndexCanvas, "_grow", noted_grow)
    monkeypatch.setattr("toposeam.texture.canvas.index_canvas._FIRST_PATCHES", 1)
    made = ts.synthesize(image, 400, patch=40, seed=3, processes=2)
    assert len(shared) == FORKS
    assert not grown
    assert len(np.unique(made.labels)) > 100


def test_no_more_objects_are_replaced_than_there_is_room_for():
    image, _, middles = discs()
    counts = []
    for room in (MANY, 16, 15):
        placer = placer_on(image, np.arange(image.size).reshape(image.shape))
        for middle in middles[1:]:  # a bite of each
            top, left = (middle + np.array([-3, -12])).tolist()
            source = placer.patch(tuple(placer.atlas.corners[0] + (100, 2)), (5, 12))
            placer.canvas.paint(top, left, source, np.ones(source.shape, bool))
        before = placer.canvas.patches
        done = make_objects_whole(placer, (40, 40), Crew(1, placer, lambda: None), before + room)
        assert placer.canvas.patches - before == done <= room
        counts.append(done)
    assert counts[0] > counts[1] > 0
    assert counts[2] == 0


def test_others_prepare_themselves_while_this_process_does(monkeypatch):
    image, _, _ = discs()
    done = []
    for owner, name in (Crew, "begin"), (Crew, "ask"), (Crew, "pass_on"), (Crew, "own"):
        method = getattr(owner, name)

        def noted(self, *given, name=name, method=method):
            done.append(name)
            return method(self, *given)

        monkeypatch.setattr(owner, name, noted)
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    with Crew(1, placer, lambda: None) as crew:
        make_objects_whole(placer, (40, 40), crew, MANY)
    assert done[:4] == ["begin", "ask", "pass_on", "own"]
    assert done.count("begin") == 1


def test_an_object_is_not_completed_by_one_shown_near_by():
    image, _, _ = discs()
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    exchange = exchange_on(placer)
    key = next(iter(exchange._shown))
    task, alike = ReplacementTask(key, MENDED), set(exchange._replacer.similar(key[0]))
    near = {other[0] for other in exchange._positions.near(key[1:])} & alike
    assert 0 < len(near) < MAX_FORBIDDEN
    (far,) = sorted(alike - near)[:1]
    assert set(exchange._forbidding(task, set()).forbidden) == near
    assert set(exchange._forbidding(task, {far}).forbidden) == {far, *near}
    assert exchange._forbidding(task, set(range(MAX_FORBIDDEN))) == ReplacementTask(key, GROUND)
    assert exchange._forbidding(ReplacementTask(key, 3, 1), set()) == ReplacementTask(key, 3, 1)


def test_a_copy_continued_by_two_at_once_stays_within_its_limit():
    image, objects, middles = discs(9)
    placer = placer_on(image, np.arange(image.size).reshape(image.shape))
    canvas, corner = placer.canvas, placer.atlas.corners[0]
    bare = ndimage.maximum_filter(objects, 21, mode="constant", cval=1) == 0
    ground = placer.patch(tuple(corner + np.argwhere(bare)[0] - (8, 8)), (6, 17))
    apart = np.hypot(*(middles[:, np.newaxis] - middles).transpose(2, 0, 1))
    for middle in middles[list(np.unravel_index(apart.argmax(), apart.shape))]:
        canvas.paint(*(middle - 8).tolist(), ground, np.ones(ground.shape, bool))
    exchange = exchange_on(placer)
    exchange._replacer.largest = canvas.area_of(0) + ground.size * 3 // 2
    assert exchange.run() >= 1
    assert canvas.area_of(0) <= exchange._replacer.largest
    assert np.count_nonzero(shown(placer, objects)) > np.count_nonzero(objects) - ground.size


def test_a_repeated_object_is_replaced_by_one_that_fits(monkeypatch):
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
    monkeypatch.setattr("toposeam.texture.objects.object_exchange.ObjectExchange._choose", lambda *_: {})
    assert make_objects_whole(placer, (40, 40), Crew(1, placer, lambda: None), MANY) == 1
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
