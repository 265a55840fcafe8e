import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from processes import living
from skimage import data

import toposeam as ts
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.textures.maps import Maps

ASKED = ("--size", "90x70", "--patch", "32")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_picture(
        "moss.png", Picture(pixels=np.ascontiguousarray(data.coffee()[40:104, 10:80]), resolution=(4.0, 4.0))
    )
    write_picture(
        "normal.png",
        Picture(pixels=np.ascontiguousarray(data.astronaut()[40:104, 10:80]).astype(np.uint16) * 257),
    )
    write_picture("gray.tif", Picture(pixels=data.gravel()[:64, :70] / np.float32(255)))
    return tmp_path


def test_a_texture_is_grown_with_all_that_belongs_to_it(toposeam):
    ran = toposeam(
        "synth",
        "moss.png",
        *ASKED,
        "--also",
        "normal.png",
        "--tileable",
        "both",
        "--no-level",
        "-o",
        "big.png",
        "--seams",
        "seams.svg",
        "--labels",
        "labels.png",
        "--coordinates",
        "from.png",
    )
    assert ran.code == 0, ran
    big, normal, labels, place = (
        read_picture(name) for name in ("big.png", "big_normal.png", "labels.png", "from.png")
    )
    assert big.pixels.shape == normal.pixels.shape == (70, 90, 3)
    assert normal.pixels.dtype == np.uint16
    assert big.resolution == (4.0, 4.0)
    source, other = read_picture("moss.png").pixels, read_picture("normal.png").pixels
    column, row, exemplar = np.moveaxis(place.pixels, 2, 0)
    assert (exemplar == 0).all()
    # All but the mixed pixels at the seams are copies, from the same place in both maps.
    for made, given in ((big.pixels, source), (normal.pixels, other)):
        assert (made == given[row, column]).all(axis=2).mean() > 0.7
    count = len(np.unique(labels.pixels))
    assert 4 <= count <= 16
    start = f"big.png: 90 × 70 px, {count} patches of 32 × 32 px, joints are "
    assert ran.out.startswith(start)
    # Without mixing at the seams the coordinates alone tell everything; with it the border's wrapping has to
    # be told as well.
    again = toposeam(
        "synth", "moss.png", "--use-coordinates", "from.png", "--tileable", "both", "-o", "alike.png"
    )
    assert again.code == 0, again
    np.testing.assert_array_equal(read_picture("alike.png").pixels, big.pixels)
    assert (
        toposeam(
            "synth",
            "moss.png",
            *ASKED,
            "--also",
            "normal.png",
            "--no-level",
            "--tileable",
            "both",
            "-o",
            "again.png",
        )
    ).code == 0
    np.testing.assert_array_equal(read_picture("again.png").pixels, big.pixels)


def written(name, values, alpha=None):
    write_picture(name, Picture(pixels=np.ascontiguousarray(values), alpha=alpha))


def test_maps_keep_their_depth_format_and_values(toposeam):
    y, x = np.indices((64, 70))
    heights = (x * 0.9 - y * 0.1).astype(np.float32)  # in some unit: -6.3 to 62.1
    written("height.tif", heights)
    written("deep.png", (x * 900 + y).astype(np.uint16))
    written("packed.png", (y * 3).astype(np.uint8), (255 - x).astype(np.uint8))
    ran = toposeam(
        *("synth", "moss.png", *ASKED, "--no-level", "-o", "wall.jpg", "--coordinates", "from.png"),
        *("--also", "height.tif", "--also", "deep.png", "--also", "packed.png", "--normal", "normal.png"),
    )
    assert ran.code == 0, ran
    column, row, _ = np.moveaxis(read_picture("from.png").pixels, 2, 0)
    assert read_picture("wall.jpg").pixels.dtype == np.uint8
    np.testing.assert_array_equal(read_picture("wall_height.tif").pixels, heights[row, column])
    np.testing.assert_array_equal(read_picture("wall_deep.png").pixels, column.astype(np.uint16) * 900 + row)
    packed = read_picture("wall_packed.png")
    np.testing.assert_array_equal(packed.pixels, row * 3)
    np.testing.assert_array_equal(packed.alpha, 255 - column)
    assert read_picture("wall_normal.png").pixels.dtype == np.uint16


def test_heights_in_any_unit_count_by_their_range(folder):
    values = np.linspace(-8, 56, 64 * 70, dtype=np.float32).reshape(64, 70)
    files = [folder / f"{unit}.tif" for unit in ("metres", "shares")]
    for file, heights in zip(files, (values, values / 128), strict=True):
        written(file, heights)
    white = Maps.read(files, [], 1, 10**6).keywords(read_picture("moss.png"), None)["data_range"]
    assert white == [None, 64, 1]


