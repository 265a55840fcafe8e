"""Builds the kernels of core (``core/toposeam/_kernels``) beside their sources, where there is a C compiler.

Hatchling calls the hook for wheels and for editable installations, ``make kernels`` runs the file. Without a
compiler, or with ``TOPOSEAM_KERNELS=0``, nothing is built, nothing is said, and the wheel fits every system.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zlib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDER = Path(__file__).parent / "core/toposeam/_kernels"
#: Doubles are neither fused nor reordered, so that every system computes the same.
FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-fPIC", "-shared")
MICROSOFT = ("/nologo", "/O2", "/fp:precise", "/LD")
SECONDS = 300


def build() -> Path | None:
    """Compile the library and return its path; None where that is not wanted or not possible."""
    sources = sorted(FOLDER.glob("*.[ch]"))
    name = f"kernels-{zlib.crc32(b''.join(file.read_bytes() for file in sources)):08x}"
    target = FOLDER / f"{name}{'.dll' if os.name == 'nt' else '.so'}"
    compiler = _compiler()
    if os.environ.get("TOPOSEAM_KERNELS") == "0" or not compiler:
        return None
    files = [str(file) for file in sources if file.suffix == ".c"]
    try:
        with tempfile.TemporaryDirectory(dir=FOLDER, prefix="kernels-") as folder:
            made = Path(folder, target.name)
            if Path(compiler[0]).stem.lower() == "cl":
                words = [*compiler, *MICROSOFT, *files, f"/Fe:{made}"]
            else:
                words = [*compiler, *FLAGS, *_architectures(), *files, "-o", str(made)]
            subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=SECONDS)  # noqa: S603
            made.replace(target)
        for old in FOLDER.glob("kernels-*.*"):
            if old != target:
                old.unlink()
    except (OSError, subprocess.SubprocessError):
        return None
    return target


def _compiler() -> list[str]:
    """Find a C compiler, and words that it is called with; nothing where there is none."""
    named = [os.environ.get("CC", ""), sysconfig.get_config_var("CC") or ""]
    for words in (*map(shlex.split, named), *([name] for name in ("cc", "clang", "gcc", "cl"))):
        if words and (found := shutil.which(words[0])):
            return [found, *words[1:]]
    return []


def _architectures() -> list[str]:
    """Return macOS's words for processors: those of ARCHFLAGS, or both of a universal Python."""
    if sys.platform != "darwin":
        return []
    universal = "-arch x86_64 -arch arm64" if sysconfig.get_platform().endswith("universal2") else ""
    return shlex.split(os.environ.get("ARCHFLAGS") or universal)


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Builds the library before a wheel is packed, which then fits this system only."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and say what the wheel fits."""
        library = build()
        if library is not None:
            system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{system}"
            build_data["artifacts"].append(f"/core/toposeam/_kernels/{library.name}")


if __name__ == "__main__":
    print(build() or "no kernels: no C compiler was found, it failed, or TOPOSEAM_KERNELS is 0")
