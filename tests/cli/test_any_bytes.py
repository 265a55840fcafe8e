"""Files of any bytes, and any command line."""

import tempfile
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from any_input import Expected, names, quick, run, thorough
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from toposeam_cli.app.main import main
from toposeam_cli.media.pictures.picture import Picture, match_pictures, read_picture, write_picture


def encoded(suffix):
    """A small valid file."""
    rng = np.random.default_rng(1)
    image = Image.fromarray(rng.integers(0, 256, (8, 9, 3), np.uint8))
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        options = {"compression": "tiff_lzw"} if suffix == ".tif" else {}
        (image.quantize(16) if suffix == ".gif" else image).save(file.name, **options)
        return Path(file.name).read_bytes()


FILES = {suffix: encoded(suffix) for suffix in (".png", ".jpg", ".tif", ".gif", ".webp")}


SVG = """<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="15" height="8" viewBox="0 0 15 8">
  <metadata id="toposeam">{"side": "right", "core": 0.5}</metadata>
  <g transform="translate(1 0) scale(1, 1)" style="fill:none">
    <path id="seam 1" d="M7,0 L7,3 C8,4 6 5 7,6 A1 1 0 0 1 7.5 7 V8"><title>seam &amp; 1</title></path>
    <polyline points="2,2 3,3"/><circle cx="3" cy="4" r=".2mm"/>
  </g>
</svg>"""


@st.composite
def damaged(draw, whole):
    """A file with some bytes changed, left out, repeated or added."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(data)))
        kind = draw(st.sampled_from(["change", "change", "flip", "cut", "insert", "repeat", "remove"]))
        if kind == "change":
            data[place : place + 1] = draw(st.binary(min_size=1, max_size=1))
        elif kind == "flip" and place < len(data):
            data[place] ^= 1 << draw(st.integers(0, 7))
        elif kind == "cut":
            del data[place:]
        elif kind == "insert":
            data[place:place] = draw(st.binary(max_size=12))
        elif kind == "repeat":
            data[place:place] = data[max(0, place - draw(st.integers(1, 60))) : place]
        else:
            del data[place : place + draw(st.integers(1, 40))]
    return bytes(data)


def check_file(data):
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "any.png").write_bytes(data)
        write_picture(f"{folder}/b.png", Picture(pixels=np.arange(192, dtype=np.uint8).reshape(8, 8, 3)))
        ran = run(
            folder,
            "stitch",
            "any.png",
            "b.png",
            "--overlap=3",
            "--max-megapixels=1",
            "-o",
            "out.tif",
            "--labels",
            "labels.png",
        )
        if ran.code:
            assert names(folder) == {"any.png", "b.png"}
            return
        a, b = match_pictures([read_picture(f"{folder}/any.png"), read_picture(f"{folder}/b.png")])
        b_shows = read_picture(f"{folder}/labels.png").pixels > 0
        Expected(a, b, a.pixels.shape[1] - 3, 0).check(read_picture(f"{folder}/out.tif"), b_shows)


any_file = st.one_of(
    st.sampled_from(sorted(FILES)).flatmap(lambda suffix: damaged(FILES[suffix])), st.binary(max_size=300)
)


text_of_svg = st.text("MLCZAzml0123456789.,-+eE \n\"'<>/&;#=gpathsvdx()%é☃\0", max_size=120)


any_drawing = st.one_of(
    damaged(SVG.encode()),
    st.binary(max_size=200),
    text_of_svg.map(str.encode),
    text_of_svg.map(lambda data: SVG.replace("M7,0 L7,3", data).encode()),
    text_of_svg.map(lambda data: SVG.replace("translate(1 0)", data).encode()),
    text_of_svg.map(lambda data: SVG.replace("0 0 15 8", data).encode()),
)


def check_drawing(data):
    with tempfile.TemporaryDirectory() as folder:
        pixels = np.random.default_rng(0).integers(0, 256, (8, 9, 3), np.uint8)
        a, b = Picture(pixels=pixels), Picture(pixels=pixels[:, ::-1].copy())
        for name, picture in (("a.png", a), ("b.png", b)):
            write_picture(f"{folder}/{name}", picture)
        Path(folder, "any.svg").write_bytes(data)
        ran = run(
            folder,
            "stitch",
            "a.png",
            "b.png",
            "--overlap=3",
            "--use-seam",
            "any.svg",
            "-o",
            "out.png",
            "--labels",
            "labels.png",
        )
        if ran.code:
            assert names(folder) == {"a.png", "any.svg", "b.png"}
            return
        Expected(a, b, 6, 0).check(
            read_picture(f"{folder}/out.png"), read_picture(f"{folder}/labels.png").pixels > 0
        )


@pytest.mark.medium
@quick
@given(data=any_file)
def test_any_bytes_as_a_picture(data):
    check_file(data)


@pytest.mark.slow
@thorough
@given(data=any_file)
def test_many_bytes_as_a_picture(data):
    check_file(data)


@pytest.mark.medium
@quick
@given(data=any_drawing)
def test_any_bytes_as_a_seam(data):
    check_drawing(data)


@pytest.mark.slow
@thorough
@given(data=any_drawing)
def test_many_bytes_as_a_seam(data):
    check_drawing(data)


def test_the_undamaged_files_are_good():
    for data in FILES.values():
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "any.png").write_bytes(data)
            assert run(folder, "stitch", "any.png", "any.png", "--overlap=3", "-o", "out.tif").code == 0
    with tempfile.TemporaryDirectory() as folder:
        for name in ("a.png", "b.png"):
            Path(folder, name).write_bytes(FILES[".png"])
        Path(folder, "any.svg").write_text(SVG)
        assert (
            run(
                folder, "stitch", "a.png", "b.png", "--overlap=3", "--use-seam", "any.svg", "-o", "out.png"
            ).code
            == 0
        )


@quick
@given(
    words=st.lists(
        st.one_of(
            st.sampled_from(
                [
                    "a.png",
                    "b.png",
                    "-o",
                    "out.png",
                    "--overlap",
                    "--offset",
                    "--side",
                    "left",
                    "--method",
                    "dp",
                    "--core",
                    "--json",
                    "-q",
                    "--force",
                ]
            ),
            st.sampled_from(
                [
                    "3",
                    "3,0",
                    "50%",
                    "1e9",
                    "-1",
                    "nan",
                    "inf",
                    "",
                    " ",
                    "--",
                    "-",
                    "--avoid",
                    "--use-seam",
                    "--labels",
                    "--seam",
                ]
            ),
            st.text("0123456789.,-+%e ٣é\n\x1b", max_size=8),
        ),
        max_size=9,
    )
)
def test_any_command_line(words):
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for name in ("a.png", "b.png"):
            Path(name).write_bytes(FILES[".png"])
        result = CliRunner().invoke(main, ["stitch", "a.png", "b.png", *words])
        assert "something went wrong" not in result.stderr, (result.stderr, words)
        assert "Traceback" not in result.stderr
        assert result.exc_info is None or result.exc_info[0] is SystemExit, (result, words)
        if result.exit_code:
            assert names(".") == {"a.png", "b.png"}
