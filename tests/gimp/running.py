"""A GIMP that is running, and the tests' line to it; inside_gimp.py is the other end."""

import contextlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from processes import descendants

HERE = Path(__file__).parent
CHECKOUT = HERE.parent.parent
#: How long GIMP may take to start, with other things to do, or to answer, s: what hangs is asked once.
PATIENCE = 300


def find_gimp(kind="gimp-console"):
    """The newest GIMP 3 on PATH, None without one."""
    folders = [
        Path(folder) for folder in os.environ.get("PATH", "").split(os.pathsep) if Path(folder).is_dir()
    ]
    names = {
        entry.name
        for folder in folders
        for entry in folder.glob(f"{kind}-3*")
        if re.fullmatch(rf"{kind}-3(\.\d+)?", entry.name)
    }
    found = sorted(names, key=lambda name: [int(number) for number in re.findall(r"\d+", name)])
    return shutil.which(found[-1]) if found else None


def needs_gimp():
    """Skip the module that calls this where there is no GIMP 3; fail it where TOPOSEAM_GIMP_REQUIRED says
    that there must be one.
    """
    if find_gimp() is None:
        text = "no GIMP 3 on this machine; `make test-gimp` provides one and runs these tests in it"
        if os.environ.get("TOPOSEAM_GIMP_REQUIRED"):
            pytest.fail(text)
        pytest.skip(text, allow_module_level=True)


