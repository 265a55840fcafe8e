"""Panorama from Layers in a real GIMP."""

from pathlib import Path

import numpy as np
import pytest
from inside import refused, succeeded
from pictures import crops, photograph, write_png
from running import needs_gimp

needs_gimp()

SAMPLES = Path(__file__).parents[2] / "samples"
PANORAMA = "plug-in-toposeam-panorama"


@pytest.fixture
def opened(image, tmp_path):
    """Two pieces of a photograph and one of another, opened as layers."""
    whole = photograph(160, 300, seed=3)
    pieces = {"left": whole[:, :180], "right": whole[8:, 120:], "stranger": photograph(152, 180, seed=9)}
    for name, pixels in pieces.items():
        write_png(tmp_path / f"{name}.png", pixels)
    return whole, image([tmp_path / f"{name}.png" for name in pieces])


def panorama(gimp, loaded, **options):
    return succeeded(
        gimp.run(procedure=PANORAMA, image=loaded["image"], layers=loaded["layers"], options=options)
    )["layer"]


def test_layers_on_each_other_become_a_cropped_panorama(gimp, opened):
    whole, loaded = opened
    group = panorama(gimp, loaded, blend="none", **{"match-shading": False})
    after = gimp.tree(image=loaded["image"])
    assert after["layers"][0]["id"] == group
    assert [child["name"].removesuffix(" (stitched)") for child in after["layers"][0]["children"]] == [
        "right.png",
        "Background",
    ]
    assert not any(layer["visible"] for layer in after["layers"][1:])  # the stranger, too
    assert len(after["paths"]) == 1
    assert after["size"] == [300, 152]
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8")[..., :3], whole[8:])


def test_a_panorama_that_is_not_cropped_shows_all(gimp, opened):
    whole, loaded = opened
    panorama(gimp, loaded, crop="keep")
    seen = gimp.projection(loaded["image"], "R'G'B'A u8")
    assert seen.shape[:2] == whole.shape[:2]
    assert (seen[:8, 200:, 3] == 0).all()
    assert (seen[8:, :, 3] == 255).all()


def test_exact_scans_refuse_a_stranger_by_name(gimp, opened):
    _whole, loaded = opened
    options = {"pictures": "scans"}
    refused(gimp, loaded, "“stranger.png” shows nothing that the other layers show", PANORAMA, options)
    loaded["layers"].pop()
    panorama(gimp, loaded, **options)
    assert gimp.tree(image=loaded["image"])["size"] == [300, 152]


def test_photographs_of_nothing_in_common_are_refused(gimp, opened):
    _whole, loaded = opened
    refused(gimp, {**loaded, "layers": loaded["layers"][1:]}, "shows nothing that the other", PANORAMA)


def test_a_panorama_is_stitched_again_where_a_path_was_bent(gimp, opened):
    whole, loaded = opened
    group = panorama(gimp, loaded, blend="none", **{"match-shading": False})
    code = """
path = image_of(number).get_paths()[0]
path.remove_stroke(path.get_strokes()[0])
controls = [float(value) for point in ((150, 0), (150, 152)) for value in point * 3]
path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, controls, False)
"""
    gimp.python(code=code, number=loaded["image"])
    succeeded(gimp.run(procedure="plug-in-toposeam-restitch", image=loaded["image"], layers=[group]))
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8")[..., :3], whole[8:])
    upper = gimp.tree(image=loaded["image"])["layers"][0]["children"][0]["id"]
    code = "answer = item(number).get_mask().get_id()"
    mask, (x, _y) = gimp.pixels(gimp.python(code=code, number=upper), "Y u8")
    assert (mask[1:, : 150 - x] == 0).all()
    assert (mask[1:, 150 - x :] == 255).all()


@pytest.mark.parametrize(
    ("options", "format_name"),
    [({"precision": "U16_NON_LINEAR"}, "R'G'B'A u16"), ({"gray": True}, "Y'A u8")],
    ids=["16 bit", "gray"],
)
def test_panoramas_in_other_precisions_and_gray(gimp, image, tmp_path, options, format_name):
    whole = photograph(160, 300, seed=3)
    files, _places = crops(tmp_path, whole, [(0, 0), (120, 0)], 180, 160)
    loaded = image(files, **options)
    before, _ = gimp.pixels(loaded["layers"][0], format_name)
    panorama(gimp, loaded, blend="none", **{"match-shading": False})
    seen = gimp.projection(loaded["image"], format_name)
    assert seen.shape[:2] == (160, 300)
    assert seen.dtype == before.dtype
    np.testing.assert_array_equal(seen[:, :120], before[:, :120])


@pytest.mark.medium
def test_corners_of_a_warped_panorama_are_fitted(gimp, image):
    """What is filled is a layer of its own, and nothing of the canvas is transparent."""
    loaded = image([SAMPLES / f"portrait_{part}.jpg" for part in ("left", "right")])
    sizes = {}
    for corners in ("fit", "crop"):
        group = panorama(gimp, loaded, crop=corners)
        tree = gimp.tree(image=loaded["image"])
        sizes[corners] = np.prod(tree["size"])
        (made,) = (layer for layer in tree["layers"] if layer["id"] == group)
        assert (made["children"][0]["name"] == "Filled corners") == (corners == "fit")
        assert (gimp.projection(loaded["image"], "R'G'B'A u8")[..., 3] == 255).all()
        gimp.python(code="item(number).set_visible(False)", number=group)
    assert sizes["fit"] > sizes["crop"]
