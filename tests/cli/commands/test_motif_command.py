"""``toposeam motif`` and ``toposeam repeat``: what they make, make again, and refuse."""

import re
import shutil
import subprocess

import numpy as np
import pytest
import pyvips

import toposeam as ts
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.motifs.recipe_files import read_recipe, to_toml

SMALL = ("--style", "vein", "--size", "32", "--layers", "2", "--iterations", "6")


def rendered(path, width):
    """An SVG as a picture of that width."""
    text = re.sub(
        r'(<svg [^>]*?) width="[^"]*" height="[^"]*"', rf'\1 width="{width}"', path.read_text(), count=1
    )
    return pyvips.Image.svgload_buffer(text.encode()).numpy()[..., :3]


@pytest.fixture
def made(folder, toposeam):
    """A folder with ``motif.png`` in it."""
    ran = toposeam(
        "motif", "-o", "motif.png", *SMALL, "--repeat", "rotate", "--seed", "3", "--palette", "fall"
    )
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == "motif.png: 32 × 32 px, vein, 2 inks, repeats by rotate, seed 3\n"
    return folder


def test_the_motif_is_the_one_of_the_library(made):
    recipe = ts.motif.random_recipe(32, layers=2, iterations=6, repeat="rotate", seed=3, palette="fall")
    assert read_recipe(made / "motif.png") == recipe
    picture = read_picture(made / "motif.png")
    np.testing.assert_array_equal(
        picture.pixels, np.rint(ts.generate_motif(recipe).image() * 255).astype(np.uint8)
    )
    assert picture.icc is not None


@pytest.mark.parametrize(
    "arguments",
    [
        ("again.png",),
        ("again.tif", "--sheet", "3x2", "--pixels", "91x60"),
        ("again.png", "--motif-width", "5mm", "--dpi", "254"),
        ("again.svg", "--motif-width", "5mm", "--levels", "3", "--sheet", "2x2"),
    ],
)
def test_like_makes_the_same_bytes(made, toposeam, arguments):
    output, *options = arguments
    assert toposeam("motif", "-o", "first" + output[5:], *SMALL, "--seed", "4", *options).code == 0
    assert toposeam("motif", "-o", output, "--like", "first" + output[5:]).code == 0
    assert (made / output).read_bytes() == (made / ("first" + output[5:])).read_bytes()


def test_paper_size_and_resolution(made, toposeam):
    toposeam("motif", "-o", "paper.png", "--like", "motif.png", "--motif-width", "1in", "--sheet", "1x2")
    picture = read_picture(made / "paper.png")
    assert picture.pixels.shape == (600, 300, 3)
    assert picture.resolution == pytest.approx((300 / 25.4, 300 / 25.4), rel=1e-3)
    toposeam("motif", "-o", "a.svg", "--like", "motif.png", "--motif-width", "1in", "--sheet", "1x2")
    assert 'width="25.4mm" height="50.8mm" viewBox="0 0 32 64"' in (made / "a.svg").read_text()


def test_a_picture_of_another_shape_is_filled_and_cropped(made, toposeam):
    toposeam("motif", "-o", "wide.png", "--like", "motif.png", "--pixels", "130x80", "--sheet", "2x1")
    toposeam("motif", "-o", "whole.png", "--like", "motif.png", "--pixels", "130x130", "--sheet", "2x2")
    wide, whole = (read_picture(made / f"{name}.png").pixels for name in ("wide", "whole"))
    np.testing.assert_array_equal(wide, whole[:80])
    toposeam("repeat", "wide.png", "2x2", "-o", "m.png").fails("is not one whole motif")


def test_relatives_keep_what_they_share(made, toposeam):
    near = ("--vary", "0.1", "--seed", "9", "--palette", "#fff0e0 #102030 #405060")
    toposeam("motif", "-o", "near.png", "--like", "motif.png", *near)
    toposeam("motif", "-o", "far.png", "--like", "motif.png", "--seed", "9", "--vary", "0.5")
    first, near, far = (read_recipe(made / f"{name}.png") for name in ("motif", "near", "far"))
    assert near.repeat == far.repeat == "rotate"
    assert near.layers[1].ink == (0x40 / 255, 0x50 / 255, 0x60 / 255)

    def moved(other):
        pairs = [
            (a, b)
            for x, y in zip(first.layers, other.layers, strict=True)
            for a, b in zip(x.sources, y.sources, strict=True)
        ]
        return np.mean([np.hypot(a[0] - b[0], a[1] - b[1]) for a, b in pairs])

    assert 0 < moved(near) < 0.08 < moved(far)
    # Without a seed, that of the motif and one: a row of relatives counts up.
    toposeam("motif", "-o", "next.png", "--like", "motif.png", "--vary", "0.1")
    assert read_recipe(made / "next.png") == ts.motif.vary(first, amount=0.1, seed=first.seed + 1)


