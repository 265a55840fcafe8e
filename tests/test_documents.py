"""The documents: links lead somewhere, pictures are not older than the code, commands and code run."""

import itertools
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import click
import pytest

from toposeam_cli.app.main import main

HERE = Path(__file__).parents[1]
DOCUMENTS = sorted(
    path
    for path in [*HERE.glob("*.md"), *HERE.glob("docs/**/*.md"), *HERE.glob("*/README.md")]
    if not {"build", ".venv"} & set(path.relative_to(HERE).parts)
)
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)\s]*)\)")
HEADING = re.compile(r"^#+ +(.+)$", re.MULTILINE)
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
#: Options that name a file to be written.
WRITES = {"-o", "--overlay", "--seam", "--preview", "--history", "--save-layout", "--report", "--mesh"}
TUTORIALS = sorted(HERE.glob("docs/tutorials/*.md"))


def script(name):
    spec = spec_from_file_location(Path(name).stem, HERE / name)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def anchors(text):
    """The anchors of a document, as GitHub makes them."""
    headings = HEADING.findall(FENCE.sub("", text))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def test_nobody_is_sent_to_an_index_for_our_name():
    """No index has TopoSeam; who takes the name there is a stranger."""
    sent = re.compile(
        r"toposeam\[(?!\w+\] @ )|toposeam *[=<>]=|(pipx?|uvx?|tool) (install|run) +(-\S+ +)*['\"]?toposeam\b",
        re.I,
    )
    told = [path for room in ("core", "cli", "plugin_gimp", "tools") for path in (HERE / room).rglob("*.py")]
    for path in [*DOCUMENTS, *told]:
        found = sent.search(path.read_text(encoding="utf-8"))
        assert found is None, (path, found)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(HERE).as_posix())
def test_links_lead_somewhere(document):
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    dead = []
    for link in LINK.findall(text):
        name, _, anchor = link.partition("#")
        target = document.parent / name if name else document
        if not target.exists() or (
            anchor and target.suffix == ".md" and anchor not in anchors(target.read_text(encoding="utf-8"))
        ):
            dead.append(link)
    assert not dead


def test_every_document_is_in_the_navigation_of_the_site():
    index = (HERE / "docs/index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^(?:.* <)?([\w./-]+)>?$", index, re.MULTILINE))
    pages = {path.relative_to(HERE / "docs").with_suffix("").as_posix() for path in HERE.glob("docs/**/*.md")}
    assert pages - {"index"} <= listed


def test_every_picture_is_shown_and_made_by_a_script():
    made = script("docs/made.py")
    drawn = {name for which in made.SCRIPTS for name in made.pictures(which)}
    there = {path.name for path in (HERE / "docs/figures").iterdir()} - {"made.json"}
    assert there - drawn == set(), "add the script that draws it to docs/made.py"
    shown = "".join(path.read_text(encoding="utf-8") for path in DOCUMENTS)
    assert not {name for name in there if f"figures/{name}" not in shown}


@pytest.mark.parametrize("name", sorted(script("docs/made.py").SCRIPTS))
def test_no_picture_is_older_than_the_code_it_shows(name):
    made = script("docs/made.py")
    stored = json.loads(made.TABLE.read_text(encoding="utf-8"))[name]
    remedy = f"run docs/{name}, look at the pictures, then: python docs/made.py {name}"
    assert stored["pictures"] == made.pictures(name), f"pictures changed by something else; {remedy}"
    assert stored["code"] == made.fingerprint(name), f"the code has changed since; {remedy}"


def commands(text):
    """What follows ``toposeam`` in the lines of a document's blocks of commands."""
    for language, code in re.findall(r"^ *```(\S*)\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL):
        if language not in ("sh", "console", ""):
            continue
        for line in code.replace("\\\n", " ").splitlines():
            if re.match(r"(\$ )?(\S*/)?toposeam \w", line):
                words = shlex.split(line.removeprefix("$ "), comments=True)[1:]
                yield list(itertools.takewhile(lambda word: word != ">", words))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(HERE).as_posix())
