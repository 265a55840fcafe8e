"""What we write as SVG, and what editors write."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from svg_documents import GIMP_3_0, document, lines, one, path

from toposeam.errors import OptionError, PathError
from toposeam.vector import svg_shapes
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg import read_svg, write_svg

# GIMP 3.2 numbers the ids and puts the name in the title; a closed stroke comes back to its first point
# before its Z.
GIMP_3_2 = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 20010904//EN"
              "http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd">
<svg xmlns="http://www.w3.org/2000/svg" width="211.667mm" height="158.75mm" viewBox="0 0 800 600">
  <path id="path1" fill="none" stroke="black" stroke-width="1"
        d="M 100.00,100.00 C 100.00,100.00 200.00,100.00 200.00,100.00
             200.00,100.00 200.00,200.00 200.00,200.00
             200.00,200.00 100.00,100.00 100.00,100.00 Z">
    <title>seam 1 &amp; more</title>
  </path>
</svg>
"""


# As Inkscape saves a document in millimetres: 800 × 600 px, a hidden layer, layers with transforms,
# definitions with paths in them.
INKSCAPE = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<!-- Created with Inkscape (http://www.inkscape.org/) -->
<svg width="211.66667mm" height="158.75mm" viewBox="0 0 211.66667 158.75" version="1.1" id="svg5"
   inkscape:version="1.2.2 (b0a8486541, 2022-12-01)"
   sodipodi:docname="seam.svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"
   xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" xmlns="http://www.w3.org/2000/svg" xmlns:svg="http://www.w3.org/2000/svg">
  <metadata id="toposeam">{"method": "heat", "cost": 1.5}<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"/></metadata>
  <sodipodi:namedview id="namedview7" pagecolor="#ffffff" inkscape:document-units="mm" inkscape:zoom="0.7">
    <inkscape:grid type="xygrid" id="grid1" />
  </sodipodi:namedview>
  <defs id="defs2"><path id="arrow" d="M 0,0 9,9" />
  <inkscape:path-effect effect="spiro" id="path-effect1" /></defs>
  <g inkscape:label="Layer 1" inkscape:groupmode="layer" id="layer1" transform="translate(10,-5)">
    <g id="g1" transform="matrix(0,1,-1,0,0,0)">
      <path style="fill:none;stroke:#000000;stroke-width:0.264583px" d="m 5,-42.916667 h 158.75" id="path111"
         sodipodi:nodetypes="cc"><title id="title1">main seam</title></path>
    </g>
    <path d="M 0,5 0,31.458333" id="path112" inkscape:label="named in the layers panel" />
  </g>
  <g inkscape:groupmode="layer" id="layer2" style="opacity:1;display:none">
  <path d="M 0,0 5,5" id="hidden" /></g>
</svg>
"""


def test_written_document_is_plain_and_exact():
    text = write_svg(
        [Polyline([[2, 0], [2, 3], [5.25, 3]]), Polyline([[1, 1], [2, 1], [2, 2]], closed=True)],
        6,
        4,
        {"method": "heat"},
    )
    assert text == (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<svg xmlns="http://www.w3.org/2000/svg" width="6" height="4" viewBox="0 0 6 4">\n'
        '  <metadata id="toposeam">{"method": "heat"}</metadata>\n'
        '  <path id="seam 1" fill="none" stroke="#e6007e" stroke-width="1" d="M2,0 L2,3 5.25,3">\n'
        "    <title>seam 1</title>\n"
        "  </path>\n"
        '  <path id="seam 2" fill="none" stroke="#e6007e" stroke-width="1" d="M1,1 L2,1 2,2 Z">\n'
        "    <title>seam 2</title>\n"
        "  </path>\n"
        "</svg>\n"
    )


json_values = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=6,
)


@pytest.mark.medium
@settings(deadline=None)
@given(
    st.lists(lines, min_size=1, max_size=3),
    st.integers(1, 99999),
    st.integers(1, 99999),
    st.dictionaries(st.text(), json_values),
)
def test_what_was_written_is_read_back_equal(polylines, width, height, metadata):
    back = read_svg(write_svg(polylines, width, height, metadata))
    assert (back.width, back.height, back.metadata) == (width, height, metadata)
    for line, same in zip(polylines, back.polylines, strict=True):
        assert line.closed == same.closed
        np.testing.assert_array_equal(line.points, same.points)


@pytest.mark.medium
@settings(deadline=None)
@given(st.lists(st.text(), min_size=1, max_size=4))
def test_any_names_give_a_readable_document(names):
    back = read_svg(write_svg([Polyline([[0, 0], [1, 1]])] * len(names), 5, 5, {}, names))
    assert len(back.names) == len(names)
    for name, same in zip(names, back.names, strict=True):
        if name.isascii() and name.isprintable() and name.strip():
            assert same == " ".join(name.split())


def test_equal_names_get_different_ids_and_keep_their_titles():
    text = write_svg([Polyline([[0, 0], [1, 1]])] * 2, 5, 5, {}, ["left <1>", "left <1>"])
    assert 'id="left &lt;1&gt;"' in text
    assert 'id="left &lt;1&gt; (2)"' in text
    assert read_svg(text).names == ("left <1>", "left <1>")


def test_settings_may_hold_numpy_values():
    text = write_svg([], 5, 5, {"cost": np.float32(0.5), "count": np.int64(3), "side": np.array([1, 2])})
    assert json.loads(text.split('toposeam">')[1].split("</metadata>")[0]) == {
        "cost": 0.5,
        "count": 3,
        "side": [1, 2],
    }


@pytest.mark.parametrize("metadata", [{"cost": float("nan")}, {"what": object()}])
def test_settings_that_json_cannot_hold_are_refused(metadata):
    with pytest.raises(OptionError, match="cannot be written as JSON"):
        write_svg([], 5, 5, metadata)


def test_wrong_number_of_names_is_refused():
    with pytest.raises(OptionError, match="1 names for 0 paths"):
        write_svg([], 5, 5, {}, ["a"])


@pytest.mark.parametrize("size", [(0, 5), (5, -1)])
def test_picture_without_a_size_is_refused(size):
    with pytest.raises(OptionError, match="positive width and height"):
        write_svg([], *size, {})


def test_gimp_3_0_exports_count_pixels_at_any_resolution():
    seam = read_svg(GIMP_3_0)
    assert (seam.width, seam.height, seam.metadata, seam.names) == (800, 600, None, ("seam 1",))
    np.testing.assert_array_equal(
        seam.polylines[0].points, [[410, 0], [410, 120], [396.25, 120], [396.25, 600]]
    )


def test_export_of_gimp_3_2_has_its_name_in_the_title():
    seam = read_svg(GIMP_3_2)
    assert (seam.width, seam.height, seam.names) == (800, 600, ("seam 1 & more",))
    assert seam.polylines[0].closed
    np.testing.assert_allclose(seam.polylines[0].points, [[100, 100], [200, 100], [200, 200]])


def test_inkscape_units_layers_and_transforms_become_pixels():
    seam = read_svg(INKSCAPE)
    assert (seam.width, seam.height) == (800, 600)
    assert seam.names == ("main seam", "named in the layers panel")
    assert seam.metadata == {"method": "heat", "cost": 1.5}
    mm = 800 / 211.66667
    # (5, -42.916667) turned by the matrix is (42.916667, 5), moved by (10, -5)
    np.testing.assert_allclose(
        seam.polylines[0].points, [[52.916667 * mm, 0], [52.916667 * mm, 600]], atol=1e-9
    )
    np.testing.assert_allclose(seam.polylines[1].points, [[10 * mm, 0], [10 * mm, 100]], atol=1e-5)


def test_inkscape_keeps_metadata_and_pixels_of_our_document():
    text = write_svg([Polyline([[3, 0], [4, 6]])], 800, 600, {"seed": 7})
    text = text.replace('width="800" height="600"', 'width="211.66667mm" height="158.75mm"')
    text = text.replace("<metadata", '<metadata xmlns:cc="http://creativecommons.org/ns#"').replace(
        "{", '<cc:Work about="" />\n  {'
    )
    seam = read_svg(text)
    assert (seam.width, seam.height, seam.metadata) == (800, 600, {"seed": 7})
    np.testing.assert_array_equal(seam.polylines[0].points, [[3, 0], [4, 6]])


def test_size_that_is_given_overrules_the_units():
    line = one(document('<path d="M 0,0 50,25"/>'), size=(400, 200))
    np.testing.assert_array_equal(line.points, [[0, 0], [200, 100]])


@pytest.mark.parametrize(
    ("head", "size", "end"),
    [
        ('width="100" height="50"', (100, 50), (10, 10)),
        ('viewBox="0 0 100 50"', (100, 50), (10, 10)),
        ('width="100%" height="100%" viewBox="0,0,100,50"', (100, 50), (10, 10)),
        ('width="200px" height="100px" viewBox="0 0 100 50"', (200, 100), (20, 20)),
        ('width="200" height="100" viewBox="-5 5 100 50"', (200, 100), (30, 10)),
        ('width="300" height="100" viewBox="0 0 100 50"', (300, 100), (70, 20)),
        ('width="300" height="100" viewBox="0 0 100 50" preserveAspectRatio="none"', (300, 100), (30, 20)),
        ('width="75pt" height="37.5pt"', (100, 50), (10, 10)),
        ('width="1in" height="2.54cm" viewBox="0 0 1 1"', (96, 96), (960, 960)),
        # Editors round sizes: within 0.02 px of a whole number that number is meant.
        ('width="100.019" height="50" viewBox="0 0 100.019 50"', (100, 50), (9.9981, 10)),
        ('width="100.021" height="50" viewBox="0 0 100.021 50"', (100.021, 50), (10, 10)),
        # Physical units: a viewBox of the same number, to a thousandth, counts them; another one counts px.
        ('width="25.42mm" height="25.42mm" viewBox="0 0 25.4 25.4"', (96.0756, 96.0756), (37.825, 37.825)),
        ('width="25.43mm" height="25.43mm" viewBox="0 0 25.4 25.4"', (25.4, 25.4), (10, 10)),
        # Within 1 % of the drawing's shape the area is filled, beyond it the shape is kept.
        ('width="200" height="101" viewBox="0 0 100 50"', (200, 101), (20, 20.2)),
        ('width="200" height="102" viewBox="0 0 100 50"', (200, 102), (20, 21)),
    ],
)
def test_width_height_and_viewbox_are_understood(head, size, end):
    seam = read_svg(document('<path d="M 0,0 10,10"/>', head))
    assert (seam.width, seam.height) == pytest.approx(size, rel=1e-6)
    np.testing.assert_allclose(seam.polylines[0].points[1], end, rtol=1e-4)


@pytest.mark.parametrize(
    "head",
    [
        "",
        'width="100%" height="50"',
        'viewBox="0 0 0 5"',
        'viewBox="0 0 nan 5"',
        'viewBox="0 0 5"',
        'viewBox="a b c d"',
    ],
)
def test_document_that_does_not_say_its_size_is_refused(head):
    with pytest.raises(PathError, match="viewBox"):
        read_svg(document('<path d="M 0,0 10,10"/>', head))


SHAPES = {
    "line": ('<line x1="1" y1="2" x2="3" y2="4"/>', [[1, 2], [3, 4]], False),
    "line in units": ('<line x2="1in" y2="72pt"/>', [[0, 0], [96, 96]], False),
    "line in others": ('<line x1="6pc" y1="96px" x2="5.08cm" y2="25.4mm"/>', [[96, 96], [192, 96]], False),
    "polyline": ('<polyline points="1,2 3,4 5 6"/>', [[1, 2], [3, 4], [5, 6]], False),
    "polygon": ('<polygon points="1,2 3,4 5,6"/>', [[1, 2], [3, 4], [5, 6]], True),
    "rect": ('<rect x="1" y="2" width="3" height="4"/>', [[1, 2], [4, 2], [4, 6], [1, 6]], True),
    "relative path": ('<path d="m1,2 3,4h5v-6"/>', [[1, 2], [4, 6], [9, 6], [9, 0]], False),
    "crowded numbers": ('<path d="M1-2L.5.5 1e1-1E-1"/>', [[1, -2], [0.5, 0.5], [10, -0.1]], False),
    "no namespace": (None, [[1, 2], [3, 4]], False),
    "nested transforms": (
        '<g transform="translate(10)"><g transform="scale(2) translate(1 1)"><path transform="rotate(90)" '
        'd="M1,0 2,0"/></g></g>',
        [[12, 4], [12, 6]],
        False,
    ),
    "nested svg": (
        '<svg x="10" y="20" width="10" height="10" viewBox="0 0 1 1"><path d="M0,0 1,1"/></svg>',
        [[10, 20], [20, 30]],
        False,
    ),
}


@pytest.mark.parametrize(("inner", "points", "closed"), SHAPES.values(), ids=SHAPES.keys())
def test_shapes_become_lines(inner, points, closed):
    line = one(document(inner) if inner else '<svg width="9" height="9"><path d="M1,2 3,4"/></svg>')
    np.testing.assert_allclose(line.points, points, atol=1e-12)
    assert line.closed == closed


CURVES = {
    "circle": '<circle cx="50" cy="25" r="20"/>',
    "ellipse under a transform": '<ellipse transform="translate(50 25) scale(2 .5)" rx="10" ry="40"/>',
    "arc": '<path d="M 30,25 A 20,20 0 0 1 70,25 A 20 20 0 0 1 30 25 Z"/>',
    "small circle scaled up": '<g transform="translate(50 25) scale(1000)"><circle r=".02"/></g>',
}


@pytest.mark.parametrize("inner", CURVES.values(), ids=CURVES.keys())
def test_round_shapes_are_flattened_within_the_stated_tolerance(inner):
    line = one(document(inner))
    assert line.closed
    outline = np.concatenate([line.points, line.points[:1]])
    middles = (outline[1:] + outline[:-1]) / 2
    for points in (outline, middles):
        # cubics stand in for arcs of 30°, 4e-7 of the radius off
        assert np.abs(np.hypot(*(points - (50, 25)).T) - 20).max() < svg_shapes.FLATNESS_PX + 1e-4


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-500, 500), st.floats(-500, 500)), min_size=4, max_size=4), st.booleans())
def test_bezier_curves_stay_within_the_stated_tolerance(control, cubic):
    control = np.round(control, 3) if cubic else np.round(control, 3)[:3]
    data = (
        f"M{control[0][0]},{control[0][1]} {'C' if cubic else 'Q'} "
        f"{' '.join(f'{x},{y}' for x, y in control[1:])}"
    )
    try:
        line = one(path(data))
    except PathError:  # it comes back to where it began, and goes no further than the tolerance
        assert np.ptp(control, axis=0).max() <= 2 * svg_shapes.FLATNESS_PX
        return
    t = np.linspace(0, 1, 300)[:, np.newaxis]
    while len(control) > 1:
        control = [a + t * (b - a) for a, b in pairwise(control)]
    p, q = line.points[:-1], line.points[1:]
    along = np.clip(
        ((control[0][:, np.newaxis] - p) * (q - p)).sum(-1) / np.maximum(((q - p) ** 2).sum(-1), 1e-30), 0, 1
    )
    distance = np.hypot(
        *np.moveaxis(control[0][:, np.newaxis] - (p + along[..., np.newaxis] * (q - p)), -1, 0)
    ).min(axis=1)
    assert distance.max() <= svg_shapes.FLATNESS_PX + 1e-6


@pytest.mark.parametrize("handle", [-30, 40])
def test_a_curve_reaching_beyond_its_chord_is_fully_drawn(handle):
    x, y = one(path(f"M0,0 C {handle},0 {handle},0 10,0")).points.T
    t = np.linspace(0, 1, 300)
    there = 3 * handle * t * (1 - t) + 10 * t**3
    assert not y.any()
    assert (x.min(), x.max()) == pytest.approx((there.min(), there.max()), abs=0.1)


def test_straight_curves_need_no_extra_points():
    assert one(path("M0,0 C 0,0 30,40 30,40")).points.tolist() == [[0, 0], [30, 40]]


def test_subpaths_of_one_path_share_its_name():
    seam = read_svg(document('<path id="p" d="M0,0 1,1 M2,2 3,3 3,4 z L 9,9"/><path d="M5,5 6,6"/>'))
    assert seam.names == ("p", "p", "p", "seam 4")
    assert [line.points.tolist() for line in seam.polylines] == [
        [[0, 0], [1, 1]],
        [[2, 2], [3, 3], [3, 4]],
        [[2, 2], [9, 9]],
        [[5, 5], [6, 6]],
    ]
    assert [line.closed for line in seam.polylines] == [False, True, False, False]


def test_hidden_shapes_definitions_and_foreign_tags_are_skipped():
    hidden = (
        '<defs><path d="M0,0 1,1"/></defs><clipPath><path d="M0,0 1,1"/></clipPath><symbol><path d="M0,0 '
        '1,1"/></symbol><g display="none"><path d="M0,0 1,1"/></g><path style="stroke:red; display : none" '
        'd="M0,0 1,1"/><x:path xmlns:x="urn:other" d="M0,0 1,1"/><text>words</text><path '
        'd="M3,3"/><path/><circle r="0"/>'
    )
    assert one(document(hidden + '<path d="M5,5 6,6"/>')).points.tolist() == [[5, 5], [6, 6]]
    with pytest.raises(PathError, match="no visible path"):
        read_svg(document(hidden))


@pytest.mark.parametrize("text", ["{broken", "[1]", "{" * 100_000, '{"a":' * 100_000, "plain words", ""])
def test_metadata_of_others_is_no_settings(text):
    assert read_svg(document(f"<metadata>{text}</metadata><path d='M0,0 1,1'/>")).metadata is None
