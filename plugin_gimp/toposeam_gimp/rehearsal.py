"""GI-free: one preview after another from engines that are warm; what is no longer wanted is ended."""

from __future__ import annotations

import shutil
import subprocess
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from toposeam_gimp import engine
from toposeam_gimp.folder import FolderError, RequestFolder

#: Width, height, channels and 8-bit pixels of a preview.
Picture = tuple[int, int, int, bytes]


class Rehearsal:
    """Previews in the background, the newest request only.

    Parameters
    ----------
    done : callable
        Called with a `Picture`, or with a sentence instead of it, from another thread.
    """

    def __init__(self, done: Callable[[Picture | str], object]) -> None:
        self._done = done
        self._spare: subprocess.Popen[bytes] | None = None
        self._running: subprocess.Popen[bytes] | None = None
        self._number = 0
        self._closed = False
        self._lock = threading.Lock()

    def warm_up(self) -> None:
        """Start an engine that waits, unless one does."""
        with self._lock, suppress(engine.EngineError):
            if not self._closed and (self._spare is None or self._spare.poll() is not None):
                self._spare = engine.start()

    def show(self, scene: Mapping[str, Any], options: Mapping[str, Any], pixels: Path) -> None:
        """Ask for a preview in place of any that is under way.

        Parameters
        ----------
        scene : mapping
            The request without options.
        options : mapping
        pixels : Path
            The folder with the scene's pixels.
        """
        self.cancel()
        try:
            with self._lock:
                process = self._spare or engine.start()
                self._spare, self._running = None, process
                number = self._number
        except engine.EngineError as error:
            self._done(str(error))
            return
        request = {"operation": "preview", **scene, "options": dict(options)}
        threading.Thread(target=self._ask, args=(number, process, request, pixels), daemon=True).start()
        self.warm_up()

    def cancel(self) -> None:
        """End the preview that is under way."""
        with self._lock:
            self._number += 1
            if self._running is not None and self._running.poll() is None:
                self._running.kill()
            self._running = None

    def close(self) -> None:
        """End everything."""
        self.cancel()
        with self._lock:
            self._closed = True
            if self._spare is not None:
                engine.end(self._spare)
                self._spare = None

    def _ask(
        self, number: int, process: subprocess.Popen[bytes], request: dict[str, Any], pixels: Path
    ) -> None:
        found: Picture | str
        try:
            with RequestFolder() as folder:
                for file in pixels.glob("*.raw"):
                    shutil.copyfile(file, folder.path / file.name)
                raster = engine.ask(folder, request, lambda share: None, waiting=process)["picture"]
                content = (folder.path / raster["file"]).read_bytes()
                found = raster["width"], raster["height"], raster["channels"], content
        except (engine.EngineError, FolderError, OSError) as error:
            found = str(error)
        with self._lock:
            wanted = number == self._number
        if wanted:
            self._done(found)
