"""Numbers, choices, seeds and options: what is wrong is named, with what it must be."""

from dataclasses import dataclass

import numpy as np
import pytest

import toposeam as ts
from toposeam.checks import check_choice, check_number, check_pair, check_whole, options_from, seed_of


@pytest.mark.parametrize("value", ["x", None, True, float("nan"), float("inf"), -1, 2.5, 1j, [1], 10**400])
def test_a_number_is_a_finite_number_in_its_range(value):
    with pytest.raises(ts.OptionError, match=r"^weight is .*; it must be a number between 0 and 2$"):
        check_number("weight", value, 0, 2)


@pytest.mark.parametrize("value", [0, 1, np.float32(0.5), np.int64(2), 2.0])
def test_numbers_of_every_kind_are_numbers(value):
    assert check_number("weight", value, 0, 2) == float(value)


def test_the_lower_end_is_left_out_where_it_must_be_above():
    with pytest.raises(ts.OptionError, match="it must be a positive number"):
        check_number("length", 0, 0, above=True)
    assert check_number("band", float("inf"), 0, infinite=True) == float("inf")


@pytest.mark.parametrize("value", [2.5, 2.0, "2", True, -3, None, np.float64(2)])
def test_a_whole_number_is_no_float(value):
    with pytest.raises(ts.OptionError, match="whole number of at least 0"):
        check_whole("iterations", value, 0)


def test_seeds_are_whole_numbers_generators_or_none():
    assert seed_of(np.int32(5)) == 5
    assert seed_of(np.random.default_rng(1)) == seed_of(np.random.default_rng(1))
    # Up to 2⁵³, which JSON keeps in a recipe.
    assert seed_of(np.random.default_rng(1)) == np.random.default_rng(1).integers(2**53)
    assert seed_of(None) != seed_of(None)
    with pytest.raises(ts.OptionError, match="seed is -3; pass a whole number from 0 on"):
        seed_of(-3)


def test_choices_and_pairs_name_what_they_got():
    with pytest.raises(ts.OptionError, match="side is 'up'; choose one of left, right"):
        check_choice("side", "up", ("left", "right"))
    with pytest.raises(ts.OptionError, match="side is \\['left'\\]"):
        check_choice("side", ["left"], ("left", "right"))
    assert check_pair("size", (3, np.int8(4)), 1) == (3, 4)
    with pytest.raises(ts.OptionError, match="size is 7; pass two whole numbers"):
        check_pair("size", 7, 1)


@dataclass(frozen=True, kw_only=True)
class _Options:
    steps: int = 3


def test_options_come_as_an_instance_or_as_keywords_not_both():
    assert options_from(_Options, None, {"steps": 4}, "x").steps == 4
    assert options_from(_Options, _Options(steps=5), {}, "x").steps == 5
    with pytest.raises(ts.OptionError, match="steps was given beside options"):
        options_from(_Options, _Options(), {"steps": 4}, "x")
    with pytest.raises(ts.OptionError, match="x does not know stops; its options are steps"):
        options_from(_Options, None, {"stops": 4}, "x")
    with pytest.raises(ts.OptionError, match="options is of class dict; x takes _Options"):
        options_from(_Options, {"steps": 4}, {}, "x")
