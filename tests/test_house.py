"""The house: which room may import which, that nothing runs in circles, and what is never loaded where."""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]
PACKAGES = {
    "toposeam": HERE / "core",
    "toposeam_cli": HERE / "cli",
    "toposeam_engine": HERE / "plugin_gimp",
    "toposeam_gimp": HERE / "plugin_gimp",
}

#: Each room, and the rooms its modules may import; within a room everything may import everything that
#: does not make a circle. A room is a folder, or a module beside the folders; "toposeam" is the public face.
BASE = {
    "toposeam.arrays",
    "toposeam.errors",
    "toposeam.sentence",
    "toposeam.checks",
    "toposeam.images",
    "toposeam.colours",
    "toposeam.typing",
    "toposeam.verbs",
}
BELOW = BASE | {
    "toposeam.saving",
    "toposeam.display",
    "toposeam.picture_files",
    "toposeam._kernels",
    "toposeam.heat",
    "toposeam.optimize",
    "toposeam.vector",
}
CLI_CORE = {"toposeam", "toposeam_cli"} | BASE
ARROWS = {
    "toposeam": set(),
    "toposeam.__main__": set(),
    "toposeam.arrays": set(),
    "toposeam.errors": set(),
    "toposeam.sentence": {"toposeam.errors"},
    "toposeam.checks": {"toposeam.errors"},
    "toposeam.images": {"toposeam._kernels", "toposeam.arrays", "toposeam.errors", "toposeam.checks"},
    "toposeam.colours": {"toposeam.arrays", "toposeam.errors"},
    "toposeam.saving": {"toposeam.checks"},
    "toposeam.display": BASE,
    "toposeam.picture_files": BASE | {"toposeam.display", "toposeam.saving"},
    "toposeam._kernels": set(),
    "toposeam.heat": {"toposeam._kernels", "toposeam.arrays", "toposeam.errors", "toposeam.checks"},
    "toposeam.optimize": {"toposeam.arrays", "toposeam.errors", "toposeam.checks"},
    "toposeam.vector": {
        "toposeam.arrays",
        "toposeam.errors",
        "toposeam.sentence",
        "toposeam.checks",
        "toposeam.saving",
        "toposeam.display",
    },
    "toposeam.seam": BELOW,
    "toposeam.layers": BELOW | {"toposeam.seam", "toposeam.texture"},
    "toposeam.texture": BELOW | {"toposeam.seam"},
    "toposeam.motif": BELOW,
    "toposeam.path": BELOW,
    "toposeam.volume": BELOW | {"toposeam.seam"},
    "toposeam.solid": BELOW | {"toposeam.motif", "toposeam.volume"},
    "toposeam.typing": set(),
    "toposeam.verbs": set(),
    "toposeam_cli": set(),
    "toposeam_cli.__main__": {"toposeam_cli.app", "toposeam_gimp"},
    "toposeam_cli.app": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.jobs"},
    "toposeam_cli.files": CLI_CORE,
    "toposeam_cli.jobs": CLI_CORE | {"toposeam_cli.files"},
    "toposeam_cli.media": CLI_CORE
    | {"toposeam_cli.files", "toposeam.layers", "toposeam.motif", "toposeam.vector"},
    "toposeam_cli.figures": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.media"},
    "toposeam_cli.gimp": CLI_CORE | {"toposeam_cli.files", "toposeam_gimp"},
    "toposeam_cli.batch": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.app"},
    "toposeam_cli.stitching": CLI_CORE
    | {
        "toposeam._kernels",
        "toposeam.layers",
        "toposeam_cli.app",
        "toposeam_cli.figures",
        "toposeam_cli.files",
        "toposeam_cli.jobs",
        "toposeam_cli.media",
    },
    "toposeam_cli.edit": CLI_CORE
    | {
        "toposeam.layers",
        "toposeam.motif",
        "toposeam.seam",
        "toposeam_cli.app",
        "toposeam_cli.files",
        "toposeam_cli.media",
        "toposeam_cli.motifs",
        "toposeam_cli.stitching",
    },
    "toposeam_cli.textures": CLI_CORE | {"toposeam_cli.app", "toposeam_cli.files", "toposeam_cli.media"},
    "toposeam_cli.motifs": CLI_CORE
    | {
        "toposeam.motif",
        "toposeam.vector",
        "toposeam_cli.app",
        "toposeam_cli.figures",
        "toposeam_cli.files",
        "toposeam_cli.media",
    },
    "toposeam_engine": BELOW
    | {"toposeam", "toposeam.layers", "toposeam.texture", "toposeam.motif", "toposeam.volume"},
    "toposeam_gimp": set(),
}
#: Whatever the front ends have in common is below the commands; they may use all of it, and not each other.
ARROWS["toposeam_cli.commands"] = set(ARROWS) - {"toposeam_engine", "toposeam_gimp", "toposeam_cli.__main__"}
#: Inside a room: each sub-room, and what of the room it may import. Modules beside the sub-rooms are the
#: room's doors: they may import all of it.
INSIDE: dict[str, dict[str, set[str]]] = {
    "toposeam.seam": {
        "problem": set(),
        "exact": {"problem"},
        "heat": {"problem", "exact"},
        "thesis": {"problem"},
        "result": {"problem", "exact", "heat"},
    },
    "toposeam.layers": {
        "canvas": set(),
        "execution": {"canvas"},
        "labelling": {"canvas"},
        "search": {"canvas", "execution", "labelling"},
        "exposure": {"canvas", "execution"},
        "mesh": {"canvas", "execution", "labelling", "exposure"},
        "boundary": {"canvas", "mesh"},
        "registration": {"canvas", "execution", "labelling", "mesh"},
        "blending": {"canvas"},
        "composite": {
            "canvas",
            "execution",
            "labelling",
            "search",
            "registration",
            "exposure",
            "blending",
            "boundary",
        },
    },
    "toposeam.texture": {
        "exemplar": set(),
        "canvas": {"exemplar"},
        "periodicity": {"exemplar", "canvas"},
        "light": {"exemplar", "canvas"},
        "placement": {"exemplar", "canvas", "periodicity"},
        "scheduling": {"canvas", "placement"},
        "repair": {"exemplar", "canvas", "placement", "scheduling"},
        "objects": {"exemplar", "canvas", "placement", "scheduling"},
        "holes": {"exemplar", "canvas", "periodicity", "light", "placement"},
    },
    "toposeam.motif": {
        "symmetry": set(),
        "ink": {"symmetry"},
        "recipe": {"symmetry", "ink"},
        "optimise": {"symmetry", "ink", "recipe"},
    },
    "toposeam.volume": {
        "problem": set(),
        "heat": {"problem"},
        "clip": {"problem", "heat", "find", "surface"},
    },
    "toposeam_gimp": {
        "entries": {"texts"},
        "engine": {"texts", "sentences", "entries"},
        "image": {"texts", "engine"},
        "dialogs": {"texts", "image", "engine", "entries", "actions"},
        "actions": {"texts", "image", "engine", "entries"},
    },
}
#: Modules in a folder, and lines of a class, that a reader holds.
MODULES = 15
CLASS_LINES = 250
#: A test's name is shorter.
NAME_CHARACTERS = 60
#: Classes that are still longer, to be shortened: nothing may be added.
LONG_CLASSES = {"Composition", "ShiftMoves", "_Run"}
WITHOUT_CLICK = {
    "toposeam_cli.media",
    "toposeam_cli.files",
    "toposeam_cli.jobs",
    "toposeam_cli.figures",
    "toposeam_engine",
}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def module_name(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def imports() -> dict[str, set[str]]:
    """Every module of the house, and what it imports anywhere in its text."""
    paths = {
        module_name(path, root): path
        for name, root in PACKAGES.items()
        for path in (root / name).rglob("*.py")
    }
    found = {}
    for name, path in paths.items():
        package = name if path.stem == "__init__" else name.rpartition(".")[0]
        wanted: set[str] = set()
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
                base = ".".join([*above, *([node.module] if node.module else [])])
                wanted |= {
                    f"{base}.{alias.name}" if f"{base}.{alias.name}" in paths else base
                    for alias in node.names
                }
        found[name] = wanted - {name}
    return found


def room(module: str) -> str:
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] in ("toposeam", "toposeam_cli") and len(parts) > 1 else parts[0]


