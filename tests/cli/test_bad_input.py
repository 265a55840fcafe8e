"""What goes wrong ends in one sentence that says what to do, a non-zero exit code, and the folder as it was."""

import gzip
import os
import pty
import shutil
import signal
import struct
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest
import tifffile
from PIL import Image

from toposeam_cli import main as main_module
from toposeam_cli import output
from toposeam_cli.picture import Picture, write_picture

IN = "--overlap 20 -o out.png"  # where nothing is wrong with the placement and the output
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="92" height="40" {}>{}</svg>'


def snapshot(folder):
    """Every entry of a folder with what it holds."""
    return {path.name: path.read_bytes() if path.is_file() and not path.is_symlink() else None for path in folder.iterdir()}


def png_that_claims(width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")


def make_pictures(folder):
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (40, 56, 3), np.uint8)
    for name in ("a.png", "b.png", "whole.jpg", "whole.tif", "whole.webp"):
        write_picture(folder / name, Picture(pixels=noise if name != "b.png" else noise[:, ::-1]))
    for name in ("whole.jpg", "whole.tif", "whole.webp", "a.png"):
        whole = (folder / name).read_bytes()
        (folder / f"cut{name[-4:]}").write_bytes(whole[: len(whole) // 2])
        (folder / f"cut-late{name[-4:]}").write_bytes(whole[: -len(whole) // 10])
    damaged = bytearray((folder / "a.png").read_bytes())
    damaged[3000:3020] = bytes(20)  # in the pixels
    (folder / "damaged.png").write_bytes(damaged)
    (folder / "empty.png").touch()
    (folder / "text.png").write_text("I am a picture, believe me.\n")
    (folder / "folder.png").mkdir()
    (folder / "vector.svg").write_text(SVG.format("", '<path d="M0 0 L9 9"/>'))
    (folder / "bomb.png").write_bytes(png_that_claims(40000, 40000))
    (folder / "wide.png").write_bytes(png_that_claims(2**31 - 1, 1))
    (folder / "none.png").write_bytes(png_that_claims(0, 7))
    (folder / "dangling.png").symlink_to(folder / "nowhere.png")
    (folder / "loop.png").symlink_to(folder / "loop.png")
    floats = np.ones((40, 56, 3), np.float32)
    for name, value in (("nan", np.nan), ("inf", -np.inf)):
        floats[3, 5, 1] = value
        tifffile.imwrite(folder / f"{name}.tif", floats, photometric="rgb")
    tifffile.imwrite(folder / "bands.tif", np.zeros((40, 56, 7), np.uint8), photometric="minisblack", planarconfig="contig")
    tifffile.imwrite(folder / "complex.tif", np.ones((40, 56), np.complex64))
    write_picture(folder / "clear.png", Picture(pixels=noise, alpha=np.zeros((40, 56), np.uint8)))
    write_picture(folder / "pixel.png", Picture(pixels=noise[:1, :1]))
    write_picture(folder / "long.png", Picture(pixels=np.zeros((1, 9000), np.uint8)))
    write_picture(folder / "mask.png", Picture(pixels=np.full((40, 92), 255, np.uint8)))
    write_picture(folder / "small-mask.png", Picture(pixels=np.zeros((9, 9), np.uint8)))


def make_drawings(folder):
    across = '<path d="M46 0 V40"/>'
    drawings = {
        "good": SVG.format("", across),
        "no-path": SVG.format("", "<text>seam</text>"),
        "hidden": SVG.format("", f'<g style="display:none">{across}</g>'),
        "other-size": SVG.format("", across).replace("92", "93"),
        "stops": SVG.format("", '<path d="M40 3 L44 6 L41 9 Z"/>'),
        "misses": SVG.format("", '<path d="M1 0 V40"/>'),
        "far": SVG.format("", '<path d="M46 0 L1e200 1e200 V40"/>'),
        "infinite": SVG.format("", '<path d="M46 0 L1e999 1e999 V40"/>'),
        "garbled": SVG.format("", '<path d="M46 0 V forty"/>'),
        "turned": SVG.format("", f'<g transform="rotate(deg)">{across}</g>'),
        "no-size": f'<svg xmlns="http://www.w3.org/2000/svg">{across}</svg>',
        "bad-box": SVG.format('viewBox="0 0 wide"', across),
        "entities": "<!DOCTYPE svg [" + "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10 if i else "ha"}">' for i in range(9)) + "]>"
        + SVG.format("", f"<title>&l8;</title>{across}"),
        "outside": '<!DOCTYPE svg [<!ENTITY secret SYSTEM "file:///etc/hostname">]>' + SVG.format("", f"<title>&secret;</title>{across}"),
        "rules": "<!DOCTYPE svg [<!ELEMENT svg ANY>]>" + SVG.format("", across),
        "undefined": SVG.format("", f"<title>&what;</title>{across}"),
        "not-xml": "<svg><path",
        "not-svg": "<html><body/></html>",
        "blank": " \n",
        "crowded": SVG.format("", '<path d="M0 0 ' + "1 " * 2_100_000 + '"/>'),
        "deep": SVG.format("", "<g>" * 50_000 + "</g>" * 50_000),
    }  # fmt: skip
    for name, text in drawings.items():
        (folder / f"{name}.svg").write_text(text)
    (folder / "zipped.svg").write_bytes(gzip.compress(drawings["good"].encode()))
    (folder / "binary.svg").write_bytes(bytes(range(256)) * 9)
    (folder / "nul.svg").write_bytes(drawings["good"].encode() + bytes(9))


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    make_pictures(folder)
    make_drawings(folder)
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder but for two files that must survive."""
    (tmp_path / "there.png").write_bytes(b"precious")
    (tmp_path / "there.svg").write_bytes(b"precious too")
    monkeypatch.chdir(tmp_path)
    return tmp_path


CASES = {
    # A picture that is none
    "missing": ("{in}/nowhere.png {b} " + IN, "there is no file"),
    "missing folder": ("{in}/nowhere/a.png {b} " + IN, "there is no file"),
    "file as folder": ("{a}/a.png {b} " + IN, "there is no file"),
    "second missing": ("{a} {in}/nowhere.png " + IN, "check its name and folder"),
    "dangling link": ("{a} {in}/dangling.png " + IN, "there is no file"),
    "link to itself": ("{a} {in}/loop.png " + IN, "cannot read"),
    "endless name": ("{a} {in}/" + "n" * 300 + ".png " + IN, "check its name"),
    "empty": ("{a} {in}/empty.png " + IN, "export the picture again"),
    "text": ("{a} {in}/text.png " + IN, "export it again as PNG or TIFF"),
    "folder": ("{a} {in}/folder.png " + IN, "name a picture inside it"),
    "device": ("{a} /dev/zero " + IN, "save the picture to disk first"),
    "standard input": ("- {b} " + IN, "there is no file '-'"),
    "vector": ("{a} {in}/vector.svg " + IN, "export it as PNG or TIFF"),
    "half a png": ("{a} {in}/cut.png " + IN, "export it again"),
    "half a jpeg": ("{a} {in}/cut.jpg " + IN, "export it again"),
    "half a tiff": ("{a} {in}/cut.tif " + IN, "export it again"),
    "half a webp": ("{a} {in}/cutwebp " + IN, "export it again"),
    "most of a png": ("{a} {in}/cut-late.png " + IN, "export it again"),
    "most of a jpeg": ("{a} {in}/cut-late.jpg " + IN, "export it again"),
    "most of a tiff": ("{a} {in}/cut-late.tif " + IN, "export it again"),
    "damaged": ("{a} {in}/damaged.png " + IN, "export it again"),
    "bomb": ("{a} {in}/bomb.png " + IN, "raise --max-megapixels if the file is trusted"),
    "wide bomb": ("{a} {in}/wide.png " + IN, "'"),
    "no pixels": ("{a} {in}/none.png " + IN, "export it again"),
    "small limit": ("{a} {b} --max-megapixels 0.002 " + IN, "raise --max-megapixels"),
    "nan": ("{a} {in}/nan.tif " + IN, "replace them with numbers first"),
    "infinity": ("{a} {in}/inf.tif " + IN, "replace them with numbers first"),
    "seven channels": ("{a} {in}/bands.tif " + IN, "export it as gray or RGB"),
    "complex": ("{a} {in}/complex.tif " + IN, "export it again"),
    "transparent": ("{a} {in}/clear.png " + IN, "no pixel is covered by both"),
    # Where the pictures lie
    "no placement": ("{a} {b} -o out.png", "either --offset X,Y or --overlap"),
    "two placements": ("{a} {b} --offset 3,4 --overlap 5 -o out.png", "either --offset X,Y or --overlap"),
    "beside, right": ("{a} {b} --offset 56,0 -o out.png", "choose an offset at which they overlap"),
    "beside, left": ("{a} {b} --offset=-56,0 -o out.png", "choose an offset at which they overlap"),
    "beside, below": ("{a} {b} --offset 0,40 -o out.png", "choose an offset at which they overlap"),
    "beside, above": ("{a} {b} --offset 3,-40 -o out.png", "choose an offset at which they overlap"),
    "far away": ("{a} {b} --offset 999999999,999999999 -o out.png", "choose an offset at which they overlap"),
    "overlap too long": ("{a} {b} --overlap 57 -o out.png", "choose 1 to 56 px"),
    "overlap longer than b": ("{a} {in}/pixel.png --overlap 2 -o out.png", "choose 1 to 1 px"),
    "overlap comes to nothing": ("{a} {b} --overlap 0.1% -o out.png", "choose 1 to 56 px"),
    "one over the other": ("{a} {b} --offset 0,0 -o out.png", "nothing divides the patches"),
    "full overlap": ("{a} {b} --overlap 100% -o out.png", "nothing divides the patches"),
    "two pixels": ("{in}/pixel.png {in}/pixel.png --overlap 1 -o out.png", "nothing divides the patches"),
    "a pixel inside": ("{a} {in}/pixel.png --offset 9,9 -o out.png", "nothing divides the patches"),
    "dp on an L": ("{a} {b} --offset 30,9 --method dp -o out.png", "use heat for this shape"),
    "one picture": ("{a} --overlap 20 -o out.png", "give at least two"),
    "three pictures": ("{a} {b} {a} --overlap 20 -o out.png", "--at X,Y for each"),
    "at for too few": ("{a} {b} {a} --at 0,0 --at 9,9 -o out.png", "once for each"),
    "at and offset": ("{a} {b} --at 0,0 --at 9,9 --offset 3,3 -o out.png", "say where B lies"),
    "at and overlap for three": ("{a} {b} {a} --at 0,0 --at 9,9 --at 1,1 --overlap 3 -o out.png", "leave them out"),
    "third far away": ("{a} {b} {a} --at 0,0 --at 36,0 --at 999,0 -o out.png", "a.png (at 999,0)"),
    "side without overlap": ("{a} {b} --offset 36,0 --side left -o out.png", "--side belongs to --overlap"),
    "nothing to align": ("{a} {b} --offset 36,0 --align -o out.png", "b.png cannot be aligned"),
    "radius without align": ("{a} {b} --offset 36,0 --align-radius 3 -o out.png", "add that or leave it out"),
    "width without blend": ("{a} {b} --blend-width 3 " + IN, "leave it out"),
    "no such blend width": ("{a} {b} --blend feather --blend-width 4000 " + IN, "choose 1 to 512"),
    "mask of a third": ("{a} {b} --mask-for 2={in}/mask.png " + IN, "number from 0 to 1"),
    "mask for a stranger": ("{a} {b} --keep c.png={in}/mask.png " + IN, "one of a.png, b.png"),
    "small mask for one": ("{a} {b} --mask-for 0={in}/small-mask.png " + IN, "a.png is 56 × 40 px; make it that size"),
    "jpeg of holes": ("{a} {b} --offset 36,9 -o out.jpg", "use .png or .tif"),
    "all excluded": ("{a} {b} --mask {in}/mask.png " + IN, "no seam avoids the pixels you excluded"),
    "small mask": ("{a} {b} --mask {in}/small-mask.png " + IN, "make it that size"),
    "no mask": ("{a} {b} --mask {in}/nowhere.png " + IN, "there is no file"),
    "mask is text": ("{a} {b} --mask {in}/text.png " + IN, "export it again"),
    # A seam that cannot be used
    "no seam": ("{a} {b} --use-seam {in}/nowhere.svg " + IN, "check the name of the SVG file"),
    "seam is a folder": ("{a} {b} --use-seam {in} " + IN, "check the name of the SVG file"),
    "seam is a picture": ("{a} {b} --use-seam {a} " + IN, "save or export the path as SVG"),
    "seam without end": ("{a} {b} --use-seam /dev/zero " + IN, "larger than 64 MiB"),
    **{
        f"seam: {name}": (f"{{a}} {{b}} --use-seam {{in}}/{name}.svg {IN}", phrase)
        for name, phrase in {
            "no-path": "draw one",
            "hidden": "draw one",
            "other-size": "belongs to a canvas of 93 × 40 px",
            "stops": "draw it right across the overlap",
            "misses": "draw it right across the overlap",
            "far": "keep it within",
            "infinite": "draw or export it again",
            "garbled": "draw or export it again",
            "turned": "apply or remove it",
            "no-size": "give <svg> a viewBox",
            "bad-box": "give it four numbers",
            "entities": "save the path as plain SVG",
            "outside": "save the path as plain SVG",
            "rules": "save the path as plain SVG",
            "undefined": "save or export the path as SVG",
            "not-xml": "save or export the path as SVG",
            "not-svg": "save the path as plain SVG",
            "blank": "export the path again",
            "crowded": "simplify them",
            "deep": "draw one",
            "zipped": "save it as plain SVG",
            "binary": "save or export the path as SVG",
            "nul": "save or export the path as SVG",
        }.items()
    },
    # Options that contradict
    "history of dp": ("{a} {b} --method dp --history h.png " + IN, "choose one of them or leave it out"),
    "history of a path": ("{a} {b} --use-seam {in}/good.svg --history h.png " + IN, "leave it out"),
    "method of a path": ("{a} {b} --use-seam {in}/good.svg --method heat " + IN, "leave one of them out"),
    "two seams": ("{a} {b} --use-seam {in}/good.svg --use-seam 0:1={in}/good.svg " + IN, "leave one of them out"),
    "seam of no pair": ("{a} {b} --use-seam 1={in}/good.svg " + IN, "names no pair"),
    "seam of a stranger": ("{a} {b} --use-seam 0:7={in}/good.svg " + IN, "number from 0 to 1"),
    "seam with one name of three": (
        "{a} {b} {a} --at 0,0 --at 36,0 --at 60,0 --use-seam {in}/good.svg -o out.png",
        "good.svg': the path 'seam 1' names no pair",
    ),
    "history of three": ("{a} {b} {a} --at 0,0 --at 36,0 --at 60,0 --history h.png -o out.png", "there are 3 pictures"),
    "formulation of heat": ("{a} {b} --formulation 2 " + IN, "add that or leave it out"),
    "formulation of a path": ("{a} {b} --method thesis --formulation 2 --use-seam {in}/good.svg " + IN, "leave it out"),
    # Outputs
    "output exists": ("{a} {b} --overlap 20 -o there.png", "pass --force"),
    "seam exists": ("{a} {b} --overlap 20 -o out.png --seam there.svg", "pass --force"),
    "labels exist": ("{a} {b} --overlap 20 -o out.png --labels there.png", "pass --force"),
    "overlay exists": ("{a} {b} --overlap 20 -o out.png --overlay there.png", "pass --force"),
    "history exists": ("{a} {b} --overlap 20 -o out.png --history there.png", "pass --force"),
    "output is the input": ("{a} {b} --overlap 20 -o {b}", "pass --force"),
    "no folder": ("{a} {b} --overlap 20 -o nowhere/out.png", "create it or choose another one"),
    "no folder for the seam": ("{a} {b} --seam nowhere/out.svg " + IN, "create it or choose another one"),
    "output is a folder": ("{a} {b} --overlap 20 --force -o {in}/folder.png", "choose another name"),
    "read-only": ("{a} {b} --overlap 20 -o /proc/out.png", "choose another name or folder"),
    "no extension": ("{a} {b} --overlap 20 -o out", "use one of .png"),
    "bmp": ("{a} {b} --overlap 20 -o out.bmp", "use one of .png"),
    "seam as picture": ("{a} {b} --seam seam.png " + IN, "use one of .svg"),
    "labels as seam": ("{a} {b} --labels labels.svg " + IN, "use one of .png"),
    "history as text": ("{a} {b} --history history.txt " + IN, "use one of .png, .svg, .pdf"),
    "one name twice": ("{a} {b} --labels ./out.png " + IN, "give each a name of its own"),
    "long name": ("{a} {b} --overlap 20 -o " + "n" * 300 + ".png", "choose another name"),
    "transparent jpeg": ("{a} {b} --offset 30,9 -o out.jpg", "use .png or .tif"),
    "webp ends there": ("{in}/long.png {in}/long.png --overlap 9 -o out.webp", "write .png or .tif instead"),
}

USAGE = {
    "no command": ("stich", "No such command"),
    "no pictures": ("stitch", "Missing argument"),
    "no picture": ("stitch --overlap 20 -o out.png", "Missing argument"),
    "no output": ("stitch {a} {b} --overlap 20", "Missing option '-o'"),
    "no such option": ("stitch {a} {b} --overlap 20 -o out.png --warp", "No such option"),
    "name like an option": ("stitch {a} -b.png --overlap 20 -o out.png", "No such option"),
    "overlap in words": ("stitch {a} {b} --overlap ten -o out.png", "write pixels, like 80"),
    "no overlap": ("stitch {a} {b} --overlap 0 -o out.png", "write pixels, like 80"),
    "negative overlap": ("stitch {a} {b} --overlap=-5 -o out.png", "write pixels, like 80"),
    "half a pixel": ("stitch {a} {b} --overlap 2.5 -o out.png", "write pixels, like 80"),
    "more than all": ("stitch {a} {b} --overlap 101% -o out.png", "a share from 0% to 100%"),
    "overlap nan": ("stitch {a} {b} --overlap nan -o out.png", "write pixels, like 80"),
    "endless overlap": ("stitch {a} {b} --overlap 99999999999999 -o out.png", "write pixels, like 80"),
    "one number": ("stitch {a} {b} --offset 3 -o out.png", "like 120,-4"),
    "three numbers": ("stitch {a} {b} --offset 3,4,5 -o out.png", "like 120,-4"),
    "fractions": ("stitch {a} {b} --offset 3.5,4 -o out.png", "like 120,-4"),
    "offset in words": ("stitch {a} {b} --offset left,top -o out.png", "like 120,-4"),
    "endless offset": ("stitch {a} {b} --offset 9999999999,0 -o out.png", "like 120,-4"),
    "unknown side": ("stitch {a} {b} --overlap 20 --side middle -o out.png", "is not one of 'right'"),
    "unknown method": ("stitch {a} {b} --overlap 20 --method magic -o out.png", "is not one of 'heat'"),
    "core 0": ("stitch {a} {b} --overlap 20 --core 0 -o out.png", "not in the range"),
    "core 2": ("stitch {a} {b} --overlap 20 --core 2 -o out.png", "not in the range"),
    "core nan": ("stitch {a} {b} --overlap 20 --core nan -o out.png", "not a finite number"),
    "no megapixels": ("stitch {a} {b} --overlap 20 --max-megapixels 0 -o out.png", "not in the range"),
    "infinite megapixels": ("stitch {a} {b} --overlap 20 --max-megapixels inf -o out.png", "not a finite number"),
    "megapixels nan": ("compare {a} {b} --overlap 20 --max-megapixels nan", "not a finite number"),
    "third formulation": ("stitch {a} {b} --overlap 20 --method thesis --formulation 3 -o out.png", "not in the range"),
    "compare has no output": ("compare {a} {b} --overlap 20 -o out.png", "No such option"),
    "unknown shell": ("completion tcsh", "is not one of 'bash', 'zsh', 'fish'"),
}


def arguments(line, inputs):
    return [word.replace("{in}", str(inputs)).format(a=inputs / "a.png", b=inputs / "b.png") for word in line.split()]


@pytest.mark.parametrize(("line", "phrase"), CASES.values(), ids=CASES)
def test_it_ends_in_one_sentence_and_the_folder_as_it_was(toposeam, inputs, here, capfd, line, phrase):
    before = snapshot(here), snapshot(inputs)
    toposeam("stitch", *arguments(line, inputs)).fails(phrase)
    assert (snapshot(here), snapshot(inputs)) == before
    assert capfd.readouterr() == ("", "")  # libraries stay silent too


@pytest.mark.parametrize(("line", "phrase"), USAGE.values(), ids=USAGE)
def test_a_wrong_command_line_is_explained(toposeam, inputs, here, line, phrase):
    before = snapshot(here), snapshot(inputs)
    toposeam(*arguments(line, inputs)).fails(phrase, code=2)
    assert (snapshot(here), snapshot(inputs)) == before


@pytest.mark.parametrize("case", ["missing", "no placement", "beside, right", "full overlap", "nan", "all excluded", "bomb"])
def test_compare_refuses_the_same(toposeam, inputs, here, case):
    line, phrase = CASES[case]
    toposeam("compare", *arguments(line.replace("-o out.png", ""), inputs)).fails(phrase)


def test_no_command_at_all_shows_the_help(toposeam):
    ran = toposeam()
    assert ran.code == 2
    assert "Commands:" in ran.out + ran.err


def test_a_file_that_may_not_be_read(toposeam, inputs, here):
    shutil.copy(inputs / "a.png", "locked.png")
    (here / "locked.png").chmod(0)
    if os.access("locked.png", os.R_OK):
        pytest.skip("root reads everything")
    toposeam("stitch", "locked.png", inputs / "b.png", *IN.split()).fails("your right to read it")


@pytest.mark.parametrize("name", ["two\nlines.png", "\x1b[31mred.png", "\udcff.png"])
def test_a_hostile_name_stays_on_its_line(toposeam, inputs, here, name):
    ran = toposeam("stitch", inputs / "a.png", f"{inputs}/{name}", *IN.split())
    ran.fails("there is no file")
    assert ascii(name)[1:-5] in ran.err


@pytest.mark.parametrize(
    ("missing", "line", "remedy"),
    [
        ("maxflow", "--method graph-cut", "pip install 'toposeam[graphcut]'"),
        ("matplotlib", "--history history.png", "pip install 'toposeam[plot]'"),
    ],
)
def test_a_missing_package_is_named_with_its_command(toposeam, inputs, here, monkeypatch, missing, line, remedy):
    for name in [name for name in sys.modules if name.partition(".")[0] == missing]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    before = snapshot(here)
    toposeam("stitch", *arguments("{a} {b} " + IN, inputs), *line.split()).fails(remedy)
    assert snapshot(here) == before


# The machine fails


def fail_with(error):
    def fail(*arguments, **options):
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "phrase"),
    [
        (MemoryError(), "use smaller ones"),
        (np._core._exceptions._ArrayMemoryError((10**6, 10**6), np.dtype(float)), "use smaller ones"),
        (OSError(5, "Input/output error"), "the system refused (Input/output error)"),
    ],
)
def test_a_machine_that_gives_up_is_one_sentence_too(toposeam, inputs, here, monkeypatch, error, phrase):
    monkeypatch.setattr("toposeam.stitch", fail_with(error))
    before = snapshot(here)
    toposeam("stitch", *arguments("{a} {b} " + IN, inputs)).fails(phrase)
    assert snapshot(here) == before


def test_a_mistake_of_ours_asks_for_a_report(toposeam, inputs, here, monkeypatch):
    monkeypatch.setattr("toposeam.stitch", fail_with(ZeroDivisionError("division\nby zero")))
    line = ("stitch", *arguments("{a} {b} " + IN, inputs))
    ran = toposeam(*line)
    assert ran.code == 1
    assert ran.err.startswith("Error: something went wrong inside TopoSeam (ZeroDivisionError: division\\nby zero); set TOPOSEAM_DEBUG=1")
    assert ran.err.count("\n") == 1


def test_debugging_shows_where(started, inputs, here):
    code = "import toposeam\ntoposeam.stitch = lambda *a, **o: 1 / 0\nfrom toposeam_cli.main import main\nmain()"
    line = arguments("{a} {b} " + IN, inputs)
    done = subprocess.run(
        [sys.executable, "-c", code, "stitch", *line], env=os.environ | {"TOPOSEAM_DEBUG": "1"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    assert "ZeroDivisionError" in done.stderr


def test_a_full_disk_leaves_nothing_behind(toposeam, inputs, here, monkeypatch):
    monkeypatch.setattr(output.os, "fsync", fail_with(OSError(28, "No space left on device")))
    before = snapshot(here)
    line = arguments("{a} {b} --overlap 20 -o there.png --seam there.svg --force", inputs)
    toposeam("stitch", *line).fails("free some space or choose another folder")
    assert snapshot(here) == before


def in_a_small_file_system(started, inputs, options, *line):
    """Run with ``disk``, of 16 kB and holding a file, in a mount name space of its own; the listing of ``disk`` afterwards is printed."""
    setting_up = (
        'mount -t tmpfs -o size=16k tmpfs disk && echo precious > disk/there.png && mount -o "remount,$0" disk || exit 99; '
        '"$@"; code=$?; ls -A disk; cat disk/there.png; exit $code'
    )
    ran = started(*line, before=("unshare", "--map-root-user", "--mount", "sh", "-c", setting_up, options))
    if ran.code == 99 or "unshare" in ran.err:
        pytest.skip("no file system can be mounted here")
    return ran


@pytest.mark.skipif(shutil.which("unshare") is None, reason="no unshare")
@pytest.mark.parametrize(
    ("options", "outputs", "phrase"),
    [
        ("rw", "-o disk/out.tif", "No space left on device"),
        ("rw", "-o disk/there.png --force", "No space left on device"),
        ("rw", "-o disk/there.png --force --seam disk/seam.svg", "No space left on device"),
        ("ro", "-o disk/out.png", "read-only file system"),
        ("ro", "-o disk/there.png --force", "read-only file system"),
    ],
)
def test_a_disk_that_is_full_or_read_only_keeps_what_it_has(started, inputs, here, photographs, options, outputs, phrase):
    (here / "disk").mkdir()
    rng = np.random.default_rng(1)
    write_picture("noise.png", Picture(pixels=rng.integers(0, 256, (90, 90, 3), np.uint8)))  # 24 kB, whatever the compression
    ran = in_a_small_file_system(started, inputs, options, "stitch", "noise.png", "noise.png", "--overlap", "30", *outputs.split())
    assert ran.out == "there.png\nprecious\n"
    assert ran.code == 1
    assert phrase in ran.err
    assert ran.err.count("\n") == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")  # noqa: PTH110
def test_a_report_that_cannot_be_printed(started, inputs, here):
    with open("/dev/full", "wb") as full:  # noqa: PTH123
        ran = started("stitch", *arguments("{a} {b} " + IN, inputs), stdout=full)
    assert ran.code == 1
    assert ran.err == (
        "Error: the system refused (No space left on device); free some space, or check the rights and where the output goes\n"
    )
    assert (here / "out.png").stat().st_size > 1000


def test_a_reader_that_leaves_early_is_no_error_of_ours(process, inputs, here):
    child = process("compare", *arguments("{a} {b} --overlap 20 --method dp", inputs), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    child.stdout.close()
    with child:
        assert child.stderr.read() == b""


# Ctrl-C


@pytest.mark.parametrize("moment", ["import", "read", "search", "figure", "write", "rename"])
def test_ctrl_c_at_any_moment_leaves_nothing_half_written(toposeam, inputs, here, monkeypatch, moment):
    target = {
        "import": (main_module, "import_module"),
        "read": ("toposeam_cli.placing.read_picture",),
        "search": ("toposeam.stitch",),
        "figure": ("toposeam_cli.history_figure.history_figure",),
        "write": (output.os, "fsync"),
        "rename": (output, "_rename"),
    }[moment]
    monkeypatch.setattr(*target, fail_with(KeyboardInterrupt()))
    before = snapshot(here)
    ran = toposeam("stitch", *arguments("{a} {b} --overlap 20 -o there.png --history history.png --force", inputs))
    assert (ran.code, ran.out, ran.err) == (130, "", "Interrupted; no file was left unfinished.\n")
    assert snapshot(here) == before


def test_a_real_ctrl_c_in_the_middle_of_work(process, inputs, here):
    rng = np.random.default_rng(0)
    for name in ("c.tif", "d.tif"):
        write_picture(name, Picture(pixels=rng.integers(0, 256, (1500, 700, 3), np.uint8)))
    before = snapshot(here)
    ours, theirs = pty.openpty()
    with process("stitch", "c.tif", "d.tif", "--overlap", "500", "-o", "there.png", "--force", stderr=theirs) as child:
        os.close(theirs)
        seen = b""
        while b"joining" not in seen:  # the bar is there, so the search has begun
            seen += os.read(ours, 4096)
        child.send_signal(signal.SIGINT)
        while b"unfinished" not in seen:
            seen += os.read(ours, 4096)
        assert child.wait(60) == 130
    os.close(ours)
    assert seen.decode().endswith("Interrupted; no file was left unfinished.\r\n")
    assert "Traceback" not in seen.decode()
    assert snapshot(here) == before


@pytest.mark.parametrize("received", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_large_picture_is_not_written_to_its_end_after_ctrl_c(process, inputs, here, received):
    rng = np.random.default_rng(0)
    for name in ("c.tif", "d.tif"):
        write_picture(name, Picture(pixels=rng.integers(0, 256, (2000, 1400, 3), np.uint8)))
    before = snapshot(here)
    with process("stitch", "c.tif", "d.tif", "--overlap", "2", "-o", "out.png", stderr=subprocess.PIPE) as child:
        while not list(here.glob(".toposeam-*.part")):
            assert child.poll() is None
            time.sleep(0.01)
        child.send_signal(received)
        said = child.stderr.read().decode()
    assert (child.returncode, said) == (128 + received, "Interrupted; no file was left unfinished.\n" if received == signal.SIGINT else "")
    assert snapshot(here) == before


@pytest.mark.slow
def test_ctrl_c_and_kill_at_random_moments(process, inputs, here):
    rng = np.random.default_rng(0)
    before = snapshot(here)
    line = arguments("{a} {b} --overlap 20 -o out.png --labels labels.png --history history.png", inputs)
    codes = set()
    for turn in range(40):
        sent, ends = ((signal.SIGINT, (130, "Interrupted; no file was left unfinished.\n")), (signal.SIGTERM, (143, "")))[turn % 2]
        child = process("stitch", *line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        with child:
            try:
                child.wait(0.3 + 3 * rng.random())
            except subprocess.TimeoutExpired:
                child.send_signal(sent)
            said = child.stderr.read().decode()
        codes.add(child.returncode)
        # Python itself, while it starts or ends, dies of the signal; that is not ours.
        if child.returncode != -sent:
            assert (child.returncode, said) in {(0, ""), ends}
        for name in set(snapshot(here)) - set(before):
            assert not name.endswith(".part")
            with Image.open(name) as image:
                image.load()
            (here / name).unlink()
    assert codes >= {130, 143}
    assert snapshot(here) == before
