"""PlaceGrid ranked by how they fit, times the penalties."""

import numpy as np

import toposeam as ts
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.exemplar import Atlas
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
