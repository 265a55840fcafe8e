"""Pictures warped onto the canvas."""

import numpy as np
import pytest
from rendered import grid, turn

import toposeam as ts
from toposeam.layers.canvas import (
    Box,
    CameraTransform,
    PlaneTransform,
    coordinates,
    inside,
    on_canvas,
    resampled,
    similarity,
    warped,
    warped_box,
    warping,
)

WIDTH, HEIGHT = 180, 140
IDENTITY = PlaneTransform(np.eye(3))
TRANSFORMS = {
    "turn": similarity((7.3, -4.6), turn=12.0, scale=1.1),
    "homography": PlaneTransform(np.array([[1.0, 0.05, 3.2], [-0.04, 0.9, -7.7], [6e-4, -4e-4, 1.0]])),
    "camera": CameraTransform(
        size=(WIDTH, HEIGHT),
        rotation=turn(20, -8, 6),
        focal=250.0,
        projection="sphere",
        radius=270.0,
        lens=(0.0, -0.03, 0.0),
    ),
}
WHITE = {"uint8": 255, "uint16": 65535, "float32": 1, "float64": 1}


def waves(x, y, channels):
    """(…, C) smooth functions of a place, in [0, 1]."""
    return np.stack([0.5 + 0.4 * np.sin(x / (8 + k)) * np.cos(y / (9 - k) + k) for k in range(channels)], -1)


