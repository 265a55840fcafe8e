"""Canvases that go round: nothing shows where they are cut."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.layers.canvas import Turned, turned
from toposeam.layers.composite import composed_of_masks

PERIOD = 360


def panorama(rng, height=90, period=PERIOD):
    """A picture whose right edge goes on at the left one."""
    coarse = [
        ndimage.gaussian_filter(rng.random((height, period, 3)), (s, s, 0), mode="wrap") for s in (1, 4, 12)
    ]
    mixed = sum((layer - layer.mean()) / layer.std() for layer in coarse)
    return np.clip(128 + 22 * mixed, 0, 255).astype(np.uint8)


def views(whole, count=4, width=130, gains=None):
    """Views round the panorama; those over the edge as nona writes them, with both ends of the canvas."""
    rng = np.random.default_rng(3)
    layers = []
    for index in range(count):
        x = 20 + index * PERIOD // count
        columns = np.arange(x, x + width) % PERIOD
        gain = 1 if gains is None else gains[index]
        view = np.clip(whole[:, columns] * gain + rng.normal(0, 2, (len(whole), width, 1)), 0, 255)
        view = view.astype(np.uint8)
        if x + width <= PERIOD:
            layers.append(ts.Layer(view, at=(x, 0), name=str(index)))
            continue
        image, alpha = np.zeros_like(whole), np.zeros(whole.shape[:2], np.uint8)
        image[:, columns], alpha[:, columns] = view, 255
        layers.append(ts.Layer(image, alpha=alpha, at=(0, 0), name=str(index)))
    return layers


@pytest.mark.parametrize("start", [-500, -7, 0, 100, 359, 720])
def test_columns_of_what_goes_round(start):
    source = np.arange(3 * 50).reshape(3, 50) + 1
    known = np.zeros((3, 80), int)
    known[:, (np.arange(50) + 60) % 80] = source
    there = Turned(source, 60, 80, start, 200)
    np.testing.assert_array_equal(there[:, :], known[:, np.arange(start, start + 200) % 80])
    np.testing.assert_array_equal(
        there[1:3, 17:140:3], known[1:3, np.arange(start + 17, start + 140, 3) % 80]
    )


def test_layers_across_the_edge_are_narrow_after_another_cut():
    layers = views(panorama(np.random.default_rng(0)))
    assert [layer.image.shape[1] for layer in layers] == [130, 130, 130, 360]
    cut, beside = ts.layers.common_canvas(layers, wrap=PERIOD).sparsest_column()
    assert beside == 1
    columns = [(np.arange(x, x + 130) % PERIOD).tolist() for x in (20, 110, 200, 290)]
    assert sum(cut in one for one in columns) == 1
    moved = [turned(layer, PERIOD, 250) for layer in layers]
    assert [layer.image.shape[1] for layer in moved] == [130, 130, 360, 130]
    np.testing.assert_array_equal(
        np.asarray(moved[3].image), layers[3].image[:, np.arange(290, 420) % PERIOD]
    )


@pytest.mark.parametrize("blend", ts.layers.BLENDS)
def test_the_ends_fit(blend):
    whole = panorama(np.random.default_rng(1))
    layers = views(whole, gains=(1.05, 0.97, 1.04, 0.93))
    stitched = ts.stitch(layers, wrap=PERIOD, blend=blend)
    assert stitched.image.shape == whole.shape
    assert stitched.alpha is None
    image, labels = stitched.image.astype(float), stitched.label_map
    across = np.abs((image[:, 0] - image[:, -1]) - (whole[:, 0].astype(float) - whole[:, -1]))
    same = labels[:, 0] == labels[:, -1]
    inner = np.abs(np.diff(image, axis=1) - np.diff(whole.astype(float), axis=1)).mean()
    assert across.mean() < 1.5 * inner + 1
    if blend == "none":
        for index, layer in enumerate(layers):
            alpha = np.full(layer.image.shape[:2], 255) if layer.alpha is None else layer.alpha
            rows, columns = np.nonzero(labels == index)
            assert (alpha[rows, columns - layer.at[0]] > 0).all()
            np.testing.assert_array_equal(
                stitched.image[rows, columns], layer.image[rows, columns - layer.at[0]]
            )
    assert same.mean() > 0.5


def test_it_does_not_matter_where_the_canvas_begins():
    """Turned by some columns, the same panorama comes out, turned."""
    whole = panorama(np.random.default_rng(2))
    layers = views(whole)
    first = ts.stitch(layers, wrap=PERIOD)
    shifted = []
    for layer in layers:
        image, alpha = np.zeros_like(whole), np.zeros(whole.shape[:2], np.uint8)
        columns = (np.arange(layer.image.shape[1]) + layer.at[0] + 100) % PERIOD
        image[:, columns] = layer.image
        alpha[:, columns] = 255 if layer.alpha is None else layer.alpha
        shifted.append(ts.Layer(image, alpha=alpha, name=layer.name))
    second = ts.stitch(shifted, wrap=PERIOD)
    agree = np.roll(first.label_map, 100, axis=1) == second.label_map
    assert agree.mean() > 0.999


def test_seams_cross_the_edge_where_many_layers_lie():
    """Two layers, both all round but for a gap: each seam closes round the canvas."""
    whole = panorama(np.random.default_rng(4))
    rng = np.random.default_rng(5)
    noisy = [np.clip(whole + rng.normal(0, 6, whole.shape), 0, 255).astype(np.uint8) for _ in "ab"]
    layers = [ts.Layer(noisy[0][:60], at=(0, 0)), ts.Layer(noisy[1][30:], at=(0, 30))]
    stitched = ts.stitch(layers, wrap=PERIOD)
    labels = stitched.label_map
    heights = (labels == 0).sum(axis=0)
    assert abs(int(heights[0]) - int(heights[-1])) <= np.abs(np.diff(heights)).max()
    assert (labels[:30] == 0).all()
    assert (labels[60:] == 1).all()


@pytest.mark.parametrize(
    "options", [{"weight": np.ones((90, 360))}, {"avoid": np.zeros((90, 360))}, {"wrap": 200}]
)
def test_what_does_not_go_round_is_refused(options):
    layers = views(panorama(np.random.default_rng(0)))
    with pytest.raises(ts.OptionError):
        ts.stitch(layers, **{"wrap": PERIOD, **options})


@pytest.mark.parametrize("blend", ["soft", "multiband", "gradient"])
@pytest.mark.parametrize("turn", [0, 60, 250])
def test_blends_go_on_over_the_edge(blend, turn):
    """Wherever the edge lies, in an overlap or not, the step there is like any other."""
    whole = np.roll(panorama(np.random.default_rng(6)), turn, axis=1).astype(float)
    layers = []
    for index, gain in enumerate((1.0, 0.94, 1.05, 0.97)):
        columns = (np.arange(130) + 295 + 90 * index + turn) % PERIOD
        image, alpha = np.zeros(whole.shape, np.uint8), np.zeros(whole.shape[:2], np.uint8)
        image[:, columns], alpha[:, columns] = np.clip(whole[:, columns] * gain, 0, 255), 255
        layers.append(ts.Layer(image, alpha=alpha, name=str(index)))
    image = ts.stitch(layers, wrap=PERIOD, blend=blend).image.astype(float)
    excess = np.roll(image, -1, axis=1) - image - (np.roll(whole, -1, axis=1) - whole)
    steps = np.abs(excess.mean(axis=(0, 2)))  # of whole columns: noise averages out
    assert steps[-1] < 1.0
    assert steps[-1] <= np.quantile(steps, 0.9) + 0.25


@pytest.mark.parametrize("blend", ["multiband", "gradient"])
def test_masks_say_what_shows_on_a_round_canvas(blend):
    layers = views(panorama(np.random.default_rng(6)), gains=[1, 1.1, 1, 0.9])
    found = ts.stitch(layers, wrap=PERIOD, blend=blend)
    again = composed_of_masks(layers, found.masks, found.label_map.shape, blend=blend, wrap=PERIOD)
    image, alpha = again.window(slice(None), slice(None))
    np.testing.assert_array_equal(again.labels(slice(None), slice(None)), found.label_map)
    np.testing.assert_array_equal(image, found.image)
    assert alpha.min() == 255
