"""`toposeam tileset`: the files of a set, as Tiled and Godot read them."""

import json
import os
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy import ndimage

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

FILES = ["field.png", "tiles.png", "tiles.tres", "tiles.tsx"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("grass", 'wet "dirt" & mud')):
        noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(60, 60)), 1.5, mode="wrap")
        pixels = np.clip(
            np.array([60 + 90 * seed, 140 - 40 * seed, 50]) + 300 * noise[..., np.newaxis], 0, 255
        )
        write_picture(f"{name}.png", Picture(pixels=np.uint8(pixels)))
    return tmp_path


def made(toposeam, *further):
    ran = toposeam("tileset", "grass.png", 'wet "dirt" & mud.png', "--size", "32", *further, "-o", "set")
    assert ran.code == 0, ran
    return ran


@pytest.mark.medium
def test_a_set_of_tiles_for_tiled_and_godot(toposeam, folder):
    assert made(toposeam, "--kind", "corners").out.startswith(
        "set: 64 tiles of 32 × 32 px; tiles.tsx is for Tiled"
    )
    assert sorted(path.name for path in (folder / "set").iterdir()) == FILES
    assert read_picture("set/tiles.png").pixels.shape == (512, 128, 3)
    assert read_picture("set/field.png").pixels.shape == (256, 384, 3)

    root = ElementTree.parse(folder / "set/tiles.tsx").getroot()
    assert (root.tag, root.get("tilecount"), root.get("columns"), root.get("tilewidth")) == (
        "tileset",
        "64",
        "4",
        "32",
    )
    assert root.find("image").attrib == {"source": "tiles.png", "width": "128", "height": "512"}
    wang = root.find("wangsets/wangset")
    assert wang.get("type") == "corner"
    assert [one.get("name") for one in wang.iter("wangcolor")] == ["grass", 'wet "dirt" & mud']
    ids = [[int(word) for word in one.get("wangid").split(",")] for one in wang.iter("wangtile")]
    assert ids[0] == [0, 1] * 4
    assert ids[1] == [0, 1, 0, 1, 0, 1, 0, 2]  # the second material at the top left
    assert ids[2] == [0, 2, 0, 1, 0, 1, 0, 1]  # at the top right
    assert ids[4] == [0, 1, 0, 1, 0, 2, 0, 1]  # at the bottom left
    assert ids[16:32] == ids[:16]

    text = (folder / "set/tiles.tres").read_text()
    assert text.startswith('[gd_resource type="TileSet" load_steps=3 format=3]')
    assert 'path="tiles.png"' in text
    assert r'terrain_set_0/terrain_1/name = "wet \"dirt\" & mud"' in text
    assert len(re.findall(r"^\d:\d+/0 = 0$", text, re.MULTILINE)) == 64
    assert "1:0/0/terrains_peering_bit/top_left_corner = 1\n" in text
    assert "1:0/0/terrains_peering_bit/top_right_corner = 0\n" in text
    assert "3:15/0/terrain = 1\n" in text


@pytest.mark.medium
def test_tiled_itself_reads_and_draws_the_set(toposeam, folder):
    tiled, draw = shutil.which("tiled"), shutil.which("tmxrasterizer")
    if tiled is None or draw is None:
        pytest.skip("Tiled is not installed")
    made(toposeam, "--variants", "1")
    environment = {"QT_QPA_PLATFORM": "offscreen", "HOME": str(folder), "PATH": "/usr/bin:/bin"}
    where = {"cwd": folder / "set", "env": environment, "check": True, "timeout": 60}
    subprocess.run([tiled, "--export-tileset", "json", "tiles.tsx", "set.json"], **where)
    told = json.loads((folder / "set/set.json").read_text())
    assert [told["tilecount"], told["wangsets"][0]["type"]] == [16, "corner"]
    assert told["wangsets"][0]["wangtiles"][6] == {"tileid": 6, "wangid": [0, 2, 0, 1, 0, 2, 0, 1]}
    (folder / "set/map.tmx").write_text(
        '<map version="1.8" orientation="orthogonal" width="2" height="1" tilewidth="32" tileheight="32">'
        '<tileset firstgid="1" source="tiles.tsx"/><layer name="a" width="2" height="1"><data encoding="csv">'
        "11,6</data></layer></map>"
    )
    subprocess.run([draw, "map.tmx", "map.png"], **where)
    sheet, drawn = (read_picture(f"set/{name}.png").pixels[..., :3] for name in ("tiles", "map"))
    np.testing.assert_array_equal(drawn[:, :32], sheet[64:96, 64:96])
    np.testing.assert_array_equal(drawn[:, 32:], sheet[32:64, 32:64])


@pytest.mark.medium
@pytest.mark.skipif(sys.platform != "linux", reason="names are Unicode elsewhere")
def test_names_that_are_not_text(toposeam, folder):
    shutil.copy("grass.png", os.fsdecode(b"caf\xe9.png"))
    ran = toposeam("tileset", "grass.png", os.fsdecode(b"caf\xe9.png"), "--size", "32", "-o", "set")
    assert ran.code == 0, ran
    root = ElementTree.parse(folder / "set/tiles.tsx").getroot()
    assert [one.get("name") for one in root.iter("wangcolor")] == ["grass", r"caf\udce9"]
    assert r'terrain_1/name = "caf\\udce9"' in (folder / "set/tiles.tres").read_text()


@pytest.mark.medium
def test_materials_with_maps_make_a_sheet_of_each(toposeam, folder):
    for name in ("grass", 'wet "dirt" & mud'):
        (folder / name).mkdir()
        picture = read_picture(f"{name}.png")
        write_picture(folder / name / "x_albedo.png", picture)
        write_picture(folder / name / "x_height.png", Picture(pixels=np.uint16(picture.pixels[..., 1]) * 256))
    line = ("tileset", "grass", 'wet "dirt" & mud', "--size", "32", "--variants", "1", "-o", "set", "--json")
    told = json.loads(toposeam(*line).out)
    assert told["files"] == ["tiles.png", "tiles_height.png", "tiles.tsx", "tiles.tres", "field.png"]
    heights = read_picture("set/tiles_height.png").pixels
    assert heights.shape == (128, 128)
    assert heights.dtype == np.uint16


@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        ("grass.png none.png -o set", "none.png"),
        ("grass.png clear.png -o set", "transparent in places"),
        ("grass.png grass.png --size 10 -o set", "between 24 and 512"),
        ("grass.png grass.png --variants 0 -o set", "between 1 and 64"),
        ("grass.png grass.png -o none/set", "there is no folder"),
        ("grass.png folder -o set", "give either both of one kind"),
        ("grass.png grass.png -o full", "exists already; pass --force"),
    ],
)
def test_what_makes_no_set_leaves_nothing(toposeam, folder, words, phrase):
    grass = read_picture("grass.png").pixels
    alpha = np.full(grass.shape[:2], 255, np.uint8)
    alpha[:9] = 0
    write_picture("clear.png", Picture(pixels=grass, alpha=alpha))
    (folder / "folder").mkdir()
    (folder / "full").mkdir()
    (folder / "full/tiles.tsx").write_text("mine")
    before = sorted(folder.rglob("*"))
    toposeam("tileset", *words.split()).fails(phrase)
    assert sorted(folder.rglob("*")) == before
