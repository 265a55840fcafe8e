"""Any small pictures, placements, masks and methods: what must hold of every stitch."""

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest
from any_input import FULL, Expected, names, quick, run, thorough
from hypothesis import given, settings
from hypothesis import strategies as st

import toposeam as ts
from toposeam_cli.media.pictures.picture import Picture, match_pictures, read_picture, write_picture

# The thesis's own takes a second each time, and auto takes one of the others.
METHODS = [method for method in ts.seam.METHODS if method not in ("auto", "thesis")]


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
    opacity = alphas(
        rng,
        draw(st.sampled_from([*["none"] * 6, "full", "soft", "holes", "disc", "half", "clear", "dot"])),
        height,
        width,
    )
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
        x, y = (
            draw(st.integers(-60, 60) if astray else st.integers(1 - m, n - 1))
            for n, m in zip(size_a, size_b, strict=True)
        )
        return a, b, [f"--offset={x},{y}"]
    side = draw(st.sampled_from(ts.seam.SIDES))
    axis = 0 if side in ("left", "right") else 1
    longest = min(size_a[axis], size_b[axis])
    lengths = st.integers(0, 60).map(str) if astray else st.integers(1, longest).map(str)
    shares = st.integers(1, 100 if astray else max(1, 100 * longest // size_a[axis])).map("{}%".format)
    return a, b, [f"--overlap={draw(lengths | shares)}", f"--side={side}"]


@st.composite
def choices(draw):
    """The options that decide how the seam is found."""
    chosen = [f"--method={draw(st.sampled_from([*METHODS, 'auto', 'auto']))}"]
    if draw(st.booleans()):
        chosen += ["--cost", "colour"]
    if draw(st.integers(0, 3)) == 0:
        chosen.append(f"--core={draw(st.floats(0.01, 1)):.3f}")
    if draw(st.integers(0, 3)) == 0:
        chosen.append(f"--speck={draw(st.integers(0, 200))}")
    return chosen


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
        outputs = {
            "-o": "out.tif",
            "--labels": "labels.png",
            "--seam": "seam.svg",
            "--overlay": "overlay.png",
        }
        line = ("stitch", "a.tif", "b.tif", *placement, *chosen)
        ran = run(folder, *line, *(word for pair in outputs.items() for word in pair), "--json")
        if ran.code:
            assert names(folder) == {"a.tif", "b.tif"}, ran
            return ran
        assert names(folder) == {"a.tif", "b.tif", *outputs.values()}
        facts = json.loads(ran.out)
        assert len(facts["seams"]) == 1, facts
        assert facts["seams"][0]["ratio"] >= 1 - 1e-4, facts
        a, b = match_pictures([a, b])
        b_shows = read_picture(f"{folder}/labels.png").pixels > 0
        result = read_picture(f"{folder}/out.tif")
        Expected(a, b, *offset_of(placement, a, b)).check(result, b_shows)
        assert read_picture(f"{folder}/overlay.png").pixels.shape == (*b_shows.shape, 3)
        if facts["seams"][0]["paths"]:
            core = [option for option in chosen if option.startswith(("--core", "--speck"))]
            again = run(
                folder,
                "stitch",
                "a.tif",
                "b.tif",
                *placement,
                *core,
                "--use-seam",
                "seam.svg",
                "-o",
                "again.tif",
            )
            assert again.code == 0, (again, facts)
            assert Path(folder, "again.tif").read_bytes() == Path(folder, "out.tif").read_bytes()
        return ran


@pytest.mark.medium
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
@settings(thorough, max_examples=thorough.max_examples // 3)
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
        for name, picture in (
            ("a.tif", a),
            ("b.tif", b),
            ("mask.tif", Picture(pixels=avoid.astype(np.uint8) * np.uint8(255))),
        ):
            write_picture(f"{folder}/{name}", picture)
        line = (
            "stitch",
            "a.tif",
            "b.tif",
            *placement,
            *chosen,
            "--avoid",
            "mask.tif",
            "-o",
            "out.tif",
            "--labels",
            "labels.png",
            "--json",
        )
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
        assert len(facts["seams"]) == 1, facts
        assert facts["seams"][0]["ratio"] >= 1 - 1e-4, facts


#: Where rectangles begin, in percent of the canvas, and how large they are, in px.
spots = st.lists(
    st.tuples(st.integers(0, 99), st.integers(0, 99), st.integers(1, 8), st.integers(1, 8)),
    min_size=1,
    max_size=3,
)


@pytest.mark.medium
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
        ran = run(
            folder,
            "compare",
            "a.tif",
            "b.tif",
            *placement,
            *(f"--method={method}" for method in METHODS),
            "--json",
        )
        if ran.code == 0:
            rows = json.loads(ran.out)
            assert [row["method"] for row in rows] == METHODS
            assert all(row["ratio"] >= 1 - 1e-4 for row in rows if "ratio" in row)
