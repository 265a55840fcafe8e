"""Hugin's project files: what they say is where Hugin's own tools draw the pictures."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st

import toposeam as ts
from toposeam.layers.canvas import Box, CameraTransform, Layer, warped
from toposeam_cli.media.layouts.hugin_project import ProjectPicture, project_text, read_project
from toposeam_cli.media.layouts.tiff_place import tiff_place
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

PICTURES = """\
i w512 h400 f0 v50 Eev12.5 r-4 p3 y-15 a0 b-0.03 c0 d0 e0 n"left.jpg"
i w301 h451 f0 v35 Eev13 r88 p-12 y18 a0.01 b-0.02 c0.015 d6.5 e-9.25 n"sub folder/tall.jpg"
i w640 h360 f0 v62 r12 p17 y40 a0 b0.02 c0 d-12 e4 n"right.jpg"
"""
PANORAMAS = {
    "flat": "p f0 w1400 h901 v130",
    "cylinder": "p f1 w1801 h1001 v180",
    "sphere": "p f2 w2401 h1201 v360",
    "panini": 'p f19 w1801 h1101 v200 P"100 0 0"',
}
POINTS = [[(10, 20), (500, 390)], [(0, 450), (222.5, 31.25)], [(340, 300), (60, 330)]]
#: Of those pictures, where pano_trafo 2022.0 puts those points.
ORACLE = {
    "flat": [
        [(409.850279, 306.522648), (762.276919, 532.065358)],
        [(657.413649, 424.097887), (976.079707, 587.012469)],
        [(981.296726, 419.131883), (778.845567, 410.473412)],
    ],
    "cylinder": [
        [(483.921543, 311.520725), (1008.923764, 641.535795)],
        [(826.490226, 454.882168), (1302.977961, 683.58914)],
        [(1308.269482, 458.963678), (1036.701529, 432.544647)],
    ],
    "sphere": [
        [(923.037353, 478.568154), (1273.136002, 692.532918)],
        [(1151.479879, 569.974984), (1469.226558, 718.481549)],
        [(1472.755218, 572.681453), (1291.659653, 555.223173)],
    ],
    "panini": [
        [(613.110506, 407.88992), (971.993698, 644.114026)],
        [(851.493143, 520.146376), (1177.054013, 687.247431)],
        [(1181.016651, 519.217333), (990.510887, 504.911325)],
    ],
}


def project(folder, panorama=PANORAMAS["sphere"], pictures=PICTURES):
    path = folder / "some.pto"
    path.write_text(f"# hugin project file\n{panorama}\nm i0\n{pictures}c n0 N1 x1 y2 X3 Y4 t0\n", "utf-8")
    return path


@pytest.mark.parametrize("projection", PANORAMAS)
def test_points_lie_where_panotools_puts_them(tmp_path, projection):
    read = read_project(project(tmp_path, PANORAMAS[projection]))
    assert read.projection == projection
    for picture, points, expected in zip(read.pictures, POINTS, ORACLE[projection], strict=True):
        points = np.array(points, float)
        there = picture.transform.to_canvas(points)
        # The general Panini projection is the plain one but for 1/10000.
        tolerance = 0.05 if projection == "panini" else 5e-4
        np.testing.assert_allclose(there - read.origin, expected, rtol=0, atol=tolerance)
        np.testing.assert_allclose(picture.transform.to_picture(there), points, rtol=0, atol=1e-3)


def test_what_a_project_says(tmp_path):
    read = read_project(project(tmp_path))
    assert [picture.file.relative_to(tmp_path).as_posix() for picture in read.pictures] == [
        "left.jpg",
        "sub folder/tall.jpg",
        "right.jpg",
    ]
    assert [picture.size for picture in read.pictures] == [(512, 400), (301, 451), (640, 360)]
    assert [picture.exposure for picture in read.pictures] == [12.5, 13, None]
    assert read.size == (2402, 1201)  # Hugin widens spheres to even widths
    assert read.origin == (-1200.5, -600)
    assert read.whole_turn
    assert read.crop is None
    assert read.left_out == ()
    assert not read_project(project(tmp_path, PANORAMAS["cylinder"])).whole_turn


def test_links_crops_and_disabled_pictures(tmp_path):
    pictures = (
        '#-hugin  cropFactor=1\ni w512 h400 f0 v50 b0.01 d2 y1 j0 n"a.jpg"\n'
        "#-hugin  cropFactor=1 disabled\n"
        'i w512 h400 f3 v=0 a=0 b=0 c=0 d=0 e=0 y2 j=0 TrX0.5 n"b.jpg"\n'
        '#-hugin  cropFactor=1\ni w512 h400 f0 v=1 a=0 b=1 c=0 d=1 e=0 y3 S-5,300,10,999 n"/c.jpg"\n'
    )
    read = read_project(project(tmp_path, "p w400 h200 v90 f1 S10,390,0,200", pictures))
    first, last = read.pictures
    assert read.left_out == (("b.jpg", "disabled in Hugin"),)
    assert last.file == Path("/c.jpg")
    for value in ("focal", "lens", "shift"):
        assert getattr(first.transform, value) == getattr(last.transform, value)
    assert first.transform.lens == (0, 0.01, 0)
    assert (first.crop, last.crop) == (None, Box(10, 0, 400, 300))
    assert read.crop == Box(0, 10, 200, 390)


@pytest.mark.parametrize("projection", PANORAMAS)
def test_written_projects_read_back(tmp_path, projection):
    rng = np.random.default_rng(1)
    radius = 2160 / (2 * np.pi)
    turns = [*scipy.spatial.transform.Rotation.random(20, random_state=1).as_matrix()]
    turns += [np.eye(3), np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0.0]])]  # straight up
    pictures = [
        ProjectPicture(
            file=tmp_path / "sub" / f"{number} é.jpg",
            size=(300, 200),
            transform=CameraTransform(
                size=(300, 200),
                rotation=turn,
                focal=400 + 100 * rng.random(),
                projection=projection,
                radius=radius,
                lens=tuple(rng.normal(0, 0.02, 3)),
                shift=tuple(rng.normal(0, 5, 2)),
            ),
            exposure=None if number % 2 else 11 + rng.random(),
            crop=Box(1, 2, 100, 200) if number == 3 else None,
        )
        for number, turn in enumerate(turns)
    ]
    text = project_text(tmp_path, pictures, projection, (2160, 900), radius, crop=Box(0, 5, 900, 2000))
    path = tmp_path / "written.pto"
    path.write_text(text, "utf-8")
    read = read_project(path)
    assert (read.projection, read.size, read.crop) == (projection, (2160, 900), Box(0, 5, 900, 2000))
    assert read.whole_turn == (projection in ("cylinder", "sphere"))
    assert read.radius == pytest.approx(radius, abs=1e-6)
    for before, after in zip(pictures, read.pictures, strict=True):
        assert (after.file, after.size, after.crop) == (before.file, before.size, before.crop)
        assert before.exposure is None or after.exposure == pytest.approx(before.exposure)
        for value in ("rotation", "focal", "lens", "shift", "radius"):
            np.testing.assert_allclose(
                getattr(after.transform, value), getattr(before.transform, value), rtol=0, atol=1e-6
            )


def test_equal_lenses_are_linked(tmp_path):
    read = read_project(project(tmp_path, pictures='i w90 h60 v50 y1 n"a.jpg"\ni w90 h60 v50 y2 n"b.jpg"\n'))
    text = project_text(tmp_path, read.pictures, read.projection, read.size, read.radius)
    assert " v=0 a=0 b=0 c=0 d=0 e=0 " in text
    assert [picture.file.name for picture in read_project(project(tmp_path, "", text)).pictures] == [
        "a.jpg",
        "b.jpg",
    ]


def test_names_that_no_project_holds(tmp_path):
    (picture, *_) = read_project(project(tmp_path)).pictures
    for name in ('a".jpg', "a\n.jpg", "a\udc80.jpg"):
        odd = ProjectPicture(file=tmp_path / name, size=picture.size, transform=picture.transform)
        with pytest.raises(ts.OptionError, match="rename the file"):
            project_text(tmp_path, [odd], "sphere", (100, 50), 16.0)


def test_wider_than_a_project(tmp_path):
    pictures = read_project(project(tmp_path)).pictures
    with pytest.raises(ts.OptionError, match=r"360 degrees at most in this projection, not 390\.0"):
        project_text(tmp_path, pictures, "cylinder", (390, 50), 180 / np.pi)
    path = project(tmp_path, "", project_text(tmp_path, pictures, "sphere", (359, 50), 359 / 2 / np.pi))
    assert read_project(path).size == (360, 50)
    assert read_project(path).whole_turn


@pytest.mark.parametrize(
    ("panorama", "pictures", "told"),
    [
        ("", PICTURES, "no panorama"),
        ("p f2 w100 h50 v90", "", "no pictures"),
        ("p f2 w100 h50 v90", 'i w9 h9 v9 n"a"\n' * 1001, "1001 pictures"),
        ("p f12 w100 h50 v90", PICTURES, "projection f12; choose"),
        ('p f19 w100 h50 v90 P"50 0 0"', PICTURES, "parameters in Hugin to 100 0 0"),
        ("p f0 w100 h50 v180", PICTURES, "180 degrees wide"),
        ("p f2 w1e9 h50 v180", PICTURES, "has w1e9; write"),
        ("p f2 w10.5 h50 v180", PICTURES, "has w10.5; write w and a whole number"),
        ("p f2 w100 v180", PICTURES, "has no h; write"),
        ("p f2 w100 h50 v90 S5,5,1,9", PICTURES, "leaves nothing"),
        ("p f2 w100 h50 v90 S5,5", PICTURES, "left,right,top,bottom"),
        (None, 'i w9 h9 v9 f3 n"a"\n', r"not flat \(f3\)"),
        (None, 'i w9 h9 v9 TrX0.25 n"a"\n', r"another place \(TrX0.25\)"),
        (None, 'i w9 h9 v9 g2 n"a"\n', "sheared"),
        (None, 'i w9 h9 v190 n"a"\n', "less than 180"),
        (None, 'i w9 h9 n"a"\n', "has no v"),
        (None, 'i w9 h9 vnan n"a"\n', "has no v"),
        (None, 'i w9 h9 v1e999 n"a"\n', "has v1e999"),
        (None, 'i w9 h9 v=0 n"a"\n', "link it to an earlier picture"),
        (None, 'i w9 h9 v9 n"a"\ni w9 h9 v=99999999999 n"b"\n', "link it to an earlier picture"),
        (None, "i w9 h9 v9\n", "has no file name"),
        (None, 'i w9 h9 v9 n"a\x00"\n', "has no file name"),
        (None, 'i w9 h9 v9 n"a"\ni w9 h9 v9 j=0 n"b"\n', "belongs to a stack"),
        (None, '#-hugin  cropFactor=1 disabled\ni w9 h9 v9 n"a"\n', "disabled pictures only"),
    ],
)
def test_refused(tmp_path, panorama, pictures, told):
    panorama = PANORAMAS["sphere"] if panorama is None else panorama
    with pytest.raises(ts.OptionError, match=told) as raised:
        read_project(project(tmp_path, panorama, pictures))
    assert "\n" not in str(raised.value)


def test_files_that_are_no_projects(tmp_path):
    path = tmp_path / "odd.pto"
    for content in (b"", b"\xff\xd8\xff\xe0\x00", b"\x00" * 99, b"p", b"i\np\n"):
        path.write_bytes(content)
        with pytest.raises(ts.OptionError):
            read_project(path)
    with path.open("wb") as file:
        file.truncate(2**28)
    with pytest.raises(ts.OptionError, match="larger than"):
        read_project(path)
    with pytest.raises(ts.OptionError, match="no file"):
        read_project(tmp_path / "none.pto")


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_changed_projects_are_read_or_refused(tmp_path_factory, data):
    text = f"{PANORAMAS['panini']} S1,2,3,4\n{PICTURES}"
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(start + 9, len(text))))
    change = data.draw(st.text('0123456789.=-eE,"\n\r\tvwnpySj\x00é ', max_size=8))
    path = tmp_path_factory.getbasetemp() / "changed.pto"
    path.write_text(text[:start] + change + text[end:], "utf-8", newline="")
    try:
        read = read_project(path)
    except ts.OptionError:
        return
    assert all(np.isfinite(picture.transform.rotation).all() for picture in read.pictures)


@pytest.mark.skipif(shutil.which("nona") is None, reason="needs Hugin's nona")
@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere"])
def test_nona_draws_the_same(tmp_path, projection):
    rng = np.random.default_rng(2)
    noise = scipy.ndimage.gaussian_filter(rng.normal(size=(451, 301, 3)), (4, 4, 0))
    pixels = np.clip(128 + 50 * noise / noise.std(), 0, 255).astype(np.uint8)
    write_picture(tmp_path / "tall.png", Picture(pixels=pixels))
    picture = PICTURES.splitlines()[1].replace("sub folder/tall.jpg", "tall.png").replace("Eev13", "")
    path = project(tmp_path, PANORAMAS[projection], f"{picture}\n")
    read = read_project(path)
    written = project_text(tmp_path, read.pictures, projection, read.size, read.radius)
    path.write_text(written.replace("m i0", "m i3"), "utf-8")
    subprocess.run(["nona", "-m", "TIFF_m", "-o", tmp_path / "view", path], check=True, capture_output=True)
    theirs = read_picture(tmp_path / "view0000.tif", 10**8)
    ours = warped(Layer(image=pixels, name="tall"), read.pictures[0].transform)
    x, y = tiff_place(tmp_path / "view0000.tif")
    left, top = (np.array([x, y]) + read.origin - ours.at).tolist()
    down, across = np.indices(theirs.alpha.shape)
    where = [down + top, across + left]  # half numbers where the panorama's size is even
    green = ours.image[..., 1].astype(float)
    expected, slope_y, slope_x = (
        scipy.ndimage.map_coordinates(plane, where, order=3) for plane in (green, *np.gradient(green))
    )
    inside = scipy.ndimage.binary_erosion(ours.alpha > 0, iterations=4).astype(float)
    both = (scipy.ndimage.map_coordinates(inside, where, order=1) > 0.999) & (theirs.alpha == 255)
    assert both.sum() > 50_000
    difference = theirs.pixels[..., 1][both] - expected[both]
    assert np.abs(difference).mean() < 1
    slopes = np.stack([slope_x[both], slope_y[both]], axis=1)
    shift = np.linalg.lstsq(slopes, difference, rcond=None)[0]
    assert np.hypot(*shift) < 0.05
