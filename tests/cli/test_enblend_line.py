"""The command line of enblend, word by word."""

from pathlib import Path

import pytest

import toposeam as ts
from toposeam_cli.stitching.enblend_line import (
    CanvasFrame,
    blend_width,
    compression_of,
    files_of,
    frame_of,
    mask_name,
    understood,
    wrap_of,
)


@pytest.mark.parametrize(
    ("line", "words", "ignored"),
    [
        # as hugin_executor writes it
        (
            "-w -f720x360 --compression=LZW -o out.tif -- a.tif b.tif",
            "--wrap=horizontal --frame=720x360 --compression=LZW --output=out.tif a.tif b.tif",
            "",
        ),
        ("-o out.tif -x -a a.tif -w b.tif", "--output=out.tif --wrap=horizontal a.tif b.tif", ""),
        ("-whorizontal -oout.tif a b", "--wrap=horizontal --output=out.tif a b", ""),
        ("-wax -l5 a b", "--wrap=horizontal --levels=5 a b", ""),
        ("--wrap=none a -l 7 b", "--wrap=none --levels=7 a b", ""),
        ("-v -v --verbose=3 -v2 -m 1024 -b256 --gpu a b", "a b", ""),
        ("-z a b", "--compression=lzw a b", ""),
        ("--primary-seam-generator=nft --fine-mask a b", "a b", "--primary-seam-generator --fine-mask"),
        ("--primary-seam-generator graph-cut -d 16 -c a b", "a b", "--primary-seam-generator -d -c"),
        ("--coarse-mask --coarse-mask=4 --visualize a b", "a b", "--coarse-mask --coarse-mask --visualize"),
        ("--save-masks --load-masks=m%i.png a b", "--save-masks=mask-%n.tif --load-masks=m%i.png a b", ""),
        ("-V", "--version", ""),
        ("a -- -b.tif -", "a -b.tif -", ""),
    ],
)
def test_lines_are_understood(line, words, ignored):
    assert understood(line.split()) == (words.split(), ignored.split())


@pytest.mark.parametrize("line", ["--nonsense a b", "-o", "-q a b", "--frame=1x1 a b", "a -l"])
def test_what_enblend_has_not_either_is_refused(line):
    with pytest.raises(ts.OptionError):
        understood(line.split())


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("8000x4000", CanvasFrame(8000, 4000, 0, 0)),
        ("8000x4000+12+340", CanvasFrame(8000, 4000, 12, 340)),
        ("800x400-5+7", CanvasFrame(800, 400, -5, 7)),
        ("800x400+-5+-7", CanvasFrame(800, 400, -5, -7)),
    ],
)
def test_frames(text, frame):
    assert frame_of(text) == frame


@pytest.mark.parametrize("text", ["", "8000", "0x5", "5x0", "8000x4000+1", "axb"])
def test_no_frames(text):
    with pytest.raises(ts.OptionError, match="8000x4000"):
        frame_of(text)


def test_levels_modes_and_compressions():
    assert [blend_width(levels) for levels in ("auto", "AUTOMATIC", "-2", "1", "6", "29")] == [
        None,
        None,
        None,
        2.0,
        64.0,
        512.0,
    ]
    assert [wrap_of(mode) for mode in ("none", "Horizontal")] == [False, True]
    assert [compression_of(text) for text in ("LZW", "none", "packbits", "90", "jpeg:75", "jpeg", "0")] == [
        ("lzw", None),
        ("none", None),
        ("lzw", None),
        ("lzw", 90),
        ("lzw", 75),
        ("lzw", None),
        ("lzw", 1),
    ]
    for function, text in (
        (blend_width, "0"),
        (blend_width, "many"),
        (blend_width, "30"),
        (wrap_of, "vertical"),
        (wrap_of, "both"),
        (wrap_of, "round"),
        (compression_of, "zip"),
        (compression_of, "101"),
    ):
        with pytest.raises(ts.OptionError):
            function(text)


def test_lists_of_files(tmp_path):
    for name in ("a1.tif", "a2.tif", "b c.tif"):
        (tmp_path / name).touch()
    listed = tmp_path / "list.txt"
    listed.write_text("# views\na*.tif   # two\n\nb c.tif\n")
    assert files_of(["x.tif", f"@{listed}"]) == [
        Path("x.tif"),
        tmp_path / "a1.tif",
        tmp_path / "a2.tif",
        tmp_path / "b c.tif",
    ]
    listed.write_text("z*.tif\n")
    with pytest.raises(ts.OptionError, match="no such file"):
        files_of([f"@{listed}"])
    with pytest.raises(ts.OptionError, match=r"there is no file 'nowhere\.txt'"):
        files_of(["@nowhere.txt"])


def test_names_of_masks():
    source, output = Path("in/view.tif"), Path("out/pano.jpg")
    assert mask_name("mask-%n.tif", 2, source, output) == Path("mask-3.tif")
    assert mask_name("%d/%b-%i%e", 2, source, output) == Path("in/view-2.tif")
    assert mask_name("%D/%B_%f.png", 0, source, output) == Path("out/pano_view.tif.png")
    assert mask_name("%p%%.png", 0, source, output) == Path("in/view%.png")
    with pytest.raises(ts.OptionError, match="%q"):
        mask_name("%q.tif", 0, source, output)