class Gimp:
    """The other end of inside_gimp.py."""

    def __init__(self, folder, environment=None, command=None, plug_ins=CHECKOUT / "plugin_gimp"):
        self.folder = folder
        self.profile = folder / "profile"
        self.profile.mkdir()
        # As after the first start: no welcome, no tips in the way.
        version = subprocess.run(
            [find_gimp(), "--version"], capture_output=True, text=True, check=True
        ).stdout.split()[-1]
        settings = f'(config-version "{version}")\n(show-welcome-dialog no)\n(check-updates no)\n'
        (self.profile / "gimprc").write_text(
            f'{settings}(plug-in-path "{plug_ins}:${{gimp_plug_in_dir}}/plug-ins")\n'
        )
        self.log = folder / "gimp.log"
        address = str(folder / "socket")
        own = str(Path(sys.executable).parent)  # GIMP must not take our Python for its plug-ins
        path = os.pathsep.join(folder for folder in os.environ["PATH"].split(os.pathsep) if folder != own)
        self.environment = {
            **os.environ,
            "PATH": path,
            "GIMP3_DIRECTORY": str(self.profile),
            "TOPOSEAM_TEST_SOCKET": address,
            "TOPOSEAM_PYTHON": str(folder / "engine"),
            "TMPDIR": str(folder / "tmp"),
            **(environment or {}),
        }
        (folder / "tmp").mkdir()
        self.engine = folder / "engine"
        self.set_engine(f'exec "{sys.executable}" "$@"')
        code = (
            f"exec(compile(open({str(HERE / 'inside_gimp.py')!r}).read(), 'inside_gimp.py', 'exec'), "
            "globals())"
        )
        command = command or [find_gimp(), "-nidfs"]
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [*command, "--batch-interpreter=python-fu-eval", "-b", code, "--quit"],
                env=self.environment,
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
            )
        self.socket = socket.socket(socket.AF_UNIX)
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                self.socket.connect(address)
                break
            except OSError:
                if self.process.poll() is not None or time.monotonic() > deadline:
                    raise RuntimeError(
                        f"GIMP did not start: {self.log.read_text(errors='replace')[-3000:]}"
                    ) from None
                time.sleep(0.1)
        self.socket.settimeout(PATIENCE)
        self.lines = self.socket.makefile("rw", encoding="utf-8")

    def set_engine(self, script):
        """Let a shell script be the Python that the plug-in starts its engine with."""
        self.engine.write_text(f"#!/bin/sh\n{script}\n")
        self.engine.chmod(0o755)

    def __getattr__(self, name):
        def call(**values):
            try:
                self.lines.write(json.dumps([name, values]) + "\n")
                self.lines.flush()
                line = self.lines.readline()
            except ConnectionError:
                line = ""
            if not line:
                raise RuntimeError(
                    f"GIMP ended ({self.process.wait(30)}): {self.log.read_text(errors='replace')[-3000:]}"
                )
            answer = json.loads(line)
            if "error" in answer:
                raise RuntimeError(answer["error"])
            return answer["answer"]

        return call

    def child(self, *words):
        """The id of a process that this GIMP has started, itself or through others, and whose command line
        has all these words; None if there is none.
        """
        for process in descendants(self.process.pid):
            if all(word.encode() in process.command for word in words):
                return process.number
        return None

    def stitch(self, loaded, options=None, **more):
        return self.run(
            procedure="plug-in-toposeam-stitch",
            image=loaded["image"],
            layers=loaded["layers"],
            options=options,
            **more,
        )

    def pixels(self, drawable, format_name):
        """(H, W, C) array of a drawable, and its offset."""
        file = self.folder / "pixels.raw"
        width, height, x, y = self.save_pixels(drawable=drawable, file=str(file), format_name=format_name)
        return _array(file, height, width, format_name), (x, y)

    def projection(self, image, format_name):
        file = self.folder / "projection.raw"
        width, height = self.save_projection(image=image, file=str(file), format_name=format_name)
        return _array(file, height, width, format_name)

    def complaints(self):
        """What our plug-in's libraries have complained of; but for what GTK misses of a desktop that speaks
        to the blind, and but for a plug-in's goodbye: GIMP 3 closes the pipe as soon as it has the result,
        and libgimp complains, once, where that is before the last word of a plug-in, of GIMP's own too.
        """
        said = self.log.read_text(errors="replace")
        told, goodbyes = [], set()
        pattern = r"^(\(toposeam_gimp\S*:(\d+)\): .*(?:WARNING|CRITICAL).*)$"
        for line, number in re.findall(pattern, said, re.MULTILINE):
            if line.endswith("gimp_flush(): error: Broken pipe") and number not in goodbyes:
                goodbyes.add(number)
            elif "accessib" not in line:
                told.append(line)
        return told

    def runs(self):
        """Whether GIMP is still there."""
        return self.process.poll() is None

    def leftovers(self):
        """Request folders that are still there."""
        return list((self.folder / "tmp").glob("toposeam-request-*"))

    def close(self):
        """End GIMP."""
        try:
            self.lines.write('["quit", {}]\n')
            self.lines.flush()
            self.process.wait(timeout=30)
        except (OSError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
        with contextlib.suppress(ConnectionError):
            self.lines.close()
        self.socket.close()


def _array(file, height, width, format_name):
    dtype = {"u8": np.uint8, "u16": np.uint16, "float": np.float32}[format_name.split()[1]]
    return np.fromfile(file, dtype).reshape(height, width, -1)


class Screen:
    """An X display that nobody sees, with a window manager."""

    def __init__(self, width=1280, height=900):
        read, write = os.pipe()
        command = [
            "Xvfb",
            "-displayfd",
            str(write),
            "-screen",
            "0",
            f"{width}x{height}x24",
            "-nolisten",
            "tcp",
        ]
        self._server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as number:
            self.display = ":" + number.readline().strip()
        self.environment = {**os.environ, "DISPLAY": self.display}
        self._manager = subprocess.Popen(
            ["openbox"], env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def do(self, *arguments):
        """Run xdotool; what it prints."""
        return subprocess.run(
            ["xdotool", *map(str, arguments)],
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        ).stdout

    def window(self, name, seconds=180):
        """Wait for a visible window whose title has a text; its id."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            found = self.do("search", "--onlyvisible", "--name", name).split()
            if found:
                return found[-1]
            time.sleep(0.1)
        raise AssertionError(f"no window {name!r} within {seconds} s")

    def press(self, window, *keys):
        """Give a window the focus and type keys into it."""
        self.do("windowactivate", "--sync", window)
        if keys:
            self.do("key", "--delay", "80", *keys)

    def shoot(self, file, window="root"):
        """Photograph a window, or all of the screen."""
        subprocess.run(["import", "-window", str(window), str(file)], env=self.environment, check=True)

    def close(self):
        for process in (self._manager, self._server):
            process.terminate()
            process.wait()
