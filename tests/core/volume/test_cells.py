"""Cells in stacks: they stay whole, whatever the camera wrote, with a segmentation and without."""

from functools import cache

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree

import toposeam as ts
from toposeam.volume.problem import brightness, place_stacks, tones_of

array = pytest.importorskip("dask.array")

OVERLAP = 32


@cache
def tissue(seed=0, gain=0.7, noise=0.01, shape=(20, 48, 90)):
    """Two stacks of densely packed cells, b darker and with noise of its own, and the cells' numbers."""
    rng = np.random.default_rng(seed)
    middles = np.stack([rng.uniform(0, side, 110) for side in shape], axis=1)
    apart, nearest = cKDTree(middles).query(np.stack(np.indices(shape), axis=-1), 2)
    valley, nearest = apart[..., 1] - apart[..., 0], nearest[..., 0] + 1
    numbers = np.where(valley > 1.5, nearest, 0)
    light = rng.uniform(0.5, 1, 111)[nearest] * np.clip(valley / 4, 0.15, 1)
    light = ndimage.gaussian_filter(light, 0.7)
    start = (shape[2] - OVERLAP) // 2
    a, b = (
        part * share + rng.normal(0, noise, part.shape)
        for part, share in ((light[..., : start + OVERLAP], 1.0), (light[..., start:], gain))
    )
    return a, b, (0, 0, start), numbers


def counts(values, white=900, black=100):
    """What a camera of 12 bits writes into 16."""
    return np.rint(np.clip(black + white * values, 0, 4095)).astype(np.uint16)


def in_cells(joined, numbers):
    """The share of the surface that has one cell on both sides."""
    cells = numbers[joined.places.overlap]
    faces = inside = 0
    for axis in range(3):
        low, high = ((slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None)))
        between = joined.labels[low] != joined.labels[high]
        faces += between.sum()
        inside += (between & (cells[low] == cells[high]) & (cells[low] > 0)).sum()
    return inside / faces


def cells_of(numbers, offset, width):
    return numbers[..., :width], numbers[..., offset[2] :]


@pytest.mark.medium
def test_twelve_bits_in_sixteen_are_joined_as_floats_are():
    a, b, offset, _ = tissue()
    floats = ts.join_volumes(a.astype(np.float32), b.astype(np.float32), offset=offset)
    whole = ts.join_volumes(counts(a), counts(b), offset=offset)
    assert (floats.labels != whole.labels).mean() < 0.02


@pytest.mark.medium
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_dense_cells_are_cut_less_than_by_the_costs_alone(seed):
    a, b, offset, numbers = tissue(seed)
    stacks = counts(a), counts(b)
    alone = in_cells(ts.join_volumes(*stacks, offset=offset, cells=False, data_range=1000), numbers)
    assert in_cells(ts.join_volumes(*stacks, offset=offset), numbers) < 0.5 * alone
    known = ts.join_volumes(*stacks, offset=offset, cells=cells_of(numbers, offset, a.shape[2]))
    assert in_cells(known, numbers) < 0.05


@pytest.mark.medium
def test_a_price_is_no_wall():
    a, b, offset, _ = tissue()
    everything = np.ones(a.shape, np.uint8), np.ones(b.shape, np.uint8)
    joined = ts.join_volumes(counts(a), counts(b), offset=offset, cells=everything)
    assert joined.labels.any()
    assert not joined.labels.all()


@pytest.mark.medium
def test_segmentations_are_joined_in_one_numbering():
    a, b, offset, numbers = tissue()
    of_a, of_b = cells_of(numbers, offset, a.shape[2])
    joined = ts.join_volumes(counts(a), counts(b), offset=offset, cells=(of_a, np.where(of_b, of_b + 500, 0)))
    found = np.where(joined.cells > numbers.max(), joined.cells - numbers.max() - 500, joined.cells)
    np.testing.assert_array_equal(found, numbers)
    # What both stacks show in full has one number on either side of the surface.
    shown = joined.cells[..., offset[2] + 8 : a.shape[2] - 8]
    assert (shown <= numbers.max()).mean() > 0.9


@pytest.mark.medium
def test_blocks_price_cells_as_the_whole_does():
    a, b, offset, numbers = tissue()
    cells = cells_of(numbers, offset, a.shape[2])
    for given in (True, cells):
        whole = ts.join_volumes(counts(a), counts(b), offset=offset, cells=given)
        blocks = ts.join_volumes(counts(a), counts(b), offset=offset, cells=given, block=24)
        assert in_cells(blocks, numbers) < in_cells(whole, numbers) + 0.03
    np.testing.assert_array_equal(np.asarray(blocks.cells)[..., : offset[2]], cells[0][..., : offset[2]])


