"""The engine's operation that fills holes: what of a layer it looks at, and layers without opacity."""

import numpy as np
import pytest
from engine_requests import message_of, result_of

import toposeam as ts

OPTIONS = {"from": "layer", "patch": 24, "overlap": 0, "band": 0, "seed": 1}
HOLE = np.s_[640:700, 650:720]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def _layer(rng):
    """(1300, 1400, 3), dark noise, and bright noise farther from the hole than 512 px."""
    pixels = rng.integers(0, 100, (1300, 1400, 3), np.uint8)
    pixels[:128] += 128
    pixels[:, 1232:] += 128
    return pixels


def _filled(request_folder, pixels, **more):
    hole = np.zeros(pixels.shape[:2], np.uint8)
    hole[HOLE] = 255
    layer = request_folder.raster("layer", pixels, (30, 20))
    selection = request_folder.raster("hole", hole, (30, 20))
    request = {"operation": "fill", "layer": layer, "selection": selection, "source": None}
    picture = result_of(request_folder.ask(**request, options={**OPTIONS, **more}))["picture"]
    x, y = picture["at"]
    return request_folder.pixels(picture), (y - 20, x - 30)


def test_a_hole_in_a_large_layer_is_filled_from_around_it(request_folder, rng):
    pixels = _layer(rng)
    made, (top, left) = _filled(request_folder, pixels)
    assert made.shape[0] < 100
    part, hole = np.s_[640 - 512 : 700 + 512, 650 - 512 : 720 + 512], np.zeros(pixels.shape[:2], bool)
    hole[HOLE] = True
    near = ts.fill(pixels[part], hole[part], patch=24, seed=1).image
    expected = pixels.copy()
    expected[part] = near
    shown = pixels[top : top + made.shape[0], left : left + made.shape[1]].copy()
    shown[made[..., 3] > 0] = made[made[..., 3] > 0][:, :3]
    np.testing.assert_array_equal(shown, expected[top : top + made.shape[0], left : left + made.shape[1]])
    assert made[made[..., 3] > 0][:, :3].max() < 100


def test_a_hole_amid_transparency_is_filled_from_afar(request_folder, rng):
    pixels = np.dstack([_layer(rng), np.zeros((1300, 1400), np.uint8)])
    pixels[:100, :, 3] = 255
    pixels[HOLE][..., 3] = 255
    made, _place = _filled(request_folder, pixels)
    assert made[..., :3].min() >= 128  # bright noise, farther off than is looked at where something is near


@pytest.mark.parametrize("where", ["layer", "around"])
def test_a_layer_without_opacity_is_opaque(request_folder, rng, where):
    pixels = _layer(rng)
    opaque, place = _filled(request_folder, pixels, **{"from": where})
    full = np.full(pixels.shape[:2], 255, np.uint8)
    made, other = _filled(request_folder, np.dstack([pixels, full]), **{"from": where})
    assert place == other
    np.testing.assert_array_equal(opaque, made)


def test_gray_layers_without_opacity_can_be_stitched(request_folder, rng):
    wide = rng.integers(0, 255, (40, 90), np.uint8)
    parts = {"left": (wide[:, :60], (0, 0)), "right": (wide[:, 30:], (30, 0))}
    answers = []
    for opacity in (False, True):
        layers = [
            request_folder.raster(
                name, np.dstack([part, np.full(part.shape, 255, np.uint8)]) if opacity else part, at
            )
            for name, (part, at) in parts.items()
        ]
        answer = result_of(request_folder.ask(operation="stitch", layers=layers, options={}))
        answers.append([raster and request_folder.pixels(raster) for raster in answer["masks"]])
    assert answers[0][0] is None
    np.testing.assert_array_equal(answers[0][1], answers[1][1])


def test_a_preview_at_full_size_is_the_result(request_folder, rng):
    pixels = _layer(rng)
    made, (top, left) = _filled(request_folder, pixels)
    hole = np.zeros(pixels.shape[:2], np.uint8)
    hole[HOLE] = 255
    part = np.s_[640 - 530 : 700 + 530, 650 - 540 : 720 + 540]
    scene = {
        "operation": "preview",
        "of": "fill",
        "scale": 1.0,
        "layer": {**request_folder.raster("part", pixels[part], (110, 110)), "cut_from": hole.size},
        "selection": request_folder.raster("part-hole", hole[part], (110, 110)),
        "source": None,
        "shown": [left - 110, top - 110, made.shape[1], made.shape[0]],
        "options": OPTIONS,
    }
    drawn = request_folder.pixels(result_of(request_folder.ask(**scene))["picture"])
    inside = made[..., 3] > 0
    np.testing.assert_array_equal(drawn[inside], made[inside])
    before = request_folder.pixels(result_of(request_folder.ask(**scene, before=True))["picture"])
    height, width = made.shape[:2]
    np.testing.assert_array_equal(before[..., :3], pixels[top : top + height, left : left + width])


