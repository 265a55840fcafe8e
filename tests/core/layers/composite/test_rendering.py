"""What a composition shows: boxes of its picture, windows that sinks are given, and the same elsewhere."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.layers.canvas import Box, TileMap
from toposeam.layers.canvas import tile_map as maps
from toposeam.layers.composite import composition, painter
from toposeam.layers.composite import summary as summaries

#: The blends, of which one looks far around each window.
MARKED = [
    pytest.param(blend, marks=[pytest.mark.medium] if blend == "multiband" else [])
    for blend in ts.layers.BLENDS
]
#: Height and width of the canvas of all these, px.
HEIGHT, WIDTH = 100, 180
ALL = np.s_[:, :]


def scene(channels=3):
    coarse = np.random.default_rng(2).random((14, 24, channels))
    whole = ndimage.zoom(coarse, (8, 8, 1), order=1)[:HEIGHT, :WIDTH]
    return np.clip(40 + 170 * whole, 0, 255)


def layers_of(*, alpha=False, round_=False):
    """Three layers of unlike tones, one of them with holes; if round they reach over the right edge."""
    rng, whole, layers = np.random.default_rng(3), scene(), []
    columns = ((0, 80), (60, 140), (120, 200 if round_ else 180))
    for index, (first, stop) in enumerate(columns):
        part = whole[:, np.arange(first, stop) % WIDTH] * (0.9 + 0.08 * index)
        part = np.clip(part + rng.normal(0, 3, part.shape), 0, 255).astype(np.uint8)
        opacity = np.full(part.shape[:2], 255, np.uint8)
        opacity[:20, :15] = 0
        opacity[60:, 30:50] = 140
        shown = opacity if alpha and index == 1 else None
        layers.append(ts.Layer(part, alpha=shown, at=(first - 7, 4), name="abc"[index]))
    return layers


def composed(blend="none", *, alpha=False, round_=False):
    layers = layers_of(alpha=alpha, round_=round_)
    return ts.stitch(layers, blend=blend, wrap=WIDTH if round_ else None)


def picture(shown):
    """The image, and its opacity also where it is None."""
    image, alpha = shown.image, shown.alpha
    return image, np.full(image.shape[:2], 255, np.uint8) if alpha is None else alpha


def expected(whole, box):
    """A box of an array, and zeros beyond it."""
    far = 300
    padded = np.pad(whole, [(far, far)] * 2 + [(0, 0)] * (whole.ndim - 2))
    return padded[Box(*box).moved(far, far).slices]


class Copying:
    """An executor that hands everything on as another process would have it."""

    def __init__(self):
        self.items = 0

    def map(self, function, items):
        for item in items:
            self.items += 1
            yield pickle.loads(pickle.dumps(function(pickle.loads(pickle.dumps(item)))))  # noqa: S301


EXECUTORS = [None, Copying(), ThreadPoolExecutor(2)]


@pytest.fixture(params=["whole tiles", "parts of tiles"])
def narrow_windows(request, monkeypatch):
    """Windows of 128 × 32 px, which are four tiles or within one."""
    monkeypatch.setattr(composition, "BLOCK", 32)
    if request.param == "whole tiles":
        monkeypatch.setattr(painter, "BLOCK", 32)


@pytest.mark.parametrize("round_", [False, True], ids=["flat", "round"])
@pytest.mark.parametrize("alpha", [False, True], ids=["opaque", "alpha"])
@pytest.mark.parametrize("blend", MARKED)
def test_a_sink_is_given_the_picture(blend, alpha, round_, narrow_windows):
    whole = composed(blend, alpha=alpha, round_=round_)
    assert whole.shape == (HEIGHT, WIDTH)
    assert whole.period == (WIDTH if round_ else None)
    with pytest.MonkeyPatch.context() as usual:
        usual.setattr(painter, "BLOCK", maps.BLOCK)
        image, opacity = picture(composed(blend, alpha=alpha, round_=round_))
    assert (opacity.min() < 255) == alpha
    before = EXECUTORS[1].items
    for executor in EXECUTORS:
        sink, shares = ts.layers.ArraySink(), []
        whole.render(sink, executor=executor, progress=shares.append)
        np.testing.assert_array_equal(sink.image, image)
        np.testing.assert_array_equal(sink.alpha, opacity)
        assert shares == [number / 8 for number in range(1, 9)], "four rows of two windows"
        if isinstance(executor, Copying):
            assert executor.items - before == (0 if blend == "gradient" else 8), "which needs the whole"


def test_a_sink_of_gray_and_of_floats():
    layers = [ts.Layer(layer.image[..., 0] / 255, at=layer.at) for layer in layers_of()]
    whole, sink = ts.stitch(layers), ts.layers.ArraySink()
    whole.render(sink)
    assert (sink.image.dtype, sink.alpha.dtype) == (np.float64, np.float64)
    np.testing.assert_array_equal(sink.image, whole.image)
    assert (sink.alpha == 1).all()


class Recorded(ts.layers.Sink):
    """Notes how it is called, and fails at a window."""

    def __init__(self, fails_at=None):
        self.calls, self.fails_at = [], fails_at

    def open(self, shape, dtype):
        self.calls.append(("open", shape, dtype))

    def write(self, box, pixels, alpha):
        if box == self.fails_at:
            raise ts.ImageError("the sink is full; empty it")
        assert pixels.shape[:2] == alpha.shape == box.shape
        return box

    def take(self, box, answer):
        assert answer == box
        self.calls.append(("take", box))

    def close(self):
        self.calls.append(("close",))


@pytest.mark.parametrize("executor", EXECUTORS, ids=lambda one: type(one).__name__)
def test_a_sink_is_opened_and_closed_once_and_told_in_order(executor, monkeypatch):
    monkeypatch.setattr(composition, "BLOCK", 32)
    sink = Recorded()
    composed().render(sink, executor=executor)
    boxes = [
        Box(top, left, min(top + 32, HEIGHT), min(left + 128, WIDTH))
        for top in range(0, HEIGHT, 32)
        for left in (0, 128)
    ]
    assert sink.calls == [
        ("open", (HEIGHT, WIDTH, 3), np.dtype(np.uint8)),
        *(("take", box) for box in boxes),
        ("close",),
    ]


@pytest.mark.parametrize("executor", EXECUTORS, ids=lambda one: type(one).__name__)
def test_a_sink_that_fails_is_not_closed_as_if_it_were_whole(executor, monkeypatch):
    monkeypatch.setattr(composition, "BLOCK", 32)
    sink, shares = Recorded(fails_at=Box(32, 0, 64, 128)), []
    with pytest.raises(ts.ImageError, match="the sink is full; empty it"):
        composed().render(sink, executor=executor, progress=shares.append)
    assert [call[0] for call in sink.calls] == ["open", "take", "take"]
    assert shares == [1 / 8, 2 / 8]


#: Inside; over each edge; larger than the canvas; one pixel; nothing.
VIEWS = [
    (10, 20, 90, 120),
    (-9, 30, 40, 200),
    (50, -40, 130, 60),
    (-20, -30, 140, 230),
    (99, 179, 100, 180),
    (40, 60, 40, 90),
]


@pytest.fixture(params=["array", "tiles"])
def kept_as(request, monkeypatch):
    """How label maps are kept."""
    if request.param == "tiles":
        monkeypatch.setattr(maps, "DENSE_PIXELS", 0)
        monkeypatch.setattr(maps, "TILE", 32)
    return request.param


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("round_", [False, True], ids=["flat", "round"])
def test_a_crop_shows_a_box_of_the_picture(view, round_, kept_as):
    whole = composed("feather", alpha=True, round_=round_)
    assert isinstance(whole.solution.labels, TileMap) == (kept_as == "tiles")
    part, (top, left, bottom, right) = whole.crop(view), view
    assert part.view == Box(*view)
    assert part.shape == part.image.shape[:2] == (bottom - top, right - left)
    assert part.origin == (whole.origin[0] + left, whole.origin[1] + top)
    assert part.canvas is whole.canvas
    image, opacity = picture(whole)
    np.testing.assert_array_equal(part.image, expected(image, view))
    np.testing.assert_array_equal(part.window(*ALL)[1], expected(opacity, view))
    labels = expected(whole.label_map + 1, view) - 1
    np.testing.assert_array_equal(part.label_map, labels)
    assert part.label_map.dtype == np.int16
    for index, mask in enumerate(part.masks):
        np.testing.assert_array_equal(mask, labels == index)
    assert part.shown == tuple(int((labels == index).sum()) for index in range(3))
    assert part.hidden == tuple(index for index in range(3) if not (labels == index).any())
    window = np.s_[3:31, 5:-4]
    np.testing.assert_array_equal(part.window(*window)[0], part.image[window])
    np.testing.assert_array_equal(part.labels(*window), labels[window])
    assert repr(part).startswith(f"Composition(3 layers, {right - left} × {bottom - top} px, ")


@pytest.mark.parametrize("view", VIEWS[:-1])
@pytest.mark.parametrize("blend", MARKED)
def test_a_crop_is_rendered_by_windows_of_its_own(blend, view, narrow_windows):
    whole = composed(blend, alpha=True)
    part, (image, opacity) = whole.crop(view), picture(whole)
    for executor in (None, Copying()):
        sink = ts.layers.ArraySink()
        part.render(sink, executor=executor)
        np.testing.assert_array_equal(sink.image, expected(image, view))
        np.testing.assert_array_equal(sink.alpha, expected(opacity, view))


@pytest.mark.parametrize("inner", [(5, 6, 40, 50), (-12, -50, 200, 300)])
def test_a_crop_of_a_crop_counts_from_its_corner(inner):
    whole = composed(alpha=True)
    once = whole.crop((10, 20, 90, 120))
    twice = once.crop(inner)
    assert twice.view == Box(*inner).moved(10, 20)
    assert (twice.origin, twice.shape) == (whole.crop(twice.view).origin, whole.crop(twice.view).shape)
    np.testing.assert_array_equal(twice.image, whole.crop(twice.view).image)
    np.testing.assert_array_equal(twice.label_map, whole.crop(twice.view).label_map)


@pytest.mark.parametrize("blend", ts.layers.BLENDS)
@pytest.mark.parametrize("view", [(200, 20, 230, 60), (-50, -50, -10, -5), (10, 180, 30, 190)])
def test_what_lies_beside_the_canvas_is_empty(view, blend, kept_as):
    part = composed(blend).crop(view)
    assert part.image.shape == (*Box(*view).shape, 3)
    assert not part.image.any()
    assert part.alpha is not None
    assert not part.alpha.any()
    assert (part.label_map == -1).all()
    assert part.label_map.shape == part.shape
    assert part.shown == (0, 0, 0)
    assert part.hidden == (0, 1, 2)
    sink = ts.layers.ArraySink()
    part.render(sink)
    assert not sink.image.any()
    assert not sink.alpha.any()
    summary = part.summary()
    assert summary["look_at"] is None
    assert [seam["likeness"] for seam in summary["seams"]] == [1.0] * len(part.pairs)


def test_all_of_the_canvas_is_no_crop():
    whole = composed(alpha=True)
    same = whole.crop((0, 0, HEIGHT, WIDTH))
    assert whole.summary()["crop"] is same.summary()["crop"] is None
    assert same.view == whole.view == whole.canvas.box
    np.testing.assert_array_equal(same.image, whole.image)


def test_seams_are_those_of_the_canvas_whatever_is_shown():
    whole = composed(alpha=True)
    part = whole.crop((10, 20, 50, 130))
    assert isinstance(part.seams, tuple)
    assert isinstance(part.outlines, tuple)
    assert (part.pairs, part.cost) == (whole.pairs, whole.cost)
    drawn, on_canvas = part.to_svg(), ts.vector.read_svg(whole.to_svg())
    assert 'width="110" height="40" viewBox="20 10 110 40"' in drawn
    read = ts.vector.read_svg(drawn)
    assert (read.width, read.height, read.names) == (on_canvas.width, on_canvas.height, on_canvas.names)
    for line, same in zip(read.polylines, on_canvas.polylines, strict=True):
        np.testing.assert_array_equal(line.points, same.points)
    for seam, one, outline in zip(whole.seams, part.seams, part.outlines, strict=True):
        assert (one.cost, one.length) == (seam.cost, seam.length)
        assert outline.cost == seam.cost
        assert outline.length == pytest.approx(sum(path.length for path in seam.paths))


def with_two_faults():
    """Two layers that agree but for one row near the top and a worse one near the bottom."""
    whole = scene()
    first, second = whole[:, :110].copy(), whole[:, 70:].copy()
    second[14:18] += 25
    second[82:86] -= 90
    first, second = (np.clip(one, 0, 255).astype(np.uint8) for one in (first, second))
    return ts.stitch([ts.Layer(first, name="left"), ts.Layer(second, at=(70, 0), name="right")])


def test_a_summary_judges_what_the_crop_shows():
    """Places are counted from the crop's corner, and a worse one that it does not show is left out."""
    whole = with_two_faults()
    summary = whole.summary()
    assert summary["size"] == [WIDTH, HEIGHT]
    x, y = summary["look_at"]
    assert 70 <= x < 110
    assert 84 - 8 <= y <= 84 + 8  # the middle of a square of 16 px; of paths as cheap, any is a seam
    assert summary["worst_likeness"] < 0.5
    low = whole.crop((30, 50, 100, 160)).summary()
    assert (low["size"], low["crop"]) == ([110, 70], [50, 30, 110, 70])
    assert low["look_at"] == [x - 50, y - 30]
    high = whole.crop((5, 40, 60, 140)).summary()
    assert high["worst_likeness"] > summary["worst_likeness"]
    assert high["look_at"] is None or high["look_at"][1] < 25
    for part in (low, high):
        assert part["cost"] == summary["cost"]
        (seam,) = part["seams"]
        assert {name: part[name] for name in ("likeness", "worst_likeness", "look_at")} == {
            name: seam[name] for name in ("likeness", "worst_likeness", "look_at")
        }
        assert [layer["at"] for layer in part["layers"]] == [[0, 0], [70, 0]], "in the layers' coordinates"
        assert sum(layer["shown_px"] for layer in part["layers"]) == part["size"][0] * part["size"][1]
    assert whole.verdict == whole.seams[0].verdict


