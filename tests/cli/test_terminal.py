"""Help, version, completion, and what is seen on a terminal and off."""

import io
import os
import pty
import subprocess
import sys
from contextlib import redirect_stderr

import pytest

import toposeam as ts
from stitching import STRIP, names
from toposeam_cli.app.progress import progress_bar
from toposeam_cli.jobs.runner import Progress


@pytest.mark.parametrize(
    ("shell", "sign"),
    [("bash", "complete -o nosort"), ("zsh", "#compdef toposeam"), ("fish", "complete --no-files")],
)
def test_completion_prints_the_script_of_a_shell(toposeam, shell, sign):
    ran = toposeam("completion", shell)
    assert ran.code == 0
    assert sign in ran.out
    assert "_TOPOSEAM_COMPLETE" in ran.out


@pytest.mark.medium
def test_the_shell_is_told_commands_options_and_choices(started):
    told = {}
    for words in ("toposeam ", "toposeam stitch --me", "toposeam stitch --method h"):
        env = {
            "_TOPOSEAM_COMPLETE": "bash_complete",
            "COMP_WORDS": words,
            "COMP_CWORD": str(len(words.split(" ")) - 1),
        }
        # Completion goes by the name of the program.
        code = "import sys; sys.argv = ['toposeam']; from toposeam_cli.app.main import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code], env=os.environ | env, capture_output=True, text=True, check=False
        )
        told[words] = done.stdout.split()
    assert {"plain,compare", "plain,completion", "plain,stitch"} <= set(told["toposeam "])
    assert told["toposeam stitch --me"] == ["plain,--method"]
    assert told["toposeam stitch --method h"] == ["plain,heat"]


@pytest.mark.parametrize("command", ["stitch", "compare", "completion"])
@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_shows_an_example(toposeam, command, flag):
    ran = toposeam(command, flag)
    assert ran.code == 0
    assert f"toposeam {command} " in ran.out
    assert command in toposeam("--help").out


def test_the_version_is_the_package_s(toposeam):
    assert toposeam("--version").out == f"toposeam, version {ts.__version__}\n"


def test_without_click_the_command_says_what_to_install():
    code = "import sys; sys.modules['click'] = None; from toposeam_cli.__main__ import start; start()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "pip install click 'pyvips[binary]', or in the checkout: pip install '.[cli]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def on_terminal(process, *arguments, env=None):
    """Run with stderr on a terminal; what it wrote there, and on stdout."""
    ours, theirs = pty.openpty()
    with process(
        *arguments,
        stdout=subprocess.PIPE,
        stderr=theirs,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "80"} | (env or {}),
    ) as child:
        os.close(theirs)
        seen = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # Linux: the other end was closed
                break
            if not part:
                break
            seen += part
        out = child.stdout.read()
    os.close(ours)
    assert child.returncode == 0
    return seen.decode(), out.decode()


@pytest.mark.medium
def test_a_bar_on_a_terminal_runs_to_the_end(folder, process):
    seen, out = on_terminal(process, "stitch", *STRIP, "-o", "out.png")
    assert "joining a.png and b.png" in seen
    assert "100%" in seen
    assert out.startswith("out.png: ")


def test_a_direct_method_ends_at_all_of_its_bar_too(folder, process):
    seen, _ = on_terminal(process, "stitch", *STRIP, "-o", "out.png", "--method", "dp")
    assert "100%" in seen


@pytest.mark.medium
def test_no_bar_in_a_pipe_and_silence_when_quiet(folder, process, started):
    ran = started("stitch", *STRIP, "-o", "out.png")
    assert (ran.code, ran.err) == (0, "")
    assert "joining" not in ran.out
    ran = started(
        "stitch",
        *STRIP,
        "-o",
        "out.png",
        "--force",
        "--quiet",
        "--overlay",
        "overlay.png",
        "--history",
        "history.pdf",
    )
    assert ran == type(ran)(0, "", "")
    assert on_terminal(process, "stitch", *STRIP, "-o", "out.png", "--force", "-q") == ("", "")


