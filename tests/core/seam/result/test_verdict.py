"""The verdict on a seam: whether it is likely to be seen, how much, and where."""

import numpy as np
import pytest

import toposeam as ts

ROWS = np.sin(np.arange(40) * 0.9)[:, None] * np.ones((1, 30)) * 0.4 + 0.5


def test_where_patches_agree_nothing_is_seen():
    verdict = ts.find_seam(ROWS, ROWS).verdict
    assert (round(verdict.mean, 3), round(verdict.worst, 3)) == (1, 1)
    assert str(verdict) == "not to be seen"


def test_stronger_broken_lines_are_more_visible():
    lines = [0.5 + (ROWS - 0.5) * strength for strength in (0, 0.1, 1)]
    worst = [ts.find_seam(one, np.roll(one, 3, axis=0)).verdict.worst for one in lines]
    assert worst == sorted(worst, reverse=True)
    assert worst[2] < 0.2


def test_it_names_the_place_on_the_canvas():
    a = np.full((200, 60), 0.5)
    b = a.copy()
    b[120:140] = 0.9  # a band that no seam gets round
    seam = ts.find_seam(a, b)
    x, y = seam.verdict.where
    assert 110 <= y <= 150
    assert 0 <= x < 60
    assert str(seam.verdict) == f"look at {x},{y}"
    assert seam.summary()["look_at"] == [x, y]


def test_seams_of_any_law_and_method_are_judged_alike():
    a, b = np.random.default_rng(0).random((2, 60, 20))
    natural = ts.find_seam(a, b)
    assert ts.seam.seam_verdict(natural, a, b) == natural.verdict
    for given in ({"gradient": True}, {"gradient": False}, {"method": "thesis"}):
        other = ts.find_seam(a, b, **given)
        assert other.verdict is None
        assert "likeness" not in other.summary()
        assert ts.seam.seam_verdict(other, a, b).mean <= natural.verdict.mean + 0.02


def test_of_several_seams_the_worst_speaks_for_all():
    rng = np.random.default_rng(1)
    sky = np.full((60, 40, 3), 0.6) + rng.normal(0, 0.002, (60, 40, 3))
    broken = sky.copy()
    broken[20:30] = 0.1
    layers = [ts.Layer(sky), ts.Layer(sky, at=(25, 0)), ts.Layer(broken, at=(50, 0))]
    stitched = ts.stitch(layers)
    worst = [seam.verdict.worst for seam in stitched.seams]
    assert stitched.verdict.worst == min(worst) < 0.3
    assert 20 <= stitched.verdict.where[1] <= 30
    assert ts.layers.compose(layers).totals().verdict == stitched.verdict
    assert ts.stitch(layers, gradient=True).verdict is None


def test_pictures_of_another_size_are_refused():
    seam = ts.find_seam(ROWS, ROWS)
    with pytest.raises(ts.OptionError, match="pass the pictures it was found in"):
        ts.seam.seam_verdict(seam, ROWS[:-1], ROWS[:-1])


def test_a_crop_is_judged_by_what_it_shows():
    rng = np.random.default_rng(0)
    a = rng.random((96, 40))
    b = a.copy()
    b[:16] = rng.random((16, 40))
    verdict = ts.find_seam(a, b).verdict
    assert verdict.where[1] < 16
    below = verdict.inside((3, 32, 37, 64))
    assert below.unseen
    assert below.worst == pytest.approx(1)
    above = verdict.inside((1, 2, 39, 60))
    assert above.where == (verdict.where[0] - 1, verdict.where[1] - 2)
    assert verdict.inside(None) is verdict
    assert verdict.inside((39, 0, 1, 96)).where is None
