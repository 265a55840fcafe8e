import numpy as np
import pytest
from skimage import data

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_picture("gravel.png", Picture(pixels=np.ascontiguousarray(data.gravel()[:120, :140])))
    hole = np.zeros((120, 140), np.uint8)
    hole[50:80, 40:90] = 255
    write_picture("hole.png", Picture(pixels=hole))
    return tmp_path


def test_a_hole_is_filled_and_its_surroundings_stay(toposeam):
    ran = toposeam(
        "fill",
        "gravel.png",
        "--mask",
        "hole.png",
        "--band",
        "6",
        "--also",
        "gravel.png",
        "--smooth",
        "0",
        "-o",
        "full.png",
        "--labels",
        "labels.png",
    )
    assert ran.code == 0, ran
    given, made, other, labels = (
        read_picture(name).pixels for name in ("gravel.png", "full.png", "full_gravel.png", "labels.png")
    )
    np.testing.assert_array_equal(made, other)
    beyond = np.ones(given.shape, bool)
    beyond[44:86, 34:96] = False
    np.testing.assert_array_equal(made[beyond], given[beyond])
    assert (labels[50:80, 40:90] > 0).all()


def test_one_patch_is_one_patch(toposeam):
    small = np.zeros((120, 140), np.uint8)
    small[60:64, 60:64] = 255
    write_picture("small.png", Picture(pixels=small))
    ran = toposeam("fill", "gravel.png", "--mask", "small.png", "--by", "patches", "-o", "o.png")
    assert ran.out.startswith("o.png: 16 px replaced by 1 patch, joints are ")


def test_copies_come_from_where_they_are_allowed(toposeam):
    allow = np.zeros((120, 140), np.uint8)
    allow[:, 95:] = 255
    write_picture("allow.png", Picture(pixels=allow))
    ran = toposeam(
        "fill",
        "gravel.png",
        "--mask",
        "hole.png",
        "--from",
        "allow.png",
        "--patch",
        "24",
        "-o",
        "o.png",
        "--coordinates",
        "from.png",
        "--labels",
        "l.png",
    )
    assert ran.code == 0, ran
    laid = read_picture("l.png").pixels > 0
    assert (read_picture("from.png").pixels[laid][:, 0] >= 95).all()


@pytest.mark.parametrize(
    ("mask", "phrase"),
    [
        (np.zeros((120, 140), np.uint8), "mask.png is empty"),
        (np.full((120, 140), 255, np.uint8), "nothing is left"),
        (np.full((12, 14), 255, np.uint8), "12"),
    ],
)
def test_masks_with_nothing_to_fill_or_to_copy_are_refused(toposeam, folder, mask, phrase):
    write_picture("mask.png", Picture(pixels=mask))
    toposeam("fill", "gravel.png", "--mask", "mask.png", "-o", "o.png").fails(phrase)
    assert not (folder / "o.png").exists()


def test_where_nothing_is_allowed_the_mask_is_not_blamed(toposeam, folder):
    mask = np.zeros((120, 140), np.uint8)
    write_picture("allow.png", Picture(pixels=mask))
    mask[40:60, 40:60] = 255
    write_picture("mask.png", Picture(pixels=mask))
    toposeam("fill", "gravel.png", "--mask", "mask.png", "--from", "allow.png", "-o", "o.png").fails(
        "outside mask.png nothing is allowed; paint more of what may be copied"
    )
    write_picture("mine.png", Picture(pixels=np.full_like(mask, 255)))
    toposeam("fill", "gravel.png", "--mask", "mask.png", "--avoid", "mine.png", "-o", "o.png").fails(
        "outside mask.png nothing is allowed; paint less of what must not be copied"
    )
    assert not (folder / "o.png").exists()


def test_boxes_say_what_is_replaced_without_a_mask(toposeam):
    words = ["--by", "patches", "--band", "0", "--smooth", "0"]
    assert toposeam("fill", "gravel.png", "--mask", "hole.png", *words, "-o", "mask.png").code == 0
    assert toposeam("fill", "gravel.png", "--box", "40,50,50,30", *words, "-o", "box.png").code == 0
    halves = ("--box", "40,50,25,30", "--mask", "box:65,50,25,30")
    assert toposeam("fill", "gravel.png", *halves, *words, "-o", "halves.png").code == 0
    expected = read_picture("mask.png").pixels
    for name in ("box.png", "halves.png"):
        np.testing.assert_array_equal(read_picture(name).pixels, expected)


def test_fill_asks_what_is_to_be_replaced(toposeam):
    toposeam("fill", "gravel.png", "-o", "out.png").fails("--box X,Y,W,H, or --mask FILE", code=2)
