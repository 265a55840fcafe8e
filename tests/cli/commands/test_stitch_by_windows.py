"""Pictures that wait in files, and results rendered window by window: the same as in memory."""

import errno
import os
import re
from threading import Event

import numpy as np
import pytest
import pyvips
from three_pictures import AT, FILES, crop

import toposeam as ts
from stitching import PROFILE, names, told
from toposeam.layers.canvas import tile_map as maps
from toposeam.layers.composite import composition, painter
from toposeam.layers.labelling import pair_cost
from toposeam.layers.search import cost_coarsening as reduction
from toposeam_cli.files import scratch
from toposeam_cli.files.temporary import remove_stale
from toposeam_cli.media.pictures import picture as picture_files
from toposeam_cli.media.pictures import stored as stored_pictures
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching import file_sink
from toposeam_cli.stitching import inputs as placing


@pytest.fixture
def stored(monkeypatch):
    """Every picture waits in a file, and every canvas is one of tiles."""
    monkeypatch.setattr(placing, "STORED_PIXELS", 0)
    monkeypatch.setattr("toposeam_cli.jobs.crew.processes_of", lambda _: 1)  # others know the true sizes
    for module, name, value in (
        (maps, "DENSE_PIXELS", 0),
        (maps, "TILE", 16),
        (painter, "BLOCK", 64),
        (composition, "BLOCK", 32),
        (file_sink, "BLOCK", 32),
        (pair_cost, "KEPT_PIXELS", 500),
        (reduction, "KEPT_TOGETHER", 500),
    ):
        monkeypatch.setattr(module, name, value)


@pytest.mark.medium
@pytest.mark.parametrize(
    "options",
    [
        "out.tif",
        "out.png --match-tones --blend multiband",
        "out.tif --match-shading",
        "out.tif --blend feather --compression lzw",
        "out.jpg",
        "out.jpg --background #336699 --quality 80",
        "out.tif --crop inside",
        "out.png --crop 20,10,90,60",
        "out.webp --blend soft",
    ],
)
def test_what_is_written_is_what_it_is_in_memory(three, toposeam, options, monkeypatch, request):
    words = ["stitch", *FILES, *AT, "-o", *options.split(), "--labels", "labels.png", "--overlay", "o.png"]
    assert toposeam(*words, "--seam", "s.svg").code == 0
    names_before = names(three)
    outputs = [options.split()[0], "labels.png", "s.svg"]
    before = {name: (three / name).read_bytes() for name in outputs}
    pictures = {name: read_picture(name) for name in outputs[:2]}
    overlay = read_picture("o.png")
    request.getfixturevalue("stored")
    monkeypatch.setattr(ts.layers.Composition, "_picture", None)  # nothing is painted at once
    ran = toposeam(*words, "--seam", "s.svg", "--force")
    assert ran.code == 0, ran
    for name, picture in pictures.items():
        again = read_picture(name)
        np.testing.assert_array_equal(again.pixels, picture.pixels)
        assert (again.alpha is None) == (picture.alpha is None)
        if picture.alpha is not None:
            np.testing.assert_array_equal(again.alpha, picture.alpha)
        assert again.resolution == picture.resolution
    seams, seams_before = (
        ts.vector.read_svg(text) for text in ((three / "s.svg").read_bytes(), before["s.svg"])
    )
    assert seams.names == seams_before.names
    for line, other in zip(seams.polylines, seams_before.polylines, strict=True):
        np.testing.assert_array_equal(line.points, other.points)
    np.testing.assert_array_equal(read_picture("o.png").pixels, overlay.pixels)
    assert (overlay.pixels == (230, 30, 40)).all(axis=2).any()
    assert names(three) == names_before


def test_an_overlay_is_drawn_though_no_seam_was_asked_for(three, toposeam, stored, monkeypatch):
    """Quiet, nobody has made the seams before the layers' files are emptied, which here is so at once."""
    monkeypatch.setattr(scratch, "Thread", AtOnce)
    for overlay, quiet in (("told.png", []), ("quiet.png", ["-q"])):
        ran = toposeam("stitch", *FILES, *AT, "-o", "out.tif", "--overlay", overlay, *quiet, "--force")
        assert ran.code == 0, ran
    drawn = read_picture("told.png").pixels
    assert (drawn == (230, 30, 40)).all(axis=2).any()
    np.testing.assert_array_equal(read_picture("quiet.png").pixels, drawn)


def test_a_seam_is_the_same_file_wherever_pixels_are_kept(three, toposeam, request):
    words = ["stitch", "a.png", "b.png", "--offset", "40,4", "-o", "out.png", "--force", "--seam"]
    assert toposeam(*words, "here.svg").code == 0
    request.getfixturevalue("stored")
    assert toposeam(*words, "there.svg").code == 0
    here = (three / "here.svg").read_bytes()
    assert b'id="a.png : b.png"' in here
    assert (three / "there.svg").read_bytes() == here


