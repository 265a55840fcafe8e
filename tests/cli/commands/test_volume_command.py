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


def test_three_stacks_in_turn(toposeam, tmp_path):
    rng = np.random.default_rng(0)
    whole = np.rint(9000 + 30000 * ndimage.gaussian_filter(rng.standard_normal((10, 40, 70)), 1.5)).astype(
        np.uint16
    )
    parts = [(whole[:, :, :40], None), (whole[:, :24, 30:], "0,0,30"), (whole[:, 14:, 30:], "0,14,30")]
    words = []
    for place, (stack, offset) in enumerate(parts):
        np.save(tmp_path / f"{place}.npy", stack)
        words += [] if offset is None else ["--offset", offset]
    files = [tmp_path / f"{place}.npy" for place in range(3)]
    for more in ([], ["--block", "16"]):
        ran = toposeam("volume", *files, *words, "-o", tmp_path / "j.npy", "--force", *more)
        assert ran.code == 0, ran
        np.testing.assert_array_equal(np.load(tmp_path / "j.npy"), whole)
    out = ["-o", tmp_path / "k.npy"]
    toposeam("volume", *files, "--offset", "0,0,30", *out).fails("3 stacks need 2 times --offset")
    toposeam("volume", files[0], "--offset", "0,0,30", *out).fails("a second one is needed")
    toposeam("volume", *files, *words, *out, "--mesh", tmp_path / "m.ply").fails("join two at a time")
    toposeam("volume", *files, *words[:2], "--offset", "0,90,30", *out).fails("at offset 0,90,30")
    np.save(files[2], parts[2][0].astype(np.uint8))
    toposeam("volume", *files, *words, *out).fails("0.npy has dtype uint16 and 2.npy has uint8")


def test_segmentations_get_through(toposeam, pair, tmp_path):
    _, *files = pair
    cells = np.zeros((12, 24, 70), np.uint8)
    cells[3:9, 6:18, 28:42], cells[3:9, 6:18, 50:60] = 1, 2
    save(tmp_path / "ca.npy", cells[:, :, :40])
    save(tmp_path / "cb.npy", np.where(cells > 0, cells + 7, 0).astype(np.uint8)[:, :, 30:])
    avoid = ["--avoid", tmp_path / "ca.npy", "--avoid", tmp_path / "cb.npy"]
    out = ["--offset", "0,0,30", "-o", tmp_path / "j.npy"]
    assert toposeam("volume", *files, *out, *avoid, "--cells", tmp_path / "cells.tif").code == 0
    found = read(tmp_path / "cells.tif")[0]
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found > 0, cells > 0)
    assert set(np.unique(found[cells == 1])) == {1}
    toposeam("volume", *files, *out, "--force", "--avoid", tmp_path / "cells.tif").fails(
        "one for each of the 12×24×40 voxels of a.ome.tif"
    )
    toposeam("volume", *files, *out, "--force", "--cells", tmp_path / "c.tif").fails("give --avoid, too")


def test_unlike_light_is_told_and_matched(toposeam, tmp_path):
    whole, a, b = stacks()
    files = [save(tmp_path / "a.npy", a), save(tmp_path / "b.npy", (0.7 * b).astype(np.uint16))]
    words = ["volume", *files, "--offset", "0,0,30", "-o", tmp_path / "j.npy", "--force"]
    ran = toposeam(*words)
    assert "b.npy has 0.70 times the light" in ran.err
    ran = toposeam(*words, "--match-tones")
    assert not ran.err
    apart = np.abs(np.load(tmp_path / "j.npy") - whole.astype(float))
    assert apart.max() < 0.05 * whole.max()


def test_parts_of_voxels_are_refused(toposeam, pair, tmp_path):
    _, *files = pair
    toposeam("volume", *files, "--offset", "0,0.5,30", "-o", tmp_path / "j.npy").fails(
        "resample the stack", 2
    )


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


def uneven(dtype=np.uint16, channels=0, depth=35):
    """A stack whose sides all differ, of more slices than are written at a time."""
    shape = (depth, 4, 7, channels)[: 4 if channels else 3]
    return (np.random.default_rng(1).random(shape) * 200).astype(dtype)


def ome_pixels(file):
    """The sizes that OME's description names, as it writes them."""
    from xml.etree import ElementTree

    root = ElementTree.fromstring(file.ome_metadata)
    return next(dict(node.attrib) for node in root.iter() if node.tag.endswith("}Pixels"))


