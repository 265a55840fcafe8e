"""Whatever is wrong with the input, it ends in one sentence and leaves the folder as it was."""

import math
import os
import shutil
import struct
import sys
import zlib

import pytest
from bad_files import IN, arguments, snapshot
from PIL import Image

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
    "folder": ("{a} {in}/folder.png " + IN, "holds 0 pictures; put two or more there"),
    "device": ("{a} /dev/zero " + IN, "save it to disk"),
    "standard input": ("- {b} " + IN, "there is no file '-'"),
    "vector": ("{a} {in}/vector.svg " + IN, "export it again as PNG or TIFF"),
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
    "pages": ("{a} {in}/pages.tif " + IN, "holds 3 pages; save the one that is meant"),
    "transparent": (
        "{a} {in}/clear.png " + IN,
        "clear.png (at 36,0): the pictures do not overlap: no pixel of it",
    ),
    "raw data": ("{a} {in}/raw.nef " + IN, "has to be developed first; export TIFF or JPEG"),
    "heic": ("{a} {in}/damaged.heic " + IN, "make a JPEG of it first"),
    # Where the pictures lie
    "no placement": ("{a} {b} -o out.png", "cannot be placed: "),
    "two placements": ("{a} {b} --offset 3,4 --overlap 5 -o out.png", "--offset and --overlap both say"),
    "beside, right": ("{a} {b} --offset 56,0 -o out.png", "choose an offset at which they overlap"),
    "beside, left": ("{a} {b} --offset=-56,0 -o out.png", "choose an offset at which they overlap"),
    "beside, below": ("{a} {b} --offset 0,40 -o out.png", "choose an offset at which they overlap"),
    "beside, above": ("{a} {b} --offset 3,-40 -o out.png", "choose an offset at which they overlap"),
    "far away": ("{a} {b} --offset 999999999,999999999 -o out.png", "choose an offset at which they overlap"),
    "overlap too long": ("{a} {b} --overlap 57 -o out.png", "choose 1 to 56 px"),
    "overlap longer than b": ("{a} {in}/pixel.png --overlap 2 -o out.png", "comes to 2 px, but"),
    "overlap comes to nothing": ("{a} {b} --overlap 0.1% -o out.png", "choose 1 to 56 px"),
    "one over the other": ("{a} {b} --offset 0,0 -o out.png", "nothing divides the p"),
    "full overlap": ("{a} {b} --overlap 100% -o out.png", "nothing divides the p"),
    "two pixels": ("{in}/pixel.png {in}/pixel.png --overlap 1 -o out.png", "nothing divides the p"),
    "a pixel inside": ("{a} {in}/pixel.png --offset 9,9 -o out.png", "nothing divides the p"),
    "dp on an L": ("{a} {b} --offset 30,9 --method dp -o out.png", "use heat for this shape"),
    "one picture": ("{a} --overlap 20 -o out.png", "give at least two"),
    "three pictures": ("{a} {b} {a} --overlap 20 -o out.png", "--at X,Y for each"),
    "at for too few": ("{a} {b} {a} --at 0,0 --at 9,9 -o out.png", "once for each"),
    "at and offset": ("{a} {b} --at 0,0 --at 9,9 --offset 3,3 -o out.png", "--at and --offset both say"),
    "at and overlap for three": (
        "{a} {b} {a} --at 0,0 --at 9,9 --at 1,1 --overlap 3 -o out.png",
        "--at and --overlap both say",
    ),
    "third far away": ("{a} {b} {a} --at 0,0 --at 36,0 --at 999,0 -o out.png", "a.png (at 999,0)"),
    "side without overlap": ("{a} {b} --offset 36,0 --side left -o out.png", "--side belongs to --overlap"),
    "nothing to align": ("{a} {b} --offset 36,0 --align -o out.png", "b.png cannot be aligned"),
    "radius without align": ("{a} {b} --offset 36,0 --align-radius 3 -o out.png", "add that or leave it out"),
    "width without blend": ("{a} {b} --blend-width 3 " + IN, "leave it out"),
    "no such blend width": ("{a} {b} --blend feather --blend-width 4000 " + IN, "choose 1 to 512"),
    "mask of a third": ("{a} {b} --mask-for 2={in}/mask.png " + IN, "number from 0 to 1"),
    "mask for a stranger": ("{a} {b} --keep c.png={in}/mask.png " + IN, "one of a.png, b.png"),
    "small mask for one": (
        "{a} {b} --mask-for 0={in}/small-mask.png " + IN,
        "a.png is 56 × 40 px; make it that size",
    ),
    "jpeg of holes": ("{a} {b} --offset 36,9 --crop outside -o out.jpg", "use .png or .tif"),
    "all excluded": ("{a} {b} --avoid {in}/mask.png " + IN, "no seam avoids the pixels you excluded"),
    "small mask": ("{a} {b} --avoid {in}/small-mask.png " + IN, "make it that size"),
    "no mask": ("{a} {b} --avoid {in}/nowhere.png " + IN, "there is no file"),
    "mask is text": ("{a} {b} --avoid {in}/text.png " + IN, "export it again"),
    # A seam that cannot be used
    "no seam": ("{a} {b} --use-seam {in}/nowhere.svg " + IN, "check the name of the SVG file"),
    "seam is a folder": ("{a} {b} --use-seam {in} " + IN, "check the name of the SVG file"),
    "seam is a picture": ("{a} {b} --use-seam {a} " + IN, "save or export the path as SVG"),
    "seam without end": ("{a} {b} --use-seam /dev/zero " + IN, "not a regular file"),
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
    "two seams": (
        "{a} {b} --use-seam {in}/good.svg --use-seam 0:1={in}/good.svg " + IN,
        "leave one of them out",
    ),
    "seam of no pair": ("{a} {b} --use-seam 1={in}/good.svg " + IN, "names no pair"),
    "seam of a stranger": ("{a} {b} --use-seam 0:7={in}/good.svg " + IN, "number from 0 to 1"),
    "seam with one name of three": (
        "{a} {b} {a} --at 0,0 --at 36,0 --at 60,0 --use-seam {in}/good.svg -o out.png",
        "good.svg': the path 'seam 1' names no pair",
    ),
    "history of three": (
        "{a} {b} {a} --at 0,0 --at 36,0 --at 60,0 --history h.png -o out.png",
        "there are 3 pictures",
    ),
    "formulation of heat": ("{a} {b} --formulation 2 " + IN, "add that or leave it out"),
    "formulation of a path": (
        "{a} {b} --method thesis --formulation 2 --use-seam {in}/good.svg " + IN,
        "leave it out",
    ),
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
    "transparent jpeg": ("{a} {b} --offset 30,9 --crop outside -o out.jpg", "use .png or .tif"),
    "webp ends there": ("{in}/long.png {in}/long.png --overlap 9 -o out.webp", "write .png or .tif instead"),
}


