"""Mutations: whether the tests notice when a line of the code says something else. ``make check-deep`` runs
it.

A mutation changes one operator, constant, condition, bound or call of a line that the quick tests execute,
draws of which follow from a seed; then only the tests that execute the line are run, in a copy of the
checkout. What survives is printed. Mutations that change no behaviour are listed with the reason in
``mutants_equal.toml`` and do not count.

    python tests/mutants.py --count 120 --seed 1 -j 2
    python tests/mutants.py --only core/toposeam/seam --count 40
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).parents[1]
SOURCES = ("core/toposeam", "cli/toposeam_cli", "plugin_gimp/toposeam_engine")
COPIED = (
    "core",
    "cli",
    "plugin_gimp",
    "tests",
    "samples",
    "benchmarks",
    "docs",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
)
EQUAL = Path(__file__).with_name("mutants_equal.toml")
#: Tests run for one mutation at most, the quickest to name first; a line of common code is executed by
#: hundreds.
MOST_TESTS = 60
LIMIT_S = 300

_COMPARED = {
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "is": "is not",
    "is not": "is",
    "in": "not in",
    "not in": "in",
}
_OPERATORS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Is: "is",
    ast.IsNot: "is not",
    ast.In: "in",
    ast.NotIn: "not in",
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.Mod: "%",
    ast.Pow: "**",
}
_SWAPPED = {"+": "-", "-": "+", "*": "/", "/": "*", "&": "|", "|": "&", "//": "*", "%": "+", "**": "*"}
_CALLS = {
    "min": "max",
    "max": "min",
    "any": "all",
    "all": "any",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "floor": "ceil",
    "ceil": "floor",
}


@dataclass(frozen=True, slots=True)
class Mutation:
    """One changed expression."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str

    @property
    def name(self) -> str:
        return f"{self.file}:{self.line}: {self.before!r} → {self.after!r}"


def mutations_of(path: Path) -> list[Mutation]:
    """Every mutation of a file, in the order of its text."""
    text = path.read_text(encoding="utf-8")
    name = path.relative_to(ROOT).as_posix()
    begin = [0]
    for line in text.splitlines(keepends=True):
        begin.append(begin[-1] + len(line.encode()))
    raw = text.encode()
    found: list[Mutation] = []

    def place(node: ast.expr | ast.stmt) -> tuple[int, int]:
        return begin[node.lineno - 1] + node.col_offset, begin[node.end_lineno - 1] + node.end_col_offset  # type: ignore[operator]

    def add(node: ast.expr | ast.stmt, start: int, end: int, after: str) -> None:
        before = raw[start:end].decode()
        if before != after:
            found.append(Mutation(name, node.lineno, start, end, before, after))

    def between(node: ast.expr, left: ast.expr, right: ast.expr, operator: str, after: str) -> None:
        start, end = place(left)[1], place(right)[0]
        gap = raw[start:end].decode()
        if gap.count(operator) == 1 and "#" not in gap:
            at = start + len(gap[: gap.index(operator)].encode())
            add(node, at, at + len(operator), after)

    tree = ast.parse(text)
    skipped = {id(child) for node in ast.walk(tree) if _says_only(node) for child in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            operator = _OPERATORS[type(node.ops[0])]
            between(node, node.left, node.comparators[0], operator, _COMPARED[operator])
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            operator = _OPERATORS[type(node.op)]
            if not _is_text(node.left):
                between(node, node.left, node.right, operator, _SWAPPED[operator])
        elif isinstance(node, ast.BoolOp):
            operator, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            if len(node.values) == 2:
                between(node, node.values[0], node.values[1], operator, other)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.Invert | ast.USub):
            start, _ = place(node)
            add(node, start, place(node.operand)[0], "")
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, int | float)
            and not isinstance(node.value, bool)
        ):
            start, end = place(node)
            add(node, start, end, repr(node.value + 1 if isinstance(node.value, int) else node.value * 2))
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            start, end = place(node)
            add(node, start, end, repr(not node.value))
        elif isinstance(node, ast.Call):
            called = node.func
            word = (
                called.attr
                if isinstance(called, ast.Attribute)
                else called.id
                if isinstance(called, ast.Name)
                else ""
            )
            if word in _CALLS:
                _, end = place(called)
                add(node, end - len(word), end, _CALLS[word])
        elif isinstance(node, ast.If | ast.IfExp):
            start, end = place(node.test)
            add(node.test, start, end, f"not ({raw[start:end].decode()})")
        elif isinstance(node, ast.AugAssign) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        ):
            start, end = place(node)
            add(node, start, end, "pass")
    return found


