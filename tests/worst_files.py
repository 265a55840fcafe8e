"""What the costliest files of at most a megabyte that we know of cost, door by door, as a table.

``python tests/worst_files.py`` prints it, ``--write`` puts it into SECURITY.md: processor time and largest
resident set of a command of its own, with the defaults but for ``--max-megapixels`` where the table says so.
"""

import argparse
import io
import json
import os
import struct
import subprocess
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

import toposeam as ts
from toposeam_cli.motifs.recipe_files import to_toml

HERE = Path(__file__).parents[1]
DOCUMENT = HERE / "SECURITY.md"
MARK = "<!-- tests/worst_files.py writes this table -->"
LARGEST = 2**20
#: A command that takes longer is ended, s of the processor.
LONGEST_S = 400
_WATCH = (
    "import json, os, resource, subprocess, sys\n"
    f"resource.setrlimit(resource.RLIMIT_CPU, ({LONGEST_S}, {LONGEST_S}))\n"
    "code = subprocess.call(sys.argv[1:])\n"
    "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
    "print(json.dumps([code, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))\n"
)


def chunk(kind, content):
    body = kind + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def plain(width, height):
    """A gray PNG in one colour."""
    packed = zlib.compressobj(9)
    rows = bytes(width + 1)
    content = b"".join([*(packed.compress(rows) for _ in range(height)), packed.flush()])
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", content) + chunk(b"IEND", b"")


def saved(picture, kind, **options):
    file = io.BytesIO()
    picture.save(file, kind, **options)
    return file.getvalue()


def noise(side):
    return Image.fromarray(np.random.default_rng(1).integers(0, 255, (side, side, 3), np.uint8))


def turned(number, step, size):
    lines = [f"p f2 w{size} h{size // 2} v360"]
    return "\n".join([*lines, *(f'i w100 h100 f0 v50 y{step * each} n"a.png"' for each in range(number))])


def chain(number, step):
    """A layout of pictures along a diagonal."""
    place = '[[layer]]\nfile = "{}.png"\nname = "{}"\nat = [{}, {}]\n'
    return "".join(place.format("ab"[n % 2], n, n * step, n * step) for n in range(number)).encode()


def archive():
    """An OpenRaster file of two layers of 100 megapixels in one colour."""
    file, layer = io.BytesIO(), plain(10_000, 10_000)
    stack = "".join(f'<layer name="{n}" src="data/{n}.png" x="{9000 * n}" y="0"/>' for n in range(2))
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("mimetype", "image/openraster", zipfile.ZIP_STORED)
        made.writestr("stack.xml", f'<image w="19000" h="10000"><stack>{stack}</stack></image>')
        for number in range(2):
            made.writestr(f"data/{number}.png", layer)
    return file.getvalue()


def alike(count):
    """A GIF of frames of 9 megapixels that are all but alike."""
    frames = [Image.new("P", (3000, 3000)) for _ in range(count)]
    for number, frame in enumerate(frames):
        frame.putpixel((number, 0), 1)  # else it is the same frame, shown longer
    return saved(frames[0], "gif", save_all=True, append_images=frames[1:])


def recipe(side, iterations):
    """A motif's recipe of one layer, all of whose iterations are at full size."""
    made = ts.motif.random_recipe(side, layers=1, iterations=iterations, coarse=False)
    return to_toml(made).encode()


