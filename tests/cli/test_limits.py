"""What is small and unpacks to much is refused by its header: in one sentence that names the limit, within
little time and memory; and what was silently wrong is said.
"""

import json
import os
import struct
import subprocess
import sys
import zipfile
import zlib
from html import escape

import numpy as np
import pytest

from toposeam_cli.media.pictures.openraster import read_ora
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.motifs.recipe_files import read_settings, to_xmp

#: The most memory of a command that refuses, MiB: the libraries take 70 to 90 of it. It takes a second, also
#: of the libraries; what would take longer has to do with pixels, and shows in the memory.
MIB = 200


def plain_png(width, height):
    """A PNG in one colour that is much smaller than what it unpacks to."""

    def chunk(kind, content):
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    packed = zlib.compressobj(9)
    rows = bytes(100 * (width + 1))
    content = b"".join([*(packed.compress(rows) for _ in range(height // 100)), packed.flush()])
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", content) + chunk(b"IEND", b"")


@pytest.fixture(scope="session")
def large(tmp_path_factory):
    """A picture of 100 megapixels, of which 100 kB are stored."""
    path = tmp_path_factory.mktemp("large") / "large.png"
    path.write_bytes(plain_png(10_000, 10_000))
    return path


def refused(folder, words, phrase, code=1):
    """It fails with a sentence, and without having made anything large."""
    script = (
        "import resource, subprocess, sys\n"
        "done = subprocess.run([sys.executable, '-m', 'toposeam_cli', *sys.argv[1:]])\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(done.returncode, used.ru_maxrss / 1024)"
    )
    before = sorted(path.name for path in folder.iterdir())
    ran = subprocess.run(
        [sys.executable, "-c", script, *words], cwd=folder, capture_output=True, text=True, check=False
    )
    ended, mib = ran.stdout.split()
    assert phrase in ran.stderr, ran.stderr
    assert "went wrong inside" not in ran.stderr
    assert ran.stderr.count("Error:") == 1
    assert int(ended) == code
    assert float(mib) < MIB
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.fixture
def motif(toposeam, folder):
    """A motif of 32 × 32 px, m.png, and another, n.png."""
    for name, seed in (("m.png", 1), ("n.png", 2)):
        words = ["motif", "-o", name, "--size", "32", "--iterations", "2", "--layers", "1", "--seed", seed]
        assert toposeam(*words).code == 0
    return folder


@pytest.mark.medium
@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        ("motif --size 99999x99999", "--size is 99999; it must be a whole number between 8 and 8192"),
        ("repeat m.png 999999x1", "31,999,968 × 32 px, 400,000,000 in all at most; ask for fewer motifs"),
        ("repeat m.png 9999x9999", "400,000,000 in all at most; ask for fewer motifs"),
        ("repeat a.png 3x3 --repeat p6m --cell 100000", "ask for fewer motifs, or smaller ones with --cell"),
        ("join m.png n.png --sheet 1000x1000", "more than 400,000,000 px; ask for fewer"),
        ("join m.png n.png --sheet 9x9 --motif-pixels 8192", "400,000,000 pixels at most"),
        (f"join m.png n.png --grid {'9' * 40}", "--grid has a number of 40 digits"),
        ("synth a.png --size 100000x100000", "more than 72 megapixels"),
        ("synth a.png --size 64 --patch 99999999", "smaller than a patch of 99999999 px"),
        ("stitch a.png b.png --at 0,0 --at 999999,999999", "lies beside"),
    ],
)
def test_what_would_be_too_large_is_refused_before_it_is_begun(motif, words, phrase):
    refused(motif, [*words.split(), "-o", "o.png"], phrase)


@pytest.mark.medium
@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        ("stitch a.png b.png --overlap 20 --avoid LARGE -o o.png", "but the canvas is 92 × 40 px"),
        (
            "stitch LARGE LARGE LARGE LARGE LARGE LARGE --column --overlap 9 -o o.png",
            "raise --max-megapixels",
        ),
        ("compare LARGE a.png --overlap 10 --max-megapixels 64", "raise --max-megapixels"),
        ("fill a.png --mask LARGE -o o.png", "raise --max-megapixels"),
        ("synth a.png --use-coordinates LARGE -o o.png", "raise --max-megapixels"),
        ("synth a.png --guide LARGE --guide-source a.png --size 64 -o o.png", "raise --max-megapixels"),
        ("repeat LARGE 2x2 -o o.png", "holds no recipe"),
        ("repeat LARGE 2x2 --repeat translate -o o.png", "megapixels allowed; make it smaller first"),
        ("mockup LARGE --on tie --repeat p1 -o o.png", "megapixels allowed; make it smaller first"),
        ("motif --base LARGE --size 32 -o o.png", "megapixels allowed; make it smaller first"),
        ("motif --like LARGE -o o.png", "holds no recipe"),
        ("path LARGE --from 0,0 --to 9,9 -o o.svg", "megapixels allowed; make it smaller first"),
        ("loop LARGE -o o.gif", "holds one frame"),
    ],
)
def test_an_oversized_auxiliary_picture_is_not_decoded(folder, photographs, large, words, phrase):
    refused(folder, [str(large) if word == "LARGE" else word for word in words.split()], phrase)


