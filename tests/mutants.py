"""Mutations: whether the tests notice when a line of the code says something else. ``make check-deep`` runs
it.

A mutation changes one operator, constant, condition, bound or call of a line that the quick tests execute,
draws of which follow from a seed; then only the tests that execute the line are run, in a copy of the
checkout, nearest first, until one fails or their time is spent. What survives is printed. Mutations that
change no behaviour do not count: those that compile to the same code, and those listed with the reason in
``mutants_equal.toml``. Which tests execute a line, a map says that takes several minutes to make; without it
(``--nearby``) tests are looked for by their names.

Map and results are kept in ``build/mutants`` for as long as the code does not change: a run that is cut
short, or ends after ``--minutes``, goes on where it stopped. What survived is tried again with ``--again``,
when tests have been added.

    python tests/mutants.py --count 120 --seed 1 -j 2
    python tests/mutants.py --nearby --seed 2 --count 60
    python tests/mutants.py --only core/toposeam/seam --count 40
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import importlib
import itertools
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from covering import covering_tests, long_tests, measure, nearby_tests, nearest
from mutations import ROOT, SOURCES, Mutation, at_import, chosen, same_code

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
#: Processor time after which no further test is begun for a mutation, and the time after which it hangs.
BUDGET_S, LIMIT_S = 30, 600
#: What most tests load.
PRELOADED = (
    *("numpy", "numpy.testing", "scipy.ndimage", "scipy.sparse.linalg", "scipy.sparse.csgraph", "scipy.fft"),
    *("scipy.optimize", "scipy.interpolate", "scipy.cluster.vq", "qdldl", "PIL.Image", "pyvips", "click"),
    *("skimage.measure", "skimage.filters", "skimage.metrics", "click.testing"),
)

PASSED = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)


class _Budget:
    """Ends a run of tests between two of them, once they took all the time they have."""

    def __init__(self, begun: float) -> None:
        self.begun, self.spent = begun, False

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self.spent = self.spent or time.process_time() - self.begun > BUDGET_S

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        if self.spent:
            item.session.shouldstop = "the budget is spent"


class Trial:
    """The tests in a copy of the checkout that has a mutation, in a process of its own."""

    def __init__(self, mutation: Mutation, tests: list[str], copy: Path) -> None:
        self.mutation, self.copy, self.tests = mutation, copy, tests
        self._path = copy / mutation.file
        self._original = self._path.read_bytes()
        changed = self._original[: mutation.start] + mutation.after.encode() + self._original[mutation.end :]
        self._path.write_bytes(changed)
        self._until = time.monotonic() + LIMIT_S
        self._process = os.fork()
        if not self._process:
            _run_tests(tests, copy)

    def survived(self) -> bool | None:
        """Whether no test noticed; None while they run."""
        ended, status = os.waitpid(self._process, os.WNOHANG)
        if not ended:
            if time.monotonic() < self._until:
                return None
            os.killpg(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)
        self._path.write_bytes(self._original)
        return bool(ended) and os.WIFEXITED(status) and os.WEXITSTATUS(status) in PASSED

    def noticed_by(self) -> str:
        """The test that failed, or how else the tests ended; of the last trial in that copy."""
        said = (self.copy / "log").read_text(encoding="utf-8", errors="replace").splitlines()
        failed = [line for line in said if line.startswith(("FAILED", "ERROR"))]
        return failed[0][:160] if failed else "not one: they hung, or died"


def _run_tests(tests: list[str], copy: Path) -> None:
    """In a forked process, which ends here."""
    code = 1
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (5 * BUDGET_S, 5 * BUDGET_S))
        log = os.open(copy / "log", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        for stream in range(3):
            os.dup2(log, stream)
        rooms = [str(copy / room) for room in ("core", "cli", "plugin_gimp")]
        sys.path[:] = [*rooms, *(place for place in sys.path if not place.startswith(str(ROOT / "tests")))]
        os.environ["PYTHONPATH"] = os.pathsep.join(rooms)
        os.chdir(copy)
        code = _first_failure(tests)
    finally:
        os._exit(code)


def _first_failure(tests: list[str]) -> int:
    """Run tests until one fails or the budget is spent; pytest's exit status."""
    code = int(pytest.ExitCode.OK)
    begun = time.process_time()
    words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow"]
    for _, its in itertools.groupby(tests, lambda test: test.partition("::")[0]):
        # One file after the other: what is not needed is not even collected.
        budget = _Budget(begun)
        code = int(pytest.main([*words, *its], plugins=[budget]))
        if budget.spent and code == pytest.ExitCode.INTERRUPTED:
            code = 0
        if budget.spent or code not in PASSED:
            break
    return code