class AtOnce:
    """A thread that has done its work when it has started."""

    def __init__(self, target, args, daemon):
        self.start = lambda: target(*args)

    def join(self):
        pass


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("--offset 40,4 --blend soft --blend-width 20", "has no width"),
        ("c.png --at 0,0 --at 40,4 --at 40000,40000", "megapixels"),
    ],
)
def test_what_is_refused_is_so_before_tones_match(three, toposeam, stored, monkeypatch, options, reason):
    monkeypatch.setattr("toposeam_cli.stitching.joining.toned_layers", None)
    before = names(three)
    words = ["stitch", "a.png", "b.png", "-o", "out.tif", "--match-tones"]
    toposeam(*words, *options.split()).fails(reason)
    assert names(three) == before


def test_two_pictures_and_what_is_told(three, toposeam, stored):
    words = ["a.png", "b.png", "--offset", "40,4", "-o", "out.tif", "--labels", "l.png"]
    facts = told(toposeam("stitch", *words, "--json"))
    assert [layer["at"] for layer in facts["layers"]] == [[0, 0], [40, 4]]
    assert sum(layer["shown_px"] for layer in facts["layers"]) == (read_picture("out.tif").alpha > 0).sum()
    assert facts["seams"][0]["between"] == ["a.png", "b.png"]
    assert facts["seams"][0]["cost"] == pytest.approx(facts["cost"])
    line = toposeam("stitch", *words, "--force", "-v").out
    seam = r"seam of \d+ px by \S+, cost [\d.]+, \d\.\d\d s\n"
    assert re.fullmatch(seam + r"out\.tif: 100 × 54 px: .+\n", line)


def test_depths_profiles_and_gray_are_matched(three, toposeam, stored, monkeypatch):
    write_picture(
        "a.png", Picture(pixels=crop("a").astype(np.uint16) * 257, icc=PROFILE, resolution=(9, 9)), True
    )
    write_picture("b.png", Picture(pixels=crop("b")[..., 1]), True)
    assert toposeam("stitch", *FILES, *AT, "-o", "out.tif").code == 0
    result = read_picture("out.tif")
    monkeypatch.setattr(placing, "STORED_PIXELS", 10**9)
    assert toposeam("stitch", *FILES, *AT, "-o", "again.tif").code == 0
    again = read_picture("again.tif")
    assert result.pixels.dtype == np.uint16
    np.testing.assert_array_equal(result.pixels, again.pixels)
    np.testing.assert_array_equal(result.alpha, again.alpha)
    assert (result.icc, result.resolution) == (PROFILE, again.resolution)


@pytest.mark.medium
@pytest.mark.parametrize("output", ["out.jpg", "out.webp", "out.dzi"])
def test_a_format_of_fewer_bits_is_filled_some_rows_at_a_time(three, toposeam, output, request, monkeypatch):
    for name in FILES:
        deep = read_picture(name).pixels.astype(np.uint16) * 257 + 100
        write_picture(name, Picture(pixels=deep[..., 0] if "webp" in output else deep), True)
    words = ["stitch", *FILES, *AT, "--background", "white", "-o", output]
    assert toposeam(*words).code == 0
    before = _written(three, output)
    request.getfixturevalue("stored")
    monkeypatch.setattr(stored_pictures, "_ROWS", 16)
    heights, real = [], picture_files.to_depth

    def recorded(values, dtype):
        heights.append(len(values))
        return real(values, dtype)

    monkeypatch.setattr(picture_files, "to_depth", recorded)
    assert toposeam(*words, "--force").code == 0
    assert max(heights) == 16
    np.testing.assert_array_equal(_written(three, output), before)


def _written(folder, output):
    """The pixels of a picture, or of the first of its largest tiles."""
    if not output.endswith(".dzi"):
        return read_picture(output).pixels
    deepest = max((folder / "out_files").iterdir(), key=lambda path: int(path.name))
    return read_picture(deepest / "0_0.jpg").pixels


@pytest.mark.medium
@pytest.mark.parametrize("in_files", [False, True])
def test_a_pyramid_has_the_picture_at_every_size(three, toposeam, in_files, request):
    if in_files:
        request.getfixturevalue("stored")
    words = ["stitch", *FILES, *AT, "--background", "white", "-o"]
    assert toposeam(*words, "out.png").code == 0
    assert toposeam(*words, "out.tif", "--pyramid").code == 0
    assert toposeam(*words, "out.dzi").code == 0
    flat = read_picture("out.png").pixels
    np.testing.assert_array_equal(read_picture("out.tif").pixels, flat)
    image = pyvips.Image.new_from_file("out.tif")
    assert image.get("tile-width") == 256
    tile = _written(three, "out.dzi")
    assert tile.shape == flat.shape
    assert np.abs(tile.astype(int) - flat).mean() < 6
    assert names(three) == [*FILES, "out.dzi", "out.png", "out.tif", "out_files"]
    toposeam(*words, "out.dzi").fails("--force")
    assert toposeam(*words, "out.dzi", "--force").code == 0
    assert names(three) == [*FILES, "out.dzi", "out.png", "out.tif", "out_files"]
    (three / "out.dzi").unlink()
    toposeam(*words, "out.dzi").fails("out_files' exists already")
    toposeam("stitch", *FILES, *AT, "-o", "other.png", "--pyramid").fails("--pyramid is for .tif")


