"""The engine's operation that fills holes: what of a layer it looks at, and layers without opacity."""

import numpy as np
import pytest
from engine_requests import result_of

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
