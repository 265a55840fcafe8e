"""What cannot come in ends in one sentence."""

import io
import os

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from picture_samples import fails, png_file, refusal, sample, smooth
from PIL import Image

from toposeam_cli.media.pictures import decode
from toposeam_cli.media.pictures.libvips import load_vips
from toposeam_cli.media.pictures.picture import read_picture


def test_unreadable_files_are_refused_in_one_sentence(tmp_path):
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("hello " * 100)
    (tmp_path / "table.csv").write_text("1,2\n3,4\n")
    (tmp_path / "file").touch()
    (tmp_path / "drawing.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M0 0L5 5"/></svg>'
    )
    os.mkfifo(tmp_path / "pipe.png")
    assert "there is no file" in fails(read_picture, tmp_path / "missing.png")
    assert "there is no file" in fails(read_picture, tmp_path / "file" / "x.png")
    assert "folder" in fails(read_picture, tmp_path)
    assert "empty" in fails(read_picture, tmp_path / "empty.png")
    assert "export it again" in fails(read_picture, tmp_path / "text.png")
    assert "export it again" in fails(read_picture, tmp_path / "table.csv")
    assert "none of PNG, TIFF" in fails(read_picture, tmp_path / "drawing.svg")
    assert "regular file" in fails(read_picture, tmp_path / "pipe.png")
    assert "cannot read" in fails(read_picture, tmp_path / ("n" * 300))
    assert "cannot read" in fails(read_picture, tmp_path / "nul\0.png")


def test_an_unreadable_file_ends_in_one_sentence(tmp_path, monkeypatch):
    def fail(*arguments):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "in.png").touch()
    monkeypatch.setattr("pathlib.Path.open", fail)
    text = fails(decode.check_input, tmp_path / "in.png")
    monkeypatch.undo()
    assert "Permission denied" in text
    assert "right to read" in text


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".webp", ".gif", ".raw.tif"])
@pytest.mark.parametrize("kept", [0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_refused_in_silence(tmp_path, capfd, suffix, kept):
    path = tmp_path / f"in{suffix}"
    values = sample("uint8", 3, (100, 120))
    if suffix == ".raw.tif":
        tifffile.imwrite(path, values)  # pixels last: the header stays readable
    else:
        Image.fromarray(values).save(path, **({"compression": "tiff_lzw"} if suffix == ".tif" else {}))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * kept)])
    assert "damaged" in fails(read_picture, path)
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


def test_every_prefix_of_a_small_file_is_refused_or_read(tmp_path, capfd):
    whole = io.BytesIO()
    Image.fromarray(sample("uint8", 3, (4, 5))).save(whole, "PNG", dpi=(300, 300))
    path = tmp_path / "in.png"
    for length in range(1, len(whole.getvalue())):
        path.write_bytes(whole.getvalue()[:length])
        text = refusal(path)
        assert "\n" not in text
        assert text or read_picture(path).pixels.shape == (4, 5, 3)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "size", [(100_000, 100_000), (1_000_000, 501), (2**31 - 1, 2**31 - 1), (2**31 - 1, 1), (0, 5), (5, 0)]
)
def test_a_huge_or_empty_header_is_refused_before_decoding(tmp_path, size):
    (tmp_path / "in.png").write_bytes(png_file(*size))
    text = fails(read_picture, tmp_path / "in.png")
    if size[0] in (100_000, 1_000_000):  # libvips itself refuses the others
        assert "--max-megapixels" in text
        assert f"{size[0]} x {size[1]}" in text
        assert "500 megapixels" in text


def test_the_pixel_limit_is_inclusive(tmp_path):
    Image.fromarray(smooth(40, 60)).save(tmp_path / "in.png")
    assert read_picture(tmp_path / "in.png", max_pixels=2400).pixels.shape == (40, 60, 3)
    assert "0.002399 megapixels" in fails(read_picture, tmp_path / "in.png", max_pixels=2399)


def test_depths_libvips_cannot_decode_end_in_one_sentence(tmp_path):
    for dtype in (np.float64, np.complex64, np.uint64):
        tifffile.imwrite(tmp_path / "in.tif", np.ones((4, 5), dtype), photometric="minisblack")
        text = fails(read_picture, tmp_path / "in.tif")
        assert "export it again" in text
        assert dtype != np.float64 or "32 bits" in text


def test_many_channels_end_in_one_sentence(tmp_path):
    tifffile.imwrite(
        tmp_path / "in.tif", np.ones((5, 6, 7), np.uint8), photometric="minisblack", planarconfig="contig"
    )
    assert "7 channels" in fails(read_picture, tmp_path / "in.tif")


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_damaged_files_are_read_or_refused_never_worse(tmp_path_factory, data):
    suffix = data.draw(st.sampled_from([".png", ".jpg", ".tif", ".webp", ".gif"]))
    whole = io.BytesIO()
    Image.fromarray(smooth(9, 13)).save(
        whole, {".jpg": "JPEG", ".tif": "TIFF"}.get(suffix, suffix[1:].upper())
    )
    content = bytearray(whole.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("damaged") / f"in{suffix}"
    path.write_bytes(content)
    assert "\n" not in refusal(path, max_pixels=10_000)


@pytest.mark.parametrize(
    "content",
    [
        b'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><rect width="9" height="9"/></svg>',
        b"1,2,3\n4,5,6\n",
        b"3 2\n1 2 3\n4 5 6\n",
        b"P5 3 2 255\n123456",
        b"%PDF-1.4\n",
        b"SIMPLE  =                    T",
    ],
    ids=["svg", "csv", "matrix", "pgm", "pdf", "fits"],
)
@pytest.mark.parametrize("name", ["in.png", "in.csv", "in.mat", "in.svg"])
def test_readers_of_what_is_no_picture_are_blocked(tmp_path, content, name):
    (tmp_path / name).write_bytes(content)
    assert "it is no picture" in fails(read_picture, tmp_path / name)
    vips = load_vips()
    for opened in (
        lambda: vips.Image.new_from_source(vips.Source.new_from_memory(content), ""),
        lambda: vips.Image.new_from_file(str(tmp_path / name)),
    ):
        with pytest.raises(vips.Error, match=r"not in a known format|not a known file format|is blocked"):
            opened()
