"""Pipes, devices and lists of files where a file belongs: nobody waits for what never comes to an end."""

import os

import numpy as np
import pytest
from PIL import Image

from toposeam_cli.stitching.enblend_line import files_of


@pytest.mark.parametrize("place", ["pipe.toml", "/dev/zero", "/dev/null", "."])
def test_a_file_of_parameters_that_is_no_file(toposeam, folder, place):
    os.mkfifo(folder / "pipe.toml")
    toposeam("motif", "--config", place, "-o", "o.png", "--size", "32").fails("not a regular file")


PIPES = [
    ("loop", "pipe.mp4", "-o", "o.gif"),
    ("loop", "pipe.gif", "-o", "o.gif"),
    ("loop", "pipe.xyz", "-o", "o.gif"),
    ("volume", "pipe.tif", "pipe.tif", "--offset", "0,0,1", "-o", "o.tif"),
    ("volume", "pipe.npy", "pipe.npy", "--offset", "0,0,1", "-o", "o.tif"),
    ("volume", "stack.zarr", "stack.zarr", "--offset", "0,0,1", "-o", "o.tif"),
    ("motif", "--palette", "pipe.gpl", "-o", "o.png", "--size", "32"),
    ("motif", "--palette", "pipe.ase", "-o", "o.png", "--size", "32"),
    ("stitch", "pipe.ora", "-o", "o.png"),
    ("stitch", "a.png", "b.png", "--overlap", "20", "-o", "o.png", "--use-seam", "pipe.svg"),
    ("path", "pipe.png", "--from", "1,1", "--to", "5,5", "-o", "o.svg"),
    ("enblend", "@pipe.txt", "-o", "o.png"),
    ("enblend", "@/dev/zero", "-o", "o.png"),
    ("enblend", "pipe.tif", "a.png", "-o", "o.tif"),
    ("enblend", "a.png", "b.png", "-o", "o.tif", "--load-masks", "pipe.tif"),
    ("stitch", "a.png", "b.png", "--overlap", "20", "-o", "o.png", "--avoid", "pipe.png"),
    ("stitch", "a.png", "b.png", "--overlap", "20", "-o", "o.png", "--mask-for", "0=pipe.png"),
    ("fill", "a.png", "--mask", "pipe.png", "-o", "o.png"),
    ("synth", "a.png", "--also", "pipe.png", "--size", "32", "-o", "o.png"),
    ("synth", "a.png", "--use-coordinates", "pipe.tif", "-o", "o.png"),
    ("loop", "clip.gif", "--still", "pipe.png", "-o", "o.gif"),
    ("motif", "--like", "pipe.png", "-o", "o.png"),
    ("motif", "--like", "pipe.svg", "-o", "o.png"),
    ("motif", "--base", "pipe.png", "--size", "32", "-o", "o.png"),
    ("repeat", "pipe.png", "2x2", "-o", "o.png"),
    ("join", "pipe.png", "pipe.png", "-o", "o.png"),
    ("mockup", "pipe.png", "--on", "tie", "-o", "o.png"),
    ("book", "pipe.png", "-n", "1", "-o", "folder"),
    ("compare", "pipe.png", "b.png", "--overlap", "20"),
]


@pytest.mark.timeout(60)  # else they are waited for, for ever
@pytest.mark.parametrize("line", PIPES, ids=lambda line: " ".join(line))
def test_nobody_waits_for_what_comes_through_a_pipe(toposeam, folder, photographs, line):
    (folder / "stack.zarr").mkdir()
    for name in ("mp4", "gif", "xyz", "tif", "npy", "gpl", "ase", "ora", "svg", "png", "txt"):
        os.mkfifo(folder / f"pipe.{name}")
    frames = [Image.fromarray(np.roll(photographs[0], step, 1)) for step in range(8)]
    frames[0].save("clip.gif", save_all=True, append_images=frames[1:], duration=50)
    for name in (".zarray", ".zgroup", "zarr.json"):
        os.mkfifo(folder / "stack.zarr" / name)
    toposeam(*line).fails("not a regular file")


@pytest.mark.parametrize(
    ("content", "phrase"),
    [
        (b"a\0.png\n", "no name holds NUL"),
        (b"\xff\xfe", "is not UTF-8"),
        (b"a.png\n" * 2**18, "larger than 1 MiB"),
        (b"/nowhere/*.png\n", "no such file"),
        (b"**x\n", "no such file"),
        (b"[\n", "no such file"),
    ],
)
def test_a_list_of_pictures_that_is_none(toposeam, folder, photographs, content, phrase):
    (folder / "list.txt").write_bytes(content)
    toposeam("enblend", "@list.txt", "-o", "o.tif").fails(phrase)


def test_a_list_of_pictures_may_hold_patterns(toposeam, folder, photographs):
    (folder / "[odd]").mkdir()
    for name in "ab":
        (folder / f"{name}.png").rename(folder / "[odd]" / f"{name}.png")
    (folder / "[odd]" / "list.txt").write_text(f"[a].png\n{folder.resolve()}/[[]odd]/b.*\n")
    assert [path.name for path in files_of(["@[odd]/list.txt"])] == ["a.png", "b.png"]


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    "text",
    [
        "#EXTM3U\n#EXT-X-TARGETDURATION:10\n#EXTINF:10,\npipe.ts\n#EXT-X-ENDLIST\n",
        "ffconcat version 1.0\nfile pipe.ts\n",
    ],
    ids=["hls", "concat"],
)
def test_a_video_that_is_a_list_of_other_files_is_none(toposeam, folder, text):
    pytest.importorskip("av")
    os.mkfifo(folder / "pipe.ts")
    (folder / "clip.mp4").write_text(text)
    toposeam("loop", "clip.mp4", "-o", "o.gif").fails("cannot be read as a video")
