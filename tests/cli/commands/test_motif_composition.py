"""``toposeam motif``: outlines, guides, places, knock-out, stencils and growth on the command line."""

import numpy as np
import pytest
import pyvips
from scipy import ndimage

from toposeam_cli.media.pictures.picture import read_picture
from toposeam_cli.motifs.recipe_files import read_recipe

SMALL = ("--size", "64", "--iterations", "8", "--palette", "sumi", "--seed", "3")
DISC = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="80" height="80" viewBox="0 0 80 80">'
    '<circle cx="40" cy="40" r="26"/></svg>'
)
DOTS = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="80" height="80" viewBox="0 0 80 80">'
    '<circle cx="20" cy="40" r="2"/><circle cx="60" cy="40" r="2"/></svg>'
)


@pytest.fixture
def drawn(folder):
    (folder / "disc.svg").write_text(DISC)
    (folder / "dots.svg").write_text(DOTS)
    return folder


def test_a_ground_and_a_figure_by_their_outline(drawn, toposeam):
    words = ("--outline", "disc.svg", "--style", "seed,vein", "--place", "outside,inside", "--scale", "3,1")
    ran = toposeam("motif", "-o", "m.png", *SMALL, *words, "--repeat", "translate")
    assert (ran.code, ran.err) == (0, "")
    recipe = read_recipe(drawn / "m.png")
    assert [(layer.place, layer.scale) for layer in recipe.layers] == [("outside", 3), ("inside", 1)]
    assert toposeam("motif", "-o", "again.png", "--like", "m.png").code == 0
    assert np.array_equal(read_picture(drawn / "again.png").pixels, read_picture(drawn / "m.png").pixels)


def test_places_and_guides_from_drawings(drawn, toposeam):
    words = ("--sources", "dots.svg", "--guide", "disc.svg", "--style", "vein", "--layers", "1")
    assert toposeam("motif", "-o", "m.png", *SMALL, *words, "--repeat", "p2").code == 0
    recipe = read_recipe(drawn / "m.png")
    assert recipe.layers[0].sources == ((0.25, 0.5, 1.0), (0.75, 0.5, 1.0))
    assert recipe.guide
    ran = toposeam("motif", "-o", "n.png", "--like", "m.png", "--sinks", "dots.svg")
    assert ran.code == 0
    assert read_recipe(drawn / "n.png").layers[0].sinks == recipe.layers[0].sources


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_stencil_with_a_frame_stays_one_piece(drawn, toposeam, suffix):
    words = ("--stencil", "--bridge", "3mm", "--motif-width", "80mm", "--sheet", "2x2", "--frame")
    given = (*SMALL, "--style", "seed", "--layers", "1", "--repeat", "rotate", "--dpi", "100")
    ran = toposeam("motif", "-o", f"m.{suffix}", *given, *words)
    assert (ran.code, ran.err) == (0, "")
    assert read_recipe(drawn / f"m.{suffix}").bridge == pytest.approx(3 / 80 * 100)
    load = {"png": pyvips.Image.pngload_buffer, "svg": pyvips.Image.svgload_buffer}[suffix]
    shown = load((drawn / f"m.{suffix}").read_bytes()).numpy()[..., 0]
    assert ndimage.label(shown > 140)[1] == 1


@pytest.mark.parametrize("name", ["g.webp", "g.mp4", "g.svg"])
def test_a_growth_ends_with_the_motif(drawn, toposeam, name):
    if name == "g.mp4":
        pytest.importorskip("av")
    given = (*SMALL, "--style", "vein", "--repeat", "p4m", "--layers", "1")
    ran = toposeam("motif", "-o", "m.png", *given, "--animate", name, "--frames", "6")
    assert (ran.code, ran.err) == (0, "")
    assert toposeam("motif", "-o", "plain.png", *given).code == 0
    assert (drawn / "m.png").read_bytes() == (drawn / "plain.png").read_bytes()
    if name == "g.webp":
        from PIL import Image

        clip = Image.open(drawn / name)
        clip.seek(clip.n_frames - 1)
        assert np.array_equal(np.asarray(clip.convert("RGB")), read_picture(drawn / "m.png").pixels)
    assert (drawn / name).stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        (("--outline", "none.svg"), "no such file"),
        (("--outline", "star"), "one of disc, band, frame"),
        (("--sources", "none.png"), "no such file"),
        (("--place", "inside"), "give --outline"),
        (("--scale", "2", "--repeat", "rotate"), "use 3"),
        (("--stencil", "--one-piece"), "leave one of them out"),
        (("--stencil", "--bridge", "2mm"), "add --motif-width"),
        (("--frame",), "add --one-piece or --stencil"),
        (("--frames", "9"), "--animate"),
        (("--animate", "g.txt"), ".webp"),
    ],
)
def test_what_cannot_be_composed_is_said(drawn, toposeam, words, phrase):
    toposeam("motif", "-o", "m.png", *SMALL, *words).fails(phrase)
    assert not (drawn / "m.png").exists()
