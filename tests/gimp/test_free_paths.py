"""Of the half of the plug-in that needs no GIMP: lines as strokes, and which path is meant."""

from itertools import pairwise

import numpy as np
import pytest

import toposeam as ts
from toposeam.vector.polyline import trace_boundary
from toposeam_engine.lines import lines_of
from toposeam_gimp.image import curves
from toposeam_gimp.image import path_choice as choosing

#: A stroke of one straight piece, with handles on its anchors.
STRAIGHT = [1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2]
#: Two curves: a straight one and one with handles; what they stand for.
CURVES = [[0, 0, 0, 0, 5, 9, 5, 9], [5, 9, 8, 12, 8, 16, 5, 20]]
PIECES = [[0, 0, 0, 9, 5, 9], [5, 9, 7, 9, 7, 20, 5, 20]]
LINE = [0, 0, 0, 9, 5, 9, 7, 9, 7, 20, 5, 20]


def known_line(closed=False):
    curves_ = [*CURVES, [5, 20, 3, 20, 0, 5, 0, 0]] if closed else CURVES
    pieces = [*PIECES, [5, 20, 0, 20, 0, 0]] if closed else PIECES
    return {"stroke": curves.stroke_of(curves_, closed), "closed": closed, "pieces": pieces}


def test_curves_become_a_stroke_and_come_back():
    stroke = known_line()["stroke"]
    assert stroke == [0, 0, 0, 0, 0, 0, 5, 9, 5, 9, 8, 12, 8, 16, 5, 20, 5, 20]
    assert curves.curves_of(stroke, False) == CURVES
    ring = known_line(closed=True)["stroke"]
    assert ring[:2] == [0, 5]
    assert curves.curves_of(ring, True)[:2] == CURVES


def test_an_untouched_stroke_gives_the_exact_line():
    stroke = [value + 0.001 for value in known_line()["stroke"]]
    assert curves.lines_of([(stroke, False)], [known_line()]) == ([{"points": LINE, "closed": False}], False)
    ring = known_line(closed=True)
    (line,), touched = curves.lines_of([(ring["stroke"], True)], [ring])
    assert (line["points"], line["closed"], touched) == ([*LINE, 0, 20], True, False)


def test_only_what_was_bent_is_followed():
    stroke = known_line()["stroke"]
    stroke[-2] += 6  # the last anchor
    stroke[-4] += 6
    (line,), touched = curves.lines_of([(stroke, False)], [known_line()])
    assert touched
    assert line["points"][:6] == PIECES[0]
    assert line["points"][-2:] == [11, 20]
    assert len(line["points"]) > 12


@pytest.mark.parametrize("strokes", [[], [known_line()["stroke"], STRAIGHT]])
def test_strokes_added_or_removed_count_as_touched(strokes):
    assert curves.lines_of([(stroke, False) for stroke in strokes], [known_line()])[1]


def test_a_curve_is_followed_in_small_steps():
    points = curves.followed([0, 0, 0, 40, 60, 40, 60, 0])
    x, y = points[::2], points[1::2]
    assert (points[:2], points[-2:]) == ([0, 0], [60, 0])
    assert max(y) == pytest.approx(30, abs=0.05)
    assert all(abs(b - a) < 2 for a, b in pairwise(x))
    assert curves.followed([1, 2, 1, 2, 3, 4, 3, 4]) == [1, 2, 3, 4]


def path(name, *, own=False, selected=False, touched=False, newer=False):
    return choosing.Candidate(name=name, own=own, selected=selected, touched=touched, newer=newer)


OWN, BENT = path("own", own=True), path("own", own=True, touched=True)
CHOSEN = path("own", own=True, selected=True)


@pytest.mark.parametrize(
    ("candidates", "meant"),
    [
        ([OWN], ["own"]),
        ([CHOSEN, path("mine")], ["own"]),
        ([OWN, path("new 1", newer=True), path("new 2", newer=True)], ["new 1", "new 2"]),
        ([CHOSEN, path("new", newer=True)], ["own"]),
        ([OWN, path("new", newer=True), path("old", selected=True)], ["old"]),
        ([OWN, path("mine", selected=True)], ["mine"]),
        ([OWN, path("seam 1", selected=True), path("seam 2", selected=True)], ["seam 1", "seam 2"]),
        ([OWN, path("a : b", selected=True), path("a : b #1", selected=True)], ["a : b", "a : b #1"]),
    ],
)
def test_the_path_that_is_meant(candidates, meant):
    assert [one.name for one in choosing.chosen(candidates, "a : b").paths] == meant


def test_what_could_surprise_is_told():
    new = path("new", newer=True)
    assert choosing.chosen([OWN], "a : b").remark is None
    assert choosing.chosen([OWN, path("new", newer=True, selected=True)], "a : b").remark is None
    assert choosing.chosen([OWN, new], "a : b").remark == (
        "“new” was followed, the newest path of the seam a : b."
    )
    assert choosing.chosen([CHOSEN, new], "a : b").remark == (
        "“own” was followed, and not “new”, which is newer: the path that is selected counts."
    )