def test_no_command_of_a_page_ends_at_what_an_earlier_one_wrote(document):
    written = set()
    for words in commands(document.read_text(encoding="utf-8")):
        names = {name for option, name in itertools.pairwise(words) if option in WRITES}
        assert not names & written or "--force" in words, words
        written |= names


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(HERE).as_posix())
def test_every_command_in_a_document_is_one_that_there_is(document):
    """With its options and their values; whether its files are there is not asked."""
    for words in commands(document.read_text(encoding="utf-8")):
        command, said = main, []
        while isinstance(command, click.Group):
            command = command.get_command(click.Context(command), words[0])
            assert command is not None, words
            said.append(words.pop(0))
        command.make_context(" ".join(said), list(words))


def test_every_measurement_names_the_commit_that_was_measured():
    """One for all that `benchmarks/results.py` writes, without changes beyond it; the others their own."""
    top, *sections = (HERE / "docs/results.md").read_text(encoding="utf-8").split("\n## ")
    assert re.search(r"at commit [0-9a-f]{8};", top)
    named = re.compile(r"\bat commit `?[0-9a-f]{8}\b|written by benchmarks/results.py, ", re.IGNORECASE)
    assert not [text.splitlines()[0] for text in sections if not named.search(text)]
    scripts = [path for path in HERE.glob("benchmarks/*.py") if "__main__" in path.read_text("utf-8")]
    assert not [path.name for path in scripts if "print(stamp())" not in path.read_text(encoding="utf-8")]


@pytest.fixture
def beside_the_samples(tmp_path, monkeypatch):
    (tmp_path / "samples").symlink_to(HERE / "samples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


#: Lines that set TopoSeam up; README's run on fresh systems (platforms/debian.sh, gimp/test_installed.py).
SETTING_UP = re.compile(r"(make|python3 -m venv|uv|pipx) |\S+/pip install |\S+/toposeam gimp install")


def shown_code(document):
    """The lines of shell and the blocks of Python of a document, in order."""
    text = document.read_text(encoding="utf-8")
    for language, code in re.findall(r"^```(sh|python)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for part in [code] if language == "python" else code.splitlines():
            if language == "python" or not SETTING_UP.match(part):
                yield language, part


def run_shell(line, environment=None):
    """Run a line of a document, which must succeed and write what it says."""
    command, *words = shlex.split(line, comments=True)
    assert command in ("toposeam", ".venv/bin/toposeam"), line
    done = subprocess.run(
        [sys.executable, "-P", "-m", "toposeam", *words],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    assert done.returncode == 0, f"{line}\n{done.stderr}"
    for option in ("-o", "--overlay", "--seam", "--preview"):
        if option in words:
            assert Path(words[words.index(option) + 1]).stat().st_size > 0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_readme_runs_from_a_wheel(beside_the_samples, tmp_path_factory):
    """What the checkout has and the wheel lacks would be missed here."""
    built, installed = tmp_path_factory.mktemp("built"), tmp_path_factory.mktemp("installed")
    words = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", built, HERE]
    subprocess.run(words, check=True, capture_output=True)
    (wheel,) = built.glob("*.whl")
    shutil.unpack_archive(wheel, installed, "zip")
    environment = os.environ | {"PYTHONPATH": str(installed)}
    python = [sys.executable, "-P", "-c"]
    asked = "import toposeam, toposeam_cli; print(toposeam.__file__, toposeam_cli.__file__)"
    files = subprocess.check_output([*python, asked], env=environment, text=True).split()
    assert all(Path(file).is_relative_to(installed) for file in files)
    for language, code in shown_code(HERE / "README.md"):
        if language == "python":
            subprocess.run([*python, code], check=True, env=environment)
        else:
            run_shell(code, environment)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_readme_and_tutorials_run_in_one_folder(beside_the_samples):
    """Every line of shell and of Python, in order, as somebody would who copies them."""
    for document in (HERE / "README.md", *TUTORIALS):
        names, ran = {}, 0
        for language, code in shown_code(document):
            if language == "python":
                exec(compile(code, document.name, "exec"), names)  # noqa: S102 - our own document
            else:
                run_shell(code)
                ran += 1
        assert ran or names or document.stem == "gimp", document
