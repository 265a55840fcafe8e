"""Commands with options drawn from their own declarations, on files that are valid or gone bad.

``python commands.py SEED COUNT`` does so many in an empty working folder, and tells of each in a line of
JSON. What worked is tried again with something changed, and what it made is given to other commands: so the
deeper rooms are reached without this file knowing one option by its name.
"""

import io
import json
import os
import random
import re
import shutil
import sys
import tempfile
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner
from PIL import Image
from strangers import MADE, READS, VIEWS, Door, fill, fill_with_views
from watched import LARGEST_BYTES, LONGEST_S, WORDS, TooLong, gone_bad, plain_png, tell, watched

from toposeam_cli.app import registry
from toposeam_cli.app.main import main
from toposeam_cli.app.options import is_output

#: By what a type of parameter is called: values that are likely to be right.
LIKELY = {
    "X,Y": ["0,0", "20,0", "-8,3", "30,5"],
    "Z,Y,X": ["0,0,8", "0,0,16", "2,0,8", "2,0.5,0.5"],
    "N[%]": ["20", "25%", "8", "50%"],
    "WxH": ["48x32", "64x64", "33x70"],
    "N|WIDTHxHEIGHT": ["32", "48x32", "64"],
    "COLUMNSxROWS": ["2", "2x1", "3x2"],
    "N|auto": ["8", "auto", "16"],
    "LENGTH": ["80mm", "3cm", "2in"],
    "N[,N...]": ["1", "0.2,0.3", "2"],
    "W,W,…": ["1", "1,1"],
    "RULE": ["none", "reflect", "translate", "rotate", "p4m", "p6m", "p3"],
    "text": ["2x1", "fall", "winter", "soft", "clean", "A B/B A", "name"],
    "integer": ["1", "4", "8"],
}
HOSTILE_SIZES = ["0x0", "1x100000", "999999x999999", "100000x1", "3x", "x3", "1x1", "-2x2", "2x2x2"]
SUFFIXES = [".png", ".tif", ".jpg", ".webp", ".svg", ".ora", ".pdf", ".gif", ".toml", ".json", ".xyz", ""]
#: The system's folder for temporary files, for the time of the run.
TEMPORARY = Path("temporary").absolute()
#: What ``stitch`` takes for photographs, by the names of its parameters.
FOR_PHOTOGRAPHS = [
    *("model", "focal", "lens", "projection", "fov", "groups", "skip_bad", "level", "save_layout", "report"),
    *("blend", "match_tones", "match_shading", "crop", "as_json", "align", "give", "order", "centre"),
]
#: They make more than one file, and keep what they made when something fails later.
KEEPING = {"batch", "book"}


def leaves(command, words=()):
    """Every command that can be run, and the words that call it."""
    if isinstance(command, click.Group):
        for name in command.list_commands(None):
            yield from leaves(command.get_command(None, name), (*words, name))
    else:
        yield words, command


