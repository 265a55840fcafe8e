"""The process that solves: it holds the session, takes messages in order and answers with events."""

from __future__ import annotations

import contextlib
import gc
import signal
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from toposeam.layers.canvas.layer import Box
from toposeam.sentence import sentence
from toposeam_cli.edit.inbox import Inbox, Message
from toposeam_cli.edit.messages import BY_HAND
from toposeam_cli.edit.opening import PLACING, check_count
from toposeam_cli.edit.preview import encoded, jpeg, small_print
from toposeam_cli.edit.session import Change, Session
from toposeam_cli.edit.strokes import drawn, horizon_of, other_way
from toposeam_cli.edit.work import Work
from toposeam_cli.stitching.positions import LAYOUTS


def run(connection: Connection, work: Work) -> None:
    """Solve for a page until the connection closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which then ends this process
    with contextlib.suppress(EOFError, BrokenPipeError, OSError):
        _Solver(connection, work).serve()


def _grows_on(message: Message, newer: Message) -> bool:
    """Test whether a message is of the same stroke, grown."""
    return bool(message["kind"] == newer["kind"] == "stroke" and message["id"] == newer["id"])


class _Solver:
    def __init__(self, connection: Connection, work: Work) -> None:
        self._inbox, self._work = Inbox(connection), work
        self._say = self._inbox.say
        self._session: Session | None = None

    def serve(self) -> None:
        """Open the work, then answer messages one after another."""
        self._open()
        while True:
            message = self._inbox.next(_grows_on)
            try:
                self._answer(message)
            except Exception as error:
                self._say("failed", {"text": sentence(error)})

    def _stroke_waits(self) -> bool:
        return any(message["kind"] == "stroke" for message in self._inbox.receive())

    def _open(self, crop_by_hand: bool = False) -> None:
        """Show small pictures, place them, and show the seams, perhaps with a crop to be drawn."""
        self._session = None
        gc.collect()
        try:
            self._prints()
            session = Session(self._work, lambda share: self._say("placing", {"share": round(share, 3)}))
            if crop_by_hand and session.opened.crop is None:
                session.crop_to(session.opened.inside())
            self._show(session)
        except Exception as error:
            self._say("refused", {"text": sentence(error)})

    def _show(self, session: Session) -> None:
        """Show a session from its beginning."""
        self._session = session
        pictures = [encoded(layer) for layer in session.layers]
        self._say("scene", session.scene(), [session.first(), *pictures])
        self._change(session.all())
        self._rest(session)

    def _prints(self) -> None:
        files = list(self._work.files)
        if len(files) == 1 and files[0].suffix.lower() in LAYOUTS:
            from toposeam_cli.media.layouts.any_layout import layout_in

            files = [layer.file for layer in layout_in(files[0]).layers]
        check_count(len(files))
        self._say("prints", {"names": [path.name for path in files]})
        for number, path in enumerate(files):
            found = small_print(path)
            if found is not None:
                self._say("print", {"number": number, "size": list(found[1])}, [found[0]])

    def _answer(self, message: dict[str, Any]) -> None:
        session, kind = self._session, message["kind"]
        if kind == "settings":
            self._choose(message["settings"])
            return
        if session is None:
            return
        if kind == "blend":
            self._blend(session, message["box"])
        elif kind == "stroke":
            self._stroke(session, message)
        elif kind in ("undo", "redo"):
            self._change(session.undo() if kind == "undo" else session.redo())
            self._crop(session)
            self._rest(session)
        elif kind == "refresh":
            self._change(session.refresh())
        elif kind == "erase":
            if session.erase(np.array(message["points"]), message["radius"]):
                self._settle(session)
        elif kind in ("take", "other"):
            self._found(session, message)
        elif kind == "crop":
            if session.opened.crop is not None:
                session.crop_to(message["box"])
                self._change(session.refresh())
                self._crop(session)
                if session.opened.has_holes(session.opened.crop):
                    self._say("told", {"word": "crop_holes"})
        elif kind == "horizon":
            horizon = horizon_of(np.array(message["points"]), session.labels, session.opened.transforms)
            if horizon is not None:
                self._show(Session(self._work, horizon=horizon))

    def _stroke(self, session: Session, message: dict[str, Any]) -> None:
        stroke, own = message["stroke"], {"id": message["id"]}
        if stroke["layer"] >= len(session.layers):
            return
        if not message["done"]:
            self._change(session.push(stroke), own)
        elif session.paint([stroke]):
            self._settle(session, own)
        else:
            self._change(session.all(), {**own, "done": True, "lost": True})

    def _found(self, session: Session, message: dict[str, Any]) -> None:
        height, width = session.shape
        x, y = message["x"], message["y"]
        if not (0 <= x < width and 0 <= y < height):
            return
        if message["kind"] == "other":
            strokes = other_way(x, y, session.labels)
        else:
            strokes = session.thing_at(x, y, message["layer"])
        if strokes and session.paint(strokes):
            self._settle(session)
        else:
            self._say("told", {"word": "nothing_differs"})

    def _settle(self, session: Session, own: dict[str, Any] | None = None) -> None:
        self._change(session.settle(self._stroke_waits), {**(own or {}), "done": True})
        self._rest(session)

    def _choose(self, settings: dict[str, str]) -> None:
        chosen = {name: value for name, value in settings.items() if value != "auto"}
        before = {name: self._work.settings.get(name) for name in PLACING}
        moved = before != {name: chosen.get(name) for name in PLACING}
        by_hand = chosen.get("crop") == BY_HAND
        if by_hand:
            opened = None if moved or self._session is None else self._session.opened
            drawn = None if opened is None else opened.crop
            chosen["crop"] = "inside" if opened is None or drawn is None else opened.crop_to(drawn)
        self._work.settings = chosen
        if moved:
            self._work.forget_places()
        self._work.save()
        self._open(by_hand)

    def _blend(self, session: Session, box: list[int]) -> None:
        part = Box(box[0], box[1], box[2], box[3]).shared(Box(0, 0, *session.shape))
        if min(part.shape) > 0:
            pixels = session.blended(part)
            self._say("blend", {"box": list(part)}, [jpeg(pixels)])
            judged = session.judge(part, pixels)
            if judged.likeness.size:
                self._change(judged)
                self._rest(session)

    def _change(self, change: Change, own: dict[str, Any] | None = None) -> None:
        session = self._session
        if session is None:
            return
        head = {
            "box": list(change.box),
            "squares": list(change.squares),
            "lost": change.lost,
            **session.can,
            **(own or {}),
        }
        self._say("state", head, [change.labels.tobytes(), change.likeness.tobytes()])

    def _crop(self, session: Session) -> None:
        """Say where the crop lies that was drawn, if one was."""
        if session.opened.crop is not None:
            self._say("crop", {"box": session.opened.crop})

    def _rest(self, session: Session) -> None:
        """Say what is not needed while a stroke grows: the worst places and all strokes."""
        places = [
            {"x": round(one.x, 1), "y": round(one.y, 1), "likeness": round(one.likeness, 3), "done": one.done}
            for one in session.worst()
        ]
        self._say("rest", {"places": places, "strokes": drawn(session.strokes, session.opened.transforms)})
