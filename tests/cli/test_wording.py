"""What core says of its parameters reaches the user as the files and options they have written."""

import ast
import re
from pathlib import Path

import click
import numpy as np
import pytest

import toposeam as ts
from toposeam_cli.app.registry import speaking
from toposeam_cli.media.pictures.picture import Picture, write_picture

ROOT = Path(__file__).parents[2]
#: What only who writes Python knows.
PYTHON = re.compile(
    r"\b(?:map \d|patch [ab]\b|exemplar|array|dtype|max_megapixels|data_range|source_mask|mask_[ab])|\w=|'x'"
)


@pytest.fixture
def some(folder, photographs):
    """Pictures with little to go on, beside a.png and b.png of 56 × 40 px or so."""
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (60, 80, 3)).astype(np.uint8)
    clear = np.zeros((60, 80), np.uint8)
    write_picture(folder / "noise.png", Picture(pixels=noise))
    write_picture(folder / "more.png", Picture(pixels=noise[::-1].copy()))
    write_picture(folder / "small.png", Picture(pixels=noise[:30, :30].copy()))
    write_picture(folder / "dot.png", Picture(pixels=noise[:2, :2].copy()))
    write_picture(folder / "plain.png", Picture(pixels=np.full_like(noise, 9)))
    write_picture(folder / "clear.png", Picture(pixels=noise, alpha=clear))
    write_picture(folder / "white.png", Picture(pixels=np.full_like(clear, 255)))
    write_picture(folder / "black.png", Picture(pixels=clear))
    thread = clear.copy()
    thread[30] = 255
    write_picture(folder / "thread.png", Picture(pixels=thread))
    hole = clear.copy()
    hole[20:40, 20:40] = 255
    write_picture(folder / "hole.png", Picture(pixels=hole))
    (folder / "short.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="120" height="60" viewBox="0 0 120 60">'
        '<path d="M 60 -1 L 60 30 L 130 30"/></svg>'
    )
    return folder


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            "fill noise.png --mask hole.png --also small.png",
            "small.png is 30 × 30 px, but noise.png 80 × 60 px",
        ),
        ("tile noise.png --also small.png", "small.png is 30 × 30 px, but noise.png 80 × 60 px"),
        (
            "synth noise.png more.png --size 64 --also noise.png --also small.png",
            "noise.png or small.png is 30 × 30 px, but more.png 80 × 60 px",
        ),
        ("synth noise.png --size 64 --also small.png", "30 × 30 px, but noise.png 80 × 60 px"),
        ("tile plain.png", "plain.png has one value everywhere"),
        ("synth plain.png --size 64", "plain.png has one value everywhere"),
        ("tile noise.png --band 1", "--band is 1; for 80 × 60 px"),
        ("synth noise.png --size 64 --patch 2", "--patch is 2; it must be"),
        ("synth noise.png --size 64 --patch 9 --overlap 9", "--overlap is 9 with patches of 9 px"),
        ("synth small.png --size 64 --patch 31", "small.png is 30 × 30 px, smaller than a patch of 31 px"),
        (
            "synth noise.png --size 64 --from black.png",
            "nothing of noise.png may be sampled: --from is empty",
        ),
        ("synth noise.png --size 64 --from thread.png --patch 16", "no place in --from has room"),
        ("synth clear.png --size 64", "clear.png is transparent everywhere"),
        ("synth noise.png --size 64 --from thread.png", "px; use a larger mask"),
        ("tile clear.png", "clear.png is transparent everywhere"),
        ("tile clear.png --size auto", "clear.png is transparent everywhere"),
        ("tile dot.png", "dot.png is 2 × 2 px; to repeat it needs at least 32 px a side"),
        (
            "synth noise.png --size 64 --weights 1,1",
            "2 --weights were given for the picture and 0 further maps",
        ),
        ("synth noise.png more.png --size 64 --shares 1", "--shares has length 1 for 2 pictures"),
        ("synth noise.png more.png --size 64 --shares 1,0", "one of --shares is 0"),
        ("fill noise.png --mask black.png", "black.png is empty"),
        ("fill noise.png --mask white.png", "white.png covers the whole picture"),
        (
            "fill noise.png --mask hole.png --by shifts --patch 8",
            "--patch and --overlap say how large patches are; leave them out with --by shifts",
        ),
        (
            "stitch noise.png more.png dot.png --at 0,0 --at 40,0 --at 500,0",
            "dot.png (at 500,0): the pictures do",
        ),
        ("compare noise.png more.png --offset 0,0", "nothing divides the pictures"),
        (
            "stitch noise.png more.png --offset 0,0 --use-seam short.svg",
            "nothing divides the pictures",
        ),
        (
            "stitch noise.png more.png --overlap 40 --use-seam short.svg",
            "the path does not separate the pictures",
        ),
        (
            "stitch noise.png more.png --overlap 40 --use-seam short.svg",
            "of an edge of more.png the path leaves its ground",
        ),
        ("motif --size 32 --strengths 2,1", "--strengths is"),
        ("motif --size 32 --palette nope", "--palette 'nope' is not known; choose one of spring"),
        ("loop noise.png", "noise.png holds one frame"),
    ],
)
def test_files_and_options_are_called_as_they_were_given(toposeam, some, words, told):
    output = [] if words.startswith("compare") else ["-o", "o.gif" if words.startswith("loop") else "o.png"]
    ran = toposeam(*words.split(), *output)
    ran.fails(told)
    assert not PYTHON.search(ran.err), ran.err
    if "--from" not in words and "mask" not in words:
        assert "mask" not in ran.err


