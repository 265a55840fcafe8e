"""Small files that ask for much: each is refused at once, in a sentence."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import toposeam as ts
from toposeam_cli.files.tables import LARGEST_BYTES, read_table
from toposeam_cli.media.clips.reading import most_loaded
from toposeam_cli.media.pictures.lens import noted
from toposeam_cli.motifs.recipe_files import read_recipe, to_toml
from toposeam_cli.stitching.inputs import canvas_megapixels


@pytest.fixture
def pair(tmp_path):
    rng = np.random.default_rng(1)
    for name in ("a.png", "b.png"):
        Image.fromarray(rng.integers(0, 255, (100, 100, 3), np.uint8)).save(tmp_path / name)
    return tmp_path


def project(folder, count, size=(10000, 10000), projection=0, view=60, step=5.0):
    lines = [f"p f{projection} w{size[0]} h{size[1]} v{view}"]
    lines += [
        f'i w100 h100 f0 v50 r0 p0 y{step * number} n"{"ab"[number % 2]}.png"' for number in range(count)
    ]
    (folder / "p.pto").write_text("\n".join(lines))
    return str(folder / "p.pto")


def joined(toposeam, folder, *words):
    return toposeam("stitch", *words, "-o", str(folder / "out.png"))


def test_the_limit_of_pictures_is_that_of_the_canvas(toposeam, pair):
    ran = joined(toposeam, pair, project(pair, 2), "--max-megapixels", "0.05")
    ran.fails("more than 0.05 megapixels")


def test_a_project_asks_for_no_canvas_beyond_its_pictures(toposeam, pair, monkeypatch):
    monkeypatch.setattr(
        "toposeam_cli.stitching.inputs.read_picture", lambda *_, **__: pytest.fail("was read")
    )
    joined(toposeam, pair, project(pair, 2)).fails(
        "16 megapixels; check where they lie, or allow more with --max-megapixels"
    )


def chain(folder, count, step):
    """Pictures along a diagonal, whose canvas is all but empty."""
    tables = (
        f'[[layer]]\nfile = "{"ab"[n % 2]}.png"\nname = "{n}"\nat = [{step * n}, {step * n}]\n'
        for n in range(count)
    )
    (folder / "chain.toml").write_text("".join(tables))
    return str(folder / "chain.toml")


def test_a_canvas_that_is_all_but_empty_is_allowed_by_name(toposeam, pair):
    sparse = chain(pair, 60, 70)  # 4230 × 4230 px
    joined(toposeam, pair, sparse).fails("span 4230 × 4230 px, more than 16 megapixels")
    assert joined(toposeam, pair, sparse, "--max-megapixels", "18").code == 0


def test_a_canvas_may_be_several_times_its_pictures():
    assert canvas_megapixels(500, 8_000_000) == 128
    assert canvas_megapixels(500, 100) == 16
    assert canvas_megapixels(500, 400_000_000) == 1000
    assert canvas_megapixels(30, 100) == 30


def test_enblend_makes_no_canvas_that_is_all_but_empty(toposeam, tmp_path):
    tifffile = pytest.importorskip("tifffile")
    names = []
    for number in range(60):
        names.append(str(tmp_path / f"{number}.tif"))
        place = [(tag, 5, 1, (70 * number, 1), False) for tag in (286, 287)]
        tifffile.imwrite(
            names[-1],
            np.full((100, 100, 3), number, np.uint8),
            photometric="rgb",
            resolution=(1, 1),
            extratags=place,
        )
    toposeam("enblend", "-o", str(tmp_path / "o.tif"), *names).fails("give the frame, as -f WIDTHxHEIGHT")


def test_a_layout_far_apart_is_refused_before_it_is_read(toposeam, pair, monkeypatch):
    (pair / "far.toml").write_text(
        '[[layer]]\nfile = "a.png"\nat = [0, 0]\n[[layer]]\nfile = "b.png"\nat = [400, 0]\n'
    )
    monkeypatch.setattr(
        "toposeam_cli.stitching.inputs.read_picture", lambda *_, **__: pytest.fail("was read")
    )
    joined(toposeam, pair, str(pair / "far.toml"), "--max-megapixels", "0.04").fails("500 × 100 px")


def test_too_many_pairs_are_refused_before_they_are_read(toposeam, pair, monkeypatch):
    many = project(pair, 1000, (2000, 1000), 2, 360, 0.01)
    monkeypatch.setattr(
        "toposeam_cli.stitching.inputs.read_picture", lambda *_, **__: pytest.fail("was read")
    )
    joined(toposeam, pair, many).fails("1000 layers overlap in 499500 pairs")


@pytest.mark.parametrize("matrix", ["[[1e9, 0, 0], [0, 1e9, 0], [0, 0, 1]]", "[[1e9,0,0],[0,1,0],[0,0,1]]"])
def test_a_matrix_that_magnifies_beyond_measure(toposeam, pair, matrix):
    (pair / "m.toml").write_text(
        f'[[layer]]\nfile = "a.png"\nat = [0, 0]\n[[layer]]\nfile = "b.png"\nmatrix = {matrix}\n'
    )
    joined(toposeam, pair, str(pair / "m.toml")).fails("more than 16 megapixels")


def test_a_table_of_points_has_an_end(toposeam, pair):
    (pair / "p.csv").write_text("a.png,1,2,b.png,3,4\n" * (LARGEST_BYTES // 20 + 1))
    files = (str(pair / "a.png"), str(pair / "b.png"), "--points", str(pair / "p.csv"))
    joined(toposeam, pair, *files).fails("larger than 1 MiB")


@pytest.mark.parametrize(
    "text",
    ["a" + ".a" * 500_000 + " = 1", "[a" + ".a" * 500_000 + "]", "x = {" + '"a" . ' * 100_000 + "a = 1}"],
)
def test_keys_of_toml_that_go_deep(tmp_path, text, monkeypatch):
    (tmp_path / "t.toml").write_text(text)
    monkeypatch.setattr("tomllib.loads", lambda _text: pytest.fail("was parsed"))
    with pytest.raises(Exception, match="nested too deep"):
        read_table(tmp_path / "t.toml", "a layout")


@pytest.mark.parametrize(
    "text",
    [
        'file = "a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s.t.u.v.w.png"',
        "file = 'a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s.t.u.v.w.png'",
        "at = [" + "1.5, " * 100 + "]",
        "a.b.c.d = 1",
    ],
)
def test_what_people_write_is_not_taken_for_a_deep_key(tmp_path, text):
    (tmp_path / "t.toml").write_text(text)
    assert read_table(tmp_path / "t.toml", "a layout")[0]


def test_a_large_picture_in_a_small_file_is_not_decoded(toposeam, pair, monkeypatch):
    Image.fromarray(np.zeros((5000, 5000), np.uint8)).save(pair / "c.jp2")
    assert (pair / "c.jp2").stat().st_size < 90_000
    monkeypatch.setattr(
        "toposeam_cli.media.pictures.pillow_formats._values", lambda _image: pytest.fail("decoded")
    )
    joined(toposeam, pair, str(pair / "a.png"), str(pair / "c.jp2"), "--offset", "50,0").fails(
        "5000 x 5000 pixels, which no photograph needs so few for"
    )


@pytest.fixture
def alike(tmp_path):
    """A GIF of few bytes and 108 megapixels."""
    frames = [Image.new("P", (3000, 3000)) for _ in range(12)]
    for number, frame in enumerate(frames):
        frame.putpixel((number, 0), 1)  # else it is one frame, shown longer
    frames[0].save(tmp_path / "c.gif", save_all=True, append_images=frames[1:])
    assert (tmp_path / "c.gif").stat().st_size < 10_000
    return str(tmp_path / "c.gif")


@pytest.mark.medium
@pytest.mark.parametrize("words", [("loop",), ("stitch", "--offset", "0,2900,0")])
def test_a_small_clip_of_many_pixels_is_not_decoded(toposeam, alike, tmp_path, monkeypatch, words):
    monkeypatch.setattr("PIL.Image.Image.convert", lambda *_, **__: pytest.fail("was decoded"))
    command, *options = words
    files = [alike] * (2 if options else 1)
    ran = toposeam(
        command, *files, *options, "-o", str(tmp_path / "clip.webp" if options else tmp_path / "o.gif")
    )
    ran.fails("12 frames of 3000 × 3000 px, 108 megapixels")


def test_a_large_clip_may_have_many_pixels(tmp_path):
    for name, size in (("small", 10), ("large", 2_000_000), ("huge", 50_000_000)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size)
    sizes = [most_loaded(tmp_path / name, None) / 1e6 for name in ("small", "large", "huge")]
    assert sizes == [100, 200, 500]
    assert most_loaded(tmp_path, None) / 1e6 == 500
    assert most_loaded(tmp_path, 7) == 7


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("m.png --size 8192", "8192 × 8192 elements, more than 5 million"),
        ("m.png --size 64 --max-megapixels 0.001", "64 × 64 elements, more than 0.001 million"),
        ("m.png --size 1024 --style vein --iterations 10000", "10000 iterations of 1024 × 1024 elements"),
        ("m.html --explore 2x2 --size 4000", "4000 × 4000 elements"),
        ("m.stl --depth 128 --iterations 10000", "10000 iterations of 128 × 128"),
    ],
)
def test_a_motif_of_days_and_gigabytes(toposeam, tmp_path, words, text):
    output, *options = words.split()
    ran = toposeam("motif", "-o", str(tmp_path / output), "--layers", "1", *options)
    ran.fails(text)
    ran.fails("or allow more with --max-megapixels")


def test_a_recipe_of_days_in_a_picture(toposeam, tmp_path):
    picture = str(tmp_path / "m.png")
    assert toposeam("motif", "-o", picture, "--size", "16", "--iterations", "2").code == 0
    wild = read_recipe(Path(picture)).to_dict() | {"size": [4096, 4096], "iterations": 9999}
    for layer in wild["layers"]:
        layer.pop("iterations", None)
    (tmp_path / "wild.toml").write_text(to_toml(ts.motif.Recipe.from_dict(wild)))
    toposeam("motif", "-o", str(tmp_path / "n.png"), "--from", str(tmp_path / "wild.toml")).fails(
        "4096 × 4096 elements, more than 5 million"
    )
    with pytest.raises(ts.OptionError, match="iterations of 4096 × 4096") as raised:
        ts.generate_motif(ts.motif.Recipe.from_dict(wild), max_megapixels=17)
    assert raised.value.kind == "too large"
    assert raised.value.data["allowed"] == 101


def test_floats_of_64_bits_are_named(toposeam, pair):
    tifffile = pytest.importorskip("tifffile")
    tifffile.imwrite(pair / "d.tif", np.zeros((40, 40)))
    joined(toposeam, pair, str(pair / "a.png"), str(pair / "d.tif"), "--offset", "20,0").fails(
        "like 64-bit floats; export it again with 32 bits"
    )


def test_a_tag_longer_than_its_file_is_no_warning(tmp_path):
    exif = Image.Exif()
    exif[0x010E] = "x" * 40
    exif.get_ifd(0x8769)[0x920A] = 5.0
    content = exif.tobytes()
    spoilt = content.replace((41).to_bytes(4, "big"), (2**30).to_bytes(4, "big"), 1)
    assert spoilt != content
    Image.new("RGB", (20, 20)).save(tmp_path / "a.jpg", exif=spoilt)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        noted(tmp_path / "a.jpg")
    assert not told