@pytest.mark.medium
def test_a_narrow_picture_on_a_product_needs_little_memory(toposeam, folder):
    pixels = np.random.default_rng(0).integers(0, 256, (100_000, 1, 3)).astype(np.uint8)
    write_picture(folder / "thread.png", Picture(pixels=pixels))
    words = ["mockup", "thread.png", "--on", "tie", "--repeat", "p1", "-o", "o.png"]
    script = (
        "import resource, subprocess, sys\n"
        "subprocess.run([sys.executable, '-m', 'toposeam_cli', *sys.argv[1:]])\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script, *words], cwd=folder, capture_output=True, text=True, check=True
    )
    assert float(ran.stdout.split()[-1]) < 2 * MIB, ran.stderr
    assert (folder / "o.png").exists()


@pytest.mark.medium
@pytest.mark.parametrize(
    ("change", "phrase"),
    [
        ({"print": {"counts": [999999, 1]}}, "400,000,000"),
        ({"recipe": {"size": [10**6, 10**6]}}, "between 8 and 8192"),
        ({"recipe": {"size": [float("inf"), 32]}}, ""),
        ({"recipe": {"iterations": 10**9}}, "iterations"),
        ({"recipe": {"iterations": float("inf")}}, "iterations"),
        ({"recipe": {"iterations": float("nan")}}, "iterations"),
        ({"recipe": {"filter_radius": float("inf")}}, "filter_radius"),
    ],
    ids=repr,
)
@pytest.mark.parametrize("command", ["motif --like", "repeat"])
def test_recipes_that_ask_for_too_much(motif, change, phrase, command):
    if command == "repeat" and "print" in change:
        pytest.skip("it is told how many on the command line")
    settings = read_settings(motif / "m.png")
    for part, values in change.items():
        settings[part] = {**settings.get(part, {}), **values}
    text = escape(json.dumps(settings), quote=False)
    plain = to_xmp({}).decode().replace(">{}<", f">{text}<").encode()
    pixels = np.zeros((32, 32, 3), np.uint8)
    write_picture(motif / "bad.png", Picture(pixels=pixels, xmp=plain))
    words = [*command.split(), "bad.png", *(["2x2"] if command == "repeat" else []), "-o", "o.png"]
    refused(motif, [*words, "--dpi", "300"] if command == "repeat" else words, phrase)


