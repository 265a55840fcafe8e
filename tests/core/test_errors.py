"""Errors as templates and data."""

import ast
import copy
import pickle
import string
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import toposeam as ts
from toposeam import checks, errors
from toposeam.errors import Interval, OptionError, OverlapError, PathError, Term, TopoSeamError

CORE = Path(ts.__file__).parent
#: Nouns of templates for which front ends have others.
NOUNS = {"patch", "patches", "exemplars"}
FAMILY = [
    kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, TopoSeamError)
]


def refused(function, *arguments, **options):
    with pytest.raises(OptionError) as raised:
        function(*arguments, **options)
    return raised.value


def test_what_a_check_refuses_is_told_as_data():
    error = refused(checks.check_number, "band", "x", 4, 10)
    assert (error.kind, error.parameter, error.value) == ("number", "band", "x")
    assert error.allowed == Interval(4, 10)
    error = refused(checks.check_choice, "side", "{up}", ("left", "right"))
    assert (error.kind, error.value, error.allowed) == ("choice", "{up}", ("left", "right"))
    assert str(error) == "side is '{up}'; choose one of left, right"


def test_layers_are_told_by_number_and_by_name():
    layers = [ts.Layer(np.eye(30), at=(at, 0), name=f"patch {at}") for at in (0, 20, 300)]
    with pytest.raises(OverlapError) as raised:
        ts.stitch(layers)
    assert raised.value.layers == (2,)
    assert raised.value.data["name"] == "patch 300"
    assert raised.value.sentence(lambda term: "PICTURES").startswith(
        "patch 300 (at 300,0): the PICTURES do not"
    )


def test_a_path_between_layers_names_the_layers():
    whole = np.random.default_rng(0).random((30, 60))
    layers = [ts.Layer(whole[:, :40], name="patch b"), ts.Layer(whole[:, 20:], at=(20, 0), name="{a}")]
    line = ts.vector.Polyline([[30, -1], [30, 15], [70, 15]])
    with pytest.raises(PathError) as raised:
        ts.stitch(layers, use_path=ts.vector.SvgSeam((line,), 60, 30, None, ("seam",)))
    assert "of an edge of {a} the path leaves" in str(raised.value)
    assert "of an edge of {a} the path leaves" in raised.value.sentence(lambda term: "X")


@pytest.mark.parametrize("kind", FAMILY)
def test_an_error_without_data_is_said_as_it_is(kind):
    assert str(kind("{patches} of '{band}.png'; {")) == "{patches} of '{band}.png'; {"


@pytest.mark.parametrize("kind", FAMILY)
def test_errors_are_copied_whole(kind):
    inner = OverlapError("{a} lies apart", kind="apart").naming(a="{b}")
    error = kind(
        "{where}: {error}", kind="x", where="{patches}", error=inner, parameter=Term("by", value="z")
    )
    sent = pickle.loads(pickle.dumps(error))  # noqa: S301
    for again in (sent, copy.copy(error), copy.deepcopy(error)):
        assert type(again) is kind
        assert str(again) == str(error) == "{patches}: {b} lies apart"
        assert (again.kind, again.parameter) == ("x", "by")


def refuse(_):
    checks.check_number("band", lambda: 0, 4)


def test_errors_with_unpicklable_values_return_from_processes():
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(OptionError) as raised,
    ):
        list(pool.map(refuse, [None]))
    assert str(raised.value).startswith("band is <function refuse.<locals>.<lambda> at")
    assert raised.value.allowed == Interval(4)


def test_front_ends_name_terms_and_settings():
    error = OptionError("leave {patch} out with {shifts}", kind="conflict", shifts=Term("by", value="shifts"))
    assert str(error) == "leave patch out with by='shifts'"
    said = error.sentence(lambda term: f"--{term.name} {term.value or ''}".strip())
    assert said == "leave --patch out with --by shifts"
    assert error.naming(patch="{x}").sentence(lambda term: None) == "leave {x} out with by='shifts'"


def test_a_longer_sentence_keeps_kind_and_data():
    error = OverlapError("{a} is alone", kind="alone", layers=(3,), file="x").within(
        "{file}: {error}", file="{y}"
    )
    assert (str(error), error.kind, error.layers) == ("{y}: a is alone", "alone", (3,))


def calls():
    for file in sorted(CORE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and node.args:
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                if (name.endswith("Error") or name == "within") and node.keywords:
                    yield f"{file.name}:{node.lineno}", node


def test_templates_are_constants_whose_fields_are_data_or_terms():
    nodes = [
        node for file in CORE.rglob("*.py") for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
    ]
    parameters = {node.arg for node in nodes if isinstance(node, ast.arg)} | {
        node.target.id
        for node in nodes
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    found = list(calls())
    assert len(found) > 100
    for place, call in found:
        template = call.args[0]
        assert isinstance(template, ast.Constant), f"{place}: what users have written belongs into data"
        given = {keyword.arg for keyword in call.keywords}
        fields = {field for _, field, _, _ in string.Formatter().parse(template.value) if field is not None}
        if None not in given:
            assert fields - given <= NOUNS | parameters | {"error"}, place


def test_every_error_has_a_kind():
    plain = []
    for file in sorted(CORE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = {kind.__name__ for kind in FAMILY}
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in names:
                kinds = [keyword for keyword in node.keywords if keyword.arg == "kind"]
                plain += [] if kinds else [ast.unparse(node)]
    assert plain == ["TopoSeamError(str(format_message()))"]  # of click, whose sentence it keeps