def test_a_recipe_as_toml_and_back(made, toposeam):
    shown = toposeam("motif", "--like", "motif.png", "--show-recipe")
    assert shown.code == 0
    assert shown.out == to_toml(read_recipe(made / "motif.png"))
    (made / "recipe.toml").write_text(shown.out)
    toposeam("motif", "-o", "again.png", "--config", "recipe.toml")
    assert (made / "again.png").read_bytes() == (made / "motif.png").read_bytes()


def test_options_from_a_file_and_over_it(made, toposeam):
    lines = (
        "size = 32",
        "layers = 2",
        "iterations = 4",
        "penalty = 1.0",
        "base-strength = 0.5",
        'base = "a.png"',
        "mass = [0.2, 0.3]",
        "sources = [[0.1, 0.2], [0.3, 0.4, 2.0]]",
        "sinks = [1, 2]",
    )
    (made / "my.toml").write_text("\n".join(lines))
    assert toposeam("motif", "-o", "a.tif", "--config", "my.toml", "--iterations", "5").code == 0
    recipe = read_recipe(made / "a.tif")
    assert (recipe.iterations, recipe.size, recipe.base_strength) == (5, (32, 32), 0.5)
    assert [(layer.mass, layer.penalty, len(layer.sinks)) for layer in recipe.layers] == [
        (0.2, 1.0, 1),
        (0.3, 1.0, 2),
    ]
    assert [layer.sources for layer in recipe.layers] == [((0.1, 0.2, 1.0), (0.3, 0.4, 2.0))] * 2
    assert recipe.base


def test_repeat_lays_the_motif_by_its_rule(made, toposeam):
    assert toposeam("repeat", "motif.png", "3x2", "-o", "sheet.png").code == 0
    motif, sheet = (read_picture(made / f"{name}.png").pixels for name in ("motif", "sheet"))
    assert sheet.shape == (64, 96, 3)
    np.testing.assert_array_equal(sheet[:32, 32:64], motif[::-1, ::-1])
    np.testing.assert_array_equal(sheet[32:, 32:64], motif)
    toposeam("motif", "-o", "direct.png", "--like", "motif.png", "--sheet", "3x2")
    assert (made / "direct.png").read_bytes() == (made / "sheet.png").read_bytes()


def test_repeat_of_any_picture_keeps_depth_alpha_and_profile(folder, toposeam):
    rng = np.random.default_rng(0)
    pixels, alpha = rng.integers(0, 65536, (6, 8, 3), np.uint16), rng.integers(0, 65536, (6, 8), np.uint16)
    write_picture("any.png", Picture(pixels=pixels, alpha=alpha, resolution=(4.0, 4.0)))
    assert toposeam("repeat", "any.png", "2x1", "-o", "any.tif", "--repeat", "reflect").code == 0
    sheet = read_picture("any.tif")
    np.testing.assert_array_equal(sheet.pixels, np.concatenate([pixels, pixels[:, ::-1]], axis=1))
    np.testing.assert_array_equal(sheet.alpha, np.concatenate([alpha, alpha[:, ::-1]], axis=1))


@pytest.mark.medium
@pytest.mark.parametrize("rule", ["translate", "rotate", "reflect", "pgg"])
def test_drawings_look_like_the_pictures(folder, toposeam, rule):
    options = (
        "--size",
        "64",
        "--layers",
        "2",
        "--repeat",
        rule,
        "--seed",
        "5",
        "--sheet",
        "2x2",
        "--iterations",
        "15",
        "--filter",
        "3",
        "--edge",
        "soft",
    )
    toposeam("motif", "-o", "sheet.svg", *options)
    toposeam("motif", "-o", "sheet.png", *options, "--pixels", "256x256")
    drawn, painted = (
        rendered(folder / "sheet.svg", 256).astype(int),
        read_picture("sheet.png").pixels.astype(int),
    )
    assert (
        np.abs(drawn - painted).mean() < 3
    )  # of 255: the steps between levels; another seed gives more than 30
    # What the picture does across the border, the drawing does: a hairline would be a step of 50 or more that
    # the picture lacks.
    for pixels in (drawn.transpose(1, 0, 2), drawn):
        across = np.abs(np.diff(pixels, axis=0)).max(axis=2)
        here = painted.transpose(1, 0, 2) if pixels is not drawn else painted
        expected = np.abs(np.diff(here, axis=0)).max(axis=2)
        assert np.percentile(across[127], 99) <= 1.2 * np.percentile(expected[127], 99) + 4


