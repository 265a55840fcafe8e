"""``toposeam enblend``, by itself and called by Hugin's own programs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tifffile
from scipy import ndimage

from stitching import names
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

WIDTH, HEIGHT = 360, 180


def scene():
    """A picture of all directions, (HEIGHT, WIDTH, 3) in 0 to 255; its right edge goes on at the left."""
    rng = np.random.default_rng(0)
    layers = [
        ndimage.gaussian_filter(
            rng.random((HEIGHT, WIDTH, 3)), (s, s, 0), mode=("nearest", "wrap", "nearest")
        )
        for s in (1, 3, 9)
    ]
    return np.clip(128 + sum(25 * (one - one.mean()) / one.std() for one in layers), 0, 255)


def view(whole, yaw, size=(110, 80), field=80.0):
    """What a camera sees in one direction, in degrees."""
    focal = size[0] / 2 / np.tan(np.radians(field / 2))
    x, y = np.meshgrid(*(np.arange(side) - side / 2 + 0.5 for side in size))
    longitude = np.arctan2(x, focal) + np.radians(yaw)
    latitude = np.arctan2(-y, np.hypot(x, focal))
    at = (0.5 - latitude / np.pi) * HEIGHT - 0.5, ((longitude / (2 * np.pi) + 0.5) * WIDTH - 0.5) % WIDTH
    planes = [ndimage.map_coordinates(whole[..., c], at, order=1, mode="grid-wrap") for c in range(3)]
    return np.stack(planes, axis=-1)


def write_view(path, rgba, at, canvas=None):
    """A TIFF file as nona writes it."""
    tags = [(286 + axis, 5, 1, (at[axis], 150), True) for axis in (0, 1)]
    if canvas is not None:
        tags += [(33300 + axis, 4, 1, canvas[axis], True) for axis in (0, 1)]
    options = {"resolution": (150, 150), "resolutionunit": "INCH", "metadata": None, "extratags": tags}
    tifffile.imwrite(path, rgba, photometric="rgb", extrasamples=["unassalpha"], **options)


@pytest.fixture
def strip(tmp_path, monkeypatch):
    """Three cropped views side by side, exposed differently, and the scene."""
    monkeypatch.chdir(tmp_path)
    whole = scene()
    for index, (x, y) in enumerate(((10, 20), (90, 24), (170, 18))):
        part = whole[y : y + 100, x : x + 120] * (1 + 0.03 * index)
        rgba = np.full((100, 120, 4), 255, np.uint8)
        rgba[..., :3] = np.clip(part, 0, 255)
        rgba[:3, :9, 3] = 0
        write_view(tmp_path / f"v{index}.tif", rgba, (x, y), (WIDTH, HEIGHT))
    return whole


FILES = ["v0.tif", "v1.tif", "v2.tif"]


def test_no_input_is_replaced(strip, toposeam):
    before = {name: Path(name).read_bytes() for name in FILES}
    toposeam("enblend", "-o", "v1.tif", *FILES).fails("'v1.tif' is one of the pictures to be blended")
    os.link("v0.tif", "same.tif")
    toposeam("enblend", "-o", "same.tif", *FILES).fails("one of the pictures")
    toposeam("enblend", "-o", "out.tif", "--save-masks=v%i.tif", *FILES).fails("one of the pictures")
    assert {name: Path(name).read_bytes() for name in FILES} == before
    assert not Path("out.tif").exists()


@pytest.mark.medium
def test_views_are_blended_where_their_tags_say(strip, toposeam):
    ran = toposeam("enblend", "--compression=LZW", "-o", "out.tif", "-a", "-x", "--", *FILES)
    assert (ran.code, ran.out, ran.err) == (0, "", "")
    result = read_picture("out.tif")
    assert result.pixels.shape == (106, 280, 3)
    known = result.alpha > 0
    error = np.abs(result.pixels - strip[18:124, 10:290])
    assert known.mean() > 0.9
    assert error[known].mean() < 6
    with tifffile.TiffFile("out.tif") as file:
        assert file.pages[0].compression.name == "LZW"
    before = result.pixels
    ran = toposeam("enblend", "-l", "1", "-f200x86+60+30", "-oout.tif", *FILES)  # replaces it
    assert ran.code == 0, ran
    framed = read_picture("out.tif")
    assert framed.pixels.shape == (86, 200, 3)
    assert framed.alpha is None
    inner = np.abs(framed.pixels[:, :20].astype(int) - before[12:98, 50:70])
    assert inner.max() <= 40
    assert inner.mean() < 2


@pytest.mark.medium
def test_a_frame_larger_than_the_views_is_empty_around_them(strip, toposeam):
    assert toposeam("enblend", f"-f{WIDTH}x{HEIGHT}", "-o", "out.tif", *FILES).code == 0
    result = read_picture("out.tif")
    assert result.pixels.shape == (HEIGHT, WIDTH, 3)
    rows, columns = np.nonzero(result.alpha)
    assert (rows.min(), rows.max() + 1, columns.min(), columns.max() + 1) == (18, 124, 10, 290)
    assert toposeam("enblend", f"-f{WIDTH}x{HEIGHT}", "--compression=90", "-o", "out.jpg", *FILES).code == 0
    flat = read_picture("out.jpg").pixels
    assert flat[:8].max() < 12  # black, as enblend has it
    assert flat.shape == result.pixels.shape


def test_masks_are_saved_and_loaded(strip, toposeam):
    ran = toposeam("enblend", "--save-masks=m%n.png", "-o", "out.tif", *FILES)
    assert ran.code == 0, ran
    masks = [read_picture(f"m{number}.png").pixels for number in (1, 2, 3)]
    result = read_picture("out.tif")
    shown = np.sum([mask == 255 for mask in masks], axis=0)
    np.testing.assert_array_equal(shown == 1, result.alpha > 0)
    assert shown.max() == 1
    assert toposeam("enblend", "--load-masks=m%n.png", "-o", "again.tif", *FILES).code == 0
    np.testing.assert_array_equal(read_picture("again.tif").pixels, result.pixels)
    moved = np.where(result.alpha > 0, np.uint8(255), np.uint8(0))
    moved[:, 90:] = 0
    write_picture("m1.png", Picture(pixels=moved), True)
    write_picture("m2.png", Picture(pixels=np.where(moved > 0, np.uint8(0), masks[1])), True)
    assert toposeam("enblend", "--load-masks=m%n.png", "-l1", "-o", "again.tif", *FILES).code == 0
    alone = read_picture("v0.tif")
    again = read_picture("again.tif").pixels[2:102, :80]
    np.testing.assert_array_equal(
        again[alone.alpha[:, :80] > 0], alone.pixels[:, :80][alone.alpha[:, :80] > 0]
    )


def test_what_does_not_matter_is_said(strip, toposeam):
    ran = toposeam("enblend", "--primary-seam-generator=nft", "--fine-mask", "-v", "-o", "out.tif", *FILES)
    assert ran.code == 0
    assert ran.err.splitlines() == [
        "warning: --primary-seam-generator means nothing here and is left out",
        "warning: --fine-mask means nothing here and is left out",
    ]
    toposeam("enblend", "--wrap=vertical", "-o", "o.tif", *FILES).fails("goes round upwards")
    toposeam("enblend", "--nonsense", *FILES).fails("no option of enblend")
    toposeam("enblend", "-o", "o.tif", "v0.tif", "nowhere.tif").fails("nowhere.tif")
    assert toposeam("enblend", "--version").out.startswith("enblend 4.2")
    assert names(Path.cwd()) == ["out.tif", *FILES]


def test_one_view_is_itself(strip, toposeam):
    assert toposeam("enblend", f"-f{WIDTH}x{HEIGHT}", "-o", "out.tif", "v1.tif").code == 0
    result, own = read_picture("out.tif"), read_picture("v1.tif")
    np.testing.assert_array_equal(result.pixels[24:124, 90:210][own.alpha > 0], own.pixels[own.alpha > 0])
    assert (result.alpha > 0).sum() == (own.alpha > 0).sum()


def across(image, alpha, whole):
    """How much more the picture changes over the edge than the scene does, and between its other columns."""
    values = image.astype(float)
    steps = np.abs(
        np.diff(values, axis=1, append=values[:, :1]) - np.diff(whole, axis=1, append=whole[:, :1])
    )
    known = (alpha > 0) & (np.roll(alpha, -1, axis=1) > 0)
    return steps[:, -1][known[:, -1]].mean(), steps[known].mean()


def round_views(folder, whole):
    for index, yaw in enumerate(range(-150, 151, 60)):
        shown = np.clip(view(whole, yaw) * (0.94 + 0.03 * index), 0, 255).astype(np.uint8)
        write_picture(folder / f"v{index}.png", Picture(pixels=shown))


@pytest.mark.parametrize("command", ["enblend", "stitch"])
def test_all_the_way_round(tmp_path, monkeypatch, toposeam, command):
    monkeypatch.chdir(tmp_path)
    whole = scene()
    rng = np.random.default_rng(1)
    files = []
    for index in range(4):
        columns = np.arange(90 * index + 20, 90 * index + 150) % WIDTH
        rgba = np.zeros((100, WIDTH, 4), np.uint8)
        part = whole[30:130, columns] * (1 + 0.03 * index) + rng.normal(0, 1, (100, 130, 3))
        rgba[:, columns, :3], rgba[:, columns, 3] = np.clip(part, 0, 255), 255
        files.append(f"v{index}.tif")
        write_view(files[-1], rgba, (0, 30), (WIDTH, HEIGHT))
    if command == "enblend":
        words = ["enblend", "-w", f"-f{WIDTH}x{HEIGHT}", "-o", "out.tif", *files]
    else:
        words = ["stitch", *files, "--blend", "multiband", "-o", "out.tif", "--wrap"]
    ran = toposeam(*words)
    assert ran.code == 0, ran
    result = read_picture("out.tif")
    assert result.pixels.shape[1] == WIDTH
    alpha = np.full(result.pixels.shape[:2], 255) if result.alpha is None else result.alpha
    truth = whole if command == "enblend" else whole[30:130]
    edge, inside = across(result.pixels, alpha, truth)
    assert edge < 2 * inside + 0.5


def test_a_width_nobody_says_is_asked_for(strip, toposeam):
    for name in ("a.png", "b.png"):
        write_picture(name, Picture(pixels=read_picture("v0.tif").pixels))
    words = ["stitch", "a.png", "b.png", "--offset", "60,0", "-o", "out.png"]
    toposeam(*words, "--wrap").fails("--wrap 8000")
    toposeam(*words, "--wrap", "100").fails("give a larger width")
    write_picture("no.png", Picture(pixels=np.zeros((100, 180), np.uint8)))
    toposeam(*words, "--wrap", "150", "--avoid", "no.png").fails("leave them out")


@pytest.mark.medium
@pytest.mark.skipif(
    not all(map(shutil.which, ("nona", "hugin_executor"))), reason="no hugin-tools on this machine"
)
@pytest.mark.parametrize("by", ["hugin_executor", "steps"])
def test_hugin_is_served(tmp_path, by):
    whole = scene()
    round_views(tmp_path, whole)
    camera = "w110 h80 f0 v80 Ra0 Rb0 Rc0 Rd0 Re0 Eev0 Er1 Eb1 r0 p0 TrX0 TrY0 TrZ0 j0 a0 b0 c0 d0 e0 g0 t0"
    lines = [f'p f2 w{WIDTH} h{HEIGHT} v360 n"TIFF_m c:LZW"', "m i0"]
    lines += [f'i {camera} y{yaw} Vm5 n"v{index}.png"' for index, yaw in enumerate(range(-150, 151, 60))]
    (tmp_path / "pano.pto").write_text("\n".join(lines) + "\n")
    programs = tmp_path / "programs"
    programs.mkdir()
    program = programs / "enblend"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m toposeam_cli enblend "$@"\n')
    program.chmod(0o755)
    environment = os.environ | {"PATH": f"{programs}:{os.environ['PATH']}"}
    run = {"cwd": tmp_path, "env": environment, "capture_output": True, "text": True, "check": True}
    if by == "steps":
        subprocess.run(["nona", "-m", "TIFF_m", "-o", "n", "pano.pto"], **run)
        views = [f"n{index:04d}.tif" for index in range(6)]
        words = ["-w", f"-f{WIDTH}x{HEIGHT}", "--compression=LZW", "-o", "out.tif", "--", *views]
        subprocess.run(["enblend", *words], **run)
    else:
        subprocess.run(["hugin_executor", "-s", "-p", "out", "pano.pto"], **run)
    result = read_picture(tmp_path / "out.tif")
    assert result.pixels.shape == (HEIGHT, WIDTH, 3)
    known = result.alpha > 0
    assert 0.2 < known.mean() < 0.6
    assert np.abs(result.pixels - whole)[known].mean() < 8
    edge, inside = across(result.pixels, result.alpha, whole)
    assert edge < 2 * inside + 0.5


def test_a_covered_view_that_does_not_show_is_named(strip, toposeam):
    rgba = np.full((60, 50, 4), 255, np.uint8)
    rgba[..., :3] = strip[40:100, 85:135][::-1, ::-1]
    write_view("nadir.tif", rgba, (85, 40))
    ran = toposeam("enblend", "-o", "out.tif", *FILES, "nadir.tif")
    assert (ran.code, ran.out) == (0, "")
    assert ran.err.startswith("warning: nadir.tif does not show")
    assert "mask the others" in ran.err
