"""What people type instead of what is meant, and what they are answered."""

import re

import pytest

import toposeam as ts
from stitching import STRIP
from toposeam_cli.media.pictures.picture import read_picture

STITCH = "toposeam stitch a.png b.png"


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("a.png b.png -o c.jpg", f"{STITCH} -o c.jpg"),
        ("-o c.jpg a.png b.png", "toposeam stitch -o c.jpg a.png b.png"),
        ("a.png b.png", f"{STITCH} -o result.png"),
        ("a.png b.png c.tif", f"{STITCH} -o c.tif"),
        ("one.jpg two.jpg --overlap 20", "toposeam stitch one.jpg two.jpg --overlap 20 -o result.jpg"),
        ("help", "toposeam --help"),
        ("help tile", "toposeam tile --help"),
        ("stitch a.png b.png", f"{STITCH} -o result.png"),
        ("stitch a.png b.png new.png", f"{STITCH} -o new.png"),
        ("tile a.png", "toposeam tile a.png -o result.png"),
        ("loop clip.mp4 --scale 0.5", "toposeam loop clip.mp4 --scale 0.5 -o result.mp4"),
    ],
)
def test_the_very_line_to_type_is_said(folder, toposeam, typed, line):
    ran = toposeam(*typed.split())
    ran.fails("rite: ", 2)
    assert ran.err.endswith(f"rite: {line}\n")


def test_the_line_to_type_does_what_was_meant(folder, toposeam):
    line = toposeam("a.png", "b.png", "--overlap", "20").err.strip().rpartition("write: ")[2]
    assert toposeam(*line.split()[1:]).code == 0
    assert read_picture(folder / "result.png").pixels.shape == (40, 92, 3)


def test_a_name_with_a_space_is_quoted_in_it(folder, toposeam):
    (folder / "a.png").rename(folder / "a picture.png")
    assert "stitch 'a picture.png' b.png -o c.png" in toposeam("a picture.png", "b.png", "-o", "c.png").err


@pytest.mark.parametrize("name", ["a" * 400, "a" * 400 + ".png"])
def test_names_that_no_file_can_have_are_answered(folder, toposeam, name):
    toposeam("tile", name).fails("write: toposeam tile", 2)


def test_a_name_with_a_line_break_stays_on_one_line(folder, toposeam):
    (folder / "a.png").rename(folder / "a\nb.png")
    toposeam("tile", "a\nb.png").fails("write: toposeam tile 'a\\nb.png' -o result.png", 2)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("stich a.png b.png", "'stitch'"),
        ("STITCH a.png b.png", "'stitch'"),
        ("sinth a.png", "'synth'"),
        ("stitch a.png b.png --feather -o c.png", "'--blend feather'"),
        ("stitch a.png b.png --blur -o c.png", "'--blend'"),
    ],
)
def test_what_is_mistyped_is_guessed(folder, toposeam, typed, meant):
    toposeam(*typed.split()).fails(f"Did you mean {meant}?", 2)


def test_what_is_like_nothing_is_refused_without_a_guess(folder, toposeam):
    toposeam("frobnicate").fails("No such command 'frobnicate'.", 2)
    toposeam("a.png").fails("say what to do with a.png", 2)


@pytest.mark.parametrize(
    "words",
    [
        ["--size", "48", "32"],
        ["/size", "48x32"],
        ["--size=48x32"],
        ["-size", "48", "32"],
    ],
)
def test_two_numbers_are_a_size_and_other_signs_options(folder, toposeam, words):
    assert toposeam("synth", "a.png", *words, "--patch", "16", "-o=t.png").code == 0
    assert read_picture(folder / "t.png").pixels.shape == (32, 48, 3)


def test_two_numbers_are_an_offset_too(folder, toposeam):
    assert toposeam("stitch", "a.png", "b.png", "--offset", "36", "-3", "/o", "c.png").code == 0
    assert read_picture(folder / "c.png").pixels.shape == (43, 92, 3)


def test_a_second_number_that_is_a_file_stays_one(folder, toposeam):
    (folder / "64").write_bytes((folder / "b.png").read_bytes())
    assert toposeam("synth", "--size", "48", "64", "-o", "t.png", "--patch", "16").code == 0
    assert read_picture(folder / "t.png").pixels.shape == (48, 48, 3)


@pytest.mark.parametrize("words", [["/?"], ["/help"], ["-?"], ["tile", "/?"], ["stitch", "a.png", "/h"]])
def test_help_is_had_by_the_words_of_windows(toposeam, words):
    assert toposeam(*words).out.startswith("Usage: ")


def test_the_version_has_a_short_option(toposeam):
    assert toposeam("-V").out == toposeam("--version").out == f"toposeam, version {ts.__version__}\n"


def test_a_pattern_that_matches_nothing_is_named(folder, toposeam):
    toposeam("stitch", "*.jpg", "-o", "c.jpg").fails("no file matches '*.jpg'; check its folder")
    toposeam("tile", "*.png", "-o", "c.png").fails("'*.png' is in quotes")


@pytest.mark.parametrize(
    ("suffix", "hint"), [("jpg", "--crop outside --background white"), ("png", "--crop outside")]
)
def test_the_crop_of_a_result_says_how_to_keep_all(folder, toposeam, suffix, hint):
    out = f"c.{suffix}"
    cropped = toposeam("stitch", "a.png", "b.png", "--offset", "36,28", "--crop", "inside", "-o", out)
    assert "keeps all" not in cropped.out
    line = ["stitch", "a.png", "b.png", "--offset", "36,28", "--as", "photographs", "-o", out, "--force"]
    assert re.match(rf"{out}: only \d\d % kept, {hint} keeps all; ", toposeam(*line).out)
    assert toposeam(*line, *hint.split()).code == 0
    assert read_picture(folder / out).pixels.shape == (68, 92, 3)


def test_nothing_is_said_where_nothing_is_cropped(folder, toposeam):
    assert "keeps all" not in toposeam("stitch", *STRIP, "-o", "c.jpg").out