def test_a_sheet_starting_between_pixels_shows_no_lines(folder, toposeam):
    toposeam(
        "motif",
        "-o",
        "sheet.svg",
        "--style",
        "vein",
        "--repeat",
        "translate",
        "--size",
        "48",
        "--mass",
        "0.6",
        "--layers",
        "1",
        "--sheet",
        "3x3",
        "--filter",
        "3",
    )
    for width in (301, 400):
        step = np.abs(np.diff(rendered(folder / "sheet.svg", width).astype(int), axis=1)).max(axis=2)
        borders = np.concatenate(
            [step[:, int(width * third) - 2 : int(width * third) + 2].ravel() for third in (1 / 3, 2 / 3)]
        )
        assert np.percentile(borders, 99) <= 1.1 * np.percentile(step, 99) + 2


@pytest.mark.parametrize(
    ("line", "phrase"),
    [
        ("motif -o m.gif", "'.gif' is not supported"),
        ("motif -o motif.png", "pass --force"),
        ("motif -o m.png --palette autumn", "choose one of spring"),
        ("motif -o m.png --layers 9 --palette '#ffffff #ff0000'", "use fewer layers"),
        ("motif -o m.png --palette '#ffffff'", "has no ink"),
        ("motif -o m.png --palette nowhere.png", "there is no file"),
        ("motif -o m.png --palette clear.png", "is transparent everywhere"),
        ("motif -o m.png --palette patch.png", "has 1 colours"),
        ("motif -o m.png --base broken.png", "export it again"),
        ("motif -o m.png --base nowhere.png", "there is no file"),
        ("motif -o m.png --size 4", "size is"),
        ("motif -o m.png --size 32x48 --repeat p4m", "needs a square cell"),
        ("motif -o m.png --size 33 --repeat rotate", "needs even sizes"),
        ("motif -o m.png --layers 3 --mass 0.2,0.3", "one for each"),
        ("motif -o m.png --vary 0.5", "--vary needs a motif"),
        ("motif -o m.png --like a.png", "holds no recipe"),
        ("motif -o m.png --like nowhere.png", "there is no file"),
        ("motif -o m.png --like .", "is a folder"),
        ("motif -o m.png --like text.png", "'text.png' is not a picture"),
        ("motif -o m.png --sources 99999", "200 at most"),
        ("motif -o m.png --like damaged.png", "is damaged"),
        ("motif -o m.png --like wrong.png", "is damaged"),
        ("motif -o m.png --like broken.svg", "is not XML"),
        ("motif -o m.png --like motif.png --layers 2", "--layers cannot change"),
        ("motif -o m.png --like motif.png --config my.toml", "leave one of them out"),
        ("motif -o m.png --like motif.png --from my.toml", "leave one of them out"),
        ("motif -o m.png --from my.toml --number 2", "motif on a page"),
        ("motif -o m.png --number 2", "motif on a page"),
        ("motif -o m.png --config nowhere.toml", "there is no file"),
        ("motif -o m.png --config a.png", "is not UTF-8"),
        ("motif -o m.png --config typo.toml", "'masss', which is no parameter"),
        ("motif -o m.png --config range.toml", "range.toml"),
        ("motif -o m.png --sheet 9000x9000", "ask for fewer"),
        ("motif -o m.svg --sheet 90000x9000", "--sheet is 90000"),
        ("motif -o m.svg --pixels 90x90", "leave it out"),
        ("repeat motif.png 9000x9000 -o m.png", "ask for fewer motifs"),
        ("repeat a.png 2x2 -o m.png", "with --repeat"),
        ("repeat sheet.png 2x2 -o m.png", "is not one whole motif"),
        ("repeat motif.png 2x2 -o m.svg --repeat pgg", "leave --repeat out"),
        ("repeat a.png 2x2 -o m.png --motif-width 3cm", "holds no recipe"),
        ("motif -o m.png --edge hard", "edge is 'hard'"),
        ("motif -o m.png --layers 3 --edge soft,crisp", "--edge has 2 words for 3"),
        ("motif -o m.png --layers 3 --spot-names Red", "--spot-names has 1 words for 3"),
        ("motif -o m.svg --separations", "layer of its own already"),
        ("motif -o m.png --palette swatches.ase", "cannot be read"),
        ("motif -o m.png --palette bad.gpl", "is damaged"),
        ("motif -o m.png --repeat 'drop 1/3' --size 32", "divides by 3"),
        ("repeat a.png 2x2 -o m.png --cell 20", "give one with --repeat"),
        ("repeat a.png 2x2 -o m.png --repeat pg --cell 21", "even sizes"),
        ("repeat a.png 2x2 -o m.png --repeat pg --cell 20 --at 99,1", "outside the picture"),
        ("repeat a.png 2x2 -o m.png --repeat pg --at 9,1", "give --cell too"),
        ("repeat motif.png 2x2 -o m.png --repeat p4 --cell 20 --transparent", "pixel by pixel"),
        ("repeat drawing.svg 2x2 -o m.png", "write it to a .svg"),
    ],
)
def test_bad_input(made, toposeam, line, phrase):
    (made / "broken.png").write_bytes((made / "motif.png").read_bytes()[:700])
    (made / "broken.svg").write_text("<svg><metadata>")
    (made / "text.png").write_text("no picture")
    hidden = np.arange(192, dtype=np.uint8).reshape(8, 8, 3)
    for name, seen in (("clear.png", 0), ("patch.png", 1)):
        write_picture(
            name,
            Picture(
                pixels=hidden, alpha=np.where(np.arange(64) < seen, 255, 0).astype(np.uint8).reshape(8, 8)
            ),
        )
    write_picture("damaged.png", Picture(pixels=np.zeros((4, 4), np.uint8), xmp=b"<x:xmpmeta"))
    packet = (
        '<a xmlns:t="urn:x-toposeam:1.0:"><t:recipe>{"recipe": {"size": [32, 32], "layers": [{"ink": '
        "3}]}}</t:recipe></a>"
    )
    write_picture("wrong.png", Picture(pixels=np.zeros((4, 4), np.uint8), xmp=packet.encode()))
    (made / "my.toml").write_text("size = 32\n")
    (made / "typo.toml").write_text("masss = 0.3\n")
    (made / "range.toml").write_text("base-strength = 3\n")
    (made / "bad.gpl").write_text("no palette")
    if "sheet.png" in line:
        toposeam("repeat", "motif.png", "2x1", "-o", "sheet.png")
    if "drawing" in line:
        toposeam("motif", "-o", "drawing.svg", "--like", "motif.png")
    before = {path.name: path.read_bytes() for path in made.iterdir()}
    import shlex

    toposeam(*shlex.split(line)).fails(phrase)
    assert {path.name: path.read_bytes() for path in made.iterdir()} == before


