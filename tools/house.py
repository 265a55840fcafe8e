"""Print figures that say how easily the code of a stitch is read: ``python tools/house.py`` (``make house``).

Counted are the files and functions that ``toposeam stitch`` runs for two photographs, the classes it has, the
places in which one of its options is written, the forms of its JSON, the branches of functions, and the
numeric constants of rooms. ``tests/test_house.py`` holds them against :data:`LIMITS`.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: What users run is in these two; the plug-in for GIMP only calls it.
PACKAGES = ("core/toposeam", "cli/toposeam_cli")
STITCH = "cli/toposeam_cli/commands/stitch.py"
#: Where classes of a stitch are counted.
CLASS_ROOMS = ("core/toposeam/layers", "cli/toposeam_cli/stitching")
#: Where options of a stitch are written.
OPTION_ROOMS = (
    "core/toposeam/layers/composite",
    "cli/toposeam_cli/stitching",
    "cli/toposeam_cli/app/options.py",
    STITCH,
)
#: The functions of core that take these options.
JOINING = ("stitch",)
#: Where lines of a stitch are counted.
LINE_ROOMS = (*CLASS_ROOMS, STITCH, "plugin_gimp/toposeam_engine")

#: The most that each figure may be. They may only fall: lower a limit in the commit that lowers its figure.
LIMITS = {
    "files that a stitch runs": 88,
    "steps of a stitch into another file": 2200,
    "classes of a stitch": 94,
    "places of an option": 3,
    "forms of JSON": 1,
    "branches of a function": 24,
    "constants of a room": 75,
}


def modules(*rooms: str) -> Iterator[tuple[str, ast.Module]]:
    """Yield the path from the checkout and the parsed text of each module in some folders or files."""
    for room in rooms:
        path = ROOT / room
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            yield file.relative_to(ROOT).as_posix(), parsed(file)


@cache
def parsed(file: Path) -> ast.Module:
    """Parse the text of a module."""
    return ast.parse(file.read_text(encoding="utf-8"))


# What runs


@dataclass(frozen=True)
class Walk:
    """How a command went through the code of core and of the command line.

    Modules are left out as they are imported, but the bodies of their classes count as functions; so is all
    that modules of others call as they are imported.
    """

    files: int
    functions: int
    calls: int
    #: Calls of a function in another file than that of its nearest caller in core or the command line.
    steps: int
    #: The steps into each file.
    into: dict[str, int]


class Tracer:
    """A profiling function that counts calls, in all threads, until it is stopped."""

    def __init__(self) -> None:
        self._folders = tuple(f"{ROOT / package}{os.sep}" for package in PACKAGES)
        self._names: dict[str, str | None] = {}
        self._calls: Counter[tuple[str, str, int]] = Counter()
        self._steps: Counter[str] = Counter()

    def start(self) -> None:
        """Count from here on."""
        threading.setprofile(self._count)
        sys.setprofile(self._count)

    def stop(self) -> Walk:
        """End the counting and return its result."""
        sys.setprofile(None)
        threading.setprofile(None)
        return Walk(
            files=len({file for file, _, _ in self._calls}),
            functions=len(self._calls),
            calls=self._calls.total(),
            steps=self._steps.total(),
            into=dict(self._steps.most_common()),
        )

    def _count(self, frame: FrameType, event: str, _: Any) -> None:
        if event != "call" or frame.f_code.co_name == "<module>":
            return
        file = self._file(frame)
        if file is None:
            return
        caller = frame.f_back
        while caller is not None and self._file(caller) is None:
            if caller.f_code.co_name == "<module>" and caller.f_back is not None:
                return
            caller = caller.f_back
        self._calls[file, frame.f_code.co_qualname, frame.f_code.co_firstlineno] += 1
        if caller is not None and self._file(caller) != file:
            self._steps[file] += 1

    def _file(self, frame: FrameType) -> str | None:
        """Name the frame's file, if it is one of ours."""
        name = frame.f_code.co_filename
        if name not in self._names:
            ours = os.path.realpath(name).startswith(self._folders)
            self._names[name] = Path(os.path.realpath(name)).relative_to(ROOT).as_posix() if ours else None
        return self._names[name]


