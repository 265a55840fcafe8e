"""A folder with the maps of a material makes another one: `tile` and `synth`."""

import numpy as np
import pytest
from scipy import ndimage

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

MAPS = ("albedo.png", "ao.tif", "height.png", "metallic.png", "normal.png", "roughness.jpg")


def normals(heights):
    y, x = np.gradient(heights)
    vectors = np.stack([-x, y, np.ones_like(x)], axis=2)
    return vectors / np.linalg.norm(vectors, axis=2, keepdims=True)


@pytest.fixture(autouse=True)
def wall(tmp_path, monkeypatch):
    """Bumps of stone: what is high is bright, and some of it metal."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "wall"
    folder.mkdir()
    heights = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(96, 96)), 3)
    heights = (heights - heights.min()) / np.ptp(heights)
    planes = {
        "albedo.png": np.uint8(255 * heights[..., np.newaxis] * (1, 0.9, 0.8)),
        "ao.tif": np.uint8(100 + 100 * heights),
        "height.png": np.uint16(65535 * heights),
        "metallic.png": np.uint8(255 * (heights > 0.6)),
        "normal.png": np.uint16(np.rint((normals(30 * heights) + 1) * 32767.5)),
        "roughness.jpg": np.uint8(255 - 200 * heights),
    }
    for name, pixels in planes.items():
        write_picture(folder / f"wall_{name}", Picture(pixels=pixels))
    (folder / "licence.txt").write_text("free")
    return folder


def read(folder):
    return {name: read_picture(f"{folder}/wall_{name}").pixels for name in MAPS}


def test_a_tile_of_all_maps_under_the_same_names(toposeam, wall):
    ran = toposeam("tile", "wall", "-o", "tiled", "--band", "12")
    assert ran.code == 0, ran
    assert ran.out.startswith("tiled: 96 × 96 px")
    assert len(ran.out.splitlines()) == 1
    assert sorted(path.name for path in (wall.parent / "tiled").iterdir()) == [
        f"wall_{name}" for name in MAPS
    ]
    given, made = read("wall"), read("tiled")
    for name in MAPS:
        assert made[name].dtype == given[name].dtype
        assert made[name].shape == given[name].shape
        inner = np.s_[20:-20, 20:-20]
        if name != "roughness.jpg":  # which is compressed again
            np.testing.assert_array_equal(made[name][inner], given[name][inner])
    assert set(np.unique(made["metallic.png"])) <= {0, 255}
    assert not set(np.unique(made["height.png"])) - set(np.unique(given["height.png"]))
    np.testing.assert_allclose(np.linalg.norm(made["normal.png"] / 32767.5 - 1, axis=2), 1, atol=1e-3)
    toposeam("tile", "wall", "-o", "tiled").fails("wall_albedo.png' exists already; pass --force")
    assert toposeam("tile", "wall", "-o", "tiled", "--force").code == 0


@pytest.mark.medium
def test_a_texture_whose_turned_patches_have_turned_normals(toposeam):
    line = (
        "synth",
        "wall/",
        "--size",
        "120",
        "--setting",
        "fine",
        "--turns",
        "all",
        "--coordinates",
        "from.png",
    )
    assert toposeam(*line, "-o", "large").code == 0
    made = read("large")
    positions = np.unique(read_picture("from.png").pixels[..., 2])
    assert len(positions) > 2  # some patches are turned
    apart = np.linalg.norm(
        normals(30 * (made["height.png"] / 65535)) - (made["normal.png"] / 32767.5 - 1), axis=2
    )
    assert np.mean(apart < 0.01) > 0.8  # all but seams; of patches with other normals 0.3 at most would be


@pytest.mark.parametrize(
    ("change", "line", "phrase"),
    [
        (("wall_albedo.png", None), "tile wall -o out", "is the albedo; end its name in _albedo"),
        (("wall_ao.tif", "wall_foo.tif"), "tile wall -o out", "nothing tells what map"),
        (("wall_ao.tif", "wall_ao.tga"), "tile wall -o out", "save it as .tif or .png"),
        (("wall_ao.tif", "wall_diffuse.tif"), "tile wall -o out", "are both the albedo"),
        (("wall_normal.png", "wall_nor_dx.png"), "tile wall -o wall.png", "names a picture"),
        (
            ("wall_ao.tif", "wall_normal_dx.png"),
            "synth wall --size 99 --turns all -o out",
            "only one is turned",
        ),
        (None, "tile wall -o none/out", "there is no folder"),
        (None, "tile wall --also wall/wall_ao.tif -o out", "put further ones into it"),
        (None, "synth wall wall/wall_ao.tif --size 90 -o out", "give either all of one kind"),
        (None, "synth wall other --size 90 -o out", "do not have the same maps: only one has ao"),
        ("small", "tile wall -o out", "wall_height.png' is 40 × 96 px, but 'wall_albedo.png' 96 × 96 px"),
    ],
)
def test_what_is_no_material_ends_in_one_sentence(toposeam, wall, change, line, phrase):
    other = wall.parent / "other"
    other.mkdir()
    (other / "moss_color.png").write_bytes((wall / "wall_albedo.png").read_bytes())
    if change == "small":
        picture = read_picture(wall / "wall_height.png")
        write_picture(wall / "wall_height.png", Picture(pixels=picture.pixels[:, :40]), force=True)
    elif change is not None and change[1] is None:
        (wall / change[0]).unlink()
    elif change is not None:
        (wall / change[0]).rename(wall / change[1])
    before = sorted(wall.parent.rglob("*"))
    toposeam(*line.split()).fails(phrase)
    assert sorted(wall.parent.rglob("*")) == before


def test_two_materials_make_one(toposeam, wall):
    other = wall.parent / "other"
    other.mkdir()
    for path in wall.glob("*_albedo.png"):
        (other / "moss_color.png").write_bytes(path.read_bytes())
    for path in wall.iterdir():
        if not path.name.endswith(("_albedo.png", "_height.png", ".txt")):
            path.unlink()
    (other / "moss_disp_2k.png").write_bytes((wall / "wall_height.png").read_bytes())
    assert toposeam("synth", "wall", "other", "--size", "100", "--setting", "fine", "-o", "out").code == 0
    assert sorted(path.name for path in (wall.parent / "out").iterdir()) == [
        "wall_albedo.png",
        "wall_height.png",
    ]
