"""Previews that the engine makes for dialogs."""

import numpy as np
import pytest
from engine_requests import result_of

import toposeam as ts


@pytest.mark.parametrize(
    ("of", "options", "shape"),
    [
        (
            "synthesize",
            {"width": 120, "height": 100, "patch": 40, "overlap": 0, "tileable": "none", "seed": 1},
            (50, 60),
        ),
        ("make_tileable", {"band": 16, "tileable": "both", "seed": 1}, (120, 160)),
        ("fill", {"from": "around", "patch": 24, "overlap": 0, "band": 0, "seed": 1}, (60, 80)),
    ],
)
def test_previews_of_textures(request_folder, of, options, shape):
    pixels = np.dstack([np.random.default_rng(0).integers(0, 256, (60, 80, 3)), np.full((60, 80), 255)])
    layer = request_folder.raster("layer", pixels.astype(np.uint8))
    selected = np.zeros((60, 80), np.uint8)
    selected[20:32, 30:44] = 255
    selection = request_folder.raster("selection", selected) if of == "fill" else None
    result = result_of(
        request_folder.ask(
            operation="preview", of=of, scale=0.5, layer=layer, selection=selection, options=options
        )
    )
    assert request_folder.pixels(result["picture"]).shape == (*shape, 4)


def test_a_preview_of_a_motif_is_small_and_repeats(request_folder):
    options = {
        "size": 1024,
        "repeat": "p4m",
        "layers": 2,
        "palette": "random",
        "mass": 0.0,
        "penalty": 3.0,
        "iterations": 500,
        "seed": 1,
        "base_strength": 0.7,
    }
    request = {"operation": "preview", "of": "motif", "scale": 1.0, "layer": None, "options": options}
    shown = request_folder.pixels(result_of(request_folder.ask(**request))["picture"])
    assert shown.shape == (192, 192, 4)
    np.testing.assert_array_equal(shown[:96], shown[96:])


def test_a_preview_of_a_large_texture_shows_a_part_of_it(request_folder):
    pixels = np.random.default_rng(0).integers(0, 256, (60, 80, 4)).astype(np.uint8)
    pixels[..., 3] = 255
    layer = request_folder.raster("layer", pixels)
    options = {"width": 1000, "height": 800, "patch": 24, "overlap": 0, "tileable": "none", "seed": 1}
    request = {"of": "synthesize", "scale": 1.0, "extent": 0.1, "layer": layer, "options": options}
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    assert shown.shape == (80, 100, 4)


def test_a_preview_of_a_pattern_is_in_its_colours(request_folder):
    density = np.zeros((20, 30), np.uint8)
    density[:, :10] = 255
    request = {
        "of": "repeat",
        "scale": 1.0,
        "densities": [request_folder.raster("ink", density)],
        "repeat": "translate",
        "inks": ["#204080"],
        "paper": "#ffffff",
        "options": {"rows": 1, "columns": 2, "repeat": "reflect", "palette": "own"},
    }
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    assert shown.shape == (20, 60, 4)
    np.testing.assert_array_equal(
        shown[0, [0, 15, 45, 59], :3], [[32, 64, 128], [255] * 3, [255] * 3, [32, 64, 128]]
    )
    request["options"] = {"rows": 2, "columns": 1, "repeat": "own", "palette": "sea"}
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    assert shown.shape == (40, 30, 4)
    paper, ink = (
        tuple(int(part[at : at + 2], 16) for at in (1, 3, 5)) for part in ts.motif.PALETTES["sea"][:2]
    )
    assert tuple(shown[0, 20, :3]) == paper
    assert np.abs(shown[0, 0, :3].astype(int) - ink).max() <= 40  # the ink on that paper


def test_the_preview_of_an_animation_stacks_its_frames(request_folder):
    clip = np.random.default_rng(0).integers(0, 256, (10, 12, 16, 4)).astype(np.uint8)
    clip[..., 3] = 255
    layers = [request_folder.raster(str(index), frame) for index, frame in enumerate(clip)]
    options = {"length": 6, "transition": 2, "level": False}
    request = {"of": "loop", "scale": 0.5, "layers": layers, "options": options}
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    expected = ts.loop(clip[..., :3], length=6, transition=2).frames
    np.testing.assert_array_equal(shown[..., :3].reshape(6, 12, 16, 3), expected)


@pytest.mark.parametrize("before", [False, True])
def test_a_large_preview_of_seams_is_drawn_small_first(request_folder, before):
    rng = np.random.default_rng(0)
    whole = np.kron(rng.integers(0, 256, (70, 110, 3)), np.ones((10, 10, 1))).astype(np.uint8)
    whole = np.dstack([whole, np.full(whole.shape[:2], 255, np.uint8)])
    layers = [
        request_folder.raster("left", whole[:, :700]),
        request_folder.raster("right", whole[:, 400:], (400, 0)),
    ]
    scene = {"operation": "preview", "of": "stitch", "scale": 0.5, "layers": layers, "selection": None}
    scene |= {"options": {"blend": "feather", "blend_width": 40.0}, "before": before, "seam_line": False}
    first = result_of(request_folder.ask(**scene))
    rough = request_folder.pixels(first["picture"])
    second = result_of(request_folder.ask(**scene, exact=True))
    assert (first["rough"], second["rough"]) == (not before, False)
    fine = request_folder.pixels(second["picture"])
    assert fine.shape == whole.shape
    if not before:
        assert rough.shape[0] <= whole.shape[0] // 2
        step = whole.shape[0] // rough.shape[0]
        height, width = rough.shape[0] * step, rough.shape[1] * step
        means = fine[:height, :width].reshape(rough.shape[0], step, rough.shape[1], step, 4).mean((1, 3))
        assert np.abs(means - rough).mean() < 3


def test_photographs_lie_beside_each_other_before(request_folder):
    pixels = np.full((40, 50, 4), 255, np.uint8)
    layers = [request_folder.raster(name, pixels) for name in "ab"]
    scene = {"operation": "preview", "of": "stitch", "scale": 1.0, "layers": layers, "selection": None}
    answer = request_folder.ask(**scene, places="anywhere", options={}, before=True)
    shown = request_folder.pixels(result_of(answer)["picture"])
    assert (shown.shape[0], shown[0, :, 3].min(), (shown[0, :, 3] > 0).sum()) == (40, 0, 100)