def walk() -> Walk:
    """Trace ``toposeam stitch`` of two photographs of the samples, in a process of its own.

    Raises
    ------
    subprocess.CalledProcessError
        When the command fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        output, counted = Path(folder, "joined.png"), Path(folder, "walk.json")
        photographs = [str(ROOT / f"samples/portrait_{side}.jpg") for side in ("left", "right")]
        words = [__file__, "--trace", str(counted), "stitch", *photographs, "-o", str(output)]
        subprocess.run([sys.executable, *words], check=True, capture_output=True, env=_environment())  # noqa: S603
        return Walk(**json.loads(counted.read_text(encoding="utf-8")))


def trace(target: Path, words: list[str]) -> None:
    """Run a command of the command line traced, and write its walk to a file."""
    sys.argv = ["toposeam", *words]
    tracer = Tracer()
    tracer.start()
    from toposeam_cli.__main__ import start

    try:
        start()
    finally:
        target.write_text(json.dumps(asdict(tracer.stop())), encoding="utf-8")


def _environment() -> dict[str, str]:
    """Let a new process import this checkout, and its numerical libraries start no threads."""
    paths = [str(ROOT / part) for part in ("core", "cli", "plugin_gimp")]
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": os.pathsep.join(paths)}


# What is written


def classes() -> Counter[str]:
    """Count the classes at the top of the modules of a stitch, by folder."""
    return Counter(
        str(Path(file).parent)
        for file, module in modules(*CLASS_ROOMS)
        for node in module.body
        if isinstance(node, ast.ClassDef)
    )


def option_places() -> dict[str, list[str]]:
    """List where each field of ``StitchOptions`` is written, and its use as one place more.

    A place is a decorator of the command, a field of a dataclass or TypedDict whose name ends with Options or
    Keywords, with its documentation beside it, and an entry in the docstring of a function that joins layers.
    """
    written: dict[str, list[str]] = {}
    own: list[str] = []
    for file, module in modules(*OPTION_ROOMS):
        for node in ast.walk(module):
            if isinstance(node, ast.ClassDef) and node.name.endswith(("Options", "Keywords")):
                names = [field for each in node.body if (field := _field(each)) is not None]
                own += names if node.name == "StitchOptions" else []
                place = f"field of {node.name} in {file}"
            elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] == "option":
                names, place = _flags(node), f"decorator in {file}"
            elif isinstance(node, ast.FunctionDef) and node.name in JOINING:
                names = _documented(ast.get_docstring(node) or "")
                place = f"docstring of {node.name} in {file}"
            else:
                continue
            for name in names:
                written.setdefault(name, []).append(place)
    return {name: [*written[name], "use"] for name in own}


def _field(node: ast.stmt) -> str | None:
    named = isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    return node.target.id if named else None


def _flags(call: ast.Call) -> list[str]:
    """Name the parameter that a decorator defines: the word without hyphens, else the first long flag."""
    words = [
        each.value for each in call.args if isinstance(each, ast.Constant) and isinstance(each.value, str)
    ]
    plain = [word for word in words if word.isidentifier()]
    flags = [word.split("/")[0].lstrip("-").replace("-", "_") for word in words if word.startswith("--")]
    return (plain or flags)[:1]


def _documented(docstring: str) -> list[str]:
    """Name the parameters that a numpydoc docstring has an entry for."""
    entries = docstring.partition("Parameters\n----------\n")[2].splitlines()
    names: list[str] = []
    for line, below in zip(entries, [*entries[1:], ""], strict=False):
        if below.startswith("---"):
            break
        if line and not line.startswith(" "):
            names += [name.strip(" *") for name in line.split(" : ")[0].split(",")]
    return names


#: What is counted as a branch; each further value of an ``and`` or ``or`` is one more.
_BRANCHES = (
    ast.If,
    ast.For,
    ast.AsyncFor,
    ast.While,
    ast.IfExp,
    ast.ExceptHandler,
    ast.comprehension,
    ast.match_case,
)


def branches() -> list[tuple[int, str]]:
    """Count the branches of each function and of the functions inside it; the most branched comes first."""
    counted = []
    for file, module in modules(*PACKAGES):
        for function in ast.walk(module):
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
                inside = list(ast.walk(function))
                count = sum(isinstance(node, _BRANCHES) for node in inside)
                count += sum(len(node.values) - 1 for node in inside if isinstance(node, ast.BoolOp))
                counted.append((count, f"{file}:{function.lineno} {function.name}"))
    return sorted(counted, reverse=True)


def constants() -> Counter[str]:
    """Count the numeric constants of modules, by room: a folder at most two below its package."""
    counted: Counter[str] = Counter()
    for file, module in modules(*PACKAGES):
        room = "/".join(Path(file).parts[:-1][:4])
        for node in module.body:
            if isinstance(node, ast.Assign):
                pairs = [pair for target in node.targets for pair in _named(target, node.value)]
            elif isinstance(node, ast.AnnAssign) and node.value is not None:
                pairs = list(_named(node.target, node.value))
            else:
                continue
            counted[room] += sum(name.isupper() and _is_numeric(value) for name, value in pairs)
    return +counted


def _named(target: ast.expr, value: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    """Yield each name that an assignment gives a value, and that value."""
    if isinstance(target, ast.Name):
        yield target.id, value
    elif isinstance(target, ast.Tuple):
        values = value.elts if isinstance(value, ast.Tuple) else [value] * len(target.elts)
        for each, part in zip(target.elts, values, strict=True):
            yield from _named(each, part)


def _is_numeric(value: ast.expr) -> bool:
    """Test whether an expression is a number, arithmetic of numbers and constants, or a tuple of such."""
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float | complex) and not isinstance(value.value, bool)
    if isinstance(value, ast.UnaryOp):
        return _is_numeric(value.operand)
    if isinstance(value, ast.BinOp):
        sides = (value.left, value.right)
        return any(map(_is_numeric, sides)) and all(_is_numeric(side) or _is_upper(side) for side in sides)
    return isinstance(value, ast.Tuple) and bool(value.elts) and all(map(_is_numeric, value.elts))


def _is_upper(value: ast.expr) -> bool:
    """Test whether an expression is a constant's name, like ``_TURN`` or ``np.pi``."""
    return (isinstance(value, ast.Name) and value.id.isupper()) or ast.unparse(value) in ("np.pi", "math.pi")


