"""GI-free: a virtual environment for the engine, made on first use from a wheel or a checkout."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from toposeam_gimp import __version__
from toposeam_gimp.engine.launching import ISOLATED, WITH_USERS_PACKAGES, started
from toposeam_gimp.engine.process import EngineError, settings_file
from toposeam_gimp.texts import _

_LEAST = (3, 11)
_ARCHIVES = (".whl", ".zip", ".gz")
#: What pip says of each file that it fetches, and its size.
_FETCHED = re.compile(r"(?:Downloading|Using cached) .*\((\d+(?:\.\d+)?) (kB|MB|GB)\)")
_ASK = (
    "import importlib.util, toposeam, toposeam_engine;"
    "print(toposeam.__version__, importlib.util.find_spec('maxflow') is not None)"
)


class StoppedError(Exception):
    """The user has stopped the installation."""


def bundled() -> Path | None:
    """Return the wheel that came with the plug-in; None without one."""
    return next(iter(sorted((Path(__file__).parents[1] / "wheel").glob("toposeam-*.whl"))), None)


def source_of(chosen: Path) -> Path:
    """Return pip's argument for a chosen file: a wheel, an archive, or a checkout's ``pyproject.toml``.

    Raises
    ------
    EngineError
        When the file is none of these.
    """
    if chosen.name == "pyproject.toml" and (chosen.parent / "core" / "toposeam").is_dir():
        return chosen.parent
    if chosen.is_file() and chosen.suffix in _ARCHIVES and chosen.name.lower().startswith("toposeam"):
        return chosen
    text = _(
        "{file} is not TopoSeam; choose its wheel (toposeam-….whl), or the file pyproject.toml in its "
        "source folder."
    )
    raise EngineError(text.format(file=chosen.name))


class SettingUp:
    """The installation of an environment; it can be stopped from another thread."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    def stop(self) -> None:
        """Stop the installation."""
        self._stopped = True
        if self._process is not None and self._process.poll() is None:
            self._process.kill()

    def make(
        self, folder: Path, source: Path, told: Callable[[int, float], object] = lambda _step, _size: None
    ) -> None:
        """Make an environment in a folder, and record its Python as the engine's.

        Parameters
        ----------
        folder, source : Path
        told : callable
            Called with the step that begins or goes on, 0 for the environment, 1 for what is fetched, 2 for
            what is installed, and the megabytes fetched so far.

        Raises
        ------
        EngineError
            When it cannot be made; the text gives the reason, and nothing is left.
        StoppedError
        """
        if folder.exists() and not (folder / "pyvenv.cfg").is_file() and any(folder.iterdir()):
            text = _("{folder} holds something else; move it elsewhere, and try again.")
            raise EngineError(text.format(folder=folder))
        folder = folder.absolute()
        python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
        try:
            told(0, 0.0)
            self._run([*self._python(), *ISOLATED, "-m", "venv", "--clear", str(folder)])
            pip = [str(python), "-u", *ISOLATED, "-m", "pip", "install", "--disable-pip-version-check"]
            step, fetched = 1, 0.0

            def heard(line: str) -> None:
                nonlocal step, fetched
                if found := _FETCHED.search(line):
                    fetched += float(found[1]) / {"kB": 1000, "MB": 1, "GB": 0.001}[found[2]]
                step = 2 if line.startswith("Installing collected") else step
                told(step, fetched)

            told(step, fetched)
            self._run([*pip, f"{source.absolute()}[cli]"], heard)
            version, maxflow = self._run([str(python), *WITH_USERS_PACKAGES, "-c", _ASK]).split()[-2:]
            if version != __version__:
                text = _("{source} is TopoSeam {other}, and the plug-in is of {own}; take the same release.")
                raise EngineError(text.format(source=source.name, other=version, own=__version__))
            without = [] if maxflow == "True" else ["graph-cut"]
            record = json.dumps({"python": str(python), "without": without})
            settings_file().write_text(record, encoding="utf-8")
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise EngineError(f"{error.strerror or error}: {error.filename or ''}") from error
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise

    def _python(self) -> list[str]:
        """Find a Python on this machine that can make environments."""
        ask = f"import sys, venv, ensurepip; sys.exit(sys.version_info < {_LEAST})"
        for command in _pythons():
            try:
                self._run([*command, *ISOLATED, "-c", ask])
            except (OSError, EngineError):
                continue
            return command
        raise EngineError(
            _(
                "No Python {least} or later was found that can make environments; install it from "
                "python.org, on Debian and Ubuntu the package python3-venv, and try again."
            ).format(least=".".join(map(str, _LEAST)))
        )

    def _run(self, command: Sequence[str], heard: Callable[[str], object] = lambda _line: None) -> str:
        """Run a program to its end; return its output, each line of which is passed on."""
        said = ""
        with started(command, stderr=subprocess.STDOUT) as self._process:
            if self._stopped:
                self._process.kill()
            if self._process.stdout is not None:
                with self._process.stdout:
                    for line in self._process.stdout:
                        said += line.decode("utf-8", errors="replace")
                        heard(line.decode("utf-8", errors="replace"))
            self._process.wait()
        if self._stopped:
            raise StoppedError
        if self._process.returncode != 0:
            last = (said.strip().splitlines() or [str(self._process.returncode)])[-1]
            raise EngineError(_("The environment could not be made ({reason}).").format(reason=last[:300]))
        return said


def _pythons() -> Iterator[list[str]]:
    """Yield names that Python may have, the most common first."""
    if sys.platform == "win32":
        yield ["py", "-3"]
    for minor in (13, 12, 11, 14):
        yield [f"python3.{minor}"]
    yield ["python3"]
    yield ["python"]
