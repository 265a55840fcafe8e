"""Which tests are run for a mutation: those that execute its line, by a map, or else those nearby."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from mutations import ROOT, SOURCES

#: Tests run for one mutation at most; a line of common code is executed by hundreds.
MOST_TESTS = 250

#: From so many seconds on, under coverage, a test is tried after all others.
LONG_S = 1.0

_TOOK = re.compile(r"([0-9.]+)s call +(.*)$")
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+::.*?)(?: - .*)?$", re.MULTILINE)


def _free() -> list[str]:
    """The plug-in's tests that need no GIMP."""
    return sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "tests/gimp").glob("test_free_*.py"))


def pieces() -> dict[str, list[str]]:
    """The tests in pieces that take a few minutes at most, by name: up to six files of a folder."""
    named = {"examples": ["core"], "plugin": _free()}
    for side in ("core", "cli"):
        top = ROOT / "tests" / side
        for folder in (top, *sorted(path for path in top.rglob("*") if path.is_dir())):
            files = sorted(path.relative_to(ROOT).as_posix() for path in folder.glob("test_*.py"))
            name = "-".join(folder.relative_to(top).parts) or side
            for first in range(0, len(files), 6):
                named[f"{side}-{name}-{first // 6}"] = files[first : first + 6]
    return named


def measure(cache: Path, until: float, jobs: int = 1) -> bool:
    """Let the tests that are not slow run under coverage, `jobs` pieces at a time, each once for as long as
    its files stay as they are; False where time is up before.
    """
    cache.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(jobs) as pool:
        return all(list(pool.map(lambda piece: _measure_piece(cache, until, *piece), pieces().items())))


def _measure_piece(cache: Path, until: float, name: str, tests: list[str]) -> bool:
    piece = cache / f"{name}-{_digest(tests)}"
    if piece.with_suffix(".failed").exists():
        return True
    for old in cache.glob(f"{name}-????????.*"):
        old.unlink()
    if time.monotonic() > until:
        return False
    command = [sys.executable, "-m", "pytest", *tests, "-q", "-m", "not slow", "-p", "no:cacheprovider"]
    command += ["-p", "no:xdist", "-rfE", "--durations=0", "--durations-min=0.1"]
    command += [*(f"--cov={source}" for source in SOURCES), "--cov-context=test", "--cov-report="]
    environment = {**os.environ, "COVERAGE_FILE": str(piece.with_suffix(".coverage"))}
    ended = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    piece.with_suffix(".log").write_text(ended.stdout, encoding="utf-8")
    failed = "".join(f"{test}\n" for test in _FAILED.findall(ended.stdout))
    piece.with_suffix(".failed").write_text(failed, encoding="utf-8")
    print(f"measured: {name}", flush=True)
    return True


def _digest(tests: list[str]) -> str:
    told = hashlib.sha256()
    for name in tests:
        told.update(name.encode() + ((ROOT / name).read_bytes() if name.endswith(".py") else b""))
    return told.hexdigest()[:8]


def covering_tests(cache: Path) -> dict[str, dict[int, list[str]]]:
    """Per file and line, the tests that execute it and pass, as `measure` found."""
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
    return {file: {line: sorted(tests) for line, tests in lines.items()} for file, lines in found.items()}


def long_tests(cache: Path) -> set[str]:
    """The tests that took long when the map was made."""
    return {
        found[2]
        for path in cache.glob("*.log")
        for line in path.read_text(encoding="utf-8").splitlines()
        if (found := _TOOK.match(line)) and float(found[1]) >= LONG_S
    }


def nearest(tests: list[str], file: str, long: set[str]) -> list[str]:
    """At most `MOST_TESTS` of the tests: those of the file's own test file first, then those of its room,
    then some of all others; of each the long ones last.
    """
    source = Path(file)
    room = source.parent.name

    def group(test: str) -> int:
        path = Path(test.partition("::")[0])
        near = 0 if path.stem.startswith(f"test_{source.stem}") else 1 if path.parent.name == room else 2
        return 2 * near + (test in long)

    taken: list[str] = []
    for wanted in range(6):
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
    room = within.joinpath(*source.parent.parts[2:])
    if not room.is_dir():
        room = within / source.parent.name
    files = sorted(room.rglob("test_*.py")) if room.is_dir() else []
    files += sorted(within.glob("test_*.py"))
    files += sorted(path for path in within.rglob("test_*.py") if path not in files)
    if file.startswith("plugin_gimp/"):
        files = [*sorted(within.glob("test_engine*.py")), *(ROOT / file for file in _free())]
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
