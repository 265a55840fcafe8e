"""Whatever comes in, either a complete and correct picture comes out or one sentence that says what to do."""

import json
import re
import tempfile
from contextlib import chdir
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

import toposeam as ts
from toposeam_cli.main import main
from toposeam_cli.picture import Picture, match_pictures, read_picture, write_picture

FULL = {"uint8": 255, "uint16": 65535, "float32": 1.0}
METHODS = [method for method in ts.METHODS if method != "thesis"]  # the thesis's own takes a second each time

quick = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True)
thorough = settings(max_examples=600, deadline=None, suppress_health_check=list(HealthCheck))


@dataclass(frozen=True)
class Ran:
    code: int
    out: str
    err: str


def run(folder, *arguments):
    """Run the command on files in a folder; anything but success or one sentence fails the test."""
    result = CliRunner().invoke(main, [word if word.startswith("-") or "." not in word else f"{folder}/{word}" for word in arguments])
    ran = Ran(result.exit_code, result.stdout, result.stderr)
    assert result.exc_info[0] is SystemExit, result
    assert "something went wrong" not in ran.err, (ran, arguments)
    if ran.code == 0:
        assert ran.err == "", ran
    else:
        assert re.fullmatch(r"(Usage: .*\n(Try .*\n)?\n)?Error: .{10,}\n", ran.err), (ran, arguments)
        assert ran.out == "", ran
    return ran


def names(folder):
    return {path.name for path in Path(folder).iterdir()}


# Pictures and placements


@st.composite
def pictures(draw, most=40, least=1):
    """A small picture of any depth, with alpha of any kind."""
    height, width = draw(st.integers(least, most)), draw(st.integers(least, most))
    depth = draw(st.sampled_from(sorted(FULL)))
    n_channels = draw(st.sampled_from([1, 3]))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    shape = (height, width) if n_channels == 1 else (height, width, n_channels)
    look = draw(st.sampled_from(["noise", "noise", "flat", "black and white", "ramp"]))
    if look == "noise":
        values = rng.random(shape)
    elif look == "flat":
        values = np.full(shape, rng.random())
    elif look == "black and white":
        values = rng.integers(0, 2, shape).astype(float)
    else:
        values = np.zeros(shape) + np.linspace(0, 1, width).reshape((1, -1) + (1,) * (n_channels == 3))
    opacity = alphas(rng, draw(st.sampled_from([*["none"] * 6, "full", "soft", "holes", "disc", "half", "clear", "dot"])), height, width)
    scale, dtype = FULL[depth], np.dtype(depth)

    def stored(array):
        return array.astype(dtype) if depth == "float32" else np.rint(array * scale).astype(dtype)

    return Picture(pixels=stored(values), alpha=None if opacity is None else stored(opacity))


