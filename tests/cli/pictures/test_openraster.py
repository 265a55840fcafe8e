"""OpenRaster files, in and out, and hostile ones."""

import io
import tempfile
import zipfile

import numpy as np
import pytest
from PIL import Image
from three_pictures import AT, FILES, PLACES, assert_joined, crop, shown

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.openraster import read_ora
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


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
                content = (
                    cut.replace(b'"visible"', b'"hidden"')
                    + group
                    + originals.replace(b'"hidden"', b'"visible"', 1)
                )
            shown_again.writestr(name, content)
    assert toposeam("stitch", "shown.ora", "-o", "out.png").code == 0
    np.testing.assert_array_equal(read_picture("out.png").pixels, read_picture("same.png").pixels)


def test_opacity_of_layers_and_groups(three, toposeam):
    make_ora(
        "in.ora",
        STACK.replace('name="group" opacity="1.0"', 'name="group" opacity="0.5"').replace(
            'name="b.png"', 'name="b.png" opacity="0.5"'
        ),
    )
    assert toposeam("stitch", "in.ora", "-o", "out.png").code == 0
    alpha = read_picture("out.png").alpha
    assert set(np.unique(alpha)) == {0, 63, 255}


def test_what_says_no_opacity_has_that_of_its_group(three):
    make_ora("in.ora", STACK.replace('name="group" opacity="1.0"', 'name="group" opacity="0.5"'))
    layers = {layer.name: layer.picture for layer in read_ora(three / "in.ora", 10**6)}
    np.testing.assert_array_equal(layers["b.png"].alpha, 127)
    assert layers["c.png"].alpha is None or (layers["c.png"].alpha == 255).all()


def test_a_pixel_of_least_opacity_is_still_a_pixel(three, toposeam):
    make_ora("in.ora", STACK.replace('name="b.png"', 'name="b.png" opacity="0.001"'))
    layers = {layer.name: layer.picture for layer in read_ora(three / "in.ora", 10**6)}
    np.testing.assert_array_equal(layers["b.png"].alpha, 1)


def test_what_is_transparent_stays_so_at_any_opacity(three):
    pixels = np.dstack([crop("b"), np.full(crop("b").shape[:2], 200, np.uint8)])
    pixels[:5, :, 3] = 0
    make_ora("in.ora", STACK.replace('name="b.png"', 'name="b.png" opacity="0.5"'), b=png(pixels))
    layers = {layer.name: layer.picture for layer in read_ora(three / "in.ora", 10**6)}
    assert (layers["b.png"].alpha[:5] == 0).all()
    assert (layers["b.png"].alpha[5:] == 100).all()


def test_an_openraster_file_keeps_the_layers_and_loses_nothing(three, toposeam):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.ora", "--labels", "labels.png").code == 0
    assert toposeam("stitch", *FILES, *AT, "-o", "flat.png").code == 0
    flat, label_map = read_picture("flat.png"), shown()
    with zipfile.ZipFile("out.ora") as archive:
        first = archive.infolist()[0]
        assert (first.filename, first.compress_type, archive.read(first)) == (
            "mimetype",
            zipfile.ZIP_STORED,
            b"image/openraster",
        )
        merged = opened(archive, "mergedimage.png")
        np.testing.assert_array_equal(merged[..., :3], flat.pixels)
        np.testing.assert_array_equal(merged[..., 3], flat.alpha)
        assert opened(archive, "Thumbnails/thumbnail.png").shape == (80, 100, 4)
        for index, (name, (x, y)) in enumerate(PLACES.items()):
            layer = opened(archive, f"data/{index:03d}-shown.png")
            np.testing.assert_array_equal(layer[..., :3], crop(name))  # under the transparency too
            np.testing.assert_array_equal(layer[..., 3] > 0, label_map[y : y + 50, x : x + 60] == index)
            np.testing.assert_array_equal(opened(archive, f"data/{index:03d}.png"), crop(name))
    first = (three / "out.ora").read_bytes()
    assert toposeam("stitch", *FILES, *AT, "-o", "out.ora", "--force").code == 0
    assert (three / "out.ora").read_bytes() == first
    toposeam("stitch", *FILES, *AT, "-o", "out.ora").fails("pass --force")