def test_values_that_a_format_would_clip_are_refused_first(toposeam, folder):
    written("height.tif", np.linspace(-7.25, 58.3, 64 * 70, dtype=np.float32).reshape(64, 70))
    written("hole.png", np.uint8(255) * (np.indices((64, 70)).min(axis=0) > 55))
    for command in (
        ("synth", "height.tif", *ASKED),
        ("tile", "height.tif"),
        ("fill", "height.tif", "--mask", "hole.png"),
    ):
        ran = toposeam(*command, "-o", "o.png")
        assert ran.code == 1, ran
        assert (
            "cannot hold the values of height.tif, -7.25 to 58.3: .png ends at 0 and 1; write .tif" in ran.err
        )
    assert not (folder / "o.png").exists()


def test_holes_too_near_to_each_other_name_what_grows_them(toposeam):
    y, x = np.indices((64, 70))
    opaque = np.where((x // 5 + y // 5) % 2, 255, 0).astype(np.uint8)
    written("lace.png", (x * 3).astype(np.uint8), opaque)
    ran = toposeam("synth", "lace.png", *ASKED, "-o", "o.png")
    assert ran.code == 1
    assert "or --transparent where holes are part of it" in ran.err


def test_several_sources_of_unlike_depth_become_one_texture(toposeam):
    assert toposeam("synth", "moss.png", "gray.tif", *ASKED, "-o", "both.tif").code == 0
    assert read_picture("both.tif").pixels.dtype == np.float32
    assert read_picture("both.tif").pixels.shape == (70, 90, 3)


@pytest.mark.medium
def test_an_overlap_may_be_a_share_also_as_a_batch_default(toposeam, folder):
    alike = ("synth", "moss.png", *ASKED, "--coordinates")
    assert toposeam(*alike, "a_from.png", "--overlap", "50%", "-o", "a.png").code == 0
    assert toposeam(*alike, "b_from.png", "--overlap", "16", "-o", "b.png").code == 0
    np.testing.assert_array_equal(read_picture("a.png").pixels, read_picture("b.png").pixels)
    (folder / "jobs.toml").write_text(
        '[defaults]\noverlap = "25%"\n'
        '[[synth]]\nsources = ["moss.png"]\nsize = "80x60"\npatch = "24"\noutput = "c.png"\n'
        '[[fill]]\nimage = "moss.png"\nmask = "hole.png"\npatch = "24"\noutput = "d.png"\n',
        encoding="utf-8",
    )
    hole = np.zeros((64, 70), np.uint8)
    hole[20:30, 20:30] = 255
    write_picture("hole.png", Picture(pixels=hole))
    ran = toposeam("batch", "jobs.toml")
    assert ran.code == 0, ran
    assert read_picture("c.png").pixels.shape == (60, 80, 3)
    assert read_picture("d.png").pixels.shape == (64, 70, 3)


def test_lights_above_white_in_a_file_of_floats_are_kept(toposeam):
    write_picture("lights.tif", Picture(pixels=data.gravel()[:64, :70] / np.float32(20)))
    assert toposeam("synth", "lights.tif", *ASKED, "-o", "o.tif").code == 0
    assert read_picture("o.tif").pixels.max() > 3


def test_how_patches_are_chosen_and_cut_can_be_said(toposeam):
    ran = toposeam(
        "synth",
        "moss.png",
        *ASKED,
        "--method",
        "shortest-path",
        "--candidates",
        "1",
        "--context",
        "0",
        "--most",
        "5",
        "--variety",
        "0",
        "-o",
        "o.png",
        "--seams",
        "seams.svg",
    )
    assert ran.code == 0, ran
    assert '"method": "shortest-path"' in Path("seams.svg").read_text(encoding="utf-8")
    toposeam("synth", "moss.png", *ASKED, "--method", "magic", "-o", "p.png").fails("magic", 2)


def test_light_is_levelled_or_taken_out_when_told(toposeam):
    for name, words in (("a", ()), ("b", ("--level",)), ("c", ("--no-level",)), ("d", ("--flatten",))):
        assert toposeam("synth", "moss.png", *ASKED, *words, "-o", f"{name}.png").code == 0
    a, b, c, d = (read_picture(f"{name}.png").pixels.astype(float) for name in "abcd")
    np.testing.assert_array_equal(a, b)  # the sample has slow light
    assert (a != c).any()
    assert (c != d).any()


def test_a_mask_and_a_guide_are_read_from_pictures(toposeam):
    mask = np.zeros((64, 70), np.uint8)
    mask[:, :40] = 255
    write_picture("mask.png", Picture(pixels=mask))
    assert (
        toposeam(
            "synth", "moss.png", *ASKED, "--from", "mask.png", "--coordinates", "from.png", "-o", "a.png"
        ).code
        == 0
    )
    assert read_picture("from.png").pixels[..., 0].max() < 40
    write_picture("guide.png", Picture(pixels=np.tile(np.linspace(0, 255, 90).astype(np.uint8), (70, 1))))
    ran = toposeam(
        "synth",
        "gray.tif",
        *ASKED,
        "--patch",
        "16",
        "--guide",
        "guide.png",
        "--guide-source",
        "gray.tif",
        "--guide-weight",
        "0.9",
        "-o",
        "b.png",
    )
    assert ran.code == 0, ran
    made = read_picture("b.png").pixels
    assert made[:, 45:].mean() > made[:, :45].mean() * 1.1


@pytest.mark.medium
def test_an_ordered_texture_takes_the_size_on_which_it_closes(toposeam):
    y, x = np.mgrid[:120, :130]
    checks = np.where((x // 10 + y // 12) % 2, 40, 210) + np.random.default_rng(0).integers(0, 9, x.shape)
    write_picture("checks.png", Picture(pixels=checks.astype(np.uint8)))
    asked = ("synth", "checks.png", "--tileable", "both", "--patch", "40", "-o", "o.png", "--force")
    ran = toposeam(*asked, "--size", "auto:150x130")
    assert ran.code == 0, ran
    assert read_picture("o.png").pixels.shape == (120, 140)
    assert "stretched" not in ran.out
    ran = toposeam(*asked, "--size", "150x130")
    assert ran.code == 0
    assert read_picture("o.png").pixels.shape == (130, 150)
    assert "a size that suits it is 140 × 120 px (--size auto:150x130)" in ran.out
    assert toposeam(*asked, "--size", "auto").code == 0
    assert read_picture("o.png").pixels.shape == (240, 260)
    opaque = np.where(x < 60, 255, 0).astype(np.uint8)
    hidden = np.where(opaque > 0, checks, np.where((x // 7 + y // 17) % 2, 20, 230))
    write_picture("checks.png", Picture(pixels=hidden.astype(np.uint8), alpha=opaque), force=True)
    assert toposeam(*asked, "--size", "auto:150x130").code == 0
    assert read_picture("o.png").pixels.shape[0] == 120  # what is transparent has another order


@pytest.mark.medium
def test_sources_show_on_the_shares_asked_for(toposeam):
    asked = ("synth", "moss.png", "gray.tif", "--size", "150x140", "--patch", "24", "-o", "o.png", "--force")
    parts = []
    for shares in ("4,1", "1,4"):
        assert toposeam(*asked, "--coordinates", "c.png", "--shares", shares).code == 0
        parts.append((read_picture("c.png").pixels[..., 2] == 0).mean())
    assert parts[0] > 0.7
    assert parts[1] < 0.3


def test_turned_patches_can_be_cut_again_from_another_picture(toposeam):
    asked = ("--turns", "all", "--smooth", "0")
    size = ("--size", "150x140", "--patch", "24", "--no-level")
    assert toposeam("synth", "moss.png", *size, *asked, "-o", "o.png", "--coordinates", "c.png").code == 0
    assert read_picture("c.png").pixels[..., 2].max() > 3
    assert toposeam("synth", "moss.png", "--use-coordinates", "c.png", *asked, "-o", "p.png").code == 0
    assert (read_picture("o.png").pixels == read_picture("p.png").pixels).all()


def test_a_texture_is_shown_while_it_grows(toposeam):
    asked = (
        "synth",
        "moss.png",
        "--size",
        "600x40",
        "--patch",
        "32",
        "-o",
        "o.png",
        "--preview",
        "small.png",
    )
    assert toposeam(*asked).code == 0
    shown, made = read_picture("small.png").pixels, read_picture("o.png").pixels
    assert shown.shape == (20, 300, 3)
    assert made.shape == (40, 600, 3)
    again = toposeam(*asked[:-2], "--force", "--preview", "o.png")
    assert again.code == 1
    assert "two outputs have the same name" in again.err
    assert "small.png" in toposeam(*asked[:7], "p.png", *asked[8:]).err  # it is there already


def test_opacity_is_grown_along(toposeam):
    opaque = np.where((np.mgrid[:64, :70][0] % 12 < 5) | (np.mgrid[:64, :70][1] % 16 < 6), 255, 0)
    pixels = read_picture("moss.png").pixels
    write_picture("lace.png", Picture(pixels=pixels, alpha=opaque.astype(np.uint8)))
    assert toposeam("synth", "lace.png", *ASKED, "-o", "o.png").code == 1
    assert toposeam("synth", "lace.png", *ASKED, "--transparent", "-o", "o.png").code == 0
    assert 0.3 < (read_picture("o.png").alpha > 127).mean() < 0.8


def test_the_line_names_the_setting_that_was_chosen(toposeam):
    size = ("--size", "60x50")
    ran = toposeam("synth", "moss.png", *size, "-o", "o.png")
    assert re.search(r" patch(es)? of \d+ × \d+ px, setting (coarse|fine|varied)\S*, joints are ", ran.out)
    told = json.loads(toposeam("synth", "moss.png", *size, "-o", "p.png", "--json").out)
    assert told["size"] == [60, 50]
    assert set(told) == {
        "output",
        "size",
        "patches",
        "patch",
        "setting",
        "lattice",
        "joints",
        "shown",
        "look_at",
        "tried",
    }
    assert set(told["tried"]) <= set(ts.texture.SETTINGS)
    named = toposeam(
        "synth", "moss.png", *size, "-o", "q.png", "--setting", told["setting"], "--context", "8"
    )
    assert f"setting {told['setting']}," in named.out
    assert (read_picture("q.png").pixels == read_picture("o.png").pixels).all()


def test_a_lattice_is_written_across_and_down(toposeam):
    asked = ("synth", "moss.png", "--size", "60", "--setting", "fine", "-o", "o.png", "--force", "--lattice")
    assert toposeam(*asked, "24x16,-8").code == 0
    source = read_picture("moss.png").pixels
    made = ts.synthesize(source, 60, setting="fine", lattice=(16, 24, -8)).image
    assert (read_picture("o.png").pixels == made).all()
    for wrong in ("24", "axb", "24x2", "0x0"):
        ran = toposeam(*asked, wrong)
        assert ran.code != 0
        assert "lattice" in ran.err
    closing = ("synth", "moss.png", "--tileable", "both", "-o", "p.png", "--setting", "fine")
    ran = toposeam(*closing, "--size", "auto:70x50", "--lattice", "24x16")
    assert read_picture("p.png").pixels.shape == (48, 72, 3)


@pytest.mark.parametrize("given", [("--variety", "1"), ("--patch", "24"), ("--variation", "0.2")])
def test_a_setting_stands_for_what_it_is_made_of(toposeam, given):
    ran = toposeam("synth", "moss.png", "--size", "60", "--setting", "fine", *given, "-o", "o.png")
    assert ran.code == 1
    assert given[0] in ran.err
    assert "--setting" in ran.err
    assert len(ran.err.strip().splitlines()) == 1


@pytest.mark.parametrize("given", [("--variety", "1"), ("--most", "2"), ("--tolerance", "0")])
def test_variation_stands_for_what_it_is_made_of(toposeam, given):
    ran = toposeam("synth", "moss.png", *ASKED, "--variation", "0.3", *given, "-o", "o.png")
    assert ran.code == 1
    assert f"{given[0]} changes nothing with --variation" in ran.err
    assert (
        toposeam("synth", "moss.png", *ASKED, "--variation", "0.3", "--context", "4", "-o", "o.png").code == 0
    )


@pytest.mark.parametrize(
    ("arguments", "phrase", "code"),
    [
        (("moss.png", "--size", "90", "--shares", "1,2", "-o", "o.png"), "--shares has length 2 for 1", 1),
        (("moss.png", "--size", "auto", "-o", "o.png"), "add --tileable", 1),
        (("moss.png", "--size", "auto:none", "--tileable", "x", "-o", "o.png"), "is not a size", 2),
        (("moss.png", "--size", "auto:99999999", "--tileable", "x", "-o", "o.png"), "more than", 1),
        (("moss.png", "--size", "90x70", "--patch", "65", "-o", "o.png"), "smaller than a patch", 1),
        (("moss.png", "--size", "90x70", "--overlap", "40", "-o", "o.png"), "overlap is 40", 1),
        (("thin.png", "--size", "90x70", "--patch", "40", "-o", "o.png"), "smaller than a patch of 40", 1),
        (("moss.png", "--size", "90x70", "-o", "o.png", "--labels", "l.jpg"), "'.jpg' is not supported", 1),
        (("moss.png", "--size", "0x70", "-o", "o.png"), "is not a size", 2),
        (("moss.png", "--size", "big", "-o", "o.png"), "is not a size", 2),
        (("moss.png", "--size", "100000000x90", "-o", "o.png"), "more than", 1),
        (("moss.png", "--size", "90", "--patch", "small", "-o", "o.png"), "not a patch size", 2),
        (("moss.png", "--size", "90", "--weights", "a,b", "-o", "o.png"), "not a list of weights", 2),
        (
            ("moss.png", "--size", "90", "--weights", "1,2", "-o", "o.png"),
            "2 --weights were given for the picture",
            1,
        ),
        (("none.png", "--size", "90", "-o", "o.png"), "none.png", 1),
        (
            ("moss.png", "gray.tif", "--size", "90", "--also", "normal.png", "-o", "o.png"),
            "once for every source",
            1,
        ),
        (("moss.png", "--size", "90", "--also", "small.png", "-o", "o.png"), "small.png is 8 × 8 px", 1),
        (
            ("moss.png", "--size", "90", "--from", "small.png", "-o", "o.png"),
            "the mask small.png is 8 × 8 px",
            1,
        ),
        (("moss.png", "--size", "90", "--from", "black.png", "-o", "o.png"), "--from is empty", 1),
        (("moss.png", "--size", "90", "--guide", "black.png", "-o", "o.png"), "belong together", 1),
        (("moss.png", "-o", "o.png"), "--size", 1),
        (("moss.png", "--use-coordinates", "moss.png", "-o", "o.png"), "holds no coordinates", 1),
        (("moss.png", "--use-coordinates", "normal.png", "-o", "o.png"), "point beyond", 1),
        (("black.png", "--size", "90", "-o", "o.png"), "one value everywhere", 1),
        (("moss.png", "--size", "90", "-o", "moss.png"), "--force", 1),
        (("moss.png", "--size", "90", "-o", "o.xyz"), "not supported", 1),
        (("moss.png", "--size", "90", "-o", "o.png", "--labels", "o.png"), "same name", 1),
    ],
)
def test_bad_input_ends_in_one_sentence_and_leaves_nothing(toposeam, folder, arguments, phrase, code):
    write_picture("small.png", Picture(pixels=np.zeros((8, 8), np.uint8)))
    write_picture("thin.png", Picture(pixels=np.arange(300, dtype=np.uint16).reshape(3, 100)))
    write_picture("black.png", Picture(pixels=np.zeros((64, 70), np.uint8)))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    toposeam("synth", *arguments).fails(phrase, code)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.medium
def test_several_processes_make_the_same_file(toposeam):
    for count in (1, 2):
        ran = toposeam("synth", "moss.png", *ASKED, "--tileable", "x", "-j", count, "-o", f"{count}.png")
        assert ran.code == 0, ran
    assert Path("1.png").read_bytes() == Path("2.png").read_bytes()
    assert toposeam("synth", "moss.png", *ASKED, "-j", 0, "-o", "0.png").code == 2


def with_another(child):
    """The process that a command has forked, when it has."""
    while child.poll() is None:
        others = [process.number for process in living() if process.parent == child.pid]
        if others:
            return others[0]
        time.sleep(0.02)
    raise AssertionError(child.communicate())


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="nobody tells of processes as Linux does")
@pytest.mark.parametrize("ends", ["ctrl-c", "killed"])
def test_processes_that_share_a_texture_end_without_a_trace(process, ends):
    words = ["synth", "moss.png", "--size", "3000", "--patch", "24", "-j", "2", "-q", "-o", "huge.png"]
    with process(*words, stderr=subprocess.PIPE, text=True, start_new_session=True) as child:
        other = with_another(child)
        if ends == "ctrl-c":
            os.killpg(child.pid, signal.SIGINT)
        else:
            os.kill(other, signal.SIGKILL)
        _, told = child.communicate(timeout=300)
    assert child.returncode in ((130, -signal.SIGINT) if ends == "ctrl-c" else (1,))
    assert "Traceback" not in told
    if ends == "killed":
        assert told.startswith("Error: a process that worked on the texture was killed")
        assert told.count("\n") == 1
    assert not [one for one in living() if one.group == child.pid]
    assert not list(Path().rglob(".toposeam-*"))
    assert not Path("huge.png").exists()


def test_a_preview_of_what_is_never_finished_goes(toposeam, folder, monkeypatch):
    import toposeam as ts

    def interrupted(*_, preview, **__):
        preview(np.zeros((9, 9, 3), np.uint8))
        assert Path("p.png").exists()
        raise KeyboardInterrupt

    monkeypatch.setattr(ts, "synth", interrupted)
    ran = toposeam("synth", "moss.png", *ASKED, "-o", "out.png", "--preview", "p.png")
    assert ran.code == 130
    assert not Path("p.png").exists()
