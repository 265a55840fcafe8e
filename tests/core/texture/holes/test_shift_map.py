"""Holes in photographs, stitched from shifted copies."""

import numpy as np
import pytest
import skimage.data
from scipy import ndimage

import toposeam as ts
from toposeam.texture.exemplar import Atlas
from toposeam.texture.holes import Ground, ShiftMoves, candidate_shifts, is_texture
from toposeam.texture.holes import shift_candidates as offsets
from toposeam.texture.holes import shift_map as texture_shifts
from toposeam.texture.holes import shift_map_moves as shift_moves
from toposeam.texture.light import levelled, levelling, membrane


def disc(shape, row, column, radius):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(y - row, x - column) <= radius


def ground_of(image, hole, near):
    """A picture from everywhere outside of a hole of which is copied."""

    def planes():
        return np.moveaxis(image, 2, 0)

    return Ground(planes=planes, hole=hole, copied=~hole, present=np.ones_like(hole), near=near)


def two_alike(sample):
    """A picture whose right half is its left half, with a hole in the left one."""
    half = sample(0, (120, 90), channels=3)
    image = np.hstack([half, half])
    return image, disc(image.shape[:2], 60, 45, 20)


def test_candidate_places_match_windows_on_the_hole_s_rim(sample, monkeypatch):
    image = sample(3, (160, 160), channels=3).astype(np.float32) / 255
    hole = disc(image.shape[:2], 80, 80, 32)
    atlas = Atlas.of([~hole], 4)
    weights = []

    class Watching(offsets.PatchSearch):
        def fit(self, target, weight, margin, shape):
            weights.append(weight)
            return super().fit(target, weight, margin, shape)

    monkeypatch.setattr(offsets, "PatchSearch", Watching)
    offsets._fitting(atlas, atlas.spread([image]), hole, hole)
    # Centred on the rim of a disc, a window sees as much of its outside as of its inside.
    shares = [weight.mean() for weight in weights[-offsets._RIM_WINDOWS :]]
    assert len(shares) == offsets._RIM_WINDOWS
    assert all(0.4 < share < 0.75 for share in shares)


@pytest.mark.medium
def test_what_the_picture_has_twice_is_restored_exactly(sample):
    image, hole = two_alike(sample)
    spoiled = np.where(hole[..., np.newaxis], 0, image).astype(np.uint8)
    made = ts.fill(spoiled, hole, by="shifts")
    np.testing.assert_array_equal(made.image, image)
    shift = made.source[hole] - np.argwhere(hole)
    assert (shift == (0, 90)).all()
    assert repr(made).startswith("Synthesis(180 × 120 px, 1 patch of")


@pytest.mark.medium
def test_a_slope_of_light_runs_on_and_nothing_appears_in_it():
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:160, :200]
    sky = 60 + 0.5 * y + 0.35 * x + rng.normal(0, 1, y.shape)
    image = sky.copy()
    for row, column in ((30, 40), (120, 160), (130, 40), (40, 165)):
        image[disc(image.shape, row, column, 9)] = 10
    hole = disc(image.shape, 80, 100, 24)
    image[hole] = 255
    made = ts.fill(np.clip(image, 0, 255).astype(np.uint8), hole)
    assert made.settings["by"] == "shifts"
    off = np.abs(made.image.astype(float) - sky)[hole]
    assert off.max() < 12  # the noise of two pictures, and no dark disc
    assert off.mean() < 2.5
    hard = ts.fill(np.clip(image, 0, 255).astype(np.uint8), hole, level=False)
    copied = np.clip(image, 0, 255).astype(np.uint8)[hard.source[..., 0], hard.source[..., 1]]
    assert (
        np.abs(copied.astype(float) - hard.image)[hole].mean() < 2
    )  # all copies, but for the mixing at seams


