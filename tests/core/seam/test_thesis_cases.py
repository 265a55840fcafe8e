"""The constructed cases of the thesis's chapter 3: each has one right answer."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import toposeam as ts
from thesis_cases import ell, random_colours, toy, zigzag
from toposeam.seam.thesis import ThesisOptions

BOTH = pytest.mark.parametrize("method", ["heat", "thesis"])


def corners(seam: ts.seam.Seam) -> np.ndarray:
    """Every pixel corner on the seam's one line, from its upper or left end on; (N, 2) x, y."""
    (line,) = seam.paths
    steps = np.diff(line.points, axis=0)
    lengths = np.abs(steps).sum(axis=1).astype(int)
    unit = np.repeat(np.sign(steps), lengths, axis=0)
    points = np.vstack([line.points[:1], line.points[0] + np.cumsum(unit, axis=0)]).astype(int)
    return points if tuple(points[0][::-1]) < tuple(points[-1][::-1]) else points[::-1]


def wrong(case, seam) -> int:
    """Pixels of the overlap that show the other patch than planted."""
    return int((seam.labels != case.planted)[case.mask_a & case.mask_b].sum())


@BOTH
def test_the_toy_seam_runs_through_nodes_2_6_7_11_and_15(method):
    seam = toy().find(method)
    assert [4 * y + x + 1 for x, y in corners(seam)] == [2, 6, 7, 11, 15]
    assert seam.termination == ts.optimize.Termination.SINGLE_LINE
    assert seam.optimum_ratio() == pytest.approx(1.0)


@BOTH
def test_with_gradient_the_seam_follows_the_zigzag_edge(method):
    case = zigzag()
    seam = case.find(method)
    assert wrong(case, seam) == 0
    assert seam.termination == ts.optimize.Termination.SINGLE_LINE


@BOTH
def test_the_seam_without_gradient_is_straight_and_shortest(method):
    case = zigzag()
    seam = case.find(method, cost=ts.seam.MatchCost(law="colour"))
    line = corners(seam)
    assert len(line) == 81
    assert len(set(line[:, 0])) == 1


@BOTH
def test_zigzag_patches_join_to_a_plain_picture_by_both_costs(method):
    case = zigzag()
    for cost in (case.cost, ts.seam.MatchCost(law="colour")):
        joined = case.joined(case.find(method, cost=cost))
        assert (joined == joined[0, 0]).all()


def test_the_seam_ignores_the_zigzag_where_plain_ground_is_free():
    # flat = 0, the default: nobody sees a seam through equal pixels.
    case = zigzag()
    seam = case.find("heat", cost=ts.seam.MatchCost(law="gradient"))
    assert len(set(corners(seam)[:, 0])) == 1


@BOTH
def test_the_seam_follows_the_shade_round_an_l_shaped_overlap(method):
    case = ell()
    seam = case.find(method)
    assert wrong(case, seam) == 0
    assert seam.termination == ts.optimize.Termination.SINGLE_LINE
    assert (np.abs(case.joined(seam) - case.a[0, 0]) == 0).all()


@BOTH
@pytest.mark.parametrize("seed", range(4))
def test_the_seam_follows_an_outline_between_random_colours(method, seed):
    case = random_colours(seed)
    seam = case.find(method)
    assert wrong(case, seam) == 0
    upwards = np.diff(corners(seam)[:, 1]) < 0
    assert np.count_nonzero(upwards) == 16


def test_a_seam_that_may_not_turn_back_misses_the_outline():
    case = random_colours()
    assert wrong(case, case.find("dp")) > 0
    assert case.find("dp").cost > case.find("heat").cost


@BOTH
@pytest.mark.parametrize("make", [zigzag, ell, random_colours])
def test_swapping_the_patches_keeps_the_line(method, make):
    case = make()
    seam = case.find(method)
    swapped = ts.find_seam(case.b, case.a, case.mask_b, case.mask_a, method=method, cost=case.cost)
    overlap = case.mask_a & case.mask_b
    assert (swapped.labels != seam.labels)[overlap].all()


@pytest.mark.parametrize("make", [toy, zigzag, ell, random_colours])
def test_the_thesis_takes_2_to_4_stages_and_100_iterations(make):
    seam = make().find("thesis")
    assert 2 <= seam.history[-1].stage <= 4
    assert len(seam.history) <= 100


@pytest.mark.parametrize(("case", "usual", "unlimited"), [(zigzag, 1.03, 7.5), (ell, 1.01, 6.4)])
def test_the_transcription_depends_on_move_limits_as_documented(case, usual, unlimited):
    """docs/results.md, to the digits that are stated there."""
    for move, ratio in ((0.2, usual), (1.0, unlimited)):
        seam = case().find("thesis", options=ThesisOptions.plain(move=move))
        assert seam.optimum_ratio() == pytest.approx(ratio, rel=0.02)


def test_every_change_to_the_algorithms_can_be_switched_off():
    """docs/method.md has the same table."""
    plain, ours = ThesisOptions.plain(), ThesisOptions()
    changed = {
        field.name for field in fields(ours) if getattr(plain, field.name) != getattr(ours, field.name)
    }
    text = (Path(__file__).parents[3] / "docs" / "method.md").read_text(encoding="utf-8")
    table = text.partition("| change | option | as written |")[2].partition("\n\n")[0]
    assert changed == set(re.findall(r"\| `(\w+)`(?: = 1)? \|", table))
    for name in changed:
        seam = toy().find("thesis", options=replace(ours, **{name: getattr(plain, name)}))
        assert seam.optimum_ratio() < 1.3


@pytest.mark.parametrize("seed", range(4))
def test_hardening_changes_no_seam(seed):
    """As docs/method.md says of it."""
    a, b = np.random.default_rng(seed).random((2, 20, 8))
    soft, hard = (ts.find_seam(a, b, method="thesis", harden=harden) for harden in (False, True))
    assert np.array_equal(soft.labels, hard.labels)
    assert len(hard.history) > len(soft.history)
