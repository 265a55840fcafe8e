"""Every public name has an example; that they run is what ``--doctest-modules`` sees to."""

import inspect

import pytest

import toposeam as ts


def shown():
    for name in ts.__all__:
        value = getattr(ts, name)
        if inspect.isfunction(value) or (inspect.isclass(value) and not issubclass(value, Exception)):
            yield name


@pytest.mark.parametrize("name", list(shown()))
def test_every_public_name_has_an_example(name):
    assert ">>> " in (inspect.getdoc(getattr(ts, name)) or ""), f"{name}: add an Examples section"