@pytest.mark.parametrize("round_", [False, True], ids=["flat", "round"])
def test_a_composition_is_the_same_elsewhere(round_):
    whole = composed("feather", alpha=True, round_=round_)
    for one in (whole, whole.crop((-3, 5, 60, 190))):
        moved = one.moved(1000, -20)
        assert moved.origin == (one.origin[0] + 1000, one.origin[1] - 20)
        assert (moved.shape, moved.view, moved.period) == (one.shape, one.view, one.period)
        for layer, before in zip(moved.layers, one.layers, strict=True):
            assert layer.at == (before.at[0] + 1000, before.at[1] - 20)
        np.testing.assert_array_equal(moved.image, one.image)
        np.testing.assert_array_equal(moved.window(*ALL)[1], one.window(*ALL)[1])
        np.testing.assert_array_equal(moved.label_map, one.label_map)
        assert moved.cost == one.cost
    canvas = whole.canvas.moved(1000, -20)
    assert (canvas.origin, canvas.shape) == (moved.canvas.origin, (HEIGHT, WIDTH))
    assert canvas.period == whole.period
    assert list(canvas.places) == list(whole.canvas.places)


def test_a_composition_has_its_canvas():
    layers = layers_of()
    whole = ts.stitch(layers)
    assert whole.canvas.box == whole.view == Box(0, 0, HEIGHT, WIDTH)
    assert whole.origin == whole.canvas.origin == (-7, 4)
    assert whole.names == whole.canvas.names == ("a", "b", "c")
    assert [one.image is layer.image for one, layer in zip(whole.layers, layers, strict=True)] == [True] * 3
    assert whole.labelling.canvas == whole.canvas.box


