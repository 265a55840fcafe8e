"""Every public name has an example; that they run is what ``--doctest-modules`` sees to."""

import inspect

import pytest
from public_names import public_names


def shown():
    for name, value in public_names().items():
        if inspect.isfunction(value) or (inspect.isclass(value) and not issubclass(value, Exception)):
            yield name


@pytest.mark.parametrize("name", list(shown()))
def test_every_public_name_has_an_example(name):
    assert ">>> " in (inspect.getdoc(public_names()[name]) or ""), f"{name}: add an Examples section"