def test_brightness_knows_faint_cells_as_bright_ones():
    z, y, x = np.indices((15, 31, 80))
    cells = np.zeros((15, 31, 80), np.float32)
    for middle, light in ((20, 1.0), (60, 0.3)):
        cells[(z - 7) ** 2 + (y - 15) ** 2 + (x - middle) ** 2 < 25] = light
    found = brightness(cells, (15, 15, 15))
    assert found[7, 15, 20] > 200
    assert found[7, 15, 60] > 200
    assert found[7, 15, 40] == 0


@pytest.mark.parametrize("offset", [0.0, 120.0])
def test_black_and_gain_are_those_of_the_camera(offset):
    a, b, at, _ = tissue(noise=0.0)
    stacks = [(offset + 1000 * part)[..., np.newaxis] for part in (a, b)]
    tones = tones_of(*stacks, place_stacks(a.shape, b.shape, at))
    assert tones.gain == pytest.approx(0.7, rel=0.02)
    overlap = stacks[1][:, :, :OVERLAP]
    np.testing.assert_allclose(tones.evened(overlap, at), stacks[0][:, :, at[2] :], rtol=0.05, atol=10)


@pytest.mark.medium
def test_no_step_of_the_background_where_tones_are_matched():
    rng = np.random.default_rng(0)
    noise = 6.0
    light = 40 + 300 * np.clip(ndimage.gaussian_filter(rng.standard_normal((20, 60, 100)), 4) * 12, 0, None)
    fading = np.linspace(0.65, 0.8, 60)
    a = light[..., :60] + rng.normal(0, noise, (20, 60, 60))
    b = fading * light[..., 40:] + rng.normal(0, noise, (20, 60, 60))
    stacks = [np.rint(100 + part).astype(np.uint16) for part in (a, b)]
    steps = []
    for matched in (False, True):
        joined = ts.join_volumes(*stacks, offset=(0, 0, 40), match_tones=matched)
        line = (joined.volume.astype(float) - 100 - light)[..., 40:60]
        steps.append(abs(line[joined.labels].mean() - line[~joined.labels].mean()))
    assert steps[0] > noise
    assert steps[1] < noise / 2
    np.testing.assert_array_equal(joined.volume[..., :40], stacks[0][..., :40])


@pytest.mark.medium
@pytest.mark.parametrize("block", [None, 16])
def test_a_third_stack_goes_into_the_corner(block):
    rng = np.random.default_rng(0)
    whole = np.rint(1000 + 600 * ndimage.gaussian_filter(rng.standard_normal((12, 50, 50)), 1.5) * 8).astype(
        np.uint16
    )
    pieces = [
        (whole[:, :30, :30], (0, 0, 0)),
        (whole[:, :30, 20:], (0, 0, 20)),
        (whole[:, 20:, :30], (0, 20, 0)),
        (whole[:, 20:, 20:], (0, 20, 20)),
    ]
    made = pieces[0][0]
    for stack, at in pieces[1:]:
        made = ts.join_volumes(made, stack, offset=at, block=block)
    np.testing.assert_array_equal(np.asarray(made.volume), whole)
    assert np.asarray(made.present).all()


def test_an_empty_corner_is_not_what_a_stack_shows():
    rng = np.random.default_rng(0)
    first = ts.join_volumes(rng.random((6, 20, 20)), rng.random((6, 10, 20)), offset=(0, 0, 12))
    assert first.present is not None
    assert not first.present[:, 10:, 20:].any()
    joined = ts.join_volumes(first, 5 + rng.random((6, 16, 20)), offset=(0, 4, 14))
    np.testing.assert_array_equal(joined.volume[:, 10:, 20:] > 4, True)


@pytest.mark.parametrize(
    ("cells", "text"),
    [
        (3, "a pair of arrays"),
        ((None, np.zeros((2, 2, 2), int)), "one for each of its 6×8×9 voxels"),
        ((np.zeros((6, 8, 9)), None), "pass whole numbers"),
        ((np.full((6, 8, 9), 2**31), np.full((6, 8, 9), 3)), "number their cells from 1 on"),
    ],
)
def test_what_is_no_segmentation_is_told(cells, text):
    a, b = np.random.default_rng(0).random((2, 6, 8, 9))
    with pytest.raises(ts.TopoSeamError, match=text):
        ts.join_volumes(a, b, offset=(0, 0, 4), cells=cells)
