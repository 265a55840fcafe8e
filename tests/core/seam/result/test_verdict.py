"""The verdict on a seam: whether it is likely to be seen, how much, and where."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.seam.result import Verdict, verdict_of, worst_of

ROWS = np.sin(np.arange(40) * 0.9)[:, None] * np.ones((1, 30)) * 0.4 + 0.5


def test_where_patches_agree_nothing_is_seen():
    verdict = ts.find_seam(ROWS, ROWS).verdict
    assert (round(verdict.mean, 3), round(verdict.worst, 3)) == (1, 1)
    assert str(verdict) == "no visible seam"


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


def test_it_lists_all_places_that_may_be_noticed():
    a = np.full((400, 60), 0.5)
    b = a.copy()
    b[80:96] = 0.9  # bands that no seam gets round
    b[280:304] = 0.7
    verdict = ts.find_seam(a, b).verdict
    (_, first), (_, second) = verdict.places
    assert 72 <= first <= 104
    assert 272 <= second <= 312
    assert verdict.places[0] == verdict.where
    assert verdict.is_noticed_near(*verdict.where)
    assert not verdict.is_noticed_near(30, 190)
    assert ts.find_seam(a, a).verdict.places == []


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
    assert ts.stitch(layers).verdict == stitched.verdict
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


def squares_of(*groups):
    """Verdict of interfaces in groups: how many, each one's cost, x and y."""
    count, cost, x, y = np.array(groups).T
    return verdict_of(*(np.repeat(values, count) for values in (cost.astype(float), x, y)))


def test_likenesses_are_averaged_over_squares_of_sixteen():
    # Costs of 0, 18 and 162 are likenesses of 1, 1/2 and 1/10.
    found = squares_of((30, 0, 3, 5), (4, 18, 16, 5), (3, 200, 40, 40), (3, 124, 45, 47))
    assert found.mean == pytest.approx((30 + 4 / 2 + 6 / 10) / 40)
    assert found.worst == pytest.approx(0.1)  # of 6 in 40, which are more than a tenth
    assert found.where == (42, 44)
    # Of two in a square only their mean counts; one px further on they are two squares.
    assert squares_of((1, 0, 14, 3), (1, 36, 15, 3)).mean == pytest.approx(1 / 2)
    assert squares_of((1, 0, 15, 3), (1, 36, 16, 3)).mean == pytest.approx((1 + 1 / 3) / 2)
    assert squares_of((1, 0, 3, 15), (1, 36, 3, 16)).mean == pytest.approx((1 + 1 / 3) / 2)


def test_the_worst_part_is_a_tenth_at_least():
    assert squares_of((36, 0, 3, 5), (4, 162, 40, 40)).worst == pytest.approx(0.1)
    less = squares_of((33, 0, 3, 5), (4, 18, 20, 5), (3, 162, 40, 40))
    assert less.worst == pytest.approx((3 / 10 + 4 / 2) / 7)


def test_half_the_likeness_is_not_to_be_seen():
    just, below = (Verdict(mean=0.91239, worst=worst, where=(7, 9)) for worst in (0.5, 0.49996))
    assert just.unseen
    assert just.summary() == {"likeness": 0.9124, "worst_likeness": 0.5, "step": None, "look_at": None}
    assert not below.unseen
    assert below.summary() == {"likeness": 0.9124, "worst_likeness": 0.5, "step": None, "look_at": [7, 9]}
    assert str(Verdict(mean=0.1, worst=0.1, where=None)) == "no visible seam"


def test_a_crop_shows_what_lies_between_its_sides():
    verdict = squares_of((5, 18, 10, 8), (5, 162, 20, 40))
    assert verdict.inside((10, 8, 11, 33)).worst == pytest.approx(0.1)
    for box in ((10, 8, 10, 33), (10, 8, 11, 32)):
        assert verdict.inside(box).mean == pytest.approx(0.5)
        assert verdict.inside(box).where == (0, 0)
    for box in ((11, 8, 10, 33), (10, 9, 11, 32)):
        assert verdict.inside(box).mean == pytest.approx(0.1)
    assert verdict.inside((30, 0, 9, 99)) == Verdict(mean=1.0, worst=1.0, where=None)


def test_one_seam_without_a_verdict_leaves_none_for_all():
    one, other = (Verdict(mean=mean, worst=worst, where=(1, 2)) for mean, worst in ((0.9, 0.3), (0.5, 0.4)))
    assert worst_of([other, one]) is one
    assert worst_of([one, None]) is None
    assert worst_of([]) is None