def painted(dtype="float32", channels=3, white=None, **more):
    """A layer that shows these functions."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    values = waves(x, y, channels) * (white or WHITE[dtype])
    values = np.rint(values) if np.issubdtype(dtype, np.integer) else values
    return ts.Layer(values.astype(dtype) if channels > 1 else values[..., 0].astype(dtype), **more)


def places(layer):
    """(H, W, 2) places on the canvas of the pixels of a layer."""
    height, width = layer.image.shape[:2]
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) + np.array(layer.at, float)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_identity_keeps_every_pixel(dtype, channels):
    layer = painted(dtype, channels)
    noisy = np.random.default_rng(0).integers(0, WHITE[dtype], layer.image.shape, endpoint=True)
    layer = ts.Layer(noisy.astype(dtype))
    same = warped(layer, IDENTITY)
    assert same.at == (0, 0)
    assert same.image.dtype == layer.image.dtype
    assert (same.image == layer.image).all()
    assert (same.alpha == WHITE[dtype]).all()


def test_identity_keeps_floats_nearly():
    layer = painted()
    assert warped(layer, IDENTITY).image == pytest.approx(layer.image, abs=2e-6)


def test_moves_take_no_new_pixels():
    layer = painted("uint8", at=(90, 80), name="moved")
    moved = on_canvas(layer, similarity((12.4, -3.6)))
    assert moved.at == (12, -4)
    assert moved.image is layer.image
    assert moved.alpha is None
    assert moved.name == "moved"


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
def test_warped_pictures_show_what_was_there(transform, dtype, channels):
    layer = warped(painted(dtype, channels), transform)
    assert layer.image.ndim == (2 if channels == 1 else 3)
    assert layer.image.dtype == layer.alpha.dtype == dtype
    at = transform.to_picture(places(layer))
    exact = waves(at[..., 0], at[..., 1], channels)
    seen = layer.image.reshape(exact.shape) / WHITE[dtype]
    well = inside(at, (WIDTH, HEIGHT))
    off, edges = np.abs(seen - exact), np.array([WIDTH, HEIGHT]) - 1
    far = ((at > 4) & (at < edges - 4)).all(axis=-1)
    assert off[far].max() < 0.005
    assert off[well & layer.covered].max() < 0.015  # at the edges splines see a mirror
    # Nearly all that the picture holds is shown, and nothing else.
    assert (layer.covered != well).mean() < 0.002
    assert (layer.image[~layer.covered] == 0).all()


@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
def test_the_box_holds_the_picture_and_little_more(transform):
    layer = painted("uint8")
    box = warped_box(layer, transform)
    reached = transform.to_canvas(grid((WIDTH, HEIGHT), 301)).reshape(-1, 2)
    assert (reached.min(axis=0) - [box.left, box.top] > -0.05).all()
    assert ([box.right - 1, box.bottom - 1] - reached.max(axis=0) > -0.05).all()
    assert (reached.min(axis=0) - [box.left, box.top] < 1.05).all()
    assert warped(layer, transform).image.shape[:2] == box.shape


def test_opacity_and_masks_follow_the_picture():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    alpha = np.where(x < 60, 0, np.where(x > 90, 255, 128)).astype(np.uint8)
    layer = painted("uint8", alpha=alpha, mask=y >= 40, keep=(x > 120) & (y > 80), data_range=200)
    transform = TRANSFORMS["homography"]
    there = warped(layer, transform)
    at = transform.to_picture(places(there))
    well = inside(at - 0.1, (WIDTH, HEIGHT)) & inside(at + 0.1, (WIDTH, HEIGHT))
    x, y = at[..., 0], at[..., 1]
    expected = {"mask": y > 39.5, "keep": (x > 120.5) & (y > 80.5)}
    far = {
        "mask": np.abs(y - 39.5) > 0.1,
        "keep": (np.abs(x - 120.5) > 0.1) & (np.abs(y - 80.5) > 0.1),
    }
    for name, wanted in expected.items():
        found = getattr(there, name)
        assert (found == wanted)[well & far[name]].all(), name
        assert not found[~inside(at, (WIDTH + 1, HEIGHT + 1))].any(), name
    assert (there.alpha[well & (x < 58.9)] == 0).all()
    assert (there.alpha[well & (x > 61.1) & (x < 88.9)] == 128).all()
    assert (there.alpha[well & (x > 92.1)] == 255).all()
    between = there.alpha[well & (x > 59.2) & (x < 59.8)]
    assert ((between > 0) & (between < 128)).all()
    assert there.data_range == 200


def test_no_value_is_brighter_than_white():
    image = np.full((HEIGHT, WIDTH), 500, np.int32)
    image[40:90, 60:120] = 1000
    layer = ts.Layer(image, data_range=1000.0)
    there = warped(layer, TRANSFORMS["turn"])
    assert there.data_range == 1000
    assert there.image.max() == 1000
    assert there.image[there.covered].min() > 400
    assert np.unique(there.alpha).tolist() == [0, np.iinfo(np.int32).max]


def test_bits_stay_bits():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    layer = ts.Layer((x // 30 + y // 30) % 2 == 0)
    there = warped(layer, TRANSFORMS["turn"])
    at = TRANSFORMS["turn"].to_picture(places(there))
    off = np.abs((at + 0.5) % 30 - 15)  # 15 on the borders of squares
    well = inside(at, (WIDTH, HEIGHT)) & (off < 13).all(axis=-1)
    x, y = np.moveaxis(np.rint(at[well]).astype(int), -1, 0)
    assert (there.image[well] == layer.image[y, x]).all()
    assert there.alpha.dtype == bool


@pytest.mark.parametrize("block", [16, 64, 104, 1000])
@pytest.mark.parametrize("name", ["homography", "camera"])
def test_the_size_of_blocks_changes_nothing(name, block, monkeypatch):
    layer = painted("uint8")
    noisy = np.random.default_rng(0).integers(0, 40, layer.image.shape)
    layer = ts.Layer((layer.image // 2 + noisy).astype(np.uint8), mask=np.eye(HEIGHT, WIDTH) == 0)
    usual = warped(layer, TRANSFORMS[name])
    monkeypatch.setattr(warping, "_BLOCK", block)
    other = warped(layer, TRANSFORMS[name])
    assert other.at == usual.at
    both = usual.covered & other.covered
    # The last pixels of a block are interpolated between nearer knots.
    assert np.abs(other.image[both].astype(int) - usual.image[both]).max() <= 2
    assert (other.image != usual.image).mean() < 0.05
    assert (usual.covered != other.covered).mean() < 0.002


@pytest.mark.parametrize("name", TRANSFORMS)
@pytest.mark.parametrize("box", [Box(3, -5, 90, 130), Box(10, 20, 11, 21), Box(-7, 0, 9, 8)])
def test_coordinates_are_nearly_those_of_the_transform(name, box):
    there = coordinates(TRANSFORMS[name], box)
    x, y = np.meshgrid(np.arange(box.left, box.right), np.arange(box.top, box.bottom))
    exact = TRANSFORMS[name].to_picture(np.stack([x, y], axis=-1).astype(float))
    assert there.shape == (*box.shape, 2)
    assert np.abs(there - exact).max() < 0.05
    assert there[0, 0] == pytest.approx(exact[0, 0], abs=1e-9)


def test_edges_of_what_is_shown_are_not_interpolated_across():
    """A pixel beyond the horizon does not take its neighbours' colours."""
    tilted = PlaneTransform(np.array([[1.0, 0, 0], [0, 1.0, 0], [-6e-3, 0, 1.0]]))
    layer = warped(painted("uint8"), tilted)
    at = tilted.to_picture(places(layer))
    shown = layer.covered
    assert 0.1 < shown.mean() < 1
    assert inside(at, (WIDTH, HEIGHT))[shown].all()
    assert at[..., 0][shown].max() < 130  # of 179: from there on it would be enlarged too much


