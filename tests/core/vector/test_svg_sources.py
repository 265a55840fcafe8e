"""Where SVG documents come from, and hostile ones."""

import subprocess
import sys

import numpy as np
import pytest
from svg_documents import GIMP_3_0, document, one, path
from svgelements import Path

from toposeam.errors import PathError
from toposeam.vector import svg_document, svg_shapes
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg import read_svg, write_svg


def test_document_comes_from_text_bytes_or_a_file(tmp_path):
    text = write_svg([Polyline([[0, 0], [1, 1]])], 5, 5, {}, ["Süd"])
    file = tmp_path / "seam.svg"
    file.write_text(text, encoding="utf-8")
    latin = text.replace("UTF-8", "ISO-8859-1").encode("latin-1")
    for source in (
        text,
        text.encode(),
        text.encode("utf-8-sig"),
        text.replace("UTF-8", "UTF-16").encode("utf-16"),
        latin,
        file,
        str(file),
    ):
        assert read_svg(source).names == ("Süd",)


@pytest.mark.parametrize("name", ["nowhere.svg", "", "\0", "x" * 5000])
def test_missing_file_is_one_sentence(tmp_path, name):
    with pytest.raises(PathError, match=r"cannot be read \(.*\); check the name"):
        read_svg(tmp_path / name)


UNREADABLE = {
    "empty": (b"", "empty"),
    "blank": (" \n", "empty"),
    "binary garbage": (bytes(range(256)) * 10, "not XML"),
    "png": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "not XML"),
    "compressed": (b"\x1f\x8b\x08\0\0\0\0\0", "plain SVG"),
    "cut short": (GIMP_3_0[:500], "not XML"),
    "html": ("<html><body/></html>", "<html>, not <svg>"),
    "other vocabulary": ('<svg xmlns="urn:other"/>', "not <svg>"),
    "unknown encoding": (b'<?xml version="1.0" encoding="klingon"?><svg/>', "not XML"),
    "lone surrogate": ("<svg>\ud800</svg>", "not XML"),
    "undefined entity": ("<svg>&nothing;</svg>", "not XML"),
    "no path": (document(""), "no visible path"),
    "empty path": (path(""), "no visible path"),
    "infinite": (path("M0,0 1e999,1"), "finite"),
    "overflow in a transform": (
        document('<path transform="scale(1e300) scale(1e300)" d="M0,0 1,1"/>'),
        "finite",
    ),
    "infinite curve": (path("M0,0 C 1,1 1e999,2 3,3"), "finite"),
    "nan": (path("M0,0 nan,1"), "cannot be read"),
    "no move": (path("L5,5 6,6"), "cannot be read"),
    "half a point": (path("M0,0 L5"), "cannot be read"),
    "h without number": (path("M0,0 H"), "cannot be read"),
    "bad transform": (document('<path transform="matrix(1,2)" d="M0,0 1,1"/>'), "transform"),
    "percent": (document('<circle r="50%"/>'), "cannot be read"),
}


@pytest.mark.parametrize(("source", "reason"), UNREADABLE.values(), ids=UNREADABLE.keys())
def test_unreadable_document_is_one_sentence(source, reason):
    with pytest.raises(PathError, match=reason) as caught:
        read_svg(source)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


LAUGHS = (
    '<!DOCTYPE lolz [<!ENTITY lol "lol">'
    + "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 9)).replace("&l0;", "&lol;")
    + "]>"
)


HOSTILE = {
    "billion laughs": LAUGHS + "<svg>&l8;</svg>",
    "external entity": '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]><svg>&x;</svg>',
    "external parameter entity": '<!DOCTYPE svg [<!ENTITY % x SYSTEM "http://127.0.0.1:9/x.dtd"> %x;]><svg/>',
    "default attributes": f'<!DOCTYPE svg [<!ATTLIST g x CDATA "{"x" * 9999}">]><svg>{"<g/>" * 999}</svg>',
    "unparsed entity": '<!DOCTYPE svg [<!NOTATION n SYSTEM "n"><!ENTITY x SYSTEM "x" NDATA n>]><svg/>',
}


