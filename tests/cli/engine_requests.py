"""Requests to the engine, as the plug-in writes them, and what it answers."""

import io
import json
import os
import subprocess
import sys

import numpy as np

import toposeam as ts
from toposeam.sentence import sentence
from toposeam_engine import serving
from toposeam_engine.serving import MARKER, PROTOCOL


class Request:
    """A folder as the plug-in fills it."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()
        (folder / MARKER).write_text("7e57")
        self.held = None

    def raster(self, name, pixels, offset=(0, 0), **more):
        pixels = np.asarray(pixels)
        pixels.tofile(self.folder / f"{name}.raw")
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        size = {
            "width": pixels.shape[1],
            "height": pixels.shape[0],
            "channels": channels,
            "dtype": str(pixels.dtype),
        }
        return {"file": f"{name}.raw", "name": name, "at": list(offset), **size, **more}

    def put(self, **request):
        (self.folder / "request.json").write_text(
            json.dumps({"protocol": PROTOCOL, "version": ts.__version__, **request})
        )

    def ask(self, **request):
        """What the engine answers, in this process."""
        self.put(**request)
        said = io.StringIO()
        channel = serving.Channel(said)
        try:
            channel.send("result", result=serving._serve(self.folder, channel))
        except Exception as error:
            channel.send("error", message=sentence(error))
        events = [json.loads(line) for line in said.getvalue().splitlines()]
        return int(events[-1]["event"] == "error"), events

    def ask_process(self, **request):
        """The same of a process of its own, as GIMP starts it."""
        self.put(**request)
        process = self.start()
        output, noise = process.communicate(timeout=600)
        assert b"Traceback" not in noise
        events = [json.loads(line) for line in output.splitlines()]
        assert events[0] == {"event": "hello", "protocol": PROTOCOL, "version": ts.__version__}
        return process.returncode, events

    def start(self):
        command = [sys.executable, "-m", "toposeam_engine", str(self.folder)]
        read, self.held = os.pipe()
        os.write(self.held, b"7e57\n")
        process = subprocess.Popen(command, stdin=read, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        os.close(read)
        return process

    def seen(self, masks, places, shape):
        """(H, W) number of the layer that is seen, where masks lie on layers on their rows and columns."""
        seen = np.full(shape, -1)
        for index, (raster, place) in enumerate(zip(masks, places, strict=True)):
            here = seen[place]
            here[np.s_[:] if raster is None else self.pixels(raster) > 0] = index
        return seen

    def pixels(self, raster):
        pixels = np.fromfile(self.folder / raster["file"], raster["dtype"])
        return pixels.reshape(raster["height"], raster["width"], raster["channels"]).squeeze()

    def close(self):
        if self.held is not None:
            os.close(self.held)
            self.held = None


def result_of(answer):
    code, events = answer
    assert code == 0, events[-1]
    assert events[-1]["event"] == "result"
    return events[-1]["result"]


def message_of(answer):
    code, events = answer
    assert code == 1
    assert events[-1]["event"] == "error"
    return events[-1]["message"]


def points_of(line):
    """(N, 2) points of a line: those of its pieces, which meet at their ends."""
    pieces = [np.reshape(piece, (-1, 2)) for piece in line["pieces"]]
    return np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
