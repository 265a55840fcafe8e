"""``toposeam batch``: many runs of another command, from a file of jobs or from patterns."""

import json
import os
import pty
import resource
import shlex
import signal
import subprocess
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from processes import descendants, living

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

PATTERNS = ("left_*.png", "right_*.png", "--overlap", "20", "-o", "out/{name}.png")


@pytest.fixture
def pairs(folder, photographs):
    """Four pairs of pictures, left_0.png and right_0.png to left_3.png and right_3.png, no two the same."""
    for index in range(4):
        for name, pixels in zip(("left", "right"), photographs, strict=True):
            write_picture(folder / f"{name}_{index}.png", Picture(pixels=np.roll(pixels, 3 * index, axis=0)))
    return folder


def table(path):
    return {row["name"]: row for row in map(json.loads, Path(path).read_text().splitlines())}


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def write_jobs(text, name="jobs.toml"):
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_text(textwrap.dedent(text))
    return name


@pytest.mark.medium
def test_patterns_make_one_picture_for_each_pair(toposeam, pairs):
    ran = toposeam("batch", *PATTERNS, "-j", 2)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("4 done in ")
    assert sorted(contents(pairs / "out")) == ["0.png", "1.png", "2.png", "3.png"]
    assert toposeam("stitch", "left_2.png", "right_2.png", "--overlap", "20", "-o", "alone.png").code == 0
    assert (pairs / "alone.png").read_bytes() == (pairs / "out" / "2.png").read_bytes()
    rows = table("batch.results.jsonl")
    assert list(rows) == [f"out/{index}.png" for index in range(4)]
    assert all(row["status"] == "done" and row["seconds"] > 0 for row in rows.values())


@pytest.mark.medium
def test_the_same_bytes_whatever_the_number_of_processes(toposeam, pairs):
    extra = ("--labels", "{to}/{name}-labels.png", "--overlay", "{to}/{name}-seam.png")
    for processes in (1, 3):
        words = [
            word.replace("{to}", f"out{processes}") for word in (*PATTERNS[:-1], "{to}/{name}.png", *extra)
        ]
        assert toposeam("batch", *words, "-j", processes, "--results", f"{processes}.jsonl").code == 0
    assert len(contents(pairs / "out1")) == 12
    assert contents(pairs / "out1") == contents(pairs / "out3")


@pytest.mark.medium
def test_what_is_missing_or_broken_fails_alone(toposeam, pairs):
    (pairs / "right_1.png").unlink()
    (pairs / "left_2.png").write_bytes((pairs / "left_2.png").read_bytes()[:300])
    ran = toposeam("batch", *PATTERNS)
    assert ran.code == 1
    first, second = sorted(ran.err.splitlines())
    assert first.startswith("out/1.png: there is no file")
    assert second.startswith("out/2.png: cannot read")
    assert ran.out.startswith("2 done, 2 failed in ")
    assert sorted(contents(pairs / "out")) == ["0.png", "3.png"]
    assert table("batch.results.jsonl")["out/1.png"]["message"] in first


@pytest.mark.medium
def test_the_same_again_tries_only_what_failed(toposeam, pairs):
    hidden = (pairs / "right_1.png").rename(pairs / "hidden")
    assert toposeam("batch", *PATTERNS).code == 1
    before = {path.name: path.stat().st_mtime_ns for path in (pairs / "out").iterdir()}
    hidden.rename(pairs / "right_1.png")
    again = toposeam("batch", *PATTERNS)
    assert again.code == 0
    assert again.out.startswith("1 done, 3 done before in ")
    assert (
        before.items() <= {path.name: path.stat().st_mtime_ns for path in (pairs / "out").iterdir()}.items()
    )
    assert toposeam("batch", *PATTERNS, "--force").out.startswith("0 done, 4 done before in ")
    assert toposeam("batch", *PATTERNS, "--force", "--fresh").out.startswith("4 done in ")