@pytest.mark.parametrize(("width", "shown_width"), [(256, 256), (257, 129)])
def test_a_thumbnail_has_at_most_256_pixels_a_side(three, toposeam, width, shown_width):
    words = *FILES[:2], "--at", "0,0", "--at", f"{width - 60},0"
    for name, size in (("a", width - 40), ("b", 60)):
        write_picture(three / f"{name}.png", Picture(pixels=np.full((20, size, 3), 90, np.uint8)), force=True)
    assert toposeam("stitch", *words, "-o", "out.ora").code == 0
    with zipfile.ZipFile("out.ora") as archive:
        assert opened(archive, "mergedimage.png").shape[1] == width
        assert opened(archive, "Thumbnails/thumbnail.png").shape[1] == shown_width


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
    "entities": (
        lambda path: make_ora(path, '<!DOCTYPE image [<!ENTITY a "b">]>' + STACK.partition("?>")[2]),
        "declares a DTD",
    ),
    "outside": (
        lambda path: make_ora(path, STACK.replace("data/c.png", "../../etc/passwd")),
        "outside of the file",
    ),
    "absolute": (
        lambda path: make_ora(path, STACK.replace("data/c.png", "/etc/passwd")),
        "outside of the file",
    ),
    "missing entry": (
        lambda path: make_ora(path, STACK.replace("data/c.png", "data/d.png")),
        "is missing from the file",
    ),
    "nothing visible": (
        lambda path: make_ora(path, '<image w="1" h="1"><stack/></image>'),
        "has no visible layer",
    ),
    "one visible": (
        lambda path: make_ora(path, '<image><stack><layer src="data/a.png"/></stack></image>'),
        "needs at least two",
    ),
    "blend mode": (
        lambda path: make_ora(path, STACK.replace("svg:src-over", "svg:multiply")),
        "set it to Normal",
    ),
    "place": (lambda path: make_ora(path, STACK.replace('x="20"', 'x="inf"')), "no usable number"),
    "deep": (
        lambda path: make_ora(
            path, "<image><stack>" + "<stack>" * 200 + "</stack>" * 200 + "</stack></image>"
        ),
        "groups more than",
    ),
    "text as png": (lambda path: make_ora(path, c=b"I am a picture"), "in.ora': c.png"),
    "picture bomb": (lambda path: make_ora(path, c=bomb()), "raise --max-megapixels"),
    "zip bomb": (
        lambda path: make_ora(path, c=bytes(50_000_000), compression=zipfile.ZIP_DEFLATED),
        "would unpack to|unpacks to",
    ),
    "stack bomb": (
        lambda path: make_ora(path, STACK + " " * 40_000_000, compression=zipfile.ZIP_DEFLATED),
        "would unpack to",
    ),
}


@pytest.mark.medium
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
    toposeam("stitch", "in.ora", "--overlap", "9", "-o", "out.png").fails(
        "leave --at, --offset and --overlap out"
    )
    toposeam("stitch", "none.ora", "-o", "out.png").fails("there is no file")


def test_a_later_output_that_fails_takes_the_earlier_ones_back(three, toposeam, monkeypatch):
    from toposeam_cli.stitching import rendering as module

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "atomic_write", fail)
    before = sorted(path.name for path in three.iterdir())
    toposeam("stitch", *FILES, *AT, "-o", "out.png", "--seam", "s.svg").fails("free some space")
    assert sorted(path.name for path in three.iterdir()) == before


def test_a_layer_unpacks_to_what_its_header_says(tmp_path):
    """Whatever --max-megapixels allows."""
    small = io.BytesIO()
    Image.new("RGB", (60, 50)).save(small, "PNG")
    path = make_ora(
        tmp_path / "in.ora", c=small.getvalue() + bytes(40_000_000), compression=zipfile.ZIP_DEFLATED
    )
    with pytest.raises(ImageError, match="would unpack to"):
        read_ora(path, 500_000_000)


def test_what_a_killed_command_unpacked_is_removed(three, monkeypatch):
    shared = three / "tmp"
    shared.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(shared))
    left = shared / f".toposeam-{'0' * 16}.part"
    left.mkdir()
    (left / "layer.png").write_bytes(b"half")
    monkeypatch.setattr("toposeam_cli.files.temporary._tidied", set())
    assert len(read_ora(make_ora(three / "in.ora"), 10**6)) > 1
    assert not list(shared.iterdir())


def test_more_layers_than_can_be_joined_are_refused_at_once(three, toposeam):
    """Each lies on all others: half a million pairs."""
    small = io.BytesIO()
    Image.new("RGB", (8, 8)).save(small, "PNG")
    layers = "".join(f'<layer name="{n}" src="data/c.png" x="{n % 3}" y="0"/>' for n in range(1000))
    make_ora("in.ora", f'<image w="20" h="20"><stack>{layers}</stack></image>', c=small.getvalue())
    ran = toposeam("stitch", "in.ora", "-o", "out.png")
    ran.fails("of 1000 layers overlap in")
