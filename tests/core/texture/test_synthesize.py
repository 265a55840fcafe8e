import numpy as np
import pytest

import toposeam as ts


def step_at_border(image, axis):
    """Mean step across the border over the mean inner step."""
    values = image.astype(float)
    across = np.abs(np.take(values, 0, axis) - np.take(values, -1, axis)).mean()
    return across / np.abs(np.diff(values, axis=axis)).mean()


@pytest.mark.parametrize("channels", [None, 1, 3])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_size_channels_and_depth_are_as_asked(sample, dtype, channels):
    source = sample(0, channels=channels, dtype=dtype)
    made = ts.synthesize(source, (70, 90), patch=32)
    assert made.image.shape == (70, 90, *source.shape[2:])
    assert made.image.dtype == dtype
    assert made.alpha is None
    assert source.min() <= made.image.min() <= made.image.max() <= source.max()


@pytest.mark.parametrize("size", [(1, 1), (7, 100), (40, 40), (41, 40), (95, 33)])
def test_any_size_is_filled_exactly(sample, size):
    made = ts.synthesize(sample(1), size, patch=40, smooth=0)
    assert made.image.shape == size
    assert (made.labels >= 0).all()
    np.testing.assert_array_equal(made.image, sample(1)[made.source[..., 0], made.source[..., 1]])


def test_without_smoothing_every_pixel_is_a_copy_and_with_it_only_pixels_at_seams_differ(sample):
    source = sample(2, channels=3)
    hard, soft = (ts.synthesize(source, 90, patch=32, smooth=smooth) for smooth in (0, 1))
    copied = source[hard.source[..., 0], hard.source[..., 1]]
    np.testing.assert_array_equal(hard.image, copied)
    np.testing.assert_array_equal(hard.source, soft.source)
    differs = (soft.image != copied).any(axis=2)
    seam = np.zeros_like(differs)
    across, along = hard.labels[:, 1:] != hard.labels[:, :-1], hard.labels[1:] != hard.labels[:-1]
    seam[:, 1:] |= across
    seam[:, :-1] |= across
    seam[1:] |= along
    seam[:-1] |= along
    assert differs.mean() > 0.02
    assert not (differs & ~seam).any()


@pytest.mark.parametrize(("tileable", "closed"), [(True, (True, True)), ("x", (False, True)), ("y", (True, False))])
def test_tileable_textures_continue_at_the_opposite_border(sample, tileable, closed):
    steps = np.array([
        [step_at_border(ts.synthesize(sample(3), (96, 100), patch=32, seed=seed, tileable=tileable).image, axis) for axis in (0, 1)]
        for seed in range(3)
    ]).mean(axis=0)  # fmt: skip
    for step, closes in zip(steps, closed, strict=True):
        assert step < 1.4 if closes else step > 2.5


def test_the_same_seed_gives_the_same_bytes_and_another_one_another_texture(sample):
    first, second, other = (ts.synthesize(sample(4), 80, patch=32, seed=seed, tileable=True) for seed in (5, 5, 6))
    assert first.image.tobytes() == second.image.tobytes()
    assert first.to_svg() == second.to_svg()
    assert (first.image != other.image).mean() > 0.5


def test_no_source_pixel_shows_much_more_often_than_the_average(sample):
    source = sample(5, (96, 96))
    made = ts.synthesize(source, 200, patch=24)
    use = np.bincount((made.source[..., 0] * 96 + made.source[..., 1]).ravel(), minlength=source.size)
    assert use.max() <= 2.5 * use.mean()


def test_neighbouring_patches_do_not_continue_one_copy(sample):
    source = sample(6, (96, 96))
    made = ts.synthesize(source, 96, patch=32, smooth=0)
    shift = made.source - np.moveaxis(np.indices(made.labels.shape), 0, 2)
    borders = made.labels[:, 1:] != made.labels[:, :-1]
    assert borders.any()
    assert (shift[:, 1:] != shift[:, :-1]).any(axis=2)[borders].all()


def test_further_maps_are_cut_alike(sample):
    source = sample(7, channels=3)
    other = sample(8, dtype=np.uint16)
    made = ts.synthesize(source, (90, 70), patch=32, maps=[other, source], weights=[1, 0.5, 0])
    np.testing.assert_array_equal(made.maps[1], made.image)
    np.testing.assert_array_equal(made.maps[0], made.apply(other))
    assert made.maps[0].dtype == np.uint16
    # The second map must count in the search: without it other patches are taken.
    alone = ts.synthesize(source, (90, 70), patch=32)
    assert (alone.source != made.source).any()


def test_a_map_applied_later_follows_the_same_seams(sample):
    source = sample(9)
    made = ts.synthesize(source, 90, patch=32, tileable=True)
    np.testing.assert_array_equal(made.apply(source), made.image)
    # Halves are rounded to even.
    np.testing.assert_allclose(made.apply(255 - source).astype(int), 255 - made.image.astype(int), atol=1)


def test_several_exemplars_all_take_part(sample):
    first, second = sample(10, (60, 60)), sample(10, (50, 70))
    made = ts.synthesize([first, second], 160, patch=24, smooth=0)
    assert set(np.unique(made.exemplar)) == {0, 1}
    for number, image in enumerate((first, second)):
        here = made.exemplar == number
        row, column = made.source[here].T
        assert (row < image.shape[0]).all()
        assert (column < image.shape[1]).all()
        np.testing.assert_array_equal(made.image[here], image[row, column])


