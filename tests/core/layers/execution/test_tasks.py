"""Independent parts of the work done elsewhere: the same result, to the bit."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.layers.canvas import Box, TileMap, canvas, part_of
from toposeam.layers.canvas import tile_map as maps
from toposeam.layers.composite import composition, painter
from toposeam.layers.execution import results
from toposeam.layers.execution.tasks import groups
from toposeam.layers.exposure import gains as tones
from toposeam.layers.labelling import pair_cost
from toposeam.layers.registration import correlations
from toposeam.layers.registration import pair_matching as pairing
from toposeam.layers.search import SearchOptions
from toposeam.layers.search import cost_coarsening as reduction
from toposeam.layers.search import options as search_options


def copied(pickled):
    return pickle.loads(pickled)  # noqa: S301 - what this test has written


class Elsewhere:
    """An executor that does everything in an order of its own, on copies, as another process would have."""

    def __init__(self):
        self.items, self.largest = 0, 0

    def map(self, function, items):
        calls = [pickle.dumps((function, item)) for item in items]
        self.items += len(calls)
        self.largest = max(self.largest, *map(len, calls), 0)
        done = {}
        for number in sorted(range(len(calls)), key=lambda k: (k % 3, -k)):
            function, item = copied(calls[number])
            done[number] = pickle.dumps(function(item))
        return (copied(done[number]) for number in range(len(calls)))


class Kept(ts.Windows):
    """Pixels of which others are told only where they are, as those in files."""

    everywhere: ClassVar = []

    def __init__(self, image):
        super().__init__(image.shape, image.dtype)
        self.number = len(self.everywhere)
        self.everywhere.append(image)

    def read(self, rows, columns):
        return self.everywhere[self.number][rows, columns].copy()


#: On the canvas of six layers, what seams must not run through: across overlaps, and where three meet.
AVOID = np.zeros((330, 460), bool)
AVOID[60:90, 120:190] = AVOID[150:190, 300:310] = True


@pytest.fixture
def large(monkeypatch):
    """Small canvases done as large ones are."""
    for module in (maps, pair_cost, reduction):
        for name in ("DENSE_PIXELS", "KEPT_PIXELS"):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, 3000)
    for module in (maps, canvas, composition, painter):
        monkeypatch.setattr(module, "BLOCK", 128)
    monkeypatch.setattr(search_options, "FAST", SearchOptions(coarsest=2000, together=2000))
    monkeypatch.setattr(search_options, "BEST", replace(search_options.BEST, coarsest=2000, together=2000))
    monkeypatch.setattr(tones, "_SAMPLE", 2000)


class Streams(Elsewhere):
    """One that asks for items as it can begin them, two at a time, and tells the later one first."""

    def __init__(self):
        super().__init__()
        self.most = 0

    def stream(self, function, ready):
        waiting = []
        while True:
            while len(waiting) < 2 and (found := ready()) is not None:
                waiting.append((found[0], pickle.dumps((function, found[1]))))
            if not waiting:
                return
            self.most = max(self.most, len(waiting))
            self.items += 1
            number, call = waiting.pop()
            function, item = copied(call)
            yield number, copied(pickle.dumps(function(item)))


def six_layers(*, alpha=False, seed=3):
    """Three by two, each exposed differently, with things that moved."""
    rng = np.random.default_rng(seed)
    scene = ndimage.gaussian_filter(rng.random((330, 460, 3)), (2, 2, 0))
    scene = 200 * (scene - scene.min()) / np.ptp(scene) + 20
    layers = []
    for row in range(2):
        for column in range(3):
            x, y = 130 * column, 130 * row
            part = scene[y : y + 200, x : x + 200] * rng.uniform(0.85, 1.15)
            for _ in range(4):
                cy, cx = rng.integers(20, 170, 2)
                part[cy : cy + 14, cx : cx + 14] = rng.uniform(20, 220, 3)
            image = np.clip(part + rng.normal(0, 2, part.shape), 0, 255).astype(np.uint8)
            opacity = None
            if alpha:
                opacity = np.full((200, 200), 255, np.uint8)
                opacity[:30, :30] = 0
                opacity = Kept(opacity)
            layers.append(ts.Layer(Kept(image), alpha=opacity, at=(x, y), name=f"{row}{column}"))
    return layers


def same(layers, executor, **options):
    here, there = (ts.stitch(layers, executor=one, **options) for one in (None, executor))
    whole = slice(None), slice(None)
    np.testing.assert_array_equal(here.labels(*whole), there.labels(*whole))
    assert (here.pairs, here.rounds) == (there.pairs, there.rounds)
    assert here.cost == sum(one.cost for one in there.figures(executor).values())
    image, alpha = here.window(*whole)
    assert len(np.unique(here.labels(*whole))) >= 6
    sink = ts.layers.ArraySink()
    there.render(sink, executor=executor)
    np.testing.assert_array_equal(image, sink.image)
    np.testing.assert_array_equal(alpha, sink.alpha)
    return here


@pytest.mark.medium
@pytest.mark.parametrize(
    ("options", "alpha"),
    [
        ({}, False),
        ({"match_tones": True, "blend": "multiband", "blend_width": 8}, True),
        ({"match_shading": True, "blend": "feather"}, True),
        ({"blend": "soft"}, False),
        ({"effort": "best"}, False),
        ({"method": "shortest-path"}, True),
        ({"avoid": AVOID, "blend": "soft"}, False),
        ({"avoid": AVOID, "weight": 1.0 + AVOID[::-1]}, True),
        ({"wrap": 430, "blend": "multiband", "blend_width": 8}, False),
        ({"wrap": 430, "blend": "soft"}, True),
    ],
    ids=[
        "cut",
        "tones and multiband",
        "shading and feather",
        "soft",
        "best",
        "shortest path",
        "avoid",
        "avoid and weight",
        "round",
        "round and soft",
    ],
)
@pytest.mark.parametrize("kind", [Elsewhere, Streams])
def test_the_result_does_not_depend_on_who_does_the_work(large, options, alpha, kind):
    executor = kind()
    same(six_layers(alpha=alpha), executor, **options)
    assert executor.items > 15
    if kind is Streams and "wrap" not in options:
        assert executor.most == 2, "overlaps that do not touch are divided at once"


@pytest.mark.medium
def test_executors_of_the_standard_library_will_do(large):
    with ThreadPoolExecutor(3) as threads:
        same(six_layers(), threads, match_tones=True, blend="multiband", blend_width=8)


@pytest.mark.medium
def test_items_say_where_pixels_are_and_carry_none(large):
    """No item is as large as a single layer's pixels, of which there are six."""
    executor = Elsewhere()
    layers = six_layers()
    ts.stitch(layers, executor=executor, match_tones=True, blend="multiband", blend_width=8)
    assert executor.largest < layers[0].image.everywhere[layers[0].image.number].nbytes


