"""Where pictures lie by what the command line says: places alone, no pixels."""

from pathlib import Path

import numpy as np
import pytest

import toposeam as ts
from toposeam_cli.app.options import Length
from toposeam_cli.media.pictures.picture import Picture
from toposeam_cli.stitching.positions import ORDERS, Where, places_of

#: Three columns and two rows of pictures of 10 × 8 px that overlap by 3 px.
CELLS = {"a": (0, 0), "b": (7, 0), "c": (14, 0), "d": (0, 5), "e": (7, 5), "f": (14, 5)}
FOLLOWING = dict(zip(ORDERS, ("abcdef", "adbecf", "abcfed", "adebcf"), strict=True))


def found(names, where, sizes=None, numbers=None):
    pictures = [Picture(pixels=np.zeros((sizes or {}).get(name, (8, 10)), np.uint8)) for name in names]
    files = [Path(f"{name}.png") for name in names]
    return places_of(files, pictures, where, numbers, None if numbers is None else numbers[-1] + 1)


@pytest.mark.parametrize("order", ORDERS)
def test_a_grid_that_is_not_square_in_any_order(order):
    names = FOLLOWING[order]
    where = Where(grid=(3, 2), overlap=Length(3, False), order=order)
    assert found(names, where) == [CELLS[name] for name in names]


def test_rows_are_the_order_that_nobody_names():
    where = Where(grid=(3, 2), overlap=Length(3, False))
    assert found("abcdef", where) == list(CELLS.values())


@pytest.mark.parametrize(
    ("where", "places"),
    [
        (Where(row=True, overlap=Length(50, True)), [(0, 0), (5, 0), (8, 0)]),
        (Where(column=True, overlap=Length(50, True)), [(0, 0), (0, 4), (0, 8)]),
        (Where(row=True, overlap=Length(2, False)), [(0, 0), (8, 0), (12, 0)]),
    ],
)
def test_each_picture_continues_the_previous_one_by_its_size(where, places):
    assert found("abc", where, {"b": (8, 6)}) == places


def test_a_grid_has_as_many_places_as_there_are_pictures():
    with pytest.raises(ts.OptionError, match="3x2 has 6 places for 5 pictures"):
        found("abcde", Where(grid=(3, 2), overlap=Length(3, False)))
    with pytest.raises(ts.OptionError, match="add --overlap"):
        found("ab", Where(row=True))


def test_a_missing_picture_is_as_large_as_the_first():
    where = Where(row=True, overlap=Length(3, False))
    assert found("acd", where, {"a": (8, 20)}, numbers=[0, 2, 3]) == [(0, 0), (34, 0), (41, 0)]