def alphas(rng, kind, height, width):
    y, x = np.mgrid[:height, :width]
    return {
        "none": None,
        "full": np.ones((height, width)),
        "soft": rng.random((height, width)),
        "holes": (rng.random((height, width)) < 0.7).astype(float),
        "disc": (np.hypot(y - height / 2, x - width / 2) < min(height, width) / 2).astype(float),
        "half": (x < width / 2).astype(float),
        "clear": np.zeros((height, width)),
        "dot": ((y == height // 2) & (x == width // 2)).astype(float),
    }[kind]


@st.composite
def pairs(draw, least=1):
    """Two pictures with --offset or --overlap, which most of the time make them overlap."""
    a, b = draw(pictures(least=least)), draw(pictures(least=least))
    size_a, size_b = a.pixels.shape[1::-1], b.pixels.shape[1::-1]
    astray = draw(st.integers(0, 7)) == 0
    if draw(st.booleans()):
        x, y = (draw(st.integers(-60, 60) if astray else st.integers(1 - m, n - 1)) for n, m in zip(size_a, size_b, strict=True))
        return a, b, [f"--offset={x},{y}"]
    side = draw(st.sampled_from(ts.SIDES))
    axis = 0 if side in ("left", "right") else 1
    longest = min(size_a[axis], size_b[axis])
    lengths = st.integers(0, 60).map(str) if astray else st.integers(1, longest).map(str)
    shares = st.integers(1, 100 if astray else max(1, 100 * longest // size_a[axis])).map("{}%".format)
    return a, b, [f"--overlap={draw(lengths | shares)}", f"--side={side}"]


@st.composite
def choices(draw):
    """The options that decide how the seam is found."""
    chosen = [f"--method={draw(st.sampled_from([*METHODS, 'heat', 'heat']))}"]
    if draw(st.booleans()):
        chosen.append("--no-gradient")
    if draw(st.integers(0, 3)) == 0:
        chosen.append(f"--core={draw(st.floats(0.01, 1)):.3f}")
    return chosen


@dataclass
class Expected:
    """Two pictures on their canvas, worked out the plain way."""

    a: Picture
    b: Picture
    x: int
    y: int
    shape: tuple[int, int] = field(init=False)

    def __post_init__(self):
        heights, widths = (self.a.pixels.shape[i] for i in (0, 1)), (self.b.pixels.shape[i] for i in (0, 1))
        (ha, wa), (hb, wb) = tuple(heights), tuple(widths)
        self.left, self.top = min(0, self.x), min(0, self.y)
        self.shape = (max(ha, self.y + hb) - self.top, max(wa, self.x + wb) - self.left)

    def placed(self, picture, x, y):
        """Colour and opacity of one picture on the canvas, 0 where it has no pixels."""
        height, width = picture.pixels.shape[:2]
        place = np.s_[y - self.top : y - self.top + height, x - self.left : x - self.left + width]
        dtype = picture.pixels.dtype
        opacity = np.zeros(self.shape, dtype)
        opacity[place] = FULL[dtype.name] if picture.alpha is None else picture.alpha
        colour = np.zeros((*self.shape, *picture.pixels.shape[2:]), dtype)
        colour[place] = picture.pixels
        colour[opacity == 0] = 0
        return colour, opacity

    def check(self, result, b_shows):
        """The result shows A or B at every pixel, as the labels say, and every pixel that one of them covers."""
        (colour_a, alpha_a), (colour_b, alpha_b) = self.placed(self.a, 0, 0), self.placed(self.b, self.x, self.y)
        assert result.pixels.shape[:2] == self.shape
        assert result.pixels.dtype == self.a.pixels.dtype
        opacity = np.full(self.shape, FULL[alpha_a.dtype.name], alpha_a.dtype) if result.alpha is None else result.alpha
        np.testing.assert_array_equal(opacity > 0, (alpha_a > 0) | (alpha_b > 0))
        assert not (b_shows & (alpha_b == 0)).any()
        assert not (~b_shows & (alpha_a == 0) & (alpha_b > 0)).any()
        np.testing.assert_array_equal(opacity, np.where(b_shows, alpha_b, alpha_a))
        shows = b_shows if colour_a.ndim == 2 else b_shows[..., np.newaxis]
        np.testing.assert_array_equal(result.pixels, np.where(shows, colour_b, colour_a))


def offset_of(placement, a, b):
    """Where --offset or --overlap puts B, the plain way."""
    if placement[0].startswith("--offset"):
        x, y = placement[0].partition("=")[2].split(",")
        return int(x), int(y)
    length, side = (option.partition("=")[2] for option in placement)
    axis = 1 if side in ("left", "right") else 0
    whole, other = a.pixels.shape[axis], b.pixels.shape[axis]
    px = round(float(length[:-1]) / 100 * whole) if length.endswith("%") else int(length)
    along = whole - px if side in ("right", "bottom") else px - other
    return (along, 0) if axis else (0, along)


def check_stitch(a, b, placement, chosen):
    with tempfile.TemporaryDirectory() as folder:
        for name, picture in (("a.tif", a), ("b.tif", b)):
            write_picture(f"{folder}/{name}", picture)
        outputs = {"-o": "out.tif", "--labels": "labels.png", "--seam": "seam.svg", "--overlay": "overlay.png"}
        line = ("stitch", "a.tif", "b.tif", *placement, *chosen)
        ran = run(folder, *line, *(word for pair in outputs.items() for word in pair), "--json")
        if ran.code:
            assert names(folder) == {"a.tif", "b.tif"}, ran
            return ran
        assert names(folder) == {"a.tif", "b.tif", *outputs.values()}
        facts = json.loads(ran.out)
        assert facts["ratio"] >= 1 - 1e-4, facts
        a, b = match_pictures([a, b])
        b_shows = read_picture(f"{folder}/labels.png").pixels > 0
        result = read_picture(f"{folder}/out.tif")
        Expected(a, b, *offset_of(placement, a, b)).check(result, b_shows)
        assert read_picture(f"{folder}/overlay.png").pixels.shape == (*b_shows.shape, 3)
        if facts["paths"]:
            core = [option for option in chosen if "core" in option]
            again = run(folder, "stitch", "a.tif", "b.tif", *placement, *core, "--use-seam", "seam.svg", "-o", "again.tif")
            assert again.code == 0, (again, facts)
            assert Path(folder, "again.tif").read_bytes() == Path(folder, "out.tif").read_bytes()
        return ran


@quick
@given(pair=pairs(), chosen=choices())
def test_two_small_pictures(pair, chosen):
    check_stitch(*pair, chosen)


@pytest.mark.slow
@thorough
@given(pair=pairs(), chosen=choices())
def test_many_small_pictures(pair, chosen):
    check_stitch(*pair, chosen)


@pytest.mark.slow
@settings(thorough, max_examples=200)
@given(pair=pairs(), formulation=st.sampled_from("12"))
def test_the_thesis_on_small_pictures(pair, formulation):
    check_stitch(*pair, ["--method=thesis", f"--formulation={formulation}"])


def check_mask(a, b, placement, chosen, spots):
    """The seam stays off some white rectangles, or there is no way past them."""
    with tempfile.TemporaryDirectory() as folder:
        x, y = offset_of(placement, a, b)
        canvas = Expected(a, b, x, y)
        avoid = np.zeros(canvas.shape, bool)
        for row, column, rows, columns in spots:
            top, left = (canvas.shape[i] * share // 100 for i, share in enumerate((row, column)))
            avoid[top : top + rows, left : left + columns] = True
        for name, picture in (("a.tif", a), ("b.tif", b), ("mask.tif", Picture(pixels=avoid.astype(np.uint8) * np.uint8(255)))):
            write_picture(f"{folder}/{name}", picture)
        line = ("stitch", "a.tif", "b.tif", *placement, *chosen, "--mask", "mask.tif", "-o", "out.tif", "--labels", "labels.png", "--json")
        ran = run(folder, *line)
        if ran.code:
            assert names(folder) == {"a.tif", "b.tif", "mask.tif"}
            return
        a, b = match_pictures([a, b])
        b_shows = read_picture(f"{folder}/labels.png").pixels > 0
        expected = Expected(a, b, x, y)
        expected.check(read_picture(f"{folder}/out.tif"), b_shows)
        shared = (expected.placed(a, 0, 0)[1] > 0) & (expected.placed(b, x, y)[1] > 0)
        for s, t in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
            assert not ((b_shows[s] != b_shows[t]) & shared[s] & shared[t] & (avoid[s] | avoid[t])).any()
        facts = json.loads(ran.out)
        assert facts["ratio"] >= 1 - 1e-4, facts


#: Where rectangles begin, in percent of the canvas, and how large they are, in px.
spots = st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99), st.integers(1, 8), st.integers(1, 8)), min_size=1, max_size=3)


@settings(quick, max_examples=30)
@given(pair=pairs(least=6), chosen=choices(), spots=spots)
def test_any_mask(pair, chosen, spots):
    check_mask(*pair, chosen, spots)


@pytest.mark.slow
@thorough
@given(pair=pairs(least=6), chosen=choices(), spots=spots)
def test_many_masks(pair, chosen, spots):
    check_mask(*pair, chosen, spots)


@settings(quick, max_examples=15)
@given(pair=pairs())
def test_compare_any_pictures(pair):
    a, b, placement = pair
    with tempfile.TemporaryDirectory() as folder:
        for name, picture in (("a.tif", a), ("b.tif", b)):
            write_picture(f"{folder}/{name}", picture)
        ran = run(folder, "compare", "a.tif", "b.tif", *placement, *(f"--method={method}" for method in METHODS), "--json")
        if ran.code == 0:
            rows = json.loads(ran.out)
            assert [row["method"] for row in rows] == METHODS
            assert all(row["ratio"] >= 1 - 1e-4 for row in rows if "ratio" in row)


# Files of any bytes


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
        ran = run(folder, "stitch", "any.png", "b.png", "--overlap=3", "--max-megapixels=1", "-o", "out.tif", "--labels", "labels.png")
        if ran.code:
            assert names(folder) == {"any.png", "b.png"}
            return
        a, b = match_pictures([read_picture(f"{folder}/any.png"), read_picture(f"{folder}/b.png")])
        b_shows = read_picture(f"{folder}/labels.png").pixels > 0
        Expected(a, b, a.pixels.shape[1] - 3, 0).check(read_picture(f"{folder}/out.tif"), b_shows)


any_file = st.one_of(st.sampled_from(sorted(FILES)).flatmap(lambda suffix: damaged(FILES[suffix])), st.binary(max_size=300))
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
        ran = run(folder, "stitch", "a.png", "b.png", "--overlap=3", "--use-seam", "any.svg", "-o", "out.png", "--labels", "labels.png")
        if ran.code:
            assert names(folder) == {"a.png", "any.svg", "b.png"}
            return
        Expected(a, b, 6, 0).check(read_picture(f"{folder}/out.png"), read_picture(f"{folder}/labels.png").pixels > 0)


@quick
@given(data=any_file)
def test_any_bytes_as_a_picture(data):
    check_file(data)


@pytest.mark.slow
@thorough
@given(data=any_file)
def test_many_bytes_as_a_picture(data):
    check_file(data)


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
        assert run(folder, "stitch", "a.png", "b.png", "--overlap=3", "--use-seam", "any.svg", "-o", "out.png").code == 0


# The command line itself


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
                ["3", "3,0", "50%", "1e9", "-1", "nan", "inf", "", " ", "--", "-", "--mask", "--use-seam", "--labels", "--seam"]
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
