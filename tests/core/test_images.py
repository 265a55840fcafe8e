"""Images on the way in and out: what is silently wrong elsewhere is an error with a remedy here."""

import numpy as np
import PIL.Image
import pytest
import scipy

import toposeam as ts
from toposeam.display import to_pil, to_png, to_rgba8
from toposeam.images import (
    all_of_squares,
    as_array,
    as_float,
    as_mask,
    as_planes,
    as_reduced,
    blurred,
    box_of,
    reduced,
)
from toposeam.saving import save


@pytest.mark.parametrize("dtype", [np.int16, np.int32, np.int64, np.uint32, np.int8])
def test_integers_without_a_known_white_need_their_range(dtype):
    image = np.array([[0, 100]], dtype)
    with pytest.raises(ts.ImageError, match="say with data_range= which value is white"):
        as_float(image, "a")
    assert as_float(image, data_range=100).ravel().tolist() == [0.0, 1.0]


def test_floats_of_bytes_are_not_taken_for_shares():
    image = np.array([[0.0, 255.0]])
    with pytest.raises(ts.ImageError, match="a is of floats up to 255, where 1 counts as white"):
        as_float(image, "a")
    assert as_float(image, data_range=255).ravel().tolist() == [0.0, 1.0]
    assert as_float(image, data_range=1).ravel().tolist() == [0.0, 255.0]  # a wide range, kept


@pytest.mark.parametrize(
    ("image", "said"),
    [
        (np.zeros((3, 40, 50)), "looks like \\(C, H, W\\)"),
        (np.ma.masked_array(np.zeros((4, 4)), False), "masked array"),
        (np.zeros((4, 4), complex), "dtype complex128"),
        (np.array(["x"]), "pass integers or floats"),
        ([[1, 2], [3]], "is no array"),
        (np.zeros((0, 4)), "non-empty"),
        (np.full((2, 2), np.nan), "NaN"),
    ],
)
def test_what_is_no_image_is_refused(image, said):
    with pytest.raises(ts.ImageError, match=said):
        as_float(image, "a")


def test_pil_pictures_come_in_with_their_colours():
    palette = PIL.Image.new("RGB", (4, 3), (200, 10, 20)).convert("P")
    assert as_array(palette).shape == (3, 4, 3)
    assert as_array(PIL.Image.new("L", (4, 3), 7)).tolist() == [[7] * 4] * 3


def test_results_and_arrays_go_out_as_pil_pictures():
    assert to_pil(np.zeros((3, 4), np.uint16)).size == (4, 3)
    seam = ts.find_seam(np.zeros((6, 5)), np.ones((6, 5)))
    assert to_pil(seam).size == (5, 6)
    assert to_png(np.zeros((2000, 10, 4), np.uint8)).startswith(b"\x89PNG")
    assert to_rgba8(np.array([[0.0, 0.5, 9.0]]), np.array([[1.0, 0.5, 0.0]])).tolist() == [
        [[0, 0, 0, 255], [128, 128, 128, 128], [255, 255, 255, 0]]
    ]
    with pytest.raises(ts.OptionError, match="a str is no picture"):
        to_pil("x")


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "seam.svg"
    save(target, "one")
    monkeypatch.setattr("os.fsync", lambda _: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        save(target, "two")
    assert target.read_text() == "one"
    assert [path.name for path in tmp_path.iterdir()] == ["seam.svg"]


def test_a_mask_is_true_wherever_it_is_not_zero():
    assert as_mask([[-1, 0], [2, 255]], (2, 2), "mask").tolist() == [[True, False], [True, True]]
    assert as_mask(np.array([[-0.5, 0.0]]), (1, 2), "mask").tolist() == [[True, False]]
    given = np.array([[True, False]])
    assert as_mask(given, (1, 2), "mask") is given


@pytest.mark.parametrize(
    ("shape", "text"),
    [((2, 3), "the images have \\(2, 3\\); pass one value per pixel"), ((2, 3, 4), "volumes .* per voxel")],
)
def test_a_mask_of_another_shape_is_refused(shape, text):
    with pytest.raises(ts.ImageError, match=text):
        as_mask(np.zeros((2, 2)), shape, "mask")


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("shape", [(3, 5), (4, 5, 1), (4, 5, 3)])
@pytest.mark.parametrize("data_range", [None, 1.5])
def test_planes_are_the_float_image_channel_by_channel(dtype, shape, data_range):
    values = np.random.default_rng(0).random(shape) * (200 if np.issubdtype(dtype, np.integer) else 1.2)
    image = values.astype(dtype)[::-1, ::2]  # any layout
    planes = as_planes(image, data_range=data_range)
    assert planes.flags.c_contiguous
    np.testing.assert_array_equal(np.moveaxis(planes, 0, -1), as_float(image, data_range=data_range))


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32", "bool"])
@pytest.mark.parametrize("shape", [(7, 9), (8, 6, 3)])
def test_a_reduced_image_is_the_mean_of_squares(dtype, shape):
    image = (
        np.random.default_rng(3).random(shape) * (np.iinfo(dtype).max if dtype[0] == "u" else 1.5)
    ).astype(dtype)
    whole = as_float(image)
    for scale in (1, 2, 3):
        rows, columns = shape[0] // scale, shape[1] // scale
        squares = whole[: rows * scale, : columns * scale].reshape(rows, scale, columns, scale, -1)
        found = as_reduced(image, scale)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, squares.mean(axis=(1, 3), dtype=float), atol=2e-7, rtol=2e-7)


@pytest.mark.parametrize(
    "shape", [(40, 50), (3, 7, 9), (2, 2, 5, 3), (1, 1), (1, 60), (60, 1), (0, 4), (4, 0)]
)
@pytest.mark.parametrize("blur", [0, 0.1, 0.7, 1.6, 8.0])
def test_kernels_blur_as_scipy_does_to_the_bit(shape, blur, both_ways):
    pictures = np.random.default_rng(1).normal(0, 1, shape).astype(np.float32)
    one, other = both_ways(lambda: blurred(pictures, blur, 0.5))
    assert one.shape == (2, *shape)
    assert np.array_equal(one, other)
    wanted = scipy.ndimage.gaussian_filter(pictures, (*[0] * (len(shape) - 2), blur, blur))
    assert np.array_equal(one[0], wanted)


def test_a_part_of_a_picture_is_blurred_as_its_copy_is():
    picture = np.random.default_rng(2).normal(0, 1, (30, 40)).astype(np.float32)
    part = picture[::2, 3:19]
    assert np.array_equal(blurred(part, 1.0), blurred(part.copy(), 1.0))
    assert np.array_equal(blurred(part, 0)[0], part)


def test_sums_of_large_squares_do_not_overflow():
    assert reduced(np.full((256, 256), 65535, np.uint16), 256).tolist() == [[65535.0]]


def test_a_square_is_full_where_all_of_it_is():
    mask = np.ones((4, 5), bool)
    mask[3, 0] = False
    assert all_of_squares(mask, 2).tolist() == [[True, True], [False, True]]
    assert all_of_squares(mask, 1) is mask


def test_the_window_around_a_mask():
    mask = np.zeros((20, 30), bool)
    mask[3, 7] = mask[11, 4] = True
    assert box_of(mask) == (slice(3, 12), slice(4, 8))