@pytest.mark.medium
def test_every_arrow_points_where_the_house_allows():
    against = sorted(
        f"{module} imports {other}"
        for module, wanted in imports().items()
        for other in wanted
        if other.split(".")[0] in PACKAGES
        and room(other) != room(module)
        and room(other) not in ARROWS[room(module)]
    )
    assert not against, "\n".join(against)


@pytest.mark.medium
@pytest.mark.parametrize("home", sorted(INSIDE))
def test_arrows_inside_a_room(home):
    def part(module: str) -> str:
        return module.removeprefix(home + ".").split(".")[0] if module.startswith(home + ".") else ""

    inside = INSIDE[home]
    folder = PACKAGES[home.split(".")[0]] / home.replace(".", "/")
    assert {path.parent.name for path in folder.glob("*/__init__.py")} == set(inside)
    against = sorted(
        f"{module} imports {other}"
        for module, wanted in imports().items()
        if part(module) in inside
        for other in wanted
        if part(other) and part(other) != part(module) and part(other) not in inside[part(module)]
    )
    assert not against, "\n".join(against)


def test_nothing_imports_in_a_circle():
    state: dict[str, int] = {}
    circles = []

    def visit(module: str, trail: list[str]) -> None:
        state[module] = 1
        for other in sorted(imports().get(module, ())):
            if state.get(other) == 1:
                circles.append(" → ".join([*trail[trail.index(other) :], other]))
            elif other in imports() and other not in state:
                visit(other, [*trail, other])
        state[module] = 2

    for module in imports():
        if module not in state:
            visit(module, [module])
    assert not circles, "\n".join(circles)


