"""Make a release ready: ``python tools/release.py`` (``make release``). Nothing is uploaded.

Checks that everything is committed and that the version is the same wherever it is said, newer than the last
dated one and not released yet, writes today's date into CHANGELOG.md, builds wheel and source archive into
``dist/`` and checks both with twine.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_HEADING = re.compile(
    r"^## (?P<version>\d+\.\d+\.\d+) \((?P<when>unreleased|\d{4}-\d\d-\d\d)\)$", re.MULTILINE
)


def stated_versions(root: Path = ROOT) -> dict[str, str]:
    """The version, by the file that states it."""
    patterns = {
        "core/toposeam/__init__.py": r'^__version__ = "([^"]+)"$',
        "plugin_gimp/toposeam_gimp/__init__.py": r'^__version__ = "([^"]+)"$',
        "CITATION.cff": r"^version: (\S+)$",
        "CHANGELOG.md": r"^## (\S+) \(",
    }
    found = {}
    for name, pattern in patterns.items():
        match = re.search(pattern, (root / name).read_text(encoding="utf-8"), re.MULTILINE)
        found[name] = match[1] if match else "none"
    return found


def dated(changelog: str, today: date) -> str:
    """The change log with today's date at its newest version.

    Raises
    ------
    ValueError
        If the newest version is dated already, or is not newer than the one before.
    """
    headings = list(_HEADING.finditer(changelog))
    if not headings or headings[0]["when"] != "unreleased":
        raise ValueError("CHANGELOG.md begins with no unreleased version; write what changed first")
    versions = [tuple(map(int, found["version"].split("."))) for found in headings]
    if len(versions) > 1 and versions[0] <= versions[1]:
        raise ValueError(f"{headings[0]['version']} is not newer than {headings[1]['version']}; raise it")
    start, end = headings[0].span("when")
    return f"{changelog[:start]}{today:%Y-%m-%d}{changelog[end:]}"


def unreleasable(version: str, root: Path = ROOT) -> str | None:
    """Why what lies in `root` must not be released, if so: all of it goes into the archives."""
    for words, wrong in (
        (
            ("status", "--porcelain"),
            "not everything is committed; commit it, or put it aside",
        ),
        (("tag", "--list", f"v{version}"), f"v{version} is released already; raise the version"),
    ):
        try:
            told = subprocess.check_output(  # noqa: S603 - our own words
                ["git", "-C", str(root), *words],  # noqa: S607
                stderr=subprocess.DEVNULL,
            )
        except (OSError, subprocess.CalledProcessError):
            return "this is no git checkout; release from a clone"
        if told:
            return wrong
    return None


def main() -> int:
    """Release, or say in one sentence why not."""
    stated = stated_versions(ROOT)
    changelog = ROOT / "CHANGELOG.md"
    before = changelog.read_text(encoding="utf-8")
    try:
        if len(set(stated.values())) > 1:
            raise ValueError(f"the version differs: {stated}; say the same everywhere")
        after = dated(before, date.today())
        wrong = unreleasable(stated["CHANGELOG.md"], ROOT)
        if wrong:
            raise ValueError(wrong)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    dist = ROOT / "dist"
    shutil.rmtree(dist, ignore_errors=True)
    changelog.write_text(after, encoding="utf-8")
    try:
        _run("-m", "build", "--outdir", str(dist), str(ROOT))
        _run("-m", "twine", "check", "--strict", *sorted(map(str, dist.iterdir())))
    except (subprocess.CalledProcessError, KeyboardInterrupt) as error:
        changelog.write_text(before, encoding="utf-8")
        print(f"error: {error or 'interrupted'}; CHANGELOG.md is as it was", file=sys.stderr)
        return 1
    version = stated["CHANGELOG.md"]
    print(
        *(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1e6:.1f} MB" for path in sorted(dist.iterdir())),
        f"Now look into both, then: git commit -am 'Version {version}' && git tag v{version}",
        "and, when that is public: twine upload dist/*",
        sep="\n",
    )
    return 0


def _run(*arguments: str) -> None:
    alone = {**os.environ, "TOPOSEAM_KERNELS": "0"}  # a wheel for every system; cibuildwheel makes the others
    subprocess.run([sys.executable, *arguments], check=True, env=alone)  # noqa: S603 - our own words


if __name__ == "__main__":
    sys.exit(main())