def test_separations_are_the_shares_of_each_ink(made, toposeam):
    line = ("motif", "-o", "m.tif", "--like", "motif.png", "--motif-width", "10mm", "--sheet", "2x1")
    assert toposeam(*line, "--separations", "--spot-names", "PANTONE 300 C,Black").code == 0
    motif = ts.generate_motif(read_recipe(made / "m.tif"))
    layers = ts.motif.repeat_densities(motif, (1, 2), size=(118, 118))
    for name, layer in zip(("m.1-PANTONE-300-C.tif", "m.2-Black.tif"), layers, strict=True):
        plate = read_picture(name)
        np.testing.assert_array_equal(plate.pixels, np.rint(255 * (1 - layer)).astype(np.uint8))
        assert plate.icc is None
        assert plate.resolution == pytest.approx((300 / 25.4, 300 / 25.4), rel=1e-3)
    toposeam("motif", "-o", "m.svg", "--like", "m.tif")
    assert 'inkscape:label="PANTONE 300 C"' in (made / "m.svg").read_text()
    (made / "n.1-ink-1.png").write_text("something of mine")
    toposeam("motif", "-o", "n.png", "--like", "motif.png", "--separations").fails("pass --force")
    assert not (made / "n.png").exists()


def test_transparent_paper_on_white_equals_white_paper(made, toposeam):
    line = ("--like", "motif.png", "--palette", "#fff #c33 #036", "--edge", "soft,crisp")
    assert toposeam("motif", "-o", "white.png", *line).code == 0
    assert toposeam("motif", "-o", "clear.png", *line, "--transparent").code == 0
    white, clear = read_picture("white.png"), read_picture("clear.png")
    alpha = clear.alpha[..., None] / 255
    assert clear.alpha.min() < 30
    assert np.abs(alpha * clear.pixels + 255 * (1 - alpha) - white.pixels).max() <= 2
    toposeam("motif", "-o", "clear.svg", "--like", "clear.png")
    assert "<rect x=" not in (made / "clear.svg").read_text().split("<g id")[0]


