"""Focal lengths and exposures that cameras note in their files."""

import math

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from toposeam_cli.media.pictures.lens import equivalent_mm, exposure, focal_length, in_pixels, noted

SIZE = 60, 40
#: Tags of EXIF.
MM, IN_35, RESOLUTION, UNIT, WIDTH = 0x920A, 0xA405, 0xA20E, 0xA210, 0xA002


@pytest.fixture
def photograph(tmp_path):
    """A picture with notes of its camera; its name."""

    def write(notes, suffix=".jpg", size=SIZE):
        exif = Image.Exif()
        exif[0x0112] = 1  # PIL leaves out of a PNG what has no notes of its own
        exif.get_ifd(0x8769).update(notes)
        path = tmp_path / f"noted{suffix}"
        Image.new("RGB", size).save(path, exif=exif)
        return path

    return write


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp"])
def test_what_is_noted_as_of_film_is_by_the_diagonal(photograph, suffix):
    diagonal = math.hypot(24, 36)
    found = focal_length(noted(photograph({IN_35: 50}, suffix)), SIZE)
    assert found == pytest.approx(50 / diagonal * math.hypot(*SIZE))
    assert focal_length(noted(photograph({IN_35: 50}, suffix)), SIZE[::-1]) == found  # turned since


@pytest.mark.parametrize(
    ("unit", "per_unit"), [({UNIT: 2}, 25.4), ({}, 25.4), ({UNIT: 3}, 10), ({UNIT: 4}, 1), ({UNIT: 5}, 0.001)]
)
def test_pixels_of_the_sensor_are_counted(photograph, unit, per_unit):
    notes = {MM: IFDRational(18), RESOLUTION: IFDRational(round(4000 * per_unit), 1000), WIDTH: 60} | unit
    per_mm = round(4000 * per_unit) / 1000 / per_unit
    assert focal_length(noted(photograph(notes)), SIZE) == pytest.approx(18 * per_mm)


def test_a_picture_that_was_reduced_has_fewer_pixels(photograph):
    notes = {MM: IFDRational(18), RESOLUTION: IFDRational(40), UNIT: 4, WIDTH: 600}
    assert focal_length(noted(photograph(notes)), SIZE) == pytest.approx(18 * 40 / 10)


def test_what_is_noted_as_of_film_comes_first(photograph):
    notes = {MM: IFDRational(18), RESOLUTION: IFDRational(4), UNIT: 4, WIDTH: 60, IN_35: 28}
    assert focal_length(noted(photograph(notes)), SIZE) == pytest.approx(in_pixels(28, SIZE))


ABSURD = {
    "nothing": {},
    "zero": {IN_35: 0},
    "65535 mm": {IN_35: 65535},
    "1 mm": {IN_35: 1},
    "no resolution": {MM: IFDRational(18)},
    "no length": {RESOLUTION: IFDRational(4), UNIT: 4},
    "a length of zero": {MM: IFDRational(0), RESOLUTION: IFDRational(4), UNIT: 4},
    "divided by zero": {MM: IFDRational(18, 0), RESOLUTION: IFDRational(4), UNIT: 4},
    "resolution by zero": {MM: IFDRational(18), RESOLUTION: IFDRational(4, 0), UNIT: 4},
    "no such unit": {MM: IFDRational(18), RESOLUTION: IFDRational(4), UNIT: 9},
    "far too long": {MM: IFDRational(18000), RESOLUTION: IFDRational(4), UNIT: 4},
    "far too short": {MM: IFDRational(18, 100), RESOLUTION: IFDRational(4), UNIT: 4},
}


@pytest.mark.parametrize("notes", ABSURD.values(), ids=ABSURD)
def test_what_makes_no_sense_is_not_taken(photograph, notes):
    assert focal_length(noted(photograph(notes)), SIZE) is None


def test_files_without_readable_notes_have_none(photograph, tmp_path):
    path = photograph({IN_35: 50})
    content = path.read_bytes()
    start = content.index(b"Exif\0\0") + 6
    path.write_bytes(content[:start] + b"\xff" * 30 + content[start + 30 :])
    assert focal_length(noted(path), SIZE) is None
    path.write_bytes(content[:40])
    assert focal_length(noted(path), SIZE) is None
    assert focal_length(noted(tmp_path / "no such file.jpg"), SIZE) is None
    Image.new("RGB", SIZE).save(tmp_path / "plain.png")
    assert focal_length(noted(tmp_path / "plain.png"), SIZE) is None


SECONDS, F_NUMBER, ISO = 0x829A, 0x829D, 0x8827
TAKEN = {SECONDS: IFDRational(1, 125), F_NUMBER: IFDRational(56, 10), ISO: 400}


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp"])
def test_an_exposure_is_time_and_iso_by_the_square_of_the_stop(photograph, suffix):
    assert exposure(noted(photograph(TAKEN, suffix))) == pytest.approx(400 / 125 / 5.6**2)


@pytest.mark.parametrize(
    "notes",
    [
        {},
        {ISO: 400},
        TAKEN | {F_NUMBER: IFDRational(0)},
        TAKEN | {SECONDS: IFDRational(0)},
        TAKEN | {SECONDS: IFDRational(1, 0)},
    ],
)
def test_an_exposure_that_is_not_stated_whole_is_none(photograph, notes):
    assert exposure(noted(photograph(notes))) is None


@pytest.mark.parametrize("size", [(60, 40), (40, 60), (50, 50)])
def test_millimetres_and_pixels_are_inverse(size):
    assert equivalent_mm(in_pixels(35.0, size), size) == pytest.approx(35.0)