@pytest.mark.parametrize("name", sorted(WITHOUT_CLICK))
def test_rooms_below_the_commands_know_nothing_of_click(name):
    assert not [module for module, wanted in imports().items() if room(module) == name and "click" in wanted]


def test_every_command_is_known_by_its_own_first_line():
    from toposeam_cli.app.registry import COMMANDS, load

    modules = {path.stem for path in (HERE / "cli/toposeam_cli/commands").glob("*.py")} - {"__init__"}
    assert modules == set(COMMANDS)
    for name, line in COMMANDS.items():
        assert load(name).get_short_help_str(1000) == line


def test_every_room_says_in_a_line_what_it_holds():
    for name, root in PACKAGES.items():
        for path in (root / name).rglob("__init__.py"):
            assert ast.get_docstring(parsed(path)), path


@pytest.mark.parametrize("words", [["--help"], ["--version"]])
def test_help_loads_no_command_and_no_numerics(words):
    code = (
        "import sys, toposeam_cli.app.main as m\n"
        f"try: m.main({words!r})\n"
        "except SystemExit: pass\n"
        "loaded = {n for n in sys.modules if n.split('.')[0] in ('numpy', 'scipy', 'toposeam_cli', "
        "'pyvips')}\nassert not any(n.startswith(('numpy', 'scipy', 'pyvips', 'toposeam_cli.commands.')) for "
        "n in loaded), loaded"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_a_tab_loads_no_command():
    environment = {
        **os.environ,
        "_TOPOSEAM_COMPLETE": "bash_complete",
        "COMP_WORDS": "toposeam st",
        "COMP_CWORD": "1",
    }
    code = (
        "import sys, toposeam_cli.app.main as m\n"
        "try: m.main(prog_name='toposeam')\n"
        "except SystemExit: pass\n"
        "print(any(n == 'numpy' or n.startswith('toposeam_cli.commands.') for n in sys.modules))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment
    )
    assert ended.stdout.split() == ["plain,stitch", "False"]


def test_the_package_runs_as_a_module():
    ended = subprocess.run(
        [sys.executable, "-m", "toposeam", "--version"], check=True, capture_output=True, text=True
    )
    assert ended.stdout.startswith("toposeam, version")


def test_no_two_classes_share_a_name():
    places: dict[str, list[str]] = {}
    for name, root in PACKAGES.items():
        for path in (root / name).rglob("*.py"):
            for node in ast.walk(parsed(path)):
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    places.setdefault(node.name, []).append(path.relative_to(HERE).as_posix())
    assert not {name: files for name, files in places.items() if len(files) > 1}


def test_a_folder_has_about_a_dozen_modules():
    crowded = {
        folder.relative_to(HERE).as_posix(): count
        for name, root in PACKAGES.items()
        for folder in [root / name, *(path.parent for path in (root / name).rglob("__init__.py"))]
        if folder.name != "commands"
        if (count := len([path for path in folder.glob("*.py") if not path.name.startswith("__")])) > MODULES
    }
    assert not crowded


def test_a_class_is_no_longer_than_a_reader_holds():
    long = {
        node.name
        for name, root in PACKAGES.items()
        for path in (root / name).rglob("*.py")
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ClassDef) and node.end_lineno - node.lineno + 1 > CLASS_LINES
    }
    assert long == LONG_CLASSES


#: Annotations of arrays.
ARRAYS = ("NDArray", "ndarray", ": Floats", ": Ints", ": Complexes", ": Mask")


def test_dataclasses_are_frozen_and_arrays_not_compared():
    """All that core defines for others are frozen; those that hold arrays compare by identity, as `==` of
    arrays is no truth value. Mutations of these options are left out, as this test notices them.
    """
    loose, compared = [], []
    for path in [*(HERE / "core").rglob("*.py"), *(HERE / "cli").rglob("*.py")]:
        for node in ast.walk(parsed(path)):
            words = [ast.unparse(each) for each in getattr(node, "decorator_list", ())]
            made = next(
                (each for each in words if each.startswith(("dataclass", "dataclasses.dataclass"))), None
            )
            if made is None:
                continue
            if "frozen=True" not in made and "core" in path.parts and not node.name.startswith("_"):
                loose.append(f"{path.name}: {node.name}")
            fields = [ast.unparse(each) for each in node.body if isinstance(each, ast.AnnAssign)]
            arrays = [each for each in fields if any(word in each for word in ARRAYS)]
            if "eq=False" not in made and any("compare=False" not in each for each in arrays):
                compared.append(f"{path.name}: {node.name}")
    assert not loose
    assert not compared