@pytest.mark.medium
def test_a_changed_picture_named_in_a_layout_is_joined_again(toposeam, pairs):
    Path("layout.toml").write_text(
        '[[layer]]\nfile = "left_0.png"\nat = [0, 0]\n[[layer]]\nfile = "right_0.png"\nat = [36, 0]\n'
    )
    jobs = write_jobs('[[stitch]]\npictures = ["layout.toml"]\noutput = "joined.png"\nforce = true\n')
    assert toposeam("batch", jobs).out.startswith("1 done in")
    before = Path("joined.png").read_bytes()
    assert toposeam("batch", jobs).out.startswith("0 done, 1 done before")
    Path("right_0.png").write_bytes(Path("right_3.png").read_bytes())
    assert toposeam("batch", jobs).out.startswith("1 done in")
    assert Path("joined.png").read_bytes() != before


@pytest.mark.medium
def test_files_that_exist_are_kept_without_force(toposeam, pairs):
    (pairs / "out").mkdir()
    (pairs / "out" / "1.png").write_text("precious")
    ran = toposeam("batch", *PATTERNS)
    assert ran.code == 1
    assert "out/1.png' exists already; pass --force" in ran.err
    assert (pairs / "out" / "1.png").read_text() == "precious"
    assert toposeam("batch", *PATTERNS, "--force").out.startswith("1 done, 3 done before in ")
    assert read_picture(pairs / "out" / "1.png").pixels.shape == (40, 92, 3)


@pytest.mark.medium
def test_a_file_of_jobs_says_everything_the_command_line_can(toposeam, pairs):
    jobs = write_jobs(
        """
        [defaults]
        overlap = "20px"
        match-tones = true

        [[stitch]]
        pictures = ["../left_0.png", "../right_0.png"]
        output = "joined/zero.png"
        seam = "joined/zero.svg"

        [[stitch]]
        name = "one"
        first = "../left_1.png"
        second = "../right_1.png"
        overlap = false          # takes the default back
        offset = [36, 0]
        method = "shortest-path"
        match-tones = false
        output = "joined/one.png"

        [[stitch]]
        pictures = ["../left_*.png", "../right_*.png"]
        output = "joined/all-{name}.tif"

        [[stitch]]
        pictures = ["../left_0.png", "../right_0.png", "../right_0.png"]
        at = [[0, 0], [36, 0], [36, 5]]
        overlap = false
        output = "joined/three.png"
        """,
        "work/jobs.toml",
    )
    assert toposeam("batch", jobs).code == 0
    zero, one, all_two = (
        ("--overlap", "20", "--match-tones"),
        ("--offset", "36,0", "--method", "shortest-path"),
        ("--overlap", "20", "--match-tones"),
    )
    for index, options, made in ((0, zero, "zero.png"), (1, one, "one.png"), (2, all_two, "all-2.tif")):
        alone = f"alone{Path(made).suffix}"
        assert (
            toposeam(
                "stitch", f"left_{index}.png", f"right_{index}.png", *options, "-o", alone, "--force"
            ).code
            == 0
        )
        assert Path(alone).read_bytes() == (pairs / "work" / "joined" / made).read_bytes()
    names = ["joined/zero.png", "one", *(f"joined/all-{index}.tif" for index in range(4)), "joined/three.png"]
    rows = table("work/jobs.results.jsonl")
    assert list(rows) == names
    assert "92 × 45 px" in rows["joined/three.png"]["result"]["report"]
    assert (pairs / "work" / "joined" / "zero.svg").exists()


@pytest.mark.medium
def test_a_dry_run_prints_commands_that_do_the_same(toposeam, pairs):
    assert toposeam("batch", "left_0*.png", "right_0*.png", *PATTERNS[2:-1], "out/0{name}.png").code == 0
    ran = toposeam("batch", *PATTERNS, "--dry-run")
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert len(lines) == 4
    assert sorted(contents(pairs / "out")) == ["0.png"]
    assert toposeam(*shlex.split(lines[3])[1:]).code == 0
    assert sorted(contents(pairs / "out")) == ["0.png", "3.png"]