USAGE = {
    "no command": ("stich", "No such command"),
    "no pictures": ("stitch", "Missing argument"),
    "no picture": ("stitch --overlap 20 -o out.png", "Missing argument"),
    "no output": ("stitch {a} {b} --overlap 20", "Missing option '-o'"),
    "nothing to write": ("fill {a} --mask {b}", "Missing option '-o'"),
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
    "endless offset": ("stitch {a} {b} --offset 9999999999,0 -o out.png", "nine digits are the most"),
    "unknown side": ("stitch {a} {b} --overlap 20 --side middle -o out.png", "is not one of 'right'"),
    "unknown method": ("stitch {a} {b} --overlap 20 --method magic -o out.png", "is not one of 'auto'"),
    "core 0": ("stitch {a} {b} --overlap 20 --core 0 -o out.png", "not in the range"),
    "core 2": ("stitch {a} {b} --overlap 20 --core 2 -o out.png", "not in the range"),
    "core nan": ("stitch {a} {b} --overlap 20 --core nan -o out.png", "not a finite number"),
    "speck -1": ("stitch {a} {b} --overlap 20 --speck -1 -o out.png", "not in the range"),
    "no megapixels": ("stitch {a} {b} --overlap 20 --max-megapixels 0 -o out.png", "not in the range"),
    "infinite megapixels": (
        "stitch {a} {b} --overlap 20 --max-megapixels inf -o out.png",
        "not a finite number",
    ),
    "megapixels nan": ("compare {a} {b} --overlap 20 --max-megapixels nan", "not a finite number"),
    "third formulation": (
        "stitch {a} {b} --overlap 20 --method thesis --formulation 3 -o out.png",
        "not in the range",
    ),
    "compare has no output": ("compare {a} {b} --overlap 20 -o out.png", "No such option"),
    "unknown shell": ("completion tcsh", "is not one of 'bash', 'zsh', 'fish', 'powershell'"),
}


