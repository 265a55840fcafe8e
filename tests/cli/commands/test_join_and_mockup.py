"""``toposeam join`` and ``toposeam mockup``."""

import shlex

import numpy as np
import pytest
from scipy.ndimage import zoom

import toposeam as ts
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.motifs.recipe_files import read_recipe

SMALL = ("--style", "vein", "--repeat", "translate", "--size", "24", "--layers", "2", "--iterations", "5")


@pytest.fixture(scope="module")
def motifs(tmp_path_factory):
    """A folder with two motifs of other colours, one of three layers, and a narrow picture."""
    from click.testing import CliRunner

    from toposeam_cli.app.main import main

    folder = tmp_path_factory.mktemp("motifs")
    for name, options in (
        ("one", ("--palette", "sea", "--seed", "1")),
        ("two", ("--palette", "plum", "--seed", "2", "--size", "32")),
    ):
        assert (
            CliRunner().invoke(main, ["motif", "-o", str(folder / f"{name}.png"), *SMALL, *options]).exit_code
            == 0
        )
    write_picture(folder / "strip.png", Picture(pixels=np.zeros((3, 5000), np.uint8)))
    line = ["motif", "-o", str(folder / "three.png"), *SMALL, "--layers", "3"]
    assert CliRunner().invoke(main, line).exit_code == 0
    return folder


@pytest.mark.medium
def test_motifs_are_joined_as_the_library_joins_them(motifs, tmp_path, toposeam):
    one, two = (read_recipe(motifs / f"{name}.png") for name in ("one", "two"))
    ran = toposeam(
        "join",
        motifs / "one.png",
        motifs / "two.png",
        "-o",
        tmp_path / "mixed.png",
        "--grid",
        "1 2 / 3 1",
        "--seed",
        "3",
    )
    assert (ran.code, ran.err) == (0, "")
    mixed = read_picture(tmp_path / "mixed.png").pixels
    assert mixed.shape == (48, 48, 3)
    import dataclasses

    layers = tuple(dataclasses.replace(b, ink=a.ink) for a, b in zip(one.layers, two.layers, strict=True))
    other = dataclasses.replace(two, size=one.size, paper=one.paper, layers=layers)
    joined = ts.motif.join_motifs([one, other], weight=0.5, stages=2)
    expected = ts.motif.arrange(joined.motifs, np.array([[0, 1], [2, 0]])).image()
    np.testing.assert_array_equal(mixed, np.rint(expected * 255).astype(np.uint8))


@pytest.mark.medium
def test_a_random_sheet_at_a_size(motifs, tmp_path, toposeam):
    line = (
        "join",
        motifs / "one.png",
        motifs / "two.png",
        "--stages",
        "1",
        "--sheet",
        "3x2",
        "--motif-pixels",
        "30",
        "-q",
    )
    for name in ("a", "b"):
        assert toposeam(*line, "-o", tmp_path / f"{name}.png").code == 0
    assert read_picture(tmp_path / "a.png").pixels.shape == (60, 90, 3)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.medium
def test_a_motif_on_a_product_has_its_colours(motifs, tmp_path, toposeam):
    ran = toposeam(
        "mockup", motifs / "one.png", "--on", "canvas", "-o", tmp_path / "c.png", "--motif-width", "20cm"
    )
    assert (ran.code, ran.out) == (0, f"{tmp_path / 'c.png'}: canvas, one motif 200 mm wide\n")
    drawn = read_picture(tmp_path / "c.png").pixels
    # 200 mm, one motif, of the picture's middle, where the light neither gains nor loses.
    art = drawn[360:578, 436:654].reshape(-1, 3).astype(float)
    motif = read_picture(motifs / "one.png").pixels.reshape(-1, 3).astype(float)
    np.testing.assert_allclose(art.mean(axis=0), motif.mean(axis=0), atol=12)


@pytest.mark.medium
def test_a_mockup_at_a_resolution_is_the_same_picture_larger(motifs, tmp_path, toposeam):
    """A phone of 130 × 210 mm; strokes are drawn at that size, not enlarged."""
    for name, given in (("small", []), ("large", ["--dpi", 254])):
        line = ["mockup", motifs / "one.png", "--on", "phone", "-o", tmp_path / f"{name}.png", "-q"]
        assert toposeam(*line, *given).code == 0
    small, large = (read_picture(tmp_path / f"{name}.png") for name in ("small", "large"))
    assert large.pixels.shape == (2100, 1300, 3)
    assert large.resolution == pytest.approx((10, 10), rel=1e-3)
    assert small.resolution is None
    reduced = zoom(large.pixels.astype(float), (1200 / 2100, 743 / 1300, 1), order=1)
    assert np.abs(reduced - small.pixels).mean() < 6
    smooth = zoom(small.pixels.astype(float), (2100 / 1200, 1300 / 743, 1), order=1)
    sharpness = [np.abs(np.diff(pixels.astype(float), axis=1)).max() for pixels in (large.pixels, smooth)]
    assert sharpness[0] > 1.2 * sharpness[1]