def test_commands_are_the_same_after_a_batch(toposeam, pairs):
    assert toposeam("batch", *PATTERNS, "--dry-run").code == 0
    assert toposeam("stitch", "-h").code == 0


@pytest.mark.medium
def test_brackets_in_names_are_no_patterns(toposeam, pairs):
    for name in ("left", "right"):
        (pairs / f"{name}_1.png").rename(pairs / f"{name}_[x] 1.png")
    assert toposeam("batch", "left_[x]*.png", "right_[x]*.png", *PATTERNS[2:]).code == 0
    assert sorted(contents(pairs / "out")) == [" 1.png"]


@pytest.mark.slow
def test_two_stars_walk_through_folders(toposeam, pairs):
    for index in range(2):
        (pairs / f"set{index}").mkdir()
        for name in ("left", "right"):
            (pairs / f"{name}_{index}.png").rename(pairs / f"set{index}" / f"{name}.png")
    assert toposeam("batch", "set?/left.png", "set?/right.png", *PATTERNS[2:]).code == 0
    assert toposeam("batch", "**/left.png", "**/right.png", *PATTERNS[2:-1], "deep/{name}.png").code == 0
    assert contents(pairs / "out") == {
        "0.png": (pairs / "deep" / "set0.png").read_bytes(),
        "1.png": (pairs / "deep" / "set1.png").read_bytes(),
    }


ENTRY = '\n[[stitch]]\nfirst = "left_0.png"\nsecond = "right_0.png"\noverlap = "20px"\noutput = "x.png"\n'


