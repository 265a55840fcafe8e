"""Every public function that takes pictures: arrays of which nobody can tell what is white, or that no number
comes out of, are refused by one helper; none is taken silently.
"""

import warnings

import numpy as np
import pytest

import toposeam as ts

RNG = np.random.default_rng(0)
A, B = RNG.random((2, 24, 32, 3))
HOLE = np.zeros((24, 32), bool)
HOLE[8:14, 8:16] = True
HALF = [np.pad(np.ones((24, 24), bool), ((0, 0), side)) for side in ((0, 24), (24, 0))]
SEAM = ts.find_seam(A, B, side="right")
SOURCE = np.stack(np.meshgrid(np.arange(24), np.arange(24)[::-1], indexing="ij"), axis=2)

#: What a picture with values in [0, 1] becomes, and what is said of it.
WHITE, NUMBERS, SHAPE = (
    "data_range=",
    "NaN or infinite|beyond ±1e",
    "masked array|looks like|has dtype|dtype complex",
)
BAD = {
    "int16": (lambda a: (a * 30000).astype(np.int16), WHITE),
    "uint32": (lambda a: (a * 300).astype(np.uint32), WHITE),
    "int64": (lambda a: (a * 300).astype(np.int64), WHITE),
    "floats to 255": (lambda a: a * 255, WHITE),
    "NaN": (lambda a: np.where(a > 0.98, np.nan, a), NUMBERS),
    "infinite": (lambda a: np.where(a > 0.98, -np.inf, a), NUMBERS),
    "huge": (lambda a: np.where(a > 0.98, 1e30, a), NUMBERS),
    "(C, H, W)": (lambda a: np.ascontiguousarray(np.moveaxis(a, 2, 0)), SHAPE),
    "masked": (lambda a: np.ma.masked_array(a, a > 0.9), SHAPE),
    "complex": (lambda a: a.astype(complex), SHAPE),
}


def pair(a, b, **options):
    return [ts.Layer(a, **options), ts.Layer(b, at=(16, 0), **options)]


#: Calls with two pictures, (24, 32, 3).
CALLS = {
    "find_seam": lambda a, b: ts.find_seam(a, b),
    "apply_paths": lambda a, b: ts.seam.apply_paths(ts.vector.read_svg(SEAM.to_svg()), a, b),
    "seam_verdict": lambda a, b: ts.seam.seam_verdict(SEAM, a, b),
    "find_surface": lambda a, b: ts.find_surface(
        np.stack([a, b] * 2), np.stack([b, a] * 2), axis=0, channel_axis=-1
    ),
    "loop": lambda a, b: ts.loop(np.stack([a] * 3 + [b] * 5), transition=2),
    "flatten_light": lambda a, b: ts.texture.flatten_light(a),
    "synthesize": lambda a, b: ts.synthesize(a, 32, patch=8),
    "synthesize flat": lambda a, b: ts.synthesize(a, 32, patch=8, flatten=True),
    "synthesize maps": lambda a, b: ts.synthesize(A, 32, patch=8, maps=[a], weights=[1, 1]),
    "synthesize guide": lambda a, b: ts.synthesize(A, (24, 32), patch=8, guide=a, guide_source=b),
    "fill patches": lambda a, b: ts.fill(a, HOLE, patch=6),
    "fill shifts": lambda a, b: ts.fill(a, HOLE, by="shifts"),
    "make_tileable": lambda a, b: ts.make_tileable(np.repeat(a, 2, axis=a.shape.index(24))),
    "natural_patch": lambda a, b: ts.texture.natural_patch(a),
    "tile_set": lambda a, b: ts.texture.tile_set([a, b], 24, variants=1),
    "closing_size": lambda a, b: ts.texture.closing_size(a, (32, 32)),
    "stitch": lambda a, b: ts.stitch(pair(a, b)),
    "align": lambda a, b: ts.layers.align(pair(a, b), radius=4),
    "correlations": lambda a, b: ts.layers.correlations(pair(a, b)),
    "match_tones": lambda a, b: ts.layers.match_tones(pair(a, b)),
    "find_places": lambda a, b: ts.find_places(pair(a, b)),
    "placed": lambda a, b: ts.layers.placed(ts.Layer(a), at=(0, 0), turn=1),
    "restitch": lambda a, b: ts.layers.restitch(pair(a, b), HALF, {}, blend="multiband").image,
    "palette": lambda a, b: ts.motif.palette(a, 3),
    "kaleidoscope": lambda a, b: ts.motif.kaleidoscope(a, "p4m", (16, 16)),
    "border_visibility": lambda a, b: ts.motif.border_visibility(a, (8, 8)),
    "random_recipe": lambda a, b: ts.motif.random_recipe(24, base=a),
}

#: (F, C, H, W) may be a clip of 32 channels; guides of floats only have to agree with each other.
TAKEN = {("find_surface", "(C, H, W)"), ("loop", "(C, H, W)"), ("synthesize guide", "floats to 255")}


@pytest.mark.medium
@pytest.mark.parametrize(
    ("call", "kind"), [(call, kind) for call in CALLS for kind in BAD if (call, kind) not in TAKEN]
)
def test_no_array_is_taken_for_what_it_may_not_be(call, kind):
    change, said = BAD[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ts.ImageError, match=said):
            CALLS[call](change(A), change(B))


def test_light_is_flattened_within_what_is_white():
    deep = np.linspace(100, 4000, 64 * 64).reshape(64, 64).astype(np.int32)
    flat = ts.texture.flatten_light(deep, data_range=4095)
    assert flat.dtype == np.int32
    assert 0 <= flat.min() <= flat.max() <= 4095
    made = ts.synthesize(deep, 48, patch=16, flatten=True, data_range=4095)
    assert made.image.max() <= 4095
    # What the mask leaves out does not count, whatever it is.
    spoilt = deep / 4095
    spoilt[:, 60:] = np.nan
    where = np.isfinite(spoilt)
    assert np.isfinite(ts.texture.flatten_light(spoilt, source_mask=where)[where]).all()


def test_integer_maps_are_cut_and_nan_values_are_not_mixed():
    labels = np.arange(24 * 32).reshape(24, 32)  # int64
    np.testing.assert_array_equal(
        ts.texture.apply_coordinates(labels, SOURCE, smooth=0), labels[SOURCE[..., 0], SOURCE[..., 1]]
    )
    holed = np.where(A[..., 0] > 0.9, np.nan, A[..., 0])
    assert np.isnan(ts.texture.apply_coordinates(holed, SOURCE, smooth=0)).any()
    with pytest.raises(ts.ImageError, match="say smooth=0"):
        ts.texture.apply_coordinates(holed, SOURCE)


@pytest.mark.parametrize("number", [np.full((24, 24), 65536), np.full((24, 24), -1), np.zeros((24, 24))])
def test_numbers_of_exemplars_are_whole_and_within_their_range(number):
    with pytest.raises(ts.TopoSeamError, match=r"beyond the pictures|pass whole numbers"):
        ts.texture.apply_coordinates(A, SOURCE, number)


def test_masked_arrays_are_no_masks_and_no_grounds():
    masked = np.ma.masked_array(np.ones((24, 32)), HOLE)
    for call in (
        lambda: ts.find_seam(A, B, masked, masked),
        lambda: ts.fill(A, masked, patch=6),
        lambda: ts.plan_path(masked, (1, 1), (20, 20)),
        lambda: ts.path.path_cost(ts.vector.Polyline([(1, 1), (9, 9)]), masked),
    ):
        with pytest.raises(ts.TopoSeamError, match="masked array"):
            call()
