"""What the tests beside this have in common."""

import gzip
import struct
import zlib

import numpy as np
import pytest
import tifffile

from toposeam_cli.media.pictures.picture import Picture, write_picture

IN = "--overlap 20 -o out.png"  # where nothing is wrong with the placement and the output


SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="92" height="40" {}>{}</svg>'


def snapshot(folder):
    """Every entry of a folder with what it holds."""
    return {
        path.name: path.read_bytes() if path.is_file() and not path.is_symlink() else None
        for path in folder.iterdir()
    }


def png_that_claims(width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(1000)))
        + chunk(b"IEND", b"")
    )


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
    (folder / "damaged.heic").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(300))
    (folder / "raw.nef").write_bytes(b"II*\0" + bytes(300))
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
    tifffile.imwrite(
        folder / "bands.tif", np.zeros((40, 56, 7), np.uint8), photometric="minisblack", planarconfig="contig"
    )
    tifffile.imwrite(folder / "complex.tif", np.ones((40, 56), np.complex64))
    write_picture(folder / "clear.png", Picture(pixels=noise, alpha=np.zeros((40, 56), np.uint8)))
    tifffile.imwrite(folder / "pages.tif", np.stack([noise] * 3), photometric="rgb")
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
        "entities": "<!DOCTYPE svg ["
        + "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10 if i else "ha"}">' for i in range(9))
        + "]>"
        + SVG.format("", f"<title>&l8;</title>{across}"),
        "outside": '<!DOCTYPE svg [<!ENTITY secret SYSTEM "file:///etc/hostname">]>'
        + SVG.format("", f"<title>&secret;</title>{across}"),
        "rules": "<!DOCTYPE svg [<!ELEMENT svg ANY>]>" + SVG.format("", across),
        "undefined": SVG.format("", f"<title>&what;</title>{across}"),
        "not-xml": "<svg><path",
        "not-svg": "<html><body/></html>",
        "blank": " \n",
        "crowded": SVG.format("", '<path d="M0 0 ' + "1 " * 2_100_000 + '"/>'),
        "deep": SVG.format("", "<g>" * 50_000 + "</g>" * 50_000),
    }
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


def arguments(line, inputs):
    return [
        word.replace("{in}", str(inputs)).format(a=inputs / "a.png", b=inputs / "b.png")
        for word in line.split()
    ]