def test_what_the_canvas_does_not_show_is_named():
    behind = CameraTransform(
        size=(WIDTH, HEIGHT), rotation=turn(180), focal=200.0, projection="flat", radius=200.0
    )
    with pytest.raises(ts.OptionError, match=r"^the canvas shows nothing of back; choose another projection"):
        warped(painted("uint8", name="back"), behind)
    assert warped(painted("uint8", at=(500, 500)), IDENTITY).at == (0, 0)


def test_values_that_nobody_can_read_are_refused():
    with pytest.raises(ts.ImageError, match="data_range"):
        warped(ts.Layer(np.zeros((40, 50), np.int16)), TRANSFORMS["turn"])


@pytest.mark.parametrize("name", TRANSFORMS)
def test_kernels_compute_the_same_coordinates(name, both_ways):
    for box in (Box(3, -5, 90, 130), Box(10, 20, 11, 21), Box(-7, 0, 10, 8), Box(0, 0, 17, 1)):
        assert np.array_equal(*both_ways(lambda box=box: coordinates(TRANSFORMS[name], box)))


@pytest.mark.parametrize("channels", [1, 2, 3])
@pytest.mark.parametrize("dtype", WHITE)
def test_kernels_warp_to_the_same_pixels(dtype, channels, both_ways):
    layer = painted(dtype, channels)
    one, other = both_ways(lambda: warped(layer, TRANSFORMS["homography"]).image)
    assert one.std() > 0.1 * WHITE[dtype]
    assert np.array_equal(one, other)
    lying = ts.Layer(np.rot90(layer.image))  # its pixels lie in another order
    assert np.array_equal(*both_ways(lambda: warped(lying, TRANSFORMS["homography"]).image))
    rows = np.rot90(np.random.default_rng(0).random((2, 50)) * 30)
    planes = layer.image.reshape(HEIGHT, WIDTH, -1)
    assert np.array_equal(*both_ways(lambda: resampled(planes, 1, rows)))


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 5, 3), (2, 2, 1), (4, 9, 3), (300, 17, 2)])
def test_kernels_know_the_same_splines_at_edges(shape, both_ways):
    rng = np.random.default_rng(4)
    part, ends = rng.random(shape, np.float32), np.array(shape[1::-1]) - 1
    points = np.concatenate(
        [rng.random((300, 2)) * ends, np.rint(rng.random((20, 2)) * ends), [[-1e-6, -1e-6], ends + 1e-6]]
    )
    assert np.array_equal(*both_ways(lambda: resampled(part, 1, points)))
