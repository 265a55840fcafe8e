"""Images that are read by windows, as TIFF files that are nowhere."""

import numpy as np
import pytest
import tifffile

from toposeam.images import Windows
from toposeam_cli.files.writing import OutputError
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.media.pictures.raw import Coming, Stored
from toposeam_cli.media.pictures.tiff_stream import TiffStream


class Held(Windows):
    """An array, of which some rows cannot be read."""

    def __init__(self, values, broken=()):
        super().__init__(values.shape, values.dtype)
        self.values, self.broken = values, broken

    def read(self, rows, columns):
        if set(range(*rows.indices(self.shape[0]))) & set(self.broken):
            raise OSError("the drive is gone")
        return self.values[rows, columns]


def noise(shape, dtype):
    values = np.random.default_rng(0).random(shape) * (1 if dtype is np.float32 else np.iinfo(dtype).max)
    return values.astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(1, 1), (16, 5), (50, 7, 3), (33, 1, 3), (1, 90), (129, 40)])
def test_another_reader_finds_the_same_pixels(dtype, shape):
    values = noise(shape, dtype)
    stream = TiffStream(Held(values))
    with tifffile.TiffFile(stream) as file:
        assert file.is_bigtiff
        page = file.pages[0]
        found = page.asarray()
        assert page.tags["Compression"].value == 1
    np.testing.assert_array_equal(found.reshape(shape), values)
    stream.seek(0)
    whole = stream.read()
    for start, size in ((0, 3), (len(whole) // 2, 1000), (len(whole) - 2, 9), (len(whole), 5)):
        assert stream.seek(start) == stream.tell() == start
        assert stream.read(size) == whole[start : start + size]
    assert stream.seek(-3, 2) == len(whole) - 3
    assert stream.seek(1, 1) == len(whole) - 2


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [(), (3,)])
def test_libvips_writes_them(tmp_path, dtype, channels):
    values, alpha = noise((70, 90, *channels), dtype), noise((70, 90), dtype)
    write_picture(tmp_path / "out.tif", Picture(pixels=Held(values), alpha=Held(alpha)))
    again = read_picture(tmp_path / "out.tif")
    np.testing.assert_array_equal(again.pixels, values)
    np.testing.assert_array_equal(again.alpha, alpha)


@pytest.mark.parametrize("name", ["out.tif", "out.png", "out.jpg"])
@pytest.mark.parametrize("broken", [range(1), range(100, 101), range(299, 300)])
def test_rows_that_cannot_be_read_are_no_black_ones(tmp_path, name, broken):
    with pytest.raises(OutputError, match="cannot write"):
        write_picture(tmp_path / name, Picture(pixels=Held(noise((300, 200, 3), np.uint8), broken)))
    assert not list(tmp_path.iterdir())


def test_rows_that_are_to_come_are_waited_for_or_given_up(tmp_path):
    values, coming = noise((40, 30, 3), np.uint8), Coming()
    values.tofile(tmp_path / "raw")
    pixels = Stored([tmp_path / "raw"], values.shape, values.dtype, (0, 3), (4, 0, 40, 30), coming=coming)
    coming.up_to(24)
    np.testing.assert_array_equal(pixels[:20, :], values[4:24])
    coming.give_up()
    with pytest.raises(EOFError):
        pixels[:20, :]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(16, 5), (17, 5, 3), (49, 6), (33, 7, 3)])
def test_what_the_directory_says_is_so(shape, dtype):
    values = noise(shape, dtype)
    stream = TiffStream(Held(values))
    with tifffile.TiffFile(stream) as file:
        assert len(file.pages) == 1
        page = file.pages[0]
        assert page.photometric.name == ("RGB" if len(shape) == 3 else "MINISBLACK")
        assert page.samplesperpixel == (3 if len(shape) == 3 else 1)
        assert page.compression == 1
        offsets, counts = page.dataoffsets, page.databytecounts
        line = values[0].nbytes
        assert list(counts) == [
            len(values[at : at + page.rowsperstrip]) * line for at in range(0, shape[0], 16)
        ]
        assert list(np.diff(offsets)) == list(counts[:-1])
        # Nothing stands between the directory and the pixels, or behind these.
        assert offsets[0] + values.nbytes == stream.seek(0, 2)
        ends = [
            tag.valueoffset + tag.count * {3: 2, 4: 4, 16: 8}[tag.dtype]
            for tag in page.tags.values()
            if tag.valueoffset > page.offset + len(page.tags) * 20
        ]
    assert max(ends, default=offsets[0]) == offsets[0]


def test_the_stream_is_read_and_sought_as_files_are():
    values = noise((40, 5), np.uint16)
    stream = TiffStream(Held(values))
    assert (stream.readable(), stream.seekable(), stream.writable()) == (True, True, False)
    whole = stream.readall()
    assert whole[-values.nbytes :] == values.tobytes()
    assert stream.seek(-5) == 0  # there is nothing before
    assert stream.seek(7) == 7
    assert stream.seek(3, 1) == 10
    buffer = bytearray(b"x" * 40)
    stream.seek(-30, 2)
    assert stream.readinto(buffer) == 30
    assert bytes(buffer) == whole[-30:] + b"x" * 10
    assert stream.tell() == len(whole)
    assert stream.readinto(buffer) == 0


def test_strips_are_made_once_in_a_row_and_in_little_endian():
    class Counted(Held):
        asked = ()

        def read(self, rows, columns):
            self.asked += ((rows, columns),)
            return super().read(rows, columns)

    values = noise((40, 5, 3), np.uint16).astype(">u2")
    pixels = Counted(values)
    stream = TiffStream(pixels)
    begin = stream.seek(0, 2) - values.nbytes
    stream.seek(0)
    assert stream.read(begin)
    assert not pixels.asked
    found = b"".join(iter(lambda: stream.read(77), b""))
    assert found == values.astype("<u2").tobytes()
    assert pixels.asked == tuple((slice(*rows), slice(0, 5)) for rows in ((0, 16), (16, 32), (32, 40)))