@pytest.mark.medium
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


@pytest.mark.parametrize(
    "case", ["missing", "no placement", "beside, right", "full overlap", "nan", "all excluded", "bomb"]
)
def test_compare_refuses_the_same(toposeam, inputs, here, case):
    line, phrase = CASES[case]
    toposeam("compare", *arguments(line.replace("-o out.png", ""), inputs)).fails(phrase)


def test_no_command_at_all_shows_the_help(toposeam):
    ran = toposeam()
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == toposeam("--help").out
    assert "Usage:" in ran.out


def test_a_file_that_may_not_be_read(toposeam, inputs, here):
    shutil.copy(inputs / "a.png", "locked.png")
    (here / "locked.png").chmod(0)
    if os.access("locked.png", os.R_OK):
        pytest.skip("root reads everything")
    toposeam("stitch", "locked.png", inputs / "b.png", *IN.split()).fails("your right to read it")


def test_rights_are_not_asked_about_before_a_file_is_read(toposeam, inputs, here, monkeypatch):
    """They may change until then, and click would put the answer in words of its own."""
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert toposeam("stitch", inputs / "a.png", inputs / "b.png", *IN.split()).code == 0


@pytest.mark.parametrize("name", ["two\nlines.png", "\x1b[31mred.png", "\udcff.png"])
def test_a_hostile_name_stays_on_its_line(toposeam, inputs, here, name):
    ran = toposeam("stitch", inputs / "a.png", f"{inputs}/{name}", *IN.split())
    ran.fails("there is no file")
    assert ascii(name)[1:-5] in ran.err


@pytest.mark.parametrize(
    ("missing", "line", "remedy"),
    [
        ("maxflow", "--method graph-cut", "pip install PyMaxflow"),
        ("matplotlib", "--history history.png", "pip install matplotlib"),
    ],
)
def test_a_missing_package_is_named_with_its_command(
    toposeam, inputs, here, monkeypatch, missing, line, remedy
):
    for name in [name for name in sys.modules if name.partition(".")[0] == missing]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    before = snapshot(here)
    toposeam("stitch", *arguments("{a} {b} " + IN, inputs), *line.split()).fails(remedy)
    assert snapshot(here) == before


def test_a_list_that_names_nothing_is_told(toposeam, here):
    for text in ("", "\n\n", "# nothing\n"):
        (here / "e.txt").write_text(text)
        toposeam("enblend", "-o", "o.tif", "@e.txt").fails("@e.txt names no pictures; name at least one")


def test_a_frame_of_gigapixels_is_refused(toposeam, inputs, here):
    files = inputs / "a.png", inputs / "b.png"
    ran = toposeam("enblend", "-o", "o.tif", "-f99999x99999", *files)
    ran.fails("more than 4000 megapixels; make the frame smaller")


def test_numbers_of_palettes_are_checked(toposeam, here):
    (here / "long.gpl").write_text(f"GIMP Palette\n#\n{'9' * 400} 1 2 a\n")
    nan = b"\0\0RGB " + struct.pack(">3fH", math.nan, 0, 0, 0)
    block = struct.pack(">HI", 1, len(nan)) + nan
    (here / "nan.ase").write_bytes(b"ASEF" + struct.pack(">HHI", 1, 0, 1) + block)
    for name in ("long.gpl", "nan.ase"):
        ran = toposeam("motif", "--palette", name, "--size", "32", "-o", "o.png")
        ran.fails(f"'{name}' is damaged")


def test_a_book_at_a_link_to_itself_is_told(toposeam, inputs, here):
    (here / "loop").symlink_to("loop")
    toposeam("book", inputs / "a.png", "-o", "loop").fails("'loop' is no folder")


def test_an_animation_that_lies_about_its_frames_is_told(toposeam, here):
    frames = [Image.new("RGB", (8, 8), (9 * index, 0, 0)) for index in range(6)]
    frames[0].save(here / "a.png", save_all=True, append_images=frames[1:], duration=40)
    content = (here / "a.png").read_bytes()
    at = content.index(b"acTL") + 4
    lie = b"acTL" + struct.pack(">II", 4_000_000_000, 0)
    content = content[: at - 4] + lie + struct.pack(">I", zlib.crc32(lie)) + content[at + 12 :]
    (here / "lie.apng").write_bytes(content)
    ran = toposeam("loop", "lie.apng", "-o", "o.gif")
    assert ran.code == 1, ran
    ran.is_one_sentence()
