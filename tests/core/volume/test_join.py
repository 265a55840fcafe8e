"""Stacks joined: whole, and by blocks."""

import io
import sys

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

import toposeam as ts
from toposeam.seam.problem import Overlap
from toposeam.volume.blocks import _even_chunks
from toposeam.volume.heat import coarse_span
from toposeam.volume.problem import SurfaceProblem, place_stacks
from toposeam.volume.problem.posing import surface_problem

array = pytest.importorskip("dask.array")


def stacks(shape=(30, 40, 70), overlap=24, seed=0):
    """Two 16-bit stacks of unlike noise, b to the right of a."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(2):
        values = ndimage.gaussian_filter(rng.standard_normal((*shape[:2], (shape[2] + overlap) // 2)), 1.5)
        made.append(np.rint(60000 * (values - values.min()) / np.ptp(values)).astype(np.uint16))
    return made[0], made[1], (0, 0, (shape[2] - overlap) // 2)


def cost_of(labels, a, b, offset):
    """What labels of the common box cost."""
    places = place_stacks(a.shape, b.shape, offset)
    common = [stack[places.inside(places.overlap, which)] for stack, which in ((a, "a"), (b, "b"))]
    problem, _ = surface_problem(*common, None, None, 2, ts.seam.MatchCost())
    whole = Overlap(
        np.full(labels.shape, 2, np.uint8), problem.overlap.shared, (0, 0, 0), problem.overlap.canvas
    )
    return SurfaceProblem(whole, problem.costs).cost(labels)


@pytest.mark.parametrize("offset", [(0, 0, 12), (-3, 4, 15), (5, -6, -8), (20, 0, 0)])
def test_every_voxel_is_one_of_the_stacks_where_they_lie(offset):
    rng = np.random.default_rng(0)
    a, b = rng.integers(1, 60000, (2, 24, 20, 24)).astype(np.uint16)
    joined = ts.join_volumes(a, b, offset=offset)
    places = joined.places
    on_canvas = np.zeros((2, *places.canvas), np.uint16)
    on_canvas[0][places.box("a")] = a
    on_canvas[1][places.box("b")] = b
    only_a, only_b = (on_canvas > 0)[0] & (on_canvas[1] == 0), (on_canvas > 0)[1] & (on_canvas[0] == 0)
    np.testing.assert_array_equal(joined.volume[only_a], on_canvas[0][only_a])
    np.testing.assert_array_equal(joined.volume[only_b], on_canvas[1][only_b])
    shown = np.where(joined.labels, on_canvas[1][places.overlap], on_canvas[0][places.overlap])
    np.testing.assert_array_equal(joined.volume[places.overlap], shown)
    assert (joined.volume[(on_canvas == 0).all(axis=0)] == 0).all()


@pytest.mark.medium
def test_blocks_find_nearly_the_surface_of_the_whole():
    a, b, offset = stacks()
    whole = ts.join_volumes(a, b, offset=offset)
    blocks = ts.join_volumes(array.from_array(a, chunks=(10, 16, 20)), b, offset=offset, block=16)
    assert cost_of(blocks.labels, a, b, offset) <= 1.02 * cost_of(whole.labels, a, b, offset)
    assert not blocks.labels[..., 0].any()
    assert blocks.labels[..., -1].all()
    shown = np.where(blocks.labels, b[..., :24], a[..., -24:])
    np.testing.assert_array_equal(blocks.volume.compute()[..., offset[2] : offset[2] + 24], shown)
    assert blocks.volume.shape == whole.volume.shape


@pytest.mark.medium
def test_coarse_voxels_and_a_second_round_hardly_cost_anything(monkeypatch):
    monkeypatch.setattr("toposeam.volume.heat.block_surface._MAX_COARSE_VOXELS", 8000)
    a, b, offset = stacks(seed=1)
    assert coarse_span((30, 40, 24)) == (2, 2, 1)
    whole = ts.join_volumes(a, b, offset=offset)
    blocks = ts.join_volumes(a, b, offset=offset, block=20)
    assert cost_of(blocks.labels, a, b, offset) <= 1.03 * cost_of(whole.labels, a, b, offset)


@pytest.mark.medium
def test_blocks_agree_however_they_are_cut_and_kept(tmp_path):
    pytest.importorskip("zarr")
    a, b, offset = stacks((20, 30, 50), 20)
    seen = []
    first = ts.join_volumes(a, b, offset=offset, block=16, progress=seen.append)
    second = ts.join_volumes(
        array.from_array(a, chunks=7),
        array.from_array(b, chunks=9),
        offset=offset,
        block=16,
        keep=tmp_path / "l.zarr",
    )
    np.testing.assert_array_equal(first.labels, second.labels.compute())
    assert seen == sorted(seen)
    assert 0.9 < seen[-1] <= 1


def test_blocks_do_not_copy_what_is_mapped():
    class Mapped(np.ndarray):
        def copy(self, *_):
            raise AssertionError("all of it was read")

    a, b, offset = stacks((12, 16, 30), 14)
    joined = ts.join_volumes(a.view(Mapped), b.view(Mapped), offset=offset, block=16)
    assert np.array_equal(joined.labels, ts.join_volumes(a, b, offset=offset, block=16).labels)


@pytest.mark.slow
def test_a_cluster_joins_as_one_machine_does(dask_cluster):
    distributed = pytest.importorskip("distributed")
    a, b, offset = stacks((20, 30, 50), 20)
    lazy = [array.from_array(stack, chunks=(10, 16, 20)) for stack in (a, b)]
    alone = ts.join_volumes(*lazy, offset=offset, block=16)
    with (
        dask_cluster(2) as cluster,
        distributed.Client(cluster) as client,
    ):
        together = ts.join_volumes(*lazy, offset=offset, block=16)
        volume = together.volume.compute()
        worked = client.run(lambda: "toposeam.volume.blocks" in sys.modules)
    np.testing.assert_array_equal(together.labels, alone.labels)
    np.testing.assert_array_equal(volume, alone.volume.compute())
    assert any(worked.values())  # there, not here


def test_shifted_blocks_have_borders_where_the_others_have_none():
    plain, shifted = _even_chunks(100, 30), _even_chunks(100, 30, True)
    assert sum(plain) == sum(shifted) == 100
    assert max(plain) <= 30
    assert not set(np.cumsum(plain)[:-1]) & set(np.cumsum(shifted)[:-1])


def test_channels_and_spacing():
    a, b, offset = stacks((16, 20, 40), 16)
    colour = [np.stack([stack, stack // 2], axis=-1) for stack in (a, b)]
    joined = ts.join_volumes(*colour, offset=offset, spacing=(3, 1, 1))
    assert joined.volume.shape == (16, 20, 40, 2)
    mesh = joined.mesh()
    assert np.ptp(mesh.vertices[:, 0]) == pytest.approx(45, abs=1)
    assert mesh.vertices[:, 2].min() >= offset[2]


def test_a_result_is_one_line_and_a_picture():
    a, b, offset = stacks((12, 20, 40), 16)
    joined = ts.join_volumes(a, b, offset=offset)
    assert repr(joined).startswith("JoinedVolume(12 × 20 × 40 voxels")
    shown = np.asarray(Image.open(io.BytesIO(joined._repr_png_())).convert("L"))
    middle = joined.volume[6]
    np.testing.assert_allclose(shown, 255.0 * middle / middle.max(), atol=2)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"offset": (0, 0, 60)}, "do not overlap along x"),
        ({"offset": (0, 4)}, "three whole numbers"),
        ({"offset": (0, 0, 1.5)}, "whole number"),
        ({"offset": 3}, "three whole numbers"),
        ({"b": np.zeros((8, 8, 8), np.uint8)}, "convert one of them"),
        ({"a": np.zeros((8, 8)), "b": np.zeros((8, 8))}, "pass a non-empty"),
        ({"a": np.zeros((8, 8, 8, 2)), "b": np.zeros((8, 8, 8))}, "channels"),
        ({"block": 4}, "block is 4"),
        ({"block": 16, "offset": (0, 0, 0)}, "without block"),
    ],
)
def test_bad_input_is_one_sentence(change, text):
    given = {"a": np.zeros((8, 8, 20)), "b": np.zeros((8, 8, 20)), "offset": (0, 0, 12), **change}
    with pytest.raises(ts.TopoSeamError, match=text):
        ts.join_volumes(given.pop("a"), given.pop("b"), **given)


@pytest.mark.parametrize("far", [10**8 + 1, -(10**8) - 1])
def test_a_stack_lies_at_most_a_hundred_million_voxels_away(far):
    with pytest.raises(ts.OptionError, match="offset"):
        place_stacks((4, 4, 4), (4, 4, 4), (0, far, 0))


def test_stacks_may_be_nested_lists():
    a, b = np.random.default_rng(4).random((2, 4, 9, 10))
    joined, same = (ts.join_volumes(*given, offset=(0, 0, 5)) for given in ((a, b), (a.tolist(), b.tolist())))
    assert joined.volume.shape == same.volume.shape == (4, 9, 15)
    np.testing.assert_array_equal(joined.surface.labels, same.surface.labels)
