"""Blending and tones: exact where layers agree, right where the answer is known, no trace of tiles."""

import numpy as np
import pytest
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.heat.poisson import spread_within
from toposeam.layers.canvas import Box
from toposeam.layers.composite import composition
from toposeam.layers.exposure import encoded
from toposeam.layers.exposure.gains import tone_gains
from toposeam.layers.exposure.linear_light import decoded
from toposeam.seam.problem import expand, expand_part, pyramid, reduce

PHOTOGRAPH = data.coffee()[:180, 200:420]
STRAIGHT = ts.vector.read_svg(
    '<svg xmlns="http://www.w3.org/2000/svg" width="100" height="20"><path d="M50 0 V20"/></svg>'
)
BLURS = [kind for kind in ts.layers.BLENDS if kind != "none"]


def crops(gains=((1, 1, 1),) * 3, dtype=np.uint8, **fields):
    layers = []
    for gain, (x, y, width, height) in zip(
        gains, ((0, 0, 120, 100), (80, 20, 140, 110), (30, 70, 130, 110)), strict=True
    ):
        light = decoded(PHOTOGRAPH[y : y + height, x : x + width] / 255) * np.array(gain, float)
        image = 255 * encoded(light)
        image = (
            image / 255
            if dtype == np.float32
            else np.clip(np.rint(image), 0, 255) * (257 if dtype == np.uint16 else 1)
        )
        layers.append(ts.Layer(image=image.astype(dtype), at=(x, y), **fields))
    return layers


def shown(stitched):
    return np.any(stitched.masks, axis=0)


@pytest.mark.medium
@pytest.mark.parametrize("kind", BLURS)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_where_layers_agree_nothing_changes(kind, dtype):
    stitched = ts.stitch(crops(dtype=dtype), blend=kind, max_rounds=0)
    hard = ts.stitch(crops(dtype=dtype), max_rounds=0)
    assert stitched.image.dtype == dtype
    tolerance = {np.uint8: 0, np.uint16: 1, np.float32: 1e-6}[dtype]
    np.testing.assert_allclose(stitched.image.astype(float), hard.image.astype(float), rtol=0, atol=tolerance)


@pytest.mark.parametrize("kind", BLURS)
def test_gray_layers_are_blended_too(kind):
    coloured = crops(((1.1,) * 3, (0.9,) * 3, (1,) * 3))
    gray = [ts.Layer(image=layer.image[..., 1], at=layer.at) for layer in coloured]
    blended, hard = (ts.stitch(gray, blend=name, max_rounds=0) for name in (kind, "none"))
    change = np.abs(blended.image.astype(int) - hard.image)
    assert 0 < change.max() < 60
    assert (change[~shown(hard)] == 0).all()


def step(kind, width=None, gains=((1.1, 1.1, 1.1), (0.9, 0.9, 0.9), (1, 1, 1))):
    """Mean jump across the seams beyond that of the photograph, and the largest difference to it."""
    stitched = ts.stitch(crops(gains), blend=kind, blend_width=width, max_rounds=0)
    label_map = np.argmax(stitched.masks, axis=0)
    jumps = []
    for axis in (0, 1):
        border = (
            (np.diff(label_map, axis=axis) != 0)
            & np.take(shown(stitched), range(label_map.shape[axis] - 1), axis)
            & np.delete(shown(stitched), 0, axis)
        )
        jumps.append(
            np.abs(
                np.diff(stitched.image.astype(float), axis=axis)
                - np.diff(PHOTOGRAPH.astype(float), axis=axis)
            )[border]
        )
    return np.concatenate(jumps).mean()


@pytest.mark.parametrize(
    ("kind", "share"), [("feather", 0.4), ("soft", 0.9), ("multiband", 0.35), ("gradient", 0.35)]
)
def test_the_step_at_the_seam_shrinks(kind, share):
    assert step(kind) < share * step("none")


def test_a_wider_feather_is_smoother():
    assert step("feather", 25) < step("feather", 5) < step("none")


@pytest.mark.medium
@pytest.mark.parametrize("kind", ["feather", "multiband"])
def test_far_from_the_seam_every_pixel_is_its_layer_s(kind):
    gains = ((1.1, 1.1, 1.1), (0.9, 0.9, 0.9), (1, 1, 1))
    hard, soft = (
        ts.stitch(crops(gains), blend=blend, blend_width=width, max_rounds=0)
        for blend, width in (("none", None), (kind, 8))
    )
    changed = (hard.image != soft.image).any(axis=2)
    assert changed.any()
    label_map = np.argmax(hard.masks, axis=0)
    near = np.zeros(label_map.shape, bool)
    for row, column in np.argwhere(changed):
        window = label_map[max(row - 40, 0) : row + 41, max(column - 40, 0) : column + 41]
        near[row, column] = len(np.unique(window)) > 1
    np.testing.assert_array_equal(changed, changed & near)