@pytest.mark.parametrize(
    ("name", "dtype", "imagej"),
    [
        ("s.tif", np.uint8, True),
        ("s.TIFF", np.uint16, True),
        ("s.tif", np.float32, True),
        ("s.tif", np.uint32, False),
        ("s.tif", np.float16, True),
        ("s.ome.tif", np.float16, False),
        ("s.ome.tif", np.uint8, False),
        ("s.OME.TIFF", np.uint16, False),
        ("some.tif", np.uint8, True),
    ],
)
@pytest.mark.parametrize("channels", [0, 3])
def test_other_programs_find_voxels_and_sizes_in_a_tiff(tmp_path, name, dtype, imagej, channels):
    from toposeam_cli.media.stacks.writing import write_stack

    voxels = uneven(dtype, channels)
    write_stack(tmp_path / name, voxels, SPACING)
    with tifffile.TiffFile(tmp_path / name) as file:
        assert (file.is_imagej, file.is_ome) == (imagej, not imagej)
        series, page = file.series[0], file.pages[0]
        assert series.axes == ("ZCYX" if channels else "ZYX")
        assert page.photometric == tifffile.PHOTOMETRIC.MINISBLACK
        found = series.asarray()
        if imagej:
            assert (file.imagej_metadata["spacing"], file.imagej_metadata["unit"]) == (SPACING[0], "um")
            x, y = (page.tags[tag].value for tag in ("XResolution", "YResolution"))
            assert (x[0] / x[1], y[0] / y[1]) == pytest.approx((1 / SPACING[2], 1 / SPACING[1]))
        else:
            pixels = ome_pixels(file)
            assert tuple(float(pixels[f"PhysicalSize{axis}"]) for axis in "ZYX") == SPACING
            assert {pixels[f"PhysicalSize{axis}Unit"] for axis in "ZYX"} == {"µm"}
    assert found.dtype == (np.float32 if dtype == np.float16 else dtype)
    np.testing.assert_array_equal(np.moveaxis(found, 1, -1) if channels else found, voxels)


@pytest.mark.parametrize("name", ["s.tif", "s.ome.tif"])
def test_voxels_of_no_known_size_get_none(tmp_path, name):
    from toposeam_cli.media.stacks.writing import write_stack

    write_stack(tmp_path / name, uneven(), None)
    with tifffile.TiffFile(tmp_path / name) as file:
        if file.is_ome:
            assert not any(key.startswith("Physical") for key in ome_pixels(file))
        else:
            assert not {"spacing", "unit"} & set(file.imagej_metadata)
    assert read(tmp_path / name)[1] is None


@pytest.mark.parametrize(("more", "imagej"), [(0, False), (1, True)])
def test_what_imagej_cannot_hold_is_written_as_ome(tmp_path, monkeypatch, more, imagej):
    """Its files end at 4 GB; here, at what a small stack has."""
    from toposeam_cli.media.stacks import writing

    voxels = uneven(np.uint16, channels=2)
    monkeypatch.setattr(writing, "_IMAGEJ_BYTES", voxels.nbytes + more)
    writing.write_stack(tmp_path / "s.tif", voxels, None)
    with tifffile.TiffFile(tmp_path / "s.tif") as file:
        assert (file.is_imagej, file.is_ome) == (imagej, not imagej)
    np.testing.assert_array_equal(read(tmp_path / "s.tif")[0], voxels)


@pytest.mark.parametrize("suffix", [".tif", ".npy", ".zarr"])
@pytest.mark.parametrize("lazy", [False, True])
def test_stacks_are_written_some_slices_at_a_time(tmp_path, suffix, lazy):
    from toposeam_cli.media.stacks.writing import write_stack

    values, shares, parts = uneven(np.float32, channels=2), [], []
    voxels = values
    if lazy:
        import dask.array

        def computed(block):
            parts.append(len(block))
            return block

        voxels = dask.array.from_array(values, chunks=(1, -1, -1, -1)).map_blocks(
            computed, dtype=values.dtype, meta=values[:0]
        )
    write_stack(tmp_path / f"s{suffix}", voxels, None, progress=shares.append)
    np.testing.assert_array_equal(read(tmp_path / f"s{suffix}")[0], values)
    assert shares == [16 / 35, 32 / 35, 1]
    assert sum(parts) == (35 if lazy else 0)  # each of them once


@pytest.mark.parametrize("channels", [0, 9])
@pytest.mark.parametrize("spacing", [None, SPACING])
def test_a_zarr_says_what_its_axes_are(tmp_path, channels, spacing):
    from toposeam_cli.media.stacks.writing import write_stack

    voxels = uneven(channels=channels)
    write_stack(tmp_path / "s.zarr", voxels, spacing)
    group = zarr.open_group(str(tmp_path / "s.zarr"), mode="r")
    (image,) = group.attrs["multiscales"]
    space = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    assert image["axes"] == space + [{"name": "c", "type": "channel"}] * bool(channels)
    (dataset,) = image["datasets"]
    scale = [*(spacing or (1, 1, 1)), *[1] * bool(channels)]
    assert dataset["coordinateTransformations"] == [{"type": "scale", "scale": scale}]
    np.testing.assert_array_equal(group[dataset["path"]][:], voxels)