@pytest.mark.parametrize(
    ("candidates", "phrase"),
    [
        ([OWN, path("mine")], "“own”, “mine”. Select the one that counts"),
        ([OWN, path("mine"), path("new", newer=True)], "“mine”, “new”. Select the one that counts"),
        ([OWN, path("b", newer=True), path("c", newer=True)], "“b”, “c”. Select the one that counts"),
        ([BENT, path("new", newer=True)], "“own”, “new”. Select the one that counts"),
        ([CHOSEN, path("mine", selected=True)], "Select one of them"),
    ],
)
def test_a_doubt_is_a_sentence(candidates, phrase):
    with pytest.raises(choosing.UnclearError, match=phrase):
        choosing.chosen(candidates, "a : b")


@pytest.mark.parametrize(
    ("name", "seam", "does"),
    [
        ("a : b", "a : b", True),
        ("a : b #1", "a : b", True),
        ("a : b (2)", "a : b", True),
        ("a : c", "a : b", False),
    ],
)
def test_names_say_which_seam_a_path_is_for(name, seam, does):
    assert choosing.fits(name, seam) is does


def test_seams_of_the_command_line_are_known_by_their_names():
    assert [choosing.is_seam(name) for name in ("seam 1", "a.png : b.png #1", "my drawing", "seams")] == [
        True,
        True,
        False,
        False,
    ]


def stairs(offsets):
    """A seam from top to bottom, as pixels have it."""
    points = [(offsets[0], 0)]
    for row, x in enumerate(offsets):
        points += [(x, row), (x, row + 1)]
    return ts.vector.Polyline(np.array(points, float)[1:])


def corners(line):
    """All corners that the pieces of a line pass, also where they run straight on."""
    passed = set()
    for piece in line["pieces"]:
        for start, end in pairwise(np.reshape(piece, (-1, 2))):
            count = int(np.abs(end - start).max()) + 1
            passed |= set(map(tuple, np.linspace(start, end, count).tolist()))
    return passed


@pytest.mark.parametrize("cut", [0, 1])
def test_curves_are_kept_where_a_seam_runs_as_before(cut):
    offsets = np.rint(40 + 25 * np.sin(np.arange(600) / 30) + 8 * np.sin(np.arange(600) / 7)).astype(int)
    nowhere = np.zeros(2)
    (before,) = lines_of([stairs(offsets)], nowhere)
    changed = offsets.copy()
    changed[280:330] += 15
    line = stairs(changed)
    if cut:  # traced again, a line may end a pixel earlier
        line = ts.vector.Polyline(line.points[1:-1])
    (after,) = lines_of([line], nowhere, [before])
    assert after["curves"][cut:3] == before["curves"][cut:3]
    assert after["curves"][-3:-1] == before["curves"][-3:-1]
    assert cut or after["curves"][-1] == before["curves"][-1]
    assert set(map(tuple, line.points.tolist())) <= corners(after)
    for one, other in pairwise(after["curves"]):
        assert one[6:] == other[:2]
    assert lines_of([stairs(offsets)], nowhere, [before]) == [before]


def ring(radius, at):
    """A closed seam round some pixels."""
    y, x = np.mgrid[:400, :400]
    inside = np.hypot(x - at[0], y - at[1]) < radius + 6 * np.sin(np.arctan2(y - at[1], x - at[0]) * 5)
    (line,) = trace_boundary(inside, np.ones_like(inside))
    return line


def test_a_ring_keeps_its_curves_beside_a_new_one():
    nowhere = np.zeros(2)
    (before,) = lines_of([ring(80, (120, 120))], nowhere)
    shifted = ring(80, (120, 120))
    points = shifted.outline[:-1]
    turned = ts.vector.Polyline(np.roll(points, 57, axis=0), closed=True)  # begins elsewhere
    after, other = lines_of([turned, ring(40, (320, 320))], nowhere, [before])
    assert after["closed"]
    assert other["closed"]
    assert sorted(after["curves"]) == sorted(before["curves"])
    dented = ring(80, (120, 120)).outline[:-1]
    dented[(dented[:, 0] > 190)] -= [3, 0]
    (bent,) = lines_of([ts.vector.Polyline(dented, closed=True)], nowhere, [before])
    kept = [curve for curve in bent["curves"] if curve in before["curves"]]
    assert 0 < len(kept) < len(before["curves"])
    for one, next_one in pairwise([*bent["curves"], bent["curves"][0]]):
        assert one[6:] == next_one[:2]
    for one, next_one in pairwise([*bent["pieces"], bent["pieces"][0]]):
        assert one[-2:] == next_one[:2]


@pytest.mark.parametrize("place", [10, 20])
def test_a_seam_that_bends_where_curves_meet_stays_whole(place):
    points = np.array([[x, 0] for x in range(31)], float)
    pieces = [points[[k, k + 10]].ravel().tolist() for k in (0, 10, 20)]
    known = {"closed": False, "pieces": pieces, "curves": [piece[:2] * 2 + piece[2:] * 2 for piece in pieces]}
    points[place, 1] = 1
    (line,) = lines_of([ts.vector.Polyline(points)], np.zeros(2), [known])
    assert (place, 1) in corners(line)
    for one, other in pairwise(line["pieces"]):
        assert one[-2:] == other[:2]