@pytest.mark.parametrize(
    ("text", "phrases"),
    [
        (
            '[[edit]]\npictures = ["a_left.png"]\noutput = "o.png"\n',
            ["edit", "nothing to be done in a batch"],
        ),
        ("[[stitch]]\nfirst = \n", ["not TOML", "line 2"]),
        ("\n\nfirst = 'a\n", ["not TOML", "end of document"]),
        ("a = 1\na = 2\n", ["not TOML", "line 2"]),
        (b"[[stitch]]\nfirst = '\xff'\n", ["not UTF-8", "line 2"]),
        ("x = " + "[" * 5000, ["nested too deep"]),
        ("", ["asks for nothing"]),
        ("[defaults]\nmethod = 'dp'\n", ["asks for nothing"]),
        ("defaults = 3\n" + ENTRY, ["line 1", "[defaults]"]),
        (ENTRY + "\n[[stich]]\nfirst = 'a.png'\n", ["line 8", "'stich'", "[[stitch]]"]),
        ("\n[stitch]\nfirst = 'a.png'\n", ["line 2", "double brackets"]),
        ("stitch = 3\n", ["line 1", "double brackets"]),
        (
            ENTRY + ENTRY.replace("x.png", "y.png") + "ofset = '3,4'\n",
            ["line 8", "no option 'ofset'", "offset"],
        ),
        ("[defaults]\nmehtod = 'dp'\n" + ENTRY, ["line 2", "'mehtod'"]),
        (ENTRY.replace('"20px"', '"120%"'), ["line 2", "--overlap", "120%"]),
        (ENTRY.replace('"20px"', "true"), ["line 2", "overlap", "True"]),
        (ENTRY.replace('"20px"', "[]"), ["line 2", "overlap"]),
        (ENTRY.replace('"20px"', "{a = 1}"), ["line 2", "overlap"]),
        (ENTRY.replace('"20px"', "1979-05-27"), ["line 2", "overlap"]),
        (ENTRY + "match-tones = 'yes'\n", ["line 2", "match-tones", "true or false"]),
        (ENTRY + "match-tones = true\nmatch_tones = true\n", ["line 2", "twice"]),
        (ENTRY + "pictures = 3\n", ["line 2", "a list of files"]),
        (ENTRY + "pictures = ['a.png']\n", ["line 2", "'first'", "twice"]),
        (ENTRY + "at = [[0, true]]\n", ["line 2", "at is"]),
        (ENTRY + "name = 3\n", ["line 2", "name is 3"]),
        (ENTRY.replace('output = "x.png"', ""), ["line 2", "--output"]),
        (ENTRY + ENTRY, ["two jobs are called 'x.png'"]),
        (ENTRY + ENTRY + "name = 'other'\n", ["'x.png' and 'other' both write", "an output of its own"]),
        (
            ENTRY + ENTRY.replace("left_0.png", "x.png").replace('output = "x', 'output = "y'),
            ["'y.png' reads", "'x.png' writes"],
        ),
        (ENTRY.replace("x.png", "left_0.png"), ["itself writes"]),
        (ENTRY.replace("_0", "_*"), ["line 2", "{name}"]),
        (ENTRY.replace("left_0", "lost_*"), ["line 2", "'lost_*.png'"]),
    ],
)
def test_an_invalid_job_file_is_refused_before_any_work(toposeam, pairs, text, phrases):
    Path("jobs.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    before = sorted(path.name for path in pairs.iterdir())
    ran = toposeam("batch", "jobs.toml")
    ran.fails(phrases[0])
    for phrase in phrases:
        assert phrase in ran.err, ran
    assert sorted(path.name for path in pairs.iterdir()) == before


@pytest.mark.parametrize(
    ("line", "phrase", "code"),
    [
        ("jobs.toml", "there is no file 'jobs.toml'", 1),
        ("jobs.toml --overlap 25%", "'--overlap' cannot be used with a file of jobs", 2),
        ("'lost_*.png' 'right_*.png' --overlap 25% -o {name}.png", "no file matches 'lost_*.png'", 1),
        ("left_0.png right_0.png --overlap 25% -o {name}.png", "none of the inputs is a pattern", 1),
        ("left_0.png left_1.png right_0.png right_1.png --overlap 25% -o {name}.png", "in quotes", 1),
        ("'left_*.png' 'right_*_*.png' --overlap 25% -o {name}.png", "no file matches 'right_*_*.png'", 1),
        ("'l*_*.png' 'right_*.png' --overlap 25% -o {name}.png", "different numbers of wildcards", 1),
        ("'left_*.png' 'right_*.png' --overlap 25% -o out.png", "put {name} into each output", 1),
        ("'left_*.png' 'right_*.png' --overlap 25% --nonsense -o {name}.png", "--nonsense", 2),
        (
            "'left_*.png' 'right_*.png' --overlap 25%",
            "Error: Missing option '-o' / '--output'; every job needs it",
            1,
        ),
        ("'left_*.png' --command compare", "choose one of", 1),
        (
            "'left_*.png' 'right_*.png' --overlap 25% -o {name}.png --results left_0.png",
            "choose another file",
            1,
        ),
        ("'left_*.png' 'right_*.png' --overlap 25% -o {name}.png -j 0", "-j", 2),
        ("'left_*.png' 'right_*.png' --overlap 25% -o {name}.png --dask nowhere", "nowhere", 1),
    ],
)
def test_a_command_line_that_makes_no_sense_is_one_sentence(toposeam, pairs, line, phrase, code):
    before = contents(pairs)
    toposeam("batch", *shlex.split(line)).fails(phrase, code)
    assert contents(pairs).items() >= before.items()


@pytest.mark.slow
def test_a_disk_that_fills_costs_only_what_does_not_fit(started, pairs):
    for name in ("left_2", "right_2"):  # noise, which does not compress
        write_picture(
            f"{name}.png",
            Picture(pixels=np.random.default_rng(0).integers(0, 256, (90, 90, 3), np.uint8)),
            force=True,
        )

    def leave_little_space():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    ran = started("batch", *PATTERNS, "-j", 2, preexec_fn=leave_little_space)
    assert (ran.code, ran.out[:16]) == (1, "3 done, 1 failed"), ran
    assert ran.err.startswith("out/2.png: cannot write"), ran
    assert "free some space" in ran.err
    assert sorted(path.name for path in (pairs / "out").iterdir()) == ["0.png", "1.png", "3.png"]
    assert started("batch", *PATTERNS).out.startswith("1 done, 3 done before")


@pytest.mark.medium
def test_a_terminal_shows_progress_and_ctrl_c_how_to_resume(process, pairs):
    large = np.tile(read_picture("left_0.png").pixels, (5, 5, 1))
    for name in ("left_1", "right_1", "left_2", "right_2"):
        write_picture(f"{name}.png", Picture(pixels=large), force=True)
    (pairs / "right_0.png").unlink()
    ours, theirs = pty.openpty()
    words = ("left_*.png", "right_*.png", "--overlap", "20%", "--method", "thesis", "-o", "out/{name}.png")
    with process("batch", *words, "-j", 2, stderr=theirs) as child:
        os.close(theirs)
        seen = b""
        while b"there is no file" not in seen:
            seen += os.read(ours, 4096)
        child.send_signal(signal.SIGINT)
        while b"unfinished" not in seen:
            seen += os.read(ours, 4096)
        assert child.wait(60) == 130
    os.close(ours)
    text = seen.decode()
    assert "Traceback" not in text
    assert " 1 failed" in text
    assert "of 4 jobs have ended; run the same again to go on." in text
    assert not list(pairs.glob("**/*.part"))


@pytest.mark.medium
def test_ctrl_c_on_a_terminal_while_workers_start_is_quiet(process, pairs):
    with process("batch", *PATTERNS, "-j", 2, stderr=subprocess.PIPE, start_new_session=True) as child:
        while (
            not (pairs / "batch.results.jsonl").exists() or not (pairs / "batch.results.jsonl").stat().st_size
        ):
            time.sleep(0.005)
        time.sleep(0.1)
        os.killpg(child.pid, signal.SIGINT)
        said = child.stderr.read().decode()
        assert child.wait(60) == 130
    assert said.splitlines()[-2:] == [
        "0 of 4 jobs have ended; run the same again to go on.",
        "Interrupted; no file was left unfinished.",
    ]
    assert "Traceback" not in said


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_batch_resumes_and_leaves_no_partial_files(process, started, pairs, end):
    with process("batch", *PATTERNS[:-1], "out/{name}.png", "--method", "thesis") as child:
        deadline = time.monotonic() + 60
        while (
            len(list(pairs.glob("out/?.png"))) < 2
        ):  # the row of the first is written before the second begins
            assert time.monotonic() < deadline
            time.sleep(0.01)
        workers = {one.number for one in descendants(child.pid)}
        child.send_signal(end)
        child.wait(60)
    for path in (pairs / "out").glob("?.png"):
        assert read_picture(path).pixels.shape == (40, 92, 3)
    deadline = time.monotonic() + 60
    while workers & {one.number for one in living()}:  # until the worker knows that its parent is gone
        assert time.monotonic() < deadline, "a worker outlived its parent"
        time.sleep(0.01)
    ran = started("batch", *PATTERNS[:-1], "out/{name}.png", "--method", "thesis")
    assert ran.code == 0, ran
    assert "done before" in ran.out
    assert sorted(contents(pairs / "out")) == [f"{index}.png" for index in range(4)]


@pytest.mark.parametrize("output", ["loop.png", "loop.png/o.png", "o.png"])
def test_links_that_lead_to_themselves_are_a_sentence(toposeam, tmp_path, monkeypatch, output):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    (tmp_path / "jobs.toml").write_text(
        f'[[stitch]]\npictures = ["loop.png", "b.png"]\noverlap = 20\noutput = "{output}"\n'
    )
    ran = toposeam("batch", "jobs.toml")
    assert ran.code == 1
    assert "inside TopoSeam" not in ran.err + ran.out
    assert len(ran.err.splitlines()) + len(ran.out.splitlines()) >= 1