def test_a_zarr_needs_its_package_and_a_folder(tmp_path, monkeypatch):
    from toposeam.errors import MissingPackageError
    from toposeam_cli.media.stacks.writing import check_stack_output

    with pytest.raises(OptionError, match="there is no folder"):
        check_stack_output(tmp_path / "nowhere" / "s.zarr", force=False)
    monkeypatch.chdir(tmp_path)
    check_stack_output(tmp_path / "s.zarr", force=False)
    for missing in ("zarr", "tifffile"):
        monkeypatch.setitem(sys.modules, missing, None)
    for name, package in (("s.zarr", "zarr"), ("s.ome.tif", "tifffile"), ("s.TIFF", "tifffile")):
        with pytest.raises(MissingPackageError, match=rf"{name} needs {package}; .*: pip install {package}$"):
            check_stack_output(tmp_path / name, force=False)
    check_stack_output(tmp_path / "s.NPY", force=False)  # needs nothing


def test_what_a_package_is_called_when_it_is_missing(monkeypatch, tmp_path):
    from toposeam.errors import MissingPackageError
    from toposeam_cli.media.stacks.parts import needs

    monkeypatch.setitem(sys.modules, "dask.array", None)
    with pytest.raises(MissingPackageError, match=r"s.tif needs dask; .*: pip install 'dask\[array\]'$"):
        needs("dask.array", tmp_path / "s.tif")
    assert needs("dask", tmp_path / "s.tif").__name__ == "dask"


@pytest.mark.parametrize(
    ("axes", "shape", "kept"),
    [
        ("ZYX", (3, 5, 7), "ZYX"),
        ("YXZ", (5, 7, 3), "YXZ"),
        ("XZY", (7, 3, 5), "XZY"),
        ("IYX", (3, 5, 7), "IYX"),
        ("QYX", (3, 5, 7), "QYX"),
        ("TYX", (3, 5, 7), "TYX"),
        ("TZCYX", (1, 3, 1, 5, 7), "ZYX"),
        ("TZYXQ", (1, 3, 5, 7, 1), "ZYX"),
        ("CZYX", (2, 3, 5, 7), "CZYX"),
        ("ZYXS", (3, 5, 7, 2), "ZYXS"),
        ("CTYZX", (2, 1, 5, 3, 7), "CYZX"),
    ],
)
def test_axes_in_any_order_become_slices_rows_columns(tmp_path, axes, shape, kept):
    from toposeam_cli.media.stacks.parts import Mapped, ordered

    values = np.arange(np.prod(shape), dtype=np.uint16).reshape(shape)
    np.save(tmp_path / "s.npy", values)
    depth = next(axis for axis in "ZIQT" if axis in kept)
    channel = "".join(axis for axis in kept if axis in "CS")
    expected = np.einsum(f"{axes.lower()}->{(depth + 'YX' + channel).lower()}", values)
    given = Mapped(tmp_path / "s.npy", lambda: np.load(tmp_path / "s.npy", mmap_mode="r"))
    for voxels in (values, given):
        found = ordered(voxels, axes, list(kept), tmp_path)
        assert (found.shape, found.dtype, found.ndim) == (expected.shape, np.uint16, expected.ndim)
        np.testing.assert_array_equal(found[1:, 2:4], expected[1:, 2:4])
        np.testing.assert_array_equal(np.asarray(found, float), expected)


@pytest.mark.parametrize("axes", ["YX", "TZYX", "ZCSYX", "CYX", "ZCY", "ZXC", "ZIYX"])
def test_axes_that_make_no_stack_are_named(tmp_path, axes):
    from toposeam.errors import ImageError
    from toposeam_cli.media.stacks.parts import ordered

    with pytest.raises(ImageError, match=f"has axes {axes}; give one stack"):
        ordered(np.zeros([2] * len(axes)), axes, list(axes), tmp_path)


def test_parts_of_a_stack_that_were_read_are_copies(tmp_path):
    from toposeam_cli.media.stacks.parts import Mapped

    values = uneven()
    voxels = Mapped(tmp_path, lambda: values)
    voxels[2:3][...] = 0
    assert values[2:3].any()


def test_as_many_voxels_as_are_allowed_are_read(tmp_path):
    from toposeam.errors import ImageError
    from toposeam_cli.media.stacks.reading import read_stack

    np.save(tmp_path / "s.npy", uneven(depth=3))
    assert read_stack(tmp_path / "s.npy", most=3 * 4 * 7).size == (3, 4, 7)
    with pytest.raises(ImageError, match="has 3×4×7 voxels, more than the 83 allowed"):
        read_stack(tmp_path / "s.npy", most=3 * 4 * 7 - 1)


def test_whatever_a_reader_raises_is_one_short_sentence(tmp_path):
    from toposeam.errors import ImageError
    from toposeam_cli.media.stacks.parts import damage_reported

    for error in (MemoryError(), OptionError("it is told already")):
        with pytest.raises(type(error)) as caught, damage_reported(tmp_path / "s.tif"):
            raise error
        assert caught.value is error
    for error, reason in (
        (ValueError("two\n  lines "), "two lines"),
        (KeyError(), "KeyError"),
        (ValueError("x" * 300), "x" * 120),
    ):
        told = rf"s\.tif cannot be read as a stack \({reason}\): it is damaged"
        with pytest.raises(ImageError, match=told), damage_reported(tmp_path / "s.tif"):
            raise error
