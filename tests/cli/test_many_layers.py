"""More than two pictures: places, layouts, OpenRaster files, masks and seams of single pairs."""

import io
import json
import zipfile

import numpy as np
import pytest
from PIL import Image
from skimage import data

import toposeam as ts
from toposeam_cli.picture import Picture, read_picture, write_picture

PHOTOGRAPH = data.coffee()[100:, 200:]
PLACES = {"a": (0, 0), "b": (40, 4), "c": (20, 30)}
AT = [word for x, y in PLACES.values() for word in ("--at", f"{x},{y}")]
FILES = ["a.png", "b.png", "c.png"]


def crop(name):
    x, y = PLACES[name]
    noise = np.random.default_rng(ord(name)).integers(-9, 10, (50, 60, 3))
    return np.clip(PHOTOGRAPH[y : y + 50, x : x + 60] + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def three(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in PLACES:
        write_picture(tmp_path / f"{name}.png", Picture(pixels=crop(name)))
    return tmp_path


def shown(path="labels.png"):
    """Which layer shows, by the labels picture of three layers."""
    return np.rint(read_picture(path).pixels / 127.5).astype(int)


def assert_joined(output="out.png", labels="labels.png"):
    """Every pixel is that of the picture the labels name, and none is missing."""
    result, owner = read_picture(output), shown(labels)
    covered = np.zeros(owner.shape, bool)
    for index, (name, (x, y)) in enumerate(PLACES.items()):
        place = np.s_[y : y + 50, x : x + 60]
        covered[place] = True
        mine = (owner[place] == index) & (result.alpha[place] > 0)
        assert mine.any()
        np.testing.assert_array_equal(result.pixels[place][mine], crop(name)[mine])
    np.testing.assert_array_equal(result.alpha > 0, covered)
    return owner


def test_three_pictures_at_given_places(three, toposeam):
    ran = toposeam("stitch", *FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--overlay", "o.png", "--seam", "s.svg")
    assert ran.code == 0, ran
    assert "3 layers, 3 seams" in ran.out
    assert_joined()
    assert set(ts.read_svg("s.svg").names) == {"a.png : b.png", "a.png : c.png", "b.png : c.png"}
    assert read_picture("o.png").pixels.shape == (80, 100, 3)


def test_all_seams_of_a_file_are_applied_again(three, toposeam):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--seam", "s.svg").code == 0
    before = assert_joined()
    assert toposeam("stitch", *FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--use-seam", "s.svg", "--force").code == 0
    assert (before == assert_joined()).mean() > 0.99


@pytest.mark.parametrize("key", ["0:1", "1:0", "a.png:b.png"])
def test_a_seam_for_one_pair(three, toposeam, key):
    (three / "given.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="100" height="80"><path d="M50 0 V80"/></svg>')
    ran = toposeam("stitch", *FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--use-seam", f"{key}=given.svg", "--json")
    assert ran.code == 0, ran
    owner = assert_joined()
    assert (owner[6:29, 41:50] == 0).all()
    assert (owner[6:29, 50:59] == 1).all()
    methods = {tuple(seam["between"]): seam["method"] for seam in json.loads(ran.out)["seams"]}
    assert methods["a.png", "b.png"] == "path"
    assert methods["a.png", "c.png"] == "heat"


def test_masks_by_number_and_by_name(three, toposeam):
    mask = np.zeros((50, 60), np.uint8)
    mask[:, 30:] = 255
    write_picture(three / "right.png", Picture(pixels=mask))
    keep = np.zeros((50, 60), np.uint8)
    keep[5:15, 45:58] = 255
    write_picture(three / "keep.png", Picture(pixels=keep))
    line = [*FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--mask-for", "c.png=right.png", "--keep", "0=keep.png"]
    assert toposeam("stitch", *line).code == 0
    owner = shown()
    assert not (owner[30:, :50] == 2).any()
    assert (owner[5:15, 45:58] == 0).all()


def test_alignment_says_what_it_did(three, toposeam):
    line = [
        *FILES,
        "--at",
        "0,0",
        "--at",
        "43,1",
        "--at",
        "18,32",
        "--align",
        "--align-radius",
        "8",
        "-o",
        "out.png",
        "--labels",
        "labels.png",
    ]
    ran = toposeam("stitch", *line)
    assert ran.code == 0, ran
    assert "b.png: at 40,4, moved by -3,3" in ran.out
    assert "c.png: at 20,30, moved by 2,-2" in ran.out
    assert_joined()
    places = json.loads(toposeam("stitch", *line, "--force", "--json").out)["layers"]
    assert [place["at"] for place in places] == [[0, 0], [40, 4], [20, 30]]
    assert places[1]["moved"] == [-3, 3]


@pytest.mark.parametrize("blend", ts.BLENDS)
def test_every_blend(three, toposeam, blend):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.png", "--blend", blend, "--match-tones").code == 0
    hard = toposeam("stitch", *FILES, *AT, "-o", "hard.png", "--match-tones")
    assert hard.code == 0
    difference = np.abs(read_picture("out.png").pixels.astype(int) - read_picture("hard.png").pixels)
    assert difference.any() == (blend != "none")
    assert difference.mean() < 3


def test_mixed_depths_and_gray_become_one(three, toposeam):
    write_picture(three / "b.tif", Picture(pixels=crop("b").astype(np.uint16) * 257))
    write_picture(three / "c.png", Picture(pixels=crop("c")[..., 1]), force=True)
    assert toposeam("stitch", "a.png", "b.tif", "c.png", *AT, "-o", "out.tif", "--labels", "labels.png").code == 0
    result = read_picture("out.tif")
    assert result.pixels.dtype == np.uint16
    assert result.pixels.shape == (80, 100, 3)
    place = np.s_[4:54, 40:100]
    mine = shown()[place] == 1
    np.testing.assert_array_equal(result.pixels[place][mine], crop("b")[mine].astype(np.uint16) * 257)


# Layouts

LAYOUT = """
[[layer]]
file = "a.png"
at = [0, 0]

[[layer]]
file = "b.png"
at = [40, 4]
name = "the second"
mask = "m.png"

[[layer]]
file = "a.png"
name = "hidden"
at = [999, 0]
visible = false

[[layer]]
file = "c.png"
at = [20, 30]
"""


def test_a_layout_in_toml_and_in_json(three, toposeam):
    (three / "sub").mkdir()
    for name in FILES:
        (three / name).rename(three / "sub" / name)
    write_picture(three / "sub" / "m.png", Picture(pixels=np.full((50, 60), 255, np.uint8)))
    (three / "sub" / "l.toml").write_text(LAYOUT)
    layers = [{"file": f"{name}.png", "at": list(at)} for name, at in PLACES.items()]
    (three / "sub" / "l.json").write_text(json.dumps({"layer": layers}))
    for kind in ("toml", "json"):
        assert toposeam("stitch", f"sub/l.{kind}", "-o", f"{kind}.png", "--labels", "labels.png", "--force").code == 0
        assert_joined(f"{kind}.png")
    assert (three / "toml.png").read_bytes() == (three / "json.png").read_bytes()


LAYOUTS = {
    "syntax": ("[[layer]\n", "is not TOML: "),
    "empty": ("", "it has none"),
    "surplus": ("colour = 3\n[[layer]]\nfile='a.png'\nat=[0,0]", "it has colour"),
    "one": ("[[layer]]\nfile='a.png'\nat=[0,0]", "needs at least two"),
    "no place": ("[[layer]]\nfile='a.png'", "layer 1 has no at"),
    "no file": ("[[layer]]\nat=[0,0]", "layer 1 has no file"),
    "half a place": ("[[layer]]\nfile='a.png'\nat=[0]", "two whole numbers"),
    "fractions": ("[[layer]]\nfile='a.png'\nat=[0.5,1]", "two whole numbers"),
    "far": ("[[layer]]\nfile='a.png'\nat=[0,99999999999]", "two whole numbers"),
    "misspelt": ("[[layer]]\nfile='a.png'\nposition=[0,0]", "'position', which is none of file, at"),
    "visible": ("[[layer]]\nfile='a.png'\nat=[0,0]\nvisible='no'", "write true or false"),
    "name": ("[[layer]]\nfile='a.png'\nat=[0,0]\nname=3", "write a text"),
    "twice": ("[[layer]]\nfile='a.png'\nat=[0,0]\n[[layer]]\nfile='a.png'\nat=[9,0]", "give each a name of its own"),
    "missing": ("[[layer]]\nfile='a.png'\nat=[0,0]\n[[layer]]\nfile='z.png'\nat=[9,0]", "there is no file"),
}


@pytest.mark.parametrize(("text", "phrase"), LAYOUTS.values(), ids=LAYOUTS)
def test_a_layout_that_makes_no_sense(three, toposeam, text, phrase):
    (three / "l.toml").write_text(text)
    toposeam("stitch", "l.toml", "-o", "out.png").fails(phrase)
    assert not (three / "out.png").exists()


def test_a_layout_leaves_no_room_for_places(three, toposeam):
    (three / "l.toml").write_text(LAYOUT)
    toposeam("stitch", "l.toml", "--at", "0,0", "-o", "out.png").fails("says itself where its pictures lie")
    (three / "l.json").write_text('{"layer": [')
    toposeam("stitch", "l.json", "-o", "out.png").fails("is not JSON")
    (three / "l.toml").write_bytes(b"\n\xff")
    toposeam("stitch", "l.toml", "-o", "out.png").fails("is not UTF-8 (at line 2)")
    toposeam("stitch", "none.toml", "-o", "out.png").fails("there is no file")


# OpenRaster


def png(pixels):
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def opened(archive, name):
    return np.array(Image.open(io.BytesIO(archive.read(name))))


STACK = """<?xml version='1.0' encoding='UTF-8'?>
<image w="100" h="80"><stack>
  <layer name="c.png" src="data/c.png" x="20" y="30"/>
  <stack name="group" opacity="1.0">
    <layer name="b.png" src="data/b.png" x="40" y="4" visibility="visible" composite-op="svg:src-over"/>
    <layer name="lost" src="data/nothing.png" visibility="hidden"/>
  </stack>
  <stack visibility="hidden"><layer name="lost too" src="data/nothing.png"/></stack>
  <layer name="a.png" src="data/a.png" x="0" y="0"/>
</stack></image>"""


def make_ora(path, stack=STACK, compression=zipfile.ZIP_STORED, **entries):
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("mimetype", "image/openraster", zipfile.ZIP_STORED)
        if stack is not None:
            archive.writestr("stack.xml", stack)
        for name in PLACES:
            archive.writestr(f"data/{name}.png", entries.get(name, png(crop(name))))
    return path


def test_an_openraster_file_of_another_program(three, toposeam):
    make_ora("in.ora")
    assert toposeam("stitch", "in.ora", "-o", "out.png", "--labels", "labels.png").code == 0
    assert_joined()
    assert toposeam("stitch", *FILES, *AT, "-o", "same.png").code == 0
    assert (three / "out.png").read_bytes() == (three / "same.png").read_bytes()


def test_a_file_of_our_own_is_stitched_again_from_its_originals(three, toposeam):
    assert toposeam("stitch", *FILES, *AT, "-o", "own.ora").code == 0
    assert toposeam("stitch", *FILES, *AT, "-o", "same.png").code == 0
    toposeam("stitch", "own.ora", "-o", "out.png").fails("show its group originals")
    with zipfile.ZipFile("own.ora") as own, zipfile.ZipFile("shown.ora", "w") as shown_again:
        for name in own.namelist():
            content = own.read(name)
            if name == "stack.xml":
                cut, group, originals = content.partition(b'<stack name="originals"')
                content = cut.replace(b'"visible"', b'"hidden"') + group + originals.replace(b'"hidden"', b'"visible"', 1)
            shown_again.writestr(name, content)
    assert toposeam("stitch", "shown.ora", "-o", "out.png").code == 0
    np.testing.assert_array_equal(read_picture("out.png").pixels, read_picture("same.png").pixels)


def test_opacity_of_layers_and_groups(three, toposeam):
    make_ora(
        "in.ora",
        STACK.replace('name="group" opacity="1.0"', 'name="group" opacity="0.5"').replace('name="b.png"', 'name="b.png" opacity="0.5"'),
    )
    assert toposeam("stitch", "in.ora", "-o", "out.png").code == 0
    alpha = read_picture("out.png").alpha
    assert set(np.unique(alpha)) == {0, 63, 255}


def test_an_openraster_file_keeps_the_layers_and_loses_nothing(three, toposeam):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.ora", "--labels", "labels.png").code == 0
    assert toposeam("stitch", *FILES, *AT, "-o", "flat.png").code == 0
    flat, owner = read_picture("flat.png"), shown()
    with zipfile.ZipFile("out.ora") as archive:
        first = archive.infolist()[0]
        assert (first.filename, first.compress_type, archive.read(first)) == ("mimetype", zipfile.ZIP_STORED, b"image/openraster")
        merged = opened(archive, "mergedimage.png")
        np.testing.assert_array_equal(merged[..., :3], flat.pixels)
        np.testing.assert_array_equal(merged[..., 3], flat.alpha)
        assert opened(archive, "Thumbnails/thumbnail.png").shape == (80, 100, 4)
        for index, (name, (x, y)) in enumerate(PLACES.items()):
            layer = opened(archive, f"data/{index:03d}-shown.png")
            np.testing.assert_array_equal(layer[..., :3], crop(name))  # under the transparency too
            np.testing.assert_array_equal(layer[..., 3] > 0, owner[y : y + 50, x : x + 60] == index)
            np.testing.assert_array_equal(opened(archive, f"data/{index:03d}.png"), crop(name))
    first = (three / "out.ora").read_bytes()
    assert toposeam("stitch", *FILES, *AT, "-o", "out.ora", "--force").code == 0
    assert (three / "out.ora").read_bytes() == first
    toposeam("stitch", *FILES, *AT, "-o", "out.ora").fails("pass --force")


def test_layers_of_blended_pictures_add_up_to_the_composite(three, toposeam):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.ora", "--blend", "multiband", "--match-tones").code == 0
    with zipfile.ZipFile("out.ora") as archive:
        merged = opened(archive, "mergedimage.png")
        total = np.zeros_like(merged)
        for index, (x, y) in enumerate(PLACES.values()):
            layer = opened(archive, f"data/{index:03d}-shown.png")
            place = total[y : y + 50, x : x + 60]
            place[layer[..., 3] > 0] = layer[layer[..., 3] > 0]
        np.testing.assert_array_equal(total[merged[..., 3] > 0], merged[merged[..., 3] > 0])


def bomb():
    """A PNG of 400 megapixels in 400 kB."""
    buffer = io.BytesIO()
    Image.new("1", (20000, 20000)).save(buffer, "PNG")
    return buffer.getvalue()


HOSTILE = {
    "no zip": (lambda path: path.write_text("PK"), "is no OpenRaster file"),
    "cut": (lambda path: path.write_bytes(make_ora(path).read_bytes()[:4000]), "is no OpenRaster file"),
    "no stack": (lambda path: make_ora(path, None), "has no stack.xml"),
    "broken xml": (lambda path: make_ora(path, "<image><stack>"), "is not XML"),
    "other xml": (lambda path: make_ora(path, "<svg/>"), "holds no <image>"),
    "entities": (lambda path: make_ora(path, '<!DOCTYPE image [<!ENTITY a "b">]>' + STACK.partition("?>")[2]), "declares a DTD"),
    "outside": (lambda path: make_ora(path, STACK.replace("data/c.png", "../../etc/passwd")), "outside of the file"),
    "absolute": (lambda path: make_ora(path, STACK.replace("data/c.png", "/etc/passwd")), "outside of the file"),
    "missing entry": (lambda path: make_ora(path, STACK.replace("data/c.png", "data/d.png")), "is missing from the file"),
    "nothing visible": (lambda path: make_ora(path, '<image w="1" h="1"><stack/></image>'), "has no visible layer"),
    "one visible": (lambda path: make_ora(path, '<image><stack><layer src="data/a.png"/></stack></image>'), "needs at least two"),
    "blend mode": (lambda path: make_ora(path, STACK.replace("svg:src-over", "svg:multiply")), "set it to Normal"),
    "place": (lambda path: make_ora(path, STACK.replace('x="20"', 'x="inf"')), "no usable number"),
    "deep": (lambda path: make_ora(path, "<image><stack>" + "<stack>" * 200 + "</stack>" * 200 + "</stack></image>"), "groups more than"),
    "text as png": (lambda path: make_ora(path, c=b"I am a picture"), "in.ora': c.png"),
    "picture bomb": (lambda path: make_ora(path, c=bomb()), "megapixels allowed"),
    "zip bomb": (lambda path: make_ora(path, c=bytes(50_000_000), compression=zipfile.ZIP_DEFLATED), "would unpack to|unpacks to"),
    "stack bomb": (lambda path: make_ora(path, STACK + " " * 40_000_000, compression=zipfile.ZIP_DEFLATED), "would unpack to"),
}


@pytest.mark.parametrize(("make", "phrase"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_openraster_file_is_refused(three, toposeam, make, phrase):
    make(three / "in.ora")
    before = sorted(path.name for path in three.iterdir())
    ran = toposeam("stitch", "in.ora", "-o", "out.png", "--max-megapixels", "2")
    assert any(part in ran.err for part in phrase.split("|")), ran
    ran.fails("")
    assert sorted(path.name for path in three.iterdir()) == before


def test_an_openraster_file_stands_alone(three, toposeam):
    make_ora("in.ora")
    toposeam("stitch", "in.ora", "a.png", "--offset", "0,0", "-o", "out.png").fails("give it alone")
    toposeam("stitch", "in.ora", "--overlap", "9", "-o", "out.png").fails("leave --at, --offset and --overlap out")
    toposeam("stitch", "none.ora", "-o", "out.png").fails("there is no file")


def test_a_later_output_that_fails_takes_the_earlier_ones_back(three, toposeam, monkeypatch):
    from toposeam_cli import stitch as module

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "atomic_write", fail)
    before = sorted(path.name for path in three.iterdir())
    toposeam("stitch", *FILES, *AT, "-o", "out.png", "--seam", "s.svg").fails("free some space")
    assert sorted(path.name for path in three.iterdir()) == before
