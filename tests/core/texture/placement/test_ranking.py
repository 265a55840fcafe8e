"""PlaceGrid ranked by how they fit, times the penalties."""

import dataclasses

import numpy as np
import pytest

import toposeam as ts
from toposeam.texture.canvas import Guide, IndexCanvas
from toposeam.texture.exemplar import Atlas, refined, values_at
from toposeam.texture.placement import PatchPlacer

SIDE, SHAPE = 48, (16, 16)


class Excluding:
    """A penalty that excludes every place but those in one column."""

    def __init__(self, column):
        self.column = column

    def factor(self, places):
        found = np.full(places.size, np.inf, np.float32)
        found[:, places.axes[1] == self.column] = 1
        return found


def placer():
    image = np.random.default_rng(0).random((SIDE, SIDE, 1)).astype(np.float32)
    atlas = Atlas.of([np.ones((SIDE, SIDE), bool)], 8)
    canvas = IndexCanvas((64, 64), (False, False), atlas.usable.size)
    features = atlas.spread([image])
    made = PatchPlacer(atlas, features, canvas, ts.texture.LayOptions(), np.random.default_rng(1), 64 * 64)
    made.lay(0, 0, SHAPE)
    return made


def test_a_penalty_excludes_places_unless_none_would_be_left():
    one = placer()
    column = one.margin + 5
    one.ranking.penalties.append(Excluding(column))
    site = one.site(0, 12, SHAPE)
    assert set(one.ranking.offers(site).columns) == {column}
    one.ranking.penalties.append(Excluding(column + 1))  # the two exclude every place
    assert set(one.ranking.offers(site).columns) == {column}


def test_use_is_known_anew_after_a_refresh():
    one = placer()
    site = one.site(0, 12, SHAPE)
    before = one.ranking.offers(site)
    one.canvas.usage[:] = 0
    one.canvas.usage.reshape(one.atlas.usable.shape)[:, : SIDE // 2] = 100
    kept = one.ranking.offers(site)
    one.refresh()
    after = one.ranking.offers(site)
    np.testing.assert_array_equal(kept.columns, before.columns)
    assert (after.columns >= SIDE // 2).all()
    assert (before.columns < SIDE // 2).any()


def plain_placer(factor=1, guide=None, **options):
    """A placer without penalties, on whose canvas lies one patch."""
    rng = np.random.default_rng(2)
    atlas = dataclasses.replace(Atlas.of([np.ones((60, 71), bool)], 8), factor=factor)
    canvas = IndexCanvas((64, 67), (False, False), atlas.usable.size)
    features = atlas.spread([rng.random((60, 71, 2)).astype(np.float32)])
    guide = guide and Guide(
        source=atlas.spread([rng.random((60, 71, 1)).astype(np.float32)]),
        target=rng.random((64, 67, 1)).astype(np.float32),
        weight=guide,
    )
    made = PatchPlacer(atlas, features, canvas, ts.texture.LayOptions(**options), rng, 0, guide)
    made.lay(40, 0, SHAPE)
    return made


@pytest.mark.parametrize("factor", [1, 2])
def test_the_best_places_some_px_apart_are_offered(factor):
    one = plain_placer(factor, candidates=12, copy_share=1.0, copy_patches=100)
    m, shape = one.margin, (24, 41)
    site, search, apart = one.site(30, 10, shape), one.ranking.search, 3
    values = values_at(one.features, site.known)
    left = search.fit(values, site.weight, (m, m), shape)
    i, j = np.indices(left.shape)
    found = []
    for _ in range(12):
        place = np.unravel_index(left.argmin(), left.shape)
        if np.isfinite(left[place]):
            found.append(place)
        left[factor * np.maximum(abs(i - place[0]), abs(j - place[1])) <= apart] = np.inf
    rows, columns = m + factor * np.array(found).T
    offers = one.ranking.offers(site)
    if factor > 1:
        sample = search.sample(values, site.weight, (m, m))
        rows, columns, errors = refined([(search, sample, 1.0)], rows, columns, (m, m), shape)
        np.testing.assert_allclose(offers.errors - errors, 0.01**2, atol=1e-6)
    np.testing.assert_array_equal(offers.rows, rows)
    np.testing.assert_array_equal(offers.columns, columns)


def test_errors_are_means_over_the_overlap_and_the_guide():
    one, m, (h, w) = plain_placer(guide=0.3), 8, (19, 16)
    assert one.margin == m
    site = one.site(50, 3, (h, w))  # reaches beyond the canvas
    offers, guide = one.ranking.offers(site), one._guide
    assert len(offers.errors) == 8
    for row, column, error in zip(offers.rows, offers.columns, offers.errors, strict=True):
        there = np.s_[row - m : row + h + m, column - m : column + w + m]
        off = np.square(one.features[there] - values_at(one.features, site.known)).sum(axis=2)
        counts = site.weight * one.atlas.usable[there]
        wanted = guide.target[50:, 3 : 3 + w]  # 14 of 19 rows
        unlike = np.square(guide.source[row : row + 14, column : column + w] - wanted).mean()
        expected = 0.7 * (off * counts).sum() / counts.sum() + 0.3 * unlike
        assert error == pytest.approx(expected + 0.01**2, rel=1e-3)


@pytest.mark.parametrize(("patches", "grows"), [(1.75, True), (1.74, False)])
def test_a_copy_is_continued_up_to_its_limit(patches, grows):
    one = plain_placer(copy_patches=patches, copy_share=1.0)
    site = one.site(40, 12, SHAPE)  # 12 of 16 columns are empty: 256 px and 192 more
    offers = one.ranking.offers(site)
    assert offers.new == 192
    ((row, column, first),) = set(offers.continued)
    away = np.maximum(abs(offers.rows - row), abs(offers.columns - column))
    assert (away.min() == 0) == grows
    assert grows or away.min() > 3
    assert first == one.canvas.copy_of(int(one.canvas.labels[40, 0]))


def test_the_largest_copy_is_bounded_by_patches_and_share():
    def largest(new=None, **options):
        return plain_placer(**options).ranking.largest_copy((16, 20), new)

    half = 60 * 71 // 2
    assert largest(copy_patches=3.0, copy_share=0.5) == 3 * 320
    assert largest(copy_patches=100, copy_share=0.5) == half
    assert largest(100, copy_patches=100, copy_share=0.5) == half - 110  # half of the overlap may be won
    assert largest(copy_patches=100, copy_share=0.01) == 320
