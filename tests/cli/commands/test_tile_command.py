import json

import numpy as np
import pytest
from skimage import data

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_picture(
        "gravel.png", Picture(pixels=np.ascontiguousarray(data.gravel()[:120, :140]).astype(np.uint16) * 257)
    )
    return tmp_path


def test_only_the_band_changes_and_the_preview_repeats_the_tile(toposeam):
    ran = toposeam(
        "tile",
        "gravel.png",
        "--band",
        "20",
        "-o",
        "tile.png",
        "--preview",
        "nine.png",
        "--seams",
        "seams.svg",
    )
    assert ran.code == 0, ran
    given, made, nine = (read_picture(name).pixels for name in ("gravel.png", "tile.png", "nine.png"))
    assert made.dtype == np.uint16
    np.testing.assert_array_equal(made[20:-20, 20:-20], given[20:-20, 20:-20])
    assert (made != given).mean() > 0.1
    np.testing.assert_array_equal(nine, np.tile(made, (3, 3)))


def test_on_one_axis_the_other_borders_stay(toposeam):
    assert toposeam("tile", "gravel.png", "--tileable", "x", "--band", "20", "-o", "tile.png").code == 0
    given, made = read_picture("gravel.png").pixels, read_picture("tile.png").pixels
    np.testing.assert_array_equal(made[:, 20:-20], given[:, 20:-20])


@pytest.mark.parametrize(
    ("arguments", "phrase"),
    [
        (("--band", "50", "-o", "o.png"), "band is 50"),
        (("--band", "1", "-o", "o.png"), "band is 1"),
        (("-o", "gravel.png"), "--force"),
        (("--also", "none.png", "-o", "o.png"), "none.png"),
        (("-o", "o.png", "--preview", "o.png"), "same name"),
        (("-o", "o.png", "--seams", "o.png"), "not supported"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_leaves_nothing(toposeam, folder, arguments, phrase):
    toposeam("tile", "gravel.png", *arguments).fails(phrase)
    assert [path.name for path in folder.iterdir()] == ["gravel.png"]


def test_when_one_of_several_outputs_fails_none_is_left(toposeam, folder):
    gravel = read_picture("gravel.png").pixels
    alpha = np.full_like(gravel, 65535)
    alpha[50:60, 60:70] = 0
    write_picture("gravel.png", Picture(pixels=gravel, alpha=alpha), force=True)
    toposeam("tile", "gravel.png", "-o", "o.png", "--preview", "o.jpg").fails("partly transparent")
    assert [path.name for path in folder.iterdir()] == ["gravel.png"]


def test_json_tells_how_visible_joints_are(toposeam):
    told = json.loads(toposeam("tile", "gravel.png", "-o", "o.png", "--json").out)
    assert told["joints"] >= 0
    assert told["shown"] is None  # of a picture that is only mended
    assert "tried" not in told
    assert "setting" not in told


def test_light_is_taken_out_of_a_picture_that_repeats(toposeam):
    _, x = np.mgrid[:160, :200]
    grain = np.random.default_rng(0).normal(0, 8, x.shape)
    write_picture("lit.png", Picture(pixels=np.rint(90 + 0.4 * x + grain).clip(0, 255).astype(np.uint8)))

    def step(*options):
        assert toposeam("tile", "lit.png", "-o", "o.png", "--force", *options).code == 0
        made = read_picture("o.png").pixels.astype(float)
        across = made.mean(axis=0)  # light on 20 px, over the border as inside
        light = np.convolve(np.concatenate([across, across]), np.ones(20) / 20, "valid")
        return np.abs(light[20:] - light[:-20]).max()

    assert step() > 30
    assert step("--level") < 20
    assert step("--flatten") < 10


def test_an_ordered_picture_is_cropped_unless_it_is_kept(toposeam):
    y, x = np.mgrid[:131, :149]
    checks = np.where((x // 10 + y // 12) % 2, 40, 210) + np.random.default_rng(0).integers(0, 9, x.shape)
    write_picture("checks.png", Picture(pixels=checks.astype(np.uint8)))
    ran = toposeam("tile", "checks.png", "--size", "keep", "-o", "whole.png")
    assert ran.code == 0, ran
    assert read_picture("whole.png").pixels.shape == (131, 149)
    assert "cropped to 140 × 120 px it does (--size auto)" in ran.out
    ran = toposeam("tile", "checks.png", "-o", "tile.png")
    assert ran.code == 0, ran
    made = read_picture("tile.png").pixels.astype(int)
    assert made.shape == (120, 140)
    np.testing.assert_array_less(np.abs(made - np.roll(made, (24, 20), (0, 1))), 60)
    assert "cropped to where its order closes" in ran.out
    opaque = np.where(x < 60, 255, 0).astype(np.uint8)
    hidden = np.where(opaque > 0, checks, np.where((x // 7 + y // 17) % 2, 20, 230))
    write_picture("checks.png", Picture(pixels=hidden.astype(np.uint8), alpha=opaque), force=True)
    assert toposeam("tile", "checks.png", "--size", "auto", "-o", "tile.png", "--force").code == 0
    assert read_picture("tile.png").pixels.shape[0] == 120  # what is transparent has another order