@pytest.mark.medium
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp949"])
def test_a_character_missing_from_the_encoding_stops_nothing(folder, started, encoding):
    (folder / "b.png").rename(folder / "☃.png")
    env = {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    ran = started("stitch", "a.png", "☃.png", "--overlap", "20", "-o", "☃ out.png", env=env)
    assert (ran.code, ran.err) == (0, "")
    assert "92" in ran.out
    ran = started("compare", "a.png", "☃.png", "--overlap", "20", "--method", "dp", env=env)
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.medium
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_closed_stream_does_not_stop_the_work(folder, stream):
    number = {"stdout": 1, "stderr": 2}[stream]
    script = f'exec "$0" -m toposeam_cli stitch a.png b.png --overlap 20 -o out.png {number}>&-'
    done = subprocess.run(["sh", "-c", script, sys.executable], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert names(folder) == ["a.png", "b.png", "out.png"]


def test_the_history_can_be_an_animation(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "out.png", "--history", "found.GIF").code == 0
    assert (folder / "found.GIF").read_bytes().startswith(b"GIF89a")
    assert "found.avi" in toposeam("stitch", *STRIP, "-o", "c.png", "--history", "found.avi").err
    assert names(folder) == ["a.png", "b.png", "found.GIF", "out.png"]


class Screen(io.StringIO):
    """A terminal that carries out the carriage returns and the two codes that click writes."""

    def isatty(self):
        return True

    def lines(self):
        shown = []
        for line in self.getvalue().replace("\033[?25l", "").replace("\033[?25h", "").split("\n"):
            row = ""
            for part in line.split("\r"):
                row = part + row[len(part) :]
            shown.append(row.rstrip())
        return shown


def test_the_bar_of_a_batch_stays_below_its_messages(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with redirect_stderr(Screen()) as screen, progress_bar() as bar:
        bar.report(Progress(0, 4, 0, 0.0, None))
        assert screen.lines() == ["[" + 30 * "-" + "]    0%  0 of 4"]
        bar.report(Progress(2, 4, 0, 0.5, 3665.2))
        bar.say("b: there is no file")
        bar.report(Progress(2, 4, 1, 0.5, None))
        assert screen.lines() == ["b: there is no file", f"[{15 * '#'}{15 * '-'}]   50%  2 of 4, 1 failed"]
        bar.say("한글: there is no file either")
        bar.report(Progress(4, 4, 2, 1.0, 0.0))
    assert screen.lines()[1:] == [
        "한글: there is no file either",
        f"[{30 * '#'}]  100%  4 of 4, 2 failed, 0:00:00 left",
        "",
    ]
    assert "2 of 4, 1:01:05 left" in screen.getvalue()


@pytest.mark.parametrize("columns", [50, 30, 12, 5])
def test_the_bar_of_a_batch_fits_a_narrow_terminal(monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    with redirect_stderr(Screen()) as screen, progress_bar() as bar:
        bar.report(Progress(2, 4, 1, 0.5, 60.0))
        bar.say("")
        bar.report(Progress(3, 4, 1, 0.75, 60.0))
    assert "75%" in screen.lines()[1]
    assert max(len(line) for line in screen.lines()) < max(columns, 10)


def test_an_interrupted_bar_shows_the_cursor_again():
    class Interrupted(Screen):
        def flush(self):
            if "\033[?25h" not in self.getvalue():
                raise KeyboardInterrupt

    with redirect_stderr(Interrupted()) as screen, pytest.raises(KeyboardInterrupt), progress_bar():
        pytest.fail("it was drawn")
    assert screen.getvalue().endswith("\033[?25h\n")


@pytest.mark.parametrize("quiet", [False, True])
def test_a_batch_off_the_terminal_or_quiet_has_messages_only(monkeypatch, capsys, quiet):
    if quiet:
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with progress_bar(quiet) as bar:
        bar.report(Progress(2, 4, 1, 0.5, 60.0))
        bar.say("b: there is no file")
    assert capsys.readouterr().err == "b: there is no file\n"
