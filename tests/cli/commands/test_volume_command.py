"""``toposeam volume``: formats in and out, voxel sizes kept, and what is refused."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy import ndimage

from toposeam.errors import OptionError

tifffile = pytest.importorskip("tifffile")
zarr = pytest.importorskip("zarr")

SPACING = (2.0, 0.5, 0.25)


def stacks(dtype=np.uint16, channels=0):
    """Two stacks of one another's continuation, b 30 voxels to the right, in (z, y, x[, c])."""
    rng = np.random.default_rng(0)
    values = ndimage.gaussian_filter(rng.standard_normal((12, 24, 70)), 1.5)
    values = (values - values.min()) / np.ptp(values)
    scale = 1.0 if dtype == np.float32 else np.iinfo(dtype).max
    whole = (values * scale).astype(dtype)
    if channels:
        whole = np.stack([whole // (index + 1) for index in range(channels)], axis=-1)
    return whole, whole[:, :, :40], whole[:, :, 30:]


def save(path, stack, **options):
    if path.suffix == ".npy":
        np.save(path, stack)
    elif path.suffix == ".zarr":
        group = zarr.open_group(str(path), mode="w", zarr_format=2)
        group.create_array("0", data=stack)
        dataset = {"path": "0", "coordinateTransformations": [{"type": "scale", "scale": list(SPACING)}]}
        axes = [{"name": name, "type": "space"} for name in "zyx"]
        group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": [dataset]}]
    elif path.name.endswith(".ome.tif"):
        sizes = {f"PhysicalSize{axis}": side for axis, side in zip("ZYX", SPACING, strict=True)}
        tifffile.imwrite(path, stack, metadata={"axes": "ZYX", **sizes}, ome=True, **options)
    else:
        metadata = {"axes": "ZYX", "spacing": SPACING[0], "unit": "um"}
        resolution = (1 / SPACING[2], 1 / SPACING[1])
        tifffile.imwrite(path, stack, imagej=True, metadata=metadata, resolution=resolution)
    return path


def read(path):
    from toposeam_cli.media.stacks.reading import read_stack

    stack = read_stack(path)
    return np.asarray(stack.voxels), stack.spacing


@pytest.fixture
def pair(tmp_path):
    whole, a, b = stacks()
    return whole, save(tmp_path / "a.ome.tif", a), save(tmp_path / "b.ome.tif", b)


@pytest.mark.parametrize("suffix", [".ome.tif", ".tif", ".zarr", ".npy"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_joined_stacks_keep_depth_and_voxel_size(toposeam, tmp_path, suffix, dtype):
    whole, a, b = stacks(dtype)
    files = [save(tmp_path / f"{name}{suffix}", stack) for name, stack in (("a", a), ("b", b))]
    out = tmp_path / f"joined{suffix}"
    ran = toposeam("volume", *files, "--offset", "0,0,30", "-o", out)
    assert ran.code == 0, ran
    assert "12 × 24 × 70 voxels" in ran.out
    joined, spacing = read(out)
    np.testing.assert_array_equal(joined, whole)
    assert joined.dtype == dtype
    assert spacing == (None if suffix == ".npy" else pytest.approx(SPACING, rel=1e-4))


@pytest.mark.parametrize("suffix", [".ome.tif", ".tif", ".npy"])
def test_stacks_are_opened_not_loaded(tmp_path, suffix):
    from toposeam_cli.media.stacks.reading import read_stack

    _, a, _ = stacks()
    voxels = read_stack(save(tmp_path / f"a{suffix}", a)).voxels
    assert not hasattr(voxels, "copy")  # dask would, all of it
    np.testing.assert_array_equal(voxels[3:5, :, 2:], a[3:5, :, 2:])


@pytest.mark.parametrize("suffix", [".ome.tif", ".zarr"])
def test_from_one_kind_to_another(toposeam, pair, tmp_path, suffix):
    whole, *files = pair
    out = tmp_path / f"joined{suffix}"
    assert toposeam("volume", *files, "--offset", "0,0,30", "-o", out, "--block", "16").code == 0
    joined, spacing = read(out)
    np.testing.assert_array_equal(joined, whole)
    assert spacing == pytest.approx(SPACING)


def test_compressed_and_channelled_stacks(toposeam, tmp_path):
    whole, a, b = stacks(np.uint8, channels=2)
    files = []
    for name, stack in (("a", a), ("b", b)):
        path = tmp_path / f"{name}.ome.tif"
        tifffile.imwrite(
            path, np.moveaxis(stack, -1, 0), ome=True, metadata={"axes": "CZYX"}, compression="zlib"
        )
        files.append(path)
    out = tmp_path / "joined.ome.tif"
    ran = toposeam("volume", *files, "--offset", "0,0,30", "-o", out)
    assert ran.code == 0, ran
    np.testing.assert_array_equal(read(out)[0], whole)


def test_labels_and_mesh(toposeam, pair, tmp_path):
    _, *files = pair
    extra = ["--labels", tmp_path / "labels.tif", "--mesh", tmp_path / "surface.ply"]
    assert toposeam("volume", *files, "--offset", "0,0,30", "-o", tmp_path / "j.npy", *extra).code == 0
    labels, spacing = read(tmp_path / "labels.tif")
    assert labels.shape == (12, 24, 10)
    assert set(np.unique(labels)) == {0, 255}
    assert spacing == pytest.approx(SPACING, rel=1e-4)
    head, _, body = (tmp_path / "surface.ply").read_bytes().partition(b"end_header\n")
    count = int(head.split(b"element vertex ")[1].split()[0])
    x = np.frombuffer(body, "<f4", 3 * count).reshape(-1, 3)[:, 0]
    assert 30 * SPACING[2] <= x.min() <= x.max() <= 40 * SPACING[2]


def test_voxels_of_unlike_size(toposeam, tmp_path, pair):
    _, a, b = pair
    content = tifffile.imread(b)
    sizes = {"PhysicalSizeZ": 2.0, "PhysicalSizeY": 0.5, "PhysicalSizeX": 0.5}
    tifffile.imwrite(b, content, ome=True, metadata={"axes": "ZYX", **sizes})
    toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / "j.tif").fails("resample one of them")
    ran = toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / "j.tif", "--spacing", "2,0.5,0.25")
    assert ran.code == 0, ran


def test_offsets_outside(toposeam, pair, tmp_path):
    _, a, b = pair
    out = tmp_path / "j.tif"
    toposeam("volume", a, b, "--offset", "0,0,40", "-o", out).fails("do not overlap along x")
    toposeam("volume", a, b, "--offset", "0,30", "-o", out).fails("is not z,y,x", 2)
    toposeam("volume", a, b, "--offset", "0,0,30", "-o", out, "--spacing", "0,1,1").fails("is not z,y,x", 2)
    assert not out.exists()


@pytest.mark.parametrize("share", [0.2, 0.9])
@pytest.mark.parametrize("suffix", [".ome.tif", ".tif", ".npy"])
def test_truncated_files(toposeam, tmp_path, suffix, share):
    _, a, b = stacks()
    files = [save(tmp_path / f"{name}{suffix}", stack) for name, stack in (("a", a), ("b", b))]
    content = files[1].read_bytes()
    files[1].write_bytes(content[: int(share * len(content))])
    ran = toposeam("volume", *files, "--offset", "0,0,30", "-o", tmp_path / "j.npy")
    assert ran.code == 1, ran
    ran.is_one_sentence()
    assert not (tmp_path / "j.npy").exists()


@pytest.mark.parametrize("kind", ["imagej", "ome", "bigtiff", "shaped"])
def test_half_a_stack_is_told_in_one_sentence(toposeam, tmp_path, pair, kind):
    _, a, _ = pair
    whole, half = tmp_path / "whole.tif", tmp_path / "half.tif"
    more = {} if kind == "shaped" else {kind: True}
    stack = np.random.default_rng(0).integers(0, 65536, (8, 40, 50), np.uint16)
    tifffile.imwrite(whole, stack, metadata={"axes": "ZYX"}, **more)
    half.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    ran = toposeam("volume", a, half, "--offset", "0,0,0", "-o", tmp_path / "j.tif")
    assert ran.code == 1, ran
    ran.is_one_sentence()
    assert "half.tif is damaged or cut short" in ran.err
    assert not (tmp_path / "j.tif").exists()


def test_what_is_no_stack(toposeam, tmp_path, pair):
    _, a, _ = pair
    out = ["-o", tmp_path / "j.tif", "--offset", "0,0,0"]
    (tmp_path / "text.tif").write_text("not a stack")
    np.save(tmp_path / "flat.npy", np.zeros((4, 4)))
    np.save(tmp_path / "long.npy", np.zeros((4, 4, 4), np.int64))
    tifffile.imwrite(
        tmp_path / "time.tif", np.zeros((3, 4, 8, 8), np.uint8), imagej=True, metadata={"axes": "TZYX"}
    )
    (tmp_path / "empty.zarr").mkdir()
    (tmp_path / "x.czi").write_text("x")
    (tmp_path / "void.tif").touch()
    for name, phrase in (
        ("text.tif", "cannot be read as a stack"),
        ("flat.npy", "give a stack of slices"),
        ("long.npy", "save it as uint8"),
        ("time.tif", "has axes TZYX"),
        ("empty.zarr", "empty.zarr is no zarr; give one of the stacks in that folder"),
        ("void.tif", "void.tif is empty; save or copy"),
        ("x.czi", "is no stack"),
        ("none.tif", "there is no file"),
    ):
        toposeam("volume", a, tmp_path / name, *out).fails(phrase)
    _, _, half = stacks(np.uint8)
    toposeam("volume", a, save(tmp_path / "b.npy", half), *out).fails("and b.npy has uint8; convert one")
    toposeam("volume", a, a, *out).fails("nothing divides the stacks")
    assert not (tmp_path / "j.tif").exists()


def test_without_the_extra(toposeam, pair, tmp_path, monkeypatch):
    _, a, b = pair
    monkeypatch.setitem(sys.modules, "tifffile", None)
    toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / "j.npy").fails(
        "needs tifffile; install it with: pip install tifffile"
    )


@pytest.mark.slow
@pytest.mark.parametrize("how", ["whole", "blocks"])
def test_ctrl_c_leaves_nothing(process, tmp_path, how):
    rng = np.random.default_rng(0)
    files = [tmp_path / "a.npy", tmp_path / "b.npy"]
    for path in files:
        np.save(path, rng.integers(0, 60000, (80, 160, 160)).astype(np.uint16))
    blocks = ["--block", "48"] if how == "blocks" else []
    child = process(
        "volume", *files, "--offset", "0,0,60", "-o", tmp_path / "j.tif", *blocks, stderr=subprocess.PIPE
    )
    while not list(tmp_path.glob(".toposeam-*")) and child.poll() is None:
        time.sleep(0.05)
    time.sleep(1)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=300)
    assert child.returncode == 130
    assert b"no file was left unfinished" in err
    assert sorted(tmp_path.iterdir()) == files