@pytest.mark.medium
def test_only_hole_and_band_change_and_only_allowed_pixels_copy():
    image = skimage.data.chelsea()[60:180, 120:300]
    hole, avoid = disc(image.shape[:2], 55, 60, 18), np.zeros(image.shape[:2], bool)
    avoid[:, 100:] = True
    made = ts.fill(image, hole, by="shifts", band=4, avoid=avoid)
    beyond = ndimage.distance_transform_edt(~hole) > 4
    np.testing.assert_array_equal(made.image[beyond], image[beyond])
    place = made.source[made.labels > 0]
    assert not (hole | avoid)[place[:, 0], place[:, 1]].any()
    assert (made.labels[hole] > 0).all()
    again = ts.fill(image, hole, by="shifts", band=4, avoid=avoid)
    np.testing.assert_array_equal(again.image, made.image)


@pytest.mark.medium
def test_separate_holes_are_filled_and_alpha_is_kept():
    image = skimage.data.coffee()[:140, 400:600]
    alpha = np.full(image.shape[:2], 255, np.uint8)
    alpha[:10] = 0
    hole = (
        disc(image.shape[:2], 40, 40, 10)
        | disc(image.shape[:2], 100, 160, 10)
        | disc(image.shape[:2], 8, 100, 8)
    )
    made = ts.fill(image, hole, by="shifts", alpha=alpha)
    np.testing.assert_array_equal(made.alpha, alpha)
    assert (made.labels[hole & (alpha > 0)] > 0).all()
    assert (made.source[made.labels > 0][:, 0] >= 10).all()


@pytest.mark.medium
def test_a_hole_within_reach_of_few_shifts_is_filled(sample):
    image = sample(2, (90, 120), channels=3)
    hole = np.zeros(image.shape[:2], bool)
    hole[:, 8:100] = True
    made = ts.fill(image, hole, by="shifts")
    assert (made.labels[hole] > 0).all()
    assert not hole[made.source[hole][:, 0], made.source[hole][:, 1]].any()


@pytest.mark.medium
def test_maps_are_cut_alike_and_not_levelled(sample):
    image, hole = skimage.data.rocket()[100:220, 200:360], disc((120, 160), 60, 70, 16)
    other = sample(3, (120, 160), dtype=np.uint16)
    made = ts.fill(image, hole, by="shifts", maps=[other], smooth=0)
    np.testing.assert_array_equal(made.maps[0], other[made.source[..., 0], made.source[..., 1]])
    np.testing.assert_array_equal(made.apply(other), made.maps[0])


@pytest.mark.parametrize("name", ["brick", "grass", "gravel"])
def test_textures_are_told_from_photographs(name):
    image = getattr(skimage.data, name)()[:256, :256] / np.float32(255)
    hole = disc(image.shape, 120, 130, 40)
    assert is_texture(image[..., np.newaxis].__getitem__, hole, ~hole)
    photograph = skimage.data.astronaut()[:256, 256:] / np.float32(255)
    assert not is_texture(photograph.__getitem__, hole, ~hole)


def test_a_membrane_continues_a_slope_and_levelling_an_offset():
    y, x = np.mgrid[:40, :50].astype(np.float32)
    slope = (2 * x + 3 * y)[..., np.newaxis]
    region = disc((40, 50), 20, 25, 12)
    np.testing.assert_allclose(membrane(np.where(region[..., None], 0, slope), region), slope, atol=1e-2)
    # A copy 0.05 brighter than its surroundings: what is added takes just that away.
    plane = np.full((40, 110, 1), 0.5, np.float32)
    plane[:, 60:] = 0.55
    index = np.arange(plane.size, dtype=np.int32).reshape(40, 110)[:, :50].copy()
    index[region] += 60
    usable = np.ones((40, 110), bool)
    usable[:, :50] = ~region
    added = levelled(plane, usable, index, region)
    np.testing.assert_allclose(added[region], -0.05, atol=1e-4)
    assert (added[~region] == 0).all()
    # Ten times as much, and only on the right, is an edge there: it does not bleed into the copy.
    plane[:, 60:] = 1.0
    plane[:, :25] = 1.0
    assert np.abs(levelled(plane, usable, index, region)[region]).mean() < 0.03