def test_correlations_are_the_same():
    layers = six_layers()
    assert correlations(layers, executor=Elsewhere()) == correlations(layers)


@pytest.mark.medium
@pytest.mark.parametrize("forests", [1, 6])
def test_places_that_nobody_says_are_the_same(monkeypatch, forests):
    """Also where pairs are tried that turn out to be needed no more."""
    monkeypatch.setattr(pairing, "_FORESTS", forests)
    pictures = [*six_layers(), six_layers()[2]]
    executor = Elsewhere()
    here, there = (ts.find_places(pictures, executor=one) for one in (None, executor))
    np.testing.assert_array_equal(here.places, there.places)
    assert [layer.at for layer in here.layers] == [layer.at for layer in there.layers]
    assert (here.correlations, here.misfit) == (there.correlations, there.misfit)
    assert executor.items >= 7 + 6 + 6 + 9, "digests, looks, features that are shared, and pairs"


def test_pictures_are_aligned_the_same():
    layers = six_layers()
    moved = [replace(layer, at=(layer.at[0] + k % 3, layer.at[1] - k)) for k, layer in enumerate(layers)]
    executor = Elsewhere()
    here, there = (ts.layers.align(moved, radius=8, executor=one) for one in (None, executor))
    np.testing.assert_array_equal(here.shifts, there.shifts)
    assert (here.shifts != 0).any()
    assert here.correlations == there.correlations
    assert executor.items == 11, "pairs that may overlap"


@pytest.mark.parametrize("executor", [3, "two", ThreadPoolExecutor])
@pytest.mark.parametrize(
    "door",
    [ts.stitch, ts.layers.correlations, ts.layers.match_tones, ts.find_places, ts.layers.align],
)
def test_what_does_no_work_is_refused(door, executor):
    picture = np.zeros((20, 30), np.uint8)
    with pytest.raises(ts.OptionError, match="executor is of type"):
        door([ts.Layer(picture), ts.Layer(picture, at=(20, 0))], executor=executor)


def test_a_part_of_a_map_is_the_map_there():
    rng = np.random.default_rng(0)
    values = np.repeat(np.repeat(rng.integers(0, 3, (30, 40)), 29, axis=0), 31, axis=1).astype(np.int16)
    tiled = TileMap(values.shape, 0, np.int16)
    tiled[:, :] = values
    box = Box(100, 333, 517, 700)
    for whole in (values, tiled):
        part = copied(pickle.dumps(part_of(whole, box)))
        np.testing.assert_array_equal(part[box.slices], values[box.slices])
        part[box.slices] = -1
        np.testing.assert_array_equal(whole[box.slices], values[box.slices])
    assert len(pickle.dumps(part_of(np.broadcast_to(np.True_, (9000, 9000)), box))) < 2000


def test_results_come_when_they_are_asked_for():
    seen = []
    given = results(None, lambda item: seen.append(item) or item, iter([1, 2]))
    assert not seen
    assert next(iter(given)) == 1
    assert seen == [1]


def test_work_that_touches_other_work_is_not_done_at_once():
    row = [Box(0, left, 9, left + 6) for left in range(0, 25, 5)]
    assert groups(row) == [[0, 2, 4], [1, 3]]
    assert groups([*row, Box(0, 0, 9, 99)]) == [[5], [0, 2, 4], [1, 3]]
    assert groups([]) == []


def test_overlaps_of_many_pictures_form_a_few_groups():
    """Of six rows of nine pictures that overlap by a third."""
    places = [
        Box(20 * row, 20 * column, 20 * row + 30, 20 * column + 30) for row in range(6) for column in range(9)
    ]
    shared = [a.shared(b) for k, a in enumerate(places) for b in places[:k]]
    boxes = [box.grown(1) for box in shared if all(box.shape)]
    found = groups(boxes)
    assert sorted(k for group in found for k in group) == list(range(len(boxes)))
    assert len(boxes) == 8 * 6 + 9 * 5 + 2 * 8 * 5
    assert len(found) <= 8