def test_existing_outputs_stay(toposeam, pair, tmp_path):
    _, a, b = pair
    (tmp_path / "j.zarr").mkdir()
    (tmp_path / "j.zarr" / ".zgroup").write_text(json.dumps({}))
    (tmp_path / "j.tif").write_text("mine")
    for name in ("j.zarr", "j.tif"):
        toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / name).fails("--force")
    assert (tmp_path / "j.tif").read_text() == "mine"
    toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / "j.png").fails("use one of")
    assert toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / "j.zarr", "--force").code == 0
    assert not list(tmp_path.glob(".toposeam*"))


def test_numpy_files_are_joined_by_blocks_too(toposeam, tmp_path):
    whole, a, b = stacks(np.float32)
    files = [save(tmp_path / f"{name}.npy", stack) for name, stack in (("a", a), ("b", b))]
    ran = toposeam("volume", *files, "--offset", "0,0,30", "-o", tmp_path / "j.npy", "--block", "16")
    assert ran.code == 0, ran
    assert "by blocks of 16" in ran.out
    np.testing.assert_array_equal(np.load(tmp_path / "j.npy"), whole)


def test_a_folder_that_is_no_zarr_is_not_replaced_by_force(toposeam, pair, tmp_path):
    _, a, b = pair
    (tmp_path / "album.zarr").mkdir()
    (tmp_path / "album.zarr" / "precious.txt").write_text("mine")
    (tmp_path / "file.zarr").write_text("mine")
    for name in ("album.zarr", "file.zarr"):
        ran = toposeam("volume", a, b, "--offset", "0,0,30", "-o", tmp_path / name, "--force")
        ran.fails("is left alone")
    assert (tmp_path / "album.zarr" / "precious.txt").read_text() == "mine"
    assert (tmp_path / "file.zarr").read_text() == "mine"