def test_moves_lower_the_cost_below_what_chance_finds(sample):
    image = sample(4, (60, 64), channels=3) / np.float32(255)
    hole = disc((60, 64), 30, 30, 6)
    near = ndimage.binary_dilation(hole, iterations=2)
    rng = np.random.default_rng(5)
    shifts = np.array([(0, 20), (18, 0), (-17, 5), (9, -21)])
    ground = ground_of(image, hole, near)
    like = np.concatenate([image, image[..., :2]], axis=2)
    box = np.s_[22:39], np.s_[22:39]
    moves = ShiftMoves(ground, shifts, box, 1, like, like)
    moves.begin()
    start = moves.label.copy()
    before = moves.total(start)
    moves.sweep(range(4), 5, "heat", None)
    after = moves.total(moves.label)
    assert after < before
    for _ in range(300):
        chance = np.where(moves.hole, rng.integers(0, 4, start.shape), moves.itself)
        assert after < moves.total(chance)
    # No single pixel could be better off with another shift.
    for row, column in np.argwhere(moves.hole):
        for index in range(4):
            other = moves.label.copy()
            other[row, column] = index
            assert moves.total(other) >= after * (1 - 2e-3)


@pytest.mark.medium
@pytest.mark.parametrize("method", ["heat", "shortest-path", "dp", "thesis"])
def test_every_method_fills_as_well(sample, method):
    """Those that cut no networks leave it to "auto"."""
    image, hole = two_alike(sample)
    spoiled = np.where(hole[..., np.newaxis], 0, image).astype(np.uint8)
    np.testing.assert_array_equal(ts.fill(spoiled, hole, by="shifts", method=method).image, image)


@pytest.mark.medium
def test_a_large_region_is_decided_in_windows_at_little_cost(sample, monkeypatch):
    """Windows of 24 px on a region of 80: their seams cost a little more than those decided at once."""
    image = ndimage.gaussian_filter(sample(4, (120, 130), channels=3) / np.float32(255), (2, 2, 0))
    hole = disc((120, 130), 60, 64, 34)
    near = ndimage.binary_dilation(hole, iterations=4)
    shifts = np.array([(0, 70), (62, 0), (-64, 5), (9, -75), (-70, -8)])
    ground = ground_of(image, hole, near)
    like = np.concatenate([image, image[..., :2]], axis=2)
    box = np.s_[20:101, 24:105]
    start = ShiftMoves(ground, shifts, box, 4, like, like)
    start.begin()
    start.sweep(range(5), 3, "heat", None)
    label, costs, windows = start.spread(), [], []
    for at_once in (10**9, 0):
        monkeypatch.setattr(shift_moves, "_MOST_DECISIONS", at_once)
        monkeypatch.setattr(shift_moves, "_WINDOW", 24)
        moves = ShiftMoves(ground, shifts, box, 1, like, like)
        moves.refine(label, 4)
        before, seen = moves.total(moves.label), []
        free, first = moves.free.copy(), moves.label.copy()
        moves.sweep(range(5), 1, "heat", seen.append)
        windows.append(len(list(moves._windows())))
        costs.append(moves.total(moves.label))
        assert costs[-1] < before
        assert (moves.label[~free] == first[~free]).all()
        new = moves.label != first
        assert all(moves.allows(index)[new & (moves.label == index)].all() for index in range(5))
        assert seen == sorted(seen)
    assert windows[0] == 1
    assert windows[1] > 9
    assert costs[1] < 1.03 * costs[0]


@pytest.mark.medium
def test_an_oversized_region_keeps_seams_of_the_coarser_stride(sample, monkeypatch):
    image = sample(4, (120, 130), channels=3)
    hole = disc((120, 130), 60, 64, 34)
    swept, own = [], ShiftMoves.sweep
    monkeypatch.setattr(
        ShiftMoves, "sweep", lambda moves, *given: (swept.append(moves.stride), own(moves, *given))[1]
    )
    seen = []
    ts.fill(image, hole, by="shifts")
    assert swept == [2, 1]
    swept.clear()
    monkeypatch.setattr(texture_shifts, "_MOST_FREE", 0)
    made = ts.fill(image, hole, by="shifts", progress=seen.append)
    assert swept == [2]
    assert seen[-1] == pytest.approx(1)
    assert not hole[made.source[hole][:, 0], made.source[hole][:, 1]].any()


