"""Sets of pictures that do not go together: one sentence that names the picture, and nothing left behind."""

import json

import numpy as np
import pytest
import tifffile
from skimage import data

from toposeam_cli.pictures.picture import Picture, read_picture, write_picture

PLACES = {"a": (0, 0), "b": (200, 4), "c": (30, 170), "d": (215, 160)}


def crop(photograph, at, shape=(220, 300)):
    (x, y), (height, width) = at, shape
    return photograph[y : y + height, x : x + width].copy()


@pytest.fixture
def crops(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, at in PLACES.items():
        write_picture(tmp_path / f"{name}.png", Picture(pixels=crop(data.coffee(), at)))
    return [f"{name}.png" for name in PLACES]


def nothing_new(folder, before):
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.medium
def test_pictures_of_two_scenes_are_two_groups(crops, toposeam, tmp_path):
    for name, at in (("e", (0, 0)), ("f", (100, 20))):
        write_picture(tmp_path / f"{name}.png", Picture(pixels=crop(data.chelsea(), at, (220, 240))))
    before = sorted(path.name for path in tmp_path.iterdir())
    toposeam("stitch", *crops, "e.png", "f.png", "-o", "all.png").fails("e.png and f.png show something else")
    nothing_new(tmp_path, before)


@pytest.mark.medium
def test_a_duplicate_lies_where_the_other_one_does(crops, toposeam, tmp_path):
    (tmp_path / "again.png").write_bytes((tmp_path / "b.png").read_bytes())
    ran = toposeam("stitch", *crops, "again.png", "-o", "all.png", "--json")
    assert ran.code == 0, ran
    places = {layer["name"]: layer["at"] for layer in json.loads(ran.out)["layers"]}
    assert places["again.png"] == places["b.png"] == [200, 4]
    np.testing.assert_array_equal(
        read_picture("all.png").pixels[4:224, 200:500], crop(data.coffee(), (200, 4))
    )


@pytest.mark.medium
def test_one_all_white_is_named(crops, toposeam, tmp_path):
    write_picture(tmp_path / "white.png", Picture(pixels=np.full((220, 300, 3), 255, np.uint8)))
    before = sorted(path.name for path in tmp_path.iterdir())
    toposeam("stitch", *crops, "white.png", "-o", "all.png").fails(
        "white.png fits none of the other pictures"
    )
    nothing_new(tmp_path, before)


@pytest.mark.medium
def test_one_of_another_size_and_depth_is_placed_too(crops, toposeam, tmp_path):
    deep = crop(data.coffee(), (120, 90), (180, 210)).astype(np.uint16) * 257
    write_picture(tmp_path / "deep.tif", Picture(pixels=deep))
    ran = toposeam("stitch", *crops, "deep.tif", "-o", "all.png", "--json")
    assert ran.code == 0, ran
    places = {layer["name"]: layer["at"] for layer in json.loads(ran.out)["layers"]}
    assert places["deep.tif"] == [120, 90]
    joined = read_picture("all.png").pixels
    assert joined.dtype == np.uint16
    np.testing.assert_array_equal(
        joined[100:260, 130:320], crop(data.coffee(), (130, 100), (160, 190)) * np.uint16(257)
    )


def tile(folder, index, x, y, content=None):
    path = folder / f"tile{index:02d}.tif"
    if content is not None:
        path.write_bytes(content)
        return
    tifffile.imwrite(
        path,
        crop(data.coffee(), (x, y), (50, 60)),
        resolution=(150, 150),
        resolutionunit="INCH",
        extratags=[(286, 5, 1, (x, 150), True), (287, 5, 1, (y, 150), True)],
        metadata=None,
    )


@pytest.mark.medium
def test_a_corrupt_one_among_sixty_is_named_and_left_out_when_asked(toposeam, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for index in range(60):
        row, column = divmod(index, 10)
        tile(tmp_path, index, 40 * column, 30 * row, b"II*\0broken" if index == 37 else None)
    files = sorted(path.name for path in tmp_path.iterdir())
    toposeam("stitch", *files, "-o", "all.png").fails("tile37.tif")
    nothing_new(tmp_path, files)
    ran = toposeam("stitch", *files, "--skip-bad", "-o", "all.png")
    assert ran.code == 0, ran
    assert ran.err.count("left out: ") == 1
    assert "tile37.tif" in ran.err
    joined = read_picture("all.png").pixels
    np.testing.assert_array_equal(joined[:80, :400], data.coffee()[:80, :400])
    assert joined.shape == (200, 420, 3)


@pytest.mark.parametrize("x", [2**31, 2**40])
def test_positions_beyond_all_canvases_are_refused(crops, toposeam, tmp_path, x):
    before = sorted(path.name for path in tmp_path.iterdir())
    for where in (("--at", "0,0", "--at", f"{x},0"), ("--offset", f"0,-{x}")):
        toposeam("stitch", "a.png", "b.png", *where, "-o", "all.png").fails("too far away", 2)
    nothing_new(tmp_path, before)