def test_edges_are_kept_in_the_recipe(made, toposeam):
    toposeam("motif", "-o", "ink.png", "--like", "motif.png", "--edge", "ink")
    assert [layer.edge for layer in read_recipe(made / "ink.png").layers] == ["ink", "ink"]
    assert (made / "ink.png").read_bytes() != (made / "motif.png").read_bytes()


def test_inks_that_cannot_show_on_their_paper_are_named(folder, toposeam):
    small = ("--size", "32", "--layers", "2", "--force")
    ran = toposeam("motif", "-o", "dark.png", *small, "--palette", "#101820 #f2c14e #e58a9a")
    assert ran.code == 0, ran
    assert "ink 1, ink 2 will barely show" in ran.err
    assert "#101820 is as dark as they are; take a lighter paper" in ran.err
    ran = toposeam("motif", "-o", "light.png", *small, "--palette", "#f8f0e1 #b5532a #101820")
    assert "barely show" not in ran.err


def test_palettes_of_files_and_their_list(folder, toposeam):
    (folder / "my.gpl").write_text("GIMP Palette\nName: x\n#\n 10 20 30\tdark\n255 250 240 paper\n200 0 0\n")
    toposeam("motif", "-o", "g.png", *SMALL, "--palette", "my.gpl")
    recipe = read_recipe(folder / "g.png")
    assert np.round(np.array(recipe.paper) * 255).tolist() == [255, 250, 240]
    assert [np.round(np.array(layer.ink) * 255).tolist() for layer in recipe.layers] == [
        [10, 20, 30],
        [200, 0, 0],
    ]
    import struct

    def block(model, *values):
        name = "a".encode("utf-16-be") + b"\0\0"
        body = struct.pack(">H", 2) + name + model + struct.pack(f">{len(values)}f", *values) + b"\0\0"
        return struct.pack(">HI", 1, len(body)) + body

    group = struct.pack(">HI", 0xC001, 2) + b"\0\0"
    colours = [block(b"RGB ", 1, 1, 0.5), block(b"CMYK", 1, 0, 0, 0.5), block(b"Gray", 0.25)]
    (folder / "my.ase").write_bytes(b"ASEF" + struct.pack(">HHI", 1, 0, 4) + group + b"".join(colours))
    toposeam("motif", "-o", "a.tif", *SMALL, "--palette", "my.ase")
    recipe = read_recipe(folder / "a.tif")
    assert recipe.paper == (1.0, 1.0, 0.5)
    assert [layer.ink for layer in recipe.layers] == [(0.0, 0.5, 0.5), (0.25, 0.25, 0.25)]
    ran = toposeam("motif", "--palettes")
    assert ran.out.splitlines()[0].split() == ["spring", *ts.motif.PALETTES["spring"]]


def test_half_drops_are_rules_and_layouts(made, toposeam):
    toposeam("motif", "-o", "d.png", *SMALL, "--repeat", "drop", "--sheet", "2x1")
    sheet = read_picture("d.png").pixels
    np.testing.assert_array_equal(sheet[:, 32:], np.roll(sheet[:, :32], 16, axis=0))
    toposeam("repeat", "motif.png", "1x3", "-o", "laid.png", "--repeat", "brick 1/4")
    motif, laid = read_picture("motif.png").pixels, read_picture("laid.png").pixels
    for row in range(3):
        np.testing.assert_array_equal(laid[32 * row : 32 * (row + 1)], np.roll(motif, 8 * row, axis=1))


def test_a_kaleidoscope_of_a_photograph(folder, toposeam):
    line = ("repeat", "a.png", "2x1", "-o", "k.png", "--repeat", "p4m", "--cell", "30", "--at", "20,20")
    assert toposeam(*line).out == "k.png: 60 × 30 px, 2 × 1 motifs by a kaleidoscope by p4m\n"
    cell = read_picture("k.png").pixels[:, :30].astype(int)
    assert np.abs(cell - cell[::-1]).max() <= 1
    assert np.abs(cell - cell.swapaxes(0, 1)).max() <= 1


