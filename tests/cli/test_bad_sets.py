"""Sets of pictures that do not go together: one sentence that names the picture, and nothing left behind."""

import json

import numpy as np
import pytest
import tifffile
from skimage import data

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

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
    line = ("stitch", *crops, "e.png", "f.png", "-o", "all.png")
    toposeam(*line, "--exact").fails("e.png and f.png show something else")
    nothing_new(tmp_path, before)
    ran = toposeam(*line, "--one")
    assert ran.code == 0, ran
    assert "left out: e.png shows something else, together with f.png" in ran.err
    ran = toposeam(*line, "--force")
    assert (ran.code, ran.err) == (0, "")
    assert read_picture("all-2.png").pixels.shape[:2] == (240, 340)


@pytest.mark.medium
def test_every_panorama_of_a_folder_is_made(crops, toposeam, tmp_path):
    for name, at in (("e", (0, 0)), ("f", (100, 20))):
        write_picture(tmp_path / f"{name}.png", Picture(pixels=crop(data.chelsea(), at, (220, 240))))
    (tmp_path / "Thumbs.db").write_bytes(b"no picture")
    (tmp_path / ".hidden").write_bytes(b"no picture")
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    for more in ((), ("--force",)):  # what was made is not read again
        ran = toposeam("stitch", ".", "-o", "all.png", *more)
        assert ran.code == 0, ran
        assert [line.split(":")[0] for line in ran.out.splitlines()] == ["all.png", "all-2.png"]
        first, second = ran.err.splitlines()
        assert first == "left out, as they are no pictures: Thumbs.db"
        assert second.startswith("left out: cannot read 'broken.jpg'")


@pytest.mark.parametrize("count", [0, 1])
def test_a_folder_without_pictures_is_refused(toposeam, tmp_path, monkeypatch, count):
    monkeypatch.chdir(tmp_path)
    for number in range(count):
        write_picture(tmp_path / f"{number}.png", Picture(pixels=np.zeros((9, 9), np.uint8)))
    number = f"{count} picture{'s' * (count != 1)}"
    toposeam("stitch", ".", "-o", "all.png").fails(f"the folder '.' holds {number}; put two or more there")


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
    line = ("stitch", *crops, "white.png", "-o", "all.png")
    toposeam(*line, "--exact").fails("white.png fits none of the other pictures")
    nothing_new(tmp_path, before)
    ran = toposeam(*line)
    assert (ran.code, "left out: white.png shows too little" in ran.err) == (0, True), ran


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


def tile(folder, index, x, y, content=None, said=None):
    """A picture that says where it lies, truly or not."""
    path = folder / f"tile{index:02d}.tif"
    if content is not None:
        path.write_bytes(content)
        return
    tifffile.imwrite(
        path,
        crop(data.coffee(), (x, y), (50, 60)),
        resolution=(150, 150),
        resolutionunit="INCH",
        extratags=[(286, 5, 1, (said or x, 150), True), (287, 5, 1, (y, 150), True)],
        metadata=None,
    )


@pytest.mark.medium
def test_one_corrupt_file_of_sixty_is_named_and_can_be_skipped(toposeam, tmp_path, monkeypatch):
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


@pytest.mark.parametrize(
    ("x", "said"),
    [
        (2**31 + 5, "'tile02.tif' says that it lies at 2147483653,0, which is too far away"),
        (2**30, "more than 16 megapixels; check where they lie, tile02.tif first of all"),
    ],
)
def test_a_file_that_says_it_lies_far_away_is_named(toposeam, tmp_path, monkeypatch, x, said):
    monkeypatch.chdir(tmp_path)
    for index in range(4):
        tile(tmp_path, index, 40 * index, 0, said=x if index == 2 else None)
    files = sorted(path.name for path in tmp_path.iterdir())
    toposeam("stitch", *files, "-o", "all.png").fails(said)
    nothing_new(tmp_path, files)


@pytest.mark.parametrize("x", [2**31, 2**70, 1e30])
def test_a_layout_that_lies_far_away(crops, toposeam, tmp_path, x):
    layers = [{"file": name, "at": [x if name == "c.png" else 0, 0]} for name in crops]
    (tmp_path / "far.json").write_text(json.dumps({"layer": layers}))
    before = sorted(path.name for path in tmp_path.iterdir())
    said = ", which lies too far away" if isinstance(x, int) else "; write two whole numbers"
    toposeam("stitch", "far.json", "-o", "all.png").fails(f"layer 3: at is [{x!r}, 0]{said}")
    nothing_new(tmp_path, before)


# --skip-bad where places are counted


