"""Maps of a canvas that are known without looking at their pixels."""

import numpy as np
import pytest

from toposeam.layers.canvas import Box, TileMap, blocks, doubled, ground, is_empty, part_of, several, uniform


@pytest.mark.parametrize("shape", [(1, 1), (4, 5)])
def test_a_value_that_is_everywhere_is_known(shape):
    box = Box(0, 0, *shape)
    assert uniform(np.broadcast_to(np.float32(0.5), shape), box) == 0.5
    assert uniform(np.full((4, 5), 0.5), box) is None


@pytest.mark.parametrize("shape", [(3, 4), (700, 900)])
def test_a_mask_of_nothing_is_empty_and_one_pixel_is_something(shape):
    for mask in np.zeros(shape, bool), TileMap(shape, False, bool), np.broadcast_to(False, shape):
        assert is_empty(mask)
    for mask in np.zeros(shape, bool), TileMap(shape, False, bool):
        mask[shape[0] - 1 :, shape[1] - 1 :] = True
        assert not is_empty(mask)


def lines(shape):
    """A map of values in large parts whose border is no line of pixels, and the same in tiles."""
    y, x = np.ogrid[: shape[0], : shape[1]]
    values = ((x + 2 * y) // 400 + (y > 300)).astype(np.int16)
    tiled = TileMap(shape, 0, np.int16)
    tiled[:, :] = values
    return values, tiled


@pytest.mark.parametrize("fine", [(4, 6), (3, 5), (4, 5), (3, 6), (1400, 1802), (1399, 1801)])
def test_doubling_repeats_pixels_and_crops_odd_borders(fine):
    for values in lines((-(-fine[0] // 2), -(-fine[1] // 2))):
        found = doubled(values, fine)
        assert found.shape == fine
        expected = np.kron(values[:, :], np.ones((2, 2), np.int16))[: fine[0], : fine[1]]
        np.testing.assert_array_equal(found[:, :], expected)
        if isinstance(values, TileMap):
            again = TileMap(fine, 0, np.int16)
            again[:, :] = expected
            assert found.nbytes == again.nbytes, "tiles that are alike are kept as one value"


@pytest.mark.parametrize("shape", [(512, 640), (700, 901), (129, 385)])
@pytest.mark.parametrize("overlap", [0, 1])
def test_blocks_that_are_alike_are_known_all_at_once(shape, overlap):
    _, tiled = lines(shape)
    tiled[:128, 256:384] = 7
    halves = TileMap(shape, 3, np.int16)
    halves[:, 256:] = 4  # blocks differ from the next ones only
    whole = Box(0, 0, *shape)
    for values in (tiled, halves):
        expected = [block for block in blocks(whole, 256, overlap) if uniform(values, block) is None]
        assert list(several(values, whole, overlap)) == expected
        assert bool(expected) == (values is tiled or overlap > 0)


def test_the_ground_is_the_union_of_all_covers():
    whole = np.broadcast_to(np.True_, (300, 400))
    part = lines((300, 400))[0] > 1
    tiled = TileMap((300, 400), False, bool)
    tiled[:, :] = part
    places = [Box(0, 0, 300, 400), Box(100, 300, 400, 700), Box(250, 0, 550, 400)]
    covers = [part, tiled, whole]
    ground_there = np.zeros((560, 710), bool)
    for place, cover in zip(places, covers, strict=True):
        ground_there[place.slices] |= cover[:, :]
    for box in (Box(0, 0, 560, 710), Box(260, 10, 280, 90), Box(90, 290, 260, 420), Box(0, 500, 40, 600)):
        np.testing.assert_array_equal(ground(places, covers, box), ground_there[box.slices])


def test_a_part_is_the_same_in_its_boxes_small_and_its_own():
    values, tiled = lines((700, 901))
    boxes = Box(100, 50, 300, 400), Box(-200, 800, 140, 1000), Box(-300, -200, -100, -50)
    for of in (values, tiled):
        part = part_of(of, *boxes)
        assert part.nbytes < tiled.nbytes
        for box in boxes[:2]:
            inside = box.shared(Box(0, 0, 700, 901)).slices
            np.testing.assert_array_equal(part[inside], values[inside])
            part[inside] = 9
        np.testing.assert_array_equal(of[:, :], lines((700, 901))[0])


def test_any_window_of_a_tiled_map_is_what_an_array_has_there():
    rng = np.random.default_rng(3)
    tiled, array = TileMap((500, 700), 0, np.int16), np.zeros((500, 700), np.int16)
    for value in range(1, 60):
        top, bottom = sorted(rng.integers(0, 501, 2))
        left, right = sorted(rng.integers(0, 701, 2))
        window = slice(top, bottom), slice(left, right)
        tiled[window] = array[window] = value if value % 3 else rng.integers(0, 2, array[window].shape)
        y, x = rng.integers(0, 500), rng.integers(0, 700)
        for seen in (np.s_[y : y + 200, x : x + 300], np.s_[y:y, x:], np.s_[:, :]):
            np.testing.assert_array_equal(tiled[seen], array[seen])


@pytest.mark.parametrize("shape", [(128, 256), (129, 385), (70, 90)])
def test_a_map_written_whole_keeps_one_value_if_all_are_alike(shape):
    tiled, plain = TileMap(shape, 0, np.int16), TileMap(shape, 5, np.int16)
    tiled[:, :] = np.full(shape, 5)
    assert uniform(tiled, Box(0, 0, *shape)) == 5
    assert tiled.nbytes == plain.nbytes  # at borders that end within tiles too