def test_what_click_refuses(folder, toposeam):
    for line, phrase in [
        (("motif",), "say where the motif goes"),
        (("motif", "-o", "m.png", "--repeat", "p7"), "--repeat"),
        (("motif", "-o", "m.png", "--size", "big"), "not a size"),
        (("motif", "-o", "m.png", "--motif-width", "8"), "write it with its unit"),
        (("motif", "-o", "m.png", "--sources", "2.5"), "not a number"),
    ]:
        toposeam(*line).fails(phrase, code=2)


def test_colourways_and_opaque_inks_on_dark_paper(made, toposeam):
    line = ("motif", "-o", "dark.png", *SMALL, "--seed", "3", "--repeat", "rotate", "--ink", "opaque")
    ran = toposeam(*line, "--paper", "#101820", "--palette", "spring", "--colourways", "sea, night")
    assert (ran.code, ran.err) == (0, "")
    for name, palette in (("dark", "spring"), ("dark-sea", "sea"), ("dark-night", "night")):
        alone = ("--paper", "#101820", "--palette", palette)
        assert toposeam(*line[:2], "alone.png", *line[3:], *alone, "--force").code == 0
        assert (made / f"{name}.png").read_bytes() == (made / "alone.png").read_bytes()
    light = toposeam(
        "motif", "-o", "light.png", "--like", "dark.png", "--paper", "#ffffff", "--ink", "opaque"
    )
    assert light.code == 0
    assert read_recipe(made / "light.png").paper == (1.0, 1.0, 1.0)
    toposeam(*line, "--force", "--colourways", "sea,nowhere").fails("choose one of spring")
    toposeam(*line, "--paper", "black", "--force").fails("write it as #rrggbb")


def test_drawings_of_opaque_inks_look_like_the_pictures(folder, toposeam):
    line = ("--size", "64", "--style", "rosette", "--repeat", "p2", "--ink", "opaque", "--paper", "#102030")
    for name in ("m.svg", "m.png"):
        assert toposeam("motif", "-o", name, *line, "--palette", "spring", "--seed", "2").code == 0
    drawn, picture = rendered(folder / "m.svg", 64), read_picture(folder / "m.png").pixels
    assert np.abs(drawn.astype(int)[..., :3] - picture).mean() < 4


GHOSTSCRIPT = shutil.which("gs")


@pytest.mark.medium
@pytest.mark.skipif(GHOSTSCRIPT is None, reason="there is no Ghostscript")
@pytest.mark.parametrize(
    "look",
    [
        ("--style", "fern", "--repeat", "p4m"),
        ("--style", "rosette", "--repeat", "rotate", "--sheet", "3x2"),
        ("--style", "folk", "--repeat", "p6m", "--ink", "opaque", "--paper", "#101820"),
        ("--style", "rosette", "--repeat", "brick", "--sheet", "2x3", "--ink", "opaque"),
    ],
)
def test_a_pdf_looks_like_the_picture_with_a_plate_for_each_ink(folder, toposeam, look):
    line = ("motif", *look, "--size", "96", "--seed", "2", "--palette", "sea", "--spot-names", "Red 1,Gold")
    for name in ("m.pdf", "m.png"):
        ran = toposeam(*line, "-o", name, "--motif-width", "1in", "--dpi", "384")
        assert (ran.code, ran.err) == (0, "")
    call = (GHOSTSCRIPT, "-q", "-dBATCH", "-dNOPAUSE", "-r384", "-dGraphicsAlphaBits=4")
    subprocess.run([*call, "-sDEVICE=png16m", "-sOutputFile=drawn.png", "m.pdf"], check=True, cwd=folder)
    drawn, picture = (read_picture(folder / name).pixels.astype(int) for name in ("drawn.png", "m.png"))
    assert np.abs(np.subtract(drawn.shape, picture.shape)).max() <= 1
    height, width = np.minimum(drawn.shape, picture.shape)[:2]
    assert np.abs(drawn[:height, :width] - picture[:height, :width]).mean() < 5
    subprocess.run([*call, "-sDEVICE=tiffsep", "-sOutputFile=plate.tif", "m.pdf"], check=True, cwd=folder)
    assert {path.name for path in folder.glob("plate(*")} >= {"plate(Red 1).tif", "plate(Gold).tif"}
    # The recipe is in it, and gives the same bytes.
    before = (folder / "m.pdf").read_bytes()
    assert toposeam("motif", "-o", "again.pdf", "--like", "m.pdf").code == 0
    assert (folder / "again.pdf").read_bytes() == before