@pytest.mark.medium
@pytest.mark.parametrize("kind", BLURS)
def test_tiles_leave_no_trace(kind, monkeypatch):
    gains = ((1.1, 1.1, 1.1), (0.9, 0.9, 0.9), (1, 1, 1))
    whole = ts.stitch(crops(gains, dtype=np.float32), blend=kind, max_rounds=0).image
    monkeypatch.setattr(composition, "BLOCK", 64)
    np.testing.assert_allclose(
        ts.stitch(crops(gains, dtype=np.float32), blend=kind, max_rounds=0).image, whole, rtol=0, atol=2e-6
    )


def test_feather_is_a_ramp_of_its_width_across_a_straight_seam():
    a, b = (
        ts.Layer(image=np.full((20, 60), value, np.float32), at=(x, 0)) for value, x in ((0.0, 0), (1.0, 40))
    )
    image = ts.stitch([a, b], blend="feather", blend_width=9, use_path=STRAIGHT).image
    row = image[10]
    np.testing.assert_allclose(
        image, np.broadcast_to(row, image.shape), atol=1e-6
    )  # the canvas's border changes nothing
    assert (row[:45] == 0).all()
    assert (row[55:] == 1).all()
    np.testing.assert_allclose(np.diff(row[45:54]), 1 / 9, atol=1e-6)


def test_soft_mixes_by_the_label_potential():
    first, second = crops(dtype=np.float32)[:2]
    second = ts.Layer(image=second.image + np.float32(0.1), at=second.at)
    stitched = ts.stitch([first, second], blend="soft")
    seam = stitched.seams[0]
    ramp = (seam.soft > 0.01) & (seam.soft < 0.99)
    assert ramp.any()
    offset = stitched.image - PHOTOGRAPH[: stitched.image.shape[0], : stitched.image.shape[1]] / 255
    np.testing.assert_allclose(offset[ramp].mean(axis=1), 0.1 * seam.soft[ramp], atol=1e-5)


def test_opacity_fades_too():
    layers = [
        ts.Layer(
            image=np.full((20, 60), 100, np.uint8), alpha=np.full((20, 60), opacity, np.uint8), at=(x, 0)
        )
        for opacity, x in ((255, 0), (55, 40))
    ]
    stitched = ts.stitch(layers, blend="feather", blend_width=11, use_path=STRAIGHT)
    row = stitched.alpha[10].astype(int)
    assert (np.diff(row) <= 0).all()
    assert len(np.unique(row)) > 8
    assert (stitched.image == 100).all()


def least_squares(label_map, values, patches, width):
    """What to add to one channel by a dense solve: `values` (K, H, W), NaN where a layer has none; the
    numbers of the layers that lie inside others.
    """
    height, columns = label_map.shape
    size = height * columns
    at = np.arange(size).reshape(height, columns)
    onto = np.isin(label_map, patches).ravel()
    jumps, around, inside = [], [], []
    pairs = np.concatenate(
        [np.stack([at[:, :-1].ravel(), at[:, 1:].ravel()], 1), np.stack([at[:-1].ravel(), at[1:].ravel()], 1)]
    )
    for p, q in pairs:
        i, j = (label_map.flat[pixel] for pixel in (p, q))
        excess = 0.0
        if i != j and i >= 0 and j >= 0:
            known = [values[j].flat[pixel] - values[i].flat[pixel] for pixel in (p, q)]
            known = [difference for difference in known if np.isfinite(difference)]
            excess = np.mean(known) if known else values[j].flat[q] - values[i].flat[p]
        row = np.zeros(size)
        row[p], row[q] = -1, 1
        jumps.append(row)
        around.append(0.0 if onto[p] or onto[q] else -excess)
        inside.append(-excess if onto[p] or onto[q] else 0.0)
    jumps = np.array(jumps)
    system = jumps.T @ jumps + np.eye(size) * (0 if width is None else width**-2.0)
    mean = 1.0 if width is None else 0.0  # which is 0 then
    result = np.linalg.solve(system + mean, jumps.T @ around)
    if onto.any():
        result[onto] += np.linalg.solve(system[np.ix_(onto, onto)], jumps[:, onto].T @ inside)
    return result.reshape(height, columns)


