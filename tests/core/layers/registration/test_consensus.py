"""Pairs that match where they do not belong: known, left out where others outvote them, and named."""

import dataclasses
import math
import re

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.registration import Match, evidence_of, pair_matching, without_contradictions
from toposeam.layers.registration.refusals import check_exact, check_joined

WIDTH, HEIGHT = 300, 200
STEP = 200, 130
#: A grid of 4 × 3 pictures, turned a little.
PLACES = [(column * STEP[0], row * STEP[1]) for row in range(3) for column in range(4)]
TURNS = np.radians([0, 0.4, -0.3, 0.2, 0.5, 0, -0.5, 0.1, 0.3, -0.2, 0, 0.4])
NAMES = [f"p{index}" for index in range(12)]
SIZES = np.full((12, 2), (HEIGHT, WIDTH))
#: Pairs of the grid that match elsewhere, and by how much.
WRONG = {(1, 5): (-20, 120), (5, 9): (95, 75), (2, 6): (-140, 60)}


def seen(index, points, turns=TURNS):
    """Points of the scene as a picture shows them."""
    moved = (points - np.array(PLACES[index])) @ [1, 1j] * np.exp(-1j * turns[index])
    return np.stack([moved.real, moved.imag], axis=1)


def match(i, j, rng, patches=12, elsewhere=(0, 0), turns=TURNS):
    """Patches of the overlap of two pictures, or that the second one shows as far off as that."""
    low, high = np.maximum(PLACES[i], PLACES[j]), np.minimum(PLACES[i], PLACES[j]) + np.array([WIDTH, HEIGHT])
    points = rng.uniform(low, np.maximum(high, low + 60), (patches, 2))
    second = seen(j, points + np.array(elsewhere), turns) + rng.normal(0, 0.1, (patches, 2))
    return Match(seen(i, points, turns), second, 0.9)


def grid(rng, turns=TURNS):
    """Neighbours of the grid, right, below and across."""
    found = {}
    for i in range(12):
        for j in range(i + 1, 12):
            if abs(i % 4 - j % 4) <= 1 and abs(i // 4 - j // 4) <= 1:
                found[i, j] = match(i, j, rng, turns=turns)
    return found


def off(solution):
    expected = np.array(PLACES, float) - PLACES[0]
    return np.abs(solution.transforms[:, 2:] - expected).max()


@pytest.mark.parametrize("seed", range(3))
def test_pairs_that_match_elsewhere_are_outvoted(seed):
    rng = np.random.default_rng(seed)
    right = grid(rng)
    wrong = {(0, 7): match(0, 7, rng, elsewhere=(90, 0)), (5, 6): match(5, 6, rng, elsewhere=(0, -40))}
    solution, used = without_contradictions(NAMES, SIZES, dict(sorted({**right, **wrong}.items())))
    assert set(used) == set(right) - set(wrong)
    assert off(solution) < 0.5


@pytest.mark.parametrize("most", [1, 60])
def test_wrong_pairs_among_turned_pictures_are_outvoted(most):
    """Two of them in a column, far off in one direction and in another."""
    rng = np.random.default_rng(0)
    turns = np.radians(most) * np.array([0, *rng.uniform(-1, 1, 11)])
    matches = grid(rng, turns)
    for pair, elsewhere in WRONG.items():
        matches[pair] = match(*pair, rng, elsewhere=elsewhere, turns=turns)
    solution, used = without_contradictions(NAMES, SIZES, matches)
    assert set(used) == set(matches) - set(WRONG)
    assert off(solution) < 0.5
    np.testing.assert_allclose(solution.transforms[:, :2] @ [1, 1j], np.exp(1j * turns), atol=0.005)


@pytest.mark.parametrize(("features", "clear"), [(11, True), (13, False)])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 1, 2, 0), (0, 2, 1, 3)])
def test_a_wrong_pair_is_outvoted_by_three_times_its_evidence(features, clear, order):
    """The first and the last picture, by 20 + 16 features through the two others, between which 10 pass."""
    rng, shown = np.random.default_rng(5), np.array([0, 1, 4, 5])
    matches = {}
    for one, other, number in ((0, 1, 20), (0, 2, 16), (1, 2, 50), (1, 3, 10), (2, 3, 40), (0, 3, features)):
        i, j = sorted((order.index(one), order.index(other)))
        elsewhere = (70, 20) if number == features else (0, 0)
        own = match(*shown[[order[i], order[j]]], rng, elsewhere=elsewhere)
        matches[i, j] = dataclasses.replace(own, correlation=math.nan, share=0.9, features=number)
    names = [NAMES[k] for k in range(4)]
    if clear:
        _, used = without_contradictions(names, SIZES[:4], dict(sorted(matches.items())))
        wrong = tuple(sorted((order.index(0), order.index(3))))
        assert set(used) == set(matches) - {wrong}
    else:
        with pytest.raises(ts.OverlapError, match="too little else shows which is right"):
            without_contradictions(names, SIZES[:4], dict(sorted(matches.items())))


