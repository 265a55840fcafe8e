import numpy as np
import pytest

import toposeam as ts
from toposeam.texture.canvas import near_seams, render, render_normals
from toposeam.texture.exemplar import reduced


@pytest.mark.parametrize(("wrap", "mixed"), [((False, True), True), ((False, False), False)])
def test_at_the_border_of_a_cylinder_copies_mix_round_it(wrap, mixed):
    """Two copies of one plane of 0, 10, 20 …, the right one a row further down: seams at column 4, and at
    column 0 where columns continue.
    """
    plane = (10.0 * np.arange(64)).reshape(8, 8, 1)
    index = np.arange(64, dtype=np.int32).reshape(8, 8)[:4].copy()
    index[:, 4:] += 8
    made = render(index, plane, np.ones((8, 8), bool), wrap, 1)[..., 0]
    hard = plane.ravel()[index]
    assert made[1, 3] == hard[1, 3] + 20  # 0.25 × the copy below, 80 more
    assert made[1, 4] == hard[1, 4] - 20
    # The first column's left neighbour is the last one: its copy, continued to column 8, lies at 8 + 8.
    continued = np.float64(10 * (index[1, 7] + 1))
    assert made[1, 0] == (hard[1, 0] * 0.75 + continued * 0.25 if mixed else hard[1, 0])


@pytest.mark.parametrize("kind", ["signed floats", "floats", "uint8"])
def test_mixed_normals_have_length_one_again(kind):
    angle = np.linspace(-0.9, 0.9, 64).reshape(8, 8)
    vectors = np.stack([np.sin(angle), np.zeros((8, 8)), np.cos(angle)], axis=-1)
    shares = (vectors + 1) / 2
    plane = {
        "signed floats": vectors.astype(np.float32),
        "floats": shares.astype(np.float32),
        "uint8": np.rint(255 * shares).astype(np.uint8),
    }[kind]
    index = np.arange(64, dtype=np.int32).reshape(8, 8)[:4].copy()
    index[:, 4:] += 24
    made = render_normals(index, plane, np.ones((8, 8), bool), (False, False), 1)
    assert (made != plane.reshape(-1, 3)[index]).any(axis=-1).any()
    seen = made.astype(float) / (255 if kind == "uint8" else 1)
    seen = seen if kind == "signed floats" else 2 * seen - 1
    np.testing.assert_allclose(np.linalg.norm(seen, axis=-1), 1, atol=0.01 if kind == "uint8" else 1e-5)


def test_reduced_pictures_are_area_means_with_missing_shares():
    values = np.arange(24, dtype=np.float32).reshape(4, 6, 1)
    weight = np.ones((4, 6), np.float32)
    mean, share = reduced(values, weight, 2)
    np.testing.assert_array_equal(mean[..., 0], [[3.5, 5.5, 7.5], [15.5, 17.5, 19.5]])
    np.testing.assert_array_equal(share, np.ones((2, 3)))
    weight[0, 0] = 0
    weight[2:, 4:] = 0
    mean, share = reduced(values, weight, 2)
    assert mean[0, 0, 0] == (1 + 6 + 7) / 3
    np.testing.assert_array_equal(share, [[0.75, 1, 1], [1, 1, 0]])
    # What does not fill a block is there with the rest of its weight missing.
    mean, share = reduced(values[:3, :5], np.ones((3, 5), np.float32), 2)
    np.testing.assert_array_equal(share, [[1, 1, 0.5], [0.5, 0.5, 0.25]])
    assert mean[1, 2, 0] == 16


@pytest.mark.parametrize("row", [[0, 5, 6, 7], [5, 0, 1, 2], [-1, 5, 1, 2]])
def test_near_seams_are_pixels_beside_non_neighbours_or_none(row):
    index = np.array([row, [value + 8 if value >= 0 else value for value in row]], np.int32)
    found = {divmod(at, 4) for some in near_seams(index, 8, (False, False), 1) for at in some.tolist()}
    columns = (0, 1) if row[0] >= 0 else (1, 2)
    assert found == {(y, x) for y in range(2) for x in columns}


@pytest.mark.parametrize("smooth", [0, 1])
def test_where_no_source_is_known_it_is_0(smooth):
    index = np.full((3, 4), 5, np.int32)
    index[1, 2] = -1
    made = render(index, np.full((4, 4, 2), 9.0), np.ones((4, 4), bool), (False, False), smooth)
    np.testing.assert_array_equal(made[1, 2], [0, 0])
    assert (made[index >= 0] == 9).all()


def test_copies_that_agree_are_mixed_to_the_last_bit():
    values = np.random.default_rng(0).random(50, np.float32)
    index = np.repeat([[5, 6, 1, 2]], 3, axis=0).astype(np.int32)
    made = render(index, np.tile(values, (4, 4, 1)), np.ones((4, 4), bool), (False, False), 2)
    np.testing.assert_array_equal(made, np.tile(values, (3, 4, 1)))


def test_pixels_within_reach_of_a_seam_are_near_it_but_no_holes():
    index = np.array([[-1, 0, 1, 9, 10, 11, 12]], np.int32)
    (found,) = near_seams(index, 16, (False, False), 3)
    assert found.tolist() == [1, 2, 3, 4, 5]  # two farther on either side, but not in the hole


def test_coordinates_alone_cut_other_pictures_alike(sample):
    first, second = sample(2), sample(3)
    made = ts.synthesize([first, second], 90, patch=32, tileable=True)
    again = ts.texture.apply_coordinates([first, second], made.source, made.exemplar, tileable=True)
    np.testing.assert_array_equal(again, made.image)
    with pytest.raises(ts.ImageError, match="point beyond"):
        ts.texture.apply_coordinates([first, second[:20]], made.source, made.exemplar)
    with pytest.raises(ts.ImageError, match="row and column"):
        ts.texture.apply_coordinates(first, made.source[..., 0])