@pytest.mark.parametrize("width", [None, 4.0])
@pytest.mark.parametrize("patch", [False, True])
def test_gradient_is_the_least_squares_solution(patch, width):
    """Of three small layers with holes, of which one may lie inside another."""
    rng = np.random.default_rng(5)
    places = [((11, 13), (-3, 2)), ((9, 12), (6, -1)), ((5, 6), (-1, 4)) if patch else ((8, 10), (1, 9))]
    layers = []
    for (height, columns), at in places:
        image = rng.uniform(0.3, 0.6, (height, columns, 3)) + rng.uniform(-0.1, 0.1, 3)
        alpha = np.ones((height, columns), np.float32)
        if len(layers) == 1:
            alpha[4, 2:4] = alpha[5:7, 1] = 0
        layers.append(ts.Layer(image.astype(np.float32), alpha=alpha, at=at))
    stitched = ts.stitch(layers, blend="gradient", blend_width=width)
    label_map = stitched.label_map
    assert set(np.unique(label_map)) == {-1, 0, 1, 2}
    left, top = stitched.origin
    for channel in range(3):
        values = np.full((3, *label_map.shape), np.nan)
        for plane, layer in zip(values, layers, strict=True):
            (x, y), (height, columns) = layer.at, layer.covered.shape
            part = np.where(layer.covered, layer.image[..., channel], np.nan)
            plane[y - top : y - top + height, x - left : x - left + columns] = part
        shown = np.choose(np.maximum(label_map, 0), values)
        expected = shown + least_squares(label_map, values, [2] if patch else [], width)
        ground = label_map >= 0
        found = stitched.image[..., channel]
        np.testing.assert_allclose(found[ground], expected[ground], rtol=0, atol=1e-4 if patch else 1e-6)
        assert np.abs(found - shown)[ground].max() > 0.02


def bands_mixed(images, shows, levels):
    """Two images mixed as Burt and Adelson (1983) do, the kernel continued at the borders."""
    kernel = np.array([1, 4, 6, 4, 1]) / 16

    def smooth(image):
        for axis in (0, 1):
            image = ndimage.correlate1d(image, kernel, axis, mode="nearest")
        return image

    def larger(image):
        wide = np.zeros([2 * side + 4 for side in image.shape])
        wide[::2, ::2] = np.pad(image, 1, mode="edge")
        return 4 * smooth(wide)[2:-2, 2:-2]

    sizes = [np.array([*images, shows], float)]
    for _ in range(levels):
        sizes.append(np.array([smooth(plane)[::2, ::2] for plane in sizes[-1]]))
    mixed = np.zeros((1, 1))
    for level, (*planes, share) in reversed(list(enumerate(sizes))):
        if level < levels:
            planes = [plane - larger(coarse) for plane, coarse in zip(planes, sizes[level + 1], strict=False)]
            mixed = larger(mixed)
        mixed = mixed + share * planes[0] + (1 - share) * planes[1]
    return mixed


@pytest.mark.parametrize(("width", "levels"), [(4, 2), (8, 3)])
def test_multiband_mixes_the_bands_of_burt_and_adelson(width, levels):
    rng = np.random.default_rng(2)
    whole = ndimage.gaussian_filter(rng.standard_normal((2, 64, 224)), (0, 3, 3))
    first, second = (0.4 + whole / np.abs(whole).max() / 5 + np.array([0.1, 0])[:, None, None]).astype(
        np.float32
    )
    path = ts.vector.read_svg(
        '<svg xmlns="http://www.w3.org/2000/svg" width="224" height="64">'
        '<path d="M104 0 L124 30 L110 64"/></svg>'
    )
    layers = [ts.Layer(first[:, :192]), ts.Layer(second[:, 32:], at=(32, 0))]
    stitched = ts.stitch(layers, blend="multiband", blend_width=width, use_path=path)
    shows = stitched.label_map == 0
    expected, hard = bands_mixed((first, second), shows, levels), np.where(shows, first, second)
    middle = np.s_[:, 72:152]  # the layers end far from here
    found, expected, hard = stitched.image[middle], expected[middle], hard[middle]
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=2e-3
    )  # where next to nothing is mixed in it is left
    changed = found != hard
    assert changed.mean() > 0.1
    np.testing.assert_allclose(found[changed], expected[changed], rtol=0, atol=2e-6)


def test_reduce_and_expand_keep_a_plane():
    rows, columns = np.mgrid[:32, :48].astype(np.float32)
    plane = (rows + 2 * columns)[np.newaxis]
    small = reduce(plane)
    np.testing.assert_allclose(small[0, 2:-2, 2:-2], plane[0, ::2, ::2][2:-2, 2:-2], atol=1e-4)
    np.testing.assert_allclose(expand(small)[0, 6:-6, 6:-6], plane[0, 6:-6, 6:-6], atol=1e-4)


