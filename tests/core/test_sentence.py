"""What an error came from."""

from toposeam.sentence import causes


def test_causes_come_once_each_also_in_a_circle():
    first, second, third = ValueError("1"), KeyError("2"), OSError("3")
    first.__cause__, second.__context__, third.__cause__ = second, third, first
    assert list(causes(first)) == [first, second, third]
    first.__cause__ = first
    assert list(causes(first)) == [first]
    assert list(causes(None)) == []