@pytest.mark.medium
def test_many_layers_of_one_large_picture(folder, photographs, large):
    with zipfile.ZipFile(folder / "bomb.ora", "w") as archive:
        archive.writestr("mimetype", "image/openraster")
        archive.write(large, "data/0.png")
        layers = "".join(f"<layer name='{n}' src='data/0.png' x='{n}' y='0'/>" for n in range(1000))
        archive.writestr("stack.xml", f"<image w='1' h='1'><stack>{layers}</stack></image>")
    refused(folder, ["stitch", "bomb.ora", "-o", "o.png"], "1000 pictures have 100000 megapixels together")


@pytest.mark.medium
def test_a_layout_of_large_pictures(folder, photographs, large):
    text = "".join(f"[[layer]]\nfile='{large}'\nat=[{n}, 0]\nname='{n}'\n" for n in range(6))
    (folder / "six.toml").write_text(text)
    refused(folder, ["stitch", "six.toml", "-o", "o.png"], "raise --max-megapixels")
    (folder / "many.toml").write_text("[[layer]]\nfile='a.png'\nat=[0, 0]\n" * 1001)
    refused(folder, ["stitch", "many.toml", "-o", "o.png"], "1001 layers")


@pytest.mark.medium
@pytest.mark.parametrize(
    "words",
    [
        ["tile", "LARGE", "-o", "o.png"],
        ["synth", "LARGE", "--size", "64x64", "-o", "o.png"],
        ["synth", "a.png", "--also", "LARGE", "--size", "64x64", "-o", "o.png"],
        ["fill", "LARGE", "--mask", "a.png", "-o", "o.png"],
        ["compare", "LARGE", "a.png", "--overlap", "20"],
    ],
    ids=lambda words: words[0],
)
def test_a_picture_too_large_for_texture_memory_is_refused(folder, photographs, large, words):
    refused(folder, [str(large) if word == "LARGE" else word for word in words], "raise --max-megapixels")


