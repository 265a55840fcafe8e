import numpy as np
import pytest

from toposeam.images import box_of
from toposeam.texture.exemplar import Atlas, PatchSearch, box_sum, reduced, whole


def brute_force(features, usable, values, weight, margin, patch):
    """The definition, place by place; inf where the patch has no room or a window pixel is off the atlas."""
    (height, width), (h, w) = usable.shape, weight.shape
    error = np.full((height - h + 1, width - w + 1), np.inf)
    for y in range(error.shape[0]):
        for x in range(error.shape[1]):
            part = slice(y, y + h), slice(x, x + w)
            room = usable[y + margin : y + margin + patch[0], x + margin : x + margin + patch[1]]
            share = weight * usable[part]
            if room.all() and share.sum() >= 0.25 * weight.sum():
                error[y, x] = (share[..., None] * (features[part] - values) ** 2).sum() / share.sum()
    return error


@pytest.mark.parametrize("holes", [False, True])
def test_the_fit_is_the_weighted_mean_squared_difference(holes):
    rng = np.random.default_rng(0)
    exemplars = [rng.random((20, 24, 3)).astype(np.float32), rng.random((15, 19, 3)).astype(np.float32)]
    usable = [np.ones(image.shape[:2], bool) for image in exemplars]
    if holes:
        usable[0][5:8, 17:] = False
    atlas = Atlas.of(usable, 3)
    features = atlas.spread(exemplars) * atlas.usable[..., None]
    m, patch = atlas.margin, (7, 6)
    values = rng.random((patch[0] + 2 * m, patch[1] + 2 * m, 3)).astype(np.float32)
    weight = (rng.random(values.shape[:2]) * (rng.random(values.shape[:2]) > 0.3)).astype(np.float32)
    found = PatchSearch(atlas, features).fit(values, weight, (m, m), patch)
    expected = brute_force(features, atlas.usable, values, weight, m, patch)
    assert (np.isfinite(found) == np.isfinite(expected)).all()
    assert np.isfinite(expected).sum() > 100
    # float32 transforms of sums of about 100 terms
    np.testing.assert_allclose(found[np.isfinite(found)], expected[np.isfinite(expected)], atol=2e-5)


def tinted(scale, tints):
    """(40, 44, 3): what three planes of noise, of such weights, show along three directions of colour."""
    directions, _ = np.linalg.qr(np.random.default_rng(2).random((3, 3)))
    planes = np.random.default_rng(3).random((40, 44, 3)) * tints
    return (scale * planes @ directions).astype(np.float32)


@pytest.mark.parametrize(
    ("scale", "tints", "counted"),
    [
        (1.0, (1.0, 0.5, 0.002), 2),
        (1.0, (1.0, 0.005, 0.002), 1),
        (1e-3, (1.0, 0.5, 0.002), 2),  # a faint picture as well as any
        (1.0, (1.0, 0.5, 0.05), 3),
        (0.0, (1.0, 1.0, 1.0), 1),
    ],
)
def test_colours_are_compared_along_the_directions_that_count(monkeypatch, scale, tints, counted):
    image, weight = tinted(scale, tints), np.ones((16, 16), np.float32)
    atlas = Atlas.of([np.ones(image.shape[:2], bool)], 3)
    m = atlas.margin
    patch, found, spectra = (16 - 2 * m, 16 - 2 * m), [], PatchSearch._spectra

    def noted(self, planes):
        found.append(len(planes))
        return spectra(self, planes)

    search, values = PatchSearch(atlas, atlas.spread([image])), (image[20:36, 5:21] + image[3:19, 9:25]) / 2
    search.fit(values, weight, (m, m), patch)
    monkeypatch.setattr(PatchSearch, "_spectra", noted)
    error = search.fit(values, weight, (m, m), patch)
    assert found == [counted + 1]  # and the squares
    expected = brute_force(atlas.spread([image]), atlas.usable, values, weight, m, patch)
    fits = np.isfinite(expected)
    np.testing.assert_allclose(error[fits], expected[fits], rtol=0.001, atol=1e-12)


def test_the_nine_places_round_one_have_the_same_error():
    rng = np.random.default_rng(4)
    image, usable = rng.random((30, 33, 2)).astype(np.float32), np.ones((30, 33), bool)
    usable[20:, :3] = False
    atlas = Atlas.of([usable], 3)
    features = atlas.spread([image]) * atlas.usable[..., None]
    m, patch = atlas.margin, (7, 6)
    values = rng.random((patch[0] + 2 * m, patch[1] + 2 * m, 2)).astype(np.float32)
    weight = rng.random(values.shape[:2]).astype(np.float32)
    expected = brute_force(features, atlas.usable, values, weight, m, patch)
    search = PatchSearch(atlas, features)
    sample = search.sample(values, weight, (m, m))
    middles = np.array([2 * m + 4, m + 3]), np.array([m + 2, m + 7])
    rows, columns, error = search.around(*middles, 3, sample, (m, m), patch)
    assert rows.shape == columns.shape == error.shape == (2, 9)
    assert (rows[0].reshape(3, 3)[:, 0] - rows[0, 0]).tolist() == [0, 3, 6]
    assert (np.stack([rows[:, 4], columns[:, 4]]) == middles).all()
    np.testing.assert_allclose(error, expected[rows - m, columns - m], rtol=1e-4)


