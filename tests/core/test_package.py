"""The core is a library: quick to import, quiet, and on its own."""

import ast
import inspect
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest
from public_names import public_names

import toposeam as ts

CORE = Path(ts.__file__).parent
FILES = sorted(CORE.rglob("*.py"))


def in_a_fresh_process(code):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True
    ).stdout


def test_importing_loads_no_command_line_or_optional_packages():
    loaded = in_a_fresh_process(
        "import sys, toposeam; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    ).split()
    assert "toposeam" in loaded
    unwanted = {
        "click",
        "PIL",
        "gi",
        "matplotlib",
        "pyvips",
        "maxflow",
        "toposeam_cli",
        "svgelements",
        "defusedxml",
        "tifffile",
        "pytest",
    }
    assert not unwanted & set(loaded)


def test_importing_prints_nothing_and_sets_no_threads():
    assert (
        in_a_fresh_process(
            "import os; before = dict(os.environ); import toposeam; assert dict(os.environ) == before"
        )
        == ""
    )


def test_importing_is_quick_because_it_loads_next_to_nothing():
    before, after = (
        set(in_a_fresh_process(f"import sys{more}; print(*sys.modules)").split())
        for more in ("", ", toposeam")
    )
    loaded = after - before
    assert not {"numpy", "scipy", "skimage", "contourpy", "threadpoolctl"} & loaded
    assert {name for name in loaded if name.startswith("toposeam")} == {"toposeam"}
    assert not {name for name in loaded if name.partition(".")[0] not in sys.stdlib_module_names} - {
        name for name in loaded if name.startswith(("toposeam", "lazy_loader"))
    }


def test_stitching_several_layers_loads_no_slow_modules():
    loaded = in_a_fresh_process(
        "import sys, numpy as np, toposeam as ts; whole = np.random.default_rng(0).random((90, 90, 3))\n"
        "layers = [ts.Layer(whole[y : y + 60, x : x + 60], at=(x, y)) for y in (0, 30) for x in (0, 30)]\n"
        "for blend in ('none', 'multiband'): ts.stitch(layers, blend=blend, match_tones=True)\n"
        "print(*sys.modules)"
    ).split()
    slow = {"scipy.optimize", "scipy.spatial", "scipy.stats", "scipy.signal", "scipy.fft", "skimage"}
    assert not (slow | {"toposeam.optimize.mma"}) & set(loaded)


def test_filling_loads_no_svg():
    loaded = in_a_fresh_process(
        "import sys, numpy as np, toposeam as ts; image = np.random.default_rng(0).random((60, 60, 3))\n"
        "hole = np.zeros((60, 60), bool); hole[20:30, 20:30] = True; ts.fill(image, hole)\n"
        "print(*sys.modules)"
    ).split()
    assert "toposeam.texture.fill" in loaded
    assert "toposeam.vector.svg" not in loaded


def imported(tree):
    """Every module an ``import`` names, wherever it stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or "." * node.level


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.relative_to(CORE).as_posix())
def test_the_core_does_not_import_front_ends(file):
    tree = ast.parse(file.read_text(encoding="utf-8"))
    roots = {name.partition(".")[0] for name in imported(tree)}
    front_ends = {"toposeam_cli", "toposeam_engine", "click", "gi", "matplotlib", "pyvips", "tkinter"}
    assert not roots & front_ends
    assert "PIL" not in roots or file.name == "display.py"
    assert "dask" not in roots or file.name in ("blocks.py", "block_surface.py")
    allowed = {
        "PIL",
        "dask",
        "__future__",
        "toposeam",
        "lazy_loader",
        "contourpy",
        "numpy",
        "scipy",
        "skimage",
        "qdldl",
        "threadpoolctl",
        "maxflow",
        "svgelements",
        "tifffile",
        "defusedxml",
    }
    assert roots <= allowed | sys.stdlib_module_names
    calls = {
        node.func.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert "print" not in calls


def test_heat_and_optimize_know_nothing_of_images():
    for room in ("heat", "optimize"):
        for file in (CORE / room).glob("*.py"):
            rooms = {
                name
                for name in imported(ast.parse(file.read_text(encoding="utf-8")))
                if name.startswith("toposeam.")
            }
            assert not {
                name
                for name in rooms
                if name.split(".")[1] in {"seam", "stitch", "vector", "texture", "images"}
            }, file


def test_the_version_is_stated_once():
    assert re.fullmatch(r"\d+\.\d+\.\d+([.a-z]\S*)?", ts.__version__)
    assert version("toposeam") == ts.__version__


@pytest.mark.medium
def test_what_is_offered_exists_once():
    rooms = [ts, *(value for name in ts.__all__ if isinstance(value := getattr(ts, name), ModuleType))]
    names = [name.split(".")[-1] for name in public_names()]
    assert len(names) == len(set(names))
    for room in rooms:
        assert sorted(room.__all__) == sorted(set(room.__all__))


@pytest.mark.medium
def test_rooms_show_nothing_but_what_they_offer():
    code = (
        "import toposeam as ts\n"
        "for room in (ts, ts.layers, ts.motif, ts.seam, ts.texture, ts.volume):\n"
        "    own = {n: v for n, v in vars(room).items() if not n.startswith('_')}\n"
        "    shown = {n for n, v in own.items() if not hasattr(v, '__file__')}\n"
        "    assert shown - {'lazy_loader'} <= set(room.__all__), (room, shown)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_error_is_ours_and_a_builtin():
    errors = [
        value for value in public_names().values() if isinstance(value, type) and issubclass(value, Exception)
    ]
    assert len(errors) > 5
    for error in errors:
        assert issubclass(error, ts.TopoSeamError)
        assert error is ts.TopoSeamError or any(base.__module__ == "builtins" for base in error.__bases__)


def test_help_begins_with_the_verbs_and_their_commands():
    from toposeam_cli.app.registry import COMMANDS

    text = ts.__doc__
    called = {
        name for name in ts.__all__ if callable(getattr(ts, name)) and inspect.ismodule(getattr(ts, name))
    }
    assert called <= set(COMMANDS)
    other = {"make_tileable", "synthesize", "generate_motif", "join_volumes", "plan_path", "to_pil"}
    verbs = {name for name in ts.__all__ if inspect.isfunction(getattr(ts, name))} - other | called
    told, _, after = text.partition("Arrays and PIL")
    assert set(re.findall(r"(?<!`)`(\w+)`(?!`)", told)) == verbs
    assert verbs - {"find_places", "find_seam", "find_surface", "verdict"} <= set(COMMANDS)
    rooms = {name for name in ts.__all__ if inspect.ismodule(getattr(ts, name))}
    assert rooms <= set(re.findall(r"`(\w+)`", after))


def test_former_names_stay_for_a_version():
    assert ts.make_tileable is ts.tile
    assert ts.synthesize is ts.synth
    former = {"generate_motif": ts.motif, "join_volumes": ts.volume, "plan_path": ts.path}
    for name, verb in former.items():
        assert inspect.signature(getattr(ts, name)) == inspect.signature(verb)


@pytest.mark.parametrize("room", ["motif", "volume", "path"])
def test_a_room_is_called_as_its_command_is(room):
    assert isinstance(getattr(ts, room), ModuleType)
    called = f"import toposeam.{room}; toposeam.{room}()"
    assert f"{room}() missing" in in_a_fresh_process(f"try:\n {called}\nexcept TypeError as e: print(e)")
    assert "Parameters\n" in getattr(ts, room).__doc__


@pytest.mark.parametrize("room", ["motif", "volume", "path"])
def test_type_checkers_know_all_of_a_called_room(room):
    tree = ast.parse((CORE / "verbs.pyi").read_text())
    known = next(
        node.body
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name == f"{room.capitalize()}Verb"
    )
    names = {alias.name for node in known if isinstance(node, ast.ImportFrom) for alias in node.names}
    names |= {node.targets[0].id for node in known if isinstance(node, ast.Assign)}
    assert names == {*getattr(ts, room).__all__, "__call__"}


USER = """
import numpy as np
import toposeam as ts
from toposeam.motif import Motif, Recipe
from toposeam.volume import JoinedVolume

drop: Motif = ts.motif(64, repeat="p4m", seed=3)
sheet = ts.repeat(drop, (2, 3))
length: float = ts.path((16, 24), (2, 8), (21, 8)).length
slices = np.zeros((4, 8, 8), np.uint8)
joined: JoinedVolume = ts.volume(slices, slices, offset=(2, 0, 0))
recipe: Recipe = ts.motif.random_recipe(32, seed=1)
again: Motif = ts.motif(ts.motif.vary(recipe))
"""
WRONG = """
ts.motif("64")
ts.motif(64, repaet="p4m")
ts.path((16, 24), (2, 8))
ts.motif.random_recipes(3)
"""


@pytest.mark.slow
def test_mypy_accepts_rooms_that_are_called(tmp_path):
    api = pytest.importorskip("mypy.api")
    script = tmp_path / "user.py"
    script.write_text(USER + WRONG)
    options = ["--strict", "--config-file=", "--no-incremental", "--follow-untyped-imports"]
    said, failed, _ = api.run([*options, str(script)])
    assert not failed
    lines = [int(line.split(":")[1]) for line in said.splitlines() if "error:" in line]
    first = USER.count("\n") + 2
    assert lines == [first, first + 1, first + 2, first + 3], said


def test_what_a_called_room_makes():
    options = {"layers": 1, "seed": 1, "iterations": 2}
    assert ts.motif(16, **options).recipe == ts.generate_motif(16, **options).recipe