def test_only_what_the_mask_allows_is_sampled(sample):
    source = sample(11, (80, 80))
    yy, xx = np.mgrid[:80, :80]
    mask = (yy - 40) ** 2 + (xx - 40) ** 2 < 36**2
    made = ts.synthesize(source, 100, patch=24, mask=mask, smooth=0)
    assert mask[made.source[..., 0], made.source[..., 1]].all()


def test_transparent_pixels_are_not_sampled_and_opacity_is_laid_along(sample):
    source = sample(12, (80, 80), channels=3)
    alpha = sample(13, (80, 80)) // 2 + 100
    alpha[:, :20] = 0
    made = ts.synthesize(source, 90, patch=24, alpha=alpha, smooth=0)
    np.testing.assert_array_equal(made.alpha, alpha[made.source[..., 0], made.source[..., 1]])
    assert (made.alpha > 0).all()
    opaque = ts.synthesize(source, 90, patch=24, alpha=np.where(alpha > 0, 255, 0).astype(np.uint8))
    assert opaque.alpha is None


def test_a_guide_says_what_goes_where():
    rng = np.random.default_rng(14)
    dark, light = rng.integers(0, 110, (80, 40)), rng.integers(140, 256, (80, 40))
    source = np.hstack([dark, light]).astype(np.uint8)
    stands = np.hstack([np.zeros((80, 40)), np.ones((80, 40))])
    wanted = np.zeros((96, 96))
    wanted[:, :48] = 1
    made = ts.synthesize(source, 96, patch=16, guide=wanted, guide_source=stands, guide_weight=0.8)
    assert made.image[:, :40].mean() > 170
    assert made.image[:, 56:].mean() < 80


def test_the_patch_is_chosen_by_the_size_of_the_elements(sample):
    from scipy import ndimage

    fine = sample(15, (192, 192))
    coarse = ndimage.zoom(sample(15, (64, 64)), 3, order=1)
    patches = [ts.synthesize(image, 40, patch=None).settings["patch"] for image in (fine, coarse)]
    assert 8 <= patches[0] < patches[1] <= 64


def test_seams_run_between_patches_and_can_be_read_back(sample):
    made = ts.synthesize(sample(16), (90, 100), patch=32)
    drawing = ts.read_svg(made.to_svg().encode())
    assert (drawing.width, drawing.height) == (100, 90)
    length = sum(line.length for line in drawing.polylines)
    borders = (made.labels[:, 1:] != made.labels[:, :-1]).sum() + (made.labels[1:] != made.labels[:-1]).sum()
    assert length == borders


def test_progress_rises_to_one_patch_by_patch_and_may_interrupt(sample):
    seen = []
    ts.synthesize(sample(17), 80, patch=32, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1
    assert len(seen) >= 9

    def stop(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ts.synthesize(sample(17), 80, patch=32, progress=stop)


FLAT = np.full((64, 64), 7, np.uint8)
GOOD = np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8)


@pytest.mark.parametrize(("change", "error", "text"), [
    ({"patch": 65}, ts.ImageError, "smaller than a patch"),
    ({"overlap": 40}, ts.OptionError, "overlap"),
    ({"overlap": 1}, ts.OptionError, "overlap"),
    ({"patch": 2}, ts.OptionError, "at least 4"), ({"source": FLAT}, ts.ImageError, "one value everywhere"),
    ({"mask": np.zeros((64, 64))}, ts.ImageError, "mask"), ({"mask": np.eye(64)}, ts.ImageError, "no place in the mask"),
    ({"maps": [GOOD[1:]]}, ts.ImageError, "64 × 63 px"), ({"size": 0}, ts.OptionError, "size"), ({"size": (5, -1)}, ts.OptionError, "size"),
    ({"size": (10**6, 10**6)}, ts.OptionError, "more than"), ({"source": np.zeros((64, 64, 2))}, ts.ImageError, "2 channels"),
    ({"source": np.zeros((64, 64, 5))}, ts.ImageError, "5 channels"), ({"source": []}, ts.ImageError, "empty list"),
    ({"source": GOOD.astype(float) * np.nan}, ts.ImageError, "NaN"), ({"weights": [1, 1]}, ts.OptionError, "weights"),
    ({"weights": [-1]}, ts.OptionError, "weights"),
    ({"tileable": "z"}, ts.OptionError, "tileable"),
    ({"smooth": 99}, ts.OptionError, "smooth"),
    ({"most": 0.5}, ts.OptionError, "most"),
    ({"tollerance": 1}, ts.OptionError, "not an option"),
    ({"guide": GOOD}, ts.OptionError, "belong together"),
    ({"guide": GOOD, "guide_source": GOOD}, ts.ImageError, "guide is"),
    ({"size": (8, 80), "tileable": True}, ts.OptionError, "at least 16"),
    ({"source": [GOOD, GOOD.astype(np.uint16)]}, ts.ImageError, "dtype"), ({"alpha": np.ones((3, 3))}, ts.ImageError, "alpha"),
    ({"source": np.zeros((64, 64), complex)}, ts.ImageError, "dtype"), ({"source": GOOD[0]}, ts.ImageError, "shape"),
])  # fmt: skip
def test_bad_input_is_refused_in_one_sentence(change, error, text):
    arguments = {"source": GOOD, "size": 80, **change}
    with pytest.raises(error, match=text) as caught:
        ts.synthesize(**arguments)
    assert "\n" not in str(caught.value)
