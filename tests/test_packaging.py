"""What is shipped: the version, wheel and source archive, the text on a package index, the release."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import textwrap
import tomllib
import zipfile
from datetime import date
from email.parser import BytesParser
from html.parser import HTMLParser
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]
MARKDOWN_LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)")


def script(name):
    spec = spec_from_file_location(Path(name).stem, HERE / name)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The names in the wheel and in the source archive (without its first folder), and the metadata."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, HERE],
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    (archive,) = folder.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as file:
        inside = set(file.namelist())
        (metadata,) = (name for name in inside if name.endswith(".dist-info/METADATA"))
        message = BytesParser().parsebytes(file.read(metadata))
    with tarfile.open(archive) as file:
        source = {name.partition("/")[2] for name in file.getnames()}
    return inside, source, message


def test_the_version_is_the_same_wherever_it_is_said():
    assert len(set(script("tools/release.py").stated_versions().values())) == 1


def test_a_release_dates_the_newest_version_and_no_other():
    dated = script("tools/release.py").dated
    text = "# Changelog\n\n## 0.3.0 (unreleased)\n\n- a\n\n## 0.2.0 (2026-11-21)\n"
    assert dated(text, date(2027, 1, 2)) == text.replace("unreleased", "2027-01-02")
    with pytest.raises(ValueError, match="no unreleased version"):
        dated(text.replace("unreleased", "2027-01-01"), date(2027, 1, 2))
    with pytest.raises(ValueError, match="is not newer"):
        dated(text.replace("0.2.0", "0.3.0"), date(2027, 1, 2))


@pytest.fixture
def release(tmp_path, monkeypatch, capsys):
    """`make release` in a small checkout, where builds are only noted down."""
    if shutil.which("git") is None:
        pytest.skip("there is no git")
    module = script("tools/release.py")
    for name in module.stated_versions():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "core/toposeam/__init__.py").write_text('__version__ = "0.3.0"\n')
    (tmp_path / "plugin_gimp/toposeam_gimp/__init__.py").write_text('__version__ = "0.3.0"\n')
    (tmp_path / "CITATION.cff").write_text("version: 0.3.0\n")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 0.3.0 (unreleased)\n\n- a\n")
    (tmp_path / ".gitignore").write_text("dist/\n")

    def git(*words):
        who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
        subprocess.run(["git", "-C", tmp_path, *who, *words], check=True, capture_output=True)

    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "-m", "a")
    ran = []

    def built(*arguments):
        ran.append(arguments[:2])
        (tmp_path / "dist").mkdir(exist_ok=True)
        (tmp_path / "dist/a.whl").write_bytes(b"")

    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "_run", built)

    class Release:
        folder, run, did = tmp_path, staticmethod(git), ran

        def __call__(self):
            code = module.main()
            return code, capsys.readouterr()

        def cannot(self, *_):
            raise subprocess.CalledProcessError(1, "twine")

        def fails(self):
            monkeypatch.setattr(module, "_run", self.cannot)

    return Release()


def test_a_release_is_built_checked_and_dated(release):
    code, said = release()
    assert code == 0
    assert release.did == [("-m", "build"), ("-m", "twine")]
    assert f"## 0.3.0 ({date.today()})" in (release.folder / "CHANGELOG.md").read_text()
    assert "git tag v0.3.0" in said.out


def test_what_is_not_committed_is_not_released(release):
    (release.folder / "forgotten.py").write_text("")
    code, said = release()
    assert (code, release.did) == (1, [])
    assert said.err == "error: not everything is committed; commit it, or put it aside\n"
    assert "unreleased" in (release.folder / "CHANGELOG.md").read_text()


def test_what_is_released_is_not_released_again(release):
    release.run("tag", "v0.3.0")
    code, said = release()
    assert (code, release.did) == (1, [])
    assert said.err == "error: v0.3.0 is released already; raise the version\n"


def test_differing_versions_and_folders_without_git_are_refused(release):
    shutil.rmtree(release.folder / ".git")
    assert "release from a clone" in release()[1].err
    (release.folder / "CITATION.cff").write_text("version: 0.2.0\n")
    assert "the version differs" in release()[1].err
    assert release.did == []


def test_a_release_that_fails_leaves_the_change_log_as_it_was(release):
    release.fails()
    code, said = release()
    assert code == 1
    assert "CHANGELOG.md is as it was" in said.err
    assert "unreleased" in (release.folder / "CHANGELOG.md").read_text()


@pytest.mark.slow
def test_the_wheel_holds_the_four_packages_and_nothing_else(built):
    inside, _, _ = built
    assert {name.split("/")[0] for name in inside if ".dist-info/" not in name} == {
        "toposeam",
        "toposeam_cli",
        "toposeam_engine",
        "toposeam_gimp",
    }
    assert not [name for name in inside if name.endswith((".po", ".pyc"))]
    assert "toposeam_gimp/locale/ko/LC_MESSAGES/toposeam_gimp.mo" in inside
    assert "toposeam_gimp/pictures/rule-p4m.png" in inside
    assert "toposeam/py.typed" in inside
    python = {
        path.relative_to(root).as_posix()
        for root in (HERE / "core", HERE / "cli", HERE / "plugin_gimp")
        for path in root.glob("toposeam*/**/*.py")
    }
    assert python <= inside


@pytest.mark.slow
@pytest.mark.parametrize("wanted", ["1", "0"])
def test_a_wheel_with_kernels_fits_one_system(tmp_path, monkeypatch, wanted):
    """That without them, as where there is no compiler, fits all."""
    monkeypatch.setenv("TOPOSEAM_KERNELS", wanted)
    words = [sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", tmp_path, HERE]
    subprocess.run(words, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        for name in file.namelist():
            file.extract(name, tmp_path)
    libraries = list(tmp_path.glob("toposeam/_kernels/kernels-*"))
    if wanted == "1" and not libraries and script("hatch_build.py").build() is None:
        pytest.skip("there is no C compiler")
    assert len(libraries) == int(wanted)
    assert wheel.name.endswith("py3-none-any.whl") == (wanted == "0")
    assert (tmp_path / "toposeam/_kernels/flow.c").exists()
    code = "from toposeam import _kernels; print(_kernels.library is not None, _kernels.__file__)"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "TOPOSEAM_KERNELS": "1"}
    told = subprocess.check_output([sys.executable, "-c", code], text=True, env=environment, cwd=tmp_path)
    assert told.split() == [str(wanted == "1"), str(tmp_path / "toposeam/_kernels/__init__.py")]


@pytest.mark.slow
def test_the_source_archive_holds_documents_pictures_and_tests(built):
    _, source, _ = built
    for document in [*sorted(HERE.glob("docs/**/*.md")), HERE / "README.md", HERE / "samples/README.md"]:
        assert document.relative_to(HERE).as_posix() in source
        for link in MARKDOWN_LINK.findall(document.read_text(encoding="utf-8")):
            target = (document.parent / link).resolve().relative_to(HERE)
            assert target.as_posix() in source or any(
                name.startswith(f"{target.as_posix()}/") for name in source
            ), f"{document.name}: {link}"
    assert {"tests/test_house.py", "CITATION.cff", "SECURITY.md", "LICENSE", "samples/demo.py"} <= source
    assert {"hatch_build.py", "core/toposeam/_kernels/flow.c"} <= source
    assert not [name for name in source if name.startswith("core/toposeam/_kernels/kernels-")]


@pytest.mark.slow
def test_the_readme_renders_on_pypi_with_absolute_links_only(built):
    from readme_renderer import markdown

    _, _, message = built
    assert message["Description-Content-Type"] == "text/markdown"
    html = markdown.render(message.get_payload())
    assert html is not None

    targets = []

    class Targets(HTMLParser):
        def handle_starttag(self, tag, attrs):
            targets.extend(value for name, value in attrs if name in ("href", "src"))

    Targets().feed(html)
    assert not [target for target in targets if not target.startswith(("https://", "#"))]
    assert "<h2" in html
    assert "docs/gimp.md" in html  # as words: that is where the source archive has it


def test_the_installation_is_told_truly():
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert all(re.search(r">=\d", wanted) for wanted in project["dependencies"])
    assert not [wanted for wanted in project["dependencies"] if "maxflow" in wanted.lower()]
    command_line = {"click", "pyvips", "qdldl", "cffi"}
    names = {re.match(r"[\w-]+", wanted)[0] for wanted in project["dependencies"]}
    assert not names & command_line
    assert {"click", "pyvips"} <= {
        re.match(r"[\w-]+", wanted)[0] for wanted in project["optional-dependencies"]["cli"]
    }
    for extra in ("test", "bench"):
        (maxflow,) = (w for w in project["optional-dependencies"][extra] if w.startswith("PyMaxflow"))
        assert "python_version < '3.14'" in maxflow
    lowest = project["requires-python"].removeprefix(">=")
    pythons = [line.rpartition(" ")[2] for line in project["classifiers"] if "Python :: 3." in line]
    assert pythons[0] == lowest


def test_the_measured_three_commands_are_those_of_the_readme():
    install = (HERE / "README.md").read_text(encoding="utf-8").partition("\n## Install\n")[2]
    (three,) = re.findall(r"```sh\n((?:.*\n){3})```", install.partition("\n## ")[0])
    script = (HERE / "tests/platforms/debian.sh").read_text(encoding="utf-8")
    (measured,) = re.findall(r'as_user no "(python3 -m venv .venv && .*)" >>', script)
    for without in (" -q", " --no-cache-dir", " --no-index", " --find-links ../wheels"):
        measured = measured.replace(without, "")
    measured = measured.replace(".[cli]", "'.[cli]'")  # which is in quotes already there
    assert measured.split(" && ") == three.splitlines()


def test_public_ci_is_valid_and_asks_for_what_there_is():
    yaml = pytest.importorskip("yaml")
    for path in HERE.glob(".github/**/*.yml"):
        assert isinstance(yaml.safe_load(path.read_text(encoding="utf-8")), dict), path.name
    jobs = yaml.safe_load((HERE / ".github/workflows/ci.yml").read_text(encoding="utf-8"))["jobs"]
    assert {"quick", "newest", "full", "gimp"} <= set(jobs)
    matrix = jobs["quick"]["strategy"]["matrix"]
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    classifiers = (line.rpartition(" ")[2] for line in project["classifiers"])
    assert matrix["python"] == [version for version in classifiers if version.startswith("3.")]
    assert matrix["os"] == ["ubuntu-latest", "windows-latest", "macos-latest"]
    runs = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    targets = set(re.findall(r"^([a-z-]+):", (HERE / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    wanted = {word for run in runs for word in run.partition("make ")[2].split()}
    assert wanted
    assert wanted <= targets
    extras = {extra for run in runs for extra in re.findall(r"\[([a-z,]+)\]", run)}
    assert extras <= set(project["optional-dependencies"])


def test_workflows_name_their_actions_by_commit_and_version():
    for path in HERE.glob(".github/workflows/*.yml"):
        used = re.findall(r"\buses: (.*)", path.read_text(encoding="utf-8"))
        assert used, path.name
        for one in used:
            assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", one), (path.name, one)


def test_a_release_hands_out_all_there_is():
    yaml = pytest.importorskip("yaml")
    workflow = yaml.safe_load((HERE / ".github/workflows/release.yml").read_text(encoding="utf-8"))
    jobs = workflow["jobs"]
    assert set(jobs) == {"archives", "wheels", "alone", "release"}
    assert set(jobs["release"]["needs"]) == set(jobs) - {"release"}
    assert workflow["permissions"] == {"contents": "read"}
    assert [name for name, job in jobs.items() if "permissions" in job] == ["release"]
    systems = [one["system"].partition("-")[0] for one in jobs["alone"]["strategy"]["matrix"]["include"]]
    assert systems == ["linux", "windows", "macos"]
    steps = [step for job in jobs.values() for step in job["steps"]]
    kept = [step["with"]["name"] for step in steps if "upload-artifact" in step.get("uses", "")]
    assert len({name.partition("-")[0] for name in kept}) == len(kept) == 3
    runs = [step["run"] for step in steps if "run" in step]
    for path in set(re.findall(r"\b(?:core|packaging|plugin_gimp|samples|tools)/[\w./]+", "\n".join(runs))):
        assert (HERE / path).is_file(), path
    (asked,) = (run for run in runs if "GITHUB_REF_NAME#v" in run and "grep" in run)
    for version, code in ((project_version(), 0), (project_version() + "1", 1)):
        environment = os.environ | {"GITHUB_REF_NAME": f"v{version}"}
        assert subprocess.run(["sh", "-c", asked], cwd=HERE, env=environment, check=False).returncode == code


@pytest.mark.slow
def test_the_tests_are_collected_where_there_is_nothing_of_unix(tmp_path):
    """Public CI runs them on Windows, which nobody has tried."""
    (tmp_path / "without_unix.py").write_text(
        textwrap.dedent("""
            import os, signal, sys
            for name in ("resource", "pty", "fcntl", "termios", "tty", "pwd", "grp"):
                sys.modules[name] = None
            for name in ("SIGKILL", "SIGHUP", "SIGUSR1", "SIGALRM", "SIGPIPE", "SIGCHLD"):
                delattr(signal, name)
            for name in ("killpg", "getuid", "geteuid", "mkfifo", "fork"):
                delattr(os, name)
        """)
    )
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "without_unix",
            "-p",
            "no:cacheprovider",
            "--collect-only",
            "-q",
        ],
        cwd=HERE,
        env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.parametrize("document", ["NOTICE", "docs/dependencies.md"])
def test_documents_name_what_installing_brings(document):
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = ("cli", "plot", "dask", "video", "volumes", "exr", "graphcut")
    wanted = [
        *project["dependencies"],
        *(one for extra in extras for one in project["optional-dependencies"][extra]),
    ]
    names = {re.match(r"[\w-]+", one)[0].lower() for one in wanted}
    text = (HERE / document).read_text(encoding="utf-8").lower()
    assert not [name for name in names if not re.search(rf"\b{re.escape(name)}\b", text)]
    assert not [f"[{extra}]" for extra in extras if f"[{extra}]" not in text and f"`{extra}`" not in text]


def test_recipes_have_the_fields_that_are_listed():
    listed = set(
        re.findall(r"`([A-Z][A-Z\d_]{3,})`", (HERE / "packaging/README.md").read_text(encoding="utf-8"))
    )
    recipe = (HERE / "packaging/conda/recipe.yaml").read_text(encoding="utf-8")
    assert listed == set(re.findall(r"\b[A-Z\d]+_(?:URL|SHA256)\b|\bMAINTAINER\b", recipe))
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["cli"]]
    names = {re.match(r"[\w-]+", one)[0].lower(): re.search(r">=([\d.]+)", one)[1] for one in wanted}
    run = dict(re.findall(r"^    - ([\w-]+) >=([\d.]+)$", recipe.partition("  run:")[2], re.MULTILINE))
    assert run == {
        name: floor for name, floor in names.items() if name not in ("qdldl", "pi-heif")
    }  # which conda does not have
    assert f'version: "{project_version()}"' in recipe


def test_the_address_is_filled_in_everywhere_or_nowhere(tmp_path):
    makefile = (HERE / "Makefile").read_text(encoding="utf-8")
    files = re.search(r"^ADDRESSED := (.+)$", makefile, re.MULTILINE)[1].split()
    texts = {name: (HERE / name).read_text(encoding="utf-8") for name in files}
    address = tomllib.loads(texts["pyproject.toml"])["project"]["urls"]["Repository"]
    assert address == "REPOSITORY_URL" or address.startswith("https://")
    assert not [name for name, text in texts.items() if address not in text]
    left = {name for name, text in texts.items() if "REPOSITORY_URL" in text}
    assert left == (set(files) if address == "REPOSITORY_URL" else set())
    recipes = (HERE / "packaging/README.md").read_text(encoding="utf-8")
    assert not [name for name in files if f"`{name.removeprefix('packaging/')}`" not in recipes]


def test_make_fills_the_address_in(tmp_path):
    makefile = (HERE / "Makefile").read_text(encoding="utf-8")
    files = re.search(r"^ADDRESSED := (.+)$", makefile, re.MULTILINE)[1].split()
    for name in ("Makefile", *files):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("at REPOSITORY_URL.\n" if name in files else makefile, encoding="utf-8")
    subprocess.run(
        ["make", "address", "URL=https://a.example/b"], cwd=tmp_path, check=True, capture_output=True
    )
    for name in files:
        assert (tmp_path / name).read_text(encoding="utf-8") == "at https://a.example/b.\n"
        assert not (tmp_path / f"{name}.bak").exists()
    assert subprocess.run(["make", "address"], cwd=tmp_path, check=False, capture_output=True).returncode


def project_version():
    return re.search(
        r'__version__ = "(.+)"', (HERE / "core/toposeam/__init__.py").read_text(encoding="utf-8")
    )[1]


def test_the_dockerfile_installs_extras_that_there_are():
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (extras,) = re.findall(
        r"/source\[([\w,]+)\]", (HERE / "packaging/Dockerfile").read_text(encoding="utf-8")
    )
    assert set(extras.split(",")) <= set(project["optional-dependencies"])