def test_given_points_outvote_what_matches_elsewhere():
    rng, shown = np.random.default_rng(3), (0, 1, 4, 5)
    matches = {(i, j): match(shown[i], shown[j], rng) for i in range(4) for j in range(i + 1, 4)}
    matches[1, 2] = match(1, 4, rng, patches=5, elsewhere=(90, 0))
    matches[0, 1] = dataclasses.replace(matches[0, 1], correlation=math.nan, features=200)
    solution, used = without_contradictions([NAMES[k] for k in shown], SIZES[:4], matches)
    assert set(used) == set(matches) - {(1, 2)}
    expected = np.array([PLACES[k] for k in shown], float)
    assert np.abs(solution.transforms[:, 2:] - expected).max() < 0.5


def test_where_nothing_contradicts_all_pairs_are_used():
    right = grid(np.random.default_rng(0))
    solution, used = without_contradictions(NAMES, SIZES, right)
    assert used == right
    assert off(solution) < 0.5


def without(matches, index, keep):
    """A picture that only so many pairs hold."""
    held = [pair for pair in matches if index in pair][keep:]
    return {pair: one for pair, one in matches.items() if pair not in held}


@pytest.mark.parametrize(("held", "places"), [(3, True), (2, False), (1, False)])
def test_a_weakly_held_picture_is_refused_with_the_pair_named(held, places):
    rng = np.random.default_rng(1)
    matches = without(grid(rng), 0, held)
    matches[0, 11] = match(0, 11, rng, elsewhere=(75, 0))
    if places:
        solution, used = without_contradictions(NAMES, SIZES, matches)
        assert set(matches) - set(used) == {(0, 11)}
        assert off(solution) < 0.5
        return
    with pytest.raises(ts.OverlapError, match=r"p0 and p11.* match where the other pictures do not place"):
        without_contradictions(NAMES, SIZES, matches)


def test_wrong_pairs_that_agree_count_together():
    rng = np.random.default_rng(2)
    matches = grid(rng)  # picture 0 is held by three pairs
    for other in (5, 6, 10):
        matches[0, other] = match(0, other, rng, elsewhere=(90, 0))
    with pytest.raises(ts.OverlapError, match="too little else shows which is right"):
        without_contradictions(NAMES, SIZES, matches)


def test_a_lens_is_a_lens_and_all_pairs_are_named():
    rng = np.random.default_rng(3)
    matches = {
        (i, j): Match(one.first, one.second + rng.uniform(-3, 3, 2), 0.9) for (i, j), one in grid(rng).items()
    }
    with pytest.raises(
        ts.OverlapError, match=r"more pairs do not fit .* up to [\d.]+ px .*a lens or"
    ) as told:
        without_contradictions(NAMES, SIZES, matches)
    assert len(re.findall(r"p\d+ and p\d+", str(told.value))) == 7


def test_a_poor_pair_of_few_px_is_no_match_elsewhere():
    rng = np.random.default_rng(4)
    matches = grid(rng)
    matches[0, 1] = Match(matches[0, 1].first, matches[0, 1].second + np.array([4.0, 0]), 0.9)
    with pytest.raises(ts.OverlapError, match=r"^p0 and p1 do not fit where"):
        without_contradictions(NAMES, SIZES, matches)


@pytest.mark.medium
def test_a_match_elsewhere_is_told_and_not_used(monkeypatch):
    whole = data.camera()[120:260, 100:360]
    lefts = (0, 40, 80, 120)
    pictures = [ts.Layer(whole[:, left : left + 120].copy(), name=str(left)) for left in lefts]
    own = pair_matching.PairMatcher.matches

    def found(self, *given):
        matches, best = own(self, *given)
        points = np.random.default_rng(0).uniform(10, 100, (8, 2))
        return {**matches, (0, 3): Match(points, points, 0.7)}, best

    monkeypatch.setattr(pair_matching.PairMatcher, "matches", found)
    placement = ts.find_places(pictures)
    assert [layer.at[0] for layer in placement.layers] == pytest.approx(lefts, abs=1)
    assert placement.outvoted == ((0, 3),)
    assert (0, 3) not in placement.correlations
    assert placement.misfit < 1