@pytest.mark.parametrize("source", HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_xml_is_refused(source):
    for each in (source, source.encode()):
        with pytest.raises(PathError, match="save the path as plain SVG"):
            read_svg(each)


def test_references_to_other_files_are_never_followed(tmp_path):
    (tmp_path / "other.svg").write_text(path("M7,7 8,8"))
    inner = f'<use href="{tmp_path}/other.svg#p"/><image href="{tmp_path}/other.svg"/><path d="M0,0 1,1"/>'
    assert one(document(inner)).points.tolist() == [[0, 0], [1, 1]]


def test_document_above_the_size_limit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(svg_document, "LARGEST_BYTES", 2**20)
    text = document(f"<desc>{'x' * 2**20}</desc>")
    (tmp_path / "large.svg").write_text(text)
    for source in (text, text.encode(), tmp_path / "large.svg"):
        with pytest.raises(PathError, match="larger than 1 MiB"):
            read_svg(source)


MANY = {
    "lines": ("100 segments", path("M0,0 L" + " 1,1" * 1_001)),
    "one huge curve": ("1000 points", path("M0,0 C 1e15,0 -1e15,0 5,5")),
    "many large curves": ("1000 points", path("M0,0 C" + " 1e6,0 -1e6,0 5,5" * 90)),
    "horizontals": ("100 segments", path("M0,0H" + "1 2 " * 51)),
    "closings": ("100 segments", path("M0,0L1,1" + "Z" * 101)),
    "commands": ("100 segments", path("M0,0" + "L" * 101)),
    "tiny curves": ("100 segments", path("M0,0c" + " 1,1 1,1 0,0" * 101)),
    "tiny arcs": ("100 segments", path("M0,0a" + " 1,5 0 0 0 2,1" * 21)),
    "moves": ("100 segments", path("M0,0" * 101)),
    "circles": ("100 segments", document('<circle r="1"/>' * 6)),
    "transforms": (
        "100 segments",
        document(f'<g transform="{"scale(1)" * 30}"><path d="M0,0 1,1"/></g>' * 9),
    ),
    "elements": ("200 elements", document("<g/>" * 201)),
}


@pytest.mark.parametrize(("phrase", "text"), MANY.values(), ids=MANY.keys())
def test_too_much_is_refused(monkeypatch, phrase, text):
    monkeypatch.setattr(svg_shapes, "MOST_POINTS", 1_000)
    monkeypatch.setattr(svg_shapes, "MOST_SEGMENTS", 100)
    monkeypatch.setattr(svg_document, "MOST_ELEMENTS", 200)
    with pytest.raises(PathError, match=f"more than {phrase}"):
        read_svg(text)


def test_a_path_with_too_many_segments_after_closing_is_refused():
    with pytest.raises(PathError, match="more than 100 times"):
        read_svg(path("M0,0" + "l1,1z" * 102))


@pytest.mark.medium
def test_what_topo_seam_writes_of_a_very_long_seam_is_read():
    line = Polyline(
        np.cumsum(np.random.default_rng(0).integers(0, 2, (300_000, 2)), axis=0).astype(float), False
    )
    assert np.array_equal(read_svg(write_svg([line], 200_000, 200_000, {})).polylines[0].points, line.points)


@pytest.mark.parametrize(
    "data",
    [
        "M0,0 5,0 5,5Z",
        "M 0 0 L5,0L5 5 Z M7,7L8,8",
        "M-.5-.5L1-1 2-2",
        "M0,0L4,0 4,4ZL9,9",
        "M1e1,0L-2.5E-1,3",
    ],
)
def test_straight_paths_read_the_same_however_they_are_written(data):
    def lines(text):
        return [(line.points.tolist(), line.closed) for line in read_svg(path(text)).polylines]

    assert lines(data) == lines("".join(f"{data} m0,0"))  # the small m has it read the slow way


@pytest.mark.parametrize("length", ["1" * 200_000 + "!", "1" * 200_000, " " * 200_000 + "x"])
def test_absurd_lengths_are_no_lengths(length):
    assert (
        read_svg(
            f'<svg xmlns="{svg_document.NAMESPACE}" width="{length}" viewBox="0 0 9 9"><path d="M0,0 '
            '1,1"/></svg>'
        ).width
        == 9
    )


def test_deep_nesting_is_no_problem():
    assert len(read_svg(document("<g>" * 20_000 + '<path d="M0,0 1,1"/>' + "</g>" * 20_000)).polylines) == 1


def test_importing_svg_loads_no_parser():
    code = (
        "import sys, toposeam.vector.svg; print([name for name in ('svgelements', 'defusedxml', 'xml') "
        "if name in sys.modules])"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )


def test_each_subpath_with_curves_has_its_own_points():
    data = "M 0 0 L 4 0 C 5 0 6 1 6 2 M 10 10 L 14 10 C 15 10 16 11 16 12 L 16 20 z"
    lines = svg_shapes._flatten(Path(data), np.eye(3), svg_shapes.Budget())
    assert [closed for _, closed in lines] == [False, True]
    firsts = [points[0].tolist() for points, _ in lines]
    assert firsts == [[0, 0], [10, 10]]
    assert (lines[1][0] >= 10).all()
    assert np.abs(np.diff(lines[1][0], axis=0)).sum(axis=1).min() > 0  # no point twice
