"""What a sub-room of core offers: its ``__init__.pyi`` lists what other rooms use and its tests begin with.

Modules inside a sub-room may be divided and renamed without touching the tests, as long as these import what
is offered from the sub-room.
"""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from test_house import HERE, PACKAGES, module_name, parsed

CORE = HERE / "core" / "toposeam"
SUB_ROOMS = sorted(module_name(path, HERE / "core") for path in CORE.glob("*/*/__init__.py"))
#: Test functions of core that use what no sub-room offers; they may only become fewer.
MOST_PAST_FACADES = 172


def sub_room(module: str) -> str:
    return ".".join(module.split(".")[:3])


def imported(tree: ast.AST) -> Iterator[tuple[str, str, str]]:
    """Module, name and local name of everything that a text imports from modules of sub-rooms."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and not node.level and node.module:
            for alias in node.names:
                if sub_room(node.module) in SUB_ROOMS:
                    yield node.module, alias.name, alias.asname or alias.name


@cache
def offered(name: str) -> dict[str, str]:
    """The names that a sub-room offers, and their modules."""
    stub = parsed(HERE.joinpath("core", *name.split("."), "__init__.pyi"))
    return {
        alias.name: f"{name}.{node.module}"
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


@pytest.mark.parametrize("name", SUB_ROOMS)
def test_a_sub_room_has_what_it_offers(name):
    room = importlib.import_module(name)
    for one, module in offered(name).items():
        assert getattr(room, one) is getattr(importlib.import_module(module), one)


def test_nothing_offered_has_the_name_of_a_module_beside_it():
    """Importing such a module would put it in the place of what is offered."""
    for stub in CORE.glob("*/**/__init__.pyi"):
        modules = {path.stem for path in stub.parent.glob("*.py")} | {
            path.parent.name for path in stub.parent.glob("*/__init__.py")
        }
        imports = [node for node in parsed(stub).body if isinstance(node, ast.ImportFrom) and node.module]
        assert not modules & {alias.name for node in imports for alias in node.names}, stub.parent.name


def test_what_other_rooms_import_is_offered():
    missing = set()
    for package, root in PACKAGES.items():
        for path in (root / package).rglob("*.py"):
            for module, name, _ in imported(parsed(path)):
                own = sub_room(module)
                modules = {one.stem for one in HERE.joinpath("core", *own.split(".")).glob("*.py")}
                if module != own and sub_room(module_name(path, root)) != own and name not in modules:
                    missing |= {(module, name)} - {(where, one) for one, where in offered(own).items()}
    assert not missing


def files_of_tests() -> list[Path]:
    return sorted((HERE / "tests" / "core").rglob("*.py"))


def test_tests_import_what_is_offered_from_the_sub_room():
    deep = {
        f"{path.relative_to(HERE)}: {name}"
        for path in files_of_tests()
        for module, name, _ in imported(parsed(path))
        if offered(sub_room(module)).get(name) == module
    }
    assert not deep


def test_few_tests_go_past_what_is_offered():
    past = []
    for path in files_of_tests():
        tree = parsed(path)
        hidden = {
            local
            for module, name, local in imported(tree)
            if module != sub_room(module) or name not in offered(module)
        }
        past += [
            f"{path.name}: {test.name}"
            for test in ast.walk(tree)
            if isinstance(test, ast.FunctionDef)
            and test.name.startswith("test_")
            and any(isinstance(node, ast.Name) and node.id in hidden for node in ast.walk(test))
        ]
    assert len(past) <= MOST_PAST_FACADES