def run_all(
    mutations: list[Mutation], tests_of: Callable[[Mutation], list[str]], jobs: int, until: float
) -> Iterator[tuple[Trial, bool]]:
    """Every mutation's trial, and whether it survived, as soon as that is known."""
    for name in PRELOADED:  # what all tests load is loaded once
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    os.environ |= {"PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    waiting = mutations[::-1]
    running: list[Trial] = []
    with tempfile.TemporaryDirectory(prefix="toposeam-mutants-") as scratch:
        copies = [Path(scratch) / str(number) for number in range(jobs)]
        for copy in copies:
            copy_checkout(copy)
        unchanged = Trial(
            dataclasses.replace(waiting[-1], start=0, end=0, after=""), tests_of(waiting[-1]), copies[0]
        )
        while (passed := unchanged.survived()) is None:
            time.sleep(0.05)
        if not passed:
            raise SystemExit(f"tests fail without any mutation: {unchanged.noticed_by()}")
        while running or (waiting and time.monotonic() < until):
            while waiting and copies and time.monotonic() < until:
                mutation = waiting.pop()
                running.append(Trial(mutation, tests_of(mutation), copies.pop()))
            time.sleep(0.05)
            for trial in list(running):
                survived = trial.survived()
                if survived is not None:
                    running.remove(trial)
                    copies.append(trial.copy)
                    yield trial, survived


def copy_checkout(copy: Path) -> None:
    """What tests need, in another folder."""
    copy.mkdir()
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            left_out = ("__pycache__", "figures") if name == "docs" else ("__pycache__",)
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns(*left_out))
        else:
            shutil.copy(source, copy / name)


def code_digest() -> str:
    """Of all code that can be mutated."""
    told = hashlib.sha256()
    for source in SOURCES:
        for path in sorted((ROOT / source).rglob("*.py")):
            told.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return told.hexdigest()[:12]


class Results:
    """What is known of each mutation, in a file that grows by a line for each."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self.known: dict[str, tuple[bool, str]] = {}
        if file.exists():
            for line in file.read_text(encoding="utf-8").splitlines():
                name, survived, said = json.loads(line)
                self.known[name] = survived, said

    def add(self, name: str, survived: bool, said: str) -> None:
        """Keep one."""
        self.known[name] = survived, said
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps([name, survived, said]) + "\n")


def main() -> int:
    """Draw, run, report; 1 when too many survive, 3 where the time was up before the end."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="paths that begin so")
    parser.add_argument("--nearby", action="store_true", help="look for tests nearby, without the map")
    parser.add_argument("--again", action="store_true", help="try again what survived")
    parser.add_argument("--minutes", type=float, default=600, help="begin nothing new after so many")
    parser.add_argument("--least", type=float, default=0.9, help="share that must be noticed")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "mutants")
    parser.add_argument("-j", "--jobs", type=int, default=2)
    options = parser.parse_args()
    until = time.monotonic() + 60 * options.minutes
    cache = options.cache / code_digest()
    tests, long = None, set[str]()
    if not options.nearby:
        if not measure(cache, until, options.jobs):
            return 3
        tests, long = covering_tests(cache), long_tests(cache)
    mutations = chosen(options.count, options.seed, options.only, tests)
    equal = {
        (entry["file"], entry["before"], entry["after"])
        for entry in tomllib.loads(EQUAL.read_text(encoding="utf-8")).get("equal", [])
    }
    lines = {
        name: (ROOT / name).read_text(encoding="utf-8").splitlines() for name in {m.file for m in mutations}
    }

    def line_of(mutation: Mutation) -> str:
        return lines[mutation.file][mutation.line - 1].strip()

    counted = [
        mutation
        for mutation in mutations
        if (mutation.file, line_of(mutation), mutation.after) not in equal and not same_code(mutation)
    ]
    results = Results(cache / "results.jsonl")

    def tests_of(mutation: Mutation) -> list[str]:
        if tests is None:
            return nearby_tests(mutation.file)
        lines = tests[mutation.file]
        executing = set(lines[mutation.line])
        if at_import(mutation.file, mutation.line):  # a map has those lines under the test that was first
            executing.update(*lines.values())
        return nearest(sorted(executing), mutation.file, long)

    waiting = [
        mutation
        for mutation in counted
        if mutation.name not in results.known or (options.again and results.known[mutation.name][0])
    ]
    if waiting:
        for trial, survived in run_all(waiting, tests_of, options.jobs, until):
            mutation = trial.mutation
            results.add(mutation.name, survived, line_of(mutation) if survived else trial.noticed_by())
            print(f"{'survived' if survived else 'noticed '}  {mutation.name}", flush=True)
            print(f"          {results.known[mutation.name][1]}", flush=True)
    known = [results.known[mutation.name][0] for mutation in counted if mutation.name in results.known]
    share = 1 - sum(known) / max(len(known), 1)
    for mutation in counted:
        if results.known.get(mutation.name, (False, ""))[0]:
            print(f"left: {mutation.name}   {line_of(mutation)}")
    print(
        f"{len(known) - sum(known)} of {len(known)} mutations noticed ({share:.0%}); "
        f"{len(mutations) - len(counted)} change no behaviour"
    )
    if len(known) < len(counted):
        print(f"{len(counted) - len(known)} are still to be tried; the same command goes on")
        return 3
    return 0 if share >= options.least else 1


if __name__ == "__main__":
    sys.exit(main())
