"""GI-free: one preview after another from an engine that is kept. An engine with an outdated request is
ended, and another one that waits takes over.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from toposeam_gimp.engine import process as engine
from toposeam_gimp.engine.folder import FolderError, RequestFolder

#: Most engines that wait for requests.
_MOST_WARM = 2


class Preview(NamedTuple):
    """A preview in 8 bits; of an animation all frames, one below the other."""

    width: int
    height: int
    channels: int
    content: bytes
    frames: int = 1
    #: Whether a finer one can be had.
    rough: bool = False


class Rehearsal:
    """Previews in the background, the newest request only.

    Parameters
    ----------
    done : callable
        Called from another thread with a `Preview`, or with the sentence of an error.
    of : str
        The engine's name of the previews, for which engines prepare.
    """

    def __init__(self, done: Callable[[Preview | str], object], of: str = "") -> None:
        self._done, self._arguments = done, ("-", of) if of else ("-",)
        self._warm: list[engine.Engine] = []
        self._running: engine.Engine | None = None
        self._number = 0
        self._closed = False
        self._lock = threading.Lock()

    def warm_up(self, count: int = 1) -> None:
        """Start engines until `count` of them wait."""
        with self._lock, suppress(engine.EngineError):
            self._warm = [one for one in self._warm if one.lives]
            while not self._closed and len(self._warm) < count:
                self._warm.insert(0, engine.Engine(self._arguments))

    def show(self, scene: Mapping[str, Any], options: Mapping[str, Any], pixels: Path) -> None:
        """Ask for a preview, in place of any unfinished one.

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
                process = self._next()
                self._running, number = process, self._number
        except engine.EngineError as error:
            self._done(str(error))
            return
        request = {"operation": "preview", **scene, "options": dict(options)}
        threading.Thread(target=self._ask, args=(number, process, request, pixels), daemon=True).start()

    def cancel(self) -> None:
        """Stop the unfinished preview."""
        with self._lock:
            self._number += 1
            if self._running is not None:
                self._running.kill()
            self._running = None

    def close(self) -> None:
        """End all engines."""
        self.cancel()
        with self._lock:
            self._closed = True
            while self._warm:
                self._warm.pop().end()

    def _next(self) -> engine.Engine:
        """Return the engine that answered last and still lives, or else start one."""
        while self._warm:
            process = self._warm.pop()
            if process.lives:
                return process
            process.end()
        return engine.Engine(self._arguments)

    def _ask(self, number: int, process: engine.Engine, request: dict[str, Any], pixels: Path) -> None:
        found: Preview | str
        try:
            with RequestFolder() as folder:
                for file in pixels.glob("*.raw"):
                    shutil.copyfile(file, folder.path / file.name)
                answer = engine.ask(folder, request, lambda share: None, waiting=process)
                raster = answer["picture"]
                content = (folder.path / raster["file"]).read_bytes()
            frames = raster["height"] // request["layers"][0]["height"] if request["of"] == "loop" else 1
            size = raster["width"], raster["height"], raster["channels"]
            found = Preview(*size, content, frames, bool(answer.get("rough")))
        except (engine.EngineError, FolderError, OSError) as error:
            found = str(error)
        with self._lock:
            wanted = number == self._number
            keep = wanted and process.lives and not self._closed
            if wanted:
                self._running = None
            if keep:
                self._warm.append(process)
        if not keep:
            process.end()
        if wanted:
            self._done(found)
            self.warm_up(_MOST_WARM)  # in case one has to be ended