def test_a_zarr_is_as_it_was_when_another_output_fails(toposeam, pair, tmp_path, monkeypatch):
    from toposeam.volume.mesh import Mesh

    _, a, b = pair
    save(tmp_path / "j.zarr", np.arange(24, dtype=np.uint8).reshape(2, 3, 4))
    before = read(tmp_path / "j.zarr")[0]

    def full(self, path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Mesh, "to_ply", full)
    words = ["volume", a, b, "--offset", "0,0,30", "-o", tmp_path / "j.zarr", "--mesh", tmp_path / "m.ply"]
    toposeam(*words, "--force").fails("no space left")
    np.testing.assert_array_equal(read(tmp_path / "j.zarr")[0], before)
    assert not list(tmp_path.glob(".toposeam*"))
    monkeypatch.undo()
    assert toposeam(*words, "--force").code == 0
    assert read(tmp_path / "j.zarr")[0].shape == (12, 24, 70)
    assert not list(tmp_path.glob(".toposeam*"))


def test_a_zarr_may_replace_its_own_input(toposeam, tmp_path):
    whole, a, b = stacks(np.uint8)
    files = [save(tmp_path / f"{name}.zarr", stack) for name, stack in (("a", a), ("b", b))]
    ran = toposeam(
        "volume", *files, "--offset", "0,0,30", "-o", files[0], "--mesh", tmp_path / "m.ply", "--force"
    )
    assert ran.code == 0, ran
    np.testing.assert_array_equal(read(files[0])[0], whole)


def test_a_second_try_of_a_killed_job_finds_its_zarr(tmp_path):
    from toposeam_cli.files.writing import all_or_nothing
    from toposeam_cli.media.stacks.writing import write_stack

    whole = stacks(np.uint8)[0]
    write_stack(tmp_path / "j.zarr", whole, None)
    with all_or_nothing(resumed=True):
        write_stack(tmp_path / "j.zarr", whole, None)
    with pytest.raises(OptionError, match="exists already"), all_or_nothing(resumed=True):
        write_stack(tmp_path / "j.zarr", whole + 1, None)
    np.testing.assert_array_equal(read(tmp_path / "j.zarr")[0], whole)