def test_reduce_applies_the_kernel_of_burt_and_adelson():
    planes = np.random.default_rng(0).random((3, 16, 24)).astype(np.float32)
    kernel = np.array([1, 4, 6, 4, 1]) / 16
    smooth = ndimage.correlate1d(
        ndimage.correlate1d(planes, kernel, axis=1, mode="nearest"), kernel, 2, mode="nearest"
    )
    np.testing.assert_allclose(reduce(planes), smooth[:, ::2, ::2], atol=1e-6)


@pytest.mark.parametrize("together", [1, 1600, 1 << 19])
def test_planes_are_resized_alike_singly_and_in_batches(monkeypatch, together):
    monkeypatch.setattr(pyramid, "_PIXELS_TOGETHER", together)
    planes = np.random.default_rng(1).random((5, 16, 24)).astype(np.float32)
    for resized in (reduce, expand):
        alone = np.concatenate([resized(plane[np.newaxis]) for plane in planes])
        np.testing.assert_array_equal(resized(planes), alone)


# Tones


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_gains_are_found_and_taken_out(dtype):
    gains = np.array([(1.06, 1.0, 0.97), (0.93, 0.95, 1.05), (1.0, 1.03, 1.0)])
    layers = crops(gains, dtype=dtype)
    places = [
        Box(
            layer.at[1],
            layer.at[0],
            layer.at[1] + layer.image.shape[0],
            layer.at[0] + layer.image.shape[1],
        )
        for layer in layers
    ]
    product = tone_gains(layers, places)[0] * gains
    np.testing.assert_allclose(product / product[:1], 1, atol=0.01)
    stitched, plain = (ts.stitch(layers, match_tones=match, max_rounds=0) for match in (True, False))
    scale = {np.uint8: 1, np.uint16: 257, np.float32: 1 / 255}[dtype]

    def error(result):
        difference = result.image.astype(float) / scale - PHOTOGRAPH
        return np.abs(difference - np.median(difference))[shown(result)].mean()

    assert error(stitched) < 0.4 * error(plain)
    assert stitched.image.dtype == dtype


def test_an_object_that_moved_does_not_count():
    layers = crops(((1.1, 1.1, 1.1), (1, 1, 1), (1, 1, 1)))
    layers[0].image[40:75, 80:100] = 20  # nearly half of the overlap with the second
    places = [
        Box(
            layer.at[1],
            layer.at[0],
            layer.at[1] + layer.image.shape[0],
            layer.at[0] + layer.image.shape[1],
        )
        for layer in layers[:2]
    ]
    gains, _ = tone_gains(layers[:2], places)
    np.testing.assert_allclose(gains[1] / gains[0], 1.1, atol=0.02)


def test_no_highlight_burns_out():
    bright = np.clip(PHOTOGRAPH.astype(int) + 60, 0, 240)
    layers = [
        ts.Layer(image=(bright[:, :120] * 0.8).astype(np.uint8)),
        ts.Layer(image=bright[:, 80:].astype(np.uint8), at=(80, 0)),
    ]
    stitched = ts.stitch(layers, match_tones=True)
    assert (stitched.image == 255).mean() < 0.002


def test_layers_without_a_telling_pixel_stay_as_they_are():
    layers = [
        ts.Layer(image=np.full((20, 30), value, np.uint8), at=(x, 0)) for value, x in ((255, 0), (0, 20))
    ]
    stitched = ts.stitch(layers, match_tones=True)
    assert set(np.unique(stitched.image)) == {0, 255}


ERRORS = {
    "kind": ({"blend": "magic"}, "choose one of auto, none, feather"),
    "width of none": ({"blend_width": 3}, "leave it out"),
    "width of soft": ({"blend": "soft", "blend_width": 3}, "leave it out"),
    "narrow": ({"blend": "feather", "blend_width": 0.5}, "choose 1 to 512"),
    "wide": ({"blend": "multiband", "blend_width": 1e9}, "choose 1 to 512"),
    "no number": ({"blend": "feather", "blend_width": float("nan")}, "choose 1 to 512"),
}


@pytest.mark.parametrize(("options", "remedy"), ERRORS.values(), ids=ERRORS)
def test_what_cannot_be_blended_says_what_to_do(options, remedy):
    with pytest.raises(ts.OptionError, match=remedy):
        ts.stitch(crops(), **options)