class Fuzzer:
    """A pool of files, and what has worked so far."""

    def __init__(self, seed):
        self.rng = random.Random(seed)  # noqa: S311 - no secret
        #: `edit` waits until somebody closes its page; tests/cli/edit asks it hostile things.
        self.names = [name for name in registry.COMMANDS if name != "edit"]
        self.commands = [leaf for name in self.names for leaf in leaves(registry.load(name), (name,))]
        self.pool = Path("pool").absolute()
        self.pool.mkdir()
        self.worked = {}
        self.harvested = 0
        self.command = ""
        self.door = Door()
        self.careful = False
        self._fill_pool()

    def _fill_pool(self):
        rng = np.random.default_rng(self.rng.randrange(2**32))
        base = np.kron(rng.integers(0, 256, (9, 12, 3)), np.ones((8, 8, 1))).astype(np.uint8)
        base = (base * 0.8 + rng.integers(0, 50, base.shape)).astype(np.uint8)  # (72, 96, 3), not too plain
        pictures = {
            "rgb.png": base,
            "other.png": np.roll(base, 5, axis=1),
            "gray.png": base[..., 0],
            "alpha.png": np.dstack([base, np.where(np.arange(96) > 20, 255, 0) * np.ones((72, 1))]).astype(
                np.uint8
            ),
            "clear.png": np.dstack([base, np.zeros((72, 96))]).astype(np.uint8),
            "holes.png": np.dstack([base, (rng.random((72, 96)) > 0.5) * 255]).astype(np.uint8),
            "mask.png": (np.hypot(*(np.mgrid[:72, :96] - 20)) < 9).astype(np.uint8) * 255,
            "white.png": np.full((72, 96), 255, np.uint8),
            "black.png": np.zeros((72, 96), np.uint8),
            "plain.png": np.full((72, 96, 3), 77, np.uint8),
            "dot.png": np.full((1, 1, 3), 9, np.uint8),
            "line.png": base[:1],
            "deep.tif": base[..., 0].astype(np.uint16) * 257,
            "photo.jpg": base,
            "web.webp": base,
        }
        for name, pixels in pictures.items():
            Image.fromarray(pixels).save(self.pool / name)
        fill(self.pool, base)
        fill_with_views(self.pool, rng)
        (self.pool / "huge.png").write_bytes(plain_png(30_000, 20_000))  # 600 megapixels in one colour
        (self.pool / "layout.toml").write_text(
            '[[layer]]\nfile = "rgb.png"\nat = [0, 0]\n[[layer]]\nfile = "other.png"\nat = [30, 4]\n'
        )
        (self.pool / "layout.json").write_text(
            json.dumps({"layer": [{"file": "rgb.png", "at": [0, 0]}, {"file": "gray.png", "at": [-20, 9]}]})
        )
        (self.pool / "line.svg").write_text(
            '<svg xmlns="http://www.w3.org/2000/svg" width="96" height="72" viewBox="0 0 96 72">'
            '<path id="seam" d="M 40 -3 L 44 20 L 41 80"/></svg>'
        )
        (self.pool / "table.jsonl").write_text('{"name": "a", "status": "done", "key": "0", "seconds": 1}\n')
        (self.pool / "empty").touch()
        (self.pool / os.fsdecode(b"latin-\xe9.png")).write_bytes((self.pool / "rgb.png").read_bytes())
        (self.pool / "new\nline.png").write_bytes((self.pool / "rgb.png").read_bytes())
        (self.pool / "folder.png").mkdir()
        os.mkfifo(self.pool / "pipe.png")
        os.mkfifo(self.pool / "pipe.toml")
        (self.pool / "loop.png").symlink_to(self.pool / "loop.png")
        self.remembered = self.states()

    def states(self):
        """What says whether the pool has been touched."""
        found = {}
        for path in sorted(self.pool.rglob("*")):
            state = path.lstat()
            found[str(path)] = (state.st_ino, state.st_size, state.st_mtime_ns)
        return found

    def add(self, name, content):
        """A new file in the pool."""
        (self.pool / name).write_bytes(content)
        self.remembered = self.states()

    def spoil(self):
        """A file of the pool gone bad."""
        usual = [path for path in self.pool.iterdir() if path.is_file() and path.stat().st_size < 10**6]
        source = self.rng.choice(sorted(usual))
        wanted = READS.get(self.command)
        if wanted is not None and self.rng.random() < 0.7:
            source = self.rng.choice([path for path in sorted(usual) if path.name.startswith(wanted)])
        folders = [path for path in sorted(self.pool.glob("stack*.zarr")) if wanted == "stack"]
        if folders and self.rng.random() < 0.4:
            return self.spoilt_folder(self.rng.choice(folders))
        name = f"bad{self.rng.randrange(12)}{source.suffix}"
        self.add(name, gone_bad(source.read_bytes(), self.rng))
        return self.pool / name

    def spoilt_folder(self, source):
        """A copy of a folder in which one file has gone bad."""
        target = self.pool / f"bad{self.rng.randrange(4)}.zarr"
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(source, target)
        file = self.rng.choice(sorted(path for path in target.rglob("*") if path.is_file()))
        file.write_bytes(gone_bad(file.read_bytes(), self.rng))
        self.remembered = self.states()
        return target

    # What an option can be given.

    def file(self, suffixes=None):
        """The name of a file to be read."""
        rng = self.rng
        draw = 0.5 if self.careful else rng.random()
        if draw < 0.15:
            return str(self.spoil())
        if draw < 0.22:
            places = ["missing.png", "", ".", "/dev/null", "/dev/zero", "/dev/full", "/", "a" * 300, "-"]
            special = [
                "pipe.png",
                "pipe.toml",
                "loop.png",
                "folder.png",
                "huge.png",
                "empty",
                "new\nline.png",
            ]
            return rng.choice([*places, *(str(self.pool / name) for name in special)])
        if self.command in READS and rng.random() < 0.7:
            known = sorted(path for path in self.pool.glob(f"{READS[self.command]}*"))
            return rng.choice([*map(str, known), *(self.door.names if READS[self.command] == "clip" else ())])
        made = sorted(self.pool.glob("made*"))
        if made and draw < 0.6 and rng.random() < 0.4:
            return str(rng.choice(made))
        if draw < 0.75:
            return str(self.pool / rng.choice(["rgb.png", "other.png", "gray.png", "alpha.png", "mask.png"]))
        skipped = {"huge.png", "pipe.png", "pipe.toml"}
        return str(rng.choice(sorted(path for path in self.pool.iterdir() if path.name not in skipped)))

    def output(self):
        """The name of a file to be made."""
        rng = self.rng
        draw = 1.0 if self.careful else rng.random()
        if draw < 0.08:
            names = [
                "",
                ".",
                "/dev/full",
                "/dev/null",
                "/proc/x.png",
                "no/x.png",
                "old.png/x.png",
                "a" * 300 + ".png",
            ]
            return rng.choice(names)
        if draw < 0.2:
            return rng.choice(
                ["old.png", "old.svg", "old.tif", "folder.png", os.fsdecode(b"\xff.png"), "n\nl.png"]
            )
        if self.command in MADE and rng.random() < 0.8:
            return f"new{rng.randrange(9)}{rng.choice(MADE[self.command])}"
        if self.careful:
            return f"new{rng.randrange(9)}{rng.choice(['.png', '.png', '.png', '.tif', '.svg', '.ora'])}"
        return f"new{rng.randrange(4)}{rng.choice(['.png', '.png', '.png', *SUFFIXES])}"

    def value(self, parameter):
        """A word for a parameter, likely to be right."""
        rng, kind = self.rng, parameter.type
        if is_output(parameter):
            return self.output()
        name = str(kind.name)
        if "INPUT" in (parameter.metavar or ""):  # files, and lists of them
            return ("@" if rng.random() < 0.2 else "") + self.file()
        if not self.careful and rng.random() < 0.15:
            return rng.choice(HOSTILE_SIZES if "x" in name and rng.random() < 0.6 else WORDS)
        if isinstance(kind, click.Choice):
            return str(rng.choice(list(kind.choices)))
        if isinstance(kind, click.Path):
            return f"{rng.randrange(2)}={self.file()}" if type(kind).__name__ == "KeyedFile" else self.file()
        if hasattr(kind, "min"):
            low = kind.min if kind.min is not None else 0
            high = min(kind.max if kind.max is not None else low + 30, low + 60)
            drawn = rng.choice(
                [low, high, rng.uniform(low, high), low - 1, (kind.max or 100) + 1][
                    : 3 if self.careful else 5
                ]
            )
            return str(round(drawn)) if "int" in name else repr(float(drawn))
        return rng.choice(LIKELY.get(name, [*WORDS, "1", "2x1"]))

    def words_for(self, parameter):
        """The words that give a parameter."""
        if isinstance(parameter, click.Argument):
            count = parameter.nargs if parameter.nargs > 0 else self.rng.choice([0, 1, 1, 2, 3])
            return [self.value(parameter) for _ in range(count)]
        if getattr(parameter, "is_flag", False):
            return [self.rng.choice([*parameter.opts, *parameter.secondary_opts])]
        option = self.rng.choice(parameter.opts)
        times = self.rng.choice([1, 1, 2, 3]) if parameter.multiple else 1
        return [
            word
            for _ in range(times)
            for word in (option, *(self.value(parameter) for _ in range(max(parameter.nargs, 1))))
        ]

    def draw(self):
        """A command and what is given to it, by parameter."""
        name = self.rng.choice([*self.names, "stitch", "synth", "motif"])
        words, command = self.rng.choice([leaf for leaf in self.commands if leaf[0][0] == name])
        self.command = name
        self.careful = self.rng.random() < (0.3 if self.worked.get(words) else 0.7)
        known = self.worked.get(words)
        given = dict(self.rng.choice(known)) if known and self.rng.random() < 0.6 else {}
        parameters = [parameter for parameter in command.params if parameter.name != "help"]
        if given:
            for parameter in self.rng.sample(parameters, min(len(parameters), self.rng.choice([1, 1, 2, 3]))):
                given[parameter.name] = [] if self.rng.random() < 0.2 else self.words_for(parameter)
        else:
            share = self.rng.choice([0.03, 0.1] if self.careful else [0.03, 0.1, 0.3])
            for parameter in parameters:
                argument = isinstance(parameter, click.Argument)
                if self.rng.random() < (0.95 if parameter.required or argument else share):
                    given[parameter.name] = self.words_for(parameter)
        for parameter in parameters:  # nothing but small pictures
            if given.get(parameter.name) is None and str(parameter.type.name) == "N|WIDTHxHEIGHT":
                given[parameter.name] = (
                    [parameter.opts[0], "32"] if isinstance(parameter, click.Option) else ["32"]
                )
        if words == ("stitch",) and self.rng.random() < 0.5:
            given = self.photographs(parameters)
        if words == ("volume",) and self.rng.random() < 0.7:  # an offset for each stack but the first
            count, by_name = self.rng.choice([2, 2, 3]), {each.name: each for each in parameters}
            given["stacks"] = [self.value(by_name["stacks"]) for _ in range(count)]
            given["offset"] = [
                word for _ in range(count - 1) for word in ("--offset", self.value(by_name["offset"]))
            ]
        if words == ("batch",):
            given = self.batch(parameters)
        if words == ("enblend",):  # it takes pictures of any size; this one is 45 seconds
            huge, rgb = str(self.pool / "huge.png"), str(self.pool / "rgb.png")
            given = {name: [rgb if word == huge else word for word in told] for name, told in given.items()}
        if words == ("book",):  # three seconds each, so once in a while
            number = next(parameter for parameter in parameters if isinstance(parameter.type, click.IntRange))
            given[number.name] = [number.opts[0], self.rng.choice(["1", "0", "-1", "10001"] + ["x"] * 20)]
        return words, command, given

    def photographs(self, parameters):
        """Photographs whose places are found, or a project or layout of them, and options for these."""
        rng, known = self.rng, {parameter.name: parameter for parameter in parameters}
        draw = rng.random()
        files = [str(self.pool / name) for name in rng.sample(VIEWS, rng.choice([2, 2, 3, 4]))]
        if draw < 0.3:
            source = self.pool / rng.choice(["views.pto", "views.toml"])
            files = [str(source)]
            if rng.random() < 0.4:
                self.add(f"bad{source.suffix}", gone_bad(source.read_bytes(), rng))
                files = [str(self.pool / f"bad{source.suffix}")]
        elif draw < 0.45:
            self.add("bad_view.png", gone_bad((self.pool / "view1.png").read_bytes(), rng))
            files.append(str(self.pool / "bad_view.png"))
        given = {"pictures": files, "output": ["-o", self.output()]}
        if rng.random() < 0.3:
            points = self.pool / "points.csv"
            if rng.random() < 0.5:
                self.add("bad_points.csv", gone_bad(points.read_bytes(), rng))
                points = self.pool / "bad_points.csv"
            given["points"] = ["--points", str(points)]
        for name in rng.sample(FOR_PHOTOGRAPHS, rng.choice([0, 1, 1, 2, 4])):
            given[name] = self.words_for(known[name])
        return given

    def batch(self, parameters):
        """A file of jobs, most of the time only to be looked at."""
        words, command = self.rng.choice([leaf for leaf in self.commands if len(leaf[0]) == 1])
        lines = [f"[[{words[0]}]]"]
        for parameter in command.params:
            if self.rng.random() < (0.9 if parameter.required else 0.2) and parameter.name:
                value = True if getattr(parameter, "is_flag", False) else self.value(parameter)
                key = self.rng.choice([parameter.name, max(parameter.opts, key=len).lstrip("-")])
                shown = self.rng.choice(
                    [json.dumps(value), json.dumps([value]), "1", "-0.5", "nan", "[[1, 2]]"][:3]
                )
                lines.append(f"{json.dumps(key)} = {shown}")
        if self.rng.random() < 0.2:
            lines[:0] = ["[defaults]", f"force = {self.rng.choice(['true', '1', '[]'])}"]
        content = "\n".join(lines).encode("utf-8", "surrogateescape")
        Path("jobs.toml").write_bytes(gone_bad(content, self.rng) if self.rng.random() < 0.3 else content)
        flags = {
            parameter.name: parameter.opts[-1] for parameter in parameters if getattr(parameter, "is_flag", 0)
        }
        dry = [flag for name, flag in flags.items() if "dry" in name]
        given = {"words": ["jobs.toml"], "dry": dry if self.rng.random() < 0.95 else []}
        given["flag"] = [self.rng.choice(sorted(flags.values()))] if self.rng.random() < 0.2 else []
        return given

    # One case.

    def run(self, number):
        """Do one, and tell what became of it."""
        Path("case").mkdir()
        os.chdir("case")
        try:
            for name in ("old.png", "old.svg", "old.tif"):
                Path(name).write_text("precious")
            Path("folder.png").mkdir()
            if (self.pool / "clip.mp4").exists():
                for name in self.door.names:
                    Path(name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(self.pool / "clip.mp4", name)
            words, _, given = self.draw()
            line = [*words, *(word for part in given.values() for word in part)]
            before = self.contents()
            runner, problem, result = CliRunner(), None, None
            with watched() as spent:
                try:
                    result = runner.invoke(main, line)
                except TooLong:
                    problem = "took too long"
            problem = problem or self.judge(result, line, before, words, spent)
            if problem is None and result.exit_code == 0:
                self.learn(words, given, before)
            said = result.stderr.strip().rpartition("\n")[2][:300] if result is not None else ""
            code = getattr(result, "exit_code", None)
            tell(case=number, words=line, code=code, said=said, problem=problem, **spent)
        finally:
            os.chdir("..")
            shutil.rmtree("case")

    @staticmethod
    def contents():
        """Every file below the working folder."""
        return {
            str(path): path.read_bytes()
            for path in Path().rglob("*")
            if path.is_file() and not path.is_symlink()
        }

    def judge(self, result, line, before, words, spent):
        """What is wrong about an outcome; None if nothing is."""
        if spent["seconds"] > LONGEST_S or spent["grown"] > LARGEST_BYTES:
            return f"{spent['seconds']} s, {spent['grown'] >> 20} MiB"
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            import traceback

            return "".join(traceback.format_exception(result.exception))[-1500:]
        told = result.stderr
        for never in ("Traceback", "something went wrong", "Warning:"):
            if never in told:
                return told[-1500:]
        if result.exit_code not in (0, 1, 2):
            return f"exit code {result.exit_code}"
        if (
            result.exit_code
            and words[0] not in KEEPING
            and not (
                re.search(r"Error: [^\n]{10,}\n\Z", told)
                or (words[-1:] == ("doctor",) and "PROBLEM" in result.stdout)
            )
        ):
            return f"no sentence: {told[-500:]!r}"
        if tuple(words[:2]) == ("gimp", "install") or words[0] == "book":
            now = self.states()  # they add files to a folder that is named
            files = {name: state for name, state in self.remembered.items() if not Path(name).is_dir()}
            if files.items() <= now.items():
                self.remembered = now
        if self.states() != self.remembered:
            return "an input has changed"
        if self.door.came:
            return "a connection was opened"
        if list(TEMPORARY.iterdir()):
            return f"left in the system's temporary folder: {sorted(TEMPORARY.rglob('*'))}"
        now = self.contents()
        if any(".toposeam-" in name for name in now):
            return "a temporary file is left"
        force = "--force" in line or words[0] == "enblend"  # which replaces its output, as Hugin's does
        lost = [
            name for name in before if now.get(name) != before[name] and not (force and result.exit_code == 0)
        ]
        if lost:
            return f"{lost} changed"
        new = set(now) - set(before)
        if result.exit_code and new and words[0] not in KEEPING:
            return f"failed, but left {sorted(new)}"
        return None

    def learn(self, words, given, before):
        """Remember what worked, and give what it made to others."""
        known = self.worked.setdefault(words, [])
        known.append(given)
        del known[:-12]
        for path in sorted(Path().glob("new*")):
            if path.is_file() and str(path) not in before and path.stat().st_size < 10**6:
                self.harvested += 1
                if not is_large(path):
                    self.add(f"made{self.harvested % 30}{path.suffix}", path.read_bytes())


def is_large(path):
    """Whether a picture is beyond a megapixel, which may take a command longer than a case may take."""
    try:
        with Image.open(path) as picture:
            return picture.width * picture.height > 1_000_000
    except (OSError, Image.DecompressionBombError):
        return False


if __name__ == "__main__":
    home = Path("home").absolute()
    home.mkdir()
    os.environ |= {"HOME": str(home), "XDG_CONFIG_HOME": str(home), "PATH": str(home)}
    os.environ.pop("GIMP3_DIRECTORY", None)
    TEMPORARY.mkdir()
    tempfile.tempdir = os.environ["TMPDIR"] = str(TEMPORARY)
    sys.stdin = io.StringIO()
    fuzzer = Fuzzer(int(sys.argv[1]))
    for index in range(int(sys.argv[2])):
        fuzzer.run(index)