@pytest.mark.parametrize("foreign", ["0/notes.txt", "thumbs.db", "mine/0_0.png"])
def test_a_folder_with_more_than_tiles_is_left_alone(three, toposeam, foreign):
    words = ["stitch", *FILES, *AT, "-o", "out.dzi", "--force"]
    assert toposeam(*words).code == 0
    (three / "out_files" / foreign).parent.mkdir(exist_ok=True)
    (three / "out_files" / foreign).write_text("precious")
    toposeam(*words).fails("which is no tile")
    assert (three / "out_files" / foreign).read_text() == "precious"


def test_transparent_deep_zoom_has_tiles_of_png(three, toposeam):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.dzi").code == 0
    deepest = max((three / "out_files").iterdir(), key=lambda path: int(path.name))
    assert (deepest / "0_0.png").exists()


ROW = ["stitch", "a.png", "b.png", "--offset", "40,0"]


def waited_for(monkeypatch):
    """After the first window no other is painted before somebody has begun to write the picture."""
    begun, painted, real = Event(), [], composition._painted

    def write(*arguments):
        begun.set()
        return compose(*arguments)

    def paint(whole, patches, box):
        if painted:
            assert begun.wait(60)
        painted.append(box)
        return real(whole, patches, box)

    compose = file_sink.write_composite
    monkeypatch.setattr(file_sink, "write_composite", write)
    monkeypatch.setattr(composition, "_painted", paint)
    return painted


@pytest.mark.parametrize("output", ["out.tif", "out.png", "out.jpg", "out.webp", "out.dzi", "holes.tif"])
def test_the_picture_is_written_while_it_is_painted(three, toposeam, monkeypatch, stored, output):
    words = [*ROW, "-o", output] if output != "holes.tif" else ["stitch", *FILES, *AT, "-o", output]
    monkeypatch.setattr(file_sink, "_known_full", lambda _: None)  # it is not before all is painted
    assert toposeam(*words).code == 0
    before = {path: path.read_bytes() for path in three.rglob("*") if path.is_file()}
    monkeypatch.undo()
    monkeypatch.chdir(three)
    monkeypatch.setattr(placing, "STORED_PIXELS", 0)
    monkeypatch.setattr(composition, "BLOCK", 32)
    monkeypatch.setattr(file_sink, "BLOCK", 32)
    monkeypatch.setattr("toposeam_cli.jobs.crew.processes_of", lambda _: 1)
    painted = waited_for(monkeypatch)
    assert toposeam(*words, "--force").code == 0
    assert len(painted) > 1
    assert {path: path.read_bytes() for path in three.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("fails", ["painting", "writing"])
def test_what_fails_while_the_picture_is_written_leaves_nothing(three, toposeam, monkeypatch, stored, fails):
    before = names(three)
    painted, paint = waited_for(monkeypatch), composition._painted

    def failing(*_):
        raise ts.ImageError("it is broken")

    if fails == "writing":
        monkeypatch.setattr(picture_files, "vips_image", failing)
    else:
        monkeypatch.setattr(composition, "_painted", lambda *box: failing() if painted else paint(*box))
    toposeam(*ROW, "-o", "out.tif").fails("it is broken")
    assert names(three) == before


@pytest.mark.parametrize("after", [1, 3, 4])
def test_a_disk_that_fills_up_meanwhile_leaves_nothing(three, toposeam, stored, monkeypatch, after):
    real, count = scratch.Path.open, iter(range(100))

    class Full:
        def __init__(self, file):
            self._file = file

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self._file.close()

        def seek(self, _):
            pass

        def write(self, _):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def opened(path, mode="r", *arguments, **options):
        file = real(path, mode, *arguments, **options)
        return Full(file) if mode == "r+b" and next(count) == after else file

    monkeypatch.setattr(scratch.Path, "open", opened)
    before = names(three)
    ran = toposeam("stitch", *FILES, *AT, "-o", "out.tif", "--labels", "labels.png")
    ran.fails("no space left on device")
    assert names(three) == before


def test_what_a_killed_command_left_is_removed(three, toposeam):
    left = three / ".toposeam-0123456789abcdef.part"
    left.write_bytes(b"pixels")
    remove_stale(three)
    assert names(three) == sorted(FILES)