def wall_with_moved_things(layers: int, size: int = 200) -> list[ts.Layer]:
    """A wall photographed several times, always with a box somewhere else."""
    rng = np.random.default_rng(5)
    result = []
    for index in range(layers):
        wall = np.full((size, size, 3), 120.0) + rng.normal(0, 1.5, (size, size, 3))
        left = size - 50 if index % 2 == 0 else 20
        wall[60 + 20 * index : 110 + 20 * index, left : left + 24] = 230
        at = (index * (size // 2), 0)
        result.append(ts.Layer(np.clip(np.rint(wall), 0, 255).astype(np.uint8), at=at, name=str(index)))
    return result


@pytest.mark.parametrize("layers", [2, 3])
@pytest.mark.parametrize("blend", ["multiband", "soft"])
def test_wide_blends_leave_no_step_beside_what_moved(layers, blend):
    """What is seen is wall or box, and between them is the box's whole edge."""
    image = ts.stitch(wall_with_moved_things(layers), blend=blend).image.astype(int)
    steps = np.abs(image[:, 2:] - image[:, :-2])
    assert (image > 200).any()
    assert not ((steps > 16) & (steps < 90)).any()
    assert not ((image > 140) & (image < 210)).any()


def patch_on_a_slope():
    """A bright ground with a dark thing, laid on a ground that is darker and changes, beyond both."""
    rng = np.random.default_rng(8)
    y, x = np.mgrid[:160, :200]
    below = 60 + 0.4 * x + 8 * np.sin(y / 20) + rng.normal(0, 1, y.shape)
    patch = 190 + rng.normal(0, 1, (80, 90))
    patch[14:66, 16:74] = 40
    return [
        ts.Layer(np.clip(np.rint(plane), 0, 255).astype(np.uint8), at=at)
        for plane, at in ((below, (0, 0)), (patch, (50, 40)))
    ]


@pytest.mark.parametrize("width", [None, 40])
def test_a_patch_takes_over_the_tones_below(width):
    """What is below stays, the thing stays whole, and between them there is no step."""
    below, _patch = layers = patch_on_a_slope()
    stitched = ts.stitch(layers, blend="gradient", blend_width=width)
    shows = stitched.label_map == 1
    assert shows[54:106, 66:124].all()
    np.testing.assert_array_equal(stitched.image[~shows], below.image[~shows])
    image = stitched.image.astype(float)
    for axis in (0, 1):
        across = np.diff(image, axis=axis)[np.diff(shows, axis=axis)]
        assert np.abs(across).mean() < 4  # noise alone makes 1.1
    inside = image[54:106, 66:124]
    assert inside.max() < image[44:50, 66:124].min() - 60  # as dark against its ground as it was


def test_the_correction_of_a_patch_solves_its_equations():
    rng = np.random.default_rng(4)
    source, free = rng.normal(size=(2, 30, 40))
    free = free > -0.5
    for width in (None, 5.0):
        found = spread_within(source.copy(), free, width)
        around = np.pad(found, 1, mode="edge")
        pull = 4 * found - around[2:, 1:-1] - around[:-2, 1:-1] - around[1:-1, 2:] - around[1:-1, :-2]
        pull += 0 if width is None else found / width**2
        np.testing.assert_allclose(pull[free], source[free], atol=1e-3)
        assert not found[~free].any()


def test_narrow_blends_take_the_seam_of_the_hard_cut():
    layers = wall_with_moved_things(3)
    hard = ts.stitch(layers).label_map
    assert (ts.stitch(layers, blend="feather").label_map == hard).all()
    assert (ts.stitch(layers, blend="multiband", cost=ts.seam.MatchCost(reach=0)).label_map == hard).all()
    assert (ts.stitch(layers, blend="multiband").label_map != hard).any()


@pytest.mark.parametrize("blend", ["feather", "soft", "multiband", "gradient"])
@pytest.mark.parametrize("dtype", [np.uint16, np.uint32, np.float32])
def test_what_counts_as_white_is_white_after_blending(blend, dtype):
    """Twelve bits in sixteen, as cameras give them."""
    whole = np.random.default_rng(0).integers(1000, 3000, (60, 90)).astype(dtype)
    layers = [ts.Layer(whole[:, left : left + 60], at=(left, 0), data_range=4095) for left in (0, 30)]
    np.testing.assert_allclose(ts.stitch(layers, blend=blend).image, whole, rtol=1e-5)


@pytest.mark.parametrize("rows", [slice(0, 6), slice(4, 12), slice(18, 20), slice(0, 20)])
@pytest.mark.parametrize("columns", [slice(0, 2), slice(6, 10), slice(12, 16)])
def test_a_part_of_an_expanded_image_equals_the_whole(rows, columns):
    planes = np.random.default_rng(3).random((2, 10, 8), np.float32)
    np.testing.assert_array_equal(expand_part(planes, rows, columns), expand(planes)[:, rows, columns])
