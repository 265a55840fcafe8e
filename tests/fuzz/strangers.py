"""What strangers send: stacks, clips, palettes, archives, and names that look like addresses."""

import io
import socketserver
import struct
import threading
import zipfile
from contextlib import suppress

import numpy as np
from PIL import Image

#: What each command reads beside pictures, by how the names begin.
READS = {"volume": "stack", "loop": "clip", "enblend": "list", "stitch": "clip"}
#: What these write.
MADE = {"volume": [".npy", ".tif", ".ome.tif", ".zarr"], "loop": [".gif", ".webp", ".png", ""]}


class Door:
    """A server on this machine that sends everybody away, and counts who came."""

    def __init__(self):
        self.came = came = []

        class Handler(socketserver.BaseRequestHandler):
            def handle(self):
                came.append(self.client_address)

        self._server = socketserver.TCPServer(("127.0.0.1", 0), Handler)
        self.port = self._server.server_address[1]
        threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True).start()

    @property
    def names(self):
        """Of files, which name this server."""
        place = f"127.0.0.1:{self.port}"
        return [f"tcp:{place}.mp4", f"http:/{place}/x.mp4", "12:30:05.mp4", "pipe:0.mp4"]


#: Photographs that belong together, and one that does not.
VIEWS = ["view0.png", "view1.png", "view2.png", "stranger.png"]


def views(rng):
    """(110, 120, 3) uint8 parts of one scene, 50 and 95 px further right, and one of another."""

    def scene():
        layers = [
            np.kron(rng.random((24, 36, 3)), np.ones((8, 8, 1))),
            np.kron(rng.random((48, 72, 3)), np.ones((4, 4, 1))),
            np.kron(rng.random((96, 144, 3)), np.ones((2, 2, 1))),
        ]
        return (sum(layers) / 3 * 255).astype(np.uint8)

    one = scene()
    return [one[at : at + 110, x : x + 120] for x, at in ((0, 0), (50, 3), (95, 1))] + [scene()[:110, :120]]


def fill_with_views(pool, rng):
    """These as files, and the files that say where they lie."""
    for name, pixels in zip(VIEWS, views(rng), strict=True):
        Image.fromarray(pixels).save(pool / name)
    points = [(70, 20, 20, 17), (110, 90, 60, 87), (75, 60, 25, 57), (100, 40, 50, 37)]
    (pool / "points.csv").write_text(
        "".join(f"view0.png,{x},{y},view1.png,{u},{v}\n" for x, y, u, v in points)
    )
    lines = [f'i w120 h110 f0 v40 r0 p0 y{16 * number} n"{name}"' for number, name in enumerate(VIEWS[:3])]
    (pool / "views.pto").write_text("\n".join(["p f1 w400 h150 v80", *lines]) + "\n")
    places = [(0, 0), (50, 3), (95, 1)]
    entries = [
        f'[[layer]]\nfile = "{name}"\nat = {list(at)}' for name, at in zip(VIEWS, places, strict=False)
    ]
    (pool / "views.toml").write_text("\n".join(entries) + "\n")


def fill(pool, base):
    """Valid files of every kind that is read, into a folder; `base` is (72, 96, 3) uint8."""
    stack = np.stack([np.roll(base[:24, :32, 0], step, axis=1) for step in range(10)])
    np.save(pool / "stack.npy", stack)
    np.save(pool / "stack_float.npy", (stack / np.float32(255)).astype(np.float32))
    with suppress(ImportError):
        import tifffile

        axes = {"metadata": {"axes": "ZYX"}, "photometric": "minisblack"}
        tifffile.imwrite(pool / "stack_plain.tif", stack, imagej=True, **axes)
        tifffile.imwrite(pool / "stack_packed.tif", stack, compression="zlib", **axes)
        tifffile.imwrite(pool / "stack_known.ome.tif", stack, ome=True, compression="zlib", **axes)
    with suppress(ImportError):
        import zarr

        for version in (2, 3):
            zarr.create_array(
                str(pool / f"stack{version}.zarr"), data=stack, chunks=(4, 16, 16), zarr_format=version
            )
    frames = [Image.fromarray(np.roll(base[:24, :32], 3 * step, axis=1)) for step in range(10)]
    more = {"save_all": True, "append_images": frames[1:], "duration": 40, "loop": 0}
    for name in ("clip.gif", "clip.webp", "clip.apng"):
        frames[0].save(pool / name, **({"format": "PNG"} if name.endswith("apng") else {}), **more)
    with suppress(ImportError):
        import av

        with av.open(f"file:{pool / 'clip.mp4'}", "w") as container:
            stream = container.add_stream("libx264", rate=25)
            stream.width, stream.height, stream.pix_fmt = 32, 24, "yuv420p"
            for frame in frames:
                container.mux(stream.encode(av.VideoFrame.from_image(frame)))
            container.mux(stream.encode())
    colours = ((250, 250, 240), (20, 60, 160), (160, 40, 30))
    lines = "\n".join(" ".join(map(str, rgb)) for rgb in colours)
    (pool / "colours.gpl").write_text(f"GIMP Palette\nName: x\n#\n{lines}\n")
    swatches = b"".join(
        struct.pack(">HIH4s3fH", 1, 20, 0, b"RGB ", *(value / 255 for value in rgb), 0) for rgb in colours
    )
    (pool / "colours.ase").write_bytes(b"ASEF" + struct.pack(">HHI", 1, 0, 3) + swatches)
    (pool / "list.txt").write_text("rgb.png\nother.png\n")
    picture = io.BytesIO()
    Image.fromarray(base).save(picture, "PNG")
    layers = "".join(f'<layer name="{n}" src="data/a.png" x="{30 * n}" y="{n}"/>' for n in range(2))
    with zipfile.ZipFile(pool / "layers.ora", "w") as archive:
        archive.writestr("mimetype", "image/openraster")
        archive.writestr("data/a.png", picture.getvalue())
        archive.writestr("stack.xml", f'<image w="130" h="80"><stack>{layers}</stack></image>')