def test_a_preview_darkens_what_is_not_copied(request_folder, rng):
    pixels = rng.integers(100, 200, (300, 320, 3), np.uint8)
    hole = np.zeros(pixels.shape[:2], np.uint8)
    hole[200:230, 200:230] = 255
    layer, selection = request_folder.raster("layer", pixels), request_folder.raster("hole", hole)
    scene = {"operation": "preview", "of": "fill", "scale": 1.0, "layer": layer, "selection": selection}
    answer = request_folder.ask(**scene, source=None, options={**OPTIONS, "from": "around"})
    drawn = request_folder.pixels(result_of(answer)["picture"])[..., :3]
    np.testing.assert_array_equal(drawn[:100], pixels[:100] // 3)
    np.testing.assert_array_equal(drawn[160:180, 160:180], pixels[160:180, 160:180])


@pytest.mark.parametrize("where", ["layer", "around", "other"])
def test_a_preview_shows_what_is_copied_from(request_folder, rng, where):
    """Bright is what is copied: not the hole, nothing far off, of a mask what is white."""
    pixels = rng.integers(100, 200, (300, 320, 3), np.uint8)
    hole, white = np.zeros((2, *pixels.shape[:2]), np.uint8)
    hole[200:230, 200:230] = white[:, :50] = 255
    scene = {
        "operation": "preview",
        "of": "fill",
        "scale": 1.0,
        "copied": True,
        "layer": request_folder.raster("layer", pixels),
        "selection": request_folder.raster("hole", hole),
        "source": request_folder.raster("white", white) | {"is_mask": True} if where == "other" else None,
    }
    answer = request_folder.ask(**scene, options={**OPTIONS, "from": where})
    drawn = request_folder.pixels(result_of(answer)["picture"])[..., :3]
    bright = (drawn == pixels).all(axis=2)
    assert (bright | (drawn == pixels // 3).all(axis=2)).all()
    assert not bright[205:225, 205:225].any()
    assert bright[150, 10] == (where != "around")
    assert bright[190, 190] == (where != "other")


def _bright(request_folder, pixels, hole, at=(0, 0), source=None, **more):
    """(H, W) bool: what of a layer may be copied, as the preview shows it."""
    colours = pixels[..., :3]
    scene = {
        "operation": "preview",
        "of": "fill",
        "scale": 1.0,
        "copied": True,
        "layer": {**request_folder.raster("layer", pixels, at), **more},
        "selection": request_folder.raster("hole", hole, at),
        "source": source,
    }
    options = {**OPTIONS, "from": "layer" if source is None else "other"}
    if source == "around":
        options, scene["source"] = {**OPTIONS, "from": "around"}, None
    drawn = request_folder.pixels(result_of(request_folder.ask(**scene, options=options))["picture"])
    return (drawn[..., :3] == colours).all(axis=2)


@pytest.mark.parametrize(("fewer", "scarce"), [(0, False), (1, True), (100, True), (-200, False)])
@pytest.mark.parametrize(("longer", "reach"), [(10, 512), (400, 600)])
def test_a_hole_with_little_around_it_looks_at_all(request_folder, rng, fewer, scarce, longer, reach):
    """Twice as much as is selected is enough; in large layers what lies within 512 px, or one and a half
    times the hole, is near.
    """
    pixels = np.dstack([rng.integers(100, 200, (7, 1500, 3), np.uint8), np.zeros((7, 1500), np.uint8)])
    hole = np.zeros((7, 1500), np.uint8)
    hole[2, 5 : 5 + longer], hole[4, 5:60] = 255, 255
    edge = 5 + max(longer, 55) + reach
    near = np.argwhere((hole == 0) & (np.arange(1500) < edge))
    near = near[-(2 * np.count_nonzero(hole) - fewer) :]
    pixels[near[:, 0], near[:, 1], 3] = 1
    pixels[:, edge:, 3] = 255
    bright = _bright(request_folder, pixels, hole, (30, 20), cut_from=(1 << 20) + 1)
    expected = (hole == 0) & (pixels[..., 3] > 0)
    expected[:, edge:] &= scarce
    np.testing.assert_array_equal(bright, expected)


@pytest.mark.parametrize(("size", "everywhere"), [(1 << 20, True), ((1 << 20) + 1, False)])
def test_small_layers_are_looked_at_as_a_whole(request_folder, rng, size, everywhere):
    pixels, hole = rng.integers(100, 200, (9, 900, 3), np.uint8), np.zeros((9, 900), np.uint8)
    hole[4, 10:12] = 255
    bright = _bright(request_folder, pixels, hole, cut_from=size)
    assert bright[:, 12 + 512 :].any() == everywhere
    assert bright[:, : 12 + 512].sum() == 9 * (12 + 512) - 2


@pytest.mark.parametrize(("height", "width", "reach"), [(3, 5, 48), (48, 9, 48), (60, 20, 60), (7, 70, 70)])
def test_around_is_as_far_as_the_selection_is_long(request_folder, rng, height, width, reach):
    pixels, hole = rng.integers(100, 200, (260, 290, 3), np.uint8), np.zeros((260, 290), np.uint8)
    hole[90 : 90 + height, 95 : 95 + width] = 255
    hole[91, 96] = 127  # hardly selected, so it is copied
    expected = np.zeros(hole.shape, bool)
    expected[90 - reach : 90 + height + reach, 95 - reach : 95 + width + reach] = True
    expected &= hole < 128
    np.testing.assert_array_equal(_bright(request_folder, pixels, hole, source="around"), expected)
    # At a corner of the layer there is less.
    moved = np.roll(hole, (-88, 290 - 95 - width), (0, 1))
    expected[:] = False
    expected[: 2 + height + reach, 290 - width - reach :] = True
    expected &= moved < 128
    np.testing.assert_array_equal(_bright(request_folder, pixels, moved, source="around"), expected)


@pytest.mark.parametrize("at", [(17, 31), (60, 5), (-40, 90), (200, 300), (25, 21)])
def test_a_mask_counts_where_it_lies(request_folder, rng, at):
    """White where it is 128 or more; it may go beyond the layer, or lie beside it."""
    pixels, hole = rng.integers(100, 200, (50, 70, 3), np.uint8), np.zeros((50, 70), np.uint8)
    hole[20:24, 30:33] = 255
    white = rng.choice(np.array([0, 127, 128, 255], np.uint8), (33, 64))
    source = request_folder.raster("white", white, at) | {"is_mask": True}
    bright = _bright(request_folder, pixels, hole, (25, 20), source)
    expected = np.zeros(hole.shape, bool)
    for (row, column), value in np.ndenumerate(white):
        y, x = row + at[1] - 20, column + at[0] - 25
        if 0 <= y < 50 and 0 <= x < 70:
            expected[y, x] = value >= 128 and not hole[y, x]
    np.testing.assert_array_equal(bright, expected)


@pytest.mark.parametrize("opacity", [False, True])
@pytest.mark.parametrize("size", [(40, 90), (110, 40)])
def test_another_picture_of_any_size_fills_the_hole(request_folder, rng, opacity, size):
    """As if it were to the right of the layer, and only there could be copied from; not where it is
    transparent.
    """
    pixels, hole = rng.integers(0, 100, (80, 60, 3), np.uint8), np.zeros((80, 60), np.uint8)
    hole[30:41, 20:33] = 255
    other, full = rng.integers(130, 200, (*size, 3), np.uint8), np.full(size, 255, np.uint8)
    if opacity:
        full[:, : size[1] // 2] = 0
    request = {
        "operation": "fill",
        "layer": request_folder.raster("layer", pixels, (30, 20)),
        "selection": request_folder.raster("hole", hole, (30, 20)),
        "source": request_folder.raster("other", np.dstack([other, full]) if opacity else other, (4, 3)),
    }
    answer = request_folder.ask(**request, options={**OPTIONS, "from": "other", "patch": 8})
    picture = result_of(answer)["picture"]
    made, (x, y) = request_folder.pixels(picture), picture["at"]
    rows = max(80, size[0])
    wide, alpha, own = (
        np.hstack([np.pad(one, [(0, rows - len(one)), *[(0, 0)] * (one.ndim - 1)]) for one in both])
        for both in ((pixels, other), (np.full_like(hole, 255), full), (hole > 0, np.zeros(size, bool)))
    )
    source = np.arange(wide.shape[1]) >= np.full((rows, 1), 60)
    source[size[0] :] = False
    expected = ts.fill(wide, own, source=source, alpha=alpha, patch=8, seed=1).image[:80, :60]
    shown = pixels.copy()
    part = shown[y - 20 : y - 20 + made.shape[0], x - 30 : x - 30 + made.shape[1]]
    part[made[..., 3] > 0] = made[made[..., 3] > 0][:, :3]
    np.testing.assert_array_equal(shown, expected)
    assert (shown[hole > 0] != pixels[hole > 0]).any()


def _from_discs(request_folder, rng, only):
    pixels, hole = rng.integers(100, 200, (300, 320, 3), np.uint8), np.zeros((300, 320), np.uint8)
    hole[200:230, 200:230] = 255
    scene = {
        "operation": "preview",
        "of": "fill",
        "scale": 1.0,
        "copied": True,
        "layer": request_folder.raster("layer", pixels, (30, 20)),
        "selection": request_folder.raster("hole", hole, (30, 20)),
        "source": None,
    }
    answer = request_folder.ask(**scene, options={**OPTIONS, "only": only})
    return answer, pixels


def test_only_what_was_painted_is_copied(request_folder, rng):
    answer, pixels = _from_discs(request_folder, rng, "130,120,40;160,120,40")
    drawn = request_folder.pixels(result_of(answer)["picture"])[..., :3]
    y, x = np.mgrid[:300, :320]
    painted = np.minimum(np.hypot(x - 100, y - 100), np.hypot(x - 130, y - 100)) <= 40
    np.testing.assert_array_equal((drawn == pixels).all(axis=2), painted)


@pytest.mark.parametrize("only", ["here", "1,2", "1,2,3;4"])
def test_discs_that_are_none_are_refused(request_folder, rng, only):
    assert "give discs as x,y,radius" in message_of(_from_discs(request_folder, rng, only)[0])