def test_many_unknowns_are_iterated_to_what_few_are_solved_to(monkeypatch):
    rng = np.random.default_rng(0)
    region = rng.random((90, 100)) > 0.05
    values = ndimage.gaussian_filter(rng.random((90, 100, 2)), (3, 3, 0)).astype(np.float32)
    steps = [
        (rng.normal(0, 0.02, values[s].shape).astype(np.float32), rng.random(region[s].shape, np.float32))
        for s in (np.s_[:, :-1], np.s_[:-1])
    ]
    solved = levelling._poisson(values, region, steps)
    monkeypatch.setattr(levelling, "_DIRECT", 2000)
    monkeypatch.setattr(levelling, "_MOST_STEPS", 40)  # far fewer than it takes without the coarse system
    assert np.abs(levelling._poisson(values, region, steps) - solved).mean() < 1 / 512


@pytest.mark.medium
def test_the_repeating_shift_of_a_picture_is_a_candidate(sample):
    image, hole = two_alike(sample)
    values = np.where(hole[..., np.newaxis], 0, image / np.float32(255)).astype(np.float32)
    atlas = Atlas.of([~hole], 4)
    found = candidate_shifts(atlas, atlas.spread([values]), hole, hole, 16, np.random.default_rng(0))
    assert (0, 90) in [tuple(shift) for shift in found.tolist()]
    assert len(np.unique(found, axis=0)) == len(found)


@pytest.mark.parametrize(
    ("options", "text"),
    [({"patch": 24}, "leave them out"), ({"overlap": 0.5}, "leave them out"), ({"band": -1}, "band")],
)
def test_what_would_be_ignored_is_refused(sample, options, text):
    image, hole = two_alike(sample)
    with pytest.raises(ts.OptionError, match=text):
        ts.fill(image, hole, by="shifts", **options)
    with pytest.raises(ts.OptionError, match="by is 'magic'"):
        ts.fill(image, hole, by="magic")


@pytest.mark.parametrize("shape", [(150, 70), (70, 150)])
def test_a_hole_near_the_end_of_a_picture_uses_its_whole_ring(sample, shape, monkeypatch):
    """The ring ends where the picture does, along each of its sides."""
    image = sample(5, shape, channels=3) / np.float32(255)
    hole = disc(shape, shape[0] - 20, shape[1] - 20, 8)
    atlas = Atlas.of([~hole], 4)
    asked = []
    fit = offsets.PatchSearch.fit

    def recorded(self, picture, weight, start, size):
        asked.append((picture.shape[:2], size))
        return fit(self, picture, weight, start, size)

    monkeypatch.setattr(offsets.PatchSearch, "fit", recorded)
    found = offsets._fitting(atlas, atlas.spread([image]), hole, hole)
    # The hole is 17 px a side, and the ring round it 8 px wide.
    assert asked[0] == ((33, 33), (33, 33))
    assert all(picture == size for picture, size in asked)
    assert len(found) > 8


def test_large_pictures_are_halved_before_their_statistics(sample, monkeypatch):
    factors = []
    reduced = offsets.reduced

    def recorded(picture, weight, factor):
        factors.append(factor)
        return reduced(picture, weight, factor)

    monkeypatch.setattr(offsets, "reduced", recorded)
    monkeypatch.setattr(offsets, "_MOST_PIXELS", 2000)
    image = sample(6, (90, 100), channels=3) / np.float32(255)
    hole = disc((90, 100), 45, 50, 8)
    offsets._dominant(image, ~hole, hole, 4, np.random.default_rng(0))
    assert factors == [4]  # 9000 / 4² is less than 2000, 9000 / 2² is not