def doors():
    """Each door: its name, its files, and the words after ``toposeam``."""
    pair = {"a.png": saved(noise(100), "png"), "b.png": saved(noise(100), "png")}
    small = {"a.png": plain(4000, 4000), "b.png": plain(4000, 4000)}
    join = ["-o", "out.png"]
    far = 'i w100 h100 f0 v50 y{} n"{}.png"'
    big = "\n".join(["p f0 w10000 h10000 v60", *(far.format(5 * n, name) for n, name in enumerate("ab"))])
    jp2 = saved(Image.new("L", (15_900, 15_900), 7), "jpeg2000", quality_mode="rates", quality_layers=[1])
    jp2 += bytes(max(0, LARGEST - len(jp2) - 1))
    yield (
        "PNG, two of 240 megapixels in one colour",
        {"a.png": plain(15_490, 15_490)},
        [*("stitch", "a.png", "a.png", "--offset", "0,15400", *join)],
    )
    yield (
        "the same, `--max-megapixels 50`",
        {"a.png": plain(15_490, 15_490)},
        [*("stitch", "a.png", "a.png", "--offset", "0,15400", "--max-megapixels", "50", *join)],
    )
    yield "PNG, two of 16 megapixels that show nothing", small, ["stitch", "a.png", "b.png", *join]
    yield (
        "JPEG 2000 of 253 megapixels, filled up to a megabyte",
        {**pair, "c.jp2": jp2},
        [*("stitch", "a.png", "c.jp2", "--offset", "50,0", *join)],
    )
    yield (
        "JPEG 2000 of 253 megapixels",
        {**pair, "c.jp2": jp2[:20_000]},
        [*("stitch", "a.png", "c.jp2", "--offset", "50,0", *join)],
    )
    yield "`.pto` of 10,000 × 10,000 px", {**pair, "p.pto": big.encode()}, ["stitch", "p.pto", *join]
    fits = big.replace("10000", "4000")
    yield "`.pto` of 4,000 × 4,000 px", {**pair, "p.pto": fits.encode()}, ["stitch", "p.pto", *join]
    yield (
        "layout of 430 pictures 30,000 px apart",
        {**pair, "l.toml": chain(430, 70)},
        ["stitch", "l.toml", *join],
    )
    yield (
        "layout of 430 pictures 8,000 px apart",
        {**pair, "l.toml": chain(430, 19)},
        ["stitch", "l.toml", *join],
    )
    yield (
        "`.pto` of 1,000 pictures in one place",
        {**pair, "p.pto": turned(1000, 0.01, 2000).encode()},
        [*("stitch", "p.pto", *join)],
    )
    yield (
        "layout with a key of 500,000 parts",
        {"l.toml": b"a" + b".a" * 500_000 + b"=1"},
        [*("stitch", "l.toml", *join)],
    )
    yield (
        "layout with a list of 500,000 numbers",
        {"l.toml": b"a=[" + b"1," * 500_000 + b"]"},
        [*("stitch", "l.toml", *join)],
    )
    points = "".join(f"a.png,{n % 99},{n % 97},b.png,{n % 98},{n % 96}\n" for n in range(42_000))
    yield (
        "`--points` of 42,000 lines",
        {**pair, "p.csv": points.encode()[: LARGEST - 30]},
        [*("stitch", "a.png", "b.png", "--points", "p.csv", *join)],
    )
    path = " ".join(f"L {n % 90} {n % 40}" for n in range(100_000))
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="170" height="100"><path d="M 0 0 {path}"/></svg>'
    yield (
        "SVG seam of 100,000 points",
        {**pair, "s.svg": svg.encode()[:LARGEST]},
        [*("stitch", "a.png", "b.png", "--offset", "70,0", "--use-seam", "s.svg", *join)],
    )
    jobs = "".join(f'[[stitch]]\npictures=["a.png","b.png"]\noutput="{n}.png"\n' for n in range(17_000))
    yield (
        "file of 17,000 jobs, `--dry-run`",
        {**pair, "j.toml": jobs.encode()[:LARGEST]},
        [*("batch", "j.toml", "--dry-run")],
    )
    for count in (31, 11):
        clip = {"c.gif": alike(count)}
        yield f"GIF of {count} frames of 9 megapixels", clip, ["loop", "c.gif", "-o", "out.gif"]
    far = ["--from", "m.toml", *join]
    yield "recipe of 8192 × 8192 elements", {"m.toml": recipe(8192, 10_000)}, ["motif", *far]
    yield "recipe of 10,000 iterations", {"m.toml": recipe(1024, 10_000)}, ["motif", *far]
    yield "recipe of 2,200 × 2,200 elements", {"m.toml": recipe(2200, 103)}, ["motif", *far]
    yield "OpenRaster, two layers of 100 megapixels", {"l.ora": archive()}, ["stitch", "l.ora", *join]
    colours = "".join(f"{n % 256} {n // 256 % 256} 0 c{n}\n" for n in range(60_000))
    yield (
        "palette of 60,000 colours",
        {"p.gpl": f"GIMP Palette\n{colours}".encode()},
        ["motif", "--palette", "p.gpl", "--size", "64", *join],
    )
    header = io.BytesIO()
    claimed = {"descr": "|u1", "fortran_order": False, "shape": (4000, 4000, 4000)}
    np.lib.format.write_array_header_1_0(header, claimed)
    yield (
        "`.npy` that claims 64,000 megavoxels",
        {"s.npy": header.getvalue()},
        [*("volume", "s.npy", "s.npy", "--offset", "0,0,8", "-o", "out.npy")],
    )


def measured(files, words):
    """What a command cost: its exit code (below 0 if it was ended), s, MiB, and what it said last."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            assert len(content) <= LARGEST, (name, len(content))
            Path(folder, name).write_bytes(content)
        line = [sys.executable, "-c", _WATCH, sys.executable, "-P", "-m", "toposeam", *words]
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        ran = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=True)
        code, seconds, grown = json.loads(ran.stdout.splitlines()[-1])
        return code, seconds, grown, (ran.stderr.strip().splitlines() or [""])[-1]


def rows():
    """The lines of the table."""
    yield "| door, and the costliest file of at most 1 MiB that we know | bytes | processor | memory | ends |"
    yield "|---|---:|---:|---:|---|"
    for name, files, words in doors():
        code, seconds, grown, said = measured(files, words)
        print(f"{name}: {said[:160]}", file=sys.stderr)
        size = len(list(files.values())[-1])
        ends = "well" if code == 0 else f"not within {LONGEST_S} s" if code < 0 else "in a sentence"
        assert code <= 2, (name, code, said)
        yield f"| {name} | {size:,} | {seconds:.1f} s | {grown:,.0f} MiB | {ends} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="put it into SECURITY.md")
    given = parser.parse_args()
    table = "\n".join(rows())
    print(table)
    if given.write:
        head, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(MARK)
        tail = rest.partition(MARK)[2]
        DOCUMENT.write_text(f"{head}{MARK}\n{table}\n{MARK}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