def test_a_large_exemplar_is_searched_reduced_and_then_exactly():
    rng = np.random.default_rng(1)
    image = rng.random((400, 360, 1)).astype(np.float32)
    image = (image + np.roll(image, 1, 0) + np.roll(image, 1, 1) + np.roll(image, 1, (0, 1))) / 4
    atlas = Atlas.of([np.ones(image.shape[:2], bool)], 4)
    assert atlas.factor == 2
    search = PatchSearch(atlas, atlas.spread([image]))
    m = atlas.margin
    row, column = 137 + m, 90 + m
    values = search.features[row - m : row + 24 + m, column - m : column + 24 + m]
    weight = np.ones(values.shape[:2], np.float32)
    error = search.fit(values, weight, (m, m), (24, 24))
    i, j = np.unravel_index(error.argmin(), error.shape)
    sample = search.sample(values, weight, (m, m))
    rows, columns, exact = search.around(
        np.array([m + 2 * i]), np.array([m + 2 * j]), 1, sample, (m, m), (24, 24)
    )
    best = 0, exact.argmin()
    assert (rows[best], columns[best]) == (row, column)
    assert exact[best] == 0


def test_a_window_at_the_atlas_s_last_corner_is_refined():
    image = np.random.default_rng(2).random((400, 400, 1)).astype(np.float32)
    atlas = Atlas.of([np.ones((400, 400), bool)], 8)
    search, m = PatchSearch(atlas, atlas.spread([image])), atlas.margin
    values = np.zeros((32 + 2 * m, 32 + 2 * m, 1), np.float32)
    last = 400 - 32 + m
    sample = search.sample(values, np.ones(values.shape[:2], np.float32), (m, m))
    rows, columns, exact = search.around(np.array([last]), np.array([last]), 1, sample, (m, m), (32, 32))
    assert rows.max() == columns.max() == last
    assert np.isfinite(exact).all()


def test_box_sums_are_the_sums_of_boxes():
    values = np.random.default_rng(3).integers(0, 9, (11, 13))
    expected = np.lib.stride_tricks.sliding_window_view(values, (4, 5)).sum(axis=(2, 3))
    np.testing.assert_array_equal(box_sum(values, (4, 5)), expected)


def test_blocks_hold_weighted_means_and_shares_of_weight():
    values = np.float32([[1, 3, 10], [5, 7, 20]])[..., np.newaxis]
    weight = np.float32([[1, 1, 1], [1, 0, 0]])
    mean, share = reduced(values, weight, 2)
    assert mean[..., 0] == pytest.approx(np.array([[3, 10]]))  # what has no weight does not count
    assert share == pytest.approx(np.array([[0.75, 0.25]]))  # nor what lies outside


def test_indices_lead_back_to_exemplar_row_and_column():
    atlas = Atlas.of([np.ones((9, 5), bool), np.ones((4, 8), bool)], 2)
    plane = atlas.spread([np.full((9, 5, 1), 1), np.full((4, 8, 1), 2)])[..., 0]
    for number, (rows, columns) in enumerate(atlas.places):
        assert (plane[rows, columns] == number + 1).all()
        index = np.arange(plane.size, dtype=np.int32).reshape(plane.shape)[rows, columns]
        exemplar, place = atlas.locate(index)
        assert (exemplar == number).all()
        np.testing.assert_array_equal(place[..., 0], np.indices(index.shape)[0])
        np.testing.assert_array_equal(place[..., 1], np.indices(index.shape)[1])
        np.testing.assert_array_equal(atlas.index_of(exemplar, place), index)
    assert (atlas.locate(np.array([-1], np.int32))[1] == -1).all()


def test_the_box_of_a_mask_holds_all_of_it():
    mask = np.zeros((9, 8), bool)
    mask[2, 5] = mask[6, 3] = True
    assert box_of(mask) == (slice(2, 7), slice(3, 6))
    assert box_of(mask, 3) == (slice(0, 9), slice(0, 8))


@pytest.mark.parametrize("shape", [(1, 1), (2, 5), (7, 3), (20, 24), (21, 3), (3, 25)])
def test_boxes_are_whole_where_no_pixel_is_missing(shape):
    mask = np.random.default_rng(0).random((20, 24)) < 0.97
    missing = box_sum(~mask, shape)
    np.testing.assert_array_equal(whole(mask, shape), missing == 0)


def test_what_weights_say_is_kept_of_the_windows_that_came_last(monkeypatch):
    atlas = Atlas.of([np.ones((40, 40), bool)], 8)
    search = PatchSearch(atlas, atlas.spread([np.random.default_rng(0).random((40, 40, 1), np.float32)]))
    values, spectra, found = np.zeros((28, 28, 1), np.float32), PatchSearch._spectra, []

    def noted(self, planes):
        found.append(len(planes))
        return spectra(self, planes)

    monkeypatch.setattr(PatchSearch, "_spectra", noted)
    often, others = np.ones((28, 28), np.float32), np.ones((40, 28, 28), np.float32)
    for number, weight in enumerate(others):
        weight[0, : number % 28] = weight[1, : number // 28] = 0.5
        for one in often, weight:
            search.fit(values, one, (8, 8), (12, 12))
    assert found.count(1) == len(others)  # the one that comes again is looked at once, as the first of them
    assert len(search._kept) == 16
