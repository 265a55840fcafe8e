"""Mutations: whether the tests notice when a line of the code says something else. ``make check-deep`` runs
it.

A mutation changes one operator, constant, condition, bound or call of a line that the quick tests execute,
draws of which follow from a seed; then only the tests that execute the line are run, in a copy of the
checkout. What survives is printed. Mutations that change no behaviour are listed with the reason in
``mutants_equal.toml`` and do not count. Which tests execute a line, a map says that takes several minutes to
make; without it (``--nearby``) tests are looked for by their names.

    python tests/mutants.py --count 120 --seed 1 -j 2
    python tests/mutants.py --nearby --seed 2 --count 60
    python tests/mutants.py --only core/toposeam/seam --count 40
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mutations import ROOT, SOURCES, Mutation, chosen

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
#: Tests run for one mutation at most; a line of common code is executed by hundreds.
MOST_TESTS = 60
#: Processor time after which no further test is begun for a mutation, and the time after which it hangs.
BUDGET_S, LIMIT_S = 8, 600
#: What most tests load.
PRELOADED = (
    *("numpy", "numpy.testing", "scipy.ndimage", "scipy.sparse.linalg", "scipy.sparse.csgraph", "scipy.fft"),
    *("scipy.optimize", "scipy.interpolate", "scipy.cluster.vq", "qdldl", "PIL.Image", "pyvips", "click"),
    *("skimage.measure", "skimage.filters", "skimage.metrics", "click.testing"),
)

PASSED = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)

_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+::.*?)(?: - .*)?$", re.MULTILINE)


def pieces() -> dict[str, list[str]]:
    """The quick tests in pieces that take some minutes each, by name: the rooms of core and the rest."""
    named = {
        f"{side}-{folder.name}": [folder.relative_to(ROOT).as_posix()]
        for side in ("core", "cli")
        for folder in sorted((ROOT / "tests" / side).iterdir())
        if folder.is_dir() and not folder.name.startswith("_")
    }
    named["examples"] = ["core"]
    for side in ("core", "cli"):
        files = sorted((ROOT / "tests" / side).glob("test_*.py"))
        half = len(files) // 2
        for number, part in enumerate((files[:half], files[half:])):
            named[f"{side}-{number}"] = [path.relative_to(ROOT).as_posix() for path in part]
    named["plugin"] = ["tests/gimp/test_free_half.py"]
    return named


def measure(cache: Path, until: float) -> bool:
    """Let the quick tests run under coverage, piece by piece, each once; False where time is up before."""
    cache.mkdir(parents=True, exist_ok=True)
    for name, tests in pieces().items():
        if (cache / f"{name}.failed").exists():
            continue
        if time.monotonic() > until:
            return False
        command = [sys.executable, "-m", "pytest", *tests, "-q", "-m", "not slow", "-p", "no:cacheprovider"]
        command += ["-p", "no:xdist", "-rfE", *(f"--cov={source}" for source in SOURCES)]
        command += ["--cov-context=test", "--cov-report="]
        environment = {**os.environ, "COVERAGE_FILE": str(cache / f"{name}.coverage")}
        ended = subprocess.run(
            command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=False
        )
        failed = "".join(f"{test}\n" for test in _FAILED.findall(ended.stdout))
        (cache / f"{name}.failed").write_text(failed, encoding="utf-8")
        print(f"measured: {name}", flush=True)
    return True


def covering_tests(cache: Path) -> dict[str, dict[int, list[str]]]:
    """Per file and line, the quick tests that execute it and pass, as `measure` found."""
    from coverage import CoverageData  # of make check-deep alone

    failed = {
        line for path in cache.glob("*.failed") for line in path.read_text(encoding="utf-8").splitlines()
    }
    for name in sorted(failed):
        print(f"left out, as it fails without any mutation: {name}", flush=True)
    found: dict[str, dict[int, set[str]]] = {}
    for data_file in sorted(cache.glob("*.coverage")):
        data = CoverageData(str(data_file))
        data.read()
        for file in data.measured_files():
            lines = found.setdefault(Path(file).relative_to(ROOT).as_posix(), {})
            for line, contexts in data.contexts_by_lineno(file).items():
                tests = {context.partition("|")[0] for context in contexts} - {""} - failed
                if tests:
                    lines.setdefault(line, set()).update(tests)
    return {
        file: {line: sorted(tests) for line, tests in lines.items()} for file, lines in found.items()
    }


def nearest(tests: list[str], file: str) -> list[str]:
    """At most `MOST_TESTS` of the tests: those of the file's own test file first, then those of its room,
    then some of all others.
    """
    source = Path(file)
    room = source.parent.name

    def group(test: str) -> int:
        path = Path(test.partition("::")[0])
        return 0 if path.stem == f"test_{source.stem}" else 1 if path.parent.name == room else 2

    taken: list[str] = []
    for wanted in range(3):
        near = [test for test in tests if group(test) == wanted]
        step = max(1, len(near) // max(1, MOST_TESTS - len(taken)))
        taken += near[::step][: MOST_TESTS - len(taken)]
    return taken


def nearby_tests(file: str) -> list[str]:
    """Where a file's tests are looked for without a map: its examples, its own test files, those that name
    it, its room.
    """
    source = Path(file)
    within = ROOT / "tests" / ("core" if file.startswith("core/") else "cli")
    room = within / source.parent.name
    files = sorted(room.rglob("test_*.py")) if room.is_dir() else []
    files += sorted(within.glob("test_*.py"))
    files += sorted(path for path in within.rglob("test_*.py") if path not in files)
    if file.startswith("plugin_gimp/"):
        files = [*sorted(within.glob("test_engine*.py")), ROOT / "tests/gimp/test_free_half.py"]
    named = re.compile(rf"[.\"]{re.escape(source.stem)}( import|\")")

    def group(path: Path) -> int:
        if path.stem.startswith(f"test_{source.stem}"):
            return 0
        if named.search(path.read_text(encoding="utf-8")):
            return 1
        return 2 if path.parent == room or not room.is_dir() else 3

    groups = {path: group(path) for path in files}
    ordered = sorted((path for path in files if groups[path] < 3), key=groups.__getitem__)
    examples = [file] if file.startswith("core/") else []
    return [*examples, *(path.relative_to(ROOT).as_posix() for path in ordered)]


class _Budget:
    """Ends a run of tests between two of them, once they took all the time they have."""

    def __init__(self) -> None:
        self.spent = False

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self.spent = self.spent or time.process_time() > BUDGET_S

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
        words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow"]
        files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
        for file in files:  # one after the other: what is not needed is not even collected
            budget = _Budget()
            its = [test for test in tests if test.partition("::")[0] == file]
            code = int(pytest.main([*words, *its], plugins=[budget]))
            if budget.spent and code == pytest.ExitCode.INTERRUPTED:
                code = 0
            if budget.spent or code not in PASSED:
                break
    finally:
        os._exit(code)


def run_all(
    mutations: list[Mutation], tests_of: Callable[[Mutation], list[str]], jobs: int
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
        while waiting or running:
            while waiting and copies:
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


def main() -> int:
    """Draw, run, report; 1 when too many survive."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="paths that begin so")
    parser.add_argument("--nearby", action="store_true", help="look for tests nearby, without the map")
    parser.add_argument("--again", type=Path, help="run only what a former run printed as survived")
    parser.add_argument("--least", type=float, default=0.9, help="share that must be noticed")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "mutants")
    parser.add_argument("-j", "--jobs", type=int, default=2)
    options = parser.parse_args()
    tests = None if options.nearby else covering_tests(options.cache, options.jobs)
    mutations = chosen(options.count, options.seed, options.only, tests)
    if options.again is not None:
        before = options.again.read_text(encoding="utf-8")
        mutations = [mutation for mutation in mutations if f"survived  {mutation.name}\n" in before]
    equal = {
        (entry["file"], entry["before"], entry["after"]): entry["why"]
        for entry in tomllib.loads(EQUAL.read_text(encoding="utf-8")).get("equal", [])
    }
    lines = {
        name: (ROOT / name).read_text(encoding="utf-8").splitlines()
        for name in {mutation.file for mutation in mutations}
    }

    def tests_of(mutation: Mutation) -> list[str]:
        if tests is None:
            return nearby_tests(mutation.file)
        return nearest(tests[mutation.file][mutation.line], mutation.file)

    counted = lost = 0
    for trial, survived in run_all(mutations, tests_of, options.jobs):
        mutation = trial.mutation
        line = lines[mutation.file][mutation.line - 1].strip()
        why = equal.get((mutation.file, line, mutation.after))
        counted += why is None
        lost += survived and why is None
        if why is None:
            said = line if survived else trial.noticed_by()
            print(f"{'survived' if survived else 'noticed '}  {mutation.name}\n          {said}", flush=True)
    share = 1 - lost / max(counted, 1)
    print(
        f"{counted - lost} of {counted} mutations noticed ({share:.0%}); {len(mutations) - counted} change "
        "no behaviour"
    )
    return 0 if share >= options.least else 1


if __name__ == "__main__":
    sys.exit(main())
