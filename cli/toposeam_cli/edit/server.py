"""The server of the page: it hands out files, takes dropped pictures, and passes messages on."""

from __future__ import annotations

import asyncio
import secrets
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import ExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from toposeam.seam.result.verdict import SQUARE_PX
from toposeam.sentence import sentence
from toposeam_cli.edit import saving, solver
from toposeam_cli.edit.dropped import Dropped, samples
from toposeam_cli.edit.guard import HEADERS, Guard
from toposeam_cli.edit.messages import LONGEST, MessageError, packed, parsed
from toposeam_cli.edit.processes import Worker
from toposeam_cli.edit.work import Work, claimed_work, recent_works, work_of

PAGE = Path(__file__).parent / "page"
#: The server ends when no page has been open for so long, s; and a page that reads nothing is dropped after
#: so many messages.
IDLE_S, _MOST_UNREAD = 1800.0, 400
#: Messages to the process that solves.
_FOR_SOLVER = (
    "stroke",
    "erase",
    "undo",
    "redo",
    "refresh",
    "take",
    "other",
    "blend",
    "settings",
    "horizon",
    "crop",
)


class Mirror:
    """What the solver has said, for pages that come later."""

    def __init__(self) -> None:
        self.kept: dict[str, bytes] = {}
        self.prints: list[bytes] = []
        self._labels = self._squares = np.zeros((0, 0), np.uint8)
        self._head: dict[str, Any] = {}

    def take(self, kind: str, head: dict[str, Any], blocks: list[bytes]) -> None:
        """Keep an event."""
        if kind == "prints":
            self.__init__()  # type: ignore[misc]
        if kind == "scene":
            height, width = head["shape"]
            self.kept.pop("crop", None)
            self._labels = np.zeros((height, width), np.uint8)
            self._squares = np.full((-(-height // SQUARE_PX), -(-width // SQUARE_PX)), 255, np.uint8)
        if kind == "print":
            self.prints.append(packed(kind, head, blocks))
        elif kind == "state":
            for name, own, block in zip(
                ("box", "squares"), (self._labels, self._squares), blocks, strict=True
            ):
                top, left, bottom, right = head[name]
                part = np.frombuffer(block, np.uint8).reshape(bottom - top, right - left)
                own[top:bottom, left:right] = part
            self._head = {name: head[name] for name in ("undo", "redo")}
        elif kind in ("prints", "scene", "crop", "rest", "refused", "placing"):
            self.kept[kind] = packed(kind, head, blocks)

    def messages(self) -> list[bytes]:
        """Return the messages that bring a new page up to date."""
        found = [self.kept[kind] for kind in ("prints",) if kind in self.kept]
        found += self.prints
        found += [self.kept[kind] for kind in ("placing", "scene", "crop", "refused") if kind in self.kept]
        if "scene" in self.kept and self._head:
            whole = {
                "box": [0, 0, *self._labels.shape],
                "squares": [0, 0, *self._squares.shape],
                "lost": False,
                **self._head,
            }
            found.append(packed("state", whole, [self._labels.tobytes(), self._squares.tobytes()]))
        return found + ([self.kept["rest"]] if "rest" in self.kept else [])


class Page:
    """One open page: its socket and what it has yet to be told."""

    def __init__(self, ws: WebSocket) -> None:
        self.ws = ws
        self.waiting: asyncio.Queue[bytes] = asyncio.Queue()

    def tell(self, data: bytes) -> None:
        """Queue a message."""
        self.waiting.put_nowait(data)

    async def write(self) -> None:
        """Send what is queued until the socket closes."""
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await self.ws.send_bytes(await self.waiting.get())


class Pages:
    """The pages of one server: who owns the work, what they are told, and a save that runs."""

    #: The file of `page/` that a browser gets first.
    file = "index.html"
    #: Reads a message of a page.
    parse: Callable[[str], dict[str, Any]] = staticmethod(parsed)

    def __init__(self, output: Path | None, end: Callable[[], None]) -> None:
        self.output, self._end = output, end
        self.mirror: Mirror = Mirror()
        self.dropped: Dropped | None = None
        self.pages: list[Page] = []
        self.owner: Page | None = None
        self.saved: dict[str, Path] = {}
        self.emptied_at = time.monotonic()
        self._solver: Worker | None = None
        self._saving: Worker | None = None
        self._target: Path | None = None
        self._stack = ExitStack()

    def begin(self) -> None:
        """Begin with the work that was named."""
        raise NotImplementedError

    def about(self) -> dict[str, Any]:
        """Return what the first message to a page says."""
        raise NotImplementedError

    def do(self, page: Page, message: dict[str, Any]) -> None:
        """Do what the page that owns the work asks for."""
        raise NotImplementedError

    def close(self) -> None:
        """End all processes, and leave the work."""
        for worker in (self._saving, self._solver):
            if worker is not None:
                worker.end()
        self._saving = self._solver = None
        self._stack.close()

    def hello(self, page: Page) -> bytes:
        """Return the first message to a page."""
        output = None if self.output is None else self.output.name
        return packed("hello", {"owner": page is self.owner, "output": output, **self.about()})

    def tell(self, data: bytes) -> None:
        """Tell all pages."""
        for page in list(self.pages):
            page.tell(data)
            if page.waiting.qsize() > _MOST_UNREAD:
                self.leave(page)

    def join(self, page: Page) -> None:
        """Take a page in; the first one owns the work."""
        self.pages.append(page)
        self.owner = self.owner or page
        for data in (self.hello(page), *self.mirror.messages()):
            page.tell(data)

    def leave(self, page: Page) -> None:
        """Forget a page."""
        if page in self.pages:
            self.pages.remove(page)
        if self.owner is page:
            self.owner = None
        self.emptied_at = time.monotonic()

    def answer(self, page: Page, message: dict[str, Any]) -> None:
        """Do what a page asks for, if it owns the work."""
        kind = message["kind"]
        if kind == "takeover" or self.owner is None:
            self.owner = page
            for each in self.pages:
                each.tell(packed("role", {"owner": each is page}))
        if page is not self.owner:
            return
        if kind == "cancel" and self._saving is not None:
            self._saving.ask_to_end()
        else:
            self.do(page, message)

    def ask_solver(self, page: Page, message: dict[str, Any]) -> None:
        """Pass a message on to the process that solves; a page that sends too many is dropped."""
        if self._solver is not None and not self._solver.send(message):
            self.leave(page)

    def _take(self, event: Any) -> None:
        """Pass an event of the solver on."""
        if event is None:
            return
        kind, head, blocks = event
        self.mirror.take(kind, head, blocks)
        self.tell(packed(kind, head, blocks))

    def _write(self, command: str, words: list[str], target: Path) -> None:
        """Begin to write a file by a command of ``toposeam``."""

        def take(event: Any) -> None:
            if self._saving is worker:  # the end of one that has saved may come after the next has begun
                self._saved(event)

        self._target = target
        worker = self._saving = Worker(saving.run, (command, words, target), take)

    def _saved(self, event: Any) -> None:
        """Tell the pages how far a save is, and at its end where the picture is."""
        if event is None:
            self._saving = None
            self.tell(packed("cancelled", {}))
            return
        kind, text, share = event
        head: dict[str, Any] = {"text": text, "share": round(share, 3)}
        if kind in ("saved", "failed"):
            self._saving = None
        if kind == "saved" and self._target is not None:
            if self.output is None:
                name = secrets.token_urlsafe(8)
                self.saved = {name: self._target}
                head["download"] = name
            else:
                head["text"] = str(self._target)
        self.tell(packed(kind, head))

    async def watch(self) -> None:
        """End the server when no page has been open for long."""
        while self.pages or time.monotonic() - self.emptied_at < IDLE_S:
            await asyncio.sleep(1)
        self._end()


class Hub(Pages):
    """The pages of a work of pictures, and the process that finds its seams."""

    def __init__(self, work: Work, output: Path | None, end: Callable[[], None]) -> None:
        super().__init__(output, end)
        self.work, self.dropped = work, Dropped()

    def begin(self) -> None:
        """Open the work that was named."""
        self.open(self.work)

    def open(self, work: Work) -> None:
        """Open a work: start the process that solves.

        Raises
        ------
        OptionError
            If another page has it open.
        """
        self.close()
        self._stack.enter_context(claimed_work(work))
        self.work, self.mirror = work, Mirror()
        if work.files:
            self._solver = Worker(solver.run, (work,), self._take)

    def about(self) -> dict[str, Any]:
        """Return whether there are pictures, what was edited last, and the samples."""
        works = [
            {"names": [path.name for path in work.files[:3]], "count": len(work.files), "at": changed}
            for _, work, changed in recent_works()
        ]
        return {
            "begun": bool(self.work.files),
            "recent": works,
            "samples": [names for names, _ in samples()],
        }

    def do(self, page: Page, message: dict[str, Any]) -> None:
        """Do what the page that owns the work asks for."""
        kind = message["kind"]
        if kind in _FOR_SOLVER:
            self.ask_solver(page, message)
        elif kind in ("open", "resume", "sample", "start", "forget"):
            self._begin(kind, message)
        elif kind == "save":
            self._save(message["format"])

    def _begin(self, kind: str, message: dict[str, Any]) -> None:
        """Open other pictures: dropped ones, a work that was begun, a sample, or none."""
        works = recent_works()
        try:
            if kind == "forget" and message["work"] < len(works):
                works[message["work"]][1].forget()
            elif kind == "open" and self.dropped is not None:
                self.open(self.dropped.as_work(message["files"]))
            elif kind == "resume" and message["work"] < len(works):
                self.open(works[message["work"]][1])
            elif kind == "sample" and message["sample"] < len(samples()):
                self.open(work_of(samples()[message["sample"]][1]))
            elif kind == "start":
                self.open(work_of([]))
        except Exception as error:
            self.tell(packed("failed", {"text": sentence(error)}))
        for page in self.pages:
            page.tell(self.hello(page))

    def _save(self, suffix: str) -> None:
        """Begin to write the picture at full size, unless that runs already."""
        if self._saving is not None or not self.work.layout.exists():
            return
        words = [str(self.work.layout), "--force"]
        if self.output is not None:
            words += ["--save-layout", str(self.output.with_suffix(".toml"))]
        target = self.output or self.work.folder / f"joined.{suffix}"
        self._write("stitch", [*words, "-o", str(target)], target)


def application(hub: Pages, token: str, port: int) -> Starlette:
    """Return the application of a server."""

    async def index(request: Request) -> Response:
        return FileResponse(PAGE / hub.file, headers=dict(HEADERS))

    async def drop(request: Request) -> Response:
        if hub.owner is None or hub.dropped is None:
            return PlainTextResponse("no page", 409, dict(HEADERS))
        try:
            number = await hub.dropped.take(request.query_params.get("name", ""), request.stream())
        except Exception as error:
            return JSONResponse({"text": sentence(error)}, 400, dict(HEADERS))
        return JSONResponse({"file": number}, headers=dict(HEADERS))

    async def download(request: Request) -> Response:
        path = hub.saved.get(request.path_params["name"])
        if path is None or not path.exists():
            return PlainTextResponse("nothing", 404, dict(HEADERS))
        return FileResponse(path, filename=path.name, headers=dict(HEADERS))

    async def live(ws: WebSocket) -> None:
        await ws.accept()
        page = Page(ws)
        hub.join(page)
        writing = asyncio.create_task(page.write())
        try:
            while page in hub.pages:
                hub.answer(page, hub.parse(await ws.receive_text()))
        except (WebSocketDisconnect, RuntimeError, KeyError):
            pass
        except MessageError:
            with suppress(RuntimeError):
                await ws.close(1008)
        finally:
            hub.leave(page)
            writing.cancel()

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        hub.begin()
        watching = asyncio.create_task(hub.watch())
        yield
        watching.cancel()
        hub.close()
        if hub.dropped is not None:
            hub.dropped.close()

    routes = [
        Route("/", index),
        Route("/drop", drop, methods=["POST"]),
        Route("/saved/{name}", download),
        WebSocketRoute("/live", live),
        Mount("/page", _PageFiles(directory=PAGE)),
    ]
    return Starlette(
        routes=[Mount(f"/{token}", routes=routes)],
        middleware=[Middleware(Guard, token=token, port=port)],
        lifespan=lifespan,
    )


class _PageFiles(StaticFiles):
    def file_response(self, *given: Any, **named: Any) -> Response:
        response = super().file_response(*given, **named)
        response.headers.update(HEADERS)
        return response


def serve(pages: Callable[[Callable[[], None]], Pages], port: int, opened: Callable[[str], None]) -> None:
    """Serve pages until Ctrl-C, or until they have long been closed.

    Parameters
    ----------
    pages : callable
        Returns the pages; given what ends the server.
    port : int
        0 for any that is free.
    opened : callable
        Called with the address once the server listens.

    Raises
    ------
    OptionError
        If the work is open elsewhere, or the port is taken.
    """
    with socket.socket() as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(("127.0.0.1", port))
        listening.listen()
        own = listening.getsockname()[1]
        token = secrets.token_urlsafe(24)

        def end() -> None:
            server.should_exit = True

        config = uvicorn.Config(
            application(pages(end), token, own),
            log_level="critical",
            ws="websockets-sansio",
            ws_max_size=LONGEST,
            ws_max_queue=64,
            server_header=False,
            date_header=False,
            lifespan="on",
            timeout_graceful_shutdown=1,
        )
        server = uvicorn.Server(config)
        address = f"http://127.0.0.1:{own}/{token}/"

        async def run() -> None:
            task = asyncio.create_task(server.serve([listening]))
            while not server.started and not task.done():
                await asyncio.sleep(0.02)
            if server.started:
                opened(address)
            await task

        asyncio.run(run())