#: What starts a program, and the only modules that may: all else goes through `launching`, which takes
#: nothing from the working directory. `protect` does so for multiprocessing and for what GTK opens.
STARTS = re.compile(
    r"\b(subprocess\.(run|call|Popen|check_\w+|get\w+)|os\.(system|popen|startfile|exec\w+|spawn\w+|posix_spawn\w*)"
    r"|webbrowser\.\w+|click\.(launch|edit|echo_via_pager)|create_subprocess\w+|pty\.\w+|get_context|ProcessPoolExecutor"
    r"|LocalCluster|Gio\.(AppInfo|Subprocess)|GLib\.spawn\w*|show_uri\w*)\b"
)
STARTERS = {
    "launching.py": {"subprocess.Popen"},
    "workers.py": {"get_context", "ProcessPoolExecutor"},
    "dask_workers.py": {"LocalCluster"},
    "dialog.py": {"Gio.AppInfo"},
    "processes.py": {"get_context"},
    "edit.py": {"webbrowser.open"},  # finds browsers on the PATH that `protect` has left
}


def test_programs_are_started_in_one_place():
    found: dict[str, set[str]] = {}
    for name, root in PACKAGES.items():
        for path in (root / name).rglob("*.py"):
            calls = [node.func for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]
            for word in {match[0] for call in calls if (match := STARTS.search(ast.unparse(call)))}:
                found.setdefault(path.name, set()).add(word)
    assert found == STARTERS


#: What prints, and the only modules that may: names of files may hold anything, which `say` escapes.
PRINTS = re.compile(r"^(click\.(echo|secho|progressbar)|print|sys\.std(out|err)\.write)$")
PRINTERS = {
    "progress.py": {"click.echo", "click.progressbar", "sys.stderr.write"},
    "__main__.py": {"sys.stderr.write"},
}


def test_what_is_printed_goes_through_one_function():
    found: dict[str, set[str]] = {}
    for path in (HERE / "cli" / "toposeam_cli").rglob("*.py"):
        calls = [node.func for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]
        for word in {match[0] for call in calls if (match := PRINTS.match(ast.unparse(call)))}:
            found.setdefault(path.name, set()).add(word)
    assert found == PRINTERS


def test_names_of_tests_are_short():
    long = {
        f"{path.relative_to(HERE).as_posix()}: {node.name}"
        for path in (HERE / "tests").rglob("*.py")
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and len(node.name) >= NAME_CHARACTERS
    }
    assert not long


def test_a_map_for_mutations_takes_in_every_test_file():
    from covering import pieces

    measured = [HERE / file for files in pieces().values() for file in files if file.endswith(".py")]
    assert len(set(measured)) == len(measured)
    for side in ("core", "cli"):
        assert set((HERE / "tests" / side).rglob("test_*.py")) <= set(measured)


@cache
def house():
    """The script that counts, as a module."""
    spec = spec_from_file_location("house", HERE / "tools/house.py")
    module = sys.modules["house"] = module_from_spec(spec)
    spec.loader.exec_module(module)
    module.parsed = parsed  # each module is parsed once
    return module


def within(name: str, figure: int) -> None:
    limit = house().LIMITS[name]
    assert figure <= limit, f"{figure} {name}, and {limit} are the most; make house lists where"


def test_a_stitch_gains_no_classes():
    within("classes of a stitch", house().classes().total())


def test_an_option_is_written_in_no_more_places():
    places = house().option_places()
    assert {"blend", "effort", "give"} <= set(places)
    within("places of an option", max(map(len, places.values())))


@pytest.mark.medium
def test_no_function_branches_more():
    most, where = house().branches()[0]
    assert most <= house().LIMITS["branches of a function"], where


def test_no_room_gains_constants():
    within("constants of a room", max(house().constants().values()))


@pytest.mark.medium
def test_a_stitch_runs_no_more_files_and_steps():
    walk = house().walk()
    within("files that a stitch runs", walk.files)
    within("steps of a stitch into another file", walk.steps)


@pytest.mark.medium
def test_json_of_a_stitch_has_no_more_forms():
    within("forms of JSON", len(set(house().json_forms().values())))