def four(folder, bad):
    """Four quarters of a photograph, 150 × 120 px each, that overlap by 50 and 40; one of them is broken."""
    names = [f"{index}.png" for index in range(4)]
    for index, name in enumerate(names):
        if index == bad:
            (folder / name).write_bytes(b"\x89PNG broken")
        else:
            row, column = divmod(index, 2)
            part = crop(data.coffee(), (100 * column, 80 * row), (120, 150))
            write_picture(folder / name, Picture(pixels=part))
    return names


def joined_at(ran):
    assert ran.code == 0, ran
    assert ran.err.count("left out: ") == 1
    return {layer["name"]: tuple(layer["at"]) for layer in json.loads(ran.out)["layers"]}


PLACES_OF_FOUR = {"0.png": (0, 0), "1.png": (100, 0), "2.png": (0, 80), "3.png": (100, 80)}
GRID = "--grid", "2x2", "--overlap", "50"
AT = "--at", "0,0", "--at", "100,0", "--at", "0,80", "--at", "100,80"


@pytest.mark.medium
@pytest.mark.parametrize("bad", range(4))
@pytest.mark.parametrize("way", ["grid", "at", "layout"])
def test_what_is_left_out_leaves_its_place_empty(toposeam, tmp_path, monkeypatch, bad, way):
    monkeypatch.chdir(tmp_path)
    names = four(tmp_path, bad)
    expected = {name: at for name, at in PLACES_OF_FOUR.items() if name != names[bad]}
    if way == "layout":
        lines = [f'[[layer]]\nfile = "{name}"\nat = [{x}, {y}]\n' for name, (x, y) in PLACES_OF_FOUR.items()]
        (tmp_path / "job.toml").write_text("\n".join(lines), encoding="utf-8")
        ran = toposeam("stitch", "job.toml", "--skip-bad", "--json", "-o", "all.png")
    elif way == "at":
        ran = toposeam("stitch", *names, *AT, "--skip-bad", "--json", "-o", "all.png")
    else:  # rows overlap as far as columns do
        expected = {name: (x, 7 * y // 8) for name, (x, y) in expected.items()}
        ran = toposeam("stitch", *names, *GRID, "--skip-bad", "--json", "-o", "all.png")
    assert joined_at(ran) == expected


@pytest.mark.medium
def test_numbers_refer_to_all_pictures_also_if_one_is_skipped(toposeam, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = four(tmp_path, 1)
    white = np.full((120, 150), 255, np.uint8)
    part = white.copy()
    part[:, 120:] = 0
    write_picture(tmp_path / "part.png", Picture(pixels=part))
    words = "stitch", *names, *AT, "--skip-bad", "--json", "-o", "all.png"
    ran = toposeam(*words, "--labels", "labels.png", "--mask-for", "2=part.png")
    joined_at(ran)
    labels = read_picture("labels.png").pixels
    assert (labels[130:, 120:] == 255).all()  # all of it the last one's, since 2.png may not
    masked = toposeam(*words, "--force", "--mask-for", "1=part.png", "--keep", "1.png=part.png")
    free = toposeam(*words, "--force")
    assert joined_at(masked) == joined_at(free)  # nobody is meant
    assert json.loads(masked.out)["cost"] == json.loads(free.out)["cost"]
    toposeam(*words, "--force", "--mask-for", "4=part.png").fails("use a number from 0 to 3")


@pytest.mark.medium
def test_seams_of_a_picture_that_is_left_out_are_left_out_too(toposeam, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = four(tmp_path, None)
    whole = toposeam("stitch", *names, *AT, "--seam", "seams.svg", "-o", "whole.png")
    assert whole.code == 0, whole
    (tmp_path / names[1]).write_bytes(b"\x89PNG broken")
    words = "stitch", *names, *AT, "--skip-bad", "--json", "--force", "-o", "all.png"
    joined_at(toposeam(*words, "--use-seam", "seams.svg"))
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="250" height="200"><path d="M0 100 H125"/></svg>'
    (tmp_path / "one.svg").write_text(svg, encoding="utf-8")
    ran = toposeam(*words, "--use-seam", "0:2=one.svg", "--use-seam", "1:3=one.svg")
    joined_at(ran)
    given = [seam["between"] for seam in json.loads(ran.out)["seams"] if seam["method"] == "path"]
    assert given == [["0.png", "2.png"]]


def test_an_overlap_of_three_with_a_broken_one_is_still_refused(toposeam, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = four(tmp_path, 1)[:3]
    words = "stitch", *names, "--skip-bad", "-o", "all.png"
    toposeam(*words, "--overlap", "50").fails("--overlap alone is for two pictures")
    toposeam(*words, "--offset", "100,0").fails("--offset is for two pictures")
    toposeam(*words, "--row", "--overlap", "40").fails("2.png at 220,0 lies beside 0.png")
