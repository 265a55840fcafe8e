"""What made a table of numbers: the date, the commit, and the versions of what it compares."""

import importlib.metadata
import platform
import subprocess
from datetime import date
from pathlib import Path

import toposeam as ts

PACKAGES = ("numpy", "scipy", "scikit-image", "PyMaxflow", "opencv-python-headless")


def stamp() -> str:
    """A line to stand above the numbers, and in the documents that show them."""
    versions = [f"Python {platform.python_version()}"]
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    made = f"toposeam {ts.__version__} at commit {commit()}"
    return f"{date.today()}: {made}; {', '.join(versions)}; {platform.machine()}\n"


def commit(folder: Path = Path(__file__).parent) -> str:
    """The commit, with a plus sign if the checkout has changes beyond it."""
    command = ["git", "-C", str(folder), "describe", "--always", "--abbrev=8", "--dirty=+"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