def test_the_schema_has_the_same_keys_whatever_is_joined():
    """Of two or three layers, judged or not, cropped, round, in either summary: at any depth."""
    two, three = layers_of()[:2], layers_of()
    plain = ts.seam.MatchCost(law="gradient")
    compositions = [
        ts.stitch(two),
        ts.stitch(two, cost=plain),
        ts.stitch(two, method="heat"),
        ts.stitch(three),
        ts.stitch(three, cost=plain),
        ts.stitch(three, match_tones=True, give=2),
        composed("soft", alpha=True, round_=True),
        ts.stitch(three).crop((9, 9, 50, 200)),
        ts.layers.restitch(three, ts.stitch(three).masks, {}),
    ]
    keys = set()
    for one in compositions:
        for summary in (one.summary(), one.summary(optima=False)):
            assert summary["schema"] == 1
            (layer,) = {tuple(each) for each in summary["layers"]}
            (seam,) = {tuple(each) for each in summary["seams"]}
            keys.add((tuple(summary), layer, seam))
            assert len(summary["layers"]) == len(one.layers)
            assert len(summary["seams"]) == len(one.pairs)
        assert all(seam["optimum"] is None for seam in summary["seams"])
    assert len(keys) == 1
    ((top, layer, seam),) = keys
    documented = summaries.__doc__
    for name in (*top, *layer, *seam):
        assert name in documented, name