def lines() -> dict[str, int]:
    """Count the lines of each room of a stitch."""
    return {
        room: sum(len((ROOT / file).read_text(encoding="utf-8").splitlines()) for file, _ in modules(room))
        for room in LINE_ROOMS
    }


# What is printed by a stitch


def json_forms() -> dict[str, tuple[str, ...]]:
    """Join tiny pictures in several ways; return the keys at the top of what ``--json`` prints of each."""
    return {name: tuple(sorted(printed)) for name, printed in _printed().items()}


def _printed() -> Mapping[str, dict[str, Any]]:
    """Return what ``--json`` prints, by how pictures are joined."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        files = []
        with Image.open(ROOT / "samples/portrait_left.jpg") as photograph:
            width, height = photograph.size
            for number in range(3):
                left = width // 4 + 70 * number
                files.append(str(Path(folder, f"{number}.png")))
                photograph.crop((left, height // 4, left + 200, height // 4 + 200)).save(files[-1])
        row = ("--row", "--overlap", "130")
        ways = {
            "two placed": (*files[:2], *row),
            "three placed": (*files, *row),
            "two found": files[:2],
            "three found": files,
        }
        output = str(Path(folder, "joined.png"))
        made = {name: _stitch(*words, "-o", output) for name, words in ways.items()}
        with _stored(0):
            return made | {f"{name}, by windows": _stitch(*ways[name], "-o", output) for name in ways}


def _stitch(*words: str) -> dict[str, Any]:
    from toposeam_cli.app.main import main

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        main(["stitch", *words, "--json", "--quiet", "--force", "--jobs", "1"], standalone_mode=False)
    summary: dict[str, Any] = json.loads(printed.getvalue())
    return summary


@contextlib.contextmanager
def _stored(pixels: int) -> Iterator[None]:
    """Let pictures of more pixels than this wait in files, and be made by windows."""
    name = "STORED_PIXELS"
    holders = [
        each for key, each in sys.modules.items() if key.startswith("toposeam_cli.") and name in vars(each)
    ]
    if not holders:
        raise LookupError(f"no module of the command line has {name}; say here what it is called now")
    before = [vars(each)[name] for each in holders]
    try:
        for each in holders:
            setattr(each, name, pixels)
        yield
    finally:
        for each, value in zip(holders, before, strict=True):
            setattr(each, name, value)


def main() -> None:
    """Print all figures."""
    walked = walk()
    print("toposeam stitch of two photographs runs")
    _show(walked.files, "files", LIMITS["files that a stitch runs"])
    _show(walked.functions, "functions")
    _show(walked.calls, "calls")
    _show(walked.steps, "steps into another file", LIMITS["steps of a stitch into another file"])
    _list((count, file) for file, count in walked.into.items())
    by_folder = classes()
    print("\nIt has")
    _show(by_folder.total(), "classes", LIMITS["classes of a stitch"])
    _list((count, folder) for folder, count in by_folder.most_common())
    places = sorted(option_places().items(), key=lambda item: -len(item[1]))
    _show(len(places[0][1]), "places of an option at most", LIMITS["places of an option"])
    _list((len(found), f"{name}: {'; '.join(found)}") for name, found in places[:3])
    forms = json_forms()
    _show(len(set(forms.values())), "forms of JSON", LIMITS["forms of JSON"])
    _list((len(keys), f"{name}: {' '.join(keys)}") for name, keys in forms.items())
    branched, numbers, written = branches(), constants().most_common(), lines()
    print("\nCore and the command line have")
    _show(branched[0][0], "branches of a function at most", LIMITS["branches of a function"])
    _list(branched)
    _show(numbers[0][1], "numeric constants of a room at most", LIMITS["constants of a room"])
    _list((count, room) for room, count in numbers)
    print("\nFor information")
    _show(sum(written.values()), "lines of a stitch")
    _list((count, room) for room, count in written.items())


def _show(figure: int, name: str, limit: int | None = None) -> None:
    print(f"{figure:8,}  {name}" + ("" if limit is None else f" (limit {limit:,})"))


def _list(rows: Any, most: int = 10) -> None:
    for count, name in list(rows)[:most]:
        print(f"{'':10}{count:6,}  {name}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--trace"]:
        trace(Path(sys.argv[2]), sys.argv[3:])
    else:
        main()