@pytest.mark.parametrize(
    ("name", "text", "phrase"),
    [
        ("nul.toml", '[[layer]]\nfile = "a\\u0000.png"\nat = [0, 0]\n', "the character NUL"),
        ("digits.toml", f"[[layer]]\nfile = 'a.png'\nat = [0, {'9' * 5001}]\n", "thousands of digits"),
        (
            "digits.json",
            '{"layer": [{"file": "a.png", "at": [0, ' + "9" * 5001 + "]}]}",
            "thousands of digits",
        ),
        ("deep.toml", "a = " + "[" * 3000 + "]" * 3000, "too deep"),
        ("deep.json", "[" * 100_000, "too deep"),
        ("rather.json", "[" * 40 + "]" * 40, "too deep"),
        ("long.toml", "#" * (5 * 2**20), "larger than {most} MiB"),
        ("latin.toml", b"# \xe9", "not UTF-8 (at line 1)"),
    ],
)
@pytest.mark.parametrize("command", ["stitch", "batch"])
def test_tables_with_more_than_anybody_writes(toposeam, folder, photographs, command, name, text, phrase):
    if command == "batch" and name.endswith(".json"):
        pytest.skip("jobs are TOML")
    (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    words = ["batch", name] if command == "batch" else ["stitch", name, "-o", "o.png"]
    ran = toposeam(*words)
    ran.is_one_sentence()
    assert phrase.replace("{most}", "1" if command == "batch" else "4") in ran.err


@pytest.mark.parametrize("number", ["1e308", "1e309", "nan", "0", "-1"])
def test_limits_that_are_none(toposeam, folder, photographs, number):
    toposeam("tile", "a.png", "-o", "o.png", "--max-megapixels", number).fails("--max-megapixels", 2)


@pytest.mark.parametrize("attributes", ['width="1e309" height="40"', 'viewBox="0 0 1e300 40"', 'width="inf"'])
def test_a_drawing_of_impossible_size(toposeam, folder, photographs, attributes):
    (folder / "s.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}><path d="M 3 0 L 4 40"/></svg>'
    )
    toposeam("stitch", "a.png", "b.png", "--overlap", "20", "--use-seam", "s.svg", "-o", "o.png").fails(
        "s.svg"
    )


@pytest.mark.parametrize("name", ["bell\x07", "a\x00b".replace("\x00", "\x1f"), "\ufffe", "\ud800", "<&\"'>"])
def test_names_of_layers_are_written_so_that_they_can_be_read(toposeam, folder, photographs, name):
    layers = [
        {"file": "a.png", "at": [0, 0], "name": name},
        {"file": "b.png", "at": [36, 0], "name": "b"},
    ]
    (folder / "layout.json").write_text(json.dumps({"layer": layers}))
    assert toposeam("stitch", "layout.json", "-o", "o.ora").code == 0
    assert len(read_ora(folder / "o.ora", 10**6)) == 2


def test_file_names_that_are_not_utf_8(toposeam, folder, photographs):
    (folder / os.fsdecode(b"latin-\xe9.png")).hardlink_to(folder / "a.png")
    ran = toposeam("stitch", os.fsdecode(b"latin-\xe9.png"), "b.png", "--overlap", "20", "-o", "o.ora")
    assert ran.code == 0, ran
    assert len(read_ora(folder / "o.ora", 10**6)) == 2
    words = ["stitch", os.fsdecode(b"latin-\xe9.png"), "b.png", "--overlap", "20", "-o", "o.png"]
    assert toposeam(*words, "--report", "o.html").code == 0
    assert "latin-\\udce9.png" in (folder / "o.html").read_text()
    toposeam(*words, "--force", "--save-layout", "o.toml").fails("which is not UTF-8; rename the file")
    assert not (folder / "o.toml").exists()


def test_steps_through_black_that_cost_more_than_can_be_summed(toposeam, folder, photographs):
    line = ["path", "a.png", "--from", "1,1", "--to", "9,9", "--steepest", "1e308", "-o", "o.svg"]
    toposeam(*line).fails("--steepest", 2)


def test_a_format_that_cannot_hold_it_is_said_before_the_work(toposeam, folder, photographs):
    toposeam("synth", "a.png", "--size", "100000x100", "-o", "o.webp").fails("ends at 16383")


@pytest.mark.parametrize(
    "more",
    [["--patch", "8"], ["--seams", "s.svg"], ["--labels", "l.png"], ["--also", "b.png"], ["--seed", "3"]],
)
def test_options_without_effect_on_coordinates_are_refused(toposeam, folder, photographs, more):
    words = ["synth", "a.png", "--use-coordinates", "b.png", "-o", "o.png", *more]
    toposeam(*words).fails(f"{more[0]} changes nothing with --use-coordinates")


def test_a_picture_full_of_holes_is_one_sentence(toposeam, folder):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (72, 96, 3)).astype(np.uint8)
    alpha = (rng.random((72, 96)) > 0.5).astype(np.uint8) * 255
    write_picture(folder / "holes.png", Picture(pixels=pixels, alpha=alpha))
    toposeam("tile", "holes.png", "-o", "o.png").fails(
        "nowhere is holes.png opaque for a patch of 18 × 18 px, as a band of 9 px needs it; fill its holes "
        "first, or use a narrower band"
    )


@pytest.mark.parametrize(
    "command", ["stitch a.png b.png --overlap 20", "tile a.png", "synth a.png --size 64"]
)
def test_an_empty_name_is_no_file(toposeam, folder, photographs, command):
    toposeam(*command.split(), "-o", "").fails("is not the name of a file", 2)


def test_a_job_whose_output_has_no_name(toposeam, folder, photographs):
    (folder / "jobs.toml").write_text("[[tile]]\nimage = 'a.png'\noutput = ''\n")
    toposeam("batch", "jobs.toml").fails("names no file")
    (folder / "jobs.toml").write_text("[[compare]]\npictures = ['a.png', 'b.png']\noverlap = 20\n")
    assert toposeam("batch", "jobs.toml").code == 1