@pytest.mark.medium
def test_any_picture_on_a_product(tmp_path, toposeam):
    write_picture(tmp_path / "gray.png", Picture(pixels=np.full((9, 7), 90, np.uint8)))
    assert (
        toposeam(
            "mockup",
            tmp_path / "gray.png",
            "--on",
            "scarf",
            "--repeat",
            "translate",
            "-o",
            tmp_path / "s.png",
            "-q",
        ).code
        == 0
    )
    drawn = read_picture(tmp_path / "s.png").pixels
    assert drawn.shape == (1200, round(1200 * 940 / 970), 3)
    assert abs(float(np.median(drawn[600:800, 600:700])) - 90) < 12


@pytest.mark.medium
def test_what_is_transparent_is_printed_white(tmp_path, toposeam):
    clear = Picture(pixels=np.full((9, 9), 90, np.uint16), alpha=np.zeros((9, 9), np.uint16))
    write_picture(tmp_path / "clear.png", clear)
    assert (
        toposeam(
            "mockup",
            tmp_path / "clear.png",
            "--on",
            "canvas",
            "--repeat",
            "p1",
            "-o",
            tmp_path / "c.png",
            "-q",
        ).code
        == 0
    )
    assert np.median(read_picture(tmp_path / "c.png").pixels[582:785, 655:916]) > 240


@pytest.mark.parametrize(("stages", "count"), [(1, 2), (2, 5), (3, 17)])
def test_a_motif_that_will_not_be_there_is_said_before_the_work(
    motifs, tmp_path, toposeam, monkeypatch, stages, count
):
    monkeypatch.setattr("toposeam.motif.join_motifs", lambda *given, **options: 1 / 0)
    line = ("join", motifs / "one.png", motifs / "two.png", "-o", tmp_path / "m.png", "--between", 3)
    grid = f"1 {count + 1}"
    ran = toposeam(*line, "--stages", stages, "--grid", grid)
    ran.fails(f"names motif {count + 1}, but with those between there are {count};")


@pytest.mark.parametrize(
    ("line", "phrase", "code"),
    [
        ("join {in}/one.png -o m.png", "two at least", 1),
        ("join {in}/one.png {in}/two.png -o m.png --sheet 99999x99999", "ask for fewer", 1),
        ("mockup {in}/strip.png --on tie -o m.png", "with --repeat", 1),
        ("mockup {in}/strip.png --on tie --repeat p1 -o m.png", "less narrow", 1),
        ("join {in}/one.png {in}/three.png -o m.png", "equally many", 1),
        ("join {in}/one.png {in}/two.png -o m.gif", "not supported", 1),
        ("join {in}/one.png {in}/two.png -o m.png --grid '1 2 / 1'", "as many numbers", 1),
        ("join {in}/one.png {in}/two.png -o m.png --grid '0 1'", "counted from 1", 1),
        ("join {in}/one.png {in}/two.png -o m.png --grid '1 9' --stages 1", "names motif 9", 1),
        ("join {in}/one.png nowhere.png -o m.png", "there is no file", 1),
        ("mockup nowhere.png --on tie -o m.png", "there is no file", 1),
        ("mockup {in}/one.png --on tie -o m.gif", "not supported", 1),
        ("mockup {in}/one.png --on tie -o m.png --motif-width 1mm", "use 2 mm", 1),
        ("mockup {in}/one.png --on wallpaper -o m.png --dpi 300", "ask for 1 to 51 dpi", 1),
        ("mockup {in}/one.png --on phone -o m.png --dpi 2", "ask for 8 to", 1),
        ("mockup {in}/one.png --on sock -o m.png", "--on", 2),
    ],
)
def test_bad_input(motifs, tmp_path, monkeypatch, toposeam, line, phrase, code):
    monkeypatch.chdir(tmp_path)
    toposeam(*shlex.split(line.replace("{in}", str(motifs)))).fails(phrase, code)
    assert not list(tmp_path.iterdir())


@pytest.mark.medium
def test_a_rule_that_joined_motifs_cannot_keep_is_told(tmp_path, toposeam):
    for rule in ("brick", "pmm"):
        for seed in ("1", "2"):
            line = (*SMALL, "--repeat", rule, "--palette", "sea", "--seed", seed)
            assert toposeam("motif", "-o", tmp_path / f"{rule}{seed}.png", *line).code == 0
        files = [tmp_path / f"{rule}{seed}.png" for seed in (1, 2)]
        ran = toposeam("join", *files, "-o", tmp_path / f"{rule}.png", "--sheet", "1x1", "--stages", "1")
        assert ran.code == 0
        assert ("not by brick" in ran.err) == (rule == "brick")
    cell = read_picture(tmp_path / "pmm.png").pixels
    np.testing.assert_array_equal(cell, cell[::-1])