def test_a_drawn_sheet_is_called_by_its_option(toposeam, tmp_path):
    toposeam("motif", "--size", "32", "--sheet", "2x99999", "-o", tmp_path / "o.svg").fails(
        "--sheet is 99999"
    )


def test_a_solid_calls_its_rule_by_the_option(toposeam, tmp_path):
    words = ("motif", "--size", "16", "--depth", "16", "--repeat", "p6")
    toposeam(*words, "-o", tmp_path / "o.stl").fails("--repeat p6 has no block; use one of")


def test_what_a_file_says_is_called_by_its_name_there(toposeam, tmp_path):
    (tmp_path / "a.toml").write_text("size = 16\npalette = 'nope'\n")
    ran = toposeam("motif", "--config", tmp_path / "a.toml", "-o", tmp_path / "o.png")
    ran.fails("Error: palette 'nope' is not known")


def test_jobs_of_a_batch_speak_so_too(toposeam, some):
    (some / "jobs.toml").write_text("[[tile]]\nimage = 'noise.png'\noutput = 'o.png'\nband = 1\n")
    ran = toposeam("batch", "jobs.toml")
    assert "o.png: --band is 1; for 80 × 60 px" in ran.err


def test_what_the_command_line_says_itself_stays(toposeam, some):
    toposeam("fill", "noise.png", "--mask", "small.png", "-o", "o.png").fails(
        "the mask small.png is 30 × 30 px, but noise.png is 80 × 60 px"
    )


def test_an_error_that_is_its_own_cause_is_told_once():
    @click.command()
    def command():
        error = ts.PathError("the path is bent; straighten it")
        raise error from error

    with pytest.raises(ts.PathError, match="the path is bent"):
        speaking(command).main([], standalone_mode=False)


def test_names_of_files_come_through_unharmed(toposeam, some):
    noise = (some / "noise.png").read_bytes()
    for name in ("patch 1.png", "patch b.png", "my patches.png", "{patch} map 1.png", "band is 1.png"):
        (some / name).write_bytes(noise)
    (some / "patch a.png").write_bytes((some / "more.png").read_bytes())
    places = "--at", "0,0", "--at", "40,0", "--at", "500,0"
    for name in ("patch b.png", "my patches.png", "{patch} map 1.png"):
        ran = toposeam("stitch", "patch 1.png", "patch a.png", name, *places, "-o", "o.png")
        ran.fails(f"Error: {name} (at 500,0): the pictures do not overlap")
    (some / "plain band is 1.png").write_bytes((some / "plain.png").read_bytes())
    toposeam("tile", "plain band is 1.png", "-o", "o.png").fails(
        "Error: plain band is 1.png has one value everywhere"
    )
    toposeam("synth", "{patch} map 1.png", "--size", "64", "--also", "small.png", "-o", "o.png").fails(
        "30 × 30 px, but {patch} map 1.png 80 × 60 px"
    )


def test_names_of_unplaced_files_are_reported_unchanged(toposeam, some):
    rng = np.random.default_rng(1)
    for name in ("patch b.png", "my patches.png"):
        write_picture(some / name, Picture(pixels=rng.integers(0, 256, (60, 80, 3)).astype(np.uint8)))
    toposeam("stitch", "a.png", "patch b.png", "my patches.png", "-o", "o.png").fails(
        "Error: patch b.png and my patches.png fit none of the other pictures"
    )


def test_values_come_through_unharmed(toposeam, some):
    toposeam(
        "synth", "noise.png", "--size", "64", "--patch", "9", "--overlap", "9", "-o", "{overlap}.png"
    ).fails("--overlap is 9 with patches of 9 px")


def test_nothing_searches_the_text_of_an_error():
    for folder in ("cli", "plugin_gimp"):
        for file in (ROOT / folder).rglob("*.py"):
            tree = ast.parse(file.read_text(encoding="utf-8"))
            for node in ast.walk(tree):
                assert not _searches_an_error(node), f"{file}:{node.lineno}"
    for file in ("cli/toposeam_cli/app/terms.py", "plugin_gimp/toposeam_gimp/sentences.py"):
        assert "import re" not in (ROOT / file).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("code", "searches"),
    [
        ("re.sub('patch', 'picture', str(error))", True),
        ("_PATTERN.search(f'{error}')", True),
        ("re.match(pattern, told['message'])", True),
        ("re.match(pattern, path.name)", False),
        ("found.split(str(error))", False),
    ],
)
def test_what_searches_the_text_of_an_error_is_seen(code, searches):
    assert any(map(_searches_an_error, ast.walk(ast.parse(code)))) == searches


def _searches_an_error(node):
    """Whether it is a call of a regular expression on an error's text."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
        return False
    if node.func.attr not in {"match", "search", "fullmatch", "sub", "subn", "findall", "finditer"}:
        return False
    inside = [part for argument in node.args for part in ast.walk(argument)]
    return any(
        (isinstance(part, ast.Name) and part.id in {"error", "failure", "exception", "said", "sentence"})
        or (isinstance(part, ast.Constant) and part.value == "message")
        for part in inside
    )
