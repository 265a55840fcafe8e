"""Compositions by windows: the same pixels as at once, whatever is kept how."""

import numpy as np
import pytest
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import Box, TileMap, new_map, several, uniform
from toposeam.layers.canvas import tile_map as maps
from toposeam.layers.composite import painter
from toposeam.layers.composite import seams_of_map as made
from toposeam.layers.labelling import pair_cost
from toposeam.layers.search import cost_coarsening as reduction


class Read(ts.Windows):
    """An array that is read by windows, and how much of it at once."""

    def __init__(self, array):
        super().__init__(array.shape, array.dtype)
        self.array, self.most = array, 0

    def read(self, rows, columns):
        part = self.array[rows, columns].copy()
        self.most = max(self.most, part.shape[0] * part.shape[1])
        return part


def layers(count=4, *, windows=False, alpha=False):
    rng = np.random.default_rng(5)
    photograph = ndimage.zoom(data.astronaut()[100:400, 100:400], (1.2, 1.2, 1), order=1)
    placed = []
    for index in range(count):
        x, y = 100 * (index % 2), 80 * (index // 2)
        crop = np.clip(
            photograph[y : y + 140, x : x + 160] * (0.9 + 0.05 * index) + rng.normal(0, 2, 3), 0, 255
        )
        crop = crop.astype(np.uint8)
        opaque = np.full(crop.shape[:2], 255, np.uint8)
        opaque[:20, :30] = opaque[-9:, 120:] = 0
        placed.append(
            ts.Layer(
                Read(crop) if windows else crop,
                alpha=None if not alpha else Read(opaque) if windows else opaque,
                at=(x, y),
                name=str(index),
            )
        )
    return placed


@pytest.fixture
def sparse(monkeypatch):
    """Maps of tiles however small the canvas is."""
    monkeypatch.setattr(maps, "DENSE_PIXELS", 0)
    monkeypatch.setattr(maps, "TILE", 32)
    monkeypatch.setattr(maps, "BLOCK", 128)
    monkeypatch.setattr(pair_cost, "KEPT_PIXELS", 2000)


def test_a_tile_map_reads_and_writes_like_an_array(monkeypatch):
    monkeypatch.setattr(maps, "TILE", 8)
    rng = np.random.default_rng(0)
    array, tiles = np.full((37, 53), -1, np.int16), TileMap((37, 53), -1, np.int16)
    for _ in range(300):
        top, bottom = sorted(rng.integers(0, 38, 2))
        left, right = sorted(rng.integers(0, 54, 2))
        values = (
            rng.integers(0, 3) if rng.random() < 0.7 else rng.integers(0, 2, (bottom - top, right - left))
        )
        array[top:bottom, left:right] = values
        tiles[top:bottom, left:right] = values
        box = Box(*rng.integers(0, 20, 2).tolist(), *rng.integers(20, 37, 2).tolist())
        np.testing.assert_array_equal(tiles[box.slices], array[box.slices])
        value = uniform(tiles, box)
        assert value is None or (array[box.slices] == value).all()
    np.testing.assert_array_equal(tiles[:, :], array)
    tiles[:, :] = 2
    assert uniform(tiles, Box(0, 0, 37, 53)) == 2
    assert list(several(tiles, Box(0, 0, 37, 53))) == []


@pytest.mark.medium
def test_a_map_of_a_gigapixel_is_small():
    label_map = new_map((30_000, 40_000), -1, np.int16)
    for index in range(12):
        label_map[:, 3333 * index : 3333 * index + 3333] = index
    assert label_map.nbytes < 120e6  # of 2.4 GB


@pytest.mark.medium
@pytest.mark.parametrize("blend", ["none", "feather", "soft", "multiband", "gradient"])
@pytest.mark.parametrize("alpha", [False, True])
def test_composing_by_windows_equals_stitching_at_once(blend, alpha, sparse):
    with pytest.MonkeyPatch.context() as usual:
        usual.setattr(maps, "DENSE_PIXELS", 1 << 22)
        whole = ts.stitch(layers(alpha=alpha), blend=blend, match_tones=True)
    given = layers(alpha=alpha, windows=True)
    composed = ts.stitch(given, blend=blend, match_tones=True)
    assert isinstance(composed.solution.labels, TileMap)
    height, width = composed.shape
    for top in range(0, height, 130):
        rows = slice(top, min(top + 130, height))
        for left in range(0, width, 170):
            columns = slice(left, min(left + 170, width))
            image, opacity = composed.window(rows, columns)
            np.testing.assert_array_equal(image, whole.image[rows, columns])
            np.testing.assert_array_equal(composed.labels(rows, columns), whole.label_map[rows, columns])
            if whole.alpha is not None:
                np.testing.assert_array_equal(opacity, whole.alpha[rows, columns])
    assert composed.pairs == whole.pairs
    for seam, known in zip(composed.seams, whole.seams, strict=True):
        assert seam.cost == pytest.approx(known.cost)
        np.testing.assert_array_equal(seam.labels, known.labels)


@pytest.mark.parametrize("count", [2, 4])
def test_no_layer_is_read_as_a_whole(count, sparse, monkeypatch):
    monkeypatch.setattr(painter, "BLOCK", 64)
    monkeypatch.setattr(pair_cost, "_BLOCK_PIXELS", 2000)
    monkeypatch.setattr(reduction, "_OVERLAP_ROWS", 8)
    monkeypatch.setattr(reduction, "_BAND_ROWS", 8)
    given = layers(count, windows=True)
    composed = ts.stitch(given, blend="multiband", blend_width=8)
    composed.window(slice(0, 64), slice(0, 64))
    assert all(layer.image.most < 0.75 * 140 * 160 for layer in given)


def test_two_layers_are_decided_where_both_are():
    """What lies outside of the overlap does not matter to a seam."""
    first, second = layers(2)
    seam = ts.stitch([first, second]).seams[0]
    whole = ts.find_seam(
        *(np.pad(one.image, ((0, 0), pad, (0, 0))) for one, pad in ((first, (0, 100)), (second, (100, 0)))),
        *(np.pad(np.ones((140, 160), bool), ((0, 0), pad)) for pad in ((0, 100), (100, 0))),
    )
    assert seam.cost == whole.cost
    np.testing.assert_array_equal(seam.labels, whole.labels)
    np.testing.assert_array_equal(seam.soft, whole.soft)


@pytest.mark.parametrize("alpha", [False, True])
def test_figures_are_those_of_the_seams_without_making_them(alpha):
    composed = ts.stitch(layers(4, alpha=alpha))
    seams = dict(zip(composed.pairs, composed.seams, strict=True))
    figures = composed.figures()
    assert len(seams) > 2
    assert set(figures) == set(seams)
    for pair, seam in seams.items():
        assert figures[pair].cost == pytest.approx(seam.cost, rel=1e-6)
        assert figures[pair].length == seam.length
        assert figures[pair].verdict.worst == pytest.approx(seam.verdict.worst, rel=1e-6)
        assert seam.method == composed.solution.method == "graph-cut"
    assert composed.solution.seconds == pytest.approx(sum(seam.seconds for seam in seams.values()))


def test_checked_seams_are_not_measured_again_for_figures(monkeypatch):
    measured, usual = [], made._measured
    monkeypatch.setattr(made, "_measured", lambda item: measured.append(item[0]) or usual(item))
    given = layers(4)
    avoid = np.zeros(ts.stitch(given).shape, bool)
    avoid[20:30, 20:30] = True
    measured.clear()
    composed = ts.stitch(given, avoid=avoid)
    assert composed.cost > 0
    assert sorted(measured) == sorted(set(composed.pairs))


def test_figures_of_two_layers_are_those_of_their_seam():
    a, b = np.random.default_rng(0).random((2, 30, 40))
    composed = ts.stitch(ts.layers.overlapping(a, b, overlap=10))
    (seam,) = composed.seams
    assert (composed.cost, composed.figures()[0, 1].length) == (seam.cost, seam.length)