def _says_only(node: ast.AST) -> bool:
    """Whether a node is about texts, types or options, not about what is computed."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.AnnAssign) and not (
        isinstance(node, ast.AnnAssign) and node.value
    ):
        return True
    if isinstance(node, ast.FunctionDef) and node.name in ("__repr__", "__str__"):
        return True
    if isinstance(node, ast.FunctionDef):
        return False
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in ("option", "argument", "command", "echo")
    ):
        return True
    return isinstance(node, ast.arg | ast.Import | ast.ImportFrom | ast.Subscript) and isinstance(
        getattr(node, "ctx", None), ast.Store
    )


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def covering_tests(cache: Path) -> dict[str, dict[int, list[str]]]:
    """Per file and line, the quick tests that execute it; measured once and kept."""
    data_file = cache / "coverage"
    if not data_file.exists():
        cache.mkdir(parents=True, exist_ok=True)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "tests",
            "-q",
            "-n",
            "2",
            "-m",
            "not slow",
            "-p",
            "no:cacheprovider",
            "--ignore=tests/gimp",
            *(f"--cov={source}" for source in SOURCES),
            "--cov-context=test",
            "--cov-report=",
        ]
        subprocess.run(command, cwd=ROOT, env={**os.environ, "COVERAGE_FILE": str(data_file)}, check=True)
    from coverage import CoverageData  # of make check-deep alone

    data = CoverageData(str(data_file))
    data.read()
    found: dict[str, dict[int, list[str]]] = {}
    for file in data.measured_files():
        lines = {
            line: sorted({context.partition("|")[0] for context in contexts} - {""})
            for line, contexts in data.contexts_by_lineno(file).items()
        }
        found[Path(file).relative_to(ROOT).as_posix()] = {
            line: tests for line, tests in lines.items() if tests
        }
    return found


def chosen(count: int, seed: int, only: str, tests: dict[str, dict[int, list[str]]]) -> list[Mutation]:
    """Some mutations of executed lines, spread over the files by their square roots, so that no room is left
    out.
    """
    rng = random.Random(seed)  # noqa: S311
    pool: dict[str, list[Mutation]] = {}
    for source in SOURCES:
        for path in sorted((ROOT / source).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if name.startswith(only):
                executed = [
                    mutation for mutation in mutations_of(path) if mutation.line in tests.get(name, {})
                ]
                if executed:
                    pool[name] = executed
    names = sorted(pool)
    weights = [len(pool[name]) ** 0.5 for name in names]
    drawn: dict[str, Mutation] = {}
    most = sum(map(len, pool.values()))
    while len(drawn) < min(count, most):
        mutation = rng.choice(pool[rng.choices(names, weights)[0]])
        drawn[mutation.name] = mutation
    return list(drawn.values())


def survives(mutation: Mutation, tests: list[str], copy: Path) -> bool:
    """Whether the tests pass in a copy of the checkout that has the mutation."""
    path = copy / mutation.file
    original = path.read_bytes()
    changed = original[: mutation.start] + mutation.after.encode() + original[mutation.end :]
    try:
        ast.parse(changed)
    except SyntaxError:
        return False
    path.write_bytes(changed)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-m",
        "not slow",
        *tests,
    ]
    paths = os.pathsep.join(str(copy / room) for room in ("core", "cli", "plugin_gimp"))
    environment = {
        **os.environ,
        "PYTHONPATH": paths,
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
    try:
        ended = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=LIMIT_S, check=False
        )
        return ended.returncode == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        path.write_bytes(original)


def main() -> int:
    """Draw, run, report; 1 when too many survive."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="paths that begin so")
    parser.add_argument("--least", type=float, default=0.9, help="share that must be noticed")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "mutants")
    parser.add_argument("-j", "--jobs", type=int, default=2)
    options = parser.parse_args()
    tests = covering_tests(options.cache)
    mutations = chosen(options.count, options.seed, options.only, tests)
    equal = {
        (entry["file"], entry["before"], entry["after"]): entry["why"]
        for entry in tomllib.loads(EQUAL.read_text()).get("equal", [])
    }
    lines = {
        name: (ROOT / name).read_text(encoding="utf-8").splitlines()
        for name in {mutation.file for mutation in mutations}
    }
    copies: SimpleQueue[Path] = SimpleQueue()
    with tempfile.TemporaryDirectory(prefix="toposeam-mutants-") as scratch:
        for number in range(options.jobs):
            copy = Path(scratch) / str(number)
            copy.mkdir()
            for name in COPIED:
                source = ROOT / name
                if source.is_dir():
                    shutil.copytree(
                        source, copy / name, ignore=shutil.ignore_patterns("__pycache__", "figures")
                    )
                else:
                    shutil.copy(source, copy / name)
            copies.put(copy)

        def run(mutation: Mutation) -> bool:
            copy = copies.get()
            try:
                names = tests[mutation.file][mutation.line]
                step = max(1, len(names) // MOST_TESTS)
                return survives(mutation, names[::step][:MOST_TESTS], copy)
            finally:
                copies.put(copy)

        survivors: dict[str, list[Mutation]] = defaultdict(list)
        counted = 0
        with ThreadPoolExecutor(options.jobs) as pool:
            for mutation, survived in zip(mutations, pool.map(run, mutations), strict=True):
                line = lines[mutation.file][mutation.line - 1].strip()
                why = equal.get((mutation.file, line, mutation.after))
                counted += why is None
                if survived and why is None:
                    survivors[mutation.file].append(mutation)
                    print(f"survived  {mutation.name}\n          {line}", flush=True)
    lost = sum(map(len, survivors.values()))
    share = 1 - lost / max(counted, 1)
    print(
        f"{counted - lost} of {counted} mutations noticed ({share:.0%}); {len(mutations) - counted} change "
        "no behaviour"
    )
    return 0 if share >= options.least else 1


if __name__ == "__main__":
    sys.exit(main())