def test_all_strangers_are_named_at_once():
    pictures = [ts.Layer(np.zeros((20, 20), np.uint8), name=f"p{index}") for index in range(9)]
    matches = {(0, 1): None, (1, 2): None, (2, 3): None, (5, 6): None}
    best = np.linspace(0, 0.4, 9)
    sentence = (
        r"^p4 and p7, p8 fit none of the other pictures \(the best correlation is 0\.40, 0\.5 is needed\), "
        "and p5 and p6 show something else than the other pictures; leave them out, or say where the "
        "pictures lie; join the two groups apart$"
    )
    with pytest.raises(ts.OverlapError, match=sentence):
        check_joined(pictures, matches, best, 0.5)
    lone = r"^p4 and p5, p6, p7, p8 fit none of the other pictures \(they have nothing in common\); leave"
    few = dict(list(matches.items())[:3]), np.full(9, -1.0), 0.5
    with pytest.raises(ts.OverlapError, match=lone):
        check_joined(pictures, *few)
    with pytest.raises(ts.OverlapError, match=r"\(they share 8 features at most, and too few agree\)"):
        check_joined(pictures, *few, np.arange(9))


def test_all_pictures_that_cannot_be_placed_exactly_are_named():
    pictures = [ts.Layer(np.zeros((20, 20), np.uint8), name=f"p{index}") for index in range(4)]
    worst_first = r"^p3 and p1 cannot be placed exactly: .* up to 0\.9 px open; let"
    with pytest.raises(ts.OverlapError, match=worst_first):
        check_exact(pictures, np.array([0.1, 0.5, 0.4, 0.9]))
    with pytest.raises(
        ts.OverlapError, match=r"^p1 cannot be placed exactly: what it shares .* 0\.5 px open"
    ):
        check_exact(pictures, np.array([0.1, 0.5, 0.4, 0.3]))
    check_exact(pictures, np.full(4, 0.4))


def test_what_is_the_same_tells_more_than_what_repeats_itself():
    rng = np.random.default_rng(1)
    matches = {
        pair: Match(one.first, one.second, 0.98) for pair, one in without(grid(rng), 0, 2).items()
    }  # too little beside a pair that correlates as well
    wrong = match(0, 11, rng, elsewhere=(75, 0))
    matches[0, 11] = Match(wrong.first, wrong.second, 0.8)
    solution, used = without_contradictions(NAMES, SIZES, matches)
    assert set(matches) - set(used) == {(0, 11)}
    assert off(solution) < 0.5
    matches[0, 11] = Match(wrong.first, wrong.second, 0.98)
    with pytest.raises(ts.OverlapError, match="too little else shows which is right"):
        without_contradictions(NAMES, SIZES, matches)


@pytest.mark.parametrize(
    ("right", "wrong", "clear"), [(0.98, 0.9, True), (0.98, 0.98, False), (0.99999, 0.999, False)]
)
def test_how_well_pairs_correlate_counts_up_to_noise(right, wrong, clear):
    """Two pairs hold a picture that a third one places elsewhere. Two at 0.98 tell four times as much as one
    at 0.9, but what is the same but for noise tells no more than 0.999 does.
    """
    rng = np.random.default_rng(1)
    matches = {
        pair: dataclasses.replace(one, correlation=right) for pair, one in without(grid(rng), 0, 2).items()
    }
    matches[0, 11] = dataclasses.replace(match(0, 11, rng, elsewhere=(75, 0)), correlation=wrong)
    if clear:
        _, used = without_contradictions(NAMES, SIZES, matches)
        assert set(matches) - set(used) == {(0, 11)}
        return
    with pytest.raises(ts.OverlapError, match="too little else shows which is right"):
        without_contradictions(NAMES, SIZES, matches)


def test_identical_parts_have_no_infinite_evidence():
    most = evidence_of(1.0, 10)
    assert most == evidence_of(0.9995, 10) == pytest.approx(-10 * math.log(1 - 0.999**2))
    assert 0 < evidence_of(0.99, 10) < most
    assert evidence_of(-0.3, 10) == 0
