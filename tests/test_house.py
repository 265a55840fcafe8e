"""The house: which room may import which, that nothing runs in circles, and what is never loaded where."""

import ast
import os
import subprocess
import sys
from functools import cache
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
BASE = {"toposeam.errors", "toposeam.sentence", "toposeam.checks", "toposeam.images", "toposeam.colours"}
BELOW = BASE | {
    "toposeam.saving",
    "toposeam.display",
    "toposeam.heat",
    "toposeam.optimize",
    "toposeam.vector",
}
CLI_CORE = {"toposeam", "toposeam_cli"} | BASE
ARROWS = {
    "toposeam": set(),
    "toposeam.__main__": set(),
    "toposeam.errors": set(),
    "toposeam.sentence": {"toposeam.errors"},
    "toposeam.checks": {"toposeam.errors"},
    "toposeam.images": {"toposeam.errors", "toposeam.checks"},
    "toposeam.colours": {"toposeam.errors"},
    "toposeam.saving": set(),
    "toposeam.display": BASE,
    "toposeam.heat": {"toposeam.errors", "toposeam.checks"},
    "toposeam.optimize": {"toposeam.errors", "toposeam.checks"},
    "toposeam.vector": {
        "toposeam.errors",
        "toposeam.sentence",
        "toposeam.checks",
        "toposeam.saving",
        "toposeam.display",
    },
    "toposeam.seam": BELOW,
    "toposeam.layers": BELOW | {"toposeam.seam"},
    "toposeam.texture": BELOW | {"toposeam.seam"},
    "toposeam.motif": BELOW,
    "toposeam.path": BELOW,
    "toposeam.volume": BELOW | {"toposeam.seam"},
    "toposeam.solid": BELOW | {"toposeam.motif", "toposeam.volume"},
    "toposeam_cli": set(),
    "toposeam_cli.files": CLI_CORE,
    "toposeam_cli.pictures": CLI_CORE | {"toposeam_cli.files", "toposeam.motif", "toposeam.vector"},
    "toposeam_cli.stacks": CLI_CORE | {"toposeam_cli.files"},
    "toposeam_cli.clips": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.pictures"},
    "toposeam_cli.jobs": CLI_CORE | {"toposeam_cli.files"},
    "toposeam_cli.figures": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.pictures"},
    "toposeam_cli.gimp": CLI_CORE | {"toposeam_cli.files", "toposeam_gimp"},
    "toposeam_cli.options": CLI_CORE | {"toposeam_cli.files"},
    "toposeam_cli.later": set(),
    "toposeam_cli.registry": {"toposeam_cli", "toposeam_cli.later", "toposeam_cli.terms"},
    "toposeam_cli.terms": CLI_CORE,
    "toposeam_cli.progress": CLI_CORE | {"toposeam_cli.jobs"},
    "toposeam_cli.report": CLI_CORE,
    "toposeam_cli.whereabouts": CLI_CORE | {"toposeam_cli.pictures", "toposeam_cli.options"},
    "toposeam_cli.placing": CLI_CORE
    | {
        "toposeam.layers",
        "toposeam_cli.files",
        "toposeam_cli.pictures",
        "toposeam_cli.options",
        "toposeam_cli.turning",
        "toposeam_cli.whereabouts",
    },
    "toposeam_cli.turning": CLI_CORE | {"toposeam.layers", "toposeam_cli.files", "toposeam_cli.pictures"},
    "toposeam_cli.composing": CLI_CORE
    | {
        "toposeam.layers",
        "toposeam_cli.figures",
        "toposeam_cli.files",
        "toposeam_cli.pictures",
        "toposeam_cli.placing",
    },
    "toposeam_cli.framed": CLI_CORE | {"toposeam.layers"},
    "toposeam_cli.large": CLI_CORE
    | {
        "toposeam.layers",
        "toposeam_cli.composing",
        "toposeam_cli.framed",
        "toposeam_cli.files",
        "toposeam_cli.pictures",
        "toposeam_cli.placing",
    },
    "toposeam_cli.drawn_seams": CLI_CORE | {"toposeam_cli.options", "toposeam_cli.placing"},
    "toposeam_cli.finding": CLI_CORE
    | {
        "toposeam.layers",
        "toposeam_cli.composing",
        "toposeam_cli.drawn_seams",
        "toposeam_cli.figures",
        "toposeam_cli.files",
        "toposeam_cli.jobs",
        "toposeam_cli.options",
        "toposeam_cli.placing",
        "toposeam_cli.progress",
    },
    "toposeam_cli.enblend_line": CLI_CORE | {"toposeam_cli.files"},
    "toposeam_cli.seam_page": CLI_CORE,
    "toposeam_cli.shells": {"toposeam_cli"},
    "toposeam_cli.texture_files": CLI_CORE
    | {"toposeam_cli.files", "toposeam_cli.pictures", "toposeam_cli.options"},
    "toposeam_cli.print_options": CLI_CORE
    | {"toposeam_cli.files", "toposeam_cli.pictures", "toposeam_cli.options", "toposeam.motif"},
    "toposeam_cli.motif_options": CLI_CORE
    | {"toposeam_cli.options", "toposeam_cli.print_options", "toposeam.motif"},
    "toposeam_cli.batch": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.options", "toposeam_cli.registry"},
    "toposeam_cli.book": CLI_CORE | {"toposeam_cli.figures", "toposeam_cli.pictures", "toposeam.motif"},
    "toposeam_cli.__main__": {"toposeam_cli.main"},
    "toposeam_cli.main": CLI_CORE | {"toposeam_cli.files", "toposeam_cli.registry", "toposeam_cli.shells"},
    "toposeam_engine": BELOW | {"toposeam", "toposeam.layers", "toposeam.texture", "toposeam.motif"},
    "toposeam_gimp": set(),
}
#: Whatever the front ends have in common is below the commands; they may use all of it, and not each other.
ARROWS["toposeam_cli.commands"] = set(ARROWS) - {
    "toposeam_engine",
    "toposeam_gimp",
    "toposeam_cli.main",
    "toposeam_cli.__main__",
}
WITHOUT_CLICK = {
    "toposeam_cli.clips",
    "toposeam_cli.stacks",
    "toposeam_cli.pictures",
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
    from toposeam_cli.registry import COMMANDS, load

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
        "import sys, toposeam_cli.main as m\n"
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
        "import sys, toposeam_cli.main as m\n"
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


def test_no_file_is_longer_than_a_reader_holds():
    """400 lines; longer ones are split by theme."""
    folders = ("core", "cli", "plugin_gimp", "tests", "benchmarks", "docs", "samples", "tools")
    long = {
        path.relative_to(HERE).as_posix(): lines
        for folder in folders
        for path in (HERE / folder).rglob("*.py")
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > 400
    }
    assert not long


def test_what_core_gives_away_cannot_be_changed():
    """Every dataclass of core that has a public name is frozen."""
    loose = []
    for path in (HERE / "core").rglob("*.py"):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                for decorator in node.decorator_list:
                    words = ast.unparse(decorator)
                    if words.startswith("dataclass") and "frozen=True" not in words:
                        loose.append(f"{path.name}: {node.name}")
    assert not loose
